//! `lab TASK`: the tasks of `cargo xtask` that need the project's crates.

use std::process::ExitCode;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    match sagnac_lab::run(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{}: {error:#}", args.join(" "));
            ExitCode::FAILURE
        }
    }
}
