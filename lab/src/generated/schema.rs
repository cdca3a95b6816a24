//! The JSON schema of the calibration record.

use anyhow::Result;
use sagnac::calibration::Calibration;

use crate::bless::Made;
use crate::places::CALIBRATION_SCHEMA;

pub(crate) fn make() -> Result<Vec<Made>> {
    let schema = schemars::schema_for!(Calibration);
    Ok(vec![Made::new(CALIBRATION_SCHEMA, serde_json::to_string_pretty(&schema)? + "\n")])
}
