//! A report as it leaves this crate: the page, and each of its figures by itself.

use crate::figure::Figure;
use crate::svg;

/// One HTML file that needs nothing else, and the figures on it.
#[derive(Clone, Debug)]
pub struct Report {
    pub(crate) html: String,
    pub(crate) figures: Vec<Figure>,
}

impl Report {
    /// The page, for screen and paper.
    pub fn html(&self) -> &str {
        &self.html
    }

    /// Each figure as an SVG file of its own: a name without an ending (letters, digits, `-`), and the file's text.
    pub fn figures(&self) -> impl Iterator<Item = (String, String)> + '_ {
        self.figures.iter().map(|figure| (file_name(&figure.id), svg::file(figure)))
    }
}

/// A figure's id as the name of a file.
fn file_name(id: &str) -> String {
    id.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect()
}
