//! Which limits a verification was judged by: name and hash of a file or set, the customer's specification, the decision rule.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::verify::limits::verdict::DecisionRule;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{hex, sha256};
use sagnac_units::format::controls;

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
    /// How values were compared with the limits; absent in results of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decision: Option<DecisionRule>,
    /// The customer's specification, where the file states one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub specification: Option<Specification>,
}

/// The customer's specification behind the limits, for the head of an acceptance report.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct Specification {
    /// Customer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub customer: Option<String>,
    /// Part number of the unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part: Option<String>,
    /// Revision of the part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub revision: Option<String>,
    /// Number and issue of the specification.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub number: Option<String>,
    /// Paragraph of each limit, by its key: `{ sigma_dph_max = "3.2.1" }`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub paragraphs: BTreeMap<String, String>,
}

/// Longest entry, characters.
const MOST_CHARS: usize = 80;

impl Specification {
    /// Every text fits a line.
    pub(crate) fn check(&self) -> Result<()> {
        let of_head = [&self.customer, &self.part, &self.revision, &self.number].into_iter().flatten();
        let is_line = |text: &&String| text.chars().count() <= MOST_CHARS && !text.contains(controls);
        if let Some(long) = of_head.chain(self.paragraphs.values()).find(|text| !is_line(text)) {
            let what = format!("must have at most {MOST_CHARS} characters, and no control characters");
            return Err(Error::input(what, "shorten the text").column("specification").value(long.clone()));
        }
        Ok(())
    }
}

impl LimitsSource {
    pub(crate) fn of(name: &str, text: &str) -> Self {
        Self { name: name.to_owned(), sha256: hex(&sha256(text.as_bytes())), ..Self::default() }
    }
}
