//! `limits.toml`: what a retest must show. Every key is optional; unknown keys are refused.
//!
//! Two sets come with the program, by name: `navigation-grade` and `paper`; `base` starts from one of them. A limit whose value
//! cannot be had is not met. Those of a rate table are asked only of a retest on one, those of a gyro at rest only of one at
//! rest: what is not asked is listed as such, and never counts as met.

use std::path::Path;

use crate::verify::limits::source::LimitsSource;
use crate::verify::limits::table::{EXCLUDED, LimitSpec, Limits, SPECS};
use crate::verify::limits::verdict::Verdict;
use crate::verify::result::AxisVerification;
use sagnac_log::error::{Error, Result};
use sagnac_log::read::read_text;

/// Sets that come with the program.
pub const SETS: [(&str, &str); 2] =
    [("navigation-grade", include_str!("sets/navigation-grade.toml")), ("paper", include_str!("sets/paper.toml"))];

impl Limits {
    /// Reads a limits file.
    ///
    /// # Errors
    /// Unreadable, an unknown key, a limit below zero or no number.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let name = path.display().to_string();
        let sets = Error::choices(&SETS.map(|(set, _)| set.to_owned()));
        let text = read_text(path, "read the limits", 1 << 20)
            .map_err(|e| e.help(format!("give a TOML file, or one of the sets: {sets}")))?;
        Self::of_text(&name, &text)
    }

    fn of_text(name: &str, text: &str) -> Result<Self> {
        let limits = Self::parse(text).map_err(|e| e.file(name))?;
        let set = SETS.iter().find(|(set, _)| limits.base.as_deref() == Some(*set));
        let base = set.map(|(set, text)| Box::new(LimitsSource::of(set, text)));
        let (decision, specification) = (Some(limits.decision.unwrap_or_default()), limits.specification.clone());
        Ok(Self { source: LimitsSource { base, decision, specification, ..LimitsSource::of(name, text) }, ..limits })
    }

    /// Parses the text of a limits file.
    ///
    /// # Errors
    /// As [`Limits::read`].
    pub fn parse(text: &str) -> Result<Self> {
        let own: Self = toml::from_str(text).map_err(|e| {
            Error::toml("limits", text, &e, "correct the key: docs/reference/limits.md lists all of them")
        })?;
        let limits = own.on_base()?;
        limits.check()?;
        Ok(limits)
    }

    /// Checks every value against its range.
    ///
    /// # Errors
    /// The first value outside its range, by its key.
    pub(crate) fn check(&self) -> Result<()> {
        for (spec, value) in self.given() {
            if !value.is_finite() || !(0.0..=spec.largest).contains(&value) {
                return Err(Error::input(
                    "a limit must be zero or more, and at most 1 for a fraction",
                    "correct the value in the limits file",
                )
                .column(spec.key)
                .value(value.to_string()));
            }
        }
        if let Some(flight) = &self.flight {
            flight.check()?;
        }
        if let Some(specification) = &self.specification {
            specification.check()?;
            let is_limit = |key: &&String| SPECS.iter().any(|spec| spec.key == **key);
            if let Some(unknown) = specification.paragraphs.keys().find(|key| !is_limit(key)) {
                return Err(Error::input(
                    "there is no limit of this name",
                    "correct the key: docs/reference/limits.md lists all of them",
                )
                .column("specification.paragraphs")
                .value(unknown.clone()));
            }
        }
        if self.position_error_m_max.is_some() && self.flight.is_none() {
            return Err(Error::input(
                "a limit on the position error needs a [flight]",
                "add [flight] with axis = \"level\" and profile = [{ minutes = 0, temperature_c = 20 }, …]",
            )
            .column("position_error_m_max"));
        }
        if self.given().is_empty() && self.flight.is_none() {
            return Err(Error::input(
                "the limits file contains no limit",
                "correct the key: docs/reference/limits.md lists all of them",
            ));
        }
        Ok(())
    }

    /// A set that comes with the program, by its name, else a file.
    ///
    /// # Errors
    /// As [`Limits::read`].
    pub fn named_or_read(name: &str) -> Result<Self> {
        match SETS.iter().find(|(set, _)| *set == name) {
            Some((set, text)) => Self::of_text(set, text),
            None => Self::read(Path::new(name)),
        }
    }

    /// With the limits of its base where it gives none.
    fn on_base(self) -> Result<Self> {
        let Some(name) = self.base.clone() else { return Ok(self) };
        let Some((_, text)) = SETS.iter().find(|(set, _)| *set == name) else {
            let sets = Error::choices(&SETS.map(|(set, _)| set.to_owned()));
            return Err(Error::input("there is no set of this name", format!("choose one of: {sets}"))
                .column("base")
                .value(name));
        };
        let table = |limits: &Self| {
            toml::Table::try_from(limits).map_err(|e| Error::defect(format!("the limits cannot be joined: {e}")))
        };
        let mut joined = table(&Self::parse(text)?)?;
        joined.extend(table(&self)?);
        joined.try_into().map_err(|e| Error::defect(format!("the limits cannot be joined: {e}")))
    }

    /// True where it holds a limit, not a flight alone.
    pub(crate) fn asks(&self) -> bool {
        !self.given().is_empty()
    }

    /// The limits that the file gives, with their values.
    pub(crate) fn given(&self) -> Vec<(&'static LimitSpec, f64)> {
        SPECS.iter().filter_map(|spec| Some((spec, (spec.stated)(self)?))).collect()
    }

    /// Judges a run alone by the limits that each run must meet and has a value for.
    pub(crate) fn judge_run(&self, axis: &AxisVerification) -> Vec<Verdict> {
        let rule = self.decision.unwrap_or_default();
        let of_run = self.asked_of(axis).filter(|(spec, _)| spec.is_of_each_run());
        of_run.map(|(spec, limit)| spec.judge(limit, axis, rule)).filter(|verdict| verdict.value.is_some()).collect()
    }

    /// Judges an axis by every limit given, and by how much was excluded.
    pub(crate) fn judge(&self, axis: &AxisVerification) -> Vec<Verdict> {
        let rule = self.decision.unwrap_or_default();
        self.asked_of(axis).map(|(spec, limit)| spec.judge(limit, axis, rule)).collect()
    }

    /// The limits given, and how much may be excluded where something was and the file does not state it.
    fn asked_of(&self, axis: &AxisVerification) -> impl Iterator<Item = (&'static LimitSpec, f64)> {
        let implied = self.excluded_max.is_none() && axis.left_out_fraction().is_some();
        let excluded = implied.then(|| SPECS.iter().find(|spec| spec.key == EXCLUDED)).flatten();
        self.given().into_iter().chain(excluded.map(|spec| (spec, DEFAULT_EXCLUDED_MAX)))
    }
}

/// Part of the rows that may be excluded where a file does not state it.
const DEFAULT_EXCLUDED_MAX: f64 = 0.005;

impl std::str::FromStr for Limits {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::parse(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The documentation holds the sets word for word.
    #[test]
    fn the_sets_stand_in_the_documentation() {
        let page = include_str!("../../../../../docs/reference/limits.md");
        for (name, text) in SETS {
            assert!(page.contains(text), "{name} in docs/reference/limits.md is another");
        }
    }

    #[test]
    fn the_sets_are_limits() {
        for (name, _) in SETS {
            let limits = Limits::named_or_read(name).unwrap();
            assert!(limits.given().len() >= 3, "{name}");
        }
        let joined = Limits::parse("base = \"navigation-grade\"\nhysteresis_dph_max = 0.5").unwrap();
        let set = Limits::named_or_read("navigation-grade").unwrap();
        assert_eq!((joined.hysteresis_dph_max, joined.arw_deg_rt_h_max), (Some(0.5), set.arw_deg_rt_h_max));
        assert_eq!(joined.given().len(), set.given().len());
        assert!(Limits::parse("base = \"nav-grade\"").is_err());
        assert!(Limits::parse("span_covered_min = 90.0").is_err());
        assert!(Limits::parse("position_error_m_max = 100.0").is_err());
        assert!(Limits::named_or_read("no such file or set").is_err());
    }
}
