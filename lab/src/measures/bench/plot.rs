//! Time and memory against the length of a log, both axes logarithmic.

use std::path::Path;

use anyhow::{Result, anyhow};
use plotters::prelude::*;

use crate::measures::bench::process::Cost;

const TIME: RGBColor = RGBColor(0, 114, 178);
const MEMORY: RGBColor = RGBColor(213, 94, 0);

pub(super) fn draw(path: &Path, points: &[(f64, Cost)]) -> Result<()> {
    let failed = |e: &dyn std::fmt::Display| anyhow!("cannot draw {}: {e}", path.display());
    let area = SVGBackend::new(path, (760, 380)).into_drawing_area();
    area.fill(&WHITE).map_err(|e| failed(&e))?;
    let (left, right) = area.split_horizontally(380);
    let time: Vec<(f64, f64)> = points.iter().map(|(rows, cost)| (*rows, cost.seconds)).collect();
    let memory: Vec<(f64, f64)> = points.iter().map(|(rows, cost)| (*rows, cost.peak_mib)).collect();
    panel(&left, "seconds", &time, (0.01, 10.0), TIME).map_err(|e| failed(&e))?;
    panel(&right, "peak, MiB", &memory, (1.0, 1000.0), MEMORY).map_err(|e| failed(&e))?;
    area.present().map_err(|e| failed(&e))?;
    println!("wrote {}", path.display());
    Ok(())
}

fn panel(
    area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    label: &str,
    points: &[(f64, f64)],
    (lo, hi): (f64, f64),
    colour: RGBColor,
) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    let mut chart = ChartBuilder::on(area)
        .margin(10)
        .margin_right(24)
        .x_label_area_size(40)
        .y_label_area_size(58)
        .build_cartesian_2d((8e5..1.3e8_f64).log_scale(), (lo..hi).log_scale())?;
    let short = |value: &f64| {
        if *value >= 1e6 { format!("{} M", value / 1e6) } else { format!("{value}") }
    };
    chart
        .configure_mesh()
        .max_light_lines(0)
        .bold_line_style(RGBColor(222, 225, 230))
        .x_label_formatter(&short)
        .y_label_formatter(&short)
        .x_desc("rows")
        .y_desc(label)
        .label_style(("sans-serif", 15))
        .draw()?;
    chart.draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2)))?;
    chart.draw_series(points.iter().map(|point| Circle::new(*point, 4, colour.filled())))?;
    Ok(())
}
