//! The native half of the Python package: tables and paths in, results out. The package's own modules (`package/sagnac`) give them names,
//! types and plots.
//!
//! ```text
//! Python object ─package▶ (kind, name, payload) ─sources▶ LogReader ─work: without the lock, on threads of its own▶ sagnac ─▶ result
//! ```
//!
//! Nothing here computes: a record's bytes are those of `sagnac calibrate`. Errors are the package's own exceptions ([`errors`]).

mod calibration;
mod columns;
mod compensator;
mod errors;
mod noise;
mod points;
mod settings;
mod simulation;
mod sources;
mod table;
mod verification;
mod work;

/// The native module; its functions are not for users.
#[pyo3::pymodule]
mod _sagnac {
    #[pymodule_export]
    use crate::calibration::{Calibration, calibrate, compare, parse_calibration};
    #[pymodule_export]
    use crate::compensator::Compensator;
    #[pymodule_export]
    use crate::noise::{NoiseBudget, allan};
    #[pymodule_export]
    use crate::simulation::simulate;
    #[pymodule_export]
    use crate::table::Table;
    #[pymodule_export]
    use crate::verification::{Comparison, Verification};

    /// Version of the package.
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
}
