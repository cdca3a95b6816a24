//! Why a scenario is refused.

/// Why a scenario is refused: the key, what is wrong with it, and what to do.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ScenarioError {
    /// `table.key`; empty if the error concerns the whole file.
    pub key: String,
    /// What is wrong and what to do.
    pub message: String,
    /// Line of the file, for errors of syntax and unknown keys.
    pub line: Option<u64>,
}

impl ScenarioError {
    pub(crate) fn new(key: &str, message: impl Into<String>) -> Self {
        Self { key: key.to_owned(), message: message.into(), line: None }
    }
}

impl std::fmt::Display for ScenarioError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.key.is_empty() { write!(f, "{}", self.message) } else { write!(f, "`{}` {}", self.key, self.message) }
    }
}

impl std::error::Error for ScenarioError {}
