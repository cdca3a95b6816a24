//! The inside of a simulated gyro over time, thinned while it runs.

use sagnac_report::{Chart, ChartPage, Curve, PageTable};
use sagnac_sim::{Actuator, Bode, BodePoint, ERROR_SOURCES, LogRow, Scenario, Second};
use sagnac_units::format::significant;

/// Stretches of the run that are drawn as one point.
const POINTS: f64 = 1200.0;

/// Gathers means over stretches of equal length; memory does not grow with the run.
pub(crate) struct ChartRecorder {
    scenario: Scenario,
    stretch_s: f64,
    open: Option<Stretch>,
    hours: Vec<f64>,
    columns: Vec<Vec<f64>>,
    /// Counted rate, °/h.
    output: Vec<f64>,
    invalid: Vec<[f64; 2]>,
}

/// What is summed over a stretch.
struct Stretch {
    ends_s: f64,
    start_s: f64,
    rows: f64,
    counts: f64,
    sums: Vec<f64>,
}

/// Columns before the error sources: three temperatures, actuator, mode, light, current, scale factor.
const FIXED: usize = 8;

impl ChartRecorder {
    pub(crate) fn new(scenario: &Scenario) -> Self {
        let length_s = scenario.profile().map_or(1.0, |profile| profile.length_s());
        Self {
            stretch_s: (length_s / POINTS).max(scenario.run.interval_s),
            open: None,
            hours: Vec::new(),
            columns: vec![Vec::new(); FIXED + ERROR_SOURCES.len()],
            output: Vec::new(),
            invalid: Vec::new(),
            scenario: scenario.clone(),
        }
    }

    pub(crate) fn take(&mut self, row: &LogRow, second: &Second) {
        let end_s = row.time_ns as f64 / 1e9;
        if self.open.as_ref().is_some_and(|open| end_s > open.ends_s + 1e-9) {
            self.close();
        }
        let interval = self.scenario.run.interval_s;
        let (stretch_s, columns) = (self.stretch_s, self.columns.len());
        let open = self.open.get_or_insert_with(|| Stretch {
            start_s: end_s - interval,
            ends_s: end_s - interval + stretch_s,
            rows: 0.0,
            counts: 0.0,
            sums: vec![0.0; columns],
        });
        open.rows += 1.0;
        open.counts += row.counts as f64;
        let (t, l) = (&second.temperatures, &second.loops);
        let fixed =
            [t.chamber_c, t.block_c, t.anode_c, l.actuator, l.mode as f64, l.light, l.current_ma, second.scale_ppm];
        for (sum, value) in open.sums.iter_mut().zip(fixed.into_iter().chain(second.errors_dph)) {
            *sum += value;
        }
        if !row.valid {
            let [from, to] = [(end_s - interval) / 3600.0, end_s / 3600.0];
            match self.invalid.last_mut() {
                Some(last) if from - last[1] < stretch_s / 3600.0 => last[1] = to,
                _ => self.invalid.push([from, to]),
            }
        }
    }

    fn close(&mut self) {
        let Some(open) = self.open.take() else { return };
        let length_s = open.rows * self.scenario.run.interval_s;
        self.hours.push((open.start_s + 0.5 * (open.ends_s - open.start_s)) / 3600.0);
        for (column, sum) in self.columns.iter_mut().zip(&open.sums) {
            column.push(sum / open.rows);
        }
        self.output.push(open.counts * self.scenario.arcsec_per_count() / length_s);
    }

    fn curve(&self, label: &str, y: &[f64]) -> Curve {
        Curve { label: label.to_owned(), x: self.hours.clone(), y: y.to_vec(), dashed: false }
    }

    /// The page, once the run has ended.
    pub(crate) fn page(mut self, seed: u64) -> ChartPage {
        self.close();
        let (unit, actuator) = match self.scenario.path_length.actuator {
            Actuator::Piezo => ("V", "mirror"),
            Actuator::Heater => ("W", "heater"),
        };
        let column = |index: usize, label: &str| self.curve(label, &self.columns[index]);
        let mean = self.output.iter().sum::<f64>() / self.output.len().max(1) as f64;
        let output: Vec<f64> = self.output.iter().map(|rate| rate - mean).collect();
        let mut charts = vec![
            self.chart(
                "output",
                "Counted rate",
                "counted rate less its mean, °/h",
                vec![self.curve("counted", &output)],
            ),
            self.chart("errors", "Error sources", "bias, °/h", self.sources()),
            self.chart(
                "temperatures",
                "Temperatures",
                "temperature, °C",
                vec![column(0, "chamber"), column(1, "block"), column(2, "near the anode")],
            ),
            self.chart("actuator", "Path length", &format!("actuator, {unit}"), vec![column(3, actuator)]),
            self.chart("mode", "Mode number", "peaks from that of 25 °C", vec![column(4, "mode")]),
            self.chart("scale", "Scale factor", "deviation, ppm", vec![column(7, "scale factor")]),
            self.chart("light", "Intensity", "light, 1 is regulated", vec![column(5, "light")]),
            self.chart("current", "Discharge", "current, mA", vec![column(6, "current")]),
        ];
        charts[0].caption = format!(
            "Each point is the mean of {} s; the mean of all, {} °/h, is subtracted. Shaded: rows that the gyro marks as invalid.",
            significant(self.stretch_s, 3),
            significant(mean, 6)
        );
        charts[1].caption =
            "Parts of the counted rate other than the input and the noise. Only sources that move are drawn, each less \
             its mean. A log holds none of this."
                .to_owned();
        let words = if self.scenario.description.is_empty() { &self.scenario.name } else { &self.scenario.description };
        ChartPage {
            title: format!("Simulated test: {}", self.scenario.name),
            subtitle: format!("{words}. Seed {seed}."),
            charts,
            tables: vec![self.budget()],
            ..ChartPage::default()
        }
    }

    fn chart(&self, id: &str, title: &str, y_label: &str, curves: Vec<Curve>) -> Chart {
        let invalid = ("marked invalid".to_owned(), self.invalid.clone());
        Chart {
            id: id.to_owned(),
            group: "time".to_owned(),
            title: title.to_owned(),
            caption: String::new(),
            x_label: "time, h".to_owned(),
            y_label: y_label.to_owned(),
            curves,
            shades: if self.invalid.is_empty() { Vec::new() } else { vec![invalid] },
            ..Chart::default()
        }
    }

    /// Sources that are not constant, less their means.
    fn sources(&self) -> Vec<Curve> {
        let all = ERROR_SOURCES.iter().zip(&self.columns[FIXED..]);
        all.filter_map(|(name, values)| {
            let (mean, sigma, _) = statistics(values);
            let centred: Vec<f64> = values.iter().map(|v| v - mean).collect();
            (sigma > 0.0).then(|| self.curve(&name.replace('_', " "), &centred))
        })
        .collect()
    }

    fn budget(&self) -> PageTable {
        let columns = ["source", "mean, °/h", "σ over the test, °/h", "max − min, °/h"].map(str::to_owned);
        let rows = ERROR_SOURCES.iter().zip(&self.columns[FIXED..]).map(|(name, values)| {
            let (mean, sigma, span) = statistics(values);
            let mut row = vec![name.replace('_', " ")];
            row.extend(
                [mean, sigma, span].map(|value| if value == 0.0 { "0".to_owned() } else { significant(value, 3) }),
            );
            row
        });
        PageTable {
            heading: "Error sources".to_owned(),
            columns: columns.to_vec(),
            rows: rows.collect(),
            ..PageTable::default()
        }
    }
}

/// Mean, σ and max − min.
fn statistics(values: &[f64]) -> (f64, f64, f64) {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let [lo, hi] = values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(*v), hi.max(*v)]);
    let span = (hi - lo).max(0.0);
    // A constant has no spread, whatever its sum rounds to.
    let sigma = if span > 0.0 { (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt() } else { 0.0 };
    (mean, sigma, span)
}

/// Bode plots of swept loops: gain and phase over the logarithm of the frequency.
pub(crate) fn bode_page(scenario: &Scenario, sweeps: &[Bode]) -> ChartPage {
    let charts = sweeps.iter().flat_map(|sweep| {
        let name = sweep.which.name();
        let x: Vec<f64> = sweep.points.iter().map(|p| p.frequency_hz.log10()).collect();
        let curves = |measured: Vec<f64>, design: Vec<f64>| {
            let curve = |label: &str, y, dashed| Curve { label: label.to_owned(), x: x.clone(), y, dashed };
            vec![curve("measured on the running loop", measured, false), curve("design", design, true)]
        };
        let chart = |quantity: &str, y_label: &str, curves| Chart {
            group: name.to_owned(),
            id: format!("{}-{quantity}", name.replace(' ', "-")),
            title: format!("{name} loop, {quantity}").replacen(&name[..1], &name[..1].to_uppercase(), 1),
            caption: margins(sweep),
            x_label: "log₁₀ of the frequency in Hz".to_owned(),
            y_label: y_label.to_owned(),
            curves,
            shades: Vec::new(),
            ..Chart::default()
        };
        let db = |gain: f64| 20.0 * gain.log10();
        let values = |value: &dyn Fn(&BodePoint) -> f64| sweep.points.iter().map(value).collect::<Vec<f64>>();
        [
            chart("gain", "open-loop gain, dB", curves(values(&|p| db(p.gain)), values(&|p| db(p.design_gain)))),
            chart("phase", "open-loop phase, deg", curves(values(&|p| p.phase_deg), values(&|p| p.design_phase_deg))),
        ]
    });
    ChartPage {
        title: format!("Loops of {}", scenario.name),
        subtitle: "Open loop, measured on the closed one by adding a small sine to its output".to_owned(),
        charts: charts.collect(),
        tables: Vec::new(),
        ..ChartPage::default()
    }
}

fn margins(sweep: &Bode) -> String {
    let measured = match (sweep.crossover_hz, sweep.phase_margin_deg) {
        (Some(crossover), Some(margin)) => {
            format!("crossover {} Hz, phase margin {margin:.1}°", significant(crossover, 4))
        }
        _ => "no crossover in this sweep".to_owned(),
    };
    format!(
        "Measured: {measured}. Design: crossover {} Hz, phase margin {:.1}°.",
        significant(sweep.design_crossover_hz, 4),
        sweep.design_phase_margin_deg
    )
}
