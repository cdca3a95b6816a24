//! Rows as CSV text: the log that a lab would have, and the truth in a file of its own.
//!
//! The log has time, counts, validity flag, thermometer readings, rate of the table, actuator and light. The truth has
//! every error by cause, the true rate, and the temperatures and modes. The log rounds readings to 1e-6 °C, the actuator
//! to 1e-4 and the light to 1e-6; the truth has all digits.

use std::io::{self, Write};

use crate::gyro::{ERROR_SOURCES, LogRow, Second};
use crate::scenario::{Actuator, FaultKind, Scenario};

/// Bytes collected before they are written.
const BLOCK_BYTES: usize = 1 << 16;

/// Text of the log: header and rows.
#[derive(Clone, Debug)]
pub struct LogText {
    headers: Vec<String>,
    decimals: u32,
    with_reference: bool,
    /// Cells that are the same for all rows of a second, and the end of that second.
    tail: Vec<u8>,
    tail_end_s: f64,
    row: Vec<u8>,
}

impl LogText {
    /// The log of a scenario.
    pub fn new(scenario: &Scenario) -> Self {
        let mut headers = ["time_s", "counts", "valid"].map(str::to_owned).to_vec();
        for thermometer in &scenario.thermometer {
            let separator = if thermometer.name.is_empty() { "" } else { "_" };
            headers.push(format!("temperature_c{separator}{}", thermometer.name));
        }
        let with_reference = !scenario.input.table.is_empty();
        if with_reference {
            headers.push("reference_rate_dps".to_owned());
        }
        let actuator = match scenario.path_length.actuator {
            Actuator::Piezo => "aux_path_length_v",
            Actuator::Heater => "aux_path_length_w",
        };
        headers.extend([actuator, "aux_light"].map(str::to_owned));
        // As many as the interval needs; whole ticks of 100 µs need four. A drifting clock needs microseconds.
        let whole = |decimals: &u32| {
            let units = scenario.run.interval_s * libm::exp10(f64::from(*decimals));
            (units - libm::round(units)).abs() < 1e-6
        };
        let drifts = scenario.fault.iter().any(|f| f.kind == FaultKind::ClockDrift);
        let decimals = if drifts { 6 } else { (0..4).find(whole).unwrap_or(4) };
        Self { headers, decimals, with_reference, tail: Vec::new(), tail_end_s: f64::NAN, row: Vec::new() }
    }

    /// Names of the columns; all columns are numeric.
    pub fn headers(&self) -> &[String] {
        &self.headers
    }

    /// Header line, with its line feed.
    pub fn header_line(&self) -> String {
        self.headers.join(",") + "\n"
    }

    /// A row as a line, with its line feed; valid until the next call.
    pub fn line(&mut self, row: &LogRow, second: &Second) -> &[u8] {
        if self.tail_end_s.to_bits() != second.end_s.to_bits() {
            self.tail_end_s = second.end_s;
            self.refresh(second);
        }
        let out = &mut self.row;
        out.clear();
        seconds(out, row.time_ns, self.decimals);
        out.push(b',');
        out.extend_from_slice(itoa::Buffer::new().format(row.counts).as_bytes());
        out.extend_from_slice(if row.valid { b",1" } else { b",0" });
        out.extend_from_slice(&self.tail);
        &self.row
    }

    fn refresh(&mut self, second: &Second) {
        self.tail.clear();
        // Writing to a Vec cannot fail.
        for reading in &second.readings_c {
            // Multiples of an LSB are not exact binary numbers.
            let _ = write!(self.tail, ",{}", libm::round(reading * 1e6) / 1e6);
        }
        if self.with_reference {
            let _ = write!(self.tail, ",{}", second.table_dps);
        }
        let _ = writeln!(self.tail, ",{:.4},{:.6}", second.loops.actuator, second.loops.light);
    }
}

/// Nanoseconds as seconds with a number of decimals (0 to 9), rounded down.
fn seconds(out: &mut Vec<u8>, time_ns: i64, decimals: u32) {
    let whole = time_ns.div_euclid(1_000_000_000);
    out.extend_from_slice(itoa::Buffer::new().format(whole).as_bytes());
    if decimals > 0 {
        let fraction = time_ns.rem_euclid(1_000_000_000) / 10_i64.pow(9 - decimals.min(9));
        let mut text = itoa::Buffer::new();
        let digits = text.format(fraction).as_bytes();
        out.push(b'.');
        out.extend(std::iter::repeat_n(b'0', (decimals as usize).saturating_sub(digits.len())));
        out.extend_from_slice(digits);
    }
}

/// Header line of the truth, with its line feed.
pub fn truth_header() -> String {
    let sources: Vec<String> = ERROR_SOURCES.iter().map(|name| format!("{name}_dph")).collect();
    format!(
        "time_s,true_rate_dph,{},scale_ppm,noise_arcsec,chamber_c,block_c,block_cpm,anode_c,gradient_c,mode,actuator,light,current_ma,valid\n",
        sources.join(",")
    )
}

/// Writes a row of the truth as a line.
///
/// # Errors
/// Those of the writer.
pub fn write_truth(out: &mut impl Write, row: &LogRow, second: &Second) -> io::Result<()> {
    write!(out, "{},{}", row.time_ns as f64 / 1e9, second.input_dph)?;
    second.errors_dph.iter().try_for_each(|error| write!(out, ",{error}"))?;
    let (t, l) = (&second.temperatures, &second.loops);
    writeln!(
        out,
        ",{},{},{},{},{},{},{},{},{},{},{},{}",
        second.scale_ppm,
        row.noise_arcsec,
        t.chamber_c,
        t.block_c,
        t.block_cpm,
        t.anode_c,
        t.gradient_c,
        l.mode,
        l.actuator,
        l.light,
        l.current_ma,
        u8::from(row.valid)
    )
}

/// Collects lines into large blocks. Call `flush` at the end: dropping it writes nothing.
pub struct BlockWriter<W: Write> {
    inner: W,
    block: Vec<u8>,
}

impl<W: Write> BlockWriter<W> {
    /// Writes to `inner`.
    pub fn new(inner: W) -> Self {
        Self { inner, block: Vec::with_capacity(BLOCK_BYTES + 512) }
    }
}

impl<W: Write> Write for BlockWriter<W> {
    #[inline]
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.block.extend_from_slice(bytes);
        if self.block.len() >= BLOCK_BYTES {
            self.inner.write_all(&self.block)?;
            self.block.clear();
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.write_all(&self.block)?;
        self.block.clear();
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::seconds;

    #[test]
    fn times_are_exact() {
        let text = |ns, decimals| {
            let mut out = Vec::new();
            seconds(&mut out, ns, decimals);
            String::from_utf8(out).unwrap()
        };
        assert_eq!(text(12_000_100_000, 4), "12.0001");
        assert_eq!(text(999_999_999_999, 0), "999");
        assert_eq!(text(1_005_000, 6), "0.001005");
    }
}
