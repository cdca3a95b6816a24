//! Packs the reference vectors for the C export: 2.6 MB of text in 0.4 MB.
//!
//! ```text
//! testdata/vectors/*.hex ─▶ "=== name" and text, file after file ─▶ gzip ─▶ OUT_DIR/vectors.gz
//! ```

use std::io::{Error, Write};
use std::path::Path;
use std::{env, fs};

use flate2::Compression;
use flate2::write::GzEncoder;

fn main() -> Result<(), Error> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../testdata/vectors");
    println!("cargo::rerun-if-changed={}", folder.display());
    let mut files: Vec<_> = fs::read_dir(&folder)?.map(|entry| entry.map(|e| e.path())).collect::<Result<_, _>>()?;
    files.sort();
    let mut packed = GzEncoder::new(Vec::new(), Compression::best());
    for file in files {
        println!("cargo::rerun-if-changed={}", file.display());
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        writeln!(packed, "=== {name}")?;
        packed.write_all(&fs::read(&file)?)?;
    }
    let out = env::var_os("OUT_DIR").ok_or_else(|| Error::other("cargo says where to write"))?;
    fs::write(Path::new(&out).join("vectors.gz"), packed.finish()?)
}
