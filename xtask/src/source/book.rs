//! How long the books are: a user book, an assurance book, README and CONTRIBUTING.
//!
//! Words by hand stand on pages outside blocks of code and outside tables that the program makes.

use anyhow::{Context, Result};
use xtask::shell::root;

/// Pages and words by hand of the user book, at most.
const USER_BOOK: [usize; 2] = [40, 40_000];
/// Words by hand of both books with README and CONTRIBUTING, at most.
const ALL_WORDS: usize = 65_000;
/// Lines of README, at most.
const README_LINES: usize = 110;

/// The words by hand of a page.
fn words_by_hand(page: &str) -> usize {
    if page.lines().take(4).any(|line| line.contains("do not edit")) {
        return 0;
    }
    let (mut is_code, mut is_made, mut words) = (false, false, 0);
    for line in page.lines() {
        let is_fence = line.trim_start().starts_with("```");
        is_code ^= is_fence;
        is_made = (is_made || line.contains("made by `cargo")) && !line.starts_with("<!-- end");
        if !is_code && !is_fence && !is_made && !line.starts_with("<!--") {
            words += line.split_whitespace().filter(|word| word.contains(char::is_alphanumeric)).count();
        }
    }
    words
}

/// Pages of a part of the summary.
fn pages(part: &str) -> Vec<&str> {
    let links = part.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    links.filter(|page| page.ends_with(".md")).collect()
}

fn read(path: &str) -> Result<String> {
    std::fs::read_to_string(root().join(path)).with_context(|| path.to_owned())
}

fn words_of(pages: &[&str]) -> Result<usize> {
    pages.iter().map(|page| Ok(words_by_hand(&read(&format!("docs/{page}"))?))).sum()
}

#[test]
fn words_of_code_and_of_made_tables_do_not_count() {
    let page = "One two.\n```text\nthree\n```\n<!-- x: made by `cargo xtask bless x`; do not edit -->\n| four |\n<!-- end of x -->\nfive – six\n";
    assert_eq!(words_by_hand(&format!("\n\n\n\n{page}")), 4);
    assert_eq!(words_by_hand("# Made\nMade by `cargo xtask bless`; do not edit.\nword"), 0);
}

#[test]
fn the_books_are_short() {
    let summary = read("docs/SUMMARY.md").unwrap();
    let (user, assurance) = summary.split_once("# Assurance book").unwrap();
    let user = pages(user.split_once("# User book").unwrap().1);
    let user_words = words_of(&user).unwrap();
    assert!(user.len() <= USER_BOOK[0] && user_words <= USER_BOOK[1], "{} pages, {user_words} words", user.len());
    let [readme, contributing] = ["README.md", "CONTRIBUTING.md"].map(|path| read(path).unwrap());
    let all = user_words + words_of(&pages(assurance)).unwrap() + words_by_hand(&readme) + words_by_hand(&contributing);
    assert!(all <= ALL_WORDS, "{all} words");
    assert!(readme.lines().count() <= README_LINES, "{} lines", readme.lines().count());
}
