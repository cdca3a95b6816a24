//! A page of curves: what a simulation did, or how a loop answers.

use maud::{Markup, html};

use crate::error::Result;
use crate::report::figure::{Figure, Layer, Role, rounded};
use crate::report::page::{page, shown};

/// Curves and words of a page.
#[derive(Clone, Debug, Default)]
pub struct ChartPage {
    /// Heading.
    pub title: String,
    /// What it is of.
    pub subtitle: String,
    /// Figures, in order.
    pub charts: Vec<Chart>,
    /// Tables after the figures: heading, column names, rows.
    pub tables: Vec<(String, Vec<String>, Vec<Vec<String>>)>,
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

/// Colours in the order of curves, all different; more curves begin again, dashed. What the roles stand for on other
/// pages has no meaning here.
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
        let points = MOST_POINTS / self.curves.len().max(1);
        for (index, curve) in self.curves.iter().enumerate() {
            let step = curve.x.len().div_ceil(points).max(1);
            let dashed = curve.dashed || index >= ROLES.len();
            let thin = |values: &[f64]| rounded(values.iter().copied().step_by(step));
            let role = ROLES[index % ROLES.len()];
            layers.push(Layer::Line { label: curve.label.clone(), role, x: thin(&curve.x), y: thin(&curve.y), dashed });
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
            layers,
        };
        figure.framed(false)
    }
}

fn table(heading: &str, columns: &[String], rows: &[Vec<String>]) -> Markup {
    html! {
        h2 { (heading) }
        div.scroll { table {
            thead { tr { @for column in columns { th { (column) } } } }
            tbody { @for row in rows { tr { @for cell in row { td { (cell) } } } } }
        } }
    }
}

/// The page as one self-contained HTML file.
///
/// # Errors
/// Figures that cannot be written as JSON.
pub fn chart_report(content: &ChartPage) -> Result<String> {
    let drawn: Vec<Figure> = content.charts.iter().filter_map(Chart::figure).collect();
    let body = html! {
        h1 { (content.title) }
        p.sub { (content.subtitle) }
        @for figure in &drawn { (shown(figure)) }
        @for (heading, columns, rows) in &content.tables { (table(heading, columns, rows)) }
    };
    page(&content.title, &body, &drawn)
}
