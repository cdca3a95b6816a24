//! A fit in sentences, to read before use. Terminal, page and Python show one list.

use sagnac_log::setup::RateUnit;
use sagnac_units::format::significant;

use crate::calibration::{AxisCalibration, FitDiagnostics};

/// Importance of a note.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoteLevel {
    /// True of every such fit.
    Fact,
    /// Read it before use.
    Note,
    /// Something is missing, or looks wrong.
    Warning,
}

impl NoteLevel {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fact => "fact",
            Self::Note => "note",
            Self::Warning => "warning",
        }
    }
}

/// The part of a fit that a note is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoteAbout {
    /// The prior of its fleet.
    Prior,
    /// The scale factor over the plateaus of a rate table.
    ScaleFactor,
    /// The form of the curve.
    Curve,
    /// Noise, runs and time.
    Fit,
    /// The search for its model.
    Search,
}

/// A sentence about a fit, without its full stop.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Note {
    /// How much it matters.
    pub level: NoteLevel,
    /// The part of the fit.
    pub about: NoteAbout,
    /// The words.
    pub text: String,
}

impl Note {
    fn of(level: NoteLevel, about: NoteAbout, text: impl Into<String>) -> Self {
        Self { level, about, text: text.into() }
    }
}

/// A residual that is larger than the whole noise by less is not worth a warning, however sure.
const WORTH_NAMING: f64 = 1.3;
/// A residual of this many noise floors is worth a note.
const UNEXPLAINED: f64 = 3.0;
/// A residual below this fraction of the noise floor is not noise alone.
const BELOW_FLOOR: f64 = 0.9;

impl AxisCalibration {
    /// Sentences about this axis with rates in a unit, in the order of its description.
    pub fn notes(&self, units: RateUnit) -> Vec<Note> {
        let fit = self.fit.as_ref();
        let prior = fit.and_then(|fit| fit.prior.as_ref()).map(|prior| prior.words(units));
        let asymmetry = self.scale_factor().and_then(|scale| scale.asymmetry_note(units));
        let warm_up = fit.and(self.correction.warm_up.as_ref());
        let mut notes = Vec::new();
        notes.extend(prior.map(|words| Note::of(NoteLevel::Fact, NoteAbout::Prior, words)));
        notes.extend(asymmetry.map(|note| Note::of(NoteLevel::Note, NoteAbout::ScaleFactor, note)));
        fit.into_iter().for_each(|fit| of_noise(fit, units, &mut notes));
        notes.extend(warm_up.map(|warm_up| {
            Note::of(NoteLevel::Fact, NoteAbout::Fit, format!("warm-up, corrected: {}", warm_up.words(units)))
        }));
        fit.into_iter().for_each(|fit| of_time_and_search(fit, units, &mut notes));
        notes.extend(self.below_floor_note().map(|note| Note::of(NoteLevel::Note, NoteAbout::Search, note)));
        notes
    }

    /// Why a residual well below the noise floor is no better than noise: then the floor holds more than noise.
    fn below_floor_note(&self) -> Option<&'static str> {
        let fit = self.fit.as_ref()?;
        let below = fit.residual.sigma_dph < BELOW_FLOOR * fit.noise_floor.as_ref()?.value_dph;
        if below && self.turned() {
            Some(
                "the residual is well below the noise floor: on a rate table, the floor counts the saw of quantization as noise. \
                  Set [noise] from a record at rest",
            )
        } else if below && self.other_signals().next().is_some() {
            Some(
                "the residual is well below the noise floor: the floor contains fast effects of an input. Compare with the held-out σ \
                  of other models instead",
            )
        } else {
            None
        }
    }
}

/// A residual, a curve or runs that noise does not explain.
fn of_noise(fit: &FitDiagnostics, units: RateUnit, notes: &mut Vec<Note>) {
    notes.extend(unexplained(fit, units));
    notes.extend(fit.lack_of_fit.iter().map(|lack| Note::of(NoteLevel::Warning, NoteAbout::Curve, lack.note(units))));
    let memory = fit.memory.as_ref().and_then(|memory| memory.note(units));
    notes.extend(memory.map(|text| Note::of(NoteLevel::Note, NoteAbout::Curve, text)));
    let filter_hz = fit.noise_floor.as_ref().and_then(|floor| floor.filter_hz);
    notes.extend(filter_hz.map(|hz| {
        let hz = significant(hz, 2);
        let text = format!(
            "filtered: the rows were logged behind a low-pass filter at about {hz} Hz; noise is taken from longer times"
        );
        Note::of(NoteLevel::Note, NoteAbout::Fit, text)
    }));
    if fit.noise_exceeds_setup {
        let text = "the log contains more noise than [noise] in the setup, so intervals use the log";
        notes.push(Note::of(NoteLevel::Warning, NoteAbout::Fit, text));
    }
    notes.extend(fit.hidden_in_offsets_dph.map(|hidden| {
        let text = format!(
            "each run covers few temperatures: run offsets differ by {} (σ), possibly by drift. To join the files: --one-run",
            units.text(hidden, 2)
        );
        Note::of(NoteLevel::Warning, NoteAbout::Fit, text)
    }));
}

/// A residual beyond the gyro's own noise; where that is not known, one well beyond white noise.
fn unexplained(fit: &FitDiagnostics, units: RateUnit) -> Option<Note> {
    let sigma_dph = fit.residual.sigma_dph;
    if let Some(whole) = &fit.whole_noise {
        let times = sigma_dph / whole.sigma_dph;
        let text = format!(
            "the residual is {} times the gyro's own noise, {} by the {}: this model does not explain the log (a step, a disturbance, a missing input)",
            significant(times, 2),
            units.text(whole.sigma_dph, 2),
            whole.source
        );
        let is_beyond = sigma_dph > whole.bound_dph && times > WORTH_NAMING;
        return is_beyond.then(|| Note::of(NoteLevel::Warning, NoteAbout::Fit, text));
    }
    let times = sigma_dph / fit.noise_floor.as_ref()?.value_dph;
    let text = format!(
        "the residual is {} times the white noise floor. Add a soak of an hour, or B under [noise], to separate slow noise from a step or a missing input",
        significant(times, 2)
    );
    (times > UNEXPLAINED).then(|| Note::of(NoteLevel::Note, NoteAbout::Fit, text))
}

/// Effects of time, inputs that moved together, and what the search rejected.
fn of_time_and_search(fit: &FitDiagnostics, units: RateUnit, notes: &mut Vec<Note>) {
    notes.extend(fit.time_effects.iter().map(|effect| {
        let words = effect.words(units);
        let text = format!("{words} (fitted with the terms, not corrected, and not part of residual and held-out σ)");
        Note::of(NoteLevel::Fact, NoteAbout::Fit, text)
    }));
    notes.extend(
        fit.entanglement.iter().map(|entanglement| Note::of(NoteLevel::Fact, NoteAbout::Fit, entanglement.note(units))),
    );
    notes.extend(fit.rejected_inputs.iter().map(|rejected| {
        let text = format!("input rejected: {}, {}", rejected.input, rejected.reason);
        Note::of(NoteLevel::Fact, NoteAbout::Search, text)
    }));
    notes.extend(fit.rejected_models.iter().map(|rejected| {
        let text = format!("the best model, `{}`, was rejected: {}", rejected.model, rejected.reason);
        Note::of(NoteLevel::Warning, NoteAbout::Search, text)
    }));
}
