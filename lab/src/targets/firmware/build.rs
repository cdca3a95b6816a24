//! The firmware, built for the target with Debian's compiler, and run in the emulator.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use xtask::shell::{root, sh_in, stdout_of, text};

const TARGET: &str = "thumbv7em-none-eabihf";
/// Builds core and compiler_builtins for the target once, from Debian's source of the same compiler version.
pub(crate) fn sysroot(folder: &Path) -> Result<PathBuf> {
    let versions = ["rustc-web", "rust-web-src"].map(|package| {
        let version = stdout_of(60, "dpkg-query", &["-W", "-f", "${Version}", package], &root())?;
        Ok::<_, anyhow::Error>(version)
    });
    let [compiler, source] = versions;
    let (compiler, source) = (compiler?, source?);
    ensure!(compiler == source, "rustc-web {compiler} and rust-web-src {source} are not of one version");
    let sysroot = folder.join(format!("sysroot-{compiler}"));
    let libraries = sysroot.join(format!("lib/rustlib/{TARGET}/lib"));
    let core = libraries.join("libcore.rlib");
    if !libraries.join("libcompiler_builtins.rlib").exists() {
        fs::create_dir_all(&libraries)?;
        let library = Path::new("/usr/lib/rustlib/src/rust/library");
        let common = ["--target", TARGET, "--edition=2024", "--crate-type", "rlib", "-O", "-C", "panic=abort"];
        let common = [&common[..], &["-C", "embed-bitcode=yes", "--cap-lints", "allow"]].concat();
        let common = [&common[..], &["-Z", "force-unstable-if-unmarked", "--out-dir", text(&libraries)?]].concat();
        let env = [("RUSTC_BOOTSTRAP", "1")];
        let source = library.join("core/src/lib.rs");
        sh_in(folder, "/usr/bin/rustc", &[&common[..], &["--crate-name", "core", text(&source)?]].concat(), &env)?;
        let source = library.join("compiler-builtins/compiler-builtins/src/lib.rs");
        let external = format!("core={}", text(&core)?);
        let features = ["--cfg", "feature=\"compiler-builtins\"", "--cfg", "feature=\"mem\"", "--extern", &external];
        let name = ["--crate-name", "compiler_builtins", "-C", "codegen-units=1"];
        let all = [&common[..], &name, &features, &[text(&source)?]].concat();
        sh_in(folder, "/usr/bin/rustc", &all, &env)?;
    }
    println!("check: core for {TARGET} from rust-web-src {compiler}, the compiler's own version");
    Ok(sysroot)
}

pub(crate) fn build(sysroot: &Path, image: &Path, loops: &Path, features: &[&str]) -> Result<()> {
    let files = [("SAGNAC_IMAGE", image), ("SAGNAC_LOOPS", loops)];
    cargo_build(sysroot, "firmware/gyro", features, &files)
}

fn cargo_build(sysroot: &Path, package: &str, features: &[&str], files: &[(&str, &Path)]) -> Result<()> {
    let flags = format!("-C link-arg=-Tlink.x -C linker=arm-none-eabi-ld --sysroot {}", text(sysroot)?);
    let target = root().join("target/firmware/build");
    let args = ["build", "--release", "--locked", "--target", TARGET, "--target-dir", text(&target)?];
    let output = Command::new("cargo")
        .args(args)
        .args(features)
        .current_dir(root().join(package))
        .env("RUSTC", "/usr/bin/rustc")
        .env("RUSTFLAGS", &flags)
        .envs(files.iter().copied())
        .env("SAGNAC_KEY", root().join("target/firmware/unit.key"))
        .output()
        .context("cannot start cargo")?;
    ensure!(output.status.success(), "{package} does not build:\n{}", String::from_utf8_lossy(&output.stderr));
    Ok(())
}

/// Builds the board of the STM32F407 and looks where its parts lie: the vectors in sector 0 of the flash, the program from sector 4 on, and
/// nothing in the sectors of the banks and of the loops.
pub(super) fn stm32f407(sysroot: &Path) -> Result<()> {
    const SECTOR_1: u64 = 0x0800_4000;
    const SECTOR_4: u64 = 0x0801_0000;
    const END: u64 = 0x0810_0000;
    cargo_build(sysroot, "firmware/stm32f407", &[], &[])?;
    let program = root().join(format!("target/firmware/build/{TARGET}/release/sagnac-stm32f407"));
    let headers = stdout_of(60, "arm-none-eabi-readelf", &["--wide", "--program-headers", text(&program)?], &root())?;
    let mut stored = Vec::new();
    for line in headers.lines().filter(|line| line.trim_start().starts_with("LOAD")) {
        let hex = |column: usize| {
            let digits = line.split_whitespace().nth(column).and_then(|word| word.strip_prefix("0x"));
            u64::from_str_radix(digits.with_context(|| format!("no number in: {line}"))?, 16).context("a number")
        };
        // Physical address and size in the file.
        stored.push((hex(3)?, hex(4)?));
    }
    stored.retain(|(_, size)| *size > 0);
    for (from, size) in &stored {
        let to = from + size;
        let fits = to <= SECTOR_1 || (*from >= SECTOR_4 && to <= END);
        ensure!(fits, "STM32F407: {from:#x} to {to:#x} lies in the sectors of the banks, or beyond the flash");
    }
    ensure!(stored.iter().any(|(from, _)| *from >= SECTOR_4), "STM32F407: no program in {headers}");
    let size: u64 = stored.iter().map(|(_, size)| size).sum();
    println!(
        "check: the board of the STM32F407 links without a panic path: {} KB of flash next to its banks",
        size.div_ceil(1024)
    );
    Ok(())
}

/// A program that [`build`] made.
pub(crate) fn built(program: &str) -> PathBuf {
    root().join(format!("target/firmware/build/{TARGET}/release/{program}"))
}

/// Runs a program in the emulator, in a folder, and returns its output. The exit status is the program's own verdict.
pub(super) fn emulate(program: &str, args: &[&str], folder: &Path, seconds: u32) -> Result<String> {
    let path = built(program);
    let machine = ["-M", "mps2-an386", "-cpu", "cortex-m4", "-nographic", "-monitor", "none"];
    let hosting = ["-semihosting-config", "enable=on,target=native", "-kernel", text(&path)?];
    stdout_of(seconds, "qemu-system-arm", &[&machine[..], &hosting, args].concat(), folder)
}
