//! The first entry of a journal: what is recorded, and how.

use std::collections::HashMap;

use sagnac_log::setup::{BenchSetup, Setup};
use sagnac_log::{Error, Result};
use serde::{Deserialize, Serialize};

use crate::journal::{Entry, EntryKind};

/// What is recorded, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Program and version that began the recording.
    pub program: String,
    /// Its beginning, ns since 1970.
    pub started_ns: i64,
    /// Setup of the test, with the flags over it: a journal can be finished without its bench.toml.
    setup: Setup,
    /// Its `[bench]`, which a record does not hold.
    bench: BenchSetup,
    /// Names of the sources, by their numbers.
    pub sources: Vec<String>,
}

impl Start {
    /// The entry with it.
    ///
    /// # Errors
    /// A setup that is too long for an entry.
    pub fn entry(&self) -> Result<Entry> {
        let text = serde_json::to_string(self).map_err(|e| Error::defect(format!("cannot write the journal: {e}")))?;
        let entry = Entry::text(EntryKind::Start, 0, self.started_ns, &text);
        if entry.payload.len() < text.len() {
            return Err(Error::input("the setup is larger than 64 KiB and cannot be recorded", "shorten the setup"));
        }
        Ok(entry)
    }

    /// The start in a journal's first block.
    ///
    /// # Errors
    /// A journal that does not begin with one.
    pub fn of(entries: &[Entry]) -> Result<Self> {
        let none = || {
            Error::input(
                "the journal does not begin with the setup of its recording",
                "give the journal that `sagnac bench` wrote next to the log",
            )
        };
        let first = entries.first().filter(|entry| entry.kind == EntryKind::Start).ok_or_else(none)?;
        let start: Self = serde_json::from_slice(&first.payload).map_err(|_| none())?;
        start.setup().check()?;
        Ok(start)
    }

    /// Of a recording that begins now.
    pub fn new(program: &str, started_ns: i64, setup: &Setup, sources: Vec<String>) -> Self {
        let (program, setup, bench) = (program.to_owned(), setup.clone(), setup.bench.clone());
        Self { program, started_ns, setup, bench, sources }
    }

    /// The same recording under another setup; its sources stay.
    pub(crate) fn with(&self, setup: &Setup) -> Self {
        let bench = BenchSetup { source: self.bench.source.clone(), ..setup.bench.clone() };
        Self { setup: setup.clone(), bench, ..self.clone() }
    }

    /// The setup of the recording.
    pub fn setup(&self) -> Setup {
        Setup { bench: self.bench.clone(), ..self.setup.clone() }
    }

    /// What the finished log says of its origin: one entry, so that the same journal gives the same bytes.
    pub(crate) fn metadata(&self) -> HashMap<String, String> {
        let (program, sources, started) = (&self.program, self.sources.join(", "), self.started_ns);
        HashMap::from([(
            "sagnac".to_owned(),
            format!("recorded by {program} from {sources}, begun {started} ns after 1970"),
        )])
    }
}
