//! Stands for a format that this program was built without.

use crate::ingest::columns::feed::Open;

pub(crate) const OPEN: Option<Open> = None;
