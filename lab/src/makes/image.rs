//! The image of docs/reference/image-format.md, and its bytes on that page.

use std::fs;

use anyhow::{Context, Result};
use sagnac::export::{Polynomial, encode, image_bytes, import};
use sagnac_log::setup::Setup;
use xtask::shell::root;

use crate::made::Made;
use crate::places::{IMAGE_FORMAT, PAPER_IMAGE};

/// After this line, the first text block of the page shows the bytes.
const EXAMPLE: &str = "\n## Worked example\n";
const BLOCK: [&str; 2] = ["```text\n", "```"];

pub(crate) fn make() -> Result<Vec<Made>> {
    let bytes = paper_image()?;
    let page = fs::read_to_string(root().join(IMAGE_FORMAT)).with_context(|| format!("cannot read {IMAGE_FORMAT}"))?;
    let page = with_dump(&page, &dump(&bytes)).with_context(|| format!("{IMAGE_FORMAT} has no worked example"))?;
    Ok(vec![Made::new(PAPER_IMAGE, bytes), Made::new(IMAGE_FORMAT, page)])
}

/// The paper's curve as an image. No parent: the example must not change with the program's version.
pub(crate) fn paper_image() -> Result<Vec<u8>> {
    let setup = Setup {
        serial: Some("PAPER-RIG".to_owned()),
        arcsec_per_count: Some(1.059),
        quantum: Some(0.25),
        ..Setup::default()
    };
    let polynomial = Polynomial { coefficients: vec![0.85, -46.0, 1043.39], window_s: 100.0, span_c: [17.94, 36.18] };
    let calibration = import(&polynomial, &setup)?;
    let axis = calibration.axes.first().context("no axis")?;
    Ok(image_bytes(&encode(&calibration, axis, [0; 32], 1)?))
}

fn dump(bytes: &[u8]) -> String {
    let row = |(row, chunk): (usize, &[u8])| {
        let hex: Vec<String> = chunk.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("{:4}  {}\n", row * 16, hex.join(" "))
    };
    bytes.chunks(16).enumerate().map(row).collect()
}

fn with_dump(page: &str, dump: &str) -> Option<String> {
    let example = page.find(EXAMPLE)?;
    let start = example + page[example..].find(BLOCK[0])? + BLOCK[0].len();
    let end = start + page[start..].find(BLOCK[1])?;
    Some(format!("{}{dump}{}", &page[..start], &page[end..]))
}

#[cfg(test)]
mod tests {
    use sagnac_core::Image;

    use super::*;

    #[test]
    fn the_worked_example_is_an_image() {
        let bytes = paper_image().unwrap();
        assert_eq!(Image::decode(&bytes).unwrap().serial(), Some("PAPER-RIG"));
    }

    #[test]
    fn only_the_block_behind_the_heading_is_replaced() {
        let page = "```text\na\n```\n## Worked example\nwords\n```text\nold\n```\nmore\n";
        let page = format!("\n{page}");
        assert_eq!(with_dump(&page, "new\n").unwrap(), page.replace("old", "new"));
        assert_eq!(with_dump("no heading", "new\n"), None);
    }
}
