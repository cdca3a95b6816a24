//! `ci/passed.toml`: when each part last passed, and on which inputs. One line a part, sorted; CI writes it, people commit it.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};

/// A part as it last passed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pass {
    /// Hash of its inputs.
    pub(crate) inputs: String,
    /// Year, month and day, UTC.
    pub(crate) date: String,
    pub(crate) wall_s: u64,
    pub(crate) processor_s: u64,
}

const HEAD: &str = "# Written by `cargo xtask ci`: each part as it last passed. A part whose inputs have this hash is not run again.\n";

/// The file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Passed {
    path: PathBuf,
    parts: BTreeMap<String, Pass>,
}

impl Passed {
    /// None have passed where there is no file.
    pub(crate) fn read(path: PathBuf) -> Result<Self> {
        let parts = match fs::read_to_string(&path) {
            Ok(text) => Self::parse(&text)?.parts,
            Err(_) => BTreeMap::new(),
        };
        Ok(Self { path, parts })
    }

    pub(super) fn parse(text: &str) -> Result<Self> {
        let lines = text.lines().enumerate().filter(|(_, line)| !line.starts_with('#') && !line.trim().is_empty());
        let parts = lines.map(|(at, line)| {
            line_of(line).with_context(|| format!("ci/passed.toml:{}: no line of a part: {line}; delete it", at + 1))
        });
        Ok(Self { path: PathBuf::new(), parts: parts.collect::<Result<_>>()? })
    }

    fn text(&self) -> String {
        let line = |(name, pass): (&String, &Pass)| {
            let Pass { inputs, date, wall_s, processor_s } = pass;
            format!(
                "\"{name}\" = {{ inputs = \"{inputs}\", passed = \"{date}\", wall_s = {wall_s}, processor_s = {processor_s} }}\n"
            )
        };
        HEAD.to_owned() + &self.parts.iter().map(line).collect::<String>()
    }

    pub(crate) fn of(&self, part: &str) -> Option<&Pass> {
        self.parts.get(part)
    }

    /// Takes a part out before it runs: one that fails or is interrupted has not passed.
    pub(crate) fn forget(&mut self, part: &str) -> Result<()> {
        self.parts.remove(part);
        self.write()
    }

    pub(crate) fn add(&mut self, part: &str, pass: Pass) -> Result<()> {
        self.parts.insert(part.to_owned(), pass);
        self.write()
    }

    fn write(&self) -> Result<()> {
        let path = &self.path;
        fs::create_dir_all(path.parent().context("a file without a folder")?)?;
        let new = path.with_extension("toml.new");
        fs::write(&new, self.text()).with_context(|| format!("cannot write {}", new.display()))?;
        fs::rename(&new, path).with_context(|| format!("cannot write {}", path.display()))
    }
}

fn line_of(line: &str) -> Option<(String, Pass)> {
    let (name, fields) = line.strip_prefix('"')?.split_once("\" = { ")?;
    let fields: BTreeMap<&str, &str> =
        fields.strip_suffix(" }")?.split(", ").filter_map(|field| field.split_once(" = ")).collect();
    let quoted = |key: &str| Some(fields.get(key)?.trim_matches('"').to_owned());
    let number = |key: &str| fields.get(key)?.parse().ok();
    let pass = Pass {
        inputs: quoted("inputs")?,
        date: quoted("passed")?,
        wall_s: number("wall_s")?,
        processor_s: number("processor_s")?,
    };
    Some((name.to_owned(), pass))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_and_a_broken_line_is_named() {
        let pass = Pass { inputs: "5f2c".to_owned(), date: "2026-11-27".to_owned(), wall_s: 31, processor_s: 55 };
        let parts = [("studies of fit", &pass), ("c", &pass)].map(|(n, p)| (n.to_owned(), p.clone()));
        let passed = Passed { parts: parts.into(), ..Passed::default() };
        let text = passed.text();
        assert_eq!(Passed::parse(&text).unwrap(), passed);
        assert!(text.find("\"c\"").unwrap() < text.find("\"studies").unwrap(), "sorted: {text}");
        let broken = text.replace("wall_s = 31", "wall_s = x");
        let message = Passed::parse(&broken).unwrap_err().to_string();
        assert!(message.contains("passed.toml:2"), "{message}");
    }
}
