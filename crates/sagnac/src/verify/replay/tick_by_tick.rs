//! A log through the firmware's own code, tick by tick.
//!
//! ```text
//! row (start, end] ─▶ floor(end/tick) − floor(start/tick) ticks, cut at slow updates ─▶ Compensator
//! temperature of each row ─▶ register ─▶ read by the slow update at every multiple of Δt
//! ```
//!
//! Ticks and slow updates count from the start of the run's first row. At a boundary the slow update
//! comes first. It reads the newest temperature stamped at or before its own time; the first one reads
//! the first row's. No rule of the host leaves a reading out: jumps, frozen and impossible values go to the image, whose own rules judge
//! them; a cell without a reading is none, unless the thermometer is slower than the rows. A row that a slow update cuts is split in integer proportion to its ticks. Through
//! gaps the clock runs on without counts. Where rows are missing, temperatures go from the last to the next one in equal steps, one for
//! each missing row, or up to a thousand: two steps at once would be a rate that the gyro did not see, and that its image cuts off.

use sagnac_core::{Compensator, Image, InputSpec, MAX_INPUTS, Misuse, State, Status};

use crate::verify::replay::column_of_input::{InputColumns, LogColumn};
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{AngleUnit, Batch, LogShape};
use sagnac_units::s_from_ns;

/// No gap may last longer than this many slow updates (116 days at 1 s).
const MAX_UPDATES: i64 = 10_000_000;
/// No row may: 5.8 days at 1 s. More is an image for another log.
const MAX_ROW_UPDATES: i64 = 500_000;
/// Most slow updates of a whole replay: eleven days at 10 ms, three years at 1 s. They take about 8 s.
const MAX_ALL_UPDATES: i64 = 100_000_000;
/// Largest |raw| the core takes at once.
const MAX_RAW: i64 = sagnac_core::MAX_RAW as i64;

/// Most steps of the temperature through a gap.
const STEPS: i64 = 1000;

/// One count of the target's accumulator.
const COUNT: f64 = 4_294_967_296.0;

/// How a thermometer's °C, or a column's numbers, become the codes its image expects.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Coder {
    offset_c: f64,
    gain_c: f64,
}

impl Coder {
    fn of(spec: &InputSpec) -> Self {
        let unit = 2.0_f64.powi(i32::from(spec.unit_exponent) - 24);
        let gain_c = f64::from(spec.gain.mantissa) * 2.0_f64.powi(-i32::from(spec.gain.shift)) * unit;
        Self { offset_c: f64::from(spec.offset_q24) * unit, gain_c }
    }

    /// `None` for a missing temperature or one that no code can hold.
    fn code(self, celsius: f64) -> Option<i32> {
        let code = ((celsius - self.offset_c) / self.gain_c).round();
        (code.abs() <= f64::from(i32::MAX)).then_some(code as i32)
    }
}

/// One axis being replayed.
struct AxisReplay {
    gyro: Compensator,
    state: State,
    /// Per thermometer of the image: the column it reads and how; `None` for the difference of two.
    coders: Vec<Option<(LogColumn, Coder)>>,
    /// Angle of one output count in the log's own unit (1 for quanta).
    lsb: f64,
    /// Part of an LSB not yet given to the core (rate logs), or counts of rows shorter than a tick.
    pending: f64,
}

/// Corrected values of a batch, per axis and row.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Corrected {
    /// Angle in the log's own unit: whole quanta, or arcsec.
    pub angle: Vec<Vec<f64>>,
    /// The same with what is held back of a count: the angle before it is rounded. Over a run the two never lie farther
    /// apart than what a row shorter than a tick, or the output limit, still holds back.
    pub unrounded: Vec<Vec<f64>>,
    /// Status bits that occurred during the row.
    pub status: Vec<Vec<Status>>,
}

/// A log's replay.
pub struct Replay {
    axes: Vec<AxisReplay>,
    tick_ns: i64,
    period_ticks: i64,
    /// Of a usual row, of whole periods.
    row_ticks: i64,
    origin_ns: Option<i64>,
    ticks_done: i64,
    /// Slow updates so far, of one axis.
    updates: i64,
    /// Newest value of every thermometer and auxiliary column of the log, as the images last saw it.
    register: Register,
    /// The same of the row that is being corrected.
    newest: Register,
    /// Stamp of the row of `register`, ns.
    stamp_ns: i64,
    log: LogShape,
    file: String,
}

impl Replay {
    /// One image per axis of the log, in the log's order.
    ///
    /// # Errors
    /// Images that do not fit the log (scale factor, tick, number).
    pub fn new(images: &[Image], shape: &LogShape, readings: InputColumns, file: &str) -> Result<Self> {
        let head = images
            .first()
            .ok_or_else(|| {
                Error::input(
                    "no image is given for any axis of the log",
                    "give the calibration or the images of this gyro",
                )
            })?
            .description();
        let same = |image: &Image| {
            let d = image.description();
            (d.tick_ns, d.period_ticks) == (head.tick_ns, head.period_ticks)
        };
        if images.len() != shape.axes.len() || !images.iter().all(same) {
            return Err(Error::input(
                "the log needs one image per axis, all with one tick and period",
                "export the images from one calibration",
            ));
        }
        let with_columns = images.iter().zip(&readings.columns);
        let axes: Result<Vec<AxisReplay>> =
            with_columns.map(|(image, columns)| AxisReplay::new(image, shape.unit, columns)).collect();
        let (tick_ns, period_ticks) = (i64::from(head.tick_ns), i64::from(head.period_ticks));
        Ok(Self {
            axes: axes?,
            tick_ns,
            period_ticks,
            row_ticks: (shape.nominal_ns / tick_ns / period_ticks).max(1) * period_ticks,
            origin_ns: None,
            ticks_done: 0,
            updates: 0,
            register: Register::default(),
            newest: Register::default(),
            stamp_ns: i64::MIN,
            log: shape.clone(),
            file: file.to_owned(),
        })
    }

    /// Corrects a batch.
    ///
    /// # Errors
    /// A row with more counts than the core takes between two slow updates.
    pub fn correct(&mut self, batch: &Batch) -> Result<Corrected> {
        let columns = || vec![Vec::new(); self.axes.len()];
        let mut out = Corrected { angle: columns(), unrounded: columns(), status: vec![Vec::new(); self.axes.len()] };
        for row in 0..batch.len() {
            self.correct_row(batch, row, &mut out)?;
        }
        Ok(out)
    }

    fn correct_row(&mut self, batch: &Batch, row: usize, out: &mut Corrected) -> Result<()> {
        let origin_ns = *self.origin_ns.get_or_insert_with(|| {
            // The thermometers were there before the first row.
            self.register.take(batch, row);
            batch.start_ns[row]
        });
        let tick = |t_ns: i64| (t_ns - origin_ns).div_euclid(self.tick_ns);
        let (start, end) = (tick(batch.start_ns[row]).max(self.ticks_done), tick(batch.end_ns[row]));
        let gap = start - self.ticks_done;
        if end - self.ticks_done > MAX_UPDATES.saturating_mul(self.period_ticks) {
            return Err(Error::input(
                format!("a row or gap is longer than {MAX_UPDATES} temperature periods"),
                "cut the log there: each file is a separate run",
            )
            .file(&self.file)
            .line(batch.line[row]));
        }
        if end - start > MAX_ROW_UPDATES.saturating_mul(self.period_ticks) {
            return Err(Error::input(
                format!("a row is longer than {MAX_ROW_UPDATES} temperature periods of the image"),
                "give an image with a longer temperature period, or a log with shorter rows",
            )
            .file(&self.file)
            .line(batch.line[row]));
        }
        let is_gap = self.is_gap(batch, row);
        self.count_updates(gap, end - start, if is_gap { STEPS } else { 1 })
            .map_err(|e| e.file(&self.file).line(batch.line[row]))?;
        self.newest.take(batch, row);
        for (index, axis) in self.axes.iter_mut().enumerate() {
            let before = axis.codes(&self.register);
            let after = if is_gap { axis.codes(&self.newest) } else { before };
            let codes = Between { before, after, ticks: end - self.ticks_done, gap, row_ticks: self.row_ticks };
            axis.skip(&codes).map_err(|e| misused(e, &self.file, batch.line[row]))?;
            let held = axis.held();
            let (angle, status) = axis
                .row(&codes, batch.angle[index][row], end - start)
                .map_err(|e| misused(e, &self.file, batch.line[row]))?;
            out.angle[index].push(angle);
            out.unrounded[index].push(angle + (axis.held() - held) * axis.lsb);
            out.status[index].push(status);
        }
        self.ticks_done = end.max(start);
        std::mem::swap(&mut self.register, &mut self.newest);
        self.stamp_ns = batch.end_ns[row];
        Ok(())
    }

    /// Rows are missing before this one: temperatures are interpolated.
    fn is_gap(&self, batch: &Batch, row: usize) -> bool {
        let is_timed = self.stamp_ns != i64::MIN && self.log.timed;
        is_timed && !self.log.is_one_interval(self.stamp_ns, batch.end_ns[row])
    }

    /// Bounds the slow updates of all rows and gaps together: a temperature period far below the length of a row would take hours.
    fn count_updates(&mut self, gap_ticks: i64, row_ticks: i64, steps: i64) -> Result<()> {
        // Each step of a gap takes no more updates than the lags take to settle to the bit.
        let settle = |axis: &AxisReplay| {
            let eighths = axis.gyro.image().inputs().iter().filter(|input| input.lag.is_used());
            eighths.map(|input| 320 * i64::from(input.lag.longest_hold_updates())).max().unwrap_or(8)
        };
        let settling = self.axes.iter().map(settle).max().unwrap_or(0).saturating_mul(steps);
        let periods = |ticks: i64| ticks.max(0) / self.period_ticks;
        self.updates = self.updates.saturating_add(periods(gap_ticks).min(settling)).saturating_add(periods(row_ticks));
        if self.updates <= MAX_ALL_UPDATES {
            return Ok(());
        }
        Err(Error::input(
            format!(
                "the log needs more than {MAX_ALL_UPDATES} slow updates at a temperature period of {} s",
                s_from_ns(self.period_ticks.saturating_mul(self.tick_ns))
            ),
            "give an image with a longer temperature period, or cut the log",
        ))
    }

    /// The state of an axis, for those who want to look inside.
    pub fn state(&self, axis: usize) -> Option<&State> {
        self.axes.get(axis).map(|axis| &axis.state)
    }
}

fn misused(error: Misuse, file: &str, line: u64) -> Error {
    Error::input(
        format!("the log cannot be replayed: {error}"),
        "set a coarser rate_lsb_arcsec in the setup of a rate log",
    )
    .file(file)
    .line(line)
}

/// Values of a row of a log.
#[derive(Default)]
struct Register {
    temperature_c: Vec<f64>,
    aux: Vec<f64>,
}

impl Register {
    fn take(&mut self, batch: &Batch, row: usize) {
        for (register, columns) in [(&mut self.temperature_c, &batch.temperature_c), (&mut self.aux, &batch.aux)] {
            register.clear();
            register.extend(columns.iter().map(|column| column[row]));
        }
        // What a fit leaves out, the target reads.
        let as_read = &batch.as_read;
        let from = as_read.partition_point(|reading| reading.row < row);
        for reading in as_read[from..].iter().take_while(|reading| reading.row == row) {
            if let Some(place) = self.temperature_c.get_mut(reading.thermometer) {
                *place = reading.celsius;
            }
        }
    }

    fn value(&self, column: LogColumn) -> f64 {
        let value = match column {
            LogColumn::Thermometer(at) => self.temperature_c.get(at),
            LogColumn::Aux(at) => self.aux.get(at),
        };
        value.copied().unwrap_or(f64::NAN)
    }
}

/// One code per thermometer of an image.
type Codes = [Option<i32>; MAX_INPUTS];

/// Codes from the stamp of a row to that of the next one: those of the first, or where rows are missing in equal steps towards those of the
/// second, which the row behind it begins with.
struct Between {
    before: Codes,
    after: Codes,
    /// Ticks from stamp to stamp, and of the gap: the row has the rest.
    ticks: i64,
    gap: i64,
    /// Ticks of a usual row, of whole periods.
    row_ticks: i64,
}

impl Between {
    fn at(&self, tick: i64) -> Codes {
        let mut codes = self.before;
        if self.before == self.after {
            return codes;
        }
        // As a logger has them: held since the last stamp.
        let stamp = if tick < self.gap {
            tick / self.step() * self.step()
        } else {
            self.gap + (tick - self.gap) / self.row_ticks * self.row_ticks
        };
        for (code, after) in codes.iter_mut().zip(&self.after) {
            let (Some(from), Some(to)) = (*code, *after) else { continue };
            let moved = (i128::from(to) - i128::from(from)) * i128::from(stamp) / i128::from(self.ticks.max(1));
            *code = i32::try_from(i128::from(from) + moved).ok();
        }
        codes
    }

    /// Ticks of a step of the gap, of whole rows.
    fn step(&self) -> i64 {
        if self.before == self.after {
            return self.gap.max(1);
        }
        (self.gap / STEPS / self.row_ticks).max(1) * self.row_ticks
    }
}

impl AxisReplay {
    fn new(image: &Image, unit: AngleUnit, columns: &[Option<LogColumn>]) -> Result<Self> {
        let arcsec_per_lsb = image.description().scale_factor_femto_arcsec as f64 / 1e15;
        let lsb = match unit {
            AngleUnit::Quanta { .. } if (unit.arcsec() / arcsec_per_lsb - 1.0).abs() < 1e-9 => 1.0,
            AngleUnit::Quanta { .. } => {
                return Err(Error::input(
                    format!(
                        "the image was made for {arcsec_per_lsb} arcsec per quantum, and the log has {}",
                        unit.arcsec()
                    ),
                    "correct arcsec_per_count in the setup, or export again",
                )
                .column("arcsec_per_count"));
            }
            AngleUnit::Arcsec => arcsec_per_lsb,
        };
        let coder = |(column, spec): (&Option<LogColumn>, &InputSpec)| column.map(|column| (column, Coder::of(spec)));
        let coders = columns.iter().zip(image.inputs()).map(coder).collect();
        Ok(Self { gyro: Compensator::new(*image), state: State::new(), coders, lsb, pending: 0.0 })
    }

    fn codes(&self, register: &Register) -> Codes {
        let mut codes = [None; MAX_INPUTS];
        for (code, coder) in codes.iter_mut().zip(&self.coders) {
            *code = coder.and_then(|(column, coder)| coder.code(register.value(column)));
        }
        codes
    }

    /// Counts that went in and have not come out: of the input's rounding to counts and of the output's.
    fn held(&self) -> f64 {
        self.pending + self.state.remainder() as f64 / COUNT
    }

    /// Lets the ticks of a gap pass without counts.
    fn skip(&mut self, codes: &Between) -> std::result::Result<(), Misuse> {
        let step = codes.step();
        let mut done = 0;
        while done < codes.gap {
            let ticks = step.min(codes.gap - done);
            self.rest(codes.at(done), ticks)?;
            done += ticks;
        }
        Ok(())
    }

    /// The same at one temperature.
    fn rest(&mut self, codes: Codes, mut ticks: i64) -> std::result::Result<(), Misuse> {
        let period = i64::from(self.gyro.image().description().period_ticks);
        while ticks > 0 {
            let periods = ticks / period;
            if self.state.ticks_to_update() == 0 && periods > 1 {
                let inputs = self.gyro.image().inputs().len();
                self.gyro.rest(&mut self.state, &codes[..inputs], periods.unsigned_abs())?;
                ticks -= periods * period;
                continue;
            }
            let step = self.step(&codes, ticks)?;
            self.gyro.skip(&mut self.state, step)?;
            ticks -= i64::from(step);
        }
        Ok(())
    }

    /// Gives a row's counts to the core; what came out, in the log's unit, and its status.
    fn row(&mut self, codes: &Between, angle: f64, ticks: i64) -> std::result::Result<(f64, Status), Misuse> {
        let exact = angle / self.lsb + self.pending;
        if ticks == 0 {
            self.pending = exact;
            return Ok((0.0, self.state.status()));
        }
        let whole = exact.round();
        self.pending = exact - whole;
        if whole.abs() > MAX_RAW.saturating_mul(ticks) as f64 {
            return Err(Misuse::RawOutOfRange);
        }
        let (mut raw, mut left) = (whole as i64, ticks);
        let (mut out, mut status) = (0_i64, Status::OK);
        while left > 0 {
            // As many ticks at once as the core takes the counts of.
            let most = (i128::from(left) * i128::from(MAX_RAW)).checked_div(i128::from(raw).abs());
            let most = most.map_or(left, |most| i64::try_from(most).map_or(left, |most| most.clamp(1, left)));
            let step = self.step(&codes.at(codes.ticks - left), most)?;
            // Integer proportion; the last part takes the rest.
            let part = (i128::from(raw) * i128::from(step) / i128::from(left)) as i64;
            if part.abs() > MAX_RAW {
                return Err(Misuse::RawOutOfRange);
            }
            let output = self.gyro.advance(&mut self.state, part as i32, step)?;
            out += i64::from(output.counts);
            status |= output.status;
            raw -= part;
            left -= i64::from(step);
        }
        Ok((out as f64 * self.lsb, status))
    }

    /// Makes the slow update if it is due; how many of `ticks` may then run at once.
    fn step(&mut self, codes: &Codes, ticks: i64) -> std::result::Result<u32, Misuse> {
        if self.state.ticks_to_update() == 0 {
            self.gyro.update(&mut self.state, &codes[..self.gyro.image().inputs().len()])?;
        }
        Ok(self.state.ticks_to_update().min(u32::try_from(ticks).unwrap_or(u32::MAX)))
    }
}
