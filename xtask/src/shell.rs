//! Running other programs: the bottom of xtask and lab, which both stand on it.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use anyhow::{Context, Result, bail, ensure};

/// The workspace's folder.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new(".")).to_owned()
}

/// Where cargo puts what it builds.
pub fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), |folder| root().join(folder))
}

/// The program `name` as cargo built it; `debug` is the folder of the profile that tests and lab share.
pub fn built(profile: &str, name: &str) -> PathBuf {
    target().join(profile).join(name)
}

/// Runs a program in the workspace's folder and shows what it says.
pub fn sh(program: &str, args: &[&str]) -> Result<()> {
    sh_in(&root(), program, args, &[])
}

/// The same elsewhere, with variables of the environment.
pub fn sh_in(folder: &Path, program: &str, args: &[&str], env: &[(&str, &str)]) -> Result<()> {
    println!("$ {program} {}", args.join(" "));
    let status = Command::new(program).args(args).current_dir(folder).envs(env.iter().copied()).status();
    let status = status.with_context(|| format!("cannot start {program}"))?;
    ensure!(status.success(), "{program} {} failed ({status})", args.join(" "));
    Ok(())
}

/// Runs a program that must end within so many seconds (`timeout` of the coreutils sees to that); what it said.
pub fn output(seconds: u32, program: &str, args: &[&str], folder: &Path) -> Result<Output> {
    let limit = seconds.to_string();
    let output = Command::new("timeout")
        .args([&limit, program])
        .args(args)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("cannot start {program}"))?;
    if output.status.code() == Some(124) {
        bail!("{program} did not end within {seconds} s");
    }
    Ok(output)
}

/// The same; anything but success is an error with what it said.
pub fn said(seconds: u32, program: &str, args: &[&str], folder: &Path) -> Result<String> {
    let output = output(seconds, program, args, folder)?;
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    ensure!(output.status.success(), "{program} {}: {}\n{out}{err}", args.join(" "), output.status);
    Ok(out.into_owned())
}

/// A path as text, for a command line.
pub fn text(path: &Path) -> Result<&str> {
    path.to_str().with_context(|| format!("{} is not UTF-8", path.display()))
}

/// A program (or a file that must exist, where `*` is any one folder) and the Debian package that has it.
pub type Tool = (&'static str, &'static str);

/// Makes sure that all of these are there: root gets the missing ones installed, anyone else is told the command.
pub fn need(tools: &[Tool]) -> Result<()> {
    let packages = missing(tools);
    if packages.is_empty() {
        return Ok(());
    }
    let install = [&["install", "--yes", "--no-install-recommends"], &packages[..]].concat();
    if !is_root() {
        bail!("Debian packages are missing; as root: apt-get {}", install.join(" "));
    }
    sh_in(&root(), "apt-get", &["update", "-qq"], &[])?;
    sh_in(&root(), "apt-get", &[&["-qq"], &install[..]].concat(), &[("DEBIAN_FRONTEND", "noninteractive")])
}

/// The packages of those tools that are not there, each once.
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

fn is_root() -> bool {
    fs::metadata("/proc/self").is_ok_and(|process| process.uid() == 0)
}

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

    #[test]
    fn a_program_that_does_not_end_is_stopped_and_named() {
        let said = output(1, "sleep", &["60"], &root()).unwrap_err().to_string();
        assert_eq!(said, "sleep did not end within 1 s");
    }
}
