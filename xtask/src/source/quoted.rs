//! Numbers that prose quotes below the output of a command: each stands in that output, in the evidence, or is marked as the author's own.
//!
//! ```text
//! section of a page: ```console … ``` ─▶ numbers of the outputs ┐
//!                    prose below ──────▶ numbers ───────────────┴▶ one that no output rounds to, without <!-- own -->
//! ```
//!
//! A section ends at the next heading. Whole numbers of one digit are words. Fails to see a number of another output that happens to be equal.

/// Pages that people follow command by command.
const PAGES: [&str; 3] = ["README.md", "docs/tutorial/", "docs/how-to/"];
/// A paragraph whose numbers are the author's.
const OWN: &str = "<!-- own -->";

/// A number as it is written: its value, and its decimals.
fn numbers(text: &str) -> Vec<(&str, f64, usize)> {
    let is_part = |c: char| c.is_ascii_digit() || c == '.' || c == ',';
    let mut out = Vec::new();
    let mut rest = text;
    let mut before = ' ';
    while let Some(at) = rest.find(|c: char| c.is_ascii_digit()) {
        before = rest[..at].chars().next_back().unwrap_or(before);
        let tail = &rest[at..];
        let end = tail.find(|c| !is_part(c)).unwrap_or(tail.len());
        let written = tail[..end].trim_end_matches(['.', ',']);
        let is_word = before.is_alphanumeric() || before == '_' || before == '^';
        if let Ok(value) = written.replace(',', "").parse::<f64>()
            && !is_word
        {
            out.push((written, value, written.split_once('.').map_or(0, |(_, digits)| digits.len())));
        }
        before = tail[..end].chars().next_back().unwrap_or(' ');
        rest = &tail[end..];
    }
    out
}

/// Prose without code and without the targets of its links.
fn plain(paragraph: &str) -> String {
    let without_code: String = paragraph.split('`').step_by(2).collect::<Vec<_>>().join(" ");
    let mut out = String::new();
    let mut rest = without_code.as_str();
    while let Some((text, target)) = rest.split_once("](") {
        out.push_str(text);
        rest = target.split_once(')').map_or("", |(_, rest)| rest);
    }
    out + rest
}

/// The numbers below console blocks of a page that neither these nor the evidence hold.
fn unquoted(page: &str, evidence: &[f64]) -> Vec<String> {
    let mut outputs: Vec<f64> = Vec::new();
    let mut missing = Vec::new();
    for (at, part) in page.split("```").enumerate() {
        if at % 2 == 1 {
            if part.starts_with("console") {
                outputs.extend(numbers(part).iter().map(|(_, value, _)| value));
            }
            continue;
        }
        for paragraph in part.split("\n\n") {
            if paragraph.trim_start().starts_with('#') {
                outputs.clear();
            }
            if outputs.is_empty() || paragraph.contains(OWN) {
                continue;
            }
            let rounds_to = |known: f64, value: f64, decimals: usize| {
                (known.abs() - value).abs() <= 0.5 * 10_f64.powi(-(decimals as i32)) * (1.0 + 1e-9)
            };
            let text = plain(paragraph);
            let strange = numbers(&text).into_iter().filter(|(written, value, decimals)| {
                written.len() > 1 && !outputs.iter().chain(evidence).any(|known| rounds_to(*known, *value, *decimals))
            });
            missing.extend(strange.map(|(written, ..)| format!("{written} in: {}", text.trim().replace('\n', " "))));
        }
    }
    missing
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use xtask::shell::{root, stdout_of};

    #[test]
    fn a_number_that_no_output_holds_is_found() {
        let page =
            "# A\n\n```console\n$ sagnac x\nσ 0.0179 °/h over 792 windows\n```\n\nσ is 0.018 °/h, of 792 windows.\n\n";
        assert_eq!(unquoted(page, &[]), Vec::<String>::new());
        assert_eq!(unquoted(&format!("{page}It was 0.021."), &[]), ["0.021 in: It was 0.021."]);
        assert_eq!(unquoted(&format!("{page}It was 0.021."), &[0.0211]), Vec::<String>::new());
        assert_eq!(unquoted(&format!("{page}It was 0.021. <!-- own -->"), &[]), Vec::<String>::new());
        assert_eq!(unquoted(&format!("{page}## B\n\nIt was 0.021."), &[]), Vec::<String>::new());
    }

    #[test]
    fn prose_quotes_the_outputs_above_it() {
        let tables = ["sagnac.csv", "sagnac-noise.csv"].map(|name| root().join("docs/explanation/evidence").join(name));
        let evidence: String = tables.iter().map(|table| fs::read_to_string(table).unwrap()).collect();
        let evidence: Vec<f64> = evidence.lines().filter_map(|row| row.split(',').nth(2)?.parse().ok()).collect();
        assert!(evidence.len() > 200, "{}", evidence.len());
        let files = stdout_of(60, "git", &["ls-files", "-z", "*.md"], &root()).unwrap();
        let is_followed = |path: &&str| PAGES.iter().any(|page| path.starts_with(page));
        let strange = files.split('\0').filter(is_followed).flat_map(|path| {
            let page = fs::read_to_string(root().join(path)).unwrap();
            unquoted(&page, &evidence).into_iter().map(|number| format!("{path}: {number}")).collect::<Vec<_>>()
        });
        let strange: Vec<String> = strange.collect();
        assert!(
            strange.is_empty(),
            "no output above has these numbers; correct them, or mark the paragraph {OWN}:\n{}",
            strange.join("\n")
        );
    }
}
