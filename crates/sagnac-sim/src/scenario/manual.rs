//! The manual of the scenario file: every table and key, from the declarations that read them.

use crate::scenario::fault::Fault;
use crate::scenario::section::{KeyDoc, Section};
use crate::scenario::tables::{
    BiasConfig, BlockConfig, CavityConfig, ChamberConfig, DitherConfig, ElectronicsConfig, GeometryConfig, InputConfig,
    IntensityControlConfig, NoiseConfig, PathLengthControlConfig, ReadoutConfig, RunConfig, ScaleFactorConfig,
    ThermometerConfig,
};

/// A table of the manual.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct TableDoc {
    /// Name in the file.
    pub path: &'static str,
    /// Description.
    pub about: &'static str,
    /// Its keys.
    pub keys: &'static [KeyDoc],
}

const fn table<S: Section>() -> TableDoc {
    TableDoc { path: S::PATH, about: S::ABOUT, keys: S::KEYS }
}

/// Every table of a scenario file with its keys.
pub fn manual() -> Vec<TableDoc> {
    vec![
        table::<RunConfig>(),
        table::<GeometryConfig>(),
        table::<CavityConfig>(),
        table::<DitherConfig>(),
        table::<ReadoutConfig>(),
        table::<BlockConfig>(),
        table::<BiasConfig>(),
        table::<ScaleFactorConfig>(),
        table::<PathLengthControlConfig>(),
        table::<IntensityControlConfig>(),
        table::<NoiseConfig>(),
        table::<ThermometerConfig>(),
        table::<ElectronicsConfig>(),
        table::<ChamberConfig>(),
        table::<InputConfig>(),
        table::<Fault>(),
    ]
}
