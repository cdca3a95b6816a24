//! `cargo xtask bless` makes all generated files. Tests and `--check` compare the committed files with the output of the
//! same functions.
//!
//! ```text
//! FILES: name ─▶ make(program) ─▶ paths and bytes ─┬─▶ written where they differ      bless
//!                                                  └─▶ named where they differ        bless --check, tests
//! ```

use std::fs;
use std::io::Read;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use flate2::read::GzDecoder;
use xtask::shell::root;

use crate::made::Made;
use crate::makes::{
    chamber, circle, errors, faults, first_bytes, glossary, good_log, image, manual, pages, requirements, tables,
    vectors,
};
use crate::program::Program;

/// How files are made, by name.
enum Make {
    /// From the libraries.
    Here(fn() -> Result<Vec<Made>>),
    /// By running the program.
    ByProgram(fn(&Program) -> Result<Vec<Made>>),
}

/// All generated files. Those of the libraries come first: the program reads some.
const FILES: [(&str, Make); 16] = [
    ("testdata", Make::Here(chamber::make)),
    ("image", Make::Here(image::make)),
    ("vectors", Make::Here(vectors::make)),
    ("schema", Make::Here(tables::schema::make)),
    ("limits", Make::Here(tables::limits::make)),
    ("serial-line", Make::Here(tables::serial_line::make)),
    ("glossary", Make::Here(glossary::make)),
    ("scenario", Make::Here(tables::scenario_keys::make)),
    ("first-bytes", Make::Here(first_bytes::make)),
    ("circle", Make::Here(circle::make)),
    ("requirements", Make::Here(requirements::make)),
    ("cli", Make::ByProgram(manual::make)),
    ("errors", Make::ByProgram(errors::make)),
    ("faults", Make::ByProgram(faults::make)),
    ("good-log", Make::ByProgram(good_log::make)),
    ("pages", Make::ByProgram(pages::make)),
];

/// Makes the named files, or all, and writes those that differ. With `--check` nothing is written:
/// any difference is an error that names the file.
pub(crate) fn bless(args: &[&str]) -> Result<()> {
    let check = args.contains(&"--check");
    let names: Vec<&str> = args.iter().copied().filter(|arg| *arg != "--check").collect();
    let program = Program::beside_the_lab()?;
    if check {
        let stale = stale(&names, &program)?;
        ensure!(stale.is_empty(), "out of date; `cargo xtask bless` makes them again:\n{}", stale.join("\n"));
        println!("bless: every generated file is up to date");
        return Ok(());
    }
    for (name, make) in chosen(&names)? {
        for made in made(name, make, &program)? {
            write(&made)?;
        }
    }
    Ok(())
}

/// Names of the files that the program makes.
pub fn of_program() -> Vec<&'static str> {
    FILES.iter().filter_map(|(name, make)| matches!(make, Make::ByProgram(_)).then_some(*name)).collect()
}

/// The stale files of these names (none: of all), each with its first difference.
pub fn stale(names: &[&str], program: &Program) -> Result<Vec<String>> {
    let mut stale = Vec::new();
    for (name, make) in chosen(names)? {
        stale.extend(made(name, make, program)?.iter().filter_map(difference));
    }
    Ok(stale)
}

fn chosen(names: &[&str]) -> Result<Vec<&'static (&'static str, Make)>> {
    if let Some(unknown) = names.iter().find(|name| FILES.iter().all(|(known, _)| known != *name)) {
        let known: Vec<&str> = FILES.iter().map(|(name, _)| *name).collect();
        bail!("nothing named {unknown} is generated; there are: {}", known.join(", "));
    }
    Ok(FILES.iter().filter(|(name, _)| names.is_empty() || names.contains(name)).collect())
}

fn made(name: &str, make: &Make, program: &Program) -> Result<Vec<Made>> {
    let made = match make {
        Make::Here(make) => make(),
        Make::ByProgram(make) => make(program),
    };
    made.with_context(|| format!("{name} cannot be made"))
}

fn write(made: &Made) -> Result<()> {
    if difference(made).is_none() {
        return Ok(());
    }
    let path = root().join(&made.path);
    fs::create_dir_all(path.parent().context("a file without a folder")?)?;
    fs::write(&path, &made.bytes).with_context(|| format!("cannot write {}", made.path))?;
    println!("wrote {}", made.path);
    Ok(())
}

/// The first difference of the committed file, in words. Compressed files are compared by their content.
fn difference(made: &Made) -> Option<String> {
    let Ok(committed) = fs::read(root().join(&made.path)) else { return Some(format!("{} is not there", made.path)) };
    let (committed, anew) = (content(&made.path, &committed), content(&made.path, &made.bytes));
    if committed == anew {
        return None;
    }
    let (Ok(committed), Ok(anew)) = (String::from_utf8(committed), String::from_utf8(anew)) else {
        return Some(made.path.clone());
    };
    Some(format!("{}:{}", made.path, first_difference(&committed, &anew)))
}

fn content(path: &str, bytes: &[u8]) -> Vec<u8> {
    let mut unpacked = Vec::new();
    let is_packed = Path::new(path).extension().is_some_and(|extension| extension == "gz");
    if is_packed && GzDecoder::new(bytes).read_to_end(&mut unpacked).is_ok() { unpacked } else { bytes.to_vec() }
}

/// The line number, the committed line and the generated one.
fn first_difference(committed: &str, anew: &str) -> String {
    let shorter = committed.lines().count().min(anew.lines().count());
    let lines = committed.lines().zip(anew.lines()).enumerate();
    let (at, (is, made)) = { lines }.find(|(_, (is, made))| is != made).unwrap_or((shorter, ("(ends)", "(or here)")));
    format!("{}\n  is   {is}\n  made {made}", at + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Those of the program: the tests of `sagnac-cli`.
    #[test]
    fn files_made_by_the_libraries_are_as_they_are_made() {
        let here = |(name, make): &(&'static str, Make)| matches!(make, Make::Here(_)).then_some(*name);
        let names: Vec<&str> = FILES.iter().filter_map(here).collect();
        let stale = stale(&names, &Program::at("not used")).unwrap();
        assert!(names.len() > 8 && stale.is_empty(), "{}\nrun `cargo xtask bless`", stale.join("\n"));
    }

    #[test]
    fn a_file_that_differs_is_named_with_its_line() {
        let manifest = fs::read_to_string(root().join("lab/Cargo.toml")).unwrap();
        assert_eq!(difference(&Made::new("lab/Cargo.toml", manifest.as_str())), None);
        let other = manifest.replacen("name = ", "nam = ", 1);
        let message = difference(&Made::new("lab/Cargo.toml", other)).unwrap();
        assert!(message.starts_with("lab/Cargo.toml:2\n  is   name = "), "{message}");
        assert_eq!(difference(&Made::new("lab/no-such-file", "")).unwrap(), "lab/no-such-file is not there");
        let longer = difference(&Made::new("lab/Cargo.toml", manifest + "more\n")).unwrap();
        assert!(longer.contains("(ends)"), "{longer}");
    }

    #[test]
    fn compressed_files_are_compared_by_their_content() {
        let log = "testdata/chamber/cycle-1.csv.gz";
        let packed = fs::read(root().join(log)).unwrap();
        let unpacked = content(log, &packed);
        assert!(unpacked.starts_with(b"time_s,"));
        let mut other = packed.clone();
        // The tenth byte of the header: the operating system that packed the file.
        other[9] ^= 3;
        assert_eq!(difference(&Made::new(log, other)), None);
    }

    #[test]
    fn an_unknown_name_is_refused_with_the_known_ones() {
        let message = stale(&["vector"], &Program::at("not used")).unwrap_err().to_string();
        assert!(message.contains("named vector") && message.contains("vectors"), "{message}");
    }
}
