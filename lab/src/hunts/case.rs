//! A case of the hunt.

/// A command on files.
pub(crate) struct HuntCase {
    pub(super) number: u64,
    pub(super) kind: &'static str,
    pub(super) args: Vec<String>,
    pub(super) files: Vec<(String, Vec<u8>)>,
    /// Beginnings of the names of what the command may write.
    pub(super) outputs: Vec<&'static str>,
}
