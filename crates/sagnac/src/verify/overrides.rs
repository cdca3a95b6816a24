//! What was stated otherwise for a retest than for its calibration, or in limits than in their base set: the end of the verdict's line.

use sagnac_units::format::significant;
use serde::{Deserialize, Serialize};

use sagnac_log::setup::RateUnit;

/// Something that was stated otherwise for the retest than for its calibration, or in limits than in their base set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "what", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Override {
    /// The input rate along an axis, °/h.
    InputRate {
        /// Axis letter.
        axis: char,
        /// Of the calibration.
        calibration_dph: f64,
        /// Of the retest.
        retest_dph: f64,
    },
    /// The length of a window, s.
    Window {
        /// Of the calibration.
        calibration_s: f64,
        /// Of the retest.
        retest_s: f64,
    },
    /// A limit that is easier to meet than that of the base set.
    Limit {
        /// Its key.
        name: String,
        /// In the base set.
        base: f64,
        /// In the file.
        stated: f64,
    },
    /// The base set asks for a guard band, and the file for the value alone.
    Decision,
    /// The file has no other limit than this.
    SingleLimit {
        /// Its key.
        name: String,
    },
}

impl Override {
    /// With its values, in a unit of rates.
    pub fn words(&self, units: RateUnit) -> String {
        match self {
            Self::InputRate { axis, calibration_dph, retest_dph } => {
                let [calibration, retest] = [calibration_dph, retest_dph].map(|dph| units.text(*dph, 5));
                format!("input rate of axis {axis}: {calibration} in the calibration, {retest} in the retest")
            }
            Self::Window { calibration_s, retest_s } => {
                let [calibration, retest] = [calibration_s, retest_s].map(|seconds| significant(*seconds, 6));
                format!("window: {calibration} s in the calibration, {retest} s in the retest")
            }
            Self::Limit { name, base, stated } => format!("{name}: {base} in the base set, {stated} in the file"),
            Self::Decision => "decision: guarded in the base set, simple in the file".to_owned(),
            Self::SingleLimit { name } => format!("no other limit than {name}"),
        }
    }
}

/// `input rate, 2 limits`: the kinds of these, each once; empty without any.
pub(crate) fn kinds(overrides: &[Override]) -> String {
    let limits = overrides.iter().filter(|one| matches!(one, Override::Limit { .. })).count();
    let has = |is_kind: fn(&Override) -> bool, name: &str| overrides.iter().any(is_kind).then(|| name.to_owned());
    let all = [
        has(|one| matches!(one, Override::InputRate { .. }), "input rate"),
        has(|one| matches!(one, Override::Window { .. }), "window"),
        match limits {
            0 => None,
            1 => Some("1 limit".to_owned()),
            n => Some(format!("{n} limits")),
        },
        has(|one| matches!(one, Override::Decision), "decision"),
        has(|one| matches!(one, Override::SingleLimit { .. }), "a single limit"),
    ];
    all.into_iter().flatten().collect::<Vec<_>>().join(", ")
}
