//! Figures for paper: SVG by `plotters`, on white, in colours that the colour-blind can distinguish
//! (Okabe and Ito 2008) and with marks that differ without colour.
//!
//! Dots are one path, not one element each: a day of windows stays small.

use std::fmt::Write;

use plotters::backend::SVGBackend;
use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::types::RangedCoordf64;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::element::{PathElement, Polygon, Rectangle};
use plotters::series::LineSeries;
use plotters::style::{Color, RGBColor, ShapeStyle, WHITE};

use sagnac_units::format::printable;

use crate::figure::{Dash, Figure, Layer, Role};

const WIDTH: u32 = 860;
const HEIGHT: u32 = 350;
const LEGEND_LEFT: f64 = 84.0;
const LEGEND_ROW: i32 = 18;
const INK: RGBColor = RGBColor(60, 64, 72);
const GRID: RGBColor = RGBColor(222, 225, 230);

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type PlotContext<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

fn colour(role: Role) -> RGBColor {
    match role {
        Role::Before | Role::Heating => RGBColor(213, 94, 0),
        Role::After | Role::Cooling => RGBColor(0, 114, 178),
        Role::Fit => RGBColor(0, 0, 0),
        Role::Floor => RGBColor(0, 130, 96),
        Role::Steady => RGBColor(120, 124, 132),
        Role::Excluded => RGBColor(204, 121, 167),
        Role::ExcludedToo => RGBColor(86, 180, 233),
        Role::ExcludedAlso => RGBColor(214, 196, 40),
        Role::Temperature => RGBColor(90, 95, 105),
    }
}

/// Draws a figure; if that fails, a message replaces it.
pub(crate) fn draw(figure: &Figure) -> String {
    let in_powers = figure.decades.then(|| figure.in_powers());
    let figure = in_powers.as_ref().unwrap_or(figure);
    let mut svg = String::new();
    let drawn = {
        let area = SVGBackend::with_string(&mut svg, (WIDTH, HEIGHT)).into_drawing_area();
        draw_on(&area, figure)
    };
    match drawn {
        Ok(marks) => finish(&svg, &marks, &figure.title),
        Err(error) => format!("<p>This figure could not be drawn: {error}</p>"),
    }
}

/// A figure as a file of its own, with the size that a page gives it otherwise.
pub(crate) fn file(figure: &Figure) -> String {
    printable(&draw(figure)).replacen("<svg ", &format!("<svg width=\"{WIDTH}\" height=\"{HEIGHT}\" "), 1)
}

/// The marks go on top, before the end of the drawing; the size is left to the page.
fn finish(svg: &str, marks: &str, title: &str) -> String {
    let size = format!("width=\"{WIDTH}\" height=\"{HEIGHT}\" ");
    let label: String = title.chars().filter(|c| !"<>&\"".contains(*c)).collect();
    let body = svg.replacen(&size, &format!("role=\"img\" aria-label=\"{label}\" "), 1);
    let (before, after) = body.rsplit_once("</svg>").unwrap_or((&body, ""));
    format!("{}{marks}</svg>{after}", before.trim_end()).replace("\n", "")
}

fn draw_on(area: &Area<'_>, figure: &Figure) -> Result<String, DrawingAreaErrorKind<std::io::Error>> {
    area.fill(&WHITE)?;
    let (signs, last_row) = legend(figure);
    let ([x_lo, x_hi], [y_lo, y_hi]) = (figure.x, figure.y);
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_top(last_row + 14)
        .margin_right(16)
        .x_label_area_size(44)
        .y_label_area_size(room_for_labels(figure))
        .build_cartesian_2d(x_lo..x_hi, y_lo..y_hi)?;
    let mut marks = String::new();
    for layer in figure.layers.iter().filter(|layer| matches!(layer, Layer::Shades { .. })) {
        draw_layer(&mut chart, figure, layer, &mut marks)?;
    }
    draw_mesh(&mut chart, figure)?;
    for layer in figure.layers.iter().filter(|layer| !matches!(layer, Layer::Shades { .. })) {
        draw_layer(&mut chart, figure, layer, &mut marks)?;
    }
    area.present()?;
    marks += &signs;
    Ok(marks)
}

/// Width of the numbers along y with their label, px: a number in m°/s is short, the same in rad/s is not.
fn room_for_labels(figure: &Figure) -> i32 {
    let [lo, hi] = figure.y;
    let whole = lo.abs().max(hi.abs()).max(1.0).log10().floor() as i32 + 1;
    let sign = i32::from(lo < 0.0);
    if figure.decades { 72 } else { (32 + 8 * (sign + whole + 1 + decimals_of(figure.y) as i32)).max(72) }
}

/// Decimals of the numbers along an axis.
fn decimals_of([lo, hi]: [f64; 2]) -> usize {
    (2.0 - (hi - lo).log10().floor()).clamp(0.0, 9.0) as usize
}

fn draw_mesh(chart: &mut PlotContext<'_, '_>, figure: &Figure) -> Drawn {
    let decades = figure.decades;
    let text = |range: [f64; 2]| {
        let decimals = decimals_of(range);
        move |value: &f64| {
            if decades {
                return power_of_ten(*value);
            }
            let text = format!("{value:.decimals$}");
            let short = if decimals > 0 { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
            if short == "-0" { "0".to_owned() } else { short.to_owned() }
        }
    };
    chart
        .configure_mesh()
        .max_light_lines(0)
        .bold_line_style(GRID)
        .x_labels(11)
        .y_labels(7)
        .x_label_formatter(&text(figure.x))
        .y_label_formatter(&text(figure.y))
        .x_desc(figure.x_label.as_str())
        .y_desc(figure.y_label.as_str())
        .axis_style(INK)
        .label_style(("sans-serif", 15))
        .draw()
}

/// The label of a whole power; between them a line without one.
fn power_of_ten(power: f64) -> String {
    if (power - power.round()).abs() > 1e-6 {
        return String::new();
    }
    match power.round() as i32 {
        small @ -4..=4 => format!("{}", 10.0_f64.powi(small)),
        large => format!("1e{large}"),
    }
}

fn draw_layer(chart: &mut PlotContext<'_, '_>, figure: &Figure, layer: &Layer, marks: &mut String) -> Drawn {
    let clip = |y: f64| y.clamp(figure.y[0], figure.y[1]);
    match layer {
        Layer::Dots { role, x, y, .. } => {
            let at = x.iter().zip(y).filter(|(x, y)| x.is_finite() && y.is_finite());
            let pixels: Vec<(i32, i32)> = at.map(|(x, y)| chart.backend_coord(&(*x, clip(*y)))).collect();
            *marks += &dots(&pixels, *role);
        }
        Layer::Line { role, x, y, dash, .. } => {
            let points: Vec<(f64, f64)> = x.iter().zip(y).map(|(x, y)| (*x, clip(*y))).collect();
            if !dash.is_empty() {
                // One path; dash by dash it would be a hundred elements.
                let pixels: Vec<(i32, i32)> = points.iter().map(|point| chart.backend_coord(point)).collect();
                let corners: Vec<String> = pixels.iter().map(|(x, y)| format!("{x} {y}")).collect();
                let path = corners.join("L");
                let (stroke, dashes) = (hex(*role), dashes(dash));
                *marks +=
                    &format!("<path d=\"M{path}\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"2\"{dashes}/>");
            } else {
                chart.draw_series(LineSeries::new(points, colour(*role).stroke_width(2)))?;
            }
        }
        Layer::Band { role, x, lo, hi, .. } => {
            let outline = x.iter().zip(hi).chain(x.iter().zip(lo).rev());
            let outline: Vec<(f64, f64)> = outline.map(|(x, y)| (*x, clip(*y))).collect();
            chart.draw_series([Polygon::new(outline, colour(*role).mix(0.18))])?;
        }
        Layer::Whiskers { role, x, y, half, joined, .. } => {
            let style: ShapeStyle = colour(*role).stroke_width(2);
            let ends = x.iter().zip(y).zip(half).filter(|((_, y), _)| y.is_finite());
            let bars = ends.map(|((x, y), half)| PathElement::new([(*x, clip(y - half)), (*x, clip(y + half))], style));
            chart.draw_series(bars)?;
            let middles: Vec<(f64, f64)> = x.iter().copied().zip(y.iter().map(|y| clip(*y))).collect();
            if *joined {
                chart.draw_series(LineSeries::new(middles, colour(*role)))?;
            } else {
                let pixels: Vec<(i32, i32)> = middles.iter().map(|point| chart.backend_coord(point)).collect();
                *marks += &dots(&pixels, *role);
            }
        }
        Layer::Bars { role, edges, heights, .. } => {
            let fill = colour(*role).mix(0.55).filled();
            let bars = edges.windows(2).zip(heights);
            chart.draw_series(bars.map(|(e, h)| Rectangle::new([(e[0], 0.0), (e[1], *h)], fill)))?;
        }
        Layer::Shades { role, stretches, .. } => {
            let fill = colour(*role).mix(0.28).filled();
            let [bottom, top] = figure.y;
            chart.draw_series(stretches.iter().map(|[a, b]| Rectangle::new([(*a, bottom), (*b, top)], fill)))?;
        }
    }
    Ok(())
}

/// Marks: dots; rings for logged values, crosses for cooling, oblique crosses for excluded windows, small dots without motion.
fn dots(pixels: &[(i32, i32)], role: Role) -> String {
    let mut path = String::new();
    for (x, y) in pixels {
        // A String takes all that is written to it.
        let _ = match role {
            Role::Before => write!(path, "M{} {y}a2 2 0 1 0 4 0a2 2 0 1 0-4 0", x - 2),
            Role::Cooling => write!(path, "M{} {y}h6m-3-3v6", x - 3),
            Role::Excluded => write!(path, "M{} {}l6 6m0-6l-6 6", x - 3, y - 3),
            _ => write!(path, "M{x} {y}h0"),
        };
    }
    let (width, opacity) = match role {
        Role::Before => (1.0, 0.8),
        Role::Cooling | Role::Excluded => (1.3, 0.8),
        Role::Steady => (2.4, 0.7),
        _ => (4.2, 0.6),
    };
    format!(
        "<path d=\"{path}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\" stroke-opacity=\"{opacity}\" stroke-linecap=\"round\"/>",
        hex(role)
    )
}

/// The attribute of a broken line.
fn dashes(dash: Dash) -> String {
    if dash.is_empty() {
        return String::new();
    }
    let lengths: Vec<String> = dash.iter().map(u8::to_string).collect();
    format!(" stroke-dasharray=\"{}\"", lengths.join(" "))
}

fn hex(role: Role) -> String {
    let RGBColor(r, g, b) = colour(role);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// One entry per label above the figure, in as many rows as they need; the last row. Widths by the count of
/// characters: no font is available.
fn legend(figure: &Figure) -> (String, i32) {
    let mut seen: Vec<&str> = Vec::new();
    let mut out = String::new();
    let (mut at, mut row) = (LEGEND_LEFT, LEGEND_ROW - 2);
    for layer in &figure.layers {
        let (label, _) = layer.label();
        if label.is_empty() || seen.contains(&label) {
            continue;
        }
        seen.push(label);
        let width = 24.0 + 6.9 * label.chars().count() as f64 + 16.0;
        if at + width > f64::from(WIDTH) && at > LEGEND_LEFT {
            (at, row) = (LEGEND_LEFT, row + LEGEND_ROW);
        }
        let sign = sign(layer, at, row);
        let escaped = xml_text(label);
        let (text, base) = (at + 24.0, row + 4);
        let _ = write!(
            out,
            "{sign}<text x=\"{text}\" y=\"{base}\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#3c4048\">{escaped}</text>"
        );
        at += width;
    }
    (out, row)
}

/// The sign of a layer in the legend.
fn sign(layer: &Layer, at: f64, row: i32) -> String {
    let stroke = hex(layer.label().1);
    match layer {
        Layer::Dots { role, .. } => dots(&[(at as i32 + 9, row)], *role),
        Layer::Line { dash, .. } => {
            let dashes = dashes(dash);
            format!("<path d=\"M{at} {row}h18\" stroke=\"{stroke}\" stroke-width=\"2\"{dashes}/>")
        }
        Layer::Whiskers { joined: false, role, .. } => {
            let dot = dots(&[(at as i32 + 9, row)], *role);
            format!(
                "<path d=\"M{} {}v12\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"2\"/>{dot}",
                at + 9.0,
                row - 6
            )
        }
        Layer::Whiskers { .. } => {
            format!("<path d=\"M{at} {row}h18m-9-6v12\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"2\"/>")
        }
        Layer::Band { .. } | Layer::Bars { .. } | Layer::Shades { .. } => {
            let opacity = if matches!(layer, Layer::Bars { .. }) { 0.55 } else { 0.28 };
            let top = row - 6;
            format!(
                "<rect x=\"{at}\" y=\"{top}\" width=\"18\" height=\"12\" fill=\"{stroke}\" fill-opacity=\"{opacity}\"/>"
            )
        }
    }
}

/// Text in a file of XML. Characters that XML 1.0 has none of are shown as their number (section 2.2).
fn xml_text(text: &str) -> String {
    let legal = |c: char| matches!(c, '\t' | '\n' | '\r') || c >= ' ' && !matches!(c, '\u{fffe}' | '\u{ffff}');
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            c if legal(c) => out.push(c),
            c => {
                let _ = write!(out, "\\u{{{:x}}}", u32::from(c));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// XML 1.0, sections 2.2 and 2.4.
    #[test]
    fn any_text_stands_in_a_file() {
        assert_eq!(xml_text("a<b>&]]>\u{fffe}\u{1b}"), "a&lt;b&gt;&amp;]]&gt;\\u{fffe}\\u{1b}");
    }
}
