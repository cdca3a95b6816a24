//! The hash of a log that is a table in memory, which has no bytes of its own.
//!
//! ```text
//! digest of a column = SHA-256(its values as read: 8 bytes each, little-endian)       times: i64 ns; numbers: f64; faults: one byte
//! hash of the log = SHA-256("sagnac table 1\n", then per column that is read: role, "\n", digest)
//! ```
//!
//! It depends on the values alone: not on the parts that the table came in, nor on the width of its numbers, nor on columns that are not
//! read. A file with the same rows has another hash; its copy is recognised by the sketch ([`crate::ingest::share_rows`]).

use sha2::{Digest, Sha256};

use crate::ingest::bytes::source::HashHandle;
use crate::ingest::columns::header::Layout;
use crate::ingest::columns::raw::{Faults, RawRows};

const HEAD: &[u8] = b"sagnac table 1\n";
/// Values that are turned into bytes at a time.
const VALUES: usize = 512;

/// The digests of the columns so far.
pub(super) struct RowHash {
    roles: Vec<String>,
    columns: Vec<Sha256>,
    whole: HashHandle,
}

impl RowHash {
    pub(super) fn new(layout: &Layout, whole: HashHandle) -> Self {
        let time = layout.time.iter().map(|_| "time_ns".to_owned());
        let axes = layout
            .axes
            .iter()
            .map(|(_, axis, rate)| format!("{} {axis}", if rate.is_some() { "rate" } else { "counts" }));
        let temperatures = layout.temperatures.iter().map(|(_, name, _)| format!("temperature {name}"));
        let aux = layout.aux.iter().map(|(_, name)| format!("aux {name}"));
        let reference = layout.reference.iter().map(|_| "reference".to_owned());
        let faults = layout.valid.iter().map(|_| "valid".to_owned());
        let roles: Vec<String> =
            time.chain(axes).chain(temperatures).chain(aux).chain(reference).chain(faults).collect();
        Self { columns: vec![Sha256::new(); roles.len()], roles, whole }
    }

    /// The next rows.
    pub(super) fn push(&mut self, rows: &RawRows) {
        let mut columns = self.columns.iter_mut();
        let times = (!rows.time_ns.is_empty()).then(|| columns.next()).flatten();
        times.into_iter().for_each(|digest| update(digest, &rows.time_ns, |time_ns| time_ns.to_le_bytes()));
        let reference = (!rows.reference_dps.is_empty()).then_some(&rows.reference_dps);
        let numbers = rows.axes.iter().chain(&rows.temperatures_c).chain(&rows.aux).chain(reference);
        for (digest, values) in columns.by_ref().zip(numbers) {
            update(digest, values, |value| value.to_le_bytes());
        }
        if let Some(digest) = columns.next() {
            rows.faults.iter().for_each(|faults| digest.update([u8::from(faults.has(Faults::FLAGGED))]));
        }
    }

    /// No more rows.
    pub(super) fn finish(&mut self) {
        self.whole.update(HEAD);
        for (role, digest) in self.roles.iter().zip(&mut self.columns) {
            self.whole.update(role.as_bytes());
            self.whole.update(b"\n");
            self.whole.update(&std::mem::take(digest).finalize());
        }
        self.roles.clear();
    }
}

fn update<T: Copy>(digest: &mut Sha256, values: &[T], bytes_of: impl Fn(T) -> [u8; 8]) {
    let mut bytes = [0; 8 * VALUES];
    for part in values.chunks(VALUES) {
        for (place, value) in bytes.chunks_exact_mut(8).zip(part) {
            place.copy_from_slice(&bytes_of(*value));
        }
        digest.update(&bytes[..8 * part.len()]);
    }
}
