//! A generated file on its way to the tree, or a generated part of a page written by hand.

use anyhow::{Context, Result};

/// A generated file; the path is relative to the workspace.
#[derive(Clone)]
pub(crate) struct Made {
    /// Its path.
    pub(crate) path: String,
    /// Its content.
    pub(crate) bytes: Vec<u8>,
}

impl Made {
    pub(crate) fn new(path: impl Into<String>, bytes: impl Into<Vec<u8>>) -> Self {
        Self { path: path.into(), bytes: bytes.into() }
    }
}

/// Begin and end of the generated part of a page.
pub(crate) fn marks(name: &str, maker: &str) -> (String, String) {
    (
        format!("<!-- {name}: made by `cargo xtask bless {maker}`; do not edit -->\n"),
        format!("<!-- end of {name} -->\n"),
    )
}

/// A page with this text between its marks.
pub(crate) fn between_marks(page: &str, (begin, end): &(String, String), text: &str) -> Result<String> {
    let (head, rest) = page.split_once(begin).with_context(|| format!("no mark {}", begin.trim()))?;
    let (_, tail) = rest.split_once(end).with_context(|| format!("no mark {}", end.trim()))?;
    Ok(format!("{head}{begin}{text}{end}{tail}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_goes_between_its_marks_or_the_missing_mark_is_named() {
        let of_rows = marks("rows", "table");
        let (begin, end) = &of_rows;
        let page = between_marks(&format!("before\n{begin}old\n{end}after\n"), &of_rows, "new\n").unwrap();
        assert_eq!(page, format!("before\n{begin}new\n{end}after\n"));
        for (page, message) in [("", "no mark <!-- rows"), (begin.as_str(), "end of rows")] {
            assert!(between_marks(page, &of_rows, "").unwrap_err().to_string().contains(message), "{page}");
        }
    }
}
