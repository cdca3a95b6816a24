//! Bytes of a log: opened, hashed, unpacked, and known for another program's. Knows no format that is read.

pub(crate) mod foreign;
pub(crate) mod source;
