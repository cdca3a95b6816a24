//! Paths in a source, as text: what `use`, `crate::` and `super::` name.

/// A name that a `use` brings in: from this path, under this name (`*`: all of it).
#[derive(Debug, PartialEq)]
pub(crate) struct Used {
    pub(crate) path: Vec<String>,
    pub(crate) name: String,
}

/// A source without its comments and its own tests.
pub(crate) fn code(source: &str) -> String {
    let source = source.split("\n#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let lines = source.lines().filter(|line| !line.trim_start().starts_with("//"));
    lines.collect::<Vec<_>>().join("\n")
}

/// The paths that begin with `crate::` or `super::`, as their names; a list in braces is one path for each of its parts.
pub(crate) fn paths(code: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for start in ["crate", "super"] {
        let begin = format!("{start}::");
        for (at, _) in code.match_indices(&begin) {
            let is_whole = !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':' || c == '$');
            if is_whole {
                let mut used = Vec::new();
                tails(&code[at + begin.len()..], &[start.to_owned()], &mut used);
                found.extend(used.into_iter().map(|used| used.path));
            }
        }
    }
    found
}

/// What the `use` declarations of a source bring in; true for those that show it to others, `pub use`.
pub(crate) fn uses(code: &str) -> Vec<(bool, Used)> {
    let mut found = Vec::new();
    let lines = code.match_indices("use ").filter(|(at, _)| {
        let line = code[..*at].rsplit('\n').next().unwrap_or_default();
        line.trim().is_empty() || line.trim_start().starts_with("pub")
    });
    for (at, _) in lines {
        let is_shown = code[..at].rsplit('\n').next().is_some_and(|line| line.contains("pub"));
        let mut used = Vec::new();
        tails(&code[at + 4..], &[], &mut used);
        found.extend(used.into_iter().map(|used| (is_shown, used)));
    }
    found
}

/// Adds the paths that a text begins with, each behind `before`.
fn tails(text: &str, before: &[String], found: &mut Vec<Used>) {
    let text = text.trim_start();
    if let Some(list) = text.strip_prefix('{') {
        parts(list).into_iter().for_each(|part| tails(part, before, found));
        return;
    }
    let name = if text.starts_with('*') { "*".to_owned() } else { first_name(text) };
    if name.is_empty() {
        return;
    }
    let rest = &text[name.len()..];
    if let Some(rest) = rest.strip_prefix("::").filter(|rest| !rest.starts_with('<')) {
        return tails(rest, &[before, std::slice::from_ref(&name)].concat(), found);
    }
    let under = rest.trim_start().strip_prefix("as ").map(first_name);
    match name.as_str() {
        "*" => found.push(Used { path: before.to_vec(), name }),
        // `a::{self, b}`
        "self" => found.push(Used { path: before.to_vec(), name: before.last().cloned().unwrap_or_default() }),
        _ => {
            let path = [before, std::slice::from_ref(&name)].concat();
            found.push(Used { path, name: under.unwrap_or(name) });
        }
    }
}

/// The parts of a braced list; commas of inner lists do not separate.
fn parts(list: &str) -> Vec<&str> {
    let (mut depth, mut start, mut parts) = (0_usize, 0, Vec::new());
    for (at, c) in list.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => {
                parts.push(&list[start..at]);
                break;
            }
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&list[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    parts
}

fn first_name(path: &str) -> String {
    path.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(path: &[&str]) -> Vec<String> {
        path.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn paths_are_whole_and_lists_are_taken_apart() {
        let code = "use crate::a::{b::C, d};\nlet x = super::super::e(1); crate::f!(); my_crate::no(); $crate::no";
        let wanted = [of(&["crate", "a", "b", "C"]), of(&["crate", "a", "d"]), of(&["crate", "f"])];
        assert_eq!(paths(code)[..3], wanted);
        assert_eq!(paths(code)[3], of(&["super", "super", "e"]));
    }

    #[test]
    fn a_use_says_from_where_and_under_which_name() {
        let code = "use a::{self, b::C as D};\npub(crate) use e::*;\nlet reuse = 1;";
        let used = |path: &[&str], name: &str| Used { path: of(path), name: name.to_owned() };
        let wanted = [(false, used(&["a"], "a")), (false, used(&["a", "b", "C"], "D")), (true, used(&["e"], "*"))];
        assert_eq!(uses(code), wanted);
    }

    #[test]
    fn comments_and_tests_name_nothing() {
        let source = "// \"docs\"\nlet a = \"site\"; //\n\n#[cfg(test)]\nmod tests {\n\"python\"";
        assert_eq!(code(source), "let a = \"site\"; //");
    }
}
