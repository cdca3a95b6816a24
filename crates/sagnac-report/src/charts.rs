//! A page of curves: the course of a simulation, or the response of a loop.

use maud::{Markup, html};

use crate::figure::{DASHES, Figure, Layer, Role, SOLID, rounded};
use crate::page::{all_shown, page};
use crate::prose::prose;
use crate::report::Report;
use sagnac_log::error::Result;
use sagnac_log::setup::RateUnit;

/// Curves and words of a page.
#[derive(Clone, Debug, Default)]
pub struct ChartPage {
    /// Heading.
    pub title: String,
    /// What it is of.
    pub subtitle: String,
    /// Figures, in order.
    pub charts: Vec<Chart>,
    /// Unit of the rates in figures; a chart is made in °/h.
    pub units: RateUnit,
    /// Verdicts under the subtitle: whether it is well, and in words.
    pub verdicts: Vec<(bool, String)>,
    /// Words under them: what to know before reading on.
    pub notes: Vec<String>,
    /// Words under the figures.
    pub remarks: Vec<String>,
    /// Tables before the figures: what a reader wants first.
    pub results: Vec<PageTable>,
    /// Tables after the figures.
    pub tables: Vec<PageTable>,
    /// Entries at the end, each reached by a link to its id.
    pub entries: Vec<ChartEntry>,
}

/// An entry of a page.
#[derive(Clone, Debug, Default)]
pub struct ChartEntry {
    /// Unique on the page: letters, digits, - _ . and =.
    pub id: String,
    /// Heading.
    pub heading: String,
    /// Words under it.
    pub words: Vec<String>,
    /// Its tables.
    pub tables: Vec<PageTable>,
}

/// A table of a page; columns of long texts are set as words.
#[derive(Clone, Debug, Default)]
pub struct PageTable {
    /// Heading.
    pub heading: String,
    /// Names of the columns, with their units.
    pub columns: Vec<String>,
    /// Rows of cells.
    pub rows: Vec<Vec<String>>,
    /// Of each row the id of an entry that its first cell leads to; empty without any.
    pub entries: Vec<Option<String>>,
}

/// A figure of curves over one axis.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// Unique on the page: letters, digits, -.
    pub id: String,
    /// Charts of one group share zoom and cursor.
    pub group: String,
    /// What it answers.
    pub title: String,
    /// What to see in it.
    pub caption: String,
    /// Quantity and unit along x.
    pub x_label: String,
    /// Quantity and unit along y.
    pub y_label: String,
    /// Curves.
    pub curves: Vec<Curve>,
    /// Values that no line joins: many, then few that stand out. All of them are drawn.
    pub dots: Vec<Curve>,
    /// Bands between two curves, behind the curve of their place.
    pub bands: Vec<Band>,
    /// Both axes in decades; every value must be above zero.
    pub decades: bool,
    /// Stretches of x that are shaded, with their label.
    pub shades: Vec<(String, Vec<[f64; 2]>)>,
}

/// A curve.
#[derive(Clone, Debug, Default)]
pub struct Curve {
    /// Its name in the legend.
    pub label: String,
    /// Along x, rising.
    pub x: Vec<f64>,
    /// Along y.
    pub y: Vec<f64>,
    /// Dashed: what was designed, or how it was before.
    pub dashed: bool,
}

/// A band.
#[derive(Clone, Debug, Default)]
pub struct Band {
    /// Its name in the legend.
    pub label: String,
    /// Along x, rising.
    pub x: Vec<f64>,
    /// Lower edge.
    pub lo: Vec<f64>,
    /// Upper edge.
    pub hi: Vec<f64>,
}

/// Colours in the order of curves, all different; more curves begin again, dashed. The meaning of roles on other
/// pages does not apply here.
const ROLES: [Role; 8] = [
    Role::After,
    Role::Before,
    Role::Floor,
    Role::Fit,
    Role::Excluded,
    Role::ExcludedToo,
    Role::ExcludedAlso,
    Role::Steady,
];
/// Curves of a chart draw no more points together.
const MOST_POINTS: usize = 4000;

impl Chart {
    fn figure(&self) -> Option<Figure> {
        let mut layers = Vec::new();
        let shades = [Role::Excluded, Role::ExcludedToo, Role::ExcludedAlso];
        for ((label, stretches), role) in self.shades.iter().zip(shades.into_iter().cycle()) {
            layers.push(Layer::Shades { label: label.clone(), role, stretches: stretches.clone() });
        }
        for (band, role) in self.bands.iter().zip(ROLES) {
            let [x, lo, hi] = [&band.x, &band.lo, &band.hi].map(|values| rounded(values.iter().copied()));
            layers.push(Layer::Band { label: band.label.clone(), role, x, lo, hi });
        }
        for (dots, role) in self.dots.iter().zip([Role::Temperature, Role::Before]) {
            let [x, y] = [&dots.x, &dots.y].map(|values| rounded(values.iter().copied()));
            layers.push(Layer::Dots { label: dots.label.clone(), role, x, y });
        }
        let points = MOST_POINTS / self.curves.len().max(1);
        // Where broken lines have no meaning of their own, they distinguish curves on paper without colour.
        let alike = self.curves.len() > 2 && !self.curves.iter().any(|curve| curve.dashed);
        for (index, curve) in self.curves.iter().enumerate() {
            let step = curve.x.len().div_ceil(points).max(1);
            let dash = if curve.dashed || index >= ROLES.len() || (alike && index > 0) {
                DASHES[(index + DASHES.len() - 1) % DASHES.len()]
            } else {
                SOLID
            };
            let thin = |values: &[f64]| rounded(values.iter().copied().step_by(step));
            let role = ROLES[index % ROLES.len()];
            layers.push(Layer::Line { label: curve.label.clone(), role, x: thin(&curve.x), y: thin(&curve.y), dash });
        }
        let figure = Figure {
            id: self.id.clone(),
            title: self.title.clone(),
            caption: self.caption.clone(),
            x_label: self.x_label.clone(),
            y_label: self.y_label.clone(),
            group: self.group.clone(),
            x: [0.0; 2],
            y: [0.0; 2],
            decades: self.decades,
            layers,
        };
        figure.framed(false)
    }
}

/// Longer cells are words, not figures.
const LONGEST_FIGURE: usize = 32;

/// A cell; the first of a row may lead to an entry.
fn cell(table: &PageTable, row: usize, column: usize, text: &str) -> Markup {
    match table.entries.get(row).and_then(Option::as_ref).filter(|_| column == 0) {
        Some(id) => html! { a href={ "#" (id) } { (prose(text)) } },
        None => prose(text),
    }
}

fn table(table: &PageTable) -> Markup {
    let words: Vec<bool> = (0..table.columns.len())
        .map(|column| {
            table.rows.iter().any(|row| row.get(column).is_some_and(|cell| cell.chars().count() > LONGEST_FIGURE))
        })
        .collect();
    let is_words = |column: usize| words.get(column) == Some(&true);
    // A column without any value says nothing.
    let has_value = |column: usize| {
        column == 0
            || table.rows.iter().any(|row| row.get(column).is_some_and(|cell| !["", "-"].contains(&cell.as_str())))
    };
    html! {
        h2 { (table.heading) }
        div.scroll { table {
            thead { tr { @for (i, column) in table.columns.iter().enumerate().filter(|(i, _)| has_value(*i)) { th.words[is_words(i)] { (column) } } } }
            tbody { @for (at, row) in table.rows.iter().enumerate() { tr { @for (i, text) in row.iter().enumerate().filter(|(i, _)| has_value(*i)) { td.words[is_words(i)] { (cell(table, at, i, text)) } } } } }
        } }
    }
}

/// The page as a report.
///
/// # Errors
/// Figures that cannot be written as JSON.
pub fn chart_report(content: &ChartPage) -> Result<Report> {
    let drawn: Vec<Figure> =
        content.charts.iter().filter_map(Chart::figure).map(|figure| figure.shown_in(content.units)).collect();
    let body = html! {
        h1 { (content.title) }
        p.sub { (content.subtitle) }
        @for (well, words) in &content.verdicts {
            div class={ "verdict " (if *well { "pass" } else { "fail" }) } { b.word { (prose(words)) } }
        }
        @for note in &content.notes { p.note { (prose(note)) } }
        @for result in &content.results { (table(result)) }
        (all_shown(&drawn))
        @for remark in &content.remarks { p.note { (prose(remark)) } }
        @for data in &content.tables { (table(data)) }
        @for entry in &content.entries {
            section.entry id=(entry.id) {
                h2 { (entry.heading) }
                @for words in &entry.words { p.note { (prose(words)) } }
                @for data in &entry.tables { (table(data)) }
            }
        }
    };
    page(&content.title, &body, drawn)
}
