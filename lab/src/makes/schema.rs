//! The JSON schema of the calibration record, and the tables of its fields on the record's page.

use std::fs;

use anyhow::Result;
use sagnac::calibration::Calibration;
use xtask::shell::root;

use crate::made::Made;
use crate::makes::fields;
use crate::places::{CALIBRATION_SCHEMA, RECORD};

pub(crate) fn make() -> Result<Vec<Made>> {
    let schema = schemars::schema_for!(Calibration);
    let page = fields::between_marks(&fs::read_to_string(root().join(RECORD))?, schema.as_value())?;
    Ok(vec![Made::new(CALIBRATION_SCHEMA, serde_json::to_string_pretty(&schema)? + "\n"), Made::new(RECORD, page)])
}
