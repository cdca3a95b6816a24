//! LaTeX in Markdown to MathML, which browsers render themselves with a font that has a MATH table.
//!
//! `$…$` is an equation in a line, `$$…$$` one of its own, as on GitHub. Code stays unchanged. In Markdown, MathML is
//! inline HTML, and Markdown interprets the text between its tags. So every character with a meaning in Markdown becomes
//! a reference (`&#42;`), and an equation becomes a single line.

use std::fmt::Write;

use anyhow::{Result, anyhow, bail};
use pulldown_cmark::{Event, Options, Parser as Markdown, TextMergeWithOffset};
use pulldown_latex::config::DisplayMode;
use pulldown_latex::{Parser as Latex, RenderConfig, Storage, push_mathml};

/// The Markdown with every equation as MathML.
pub(crate) fn to_mathml(markdown: &str) -> Result<String> {
    let options = Options::ENABLE_MATH | Options::ENABLE_TABLES | Options::ENABLE_FOOTNOTES;
    let mut out = String::with_capacity(markdown.len());
    let mut copied = 0;
    for (event, range) in TextMergeWithOffset::new(Markdown::new_ext(markdown, options).into_offset_iter()) {
        let mathml = match event {
            Event::InlineMath(latex) => render(&latex, DisplayMode::Inline)?,
            Event::DisplayMath(latex) => {
                format!("<span class=\"equation\">{}</span>", render(&latex, DisplayMode::Block)?)
            }
            Event::Text(text) if text.contains("$$") => {
                bail!(
                    "`$$` that Markdown takes for text; does a line of the equation begin with + or -, or hold a blank line?"
                )
            }
            _ => continue,
        };
        out += &markdown[copied..range.start];
        out += &mathml;
        copied = range.end;
    }
    out += &markdown[copied..];
    Ok(out)
}

/// One equation as one line of MathML.
fn render(latex: &str, display_mode: DisplayMode) -> Result<String> {
    let storage = Storage::new();
    // push_mathml writes errors into the page; here an error is an error.
    let events: Result<Vec<_>, _> = Latex::new(latex, &storage).collect();
    let events = events.map_err(|error| anyhow!("equation `{latex}`: {error}"))?;
    let config = RenderConfig { display_mode, ..RenderConfig::default() };
    let mut mathml = String::new();
    let ok = events.into_iter().map(Ok::<_, std::convert::Infallible>);
    push_mathml(&mut mathml, ok, config)?;
    Ok(escape(&mathml))
}

/// Replaces Markdown's special characters outside tags by references and line ends by blanks. The bar is escaped
/// everywhere, because it ends a table cell.
fn escape(mathml: &str) -> String {
    let mut out = String::with_capacity(mathml.len());
    let mut in_tag = false;
    for c in mathml.chars() {
        match c {
            '<' => in_tag = true,
            '>' => in_tag = false,
            _ => {}
        }
        let own = matches!(
            c,
            '*' | '_' | '[' | ']' | '(' | ')' | '`' | '~' | '\\' | '$' | '{' | '}' | '!' | '#' | '^' | '-' | '+'
        );
        match c {
            '\n' | '\r' => out.push(' '),
            '|' => out += "&#124;",
            _ if own && !in_tag => {
                let _ = write!(out, "&#{};", u32::from(c));
            }
            _ => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_equation_in_a_line_becomes_mathml_and_the_line_stays() {
        let out = to_mathml("The rate $\\dot T$ is in °C/min.").unwrap();
        assert!(out.starts_with("The rate <math") && out.ends_with("</math> is in °C/min."), "{out}");
    }

    #[test]
    fn an_equation_of_its_own_is_marked_for_the_style_sheet() {
        let out = to_mathml("a\n\n$$\n\\frac{N^2}{\\tau} + \\sqrt{x}\n$$\n\nb").unwrap();
        assert!(out.contains("<span class=\"equation\"><math display=\"block\""), "{out}");
        assert!(out.contains("<mfrac>") && out.contains("<msqrt>"), "{out}");
        let lines: Vec<&str> = out.lines().filter(|line| line.contains("math")).collect();
        assert_eq!(lines.len(), 1, "an equation is one line: {out}");
    }

    #[test]
    fn code_and_prices_are_no_equations() {
        for text in ["`$x$`", "```console\n$ sagnac inspect a.csv\n$ sagnac\n```", "it costs 5 $ or 6 $ here"] {
            assert_eq!(to_mathml(text).unwrap(), text);
        }
    }

    /// mdBook renders the page after us: the rendered text must contain the text of the equation.
    #[test]
    fn markdown_leaves_the_mathml_alone() {
        let page = to_mathml("| a | b |\n|---|---|\n| $a * b * [c]_1 (d)$ | $\\lvert x \\rvert$ |\n").unwrap();
        let mut text = String::new();
        let mut cells = 0;
        for event in Markdown::new_ext(&page, Options::ENABLE_TABLES) {
            match event {
                Event::Text(t) => text += &t,
                Event::Start(pulldown_cmark::Tag::TableCell) => cells += 1,
                Event::Start(pulldown_cmark::Tag::Emphasis | pulldown_cmark::Tag::Link { .. }) => panic!("{page}"),
                _ => {}
            }
        }
        assert_eq!(cells, 4, "{page}");
        assert_eq!(text, "aba∗b∗[c]1(d)|x|");
    }

    #[test]
    fn an_equation_that_markdown_tears_apart_is_an_error() {
        for torn in ["$$\nx\n+ y\n$$", "$$\nx\n\ny\n$$"] {
            assert!(to_mathml(torn).unwrap_err().to_string().contains("begin with +"), "{torn}");
        }
    }

    #[test]
    fn what_latex_does_not_know_is_an_error_with_the_equation() {
        let error = to_mathml("so $\\frac{1}$ it is").unwrap_err().to_string();
        assert!(error.contains("equation `\\frac{1}`"), "{error}");
    }
}
