//! A running test on a terminal: the page's figures in text.
//!
//! Wide terminals show all figures, narrow ones the one that was chosen by its number. It draws what is known at the moment, at any size, and holds
//! up nobody: the recorder and the fits are on threads of their own.

use std::io::{ErrorKind, Read, Write};
use std::mem::ManuallyDrop;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::Line;
use ratatui::widgets::{Axis, Block, Chart, Dataset, GraphType, Paragraph, Wrap};
use ratatui::{DefaultTerminal, Frame};
use sagnac::{Error, Result};
use sagnac_bench::live::{Live, LiveState, TrendPoint};
use sagnac_bench::source::Stop;
use sagnac_bench::{SourceState, SourceStatus};
use sagnac_log::setup::RateUnit;
use sagnac_units::format::{printable, significant};

use crate::verbs::bench::lines::{lines_of, long};

/// Time between two drawings.
const EVERY: Duration = Duration::from_millis(250);
/// From this size on all figures are shown.
const WIDE: (u16, u16) = (110, 34);
/// Lines of warnings and events.
const NEWS: u16 = 6;
const COLOURS: [Color; 6] =
    [Color::LightBlue, Color::LightRed, Color::LightGreen, Color::LightMagenta, Color::LightYellow, Color::LightCyan];

/// What is drawn.
pub(crate) struct View<'a> {
    pub(crate) title: &'a str,
    pub(crate) state: &'a LiveState,
    pub(crate) sources: &'a [SourceStatus],
    /// Figure that a narrow terminal shows, from 0.
    pub(crate) chosen: usize,
    pub(crate) units: RateUnit,
}

/// The terminal; it is as before when this ends.
pub(crate) struct BenchScreen {
    /// Its own drop writes to standard error, and panics where that is gone too.
    terminal: ManuallyDrop<DefaultTerminal>,
    title: String,
    chosen: usize,
    /// Keys were asked to end the recording once.
    asked: bool,
    keys: Receiver<u8>,
    units: RateUnit,
}

impl BenchScreen {
    /// Takes the terminal over.
    pub(crate) fn begin(title: &str, units: RateUnit) -> Result<Self> {
        let terminal = ratatui::try_init()
            .map(ManuallyDrop::new)
            .map_err(|e| Error::input(format!("cannot draw on this terminal: {e}"), "remove --tui"))?;
        Ok(Self { terminal, title: printable(title).into_owned(), chosen: 0, asked: false, keys: keys(), units })
    }

    /// The unit of its rates.
    pub(crate) fn units(&self) -> RateUnit {
        self.units
    }

    /// Draws what is known, and waits for a key or a moment.
    pub(crate) fn show(&mut self, live: &Live, sources: &[SourceStatus], stop: &Stop) -> Result<()> {
        let failed = |e: std::io::Error| Error::input(format!("cannot draw on this terminal: {e}"), "remove --tui");
        let (title, chosen, units, terminal) = (&self.title, self.chosen, self.units, &mut self.terminal);
        live.look(|state| {
            terminal
                .draw(|frame| draw(frame, &View { title, state, sources, chosen, units }))
                .map(|_| ())
                .map_err(failed)
        })?;
        match self.keys.recv_timeout(EVERY) {
            Ok(key) => self.key(key, stop),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(failed(ErrorKind::UnexpectedEof.into())),
        }
        Ok(())
    }

    fn key(&mut self, key: u8, stop: &Stop) {
        match key {
            // A terminal in this mode sends Ctrl-C as a key.
            CTRL_C | b'q' => {
                if std::mem::replace(&mut self.asked, true) {
                    crate::files::interrupt::leave();
                }
                stop.stop();
            }
            b'1'..=b'5' => self.chosen = usize::from(key - b'1'),
            b'\t' => self.chosen = (self.chosen + 1) % FIGURES.len(),
            _ => {}
        }
    }
}

/// Ctrl-C in raw mode.
const CTRL_C: u8 = 3;

/// The keys of standard input. It ends with the terminal: a library that polls one that has gone away never returns.
fn keys() -> Receiver<u8> {
    let (to, keys) = sync_channel(16);
    let read = move || {
        let mut key = [0];
        while std::io::stdin().read(&mut key).is_ok_and(|read| read == 1) {
            if to.send(key[0]).is_err() {
                return;
            }
        }
    };
    // Without the thread the keys are gone, and the recording is shown in lines.
    let _ = sagnac_log::threads::spawn("keys", read);
    keys
}

impl Drop for BenchScreen {
    fn drop(&mut self) {
        // Where the terminal is gone there is nothing to restore, and nobody to say so to.
        let _ = self.terminal.show_cursor();
        let _ = ratatui::try_restore();
        let _ = std::io::stdout().flush();
    }
}

/// The figures, in the order of their keys.
const FIGURES: [fn(&mut Frame<'_>, Rect, &View<'_>); 5] = [rate, temperature, residual, known, allan];

/// Draws everything.
pub(crate) fn draw(frame: &mut Frame<'_>, view: &View<'_>) {
    let area = frame.area();
    let words = words(view);
    let width = usize::from(area.width.max(1));
    let lines: u16 = words.iter().map(|line| line.width().div_ceil(width).max(1) as u16).sum();
    let top = lines.min(area.height / 2);
    let is_wide = area.width >= WIDE.0 && area.height >= WIDE.1;
    let [head, figures, news] =
        Layout::vertical([Constraint::Length(top), Constraint::Fill(1), Constraint::Length(NEWS.min(area.height / 4))])
            .areas(area);
    frame.render_widget(Paragraph::new(words).wrap(Wrap { trim: false }), head);
    if is_wide {
        let [upper, lower] = Layout::vertical([Constraint::Fill(1), Constraint::Fill(1)]).areas(figures);
        let [one, two] = Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)]).areas(upper);
        let [three, four, five] =
            Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1), Constraint::Fill(1)]).areas(lower);
        FIGURES.iter().zip([one, two, three, four, five]).for_each(|(figure, area)| figure(frame, area, view));
    } else if let Some(figure) = FIGURES.get(view.chosen) {
        figure(frame, figures, view);
    }
    frame.render_widget(Paragraph::new(news_of(view.state, news.height)).wrap(Wrap { trim: false }), news);
}

fn words(view: &View<'_>) -> Vec<Line<'static>> {
    let state = view.state;
    let bold = Style::default().add_modifier(Modifier::BOLD);
    let mut all = vec![Line::styled(
        format!("{}   {}   keys: 1–5 figure, q ends the recording", view.title, long(state.now.t_s)),
        bold,
    )];
    let silent = view.sources.iter().filter(|source| matches!(source.state, SourceState::Silent | SourceState::Lost));
    for source in silent {
        let word =
            if source.state == SourceState::Lost { format!("lost: {}", source.why) } else { "silent".to_owned() };
        all.push(Line::styled(printable(&format!("{} is {word}", source.name)).into_owned(), Color::LightRed));
    }
    all.extend(lines_of(state, view.units).into_iter().map(|line| Line::raw(printable(&line).into_owned())));
    all
}

/// Warnings that hold, then the newest events.
fn news_of(state: &LiveState, lines: u16) -> Vec<Line<'static>> {
    let holding = state.warnings.iter().filter(|warning| warning.until_s.is_none());
    let warnings = holding.map(|w| Line::styled(format!("⚠ {}", printable(&w.words)), Color::LightRed));
    let events = state.events.iter().rev().map(|event| Line::raw(printable(&event.what).into_owned()));
    warnings.chain(events).take(usize::from(lines)).collect()
}

/// Points of one curve.
struct ScreenCurve {
    name: String,
    points: Vec<(f64, f64)>,
    dots: bool,
}

/// A chart of curves; it says so where there is nothing to draw.
fn chart(frame: &mut Frame<'_>, area: Rect, title: &str, units: [&str; 2], curves: &[ScreenCurve]) {
    let block = Block::bordered().title(title.to_owned());
    let all = || curves.iter().flat_map(|curve| &curve.points);
    let bounds = |coordinate: fn(&(f64, f64)) -> f64| {
        all().map(coordinate).fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(v), hi.max(v)])
    };
    let ([x_lo, x_hi], [y_lo, y_hi]) = (bounds(|p| p.0), bounds(|p| p.1));
    if !(x_lo < x_hi && y_lo.is_finite() && y_hi.is_finite()) {
        frame.render_widget(Paragraph::new("nothing to draw yet").block(block), area);
        return;
    }
    let margin = ((y_hi - y_lo) * 0.05).max(y_hi.abs().max(1e-9) * 1e-3);
    let (y_lo, y_hi) = (y_lo - margin, y_hi + margin);
    let label = |value: f64| significant(value, 3);
    let axis = |name: &str, lo: f64, hi: f64| {
        let labels = [label(lo), label(f64::midpoint(lo, hi)), label(hi)];
        Axis::default().title(name.to_owned()).bounds([lo, hi]).labels(labels).style(Color::Gray)
    };
    let sets = curves.iter().enumerate().map(|(at, curve)| {
        let (kind, marker) =
            if curve.dots { (GraphType::Scatter, Marker::Dot) } else { (GraphType::Line, Marker::Braille) };
        Dataset::default()
            .name(curve.name.clone())
            .marker(marker)
            .graph_type(kind)
            .style(COLOURS[at % COLOURS.len()])
            .data(&curve.points)
    });
    let chart =
        Chart::new(sets.collect()).block(block).x_axis(axis(units[0], x_lo, x_hi)).y_axis(axis(units[1], y_lo, y_hi));
    frame.render_widget(chart, area);
}

/// A curve for each name, of the points that have its value.
fn curves<N: std::fmt::Display>(
    names: &[N],
    points: &[TrendPoint],
    scale: f64,
    of: fn(&TrendPoint) -> &[Option<f64>],
) -> Vec<ScreenCurve> {
    let curve = |(at, name): (usize, &N)| {
        let known = points.iter().filter_map(|point| Some((point.t_s / scale, (*of(point).get(at)?)?)));
        ScreenCurve { name: name.to_string(), points: known.collect(), dots: false }
    };
    names.iter().enumerate().map(curve).collect()
}

fn rate(frame: &mut Frame<'_>, area: Rect, view: &View<'_>) {
    let state = view.state;
    let mut all = curves(&state.names.axes, &state.seconds(), 60.0, |point| &point.rates_dph);
    all.iter_mut().flat_map(|curve| &mut curve.points).for_each(|point| point.1 = view.units.of_dph(point.1));
    chart(frame, area, "1 rate, last ten minutes", ["min", view.units.name()], &all);
}

fn temperature(frame: &mut Frame<'_>, area: Rect, view: &View<'_>) {
    let state = view.state;
    let mut points = state.means();
    let end_s = points.last().map_or(f64::NEG_INFINITY, |point| point.t_s);
    points.extend(state.seconds().into_iter().filter(|point| point.t_s > end_s));
    let all = curves(&state.names.thermometers, &points, 3600.0, |point| &point.temperatures_c);
    chart(frame, area, "2 temperature", ["h", "°C"], &all);
}

fn residual(frame: &mut Frame<'_>, area: Rect, view: &View<'_>) {
    let curve = |axis: &sagnac_bench::live::StudyAxis| ScreenCurve {
        name: axis.axis.to_string(),
        points: axis.residuals.iter().map(|point| (point.temperature_c, view.units.of_dph(point.after_dph))).collect(),
        dots: true,
    };
    let all: Vec<ScreenCurve> = view.state.study.axes.iter().map(curve).collect();
    chart(frame, area, "3 residual on the fit so far", ["°C", view.units.name()], &all);
}

fn known(frame: &mut Frame<'_>, area: Rect, view: &View<'_>) {
    let curve = |axis: &sagnac_bench::live::StudyAxis| ScreenCurve {
        name: axis.axis.to_string(),
        points: axis.curve.iter().map(|at| (at.temperature_c, view.units.of_dph(at.half_dph))).collect(),
        dots: false,
    };
    let all: Vec<ScreenCurve> = view.state.study.axes.iter().map(curve).collect();
    chart(frame, area, "4 half of the curve's 95 % interval", ["°C", view.units.name()], &all);
}

fn allan(frame: &mut Frame<'_>, area: Rect, view: &View<'_>) {
    let drawn = |(axis, curve): &(char, Vec<sagnac_bench::live::DeviationAt>)| ScreenCurve {
        name: axis.to_string(),
        points: curve
            .iter()
            .filter(|at| at.adev_dph > 0.0)
            .map(|at| (at.tau_s.log10(), view.units.of_dph(at.adev_dph).log10()))
            .collect(),
        dots: false,
    };
    let all: Vec<ScreenCurve> = view.state.study.allan.iter().map(drawn).collect();
    chart(frame, area, "5 Allan deviation so far", ["log10 τ/s", &format!("log10 {}", view.units.name())], &all);
}

#[cfg(test)]
mod tests {
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    use super::*;

    fn text(view: &View<'_>, width: u16, height: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| draw(frame, view)).unwrap();
        let buffer = terminal.backend().buffer();
        let line = |y: u16| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>();
        (0..height).map(|y| line(y) + "\n").collect()
    }

    fn state() -> LiveState {
        let mut state = LiveState::default();
        state.names.axes.push('z');
        state.names.thermometers.push("block".to_owned());
        state
    }

    /// Any size is drawn, and what is wrong is in it.
    #[test]
    fn every_size_is_drawn() {
        let mut state = state();
        state.warnings.push(sagnac_bench::live::Warning {
            kind: sagnac_bench::live::WarningKind::Light,
            place: "light".into(),
            words: "the light is\u{1b}[31m dim".into(),
            since_s: 60.0,
            until_s: None,
        });
        let mut silent = SourceStatus::waiting("the gyro".into(), 3.0);
        silent.state = SourceState::Silent;
        for (width, height) in [(1, 1), (20, 5), (60, 20), (80, 24), (200, 60)] {
            let view = View {
                title: "RLG-7",
                state: &state,
                sources: std::slice::from_ref(&silent),
                chosen: 1,
                units: RateUnit::DegPerHour,
            };
            let shown = text(&view, width, height);
            if width >= 60 {
                assert!(shown.contains("RLG-7") && shown.contains("the gyro is silent"), "{shown}");
                assert!(shown.contains("⚠ the light is"), "{shown}");
                assert!(shown.contains("2 temperature"), "{shown}");
            }
            assert!(!shown.contains('\u{1b}'), "an escape of a log controls the terminal");
            assert_eq!(shown.contains("5 Allan"), width >= WIDE.0 && height >= WIDE.1);
        }
    }
}
