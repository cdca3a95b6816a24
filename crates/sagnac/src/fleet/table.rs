//! All results as one Parquet table: a row per unit and axis, one for a unit without a calibration.
//!
//! Written whole and in one step, in the natural order of the units. `sagnac.fleet` in the schema's metadata is its version.

use std::collections::HashMap;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use arrow_array::builder::{Float64Builder, ListBuilder, StringBuilder};
use arrow_array::cast::AsArray;
use arrow_array::{ArrayRef, BooleanArray, Float64Array, RecordBatch, StringArray};
use arrow_schema::{Field, Schema};
use parquet::arrow::ArrowWriter;

use super::common_basis::CommonBasis;
use super::result::{AxisResult, Refusal, UnitOutcome, UnitResult};
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{ParquetRead, parquet_batches, parquet_schema};
use sagnac_log::memory::MemoryBudget;
use sagnac_log::write::{parquet_properties, write_atomically};

/// Version of the schema.
const VERSION: &str = "1";
const METADATA_KEY: &str = "sagnac.fleet";

/// Rows decoded at once, and most values of a table whose rows are counted.
const BATCH_ROWS: usize = 1024;
const MOST_VALUES: u64 = 1 << 26;

/// A unit and one of its axes.
type AxisRow<'a> = (&'a UnitResult, Option<&'a AxisResult>);

pub(super) fn write(results: &[UnitResult], path: &Path) -> Result<()> {
    let rows: Vec<AxisRow<'_>> = results.iter().flat_map(rows_of).collect();
    let broken = |e: &dyn std::fmt::Display| {
        Error::input(format!("cannot write the table: {e}"), "write the fleet to another folder")
    };
    let batch = batch_of(&rows).map_err(|e| broken(&e))?;
    write_atomically(path, |out| {
        let mut writer =
            ArrowWriter::try_new(out, batch.schema(), Some(parquet_properties())).map_err(|e| broken(&e))?;
        writer.write(&batch).map_err(|e| broken(&e))?;
        writer.close().map_err(|e| broken(&e)).map(|_| ())
    })
}

/// What a table holds, without its values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct TableSummary {
    /// Rows: an axis each, or a unit without a calibration.
    pub rows: usize,
    /// Units.
    pub units: usize,
    /// Units with a calibration.
    pub calibrated: usize,
}

/// What a table of a fleet holds; `None` for any other file.
///
/// # Errors
/// A file that cannot be opened, or a table that is damaged.
pub fn table_summary(path: &Path) -> Result<Option<TableSummary>> {
    // The decoder is not ours; whatever it does with a damaged file, the file is what is bad.
    let read = std::panic::catch_unwind(|| summary(path));
    let read = read.unwrap_or_else(|_| Err(Error::damaged("Parquet file (its decoder gave up)")));
    read.map_err(|e| e.file(path.display().to_string()))
}

fn summary(path: &Path) -> Result<Option<TableSummary>> {
    let open = || File::open(path).map_err(|e| Error::io_path(path, "open", &e));
    let damaged = |e: &dyn std::fmt::Display| Error::damaged(format!("table of a fleet: {e}"));
    let schema = match parquet_schema(open()?) {
        Ok(schema) if schema.metadata().contains_key(METADATA_KEY) => schema,
        _ => return Ok(None),
    };
    let roots = ["unit", "outcome"].map(|name| schema.index_of(name).map_err(|e| damaged(&e)));
    let roots = roots.into_iter().collect::<Result<Vec<usize>>>()?;
    let memory = MemoryBudget::default();
    let read = ParquetRead { roots: Some(&roots), rows: BATCH_ROWS, values: MOST_VALUES, memory };
    let (mut out, mut before) = (TableSummary::default(), None);
    for batch in parquet_batches(open()?, &read).map_err(|e| damaged(&e))? {
        let batch = batch.map_err(|e| damaged(&e))?;
        let column = |name: &str| batch.column_by_name(name)?.as_string_view_opt();
        let (Some(units), Some(outcomes)) = (column("unit"), column("outcome")) else {
            return Err(damaged(&"a column that is not text"));
        };
        for (unit, outcome) in units.iter().zip(outcomes) {
            out.rows += 1;
            if unit.map(str::to_owned) != before {
                before = unit.map(str::to_owned);
                out.units += 1;
                out.calibrated += usize::from(outcome == Some(UnitOutcome::Calibrated.name()));
            }
        }
    }
    Ok(Some(out))
}

fn rows_of(unit: &UnitResult) -> Vec<AxisRow<'_>> {
    let axes = unit.axes.iter().map(Some).chain(unit.axes.is_empty().then_some(None));
    axes.map(|axis| (unit, axis)).collect()
}

fn batch_of(rows: &[AxisRow<'_>]) -> std::result::Result<RecordBatch, arrow_schema::ArrowError> {
    let of_axis = |value: fn(&AxisResult) -> Option<f64>| number(rows, move |(_, axis)| axis.and_then(value));
    let common = |values: fn(&CommonBasis) -> &[f64]| {
        numbers(rows, move |axis| axis.common.as_ref().map(|common| values(common).iter().copied().map(Some).collect()))
    };
    let curve =
        |column: usize| numbers(rows, move |axis| Some(axis.curve.iter().map(|point| Some(point[column])).collect()));
    let refusal = |value: fn(&Refusal) -> &str, of: fn(&UnitResult) -> &Option<Refusal>| {
        text(rows, move |(unit, _)| of(unit).as_ref().map(value))
    };
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("unit", text(rows, |(unit, _)| Some(&unit.unit))),
        ("serial", text(rows, |(unit, _)| unit.serial.as_deref())),
        ("lot", text(rows, |(unit, _)| Some(&unit.lot))),
        ("rig", text(rows, |(unit, _)| Some(&unit.rig))),
        ("axis", text(rows, |(_, axis)| axis.map(|axis| axis.axis.as_str()))),
        ("outcome", text(rows, |(unit, _)| Some(unit.outcome.name()))),
        ("reason", refusal(|refusal| &refusal.reason, |unit| &unit.refusal)),
        ("place", refusal(|refusal| &refusal.place, |unit| &unit.refusal)),
        ("time_s", number(rows, |(unit, _)| unit.time_s)),
        ("model", text(rows, |(_, axis)| axis.map(|axis| axis.model.as_str()))),
        ("with_prior", flag(rows, |axis| axis.with_prior)),
        ("reference_c", of_axis(|axis| Some(axis.reference_c))),
        ("span_low_c", of_axis(|axis| Some(axis.span_c[0]))),
        ("span_high_c", of_axis(|axis| Some(axis.span_c[1]))),
        ("lag_s", of_axis(|axis| axis.lag_s)),
        ("mean_offset_dph", of_axis(|axis| axis.mean_offset_dph)),
        ("terms", texts(rows, |axis| axis.common.as_ref().map(|common| plain(&common.terms)))),
        ("units", texts(rows, |axis| axis.common.as_ref().map(|common| plain(&common.units)))),
        ("coefficients", common(|common| &common.coefficients)),
        ("covariance", common(|common| &common.covariance)),
        ("curve_c", curve(0)),
        ("curve_dph", curve(1)),
        ("curve_sigma_dph", curve(2)),
        ("residual_dph", of_axis(|axis| axis.residual_dph)),
        ("held_out_dph", of_axis(|axis| axis.held_out_dph)),
        ("noise_floor_dph", of_axis(|axis| axis.noise_floor_dph)),
        ("n_deg_rt_h", of_axis(|axis| axis.n_deg_rt_h)),
        ("q_arcsec", of_axis(|axis| axis.q_arcsec)),
        ("bias_instability_dph", of_axis(|axis| axis.bias_instability_dph)),
        ("rate_random_walk_dph_rt_h", of_axis(|axis| axis.rate_random_walk_dph_rt_h)),
        ("scale_ppm", of_axis(|axis| axis.scale_ppm)),
        ("acceptance", text(rows, |(unit, _)| Some(unit.acceptance.name()))),
        ("limits_not_met", texts(rows, |axis| Some(axis.limits_not_met()))),
        ("limits", texts(rows, |axis| Some(axis.limits.iter().map(|limit| limit.name.as_str()).collect()))),
        ("limit_bounds", numbers(rows, |axis| Some(axis.limits.iter().map(|limit| Some(limit.bound)).collect()))),
        ("limit_values", numbers(rows, |axis| Some(axis.limits.iter().map(|limit| limit.value).collect()))),
        ("retest_reason", refusal(|refusal| &refusal.reason, |unit| &unit.retest_refusal)),
        ("retest_before_dph", of_axis(|axis| axis.retest_before_dph)),
        ("retest_after_dph", of_axis(|axis| axis.retest_after_dph)),
        ("record_sha256", text(rows, |(unit, _)| unit.record_sha256.as_deref())),
        ("proof_sha256", text(rows, |(unit, _)| unit.proof_sha256.as_deref())),
        ("key", text(rows, |(unit, _)| Some(&unit.key))),
    ];
    let field = |(name, column): &(&str, ArrayRef)| Field::new(*name, column.data_type().clone(), true);
    let metadata = HashMap::from([(METADATA_KEY.to_owned(), VERSION.to_owned())]);
    let schema = Schema::new(columns.iter().map(field).collect::<Vec<_>>()).with_metadata(metadata);
    RecordBatch::try_new(Arc::new(schema), columns.into_iter().map(|(_, column)| column).collect())
}

fn text<'a>(rows: &[AxisRow<'a>], value: impl Fn(AxisRow<'a>) -> Option<&'a str>) -> ArrayRef {
    Arc::new(StringArray::from_iter(rows.iter().map(|row| value(*row))))
}

fn number<'a>(rows: &[AxisRow<'a>], value: impl Fn(AxisRow<'a>) -> Option<f64>) -> ArrayRef {
    Arc::new(Float64Array::from_iter(rows.iter().map(|row| value(*row))))
}

fn flag(rows: &[AxisRow<'_>], value: fn(&AxisResult) -> bool) -> ArrayRef {
    Arc::new(BooleanArray::from_iter(rows.iter().map(|(_, axis)| axis.map(value))))
}

fn plain(names: &[String]) -> Vec<&str> {
    names.iter().map(String::as_str).collect()
}

fn texts<'a>(rows: &[AxisRow<'a>], values: impl Fn(&'a AxisResult) -> Option<Vec<&'a str>>) -> ArrayRef {
    let mut list = ListBuilder::new(StringBuilder::new());
    for (_, axis) in rows {
        let values = axis.and_then(&values);
        values.iter().flatten().for_each(|name| list.values().append_value(name));
        list.append(values.is_some());
    }
    Arc::new(list.finish())
}

fn numbers(rows: &[AxisRow<'_>], values: impl Fn(&AxisResult) -> Option<Vec<Option<f64>>>) -> ArrayRef {
    let mut list = ListBuilder::new(Float64Builder::new());
    for (_, axis) in rows {
        let values = axis.and_then(&values);
        values.iter().flatten().for_each(|value| list.values().append_option(*value));
        list.append(values.is_some());
    }
    Arc::new(list.finish())
}
