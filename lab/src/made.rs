//! A generated file on its way to the tree.

/// A generated file; the path is relative to the workspace.
#[derive(Clone)]
pub(crate) struct Made {
    /// Its path.
    pub(crate) path: String,
    /// Its content.
    pub(crate) bytes: Vec<u8>,
}

impl Made {
    pub(crate) fn new(path: impl Into<String>, bytes: impl Into<Vec<u8>>) -> Self {
        Self { path: path.into(), bytes: bytes.into() }
    }
}
