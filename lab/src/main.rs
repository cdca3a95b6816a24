//! `lab`: measures the program, checks what it exports, and makes the files that the project made. `cargo xtask` builds
//! it with the program and runs it.

mod bench;
mod compare;
mod conserve;
mod errors;
mod exports;
mod firmware;
mod made;
mod pictures;
mod program;
mod vectors;

use std::process::ExitCode;

use anyhow::{Result, bail};

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let task = args.first().map_or("", String::as_str);
    match run(task, args.get(1).map(String::as_str)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{task}: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(task: &str, part: Option<&str>) -> Result<()> {
    match task {
        "bench" => bench::bench(part),
        "c" => exports::c(),
        "cli" => made::cli(),
        "compare" => compare::compare(),
        "conserve" => conserve::conserve(),
        "errors" => errors::write(),
        "firmware" => firmware::firmware(),
        "fpga" => exports::fpga(part == Some("place")),
        "hexdump" => made::hexdump(),
        "pictures" => pictures::pictures(),
        "schema" => made::schema(),
        "testdata" => made::testdata(),
        "vectors" => vectors::write(),
        other => bail!("no such task: {other:?}; `cargo xtask help` lists them"),
    }
}
