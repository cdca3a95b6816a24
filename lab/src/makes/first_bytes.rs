//! Checksums of the first bytes of log and truth of each scenario. They detect a machine, compiler or crate version that
//! changes the simulator's output.

use std::fmt::Write as _;
use std::io::Write as _;

use anyhow::Result;
use sagnac_sim::{LogText, Scenario, truth_header, write_truth};
use xtask::shell::root;

use crate::made::Made;
use crate::makes::READY;
use crate::places::FIRST_BYTES;

const ROWS: usize = 3000;
const SEED: u64 = 1;

pub(crate) fn make() -> Result<Vec<Made>> {
    let mut text = String::new();
    for name in READY {
        let scenario = Scenario::from_file(root().join(format!("scenarios/{name}/{name}.toml")))?;
        writeln!(text, "{name} {:016x}", fnv_1a(&first_bytes(&scenario)?))?;
    }
    Ok(vec![Made::new(FIRST_BYTES, text)])
}

/// The first rows of the log, and after them those of the truth.
fn first_bytes(scenario: &Scenario) -> Result<Vec<u8>> {
    let mut text = LogText::new(scenario);
    let (mut log, mut truth) = (text.header_line().into_bytes(), truth_header().into_bytes());
    let (mut rows, mut failed) = (0, None);
    // An error is the only way to end a run early.
    let _ = scenario.build()?.start(SEED).each_row(|row, second| {
        failed = log.write_all(text.line(row, second)).and_then(|()| write_truth(&mut truth, row, second)).err();
        rows += 1;
        if rows < ROWS && failed.is_none() { Ok(()) } else { Err(()) }
    });
    failed.map_or(Ok(()), Err)?;
    log.extend(truth);
    Ok(log)
}

fn fnv_1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |sum, byte| (sum ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3))
}
