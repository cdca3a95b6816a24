//! Both loops as bytes, for a target without floating point.
//!
//! ```text
//! 0        24              24 + 392                  24 + 392 + 92        + 4
//! ┌────────┬───────────────┬─────────────────────────┬──────┐
//! │ head   │ path length   │ intensity               │ CRC  │     512 bytes, little-endian
//! └────────┴───────────────┴─────────────────────────┴──────┘
//! ```
//!
//! [`LoopTable::decode`] refuses every value with which the arithmetic of a tick could overflow or an actuator could
//! leave its range. A designed loop always passes. Fields: `docs/reference/loop-table.md`.

use core::fmt;

use sagnac_core::bytes::{Reader, Writer, crc32};

use crate::MAX_CODE;
use crate::gain::LoopGain;
use crate::intensity::Intensity;
use crate::lockin::{MAX_TICKS_PER_PERIOD, Reference};
use crate::path_length::{MAX_EVIDENCE, MOST_CURVATURE_Q8, PathLength};

/// First eight bytes of every table.
pub const TABLE_MAGIC: [u8; 8] = *b"SAGNACLT";
/// Version of the layout.
pub const TABLE_VERSION: u16 = 2;
/// Length of a table, bytes.
pub const TABLE_LEN: usize = HEAD_LEN + PATH_LEN + LIGHT_LEN + 4;
const HEAD_LEN: usize = 24;
const PATH_LEN: usize = 392;
const LIGHT_LEN: usize = 92;
/// Longest time, in periods or updates.
const MAX_TIME: u32 = 1_000_000_000;
/// Largest size of an error.
const MAX_ERROR: i32 = 1 << 30;

/// The two loops of a gyro.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoopTable {
    /// Length of the tick of the design, ns.
    pub tick_ns: u32,
    /// The path-length loop.
    pub path_length: PathLength,
    /// The intensity loop.
    pub intensity: Intensity,
}

/// Why bytes are refused as a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableError {
    /// Not [`TABLE_LEN`] bytes.
    Length(usize),
    /// The first eight bytes are not a table's.
    NotATable,
    /// An unknown layout.
    UnknownVersion(u16),
    /// The checksum does not match.
    Crc,
    /// A field is outside its range.
    OutOfRange(&'static str),
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length(given) => write!(f, "{given} bytes where a table of the loops has {TABLE_LEN}"),
            Self::NotATable => f.write_str("does not begin like a table of the loops"),
            Self::UnknownVersion(v) => write!(f, "table format version {v}; this program reads {TABLE_VERSION}"),
            Self::Crc => f.write_str("checksum of the table does not match: damaged"),
            Self::OutOfRange(field) => write!(f, "{field} of the table is out of range"),
        }
    }
}

impl core::error::Error for TableError {}

impl LoopTable {
    /// The table as bytes.
    pub fn encode(&self) -> [u8; TABLE_LEN] {
        let mut bytes = [0; TABLE_LEN];
        let body_len = TABLE_LEN - 4;
        if let Some((body, tail)) = bytes.split_at_mut_checked(body_len) {
            // Cannot fail: the lengths above are those of the fields, and a test reads them back.
            let _ = self.write(&mut Writer::new(body));
            tail.copy_from_slice(&crc32(body).to_le_bytes());
        }
        bytes
    }

    /// Reads a table that fills `bytes` exactly.
    ///
    /// # Errors
    /// [`TableError`], cheapest check first: length, magic, version, CRC, then every value.
    pub fn decode(bytes: &[u8]) -> Result<Self, TableError> {
        let length = TableError::Length(bytes.len());
        if bytes.len() != TABLE_LEN {
            return Err(length);
        }
        let (body, tail) = bytes.split_last_chunk::<4>().ok_or(length)?;
        let mut r = Reader::new(body);
        if r.take::<8>() != Some(TABLE_MAGIC) {
            return Err(TableError::NotATable);
        }
        let version = r.u16().ok_or(length)?;
        if version != TABLE_VERSION {
            return Err(TableError::UnknownVersion(version));
        }
        if u32::from_le_bytes(*tail) != crc32(body) {
            return Err(TableError::Crc);
        }
        let table = Self::read(&mut r).ok_or(TableError::OutOfRange("a reserved byte"))?;
        table.check().map_err(TableError::OutOfRange)?;
        Ok(table)
    }

    fn write(&self, w: &mut Writer<'_>) -> Option<()> {
        w.put(TABLE_MAGIC)?;
        w.put(TABLE_VERSION.to_le_bytes())?;
        w.put([0; 2])?;
        w.put((TABLE_LEN as u32).to_le_bytes())?;
        w.put(self.tick_ns.to_le_bytes())?;
        w.put([0; 4])?;
        write_path(w, &self.path_length)?;
        write_light(w, &self.intensity)
    }

    /// Reads the rest after the version; `None` if reserved bytes are not zero.
    fn read(r: &mut Reader<'_>) -> Option<Self> {
        zeros(r.take::<2>()?)?;
        (r.u32()? as usize == TABLE_LEN).then_some(())?;
        let tick_ns = r.u32()?;
        zeros(r.take::<4>()?)?;
        let table = Self { tick_ns, path_length: read_path(r)?, intensity: read_light(r)? };
        r.is_empty().then_some(table)
    }

    fn check(&self) -> Result<(), &'static str> {
        let rules = core::iter::once((self.tick_ns > 0, "tick"));
        let mut rules = rules.chain(self.path_length.rules()).chain(self.intensity.rules());
        rules.find(|(holds, _)| !holds).map_or(Ok(()), |(_, field)| Err(field))
    }
}

impl PathLength {
    /// All numbers of the table by name, without the tables of the reference. For exports to other languages.
    pub fn fields(&self) -> [(&'static str, i64); 26] {
        [
            ("ticks", self.reference.ticks().into()),
            ("delay", self.reference.delay().into()),
            ("modulation", self.modulation.into()),
            ("error_shift", self.error_shift.into()),
            ("kp_mantissa", self.kp.mantissa.into()),
            ("kp_shift", self.kp.shift.into()),
            ("ki_mantissa", self.ki.mantissa.into()),
            ("ki_shift", self.ki.shift.into()),
            ("low", self.low.into()),
            ("high", self.high.into()),
            ("reset_low", self.reset_low.into()),
            ("reset_high", self.reset_high.into()),
            ("wavelength", self.wavelength.into()),
            ("sweep_step_q32", self.sweep_step_q32),
            ("reset_step_q32", self.reset_step_q32),
            ("sweep_periods", self.sweep_periods.into()),
            ("settle_periods", self.settle_periods.into()),
            ("lock_periods", self.lock_periods.into()),
            ("lost_periods", self.lost_periods.into()),
            ("give_up_periods", self.give_up_periods.into()),
            ("lock_error", self.lock_error.into()),
            ("lost_error", self.lost_error.into()),
            ("least_curvature_q8", self.least_curvature_q8.into()),
            ("most_curvature_q8", self.most_curvature_q8.into()),
            ("dark_sum", self.dark_sum),
            ("range_middle_q32", self.middle_q32()),
        ]
    }

    /// One period of the sine of the reference, Q15.
    pub fn sine_q15(&self) -> impl Iterator<Item = i16> + '_ {
        (0..self.reference.ticks()).map(|index| self.reference.sine_q15(index))
    }

    /// One period of the second harmonic of the reference, Q15.
    pub fn second_q15(&self) -> impl Iterator<Item = i16> + '_ {
        (0..self.reference.ticks()).map(|index| self.reference.second_q15(index))
    }

    /// The rules that keep every sum and product of a tick within 64 bits, and the actuator within its range.
    fn rules(&self) -> [(bool, &'static str); 21] {
        let code = |value: i32| value.unsigned_abs() <= MAX_CODE.unsigned_abs();
        let time = |value: u32| value <= MAX_TIME;
        let error = |value: i32| (1..=MAX_ERROR).contains(&value);
        let step = i64::from(MAX_CODE) << 33;
        [
            (self.reference.is_valid(), "path-length reference"),
            ((0..=MAX_CODE).contains(&self.modulation), "path-length modulation"),
            (self.error_shift <= 40, "path-length error shift"),
            (self.kp.is_valid(), "path-length kp"),
            (self.ki.is_valid(), "path-length ki"),
            (code(self.low) && code(self.high) && self.low < self.high, "path-length range"),
            (self.reset_low >= self.low.saturating_sub(1) && self.reset_low <= self.high, "path-length reset_low"),
            (
                self.reset_high <= self.high.saturating_add(1) && self.reset_high >= self.reset_low,
                "path-length reset_high",
            ),
            ((1..=2 * MAX_CODE).contains(&self.wavelength), "path-length wavelength"),
            ((0..=step).contains(&self.sweep_step_q32), "path-length sweep step"),
            ((1..=step).contains(&self.reset_step_q32), "path-length reset step"),
            (time(self.sweep_periods), "path-length sweep time"),
            (time(self.settle_periods), "path-length settling time"),
            ((1..=MAX_EVIDENCE).contains(&self.lock_periods), "path-length lock time"),
            ((1..=MAX_EVIDENCE).contains(&self.lost_periods), "path-length loss time"),
            (self.least_curvature_q8 >= 2, "path-length least curvature"),
            (
                (u32::from(self.least_curvature_q8)..=MOST_CURVATURE_Q8).contains(&self.most_curvature_q8),
                "path-length most curvature",
            ),
            (time(self.give_up_periods), "path-length time to give up"),
            (error(self.lock_error), "path-length lock error"),
            (error(self.lost_error), "path-length loss error"),
            ((0..=i64::from(MAX_CODE) * 64).contains(&self.dark_sum), "path-length dark sum"),
        ]
    }
}

impl Intensity {
    /// All numbers of the table by name.
    pub fn fields(&self) -> [(&'static str, i64); 19] {
        [
            ("ticks", self.ticks.into()),
            ("set_point", self.set_point),
            ("error_shift", self.error_shift.into()),
            ("kp_mantissa", self.kp.mantissa.into()),
            ("kp_shift", self.kp.shift.into()),
            ("ki_mantissa", self.ki.mantissa.into()),
            ("ki_shift", self.ki.shift.into()),
            ("least", self.least.into()),
            ("most", self.most.into()),
            ("slew", self.slew.into()),
            ("ignition", self.ignition.into()),
            ("ignition_updates", self.ignition_updates.into()),
            ("rest_updates", self.rest_updates.into()),
            ("tries", self.tries.into()),
            ("dark_sum", self.dark_sum),
            ("low_sum", self.low_sum),
            ("dark_updates", self.dark_updates.into()),
            ("end_updates", self.end_updates.into()),
            ("settled_error", self.settled_error.into()),
        ]
    }

    fn rules(&self) -> [(bool, &'static str); 14] {
        let most = i64::from(MAX_CODE) * i64::from(self.ticks);
        let sum = |value: i64| (0..=most).contains(&value);
        let time = |value: u32| value <= MAX_TIME;
        [
            (self.ticks > 0, "intensity ticks"),
            (sum(self.set_point), "intensity set point"),
            (self.error_shift <= 40, "intensity error shift"),
            (self.kp.is_valid(), "intensity kp"),
            (self.ki.is_valid(), "intensity ki"),
            (self.least >= 0 && self.least <= self.most && self.most <= MAX_CODE, "intensity range"),
            ((1..=MAX_CODE).contains(&self.slew), "intensity slew"),
            ((0..=self.most).contains(&self.ignition), "intensity ignition current"),
            (time(self.ignition_updates), "intensity ignition time"),
            (time(self.rest_updates), "intensity rest time"),
            (sum(self.dark_sum), "intensity dark sum"),
            (sum(self.low_sum), "intensity low sum"),
            (time(self.dark_updates) && time(self.end_updates), "intensity dark or end time"),
            ((1..=MAX_ERROR).contains(&self.settled_error), "intensity settled error"),
        ]
    }
}

fn zeros<const N: usize>(bytes: [u8; N]) -> Option<()> {
    (bytes == [0; N]).then_some(())
}

fn write_gain(w: &mut Writer<'_>, gain: LoopGain) -> Option<()> {
    w.put(gain.mantissa.to_le_bytes())?;
    w.put([gain.shift, 0, 0, 0])
}

fn read_gain(r: &mut Reader<'_>) -> Option<LoopGain> {
    let mantissa = r.i32()?;
    let [shift, rest @ ..] = r.take::<4>()?;
    zeros::<3>(rest)?;
    Some(LoopGain { mantissa, shift })
}

fn write_path(w: &mut Writer<'_>, path: &PathLength) -> Option<()> {
    for index in 0..MAX_TICKS_PER_PERIOD as u8 {
        w.put(path.reference.sine_q15(index).to_le_bytes())?;
    }
    for index in 0..MAX_TICKS_PER_PERIOD as u8 {
        w.put(path.reference.second_q15(index).to_le_bytes())?;
    }
    w.put([path.reference.ticks(), path.reference.delay(), path.error_shift, 0])?;
    write_gain(w, path.kp)?;
    write_gain(w, path.ki)?;
    let codes = [path.modulation, path.low, path.high, path.reset_low, path.reset_high, path.wavelength];
    for value in codes.into_iter().chain([path.lock_error, path.lost_error]) {
        w.put(value.to_le_bytes())?;
    }
    for value in [path.sweep_step_q32, path.reset_step_q32, path.dark_sum] {
        w.put(value.to_le_bytes())?;
    }
    let times = [path.sweep_periods, path.settle_periods, path.lock_periods, path.lost_periods, path.give_up_periods];
    for value in times {
        w.put(value.to_le_bytes())?;
    }
    w.put(path.least_curvature_q8.to_le_bytes())?;
    w.put([0; 2])?;
    w.put(path.most_curvature_q8.to_le_bytes())?;
    w.put([0; 32])
}

fn read_path(r: &mut Reader<'_>) -> Option<PathLength> {
    let (mut sine_q15, mut second_q15) = ([0; MAX_TICKS_PER_PERIOD], [0; MAX_TICKS_PER_PERIOD]);
    for entry in sine_q15.iter_mut().chain(&mut second_q15) {
        *entry = r.i16()?;
    }
    let [ticks, delay, error_shift, zero] = r.take()?;
    zeros([zero])?;
    let (kp, ki) = (read_gain(r)?, read_gain(r)?);
    let (modulation, low, high) = (r.i32()?, r.i32()?, r.i32()?);
    let (reset_low, reset_high, wavelength) = (r.i32()?, r.i32()?, r.i32()?);
    let (lock_error, lost_error) = (r.i32()?, r.i32()?);
    let (sweep_step_q32, reset_step_q32, dark_sum) = (r.i64()?, r.i64()?, r.i64()?);
    let (sweep_periods, settle_periods, lock_periods) = (r.u32()?, r.u32()?, r.u32()?);
    let (lost_periods, give_up_periods) = (r.u32()?, r.u32()?);
    let least_curvature_q8 = r.u16()?;
    zeros(r.take::<2>()?)?;
    let most_curvature_q8 = r.u32()?;
    zeros(r.take::<32>()?)?;
    let reference = Reference::from_tables(sine_q15, second_q15, ticks, delay);
    Some(PathLength {
        reference,
        modulation,
        error_shift,
        kp,
        ki,
        low,
        high,
        reset_low,
        reset_high,
        wavelength,
        sweep_step_q32,
        reset_step_q32,
        sweep_periods,
        settle_periods,
        lock_periods,
        lost_periods,
        give_up_periods,
        lock_error,
        lost_error,
        least_curvature_q8,
        most_curvature_q8,
        dark_sum,
    })
}

fn write_light(w: &mut Writer<'_>, light: &Intensity) -> Option<()> {
    w.put(light.ticks.to_le_bytes())?;
    w.put([light.error_shift, light.tries])?;
    write_gain(w, light.kp)?;
    write_gain(w, light.ki)?;
    for value in [light.set_point, light.dark_sum, light.low_sum] {
        w.put(value.to_le_bytes())?;
    }
    for value in [light.least, light.most, light.slew, light.ignition, light.settled_error] {
        w.put(value.to_le_bytes())?;
    }
    for value in [light.ignition_updates, light.rest_updates, light.dark_updates, light.end_updates, 0, 0, 0] {
        w.put(value.to_le_bytes())?;
    }
    Some(())
}

fn read_light(r: &mut Reader<'_>) -> Option<Intensity> {
    let ticks = r.u16()?;
    let [error_shift, tries] = r.take()?;
    let (kp, ki) = (read_gain(r)?, read_gain(r)?);
    let (set_point, dark_sum, low_sum) = (r.i64()?, r.i64()?, r.i64()?);
    let (least, most, slew, ignition, settled_error) = (r.i32()?, r.i32()?, r.i32()?, r.i32()?, r.i32()?);
    let (ignition_updates, rest_updates) = (r.u32()?, r.u32()?);
    let (dark_updates, end_updates) = (r.u32()?, r.u32()?);
    zeros(r.take::<12>()?)?;
    Some(Intensity {
        ticks,
        set_point,
        error_shift,
        kp,
        ki,
        least,
        most,
        slew,
        ignition,
        ignition_updates,
        rest_updates,
        tries,
        dark_sum,
        low_sum,
        dark_updates,
        end_updates,
        settled_error,
    })
}
