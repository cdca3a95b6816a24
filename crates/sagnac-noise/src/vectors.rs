//! The vector instructions of this processor, found once. What is computed with them does not depend on their width.

use std::sync::LazyLock;

use fearless_simd::Level;

/// The widest there are.
pub(crate) static VECTORS: LazyLock<Level> = LazyLock::new(Level::new);
