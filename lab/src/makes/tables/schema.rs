//! The JSON schema of the calibration record, and the tables of its fields on the record's page.

use std::fs;

use anyhow::Result;
use sagnac::calibration::Calibration;
use xtask::shell::root;

use crate::made::{Made, between_marks, marks};
use crate::makes::tables::fields;
use crate::places::{CALIBRATION_SCHEMA, RECORD};

pub(crate) fn make() -> Result<Vec<Made>> {
    let schema = schemars::schema_for!(Calibration);
    let tables = fields::tables(schema.as_value())? + "\n";
    let page = between_marks(&fs::read_to_string(root().join(RECORD))?, &marks("fields", "schema"), &tables)?;
    Ok(vec![Made::new(CALIBRATION_SCHEMA, serde_json::to_string_pretty(&schema)? + "\n"), Made::new(RECORD, page)])
}
