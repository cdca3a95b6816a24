//! Logs for the benchmark, made once: temperature cycle, small drift, Earth rate and angle random walk.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Result;
use arrow_array::{Float64Array, Int64Array, RecordBatch};
use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::properties::WriterProperties;

pub(super) const ARCSEC_PER_COUNT: &str = "0.15125";
const RATE_DPH: f64 = 4.5;
/// 0.003 °/√h in arcsec/√s.
const ARW: f64 = 0.18;
/// Rows of a record batch.
const BATCH: usize = 1 << 16;

/// Rows of the log: time in steps, temperature, counts.
struct Rows {
    hertz: f64,
    decimals: usize,
    phase: f64,
    last: i64,
    random: u64,
}

impl Rows {
    fn new(hertz: u32) -> Self {
        let decimals = hertz.ilog10() as usize;
        Self { hertz: f64::from(hertz), decimals, phase: 0.0, last: 0, random: 0x2545_f491_4f6c_dd1d }
    }

    /// Twelve uniform numbers minus six are sufficiently normal here.
    fn normal(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.random ^= self.random << 13;
            self.random ^= self.random >> 7;
            self.random ^= self.random << 17;
            sum += (self.random >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum
    }

    fn next(&mut self, row: u64) -> (f64, f64, i64) {
        let t_s = (row + 1) as f64 / self.hertz;
        let t_c = ((15.0 + 40.0 * (t_s / 1500.0).sin()) / 0.0625).round() * 0.0625;
        let drift = 0.02 * (t_c - 25.0) / 50.0 + 0.01 * ((t_c - 25.0) / 50.0).powi(2);
        let angle = (RATE_DPH + drift) / self.hertz + ARW / self.hertz.sqrt() * self.normal();
        self.phase += angle / 0.15125;
        let total = self.phase.floor() as i64;
        let counts = total - self.last;
        self.last = total;
        (t_s, t_c, counts)
    }
}

/// `time_s,temperature_c,counts`.
pub(super) fn csv_log(folder: &Path, rows: u64, hertz: u32) -> Result<PathBuf> {
    let path = folder.join(format!("{rows}-at-{hertz}.csv"));
    if path.exists() {
        return Ok(path);
    }
    println!("making {}", path.display());
    let unfinished = path.with_extension("part");
    let mut out = BufWriter::with_capacity(1 << 20, File::create(&unfinished)?);
    writeln!(out, "time_s,temperature_c,counts")?;
    let mut log = Rows::new(hertz);
    for row in 0..rows {
        let (t_s, t_c, counts) = log.next(row);
        writeln!(out, "{t_s:.0$},{t_c:.4},{counts}", log.decimals)?;
    }
    out.flush()?;
    fs::rename(unfinished, &path)?;
    Ok(path)
}

/// The same as Parquet with snappy, the default of pandas and polars.
pub(super) fn parquet_log(folder: &Path, rows: u64, hertz: u32) -> Result<PathBuf> {
    let path = folder.join(format!("{rows}-at-{hertz}.parquet"));
    if path.exists() {
        return Ok(path);
    }
    println!("making {}", path.display());
    let field = |name: &str, kind| Field::new(name, kind, true);
    let fields = [("time_s", DataType::Float64), ("temperature_c", DataType::Float64), ("counts", DataType::Int64)];
    let schema = Arc::new(Schema::new(fields.map(|(name, kind)| field(name, kind)).to_vec()));
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
    let unfinished = path.with_extension("part");
    let mut writer = ArrowWriter::try_new(File::create(&unfinished)?, Arc::clone(&schema), Some(properties))?;
    let mut log = Rows::new(hertz);
    let mut row = 0;
    while row < rows {
        let count = (rows - row).min(BATCH as u64);
        let (mut times, mut temperatures, mut counts) = (Vec::new(), Vec::new(), Vec::new());
        for row in row..row + count {
            let (t_s, t_c, n) = log.next(row);
            times.push(t_s);
            temperatures.push(t_c);
            counts.push(n);
        }
        row += count;
        let columns: Vec<arrow_array::ArrayRef> = vec![
            Arc::new(Float64Array::from(times)),
            Arc::new(Float64Array::from(temperatures)),
            Arc::new(Int64Array::from(counts)),
        ];
        writer.write(&RecordBatch::try_new(Arc::clone(&schema), columns)?)?;
    }
    writer.close()?;
    fs::rename(unfinished, &path)?;
    Ok(path)
}
