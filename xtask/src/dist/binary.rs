//! Builds the program for old systems, and reads what a program requires of a system.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use xtask::shell::{root, sh, sh_in, stdout_of, target, text};

use super::OLDEST_GLIBC;

const TARGET: &str = "x86_64-unknown-linux-gnu";
/// From PyPI: a C compiler and linker for any GLIBC, and the cargo subcommand that uses it.
const TOOLS: [&str; 2] = ["ziglang==0.17.1", "cargo-zigbuild==0.24.0"];

/// A release build against an old GLIBC, without paths of this machine.
pub(super) fn build() -> Result<PathBuf> {
    let host = stdout_of(60, "rustc", &["--print", "host-tuple"], &root())?;
    ensure!(host.trim() == TARGET, "archive and package are made for {TARGET}, on a machine of that kind");
    let tools = tools()?;
    let path = format!("{}:{}", text(&tools)?, std::env::var("PATH").unwrap_or_default());
    let cargo_home = std::env::var("CARGO_HOME").or_else(|_| std::env::var("HOME").map(|home| home + "/.cargo"))?;
    let workspace = root();
    let hidden = [(cargo_home.as_str(), "/cargo"), (text(&workspace)?, "/sagnac")];
    let flags: Vec<String> = hidden.iter().map(|(from, to)| format!("--remap-path-prefix={from}={to}")).collect();
    let [major, minor] = OLDEST_GLIBC;
    let target_folder = target().join("dist-build");
    let triple = format!("{TARGET}.{major}.{minor}");
    let args = ["zigbuild", "--release", "--locked", "--package", "sagnac-cli", "--target", &triple, "--target-dir"];
    let env = [
        ("PATH", path.as_str()),
        ("CARGO_ENCODED_RUSTFLAGS", &flags.join("\u{1f}")),
        ("CARGO_PROFILE_RELEASE_STRIP", "true"),
    ];
    sh_in(&root(), "cargo", &[&args[..], &[text(&target_folder)?]].concat(), &env)?;
    Ok(target_folder.join(TARGET).join("release/sagnac"))
}

/// A folder with `cargo-zigbuild` and the compiler that it calls.
fn tools() -> Result<PathBuf> {
    let venv = target().join("dist-tools");
    let programs = venv.join("bin");
    if !programs.join("python3").exists() {
        sh("python3", &["-m", "venv", text(&venv)?])?;
    }
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    sh(text(&programs.join("python3"))?, &[&install[..], &TOOLS].concat())?;
    Ok(programs)
}

/// Requirements of a program on its system.
#[derive(Debug, PartialEq)]
pub(super) struct Needs {
    pub(super) glibc: [u32; 2],
    /// The compiler's support library, for unwinding.
    pub(super) libgcc: bool,
}

impl Needs {
    /// As a Debian package states it.
    pub(super) fn depends(&self) -> String {
        let [major, minor] = self.glibc;
        let libgcc = if self.libgcc { ", libgcc-s1" } else { "" };
        format!("libc6 (>= {major}.{minor}){libgcc}")
    }
}

/// Reads the libraries and the symbol versions from the dynamic section.
pub(super) fn needs(program: &Path) -> Result<Needs> {
    ensure!(fs::metadata(program).is_ok(), "{} is not there", program.display());
    read_needs(&stdout_of(60, "objdump", &["-p", text(program)?], &root())?)
}

fn read_needs(objdump: &str) -> Result<Needs> {
    let (mut libgcc, mut newest) = (false, None);
    for library in objdump.lines().filter_map(|line| line.trim().strip_prefix("NEEDED")).map(str::trim) {
        match library {
            "libgcc_s.so.1" => libgcc = true,
            "libc.so.6"
            | "libm.so.6"
            | "libpthread.so.0"
            | "libdl.so.2"
            | "librt.so.1"
            | "libutil.so.1"
            | "ld-linux-x86-64.so.2" => {}
            other => bail!("the program needs {other}, of which no Debian package is known here"),
        }
    }
    for version in objdump.split_whitespace().filter_map(|word| word.strip_prefix("GLIBC_")) {
        let mut numbers = version.split('.').map(str::parse);
        let version = [numbers.next(), numbers.next()].map(|number| number.and_then(Result::ok).unwrap_or(0));
        newest = newest.max(Some(version));
    }
    Ok(Needs { glibc: newest.context("no version of GLIBC in the program")?, libgcc })
}

#[cfg(test)]
mod tests {
    use super::*;

    const OBJDUMP: &str = "Dynamic Section:\n  NEEDED               libgcc_s.so.1\n  NEEDED               libc.so.6\n\nVersion References:\n  required from libc.so.6:\n    0x06969185 0x00 08 GLIBC_2.9\n    0x09691974 0x00 06 GLIBC_2.2.5\n    0x06969197 0x00 04 GLIBC_2.17\n";

    #[test]
    fn the_newest_version_counts_by_its_numbers() {
        let needs = read_needs(OBJDUMP).unwrap();
        assert_eq!(needs, Needs { glibc: [2, 17], libgcc: true });
        assert_eq!(needs.depends(), "libc6 (>= 2.17), libgcc-s1");
    }

    #[test]
    fn a_library_of_unknown_origin_is_refused() {
        let message = read_needs(&OBJDUMP.replace("libgcc_s.so.1", "libssl.so.3")).unwrap_err().to_string();
        assert!(message.contains("libssl.so.3"), "{message}");
        assert!(read_needs("").is_err());
    }
}
