//! Coverage, power and risk. One body measures each: on all of its records in the program `studies`, on a few in `tests`.
//!
//! ```text
//! studies   the bound of the claim is asserted, and a row of the evidence written     SAGNAC_EVIDENCE=FILE
//! tests     the sibling: the bound that a program just at the claim's bound breaks once in 10,000 runs of so few records
//! ```
//!
//! A sibling catches the gross fault: coverage one half, every second bad unit accepted. Of such programs it fails six of seven;
//! where so few records cannot, [`evidence`] panics and asks for more of them.

use std::fmt::Write as _;
use std::fs::OpenOptions;
use std::io::Write as _;

use crate::IS_STUDY;

/// Records of the sibling, as a rule.
const FEW: u64 = 20;
/// How rarely a sibling fails a program that is just at its claim's bound.
const RARELY: f64 = 1e-4;
/// Draws of so few records from those of a study.
const DRAWS: usize = 1000;

/// How many records measure a claim.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Records {
    all: u64,
    few: u64,
}

impl Records {
    pub(crate) const fn new(all: u64) -> Self {
        Self { all, few: if all < FEW { all } else { FEW } }
    }

    /// The same with so many in the sibling, where [`FEW`] show no gross fault.
    pub(crate) const fn few(self, few: u64) -> Self {
        Self { few: if self.all < few { self.all } else { few }, ..self }
    }

    /// A part of them, each with as few in its sibling as all.
    pub(crate) const fn part(self, of: u64) -> Self {
        Self::new(self.all / of).few(self.few)
    }

    /// How many this program makes.
    pub(crate) const fn count(self) -> u64 {
        if IS_STUDY { self.all } else { self.few }
    }

    /// Their numbers.
    pub(crate) fn each(self) -> std::ops::Range<u64> {
        0..self.count()
    }
}

impl From<u64> for Records {
    fn from(all: u64) -> Self {
        Self::new(all)
    }
}

/// The bound of a ratio, and that of its sibling; `None` in `hours`, where none has one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    all: &'static str,
    few: Option<&'static str>,
}

impl From<[&'static str; 2]> for Bounds {
    fn from([all, few]: [&'static str; 2]) -> Self {
        Self { all, few: Some(few) }
    }
}

impl From<&'static str> for Bounds {
    fn from(all: &'static str) -> Self {
        Self { all, few: None }
    }
}

/// Asserts that a fraction of some records keeps its bound, `≥ 0.97`, `≤ 0.05` or `0.92 … 0.98`.
pub(crate) fn evidence(claim: &str, measured: f64, bound: &str, records: impl Into<Records>) {
    let records = records.into();
    if !IS_STUDY && records.few < records.all {
        return sibling(claim, measured, bound, records.few);
    }
    whole(claim, measured, bound, records.all);
}

/// The same of a value that fewer records make no worse, the largest error of all.
pub(crate) fn largest(claim: &str, measured: f64, bound: &str, records: impl Into<Records>) {
    whole(claim, measured, bound, records.into().all);
}

/// The same of a ratio or a mean, a function of records. A sibling's bound is stated; a study draws so few of its records a thousand
/// times, and none breaks it.
pub(crate) fn ratio<T: Copy>(
    claim: &str,
    of: &[T],
    value: impl Fn(&[T]) -> f64,
    bounds: impl Into<Bounds>,
    records: impl Into<Records>,
) {
    let (records, Bounds { all, few }) = (records.into(), bounds.into());
    assert_eq!(of.len() as u64, records.count(), "{claim}: each record counts once");
    let measured = value(of);
    if !IS_STUDY {
        let few = few.unwrap_or_else(|| panic!("{claim}: a sibling without a bound"));
        return assert!(is_within(measured, few), "{claim}, {} records: {measured}, not {few}", of.len());
    }
    whole(claim, measured, all, records.all);
    let Some(sibling) = few else { return };
    let mut drawn = draws(of, records.few as usize).map(|few| value(&few)).collect::<Vec<f64>>();
    drawn.sort_by(f64::total_cmp);
    let broken = drawn.iter().filter(|value| !is_within(**value, sibling)).count();
    let [least, most] = [drawn[0], drawn[drawn.len() - 1]];
    println!("  {DRAWS} draws of {} records: {least} … {most}", records.few);
    assert!(broken == 0, "{claim}: {broken} of {DRAWS} draws break the sibling's {sibling}: {least} … {most}");
}

/// Samples with replacement, by a generator of numbers of its own (Knuth's MMIX).
fn draws<T: Copy>(of: &[T], few: usize) -> impl Iterator<Item = Vec<T>> {
    let mut state = 1_u64;
    let mut below = move |end: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) as usize) % end
    };
    (0..DRAWS).map(move |_| (0..few).map(|_| of[below(of.len())]).collect())
}

fn whole(claim: &str, measured: f64, bound: &str, records: u64) {
    println!("{claim}: {measured}, {bound}, {records} records");
    write_row(claim, measured, bound, records);
    assert!(is_within(measured, bound), "{claim}: {measured}, not {bound}");
}

/// A row of the evidence, where the environment says into which file; `cargo xtask ci` merges them.
fn write_row(claim: &str, measured: f64, bound: &str, records: u64) {
    let Some(path) = std::env::var_os("SAGNAC_EVIDENCE").filter(|_| IS_STUDY) else { return };
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("?");
    let mut row = String::new();
    writeln!(row, "{test},{records},{},{bound},\"{}\"", three_digits(measured), claim.replace('"', "\"\"")).unwrap();
    let file = OpenOptions::new().create(true).append(true).open(path);
    file.unwrap().write_all(row.as_bytes()).unwrap();
}

fn is_within(measured: f64, bound: &str) -> bool {
    let [least, most] = ends(bound);
    least.is_none_or(|least| measured >= least) && most.is_none_or(|most| measured <= most)
}

/// Least and most of a bound.
fn ends(bound: &str) -> [Option<f64>; 2] {
    let number = |text: &str| Some(text.trim().parse::<f64>().unwrap());
    if let Some(least) = bound.strip_prefix('≥') {
        [number(least), None]
    } else if let Some(most) = bound.strip_prefix('≤') {
        [None, number(most)]
    } else {
        let (least, most) = bound.split_once('…').unwrap();
        [number(least), number(most)]
    }
}

/// The bound of so few records: at most [`RARELY`] broken by a program whose true fraction is at the bound of the claim.
fn sibling(claim: &str, measured: f64, bound: &str, few: u64) {
    let [least, most] = ends(bound);
    let least = least.map_or(0, |least| fewest(few, least));
    // Of a fraction at most p, those that fail are at least 1 − p.
    let most = few - most.map_or(0, |most| fewest(few, 1.0 - most));
    let is_gross = ends(bound).into_iter().flatten().all(|end| !(0.15..0.85).contains(&end));
    let passes = chance(few, 0.5, most) - if least > 0 { chance(few, 0.5, least - 1) } else { 0.0 };
    assert!(
        !is_gross || passes <= 0.15,
        "{claim}: {few} records pass a program at one half in {passes:.2} of its runs"
    );
    let [lo, hi] = [least, most].map(|count| count as f64 / few as f64);
    let holds = (lo - 1e-9..=hi + 1e-9).contains(&measured);
    assert!(holds, "{claim}, {few} records: {measured}, not {lo} … {hi} (of the study: {bound})");
}

/// The largest count that a program at fraction `p` stays below in at most [`RARELY`] of its runs.
fn fewest(of: u64, p: f64) -> u64 {
    (1..=of).take_while(|count| chance(of, p, count - 1) <= RARELY).last().unwrap_or(0)
}

/// Probability of at most `most` of `of` at fraction `p`: the binomial distribution.
fn chance(of: u64, p: f64, most: u64) -> f64 {
    let (mut ways, mut sum) = (1.0, 0.0);
    for k in 0..=most {
        sum += ways * p.powi(k as i32) * (1.0 - p).powi((of - k) as i32);
        ways *= (of - k) as f64 / (k + 1) as f64;
    }
    sum
}

/// Rounded to three digits; whole numbers as they are.
fn three_digits(value: f64) -> String {
    if value.fract() == 0.0 {
        return value.to_string();
    }
    let places = (2 - value.abs().log10().floor() as i32).max(0) as usize;
    format!("{value:.places$}")
}

#[test]
fn siblings_fail_a_gross_fault_and_no_right_program() {
    // 0.97 and 0.5 of 20: sums of Python's `math.comb`.
    assert!((chance(20, 0.97, 14) - 1.964_74e-5).abs() < 1e-9 && (chance(20, 0.5, 14) - 0.979_305).abs() < 1e-6);
    assert_eq!([fewest(20, 0.97), fewest(20, 0.95), fewest(60, 0.9), fewest(20, 1.0)], [15, 14, 44, 20]);
    let fails = |measured: f64, bound: &'static str, few: u64| {
        std::panic::catch_unwind(|| sibling("a claim", measured, bound, few)).is_err()
    };
    assert!(!fails(0.75, "≥ 0.97", 20) && fails(0.7, "≥ 0.97", 20) && fails(0.5, "≥ 0.97", 20));
    assert!(!fails(0.25, "≤ 0.03", 20) && fails(0.5, "≤ 0.05", 20));
    assert!(!fails(1.0, "0.92 … 0.98", 30) && fails(0.6, "0.92 … 0.98", 30));
    assert!(fails(1.0, "≥ 0.88", 20), "too few to see a gross fault");
    assert_eq!(three_digits(0.001_234) + &three_digits(1.0) + &three_digits(12.345), "0.00123112.3");
}
