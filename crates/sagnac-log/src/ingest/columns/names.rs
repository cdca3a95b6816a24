//! Which columns of a log are recognised: `Gyro X (deg/s)` is read as `rate_dps_x`, next to the other columns.
//!
//! A header is recognised where its words name a quantity and a unit is stated (`words.rs`): in brackets, in a line of
//! units, or as a word. A header that begins with Sagnac's own word (`temperature`, `rate`, `counts`, `time`) is read as that column always.
//! Any other is looked for only where no column has Sagnac's own name of its quantity. Of two columns that may be the same thermometer
//! neither is recognised; where two may be one rate, no rate is.

use std::collections::BTreeMap;

use crate::ingest::columns::header::{Role, role_of};
use crate::ingest::columns::iso::iso_ns;
use crate::ingest::columns::number::ISO_8601;
pub use crate::ingest::columns::words::{HeaderQuantity, HeaderUnit, Named};
use sagnac_units::format::controls;

/// Sagnac's header for a column whose header states quantity and unit, or whose first cell is a date; and whether it begins as Sagnac's own.
fn certain(header: &str, unit: Option<&str>, cell: Option<&str>) -> Option<(String, bool)> {
    let named = Named::of(header, unit)?;
    let is_own = named.is_own();
    if named.quantity == HeaderQuantity::Time && cell.is_some_and(|cell| iso_ns(cell).is_some()) {
        return Some(("time".to_owned(), is_own));
    }
    let is_clear = named.by_unit.is_none() && (is_own || named.quantity != HeaderQuantity::Counts);
    match named.unit {
        HeaderUnit::Known(ending) if is_clear => Some((named.role(ending), is_own)),
        _ => None,
    }
}

fn quantity_of(header: &str) -> Option<HeaderQuantity> {
    match role_of(header).ok()? {
        Role::Time { .. } => Some(HeaderQuantity::Time),
        Role::Temperature { .. } => Some(HeaderQuantity::Temperature),
        // One stands for the other: both are an axis.
        Role::Counts { .. } | Role::Rate { .. } => Some(HeaderQuantity::Rate),
        _ => None,
    }
}

/// True for a header whose words state an axis and the unit of its rate or counts.
pub(crate) fn is_axis(header: &str) -> bool {
    certain(header, None, None).is_some_and(|(role, _)| quantity_of(&role) == Some(HeaderQuantity::Rate))
}

/// Whether a header may be recognised: as it stands it is none of Sagnac's, or not a whole one.
fn is_open(header: &str, unit: Option<&str>) -> bool {
    match role_of(header) {
        Ok(Role::Ignored) => !header.is_empty(),
        // A column of this name holds dates, unless a line of units says seconds.
        Ok(Role::Time { places: ISO_8601 }) => unit.is_some(),
        Ok(_) => false,
        // One of Sagnac's words whose unit stands elsewhere: no column of corrected rows, and no name with control characters.
        Err(_) => !header.contains(controls) && Named::of(header, unit).is_some_and(|named| named.is_own()),
    }
}

/// Sagnac's header of each column that is recognised. `units` and `cells` are the line of units and the first row, empty where there is none;
/// `columns` is the setup's map.
pub fn recognised(
    headers: &[String],
    units: &[String],
    cells: &[String],
    columns: &BTreeMap<String, String>,
) -> Vec<Option<String>> {
    let own = |header: &String| quantity_of(columns.get(header).unwrap_or(header));
    let one = |(at, header): (usize, &String)| {
        let unit = units.get(at).map(String::as_str).filter(|unit| !unit.is_empty());
        let is_free = !columns.contains_key(header) && is_open(header, unit);
        let (role, is_own) = is_free.then(|| certain(header, unit, cells.get(at).map(String::as_str)))??;
        // An ending that is no letter of an axis, or a control character, is no header of ours.
        Some((quantity_of(&role)?, role, is_own))
    };
    let all: Vec<Option<(HeaderQuantity, String, bool)>> = headers.iter().enumerate().map(one).collect();
    let of_own = all.iter().flatten().filter(|(.., is_own)| *is_own).map(|(quantity, ..)| *quantity);
    let open = headers.iter().zip(&all).filter(|(_, one)| one.is_none()).filter_map(|(header, _)| own(header));
    let known: Vec<HeaderQuantity> = of_own.chain(open).collect();
    let found = |(quantity, _, is_own): &&(HeaderQuantity, String, bool)| *is_own || !known.contains(quantity);
    let all: Vec<Option<(HeaderQuantity, String, bool)>> =
        all.iter().map(|one| one.as_ref().filter(found).cloned()).collect();
    // Of several times the first is read; which of two rates or thermometers is meant, no header says.
    let is_first_time = |at: usize| !all[..at].iter().flatten().any(|(quantity, ..)| *quantity == HeaderQuantity::Time);
    let is_alone = |role: &String| all.iter().flatten().filter(|(_, other, _)| same_place(other, role)).count() == 1;
    // A log read without one of its axes would look whole: where one is open, all are.
    let are_rates_clear =
        all.iter().flatten().filter(|one| one.0 == HeaderQuantity::Rate).all(|(_, role, _)| is_alone(role));
    let keep = |(at, one): (usize, &Option<(HeaderQuantity, String, bool)>)| {
        let (quantity, role, is_own) = one.clone()?;
        let is_kept = match quantity {
            HeaderQuantity::Time => is_first_time(at),
            HeaderQuantity::Temperature => is_alone(&role),
            HeaderQuantity::Counts | HeaderQuantity::Rate => are_rates_clear,
        };
        (is_own || is_kept).then_some(role)
    };
    all.iter().enumerate().map(keep).collect()
}

/// The setup's map of columns with the recognised headers, and those as `Gyro X (deg/s) as rate_dps_x`.
pub(crate) fn mapped(
    headers: &[String],
    units: &[String],
    cells: &[String],
    columns: &BTreeMap<String, String>,
) -> (BTreeMap<String, String>, Vec<String>) {
    let all = headers.iter().zip(recognised(headers, units, cells, columns));
    let known: Vec<(&String, String)> = all.filter_map(|(header, known)| Some((header, known?))).collect();
    let said = known.iter().map(|(header, known)| format!("{header} as {known}")).collect();
    let recognised = known.into_iter().map(|(header, known)| (header.clone(), known));
    (columns.clone().into_iter().chain(recognised).collect(), said)
}

/// Whether two headers would be one axis or one thermometer.
fn same_place(one: &str, other: &str) -> bool {
    match (role_of(one), role_of(other)) {
        (
            Ok(Role::Rate { axis: a, .. } | Role::Counts { axis: a }),
            Ok(Role::Rate { axis: b, .. } | Role::Counts { axis: b }),
        ) => a == b,
        (Ok(Role::Temperature { name: a, .. }), Ok(Role::Temperature { name: b, .. })) => a == b,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(headers: &[&str]) -> Vec<Option<String>> {
        let headers: Vec<String> = headers.iter().map(ToString::to_string).collect();
        recognised(&headers, &[], &[], &BTreeMap::new())
    }

    fn some(roles: &[&str]) -> Vec<Option<String>> {
        roles.iter().map(|role| (!role.is_empty()).then(|| (*role).to_owned())).collect()
    }

    #[test]
    fn quantity_and_unit_make_a_header() {
        assert_eq!(
            read(&["Time (ms)", "Chip temp [°C]", "Gyro X (deg/s)", "gyro_y_dps", "gz_radps", "Accel X (m/s²)"]),
            some(&["time_ms", "temperature_c_chip", "rate_dps_x", "rate_dps_y", "rate_radps_z", ""])
        );
        assert_eq!(read(&["t_s", "T [K]", "Drehrate z [°/h]"]), some(&["time_s", "temperature_k", "rate_dph_z"]));
    }

    #[test]
    fn a_missing_unit_a_table_and_doubles_are_not_recognised() {
        let free = read(&["Gyro X", "Temp", "Time (min)", "Table rate (deg/s)", "Gyro A X (dps)", "Gyro B X (dps)"]);
        assert_eq!(free, some(&["", "", "", "", "", ""]));
        // Without x the log would look like one of y and z.
        assert_eq!(read(&["Gyro X (dps)", "Gyro X raw (dps)", "Gyro Y (dps)"]), some(&["", "", ""]));
        assert_eq!(read(&["Time (s)", "GPS time (s)"]), some(&["time_s", ""]));
    }

    #[test]
    fn corrected_rows_and_control_characters_are_not_recognised() {
        assert_eq!(read(&["compensated_rate_dps_x", "time_s"]), some(&["", ""]));
        assert_eq!(read(&["temperature_c_a\u{1}", "temperature_block_c"]), some(&["", "temperature_c_block"]));
        assert_eq!(read(&["temperature_f", "rate_rpm", "time_h"]), some(&["", "", ""]));
    }

    #[test]
    fn a_quantity_with_a_header_of_ours_is_not_looked_for() {
        let all = read(&["time_s", "counts", "gyro_dps", "board_temp_c", "Elapsed (s)"]);
        assert_eq!(all, some(&["", "", "", "temperature_c_board", ""]));
    }
}
