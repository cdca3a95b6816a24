//! Faults of the inputs of images of every kind: status 0 is never wrong by one, and no update is off by more than the number next to its
//! status. The runs that come nearest to the first bound are vectors for C and Verilog.
//!
//! ```text
//! off = |correction − that of the same image without the fault|       wrong: off > max(0.1 °/h, 0.05·ΣR) + the smallest step's effect, status 0
//! ```
//!
//! R is the largest effect of a rate term. Faults are steps, spikes, dropouts, wrong first samples and returns of any size and length on one
//! input, dropouts of all, resets; a contact that comes back for a moment, a step soon after missing samples or before them. Images are drawn with the rules of the export; `sagnac`'s study has those of fits.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use sagnac::calibration::{Calibration, CorrectionTerm, Input, InputSource, Lag, WarmUp};
use sagnac::export::{Polynomial, encode, import};
use sagnac::model::Form;
use sagnac_core::{Compensator, ErrorBound, Image, Kind, MAX_INPUTS, Multiplier, State, Status, UNBOUNDED};
use sagnac_log::setup::Setup;
use sagnac_vectors::Module;

use crate::makes::making::{Making, image_bytes};

/// Images, and runs of each.
const IMAGES: u64 = 200;
const RUNS: u64 = 50;
/// Runs that become vectors, and updates of each: before the update that is farthest off, and in all.
const WORST: usize = 200;
const BEFORE: usize = 240;
const UPDATES: usize = 260;
/// A temperature period, s, its ticks, and updates of six hours. The tick is long, for the hardware's bench runs each one.
const PERIOD_S: f64 = 5.0;
const PERIOD_TICKS: u32 = 10;
const SIX_HOURS: usize = 6 * 720;
/// °/h that status 0 may be off by, and a part of the largest rate effect.
const MOST_DPH: f64 = 0.1;
const MOST_PART: f64 = 0.05;
/// Inputs of an image, by its seed.
const KINDS: u64 = 6;

/// Codes of an update; `None` for a missing sample.
type Codes = [Option<i32>; MAX_INPUTS];

/// A run that becomes a vector.
struct Worst {
    /// How far off, as a part of the bound.
    part: f64,
    image: Image,
    codes: Vec<Codes>,
}

/// A vector file of each of the worst runs.
pub(crate) fn vectors(folder: &Path) -> Result<Vec<PathBuf>> {
    let folder = folder.join("faults");
    fs::create_dir_all(&folder)?;
    let vector = |(at, worst): (usize, &Worst)| {
        let path = folder.join(format!("fault-{at:03}.hex"));
        fs::write(&path, worst.words()?)?;
        Ok(path)
    };
    search(IMAGES)?.iter().enumerate().map(vector).collect()
}

/// The same, so many in a file, one behind the other: the hardware's bench reads them so.
pub(crate) fn joined(folder: &Path, most: usize) -> Result<Vec<PathBuf>> {
    let join = |(number, files): (usize, &[PathBuf])| {
        let path = folder.join(format!("faults-{number}.hex"));
        let texts: Vec<String> = files.iter().map(fs::read_to_string).collect::<Result<_, _>>()?;
        fs::write(&path, texts.concat())?;
        Ok(path)
    };
    vectors(folder)?.chunks(most).enumerate().map(join).collect()
}

/// All runs; the worst, with the worst first.
///
/// # Errors
/// A run that is wrong with status 0, or off by more than its number.
fn search(images: u64) -> Result<Vec<Worst>> {
    let mut worst: Vec<Worst> = Vec::new();
    for seed in 0..images {
        let unit = Unit::new(seed)?;
        for run in 0..RUNS {
            let found = unit.run(run).with_context(|| format!("image {seed}, run {run}"))?;
            ensure!(found.part <= 1.0, "image {seed}, run {run}: off by {:.3} of the bound with status 0", found.part);
            worst.push(found);
        }
        worst.sort_by(|a, b| b.part.total_cmp(&a.part));
        worst.truncate(WORST);
    }
    let (first, last) = (worst.first().context("no run")?.part, worst.last().context("no run")?.part);
    println!(
        "check: {} faults of {images} images: 0 wrong with status 0, 0 beyond their number; the {WORST} worst reach {last:.2} to {first:.2} of the bound",
        images * RUNS
    );
    Ok(worst)
}

impl Worst {
    /// Its updates around the worst one, from power-on, each with its ticks.
    fn words(&self) -> Result<String> {
        let mut making = Making::new(Module::Compensator, image_bytes(*self.image.description())?, "a fault")?;
        making.step(0, &[])?;
        for (update, codes) in self.codes.iter().enumerate() {
            let present = codes.iter().enumerate().map(|(at, code)| u32::from(code.is_some()) << at).sum();
            let [a, b, c, d] = codes.map(|code| code.unwrap_or(0).cast_unsigned());
            making.step(1, &[present, a, b, c, d])?;
            making.step(2, &[PERIOD_TICKS, update as u32, 5, 3])?;
        }
        making.words()
    }
}

/// A simulated unit.
struct Unit {
    seed: u64,
    inputs: Vec<Input>,
    gyro: Compensator,
    /// °/h per count and period in 2⁻³².
    dph: f64,
    /// What status 0 may be off by, °/h.
    most_dph: f64,
}

impl Unit {
    fn new(seed: u64) -> Result<Self> {
        let mut rng = ChaCha8Rng::seed_from_u64(49_000 + seed);
        let calibration = calibration(seed % KINDS, &mut rng)?;
        let axis = calibration.axes.first().context("no axis")?;
        let image = encode(&calibration, axis, [0; 32], 1)?;
        let d = image.description();
        let dph = d.scale_factor_femto_arcsec as f64 * 1e-15 * d.quantum_nano_counts as f64 * 1e-9
            / (f64::from(d.tick_ns) * 1e-9);
        let rates = image.terms().iter().filter(|term| term.multiplier == Multiplier::Rate && term.kind == Kind::Bias);
        let effect: f64 =
            rates.map(|term| f64::from(term.mantissa).abs() * 2.0_f64.powi(-9 - i32::from(term.shift)) * dph).sum();
        let inputs = axis.correction.inputs.clone();
        let of_steps: f64 = axis.correction.terms.iter().map(|term| of_smallest_step(term, &inputs)).sum();
        let most_dph = MOST_DPH.max(MOST_PART * effect) + of_steps;
        Ok(Self { seed, inputs, gyro: Compensator::new(image), dph: dph * 2.0_f64.powi(-32), most_dph })
    }

    /// One fault, and the update at which it is farthest off with status 0.
    fn run(&self, run: u64) -> Result<Worst> {
        let mut rng = ChaCha8Rng::seed_from_u64((self.seed << 20) + run);
        let truth = self.values(&mut rng);
        let (faulty, restart) = self.with_fault((self.seed / KINDS + run) % 9, &truth, &mut rng);
        let codes = |values: &[[Option<f64>; MAX_INPUTS]]| -> Vec<Codes> {
            values.iter().map(|values| self.codes(values)).collect()
        };
        let truth: Vec<[Option<f64>; MAX_INPUTS]> = truth.iter().map(|values| values.map(Some)).collect();
        let (codes, healthy) = (codes(&faulty), codes(&truth));
        let (mut part, mut worst_at) = (0.0, 0);
        for (at, (with, without)) in
            self.updates(&codes, restart)?.iter().zip(self.updates(&healthy, None)?).enumerate()
        {
            let off_dph = (with.target - without.target).abs() as f64 * self.dph;
            let most = f64::from(with.bound_milli_dph) * 1e-3;
            ensure!(
                with.bound_milli_dph == UNBOUNDED || off_dph <= most,
                "update {at} is off by {off_dph} °/h, and its number says {most}"
            );
            if with.status == Status::OK && off_dph / self.most_dph > part {
                (part, worst_at) = (off_dph / self.most_dph, at);
            }
        }
        let from = worst_at.saturating_sub(BEFORE);
        let codes = codes[from..(from + UPDATES).min(codes.len())].to_vec();
        Ok(Worst { part, image: *self.gyro.image(), codes })
    }

    /// Each update of a run.
    fn updates(&self, codes: &[Codes], restart: Option<usize>) -> Result<Vec<Update>> {
        let (mut state, mut bound) = (State::new(), ErrorBound::new());
        let image = self.gyro.image();
        let update = |(at, codes): (usize, &Codes)| {
            if restart == Some(at) {
                state = State::warm();
            }
            self.gyro.update(&mut state, &codes[..image.inputs().len()])?;
            bound.update(image, &state);
            self.gyro.advance(&mut state, 0, PERIOD_TICKS)?;
            let (target, status) = (state.target_increment(), state.status());
            Ok(Update { target, status, bound_milli_dph: bound.milli_dph() })
        };
        codes.iter().enumerate().map(update).collect()
    }

    /// True values of each input with a code, update by update: ramps of up to 1 °C/min and soaks; a second thermometer behind the first; a supply
    /// that swings.
    fn values(&self, rng: &mut ChaCha8Rng) -> Vec<[f64; MAX_INPUTS]> {
        let mut celsius = rng.random_range(-20.0..50.0);
        let (mut goal, mut per_update, mut soak) = (celsius, 0.0, 0);
        let (mut second, period_s, phase) = (celsius, rng.random_range(1800.0..7200.0), rng.random_range(0.0..6.0));
        let value = |at: usize| {
            if soak > 0 {
                soak -= 1;
            } else if f64::abs(goal - celsius) <= per_update {
                goal = rng.random_range(-38.0..68.0);
                per_update = rng.random_range(0.2..0.95) / 60.0 * PERIOD_S;
                soak = rng.random_range(0..720);
            } else {
                celsius += per_update * (goal - celsius).signum();
            }
            second += (celsius - second) * PERIOD_S / 150.0;
            let volts = 5.0 + 0.1 * (at as f64 * PERIOD_S * std::f64::consts::TAU / period_s + phase).sin();
            let of = |input: &Input| match &input.source {
                InputSource::Thermometer(name) if name.is_empty() => celsius,
                InputSource::Thermometer(_) => second,
                _ => volts,
            };
            std::array::from_fn(|at| self.inputs.get(at).map_or(0.0, of))
        };
        (0..SIX_HOURS).map(value).collect()
    }

    /// One fault of one input, and the update at which the processor begins again.
    fn with_fault(
        &self,
        kind: u64,
        truth: &[[f64; MAX_INPUTS]],
        rng: &mut ChaCha8Rng,
    ) -> (Vec<[Option<f64>; MAX_INPUTS]>, Option<usize>) {
        let mut values: Vec<[Option<f64>; MAX_INPUTS]> = truth.iter().map(|values| values.map(Some)).collect();
        let with_code: Vec<usize> = (0..self.inputs.len()).filter(|at| self.inputs[*at].has_code()).collect();
        let input = with_code[rng.random_range(0..with_code.len())];
        let start = rng.random_range(720..SIX_HOURS - 720);
        let length = f64::exp(rng.random_range(0.0..7.5)) as usize;
        let unit = if matches!(self.inputs[input].source, InputSource::Column(_)) { 0.005 } else { 0.2 };
        let size = unit * f64::exp(rng.random_range(0.0..6.2)) * if rng.random() { -1.0 } else { 1.0 };
        // No more than keeps a reading valid: a wrong one behind missing ones may have come within the limits of slope.
        let size = if kind < 6 { size } else { size.clamp(-15.0, 15.0) };
        let mut off = |from: usize, to: usize, size: f64| {
            let until = to.min(SIX_HOURS);
            values[from.min(until)..until]
                .iter_mut()
                .filter_map(|all| all[input].as_mut())
                .for_each(|value| *value += size);
        };
        match kind {
            0 => (0..rng.random_range(1..5)).for_each(|k| off(start + 7 * k, start + 7 * k + 1 + k % 2, size)),
            1 => off(start, start + length, size),
            3 => off(0, length.min(5), size),
            4 => {
                off(start, start + length, size);
                off(start + 2 * length, start + 3 * length, -0.7 * size);
            }
            // A contact that comes back for a moment.
            6 => {
                let again = start + length + rng.random_range(0..12);
                off(start, start + length, size);
                off(again, SIX_HOURS, size);
            }
            // A step soon after missing samples, and missing samples soon after a step.
            7 | 8 => {
                let gap = if kind == 7 { start } else { start + length + rng.random_range(1..5) };
                let step = if kind == 7 { start + length + rng.random_range(1..9) } else { start + length };
                off(step, SIX_HOURS, size);
                let gap = gap.min(SIX_HOURS)..(gap + length).min(SIX_HOURS);
                values[gap].iter_mut().for_each(|values| values[input] = None);
            }
            2 => {
                let all = rng.random();
                for values in &mut values[start..(start + length).min(SIX_HOURS)] {
                    values
                        .iter_mut()
                        .enumerate()
                        .filter(|(at, _)| all || *at == input)
                        .for_each(|(_, value)| *value = None);
                }
            }
            _ => {}
        }
        (values, (kind == 5).then_some(start))
    }

    fn codes(&self, values: &[Option<f64>; MAX_INPUTS]) -> Codes {
        std::array::from_fn(|at| {
            let input = self.inputs.get(at).filter(|input| input.has_code())?;
            let step = (input.max_step / 4.0).max(input.gain_per_code);
            values[at]
                .map(|value| (((value / step).round() * step - input.offset) / input.gain_per_code).round() as i32)
        })
    }
}

/// One slow update.
struct Update {
    target: i64,
    status: Status,
    bound_milli_dph: u32,
}

/// Random numbers of a record: curve and rate terms of a thermometer, and by kind a second lag, a difference, a supply, a warm-up.
fn calibration(kind: u64, rng: &mut ChaCha8Rng) -> Result<Calibration> {
    let setup = Setup {
        serial: Some("FAULTS".to_owned()),
        arcsec_per_count: Some(rng.random_range(0.1..2.0)),
        tick_s: Some(PERIOD_S / f64::from(PERIOD_TICKS)),
        temperature_period_s: Some(PERIOD_S),
        slew_ticks: Some(rng.random_range(0..PERIOD_TICKS)),
        ..Setup::default()
    };
    let curve = Polynomial { coefficients: vec![0.0, 0.0, 0.0], window_s: 100.0, span_c: [-40.0, 70.0] };
    let mut made = import(&curve, &setup)?;
    let correction = &mut made.axes.first_mut().context("no axis")?.correction;
    let mut main = correction.inputs.first().context("no input")?.clone();
    main.max_step = [4.0 / 256.0, 0.25][rng.random_range(0..2)];
    main.max_rate_per_s = 3.0 / 60.0;
    main.stale_after_s = 600.0;
    let behind = |mut input: Input, tau_s: f64, per_min: f64| {
        input.lag_s = Some(Lag { value: tau_s, sigma: None });
        input.rate_span_per_min = Some([-1.5 * per_min, 1.5 * per_min]);
        input
    };
    let tau_s = 60.0 * f64::exp(rng.random_range(0.0..2.0));
    let slow_s = 1500.0 * f64::exp(rng.random_range(0.0..1.5));
    let again = |of: &Input, name: &str, source: InputSource| {
        let mut input = of.clone();
        (input.name, input.source) = (name.to_owned(), source);
        input
    };
    let derived = |of: &Input, name: &str, source: InputSource| {
        let mut input = again(of, name, source);
        (input.max_step, input.max_rate_per_s) = (0.0, 0.0);
        input
    };
    let mut inputs = vec![behind(main.clone(), tau_s, 1.0)];
    if matches!(kind, 1 | 5) {
        inputs.push(behind(derived(&main, "slow", InputSource::Repeat(main.name.clone())), slow_s, 1.0));
    }
    if matches!(kind, 2 | 4) {
        let second = again(&main, "case", InputSource::Thermometer("case".to_owned()));
        let mut between = derived(&main, "between", InputSource::Difference(String::new(), "case".to_owned()));
        (between.span, between.reference, between.valid_range) = ([-4.0, 4.0], 0.0, [-127.0, 127.0]);
        inputs.extend([second, behind(between.clone(), slow_s / 4.0, 1.0)]);
        if kind == 4 {
            between = behind(derived(&between, "slow", InputSource::Repeat("between".to_owned())), slow_s, 1.0);
            inputs.push(between);
        }
    }
    if matches!(kind, 3 | 5) {
        let mut supply = again(&main, "supply", InputSource::Column("supply_v".to_owned()));
        (supply.span, supply.reference, supply.valid_range) = ([4.85, 5.15], 5.0, [0.0, 10.0]);
        (supply.max_step, supply.max_rate_per_s) = (0.004, 0.001);
        supply.gain_per_code = 1e-6;
        inputs.push(behind(supply, tau_s, 0.03));
    }
    let mut terms = Vec::new();
    for (at, input) in inputs.iter().enumerate().filter(|(_, input)| input.name != "case") {
        let is_supply = input.name == "supply";
        let mut about = |most: f64| most * rng.random_range(-2.0..2.0);
        if input.repeats().is_none() {
            terms.push(CorrectionTerm::given(Form::bias(1), input, about(if at == 0 { 0.5 } else { 0.2 })));
            terms.push(CorrectionTerm::given(Form::bias(2), input, about(0.2)));
        }
        let per_min = if is_supply { 5.0 } else { 1.0 };
        terms.push(CorrectionTerm::given(Form::rate(0), input, about(per_min)));
        terms.push(CorrectionTerm::given(Form::rate(1), input, about(0.2 * per_min)));
    }
    (correction.inputs, correction.terms) = (inputs, terms);
    if matches!(kind, 0 | 3 | 5) {
        let tau_s = Lag { value: rng.random_range(300.0..3000.0), sigma: None };
        correction.warm_up = Some(WarmUp { value_dph: rng.random_range(-1.0..1.0), sigma_dph: None, tau_s });
    }
    Ok(made)
}

/// What the smallest step that a record can tell from a fault makes by a term, °/h: behind its lag, or on the curve.
fn of_smallest_step(term: &CorrectionTerm, inputs: &[Input]) -> f64 {
    let named = |name: &str| inputs.iter().find(|input| input.name == name);
    let Some(input) = named(&term.input) else { return 0.0 };
    let parent = input.repeats().and_then(named).unwrap_or(input);
    let smallest = |input: &Input| input.max_step.max(input.max_rate_per_s * PERIOD_S);
    let step = match &parent.source {
        InputSource::Difference(..) => smallest(&inputs[0]),
        _ => smallest(parent),
    };
    let [lo, hi] = input.span;
    match input.lag_s.filter(|_| term.times_rate) {
        Some(lag) => term.value.abs() * 60.0 * step / lag.value,
        // No slope of the first two orders is larger over their span.
        None => term.value.abs() * 4.0 * step / ((hi - lo) / 2.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A small sibling of the search in `cargo xtask c`.
    #[test]
    fn no_fault_of_an_image_of_each_kind_is_wrong() {
        let worst = search(2 * KINDS).unwrap();
        assert_eq!(worst.len(), WORST);
        assert!(worst[0].part > 0.3, "{}", worst[0].part);
    }
}
