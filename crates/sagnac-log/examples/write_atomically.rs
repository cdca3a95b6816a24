//! A file that is either complete or absent, even if writing it fails.
//!
//! `cargo run --example write_atomically`

use sagnac_log::write::{write_atomically, write_bytes};
use sagnac_log::{Error, Result};

fn main() -> Result<()> {
    let path = std::env::temp_dir().join(format!("sagnac-example-{}.txt", std::process::id()));
    write_bytes(&path, b"bias 3, rate 0\n")?;

    // A writer that fails midway: the old file is still there.
    let failed = write_atomically(&path, |out| {
        out.write_all(b"bias 4").map_err(|e| Error::io_path(&path, "write", &e))?;
        Err(Error::refused("the data do not support four orders", "give more data, or a smaller model"))
    });
    println!("{}", failed.as_ref().err().map(ToString::to_string).unwrap_or_default());
    let text = std::fs::read_to_string(&path).map_err(|e| Error::io_path(&path, "read", &e))?;
    assert!(failed.is_err() && text == "bias 3, rate 0\n");
    std::fs::remove_file(&path).map_err(|e| Error::io_path(&path, "remove", &e))
}
