//! Reference vectors: what every implementation of the target arithmetic must compute, bit for bit.
//!
//! ```text
//! testdata/vectors/*.hex ─▶ words ─▶ table ─▶ Machine ─┐
//!                                └─▶ record: operation, 8 inputs, 7 outputs ─▶ step(inputs) = outputs ?
//! ```
//!
//! A file is text: 32-bit hexadecimal words with `//` comments, as Verilog's `$readmemh` reads them. It has a head of
//! four words (magic, module, bytes of the table, records), the table (a flash image or a table of the loops, four
//! bytes per word, little-endian), and 16 words per record. `cargo xtask bless vectors` makes the files from the core.
//! They are read by the Rust core on the host and on a Cortex-M, by the C99 export on both, and by the Verilog export.
//!
//! A record runs many ticks. Its stimulus comes from a linear congruential generator and, for the loops, from a small
//! integer plant, both defined in `docs/reference/vectors.md`; its outputs are the state at the end and a hash over
//! every tick.
//!
//! Limits: a hash shows in which record something differs, not in which tick. Two differences in one record cancel with
//! a probability of 2⁻³².
#![no_std]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod compensator;
mod file;
mod intensity;
mod path_length;
mod quadrature;
mod stimulus;
mod strip;
mod watch;

use core::fmt;

pub use compensator::CompensatorMachine;
pub use file::{BadFile, Head, Words};
pub use intensity::IntensityMachine;
pub use path_length::PathLengthMachine;
pub use quadrature::QuadratureMachine;
pub use strip::StripperMachine;
pub use watch::WatchMachine;

/// First word of a file.
pub const MAGIC: u32 = 0x5a67_ac01;
/// Words of a record.
pub const RECORD: usize = 1 + INPUTS + OUTPUTS;
/// Inputs of a record.
pub const INPUTS: usize = 8;
/// Outputs of a record.
pub const OUTPUTS: usize = 7;
/// Largest table, bytes.
pub const MAX_TABLE: usize = sagnac_core::MAX_IMAGE_LEN;

/// The module that a file tests: its second word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Module {
    /// [`CompensatorMachine`].
    Compensator = 1,
    /// [`PathLengthMachine`].
    PathLength = 2,
    /// [`IntensityMachine`].
    Intensity = 3,
    /// [`QuadratureMachine`].
    Quadrature = 4,
    /// [`StripperMachine`].
    Stripper = 5,
    /// [`WatchMachine`]. The bench of the hardware has another use for 6.
    Watch = 7,
}

/// An implementation under test, driven by records.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "one at a time")]
pub enum Machine {
    /// See [`CompensatorMachine`].
    Compensator(CompensatorMachine),
    /// See [`PathLengthMachine`].
    PathLength(PathLengthMachine),
    /// See [`IntensityMachine`].
    Intensity(IntensityMachine),
    /// See [`QuadratureMachine`].
    Quadrature(QuadratureMachine),
    /// See [`StripperMachine`].
    Stripper(StripperMachine),
    /// See [`WatchMachine`].
    Watch(WatchMachine),
}

/// Result of a file that passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Passed {
    /// Module tested.
    pub module: Module,
    /// Number of records, all equal.
    pub records: u32,
    /// Number of ticks.
    pub ticks: u64,
}

/// Why a file fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// The file is not a vector file.
    File(BadFile),
    /// The table in the file is refused.
    Table,
    /// A record has an operation that its module does not have.
    Operation {
        /// Record, from 0.
        record: u32,
        /// The operation.
        operation: u32,
    },
    /// An output differs.
    Differs {
        /// Module tested.
        module: Module,
        /// Record, from 0.
        record: u32,
        /// Output, from 0.
        output: u32,
        /// Value in the file.
        expected: u32,
        /// Value computed.
        found: u32,
    },
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(bad) => write!(f, "{bad}"),
            Self::Table => f.write_str("the table in the file is refused"),
            Self::Operation { record, operation } => write!(f, "record {record}: no operation {operation}"),
            Self::Differs { module, record, output, expected, found } => {
                write!(f, "{module:?}: record {record}, output {output}: {found:08x}; expected {expected:08x}")
            }
        }
    }
}

impl core::error::Error for Failure {}

impl Module {
    /// The module with this number.
    pub const fn of(number: u32) -> Option<Self> {
        match number {
            1 => Some(Self::Compensator),
            2 => Some(Self::PathLength),
            3 => Some(Self::Intensity),
            4 => Some(Self::Quadrature),
            5 => Some(Self::Stripper),
            7 => Some(Self::Watch),
            _ => None,
        }
    }
}

impl Machine {
    /// A machine at power-on; `None` if the table is refused.
    pub fn new(module: Module, table: &[u8]) -> Option<Self> {
        Some(match module {
            Module::Compensator => Self::Compensator(CompensatorMachine::new(table)?),
            Module::PathLength => Self::PathLength(PathLengthMachine::new(table)?),
            Module::Intensity => Self::Intensity(IntensityMachine::new(table)?),
            Module::Quadrature => Self::Quadrature(QuadratureMachine::new()),
            Module::Stripper => Self::Stripper(StripperMachine::new()),
            Module::Watch => Self::Watch(WatchMachine::new()),
        })
    }

    /// Runs one record's operation; `None` if there is no such operation.
    pub fn step(&mut self, operation: u32, inputs: &[u32; INPUTS]) -> Option<[u32; OUTPUTS]> {
        match self {
            Self::Compensator(machine) => machine.step(operation, inputs),
            Self::PathLength(machine) => machine.step(operation, inputs),
            Self::Intensity(machine) => machine.step(operation, inputs),
            Self::Quadrature(machine) => machine.step(operation, inputs),
            Self::Stripper(machine) => machine.step(operation, inputs),
            Self::Watch(machine) => machine.step(operation, inputs),
        }
    }

    /// Ticks so far.
    pub const fn ticks(&self) -> u64 {
        match self {
            Self::Compensator(machine) => machine.ticks(),
            Self::PathLength(machine) => machine.ticks(),
            Self::Intensity(machine) => machine.ticks(),
            Self::Quadrature(machine) => machine.ticks(),
            Self::Stripper(machine) => machine.ticks(),
            Self::Watch(machine) => machine.ticks(),
        }
    }
}

/// Runs a whole file.
///
/// # Errors
/// [`Failure`]: the first difference from the file.
pub fn check(text: &[u8]) -> Result<Passed, Failure> {
    let mut words = Words::new(text);
    let head = words.head().map_err(Failure::File)?;
    let mut table = [0; MAX_TABLE];
    let table = words.table(&head, &mut table).map_err(Failure::File)?;
    let mut machine = Machine::new(head.module, table).ok_or(Failure::Table)?;
    for record in 0..head.records {
        let [operation, rest @ ..] = words.record().map_err(Failure::File)?;
        let (inputs, outputs) = split(&rest);
        let found = machine.step(operation, &inputs).ok_or(Failure::Operation { record, operation })?;
        for ((output, expected), found) in (0_u32..).zip(outputs).zip(found) {
            if expected != found {
                return Err(Failure::Differs { module: head.module, record, output, expected, found });
            }
        }
    }
    words.end().map_err(Failure::File)?;
    Ok(Passed { module: head.module, records: head.records, ticks: machine.ticks() })
}

fn split(rest: &[u32; INPUTS + OUTPUTS]) -> ([u32; INPUTS], [u32; OUTPUTS]) {
    let (mut inputs, mut outputs) = ([0; INPUTS], [0; OUTPUTS]);
    inputs.iter_mut().chain(&mut outputs).zip(rest).for_each(|(slot, word)| *slot = *word);
    (inputs, outputs)
}
