//! `--units`: the unit of rates in text and reports.

use clap::Args;
use sagnac_log::setup::{RateUnit, Setup};

/// Overrides `units` in the setup.
#[derive(Args, Clone, Copy, Default)]
pub(crate) struct UnitsArgs {
    /// Unit of rates in text and report: dph, dps, mdps or radps [default: `units` in the setup, or dph]. JSON and files keep °/h
    #[arg(long, value_name = "UNIT", hide_short_help = true)]
    units: Option<RateUnit>,
}

impl UnitsArgs {
    /// The flag, else that of the setup, else °/h.
    pub(crate) fn over(self, setup: &Setup) -> RateUnit {
        self.units.or(setup.units).unwrap_or_default()
    }
}
