//! Programs from Debian's packages. As root, missing packages are installed. For any other user the error names the
//! command that installs them.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use anyhow::{Result, bail};

use crate::shell::{root, sh, sh_in};

/// A program (or the path of a file, where `*` stands for one folder) and the Debian package that contains it.
pub type Tool = (&'static str, &'static str);

/// Installs what is missing, as root.
///
/// # Errors
/// Missing packages for a user other than root; a failed installation.
pub fn need(tools: &[Tool]) -> Result<()> {
    let packages = missing(tools);
    if packages.is_empty() {
        return Ok(());
    }
    let install = [&["install", "--yes", "--no-install-recommends"], &packages[..]].concat();
    if !is_root() {
        bail!("Debian packages are missing; as root: apt-get {}", install.join(" "));
    }
    sh("apt-get", &["update", "-qq"])?;
    sh_in(&root(), "apt-get", &[&["-qq"], &install[..]].concat(), &[("DEBIAN_FRONTEND", "noninteractive")])
}

/// The packages of the missing tools, each once.
fn missing(tools: &[Tool]) -> Vec<&'static str> {
    let mut packages: Vec<&str> =
        tools.iter().filter(|(tool, _)| !is_there(tool)).map(|(_, package)| *package).collect();
    packages.sort_unstable();
    packages.dedup();
    packages
}

fn is_there(tool: &str) -> bool {
    if tool.starts_with('/') {
        return file_is_there(tool);
    }
    let paths = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&paths).any(|folder| folder.join(tool).is_file())
}

fn file_is_there(path: &str) -> bool {
    let Some((before, after)) = path.split_once("/*/") else { return Path::new(path).exists() };
    fs::read_dir(before).into_iter().flatten().flatten().any(|entry| entry.path().join(after).exists())
}

/// True for root.
pub fn is_root() -> bool {
    fs::metadata("/proc/self").is_ok_and(|process| process.uid() == 0)
}

/// For `cargo xtask c`.
pub const C: &[Tool] = &[
    ("cmake", "cmake"),
    ("gcc", "gcc"),
    ("/usr/include/x86_64-linux-gnu/asm/errno.h", "linux-libc-dev"),
    ("/usr/lib/gcc/x86_64-linux-gnu/*/32/libgcc.a", "gcc-12-multilib"),
    ("arm-none-eabi-gcc", "gcc-arm-none-eabi"),
    ("/usr/lib/arm-none-eabi/newlib/thumb/v7e-m+fp/hard/librdimon.a", "libnewlib-arm-none-eabi"),
    ("qemu-system-arm", "qemu-system-arm"),
    ("cppcheck", "cppcheck"),
    ("g++", "g++"),
    ("make", "make"),
    ("/usr/include/sodium.h", "libsodium-dev"),
    // Both by their versions: gcc-multilib conflicts with either package for PowerPC.
    ("powerpc-linux-gnu-gcc-12", "gcc-12-powerpc-linux-gnu"),
    ("/usr/powerpc-linux-gnu/lib/libc.a", "libc6-dev-powerpc-cross"),
    ("qemu-ppc", "qemu-user"),
    ("avr-gcc", "gcc-avr"),
    ("/usr/lib/avr/include/stdio.h", "avr-libc"),
    ("simavr", "simavr"),
];

/// For the corpus of broken inputs, whose peak memory GNU time reads.
pub const CORPUS: &[Tool] = &[("/usr/bin/time", "time")];

/// For `cargo xtask fpga`.
pub const FPGA: &[Tool] =
    &[("iverilog", "iverilog"), ("verilator", "verilator"), ("yosys", "yosys"), ("g++", "g++"), ("make", "make")];

/// For `cargo xtask fpga place`, next to those: place and route comes from PyPI.
pub const PLACE: &[Tool] = &[("python3", "python3-venv")];

/// For `cargo xtask firmware`.
pub const FIRMWARE: &[Tool] = &[
    ("/usr/bin/rustc", "rustc-web"),
    ("/usr/lib/rustlib/src/rust/library/core/Cargo.toml", "rust-web-src"),
    ("qemu-system-arm", "qemu-system-arm"),
    ("arm-none-eabi-ld", "binutils-arm-none-eabi"),
    ("arm-none-eabi-gcc", "gcc-arm-none-eabi"),
    ("/usr/lib/arm-none-eabi/newlib/thumb/v7e-m+fp/hard/librdimon.a", "libnewlib-arm-none-eabi"),
];

/// For `cargo xtask dist`.
pub const DIST: &[Tool] = &[
    ("dpkg-deb", "dpkg"),
    ("objdump", "binutils"),
    ("xz", "xz-utils"),
    ("bash", "bash"),
    ("python3", "python3-venv"),
    ("git", "git"),
];

/// For `cargo xtask wheel`: Spark runs on Java.
pub const WHEEL: &[Tool] = &[("python3", "python3-venv"), ("java", "openjdk-17-jre-headless")];

/// For `cargo xtask formats`: the packages come from PyPI.
pub const FORMATS: &[Tool] = &[("python3", "python3-venv")];

/// For the tests of reports in a browser.
pub const BROWSER: &[Tool] = &[
    ("chromium", "chromium"),
    ("chromedriver", "chromium-driver"),
    ("pdftotext", "poppler-utils"),
    ("/usr/share/fonts/truetype/dejavu", "fonts-dejavu-core"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_missing_is_asked_for_and_each_package_once() {
        let tools = [("sh", "dash"), ("no-such-tool", "b"), ("/no/such/file", "a"), ("no-such-tool-either", "b")];
        assert_eq!(missing(&tools), ["a", "b"]);
    }

    #[test]
    fn a_star_is_any_folder() {
        let manifest = format!("{}/*/Cargo.toml", root().display());
        assert!(file_is_there(&manifest));
        assert!(!file_is_there(&manifest.replace("Cargo.toml", "no-such-file")));
    }
}
