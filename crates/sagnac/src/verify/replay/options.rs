//! How retest logs are replayed: rows that are left out on request.

/// How retest logs are replayed.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct VerifyOptions {
    /// Leave out what looks like bumps, steps or start-up: for a bench that was bumped.
    pub exclude_outliers: bool,
    /// Leave out `discard_initial_s` at the start of each run.
    pub exclude_start: bool,
}

impl VerifyOptions {
    /// Leaves out what looks like bumps, steps or start-up. How much is a limit of its own, `excluded_max`.
    #[must_use]
    pub fn exclude_outliers(self, exclude: bool) -> Self {
        Self { exclude_outliers: exclude, ..self }
    }

    /// Leaves out `discard_initial_s` at the start of each run. How much is a limit of its own, `excluded_max`.
    #[must_use]
    pub fn exclude_start(self, exclude: bool) -> Self {
        Self { exclude_start: exclude, ..self }
    }

    pub(crate) fn excludes(self) -> bool {
        self.exclude_outliers || self.exclude_start
    }
}
