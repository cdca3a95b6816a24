//! How `docs/` becomes a site. `cargo xtask docs` calls mdBook; mdBook calls this program for each chapter; then
//! this program checks what mdBook wrote.
//!
//! ```text
//! docs/*.md ─▶ mdBook ─▶ sagnac-site preprocess ─▶ mdBook ─▶ target/site/*.html ─▶ sagnac-site check
//!                        equations to MathML                                       links, anchors, nothing
//!                                                                                  from outside, no page missing
//! ```

mod book;
mod equations;
mod html;
mod links;

use std::io::{self, Read, Write};
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Result, bail};

const HELP: &str = "\
sagnac-site preprocess                  mdBook's preprocessor: a book on standard input, the same with MathML on standard output
sagnac-site preprocess supports HTML    whether it serves this renderer
sagnac-site check DOCS SITE             every finding in the built site, one a line; exit status 1 if there is one";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    match run(&args) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("sagnac-site: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn run(args: &[&str]) -> Result<ExitCode> {
    match args {
        ["preprocess"] => {
            let mut text = String::new();
            io::stdin().read_to_string(&mut text)?;
            io::stdout().write_all(book::preprocess(&text)?.as_bytes())?;
            Ok(ExitCode::SUCCESS)
        }
        ["preprocess", "supports", renderer] => {
            Ok(if *renderer == "html" { ExitCode::SUCCESS } else { ExitCode::FAILURE })
        }
        ["check", docs, site] => {
            let findings = links::check(Path::new(docs), Path::new(site))?;
            findings.iter().for_each(|finding| println!("{finding}"));
            Ok(if findings.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
        }
        _ => bail!("usage:\n{HELP}"),
    }
}
