//! Paths of the files that the project makes, relative to the workspace.

use std::path::PathBuf;

use xtask::shell::root;

pub(crate) const CALIBRATION_SCHEMA: &str = "docs/reference/calibration.schema.json";
pub(crate) const CHAMBER: &str = "testdata/chamber";
pub(crate) const CIRCLE: &str = "docs/explanation/circle.md";
pub(crate) const CLOSED_LOOP_PICTURE: &str = "docs/pictures/closed-loop.svg";
pub(crate) const COMPARISON: &str = "docs/explanation/comparison.md";
pub(crate) const DOCS: &str = "docs";
pub(crate) const ERRORS: &str = "docs/reference/errors.md";
pub(crate) const FAULTS: &str = "docs/reference/faults.md";
pub(crate) const FIRST_BYTES: &str = "crates/sagnac-sim/tests/first_bytes.txt";
pub(crate) const FLEET_TABLE: &str = "docs/reference/fleet-table.md";
pub(crate) const FRAME_HEADER: &str = "ports/c/sagnac_frame.h";
pub(crate) const GLOSSARY: &str = "GLOSSARY.md";
pub(crate) const GLOSSARY_PAGE: &str = "docs/reference/glossary.md";
pub(crate) const IMAGE_FORMAT: &str = "docs/reference/image-format.md";
pub(crate) const LIMITS: &str = "docs/reference/limits.md";
pub(crate) const MANUAL: &str = "docs/reference/cli.md";
pub(crate) const OTHER_TOOLS: &str = "docs/how-to/other-tools.md";
pub(crate) const PAPER_IMAGE: &str = "testdata/image/paper.img";
pub(crate) const PERFORMANCE: &str = "docs/explanation/performance.md";
pub(crate) const PERFORMANCE_PLOT: &str = "docs/explanation/performance.svg";
pub(crate) const PICTURES: &str = "docs/pictures";
pub(crate) const README: &str = "README.md";
pub(crate) const RECORD: &str = "docs/reference/record.md";
pub(crate) const SCENARIO_KEYS: &str = "docs/reference/scenario.md";
pub(crate) const SERIAL_LINE: &str = "docs/reference/serial-line.md";
pub(crate) const TRACEABILITY: &str = "docs/reference/traceability.md";
pub(crate) const VECTORS: &str = "testdata/vectors";

/// The folder of the reference vectors.
pub(crate) fn vectors() -> PathBuf {
    root().join(VECTORS)
}
pub(crate) const GOOD_LOG: &str = "docs/how-to/good-log.md";
