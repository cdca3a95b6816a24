//! Which faults are active, and for how long.

use crate::scenario::{Fault, FaultKind};

/// The faults of a scenario.
#[derive(Clone, Debug)]
pub(crate) struct Faults(pub(crate) Vec<Fault>);

/// A fault at an instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ActiveFault {
    pub(crate) size: f64,
    /// Time since its start.
    pub(crate) since_s: f64,
    pub(crate) duration_s: f64,
}

impl Faults {
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The latest fault of a kind that is active at a time.
    pub(crate) fn active(&self, kind: FaultKind, time_s: f64) -> Option<ActiveFault> {
        self.latest(time_s, |fault| fault.kind == kind)
    }

    /// The same for one thermometer.
    pub(crate) fn active_on(&self, sensor: usize, kind: FaultKind, time_s: f64) -> Option<ActiveFault> {
        self.latest(time_s, |fault| fault.kind == kind && fault.sensor as usize == sensor)
    }

    fn latest(&self, time_s: f64, wanted: impl Fn(&Fault) -> bool) -> Option<ActiveFault> {
        let active = self.0.iter().filter(|fault| wanted(fault)).filter_map(|fault| {
            let since_s = fault.since_s(time_s)?;
            Some(ActiveFault { size: fault.effective_size(), since_s, duration_s: fault.for_s })
        });
        active.min_by(|a, b| a.since_s.total_cmp(&b.since_s))
    }
}
