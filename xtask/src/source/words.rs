//! Phrases that no public sentence has: false friends of English, and sentences in which data talk.
//!
//! ```text
//! sources: comments, strings ─┐
//! pages: lines of prose ──────┴─▶ words with their lines ─▶ a phrase of the list ─▶ file:line
//! ```
//!
//! A string of a test is no public sentence: it may be a name of a file, or of a row of the evidence. The list is not read in `GLOSSARY.md`,
//! its page and `CHANGELOG.md`, which explain it and quote it. Blocks of code on a page are outputs, and a test of their own makes them.

use anyhow::{Context, Result};
use xtask::shell::{root, stdout_of};

/// Phrases, word by word, and the better words: `..` is up to three other words, `N` a number.
const PHRASES: [(&str, &str); 20] = [
    ("beside", "next to, with"),
    ("in place of", "instead of"),
    ("anew", "again"),
    ("hold .. against", "check against"),
    ("holds .. against", "checks against"),
    ("holding .. against", "checking against"),
    ("held .. against", "checked against"),
    ("is told", "gets"),
    ("are told", "get"),
    ("has told", "is complete, contains"),
    ("have told", "are complete, contain"),
    ("told enough", "is complete"),
    ("good for nothing", "not usable"),
    ("some N", "about N"),
    ("leans towards", "prefers"),
    ("doubt", "name the uncertainty"),
    ("what is left", "the rest, the residual"),
    ("odd unit", "outlier"),
    ("odd units", "outliers"),
    ("if you know what you do", "if you know what you are doing"),
];

/// Numbers that are written as words.
const NUMBERS: [&str; 15] = [
    "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "twelve", "twenty", "thirty", "fifty",
    "hundred", "thousand",
];

/// Pages that explain the list, or quote what was said before.
const EXEMPT: [&str; 3] = ["GLOSSARY.md", "docs/reference/glossary.md", "CHANGELOG.md"];

/// Most words between those of a phrase.
const BETWEEN: usize = 3;

/// A word in lower case with its line; an empty one ends a sentence.
type Word = (String, usize);

/// The phrases of the list in a text, as `line: phrase (better words)`.
fn phrases(words: &[Word]) -> Vec<String> {
    let list = PHRASES.map(|(phrase, better)| (phrase.split(' ').collect::<Vec<_>>(), phrase, better));
    let begins = |at: usize| {
        let found = list.iter().filter(|(parts, ..)| words[at].0 == parts[0] && matches(parts, &words[at..]));
        found.max_by_key(|(_, phrase, _)| phrase.len()).map(|(_, phrase, better)| (words[at].1, phrase, better))
    };
    let found = (0..words.len()).filter_map(begins);
    found.map(|(line, phrase, better)| format!("{line}: \"{phrase}\": {better}")).collect()
}

fn matches(phrase: &[&str], words: &[Word]) -> bool {
    match (phrase, words) {
        ([], _) => true,
        ([".."], _) | (_, []) => false,
        (["..", rest @ ..], _) => (0..=BETWEEN.min(words.len() - 1))
            .take_while(|skipped| words[..*skipped].iter().all(|(word, _)| !word.is_empty()))
            .any(|skipped| matches(rest, &words[skipped..])),
        ([first, rest @ ..], [(word, _), others @ ..]) => {
            let is_number = || word.starts_with(|c: char| c.is_ascii_digit()) || NUMBERS.contains(&word.as_str());
            (word == first || *first == "N" && is_number()) && matches(rest, others)
        }
    }
}

/// The words of a line; text between backticks is code.
fn words_of(text: &str, line: usize, into: &mut Vec<Word>) {
    for (at, prose) in text.split('`').enumerate() {
        if at % 2 == 1 {
            into.push((String::new(), line));
            continue;
        }
        let words = prose.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == '-'));
        into.extend(words.filter(|word| !word.is_empty()).map(|word| (word.to_lowercase(), line)));
    }
}

/// The words of a page: its prose.
fn of_page(text: &str) -> Vec<Word> {
    let (mut words, mut in_code) = (Vec::new(), false);
    for (at, line) in text.lines().enumerate() {
        let is_fence = line.trim_start().starts_with("```");
        in_code ^= is_fence;
        match in_code || is_fence {
            true => words.push((String::new(), at + 1)),
            false => words_of(line, at + 1, &mut words),
        }
    }
    words
}

/// The words of a source: its comments, and its strings unless it is a test.
fn of_source(text: &str, with_strings: bool) -> Vec<Word> {
    let mut words = Vec::new();
    let (mut rest, mut line) = (text, 1);
    while let Some(first) = rest.chars().next() {
        let length = token(rest).max(first.len_utf8());
        let (this, after) = rest.split_at(length);
        let is_string = this.len() > 1 && (this.starts_with('"') || this.starts_with('r'));
        if this.starts_with("//") || is_string && with_strings {
            let own = this.trim_start_matches(['/', '!']);
            own.split('\n').enumerate().for_each(|(at, part)| words_of(part, line + at, &mut words));
        }
        // A comment goes on in the next line; anything else ends its sentence.
        if is_string || !this.starts_with("//") && !this.trim().is_empty() {
            words.push((String::new(), line));
        }
        line += this.matches('\n').count();
        rest = after;
    }
    words
}

/// Length of the comment, string or character at the start of a source; 0 for anything else.
fn token(source: &str) -> usize {
    let after = |end: Option<usize>, length: usize| end.map_or(source.len(), |at| at + length);
    if source.starts_with("//") {
        return after(source.find('\n'), 0);
    }
    if let Some(rest) = source.strip_prefix('r') {
        let hashes = rest.len() - rest.trim_start_matches('#').len();
        if rest[hashes..].starts_with('"') {
            let end = format!("\"{}", &rest[..hashes]);
            let body = 2 + hashes;
            return after(source[body..].find(&end).map(|at| at + body), end.len());
        }
        let word = source.find(|c: char| !(c.is_alphanumeric() || c == '_'));
        return word.unwrap_or(source.len());
    }
    if source.starts_with(|c: char| c.is_alphanumeric() || c == '_') {
        return after(source.find(|c: char| !(c.is_alphanumeric() || c == '_')), 0);
    }
    if source.starts_with('\'') {
        let mut chars = source.char_indices().skip(1);
        return match (chars.next(), chars.next()) {
            (Some((_, '\\')), _) => {
                after(source[2..].char_indices().skip(1).find(|(_, c)| *c == '\'').map(|(at, _)| at + 2), 1)
            }
            (Some(_), Some((at, '\''))) => at + 1,
            _ => 1,
        };
    }
    if source.starts_with('"') {
        let mut escaped = false;
        let end = source.char_indices().skip(1).find(|(_, c)| {
            let is_end = *c == '"' && !escaped;
            escaped = *c == '\\' && !escaped;
            is_end
        });
        return after(end.map(|(at, _)| at), 1);
    }
    0
}

/// `file:line: phrase` for each phrase in the tracked files with one of these endings.
fn in_files(endings: &[&str]) -> Result<Vec<String>> {
    let files = stdout_of(60, "git", &["ls-files", "-z"], &root())?;
    let mut found = Vec::new();
    for file in files.split('\0').filter(|file| endings.iter().any(|ending| file.ends_with(ending))) {
        // The list itself quotes them.
        if EXEMPT.contains(&file) || file == "xtask/src/source/words.rs" {
            continue;
        }
        let text = std::fs::read_to_string(root().join(file)).with_context(|| file.to_owned())?;
        let is_test = file.contains("/tests/") || file.ends_with("/tests.rs");
        let words = if file.ends_with(".rs") { of_source(&text, !is_test) } else { of_page(&text) };
        found.extend(phrases(&words).into_iter().map(|phrase| format!("{file}:{phrase}")));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A planted phrase is found with its line, in comments, strings and prose, over the end of a line, and nowhere else.
    #[test]
    fn a_planted_phrase_is_found_by_its_line() {
        let source = "/// A value held\n/// up against its limit.\nfn beside(c: char) -> bool {\n    c == '\"' || say(\"in place of a log\\\"\", r#\"anew\"#)\n}\n// Twice some\nlet in_place = some(20);\n";
        let found = |with_strings: bool| phrases(&of_source(source, with_strings));
        let lines = |found: Vec<String>| found.iter().map(|phrase| phrase[..2].to_owned()).collect::<Vec<_>>();
        assert_eq!(lines(found(true)), ["1:", "4:", "4:"], "{:?}", found(true));
        assert_eq!(lines(found(false)), ["1:"]);
        let page = "It costs some\n20 °/h.\n\n```console\nbeside\n```\nThe `beside` of code, and what is left.\n";
        assert_eq!(lines(phrases(&of_page(page))), ["1:", "7:"]);
        assert!(phrases(&of_page("Without doubt: odd units, some units, held. Again. So against all.")).len() == 3);
    }

    /// Comments, help texts, messages and reports, in Rust.
    #[test]
    fn no_source_has_a_phrase_of_the_list() {
        let found = in_files(&[".rs"]).unwrap();
        assert!(found.is_empty(), "{} phrases; see GLOSSARY.md:\n{}", found.len(), found.join("\n"));
    }

    /// README, CONTRIBUTING, ARCHITECTURE and the book.
    #[test]
    fn no_page_has_a_phrase_of_the_list() {
        let found = in_files(&[".md"]).unwrap();
        assert!(found.is_empty(), "{} phrases; see GLOSSARY.md:\n{}", found.len(), found.join("\n"));
    }
}
