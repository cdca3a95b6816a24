//! Which limits a verification was judged by: name and hash of a file or set.

use serde::{Deserialize, Serialize};

use sagnac_log::ingest::{hex, sha256};

/// Which limits a unit was judged by.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct LimitsSource {
    /// Name of the set, or of the file.
    pub name: String,
    /// SHA-256 of its text.
    pub sha256: String,
    /// The set that it starts from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<Box<LimitsSource>>,
}

impl LimitsSource {
    pub(crate) fn of(name: &str, text: &str) -> Self {
        Self { name: name.to_owned(), sha256: hex(&sha256(text.as_bytes())), base: None }
    }
}
