//! Why rows, temperatures and windows are not used, and how often.

use std::collections::BTreeMap;

use sagnac_units::format::file_name;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Why a row, a temperature or a window is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// Number of fields differs from the header's.
    Ragged,
    /// A time or count that is not a finite number.
    NotANumber,
    /// More than 1e5 °/s or 2^40 quanta in a row: no gyro turns so fast.
    ValueOutOfRange,
    /// Time before the row above.
    TimeBackwards,
    /// Time of the row above.
    DuplicateTime,
    /// More than 1.5 intervals since the row above; the row itself is used. For a cumulative counter the row covers the
    /// whole gap, up to 30 s or three intervals.
    Gap,
    /// A cumulative counter was reset: the step to this row is not known.
    CounterReset,
    /// A gap in which a cumulative counter may have wrapped more than once.
    CounterUnknown,
    /// The log's own flag.
    FlaggedInvalid,
    /// A temperature field that holds no number.
    TemperatureNotANumber,
    /// A temperature outside the thermometer's valid range.
    TemperatureInvalid,
    /// An auxiliary value outside the column's valid range.
    AuxInvalid,
    /// A temperature that jumped by more than 5 °C between rows and did not stay.
    ThermometerJump,
    /// A thermometer that stayed constant while another moved.
    ThermometerFrozen,
    /// Window within `discard_initial_s` of the start of its run.
    Settling,
    /// Window of less than a tenth of the nominal length.
    ShortWindow,
    /// Window with fewer than half of its temperatures.
    NoTemperature,
    /// First window of a run, far from what follows.
    StartUp,
    /// Window far from its neighbours (a bump, a motion).
    Motion,
    /// Window of a stretch that steps away and back.
    Step,
    /// Window at a step that lasts.
    LastingStep,
    /// Window in which the rate table changed its rate.
    TableChange,
    /// Window without a reference rate in a run that has one.
    NoReference,
}

impl Reason {
    /// Every reason.
    pub const ALL: [Self; 23] = [
        Self::Ragged,
        Self::NotANumber,
        Self::ValueOutOfRange,
        Self::TimeBackwards,
        Self::DuplicateTime,
        Self::Gap,
        Self::CounterReset,
        Self::CounterUnknown,
        Self::FlaggedInvalid,
        Self::TemperatureNotANumber,
        Self::TemperatureInvalid,
        Self::AuxInvalid,
        Self::ThermometerJump,
        Self::ThermometerFrozen,
        Self::Settling,
        Self::ShortWindow,
        Self::NoTemperature,
        Self::StartUp,
        Self::Motion,
        Self::Step,
        Self::LastingStep,
        Self::TableChange,
        Self::NoReference,
    ];

    /// The name scripts rely on.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ragged => "ragged",
            Self::NotANumber => "not_a_number",
            Self::ValueOutOfRange => "value_out_of_range",
            Self::TimeBackwards => "time_backwards",
            Self::DuplicateTime => "duplicate_time",
            Self::Gap => "gap",
            Self::CounterReset => "counter_reset",
            Self::CounterUnknown => "counter_unknown",
            Self::FlaggedInvalid => "flagged_invalid",
            Self::TemperatureNotANumber => "temperature_not_a_number",
            Self::TemperatureInvalid => "temperature_invalid",
            Self::AuxInvalid => "aux_invalid",
            Self::ThermometerJump => "thermometer_jump",
            Self::ThermometerFrozen => "thermometer_frozen",
            Self::Settling => "settling",
            Self::ShortWindow => "short_window",
            Self::NoTemperature => "no_temperature",
            Self::StartUp => "start_up",
            Self::Motion => "motion",
            Self::Step => "step",
            Self::LastingStep => "lasting_step",
            Self::TableChange => "table_change",
            Self::NoReference => "no_reference",
        }
    }
}

impl Reason {
    /// A rule of the host alone: a replay corrects such rows as the gyro's processor does, and a calibration leaves them out.
    pub fn is_replayed(self) -> bool {
        matches!(self, Self::ThermometerJump | Self::ThermometerFrozen)
    }

    /// Its meaning in a sentence.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Ragged => "The number of fields differs from the header's.",
            Self::NotANumber => "A time or count without a finite number.",
            Self::ValueOutOfRange => "More than 1e5 °/s or 2^40 quanta in a row: no gyro turns so fast.",
            Self::TimeBackwards => "Time before that of the row above.",
            Self::DuplicateTime => "Time of the row above.",
            Self::Gap => {
                "Over 1.5 intervals since the row above; the row itself is used. For a cumulative counter it covers the whole gap, up to 30 s or three intervals."
            }
            Self::CounterReset => "A cumulative counter was reset: the step to this row is not known.",
            Self::CounterUnknown => "A gap in which a cumulative counter may have wrapped more than once.",
            Self::FlaggedInvalid => "The log's own flag.",
            Self::TemperatureNotANumber => "A temperature field without a number.",
            Self::TemperatureInvalid => "A temperature outside the thermometer's valid range.",
            Self::AuxInvalid => "An auxiliary value outside the column's valid range.",
            Self::ThermometerJump => "A temperature jump of over 5 °C between rows that reverted.",
            Self::ThermometerFrozen => "A stuck thermometer: constant while another moved.",
            Self::Settling => "Within discard_initial_s of the start of the run.",
            Self::ShortWindow => "A window of less than a tenth of the nominal length.",
            Self::NoTemperature => "A window with fewer than half of its temperatures.",
            Self::StartUp => "The first window of a run, far from the next ones.",
            Self::Motion => "Far from the neighbouring windows: a bump, a motion.",
            Self::Step => "Between a step and the step back.",
            Self::LastingStep => "At a lasting step: both of its sides are kept.",
            Self::TableChange => "The rate table changed its rate within the window.",
            Self::NoReference => "No reference rate in a run that has one.",
        }
    }
}

/// How often a reason occurred, and where first.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Tally {
    /// The reason.
    pub reason: Reason,
    /// Rows of the log it concerns.
    pub rows: u64,
    /// `file:line` of the first, the file by its name alone: what a log holds does not depend on where it lies.
    pub first: String,
}

/// Tallies of one or several logs, in the order of [`Reason`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tallies(BTreeMap<Reason, (u64, String)>);

impl Tallies {
    /// Counts `rows` more for a reason.
    pub fn add(&mut self, reason: Reason, rows: u64, first: impl FnOnce() -> String) {
        self.0.entry(reason).or_insert_with(|| (0, file_name(&first()))).0 += rows;
    }

    /// Adds another log's tallies; first places stay.
    pub fn merge(&mut self, other: &Self) {
        for (reason, (rows, first)) in &other.0 {
            self.add(*reason, *rows, || first.clone());
        }
    }

    /// The reason with the most rows; of equals the first, because what is wrong with rows comes before what
    /// follows from it.
    pub fn most(&self) -> Option<Tally> {
        self.list().into_iter().rev().max_by_key(|tally| tally.rows)
    }

    /// As a list.
    pub fn list(&self) -> Vec<Tally> {
        self.0
            .iter()
            .map(|(reason, (rows, first))| Tally { reason: *reason, rows: *rows, first: first.clone() })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_is_listed_once() {
        let schema = serde_json::to_value(schemars::schema_for!(Reason)).unwrap().to_string();
        assert_eq!(schema.matches("\"const\"").count(), Reason::ALL.len());
        assert!(Reason::ALL.iter().all(|reason| schema.contains(&format!("\"const\":\"{}\"", reason.name()))));
    }

    #[test]
    fn the_most_is_the_first_of_equals() {
        let mut tallies = Tallies::default();
        tallies.add(Reason::NoTemperature, 7, String::new);
        tallies.add(Reason::TemperatureNotANumber, 7, String::new);
        tallies.add(Reason::Gap, 2, String::new);
        assert_eq!(tallies.most().map(|tally| tally.reason), Some(Reason::TemperatureNotANumber));
    }
}
