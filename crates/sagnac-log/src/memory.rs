//! The memory that the data of one run may take.
//!
//! ```text
//! budget, 1 GiB ─┬ 1/4  one step of a decoder: pages of Parquet, a batch of Arrow
//!                ├ 1/4  windows
//!                ├ 1/4  tracks of thermometers and auxiliary columns
//!                └ 1/4  pieces of a log at work, the fit, the report
//! ```
//!
//! A file of a few hundred bytes can announce any size, so each allocation that a file sizes is compared with its share before it is
//! made. The shares are fixed: whether a file is read depends on the file and the budget, never on the number of threads or on which of
//! them was faster. What is counted is the data; the program itself and its libraries take about 20 MiB more.

use crate::error::Error;

/// A budget in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MemoryBudget(u64);

impl Default for MemoryBudget {
    /// 1 GiB.
    fn default() -> Self {
        Self(1 << 30)
    }
}

impl MemoryBudget {
    /// Least budget, bytes: the pieces of a log at work need it.
    pub const LEAST: u64 = 64 << 20;

    /// A budget of so many bytes; `None` below [`MemoryBudget::LEAST`].
    pub fn of_bytes(bytes: u64) -> Option<Self> {
        (bytes >= Self::LEAST).then_some(Self(bytes))
    }

    /// Bytes that one step of a decoder may unpack.
    pub fn decoder(self) -> u64 {
        self.0 / 4
    }

    /// Bytes of all windows.
    pub fn windows(self) -> u64 {
        self.0 / 4
    }

    /// Bytes of all tracks.
    pub fn tracks(self) -> u64 {
        self.0 / 4
    }

    /// The error of an allocation beyond its share: "`what` more than …".
    pub fn exceeded(self, what: &str, share: u64, or: &str) -> Error {
        Error::input(
            format!("{what} more than {} MiB", share >> 20),
            format!("{or}, or give more memory than {} MiB with --memory", self.0 >> 20),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::MemoryBudget;

    #[test]
    fn shares_are_parts_of_the_budget_and_a_budget_has_a_least_size() {
        let budget = MemoryBudget::default();
        assert_eq!([budget.decoder(), budget.windows(), budget.tracks()], [256 << 20; 3]);
        assert_eq!(MemoryBudget::of_bytes(MemoryBudget::LEAST - 1), None);
        assert_eq!(MemoryBudget::of_bytes(MemoryBudget::LEAST).map(MemoryBudget::decoder), Some(16 << 20));
        let message = budget.exceeded("windows that take", budget.windows(), "give longer windows").to_string();
        assert!(message.contains("windows that take more than 256 MiB"), "{message}");
    }
}
