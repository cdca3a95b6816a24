//! A running test in plain lines on standard error: events and warnings as they come, and a line a minute.

use std::time::{Duration, Instant};

use sagnac_bench::live::{Live, LiveState, Versions};
use sagnac_bench::source::Stop;
use sagnac_bench::{SourceState, SourceStatus};
use sagnac_log::setup::RateUnit;
use sagnac_units::format::{celsius, significant};

use crate::output::console::Console;

/// Time between two lines of what is known.
const EVERY: Duration = Duration::from_secs(60);
/// How often it is looked whether something is new.
const LOOK: Duration = Duration::from_millis(200);

/// What was said already.
pub(crate) struct Lines {
    units: RateUnit,
    said: Option<Instant>,
    last_event_ns: i64,
    warnings: Vec<(String, f64)>,
    known: Versions,
    states: Vec<SourceState>,
    failed: bool,
}

impl Lines {
    pub(crate) fn new(units: RateUnit) -> Self {
        Self {
            units,
            said: None,
            last_event_ns: i64::MIN,
            warnings: Vec::new(),
            known: Versions::default(),
            states: Vec::new(),
            failed: false,
        }
    }

    /// Waits until something is new, or it is to stop.
    pub(crate) fn wait(&mut self, live: &Live, stop: &Stop) {
        if live.wait(self.known, LOOK) != self.known {
            stop.wait(LOOK / 4);
        }
    }

    /// Says what is new.
    pub(crate) fn show(&mut self, live: &Live, sources: &[SourceStatus], console: &mut Console) {
        let mut said = Vec::new();
        live.look(|state| {
            self.known = state.versions;
            said = self.news(state);
            let is_due = self.said.is_none_or(|said| said.elapsed() >= EVERY);
            if is_due && !state.now.rates_dph.is_empty() {
                self.said = Some(Instant::now());
                said.extend(lines_of(state, self.units));
            }
        });
        self.states.resize(sources.len(), SourceState::Waiting);
        for (source, known) in sources.iter().zip(&mut self.states) {
            let silent = source.state == SourceState::Silent && *known != SourceState::Silent;
            if silent {
                said.push(format!("{}: silent for {} s", source.name, source.silent_after_s));
            }
            *known = source.state;
        }
        said.iter().for_each(|line| console.note(line));
    }

    fn news(&mut self, state: &LiveState) -> Vec<String> {
        let mut said: Vec<String> = Vec::new();
        let is_new = |event: &&sagnac_bench::decode::Event| event.at_ns > self.last_event_ns;
        let silence = |what: &str| what.contains(": silent for ");
        said.extend(state.events.iter().filter(is_new).map(|event| event.what.clone()).filter(|what| !silence(what)));
        self.last_event_ns = state.events.last().map_or(self.last_event_ns, |event| event.at_ns);
        for warning in &state.warnings {
            let key = (warning.place.clone(), warning.since_s);
            if !self.warnings.contains(&key) {
                said.push(format!("warning: {}", warning.words));
                self.warnings.push(key);
            }
        }
        if let Some(failed) = state.failed.as_ref().filter(|_| !std::mem::replace(&mut self.failed, true)) {
            said.push(format!("rows cannot be read: {failed}"));
        }
        said
    }

    /// The last word, with the fit of the whole record.
    pub(crate) fn last(&mut self, live: &Live, console: &mut Console) {
        let said = live.look(|state| {
            let mut said = self.news(state);
            said.extend(lines_of(state, self.units));
            said
        });
        said.iter().for_each(|line| console.note(line));
    }
}

/// What is known, in a line or two.
pub(crate) fn lines_of(state: &LiveState, units: RateUnit) -> Vec<String> {
    let now = &state.now;
    let axes = state.names.axes.iter().zip(&now.rates_dph);
    let axes = axes.map(|(axis, rate)| {
        format!("{axis} {} {}", rate.map_or("–".to_owned(), |dph| units.number(dph, 5)), units.name())
    });
    let temperatures = state.names.thermometers.iter().zip(&now.temperatures_c);
    let temperatures = temperatures.map(|(name, c)| format!("{name} {} °C", c.map_or("–".to_owned(), celsius)));
    let all: Vec<String> = axes.chain(temperatures).collect();
    if state.names.axes.is_empty() || now.rates_dph.is_empty() {
        return vec!["no rows yet".to_owned()];
    }
    let mut lines = vec![format!("{}, {} rows: {}", long(now.t_s), state.counts.rows, all.join(", "))];
    let study = &state.study;
    for axis in &study.axes {
        let floor = axis.floor_dph.map_or(String::new(), |floor| format!(", noise floor {}", units.number(floor, 3)));
        lines.push(format!(
            "  axis {}: `{}`, residual σ {}{floor}, {} … {} °C",
            axis.axis,
            axis.model,
            units.text(axis.residual_dph, 3),
            celsius(axis.span_c[0]),
            celsius(axis.span_c[1])
        ));
    }
    if let Some(enough) = &study.enough {
        let least = enough.axes.iter().map(|axis| axis.probability).fold(f64::INFINITY, f64::min);
        let probability = if least.is_finite() {
            format!("probability {least:.2} if the model is right")
        } else {
            "no probability yet".into()
        };
        let hours = match (enough.met, enough.hours_to_go) {
            (true, _) => "enough".to_owned(),
            (false, Some(hours)) => format!("about {} h to go", significant(hours, 2)),
            (false, None) => "hours to go are not known".to_owned(),
        };
        let next = enough.axes.iter().find_map(|axis| axis.next.as_ref()).filter(|_| !enough.met);
        let next = next.map_or(String::new(), |step| format!(". Next: {}", step.words()));
        lines.push(format!("  {probability}, {hours}{next}"));
        lines.extend(enough.open.iter().map(|open| format!("  open: {open}")));
        lines.extend(enough.not_seen.iter().map(|what| format!("  not seen by this test: {what}")));
    } else if let Some(refused) = study.refused.as_ref() {
        lines.push(format!("  no fit yet: {refused}"));
    }
    lines
}

/// A length of time as people say it.
pub(crate) fn long(seconds: f64) -> String {
    if seconds < 120.0 {
        format!("{seconds:.0} s")
    } else if seconds < 7200.0 {
        format!("{:.0} min", seconds / 60.0)
    } else {
        format!("{:.1} h", seconds / 3600.0)
    }
}
