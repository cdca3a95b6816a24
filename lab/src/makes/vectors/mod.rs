//! The reference vectors in `testdata/vectors/`, made from the core, only after an intended change.

mod correction;
mod counting;
mod loops;

use anyhow::Result;

use self::correction::{
    compensator_edges, compensator_full, compensator_harmonic, compensator_inputs, compensator_lags, compensator_paper,
    compensator_warm_up,
};
use self::counting::{quadrature, stripper, watch};
use self::loops::{intensity, loops, path_length};
use crate::made::Made;
use crate::makes::image;

pub(crate) fn make() -> Result<Vec<Made>> {
    let mirror = loops("triangle-28cm-dithered", true)?;
    let heater = loops("prism-heater-loop", false)?;
    Ok(vec![
        // SAG-CORE-001, SAG-CORE-002, SAG-CORE-005, SAG-CORE-006, SAG-CORE-007, SAG-CORE-011, SAG-CORE-012, SAG-CORE-013
        compensator_full()?.made("compensator-full")?,
        // SAG-CORE-007, SAG-CORE-011, SAG-CORE-012, SAG-CORE-013
        compensator_paper(&image::paper_image()?)?.made("compensator-paper")?,
        // SAG-CORE-008, SAG-CORE-010, SAG-CORE-011
        compensator_inputs()?.made("compensator-inputs")?,
        // SAG-CORE-006, SAG-CORE-009, SAG-CORE-010
        compensator_harmonic()?.made("compensator-harmonic")?,
        // SAG-CORE-003, SAG-CORE-004, SAG-CORE-005, SAG-CORE-010
        compensator_lags()?.made("compensator-lags")?,
        // SAG-CORE-010, SAG-CORE-020
        compensator_warm_up()?.made("compensator-warm-up")?,
        // SAG-CORE-006, SAG-CORE-010, SAG-CORE-014, SAG-CORE-015, SAG-CORE-016, SAG-CORE-017, SAG-CORE-020
        compensator_edges(9, 1)?.made("compensator-edges")?,
        compensator_edges(1 << 30, 41)?.made("compensator-advance")?,
        // SAG-CORE-014, SAG-CORE-015, SAG-CORE-016, SAG-CORE-017
        compensator_edges(9, 41)?.made("compensator-limits")?,
        path_length(&mirror, 1, 1500)?.made("path-length-mirror")?,
        path_length(&heater, 25, 400)?.made("path-length-heater")?,
        intensity(&mirror.table)?.made("intensity")?,
        quadrature()?.made("quadrature")?,
        stripper()?.made("stripper")?,
        // SAG-CORE-024, SAG-CORE-025
        watch()?.made("watch")?,
    ])
}
