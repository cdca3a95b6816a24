//! A vector file under construction: records, and the machine that computes their outputs.

use std::fmt::Write as _;

use anyhow::{Context, Result};
use sagnac_core::{Description, Image};
use sagnac_ports::hex_words;
use sagnac_vectors::{INPUTS, MAGIC, Machine, Module};

use crate::made::Made;
use crate::places::VECTORS;

/// A vector file under construction: the machine that computes the outputs, and the text.
pub(crate) struct Making {
    pub(super) machine: Machine,
    about: &'static str,
    head: [u32; 3],
    table: Vec<u8>,
    records: u32,
    text: String,
}

impl Making {
    pub(crate) fn new(module: Module, table: Vec<u8>, about: &'static str) -> Result<Self> {
        let machine = Machine::new(module, &table).context("the table is refused")?;
        let head = [MAGIC, module as u32, table.len() as u32];
        Ok(Self { machine, about, head, table, records: 0, text: String::new() })
    }

    /// One record; its outputs.
    pub(crate) fn step(&mut self, operation: u32, inputs: &[u32]) -> Result<[u32; 7]> {
        let mut all = [0; INPUTS];
        all[..inputs.len()].copy_from_slice(inputs);
        let outputs = self.machine.step(operation, &all).context("no such operation")?;
        for word in [operation].iter().chain(&all).chain(&outputs) {
            write!(self.text, "{word:08x} ")?;
        }
        self.text.pop();
        self.text.push('\n');
        self.records += 1;
        Ok(outputs)
    }

    pub(super) fn made(self, name: &str) -> Result<Made> {
        let about = self.about;
        let words = self.words()?;
        let text = format!(
            "// {about}\n// Made by `cargo xtask bless vectors`; format in docs/reference/vectors.md.\n{words}"
        );
        Ok(Made::new(format!("{VECTORS}/{name}.hex"), text))
    }

    /// Head, table and records.
    pub(crate) fn words(self) -> Result<String> {
        let [magic, module, len] = self.head;
        let mut text = String::new();
        writeln!(text, "{magic:08x} {module:08x} {len:08x} {:08x}", self.records)?;
        text.push_str(&hex_words(&self.table));
        text.push_str(&self.text);
        Ok(text)
    }
}

pub(crate) fn image_bytes(description: Description) -> Result<Vec<u8>> {
    let image = Image::new(description)?;
    let mut bytes = vec![0; image.encoded_len()];
    image.encode(&mut bytes).context("does not fit its own length")?;
    Ok(bytes)
}
