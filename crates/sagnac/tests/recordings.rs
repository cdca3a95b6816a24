//! Recordings of others, and how they are read.

use sagnac_log::setup::Setup;

/// A file of the shared recordings, or `None` where they are missing (with a message). CI sets
/// SAGNAC_REQUIRE_SHARED=1, under which a missing file is a failure.
pub(crate) fn shared(name: &str) -> Option<std::path::PathBuf> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if path.exists() {
        return Some(path);
    }
    xtask::skip::skip(&format!("{} is not there", path.display()));
    None
}

/// A setup file of this repository.
pub(crate) fn bench(name: &str) -> Setup {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata").join(name);
    Setup::read(&path).unwrap()
}
