//! Runs other programs; used by xtask and lab.

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

/// Runs a program in the workspace's folder and shows its output.
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

/// Runs a program with a time limit in seconds (by `timeout` of the coreutils); returns its output.
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

/// The same; returns the standard output. A failure is an error with both outputs.
pub fn stdout_of(seconds: u32, program: &str, args: &[&str], folder: &Path) -> Result<String> {
    let output = output(seconds, program, args, folder)?;
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    ensure!(output.status.success(), "{program} {}: {}\n{out}{err}", args.join(" "), output.status);
    Ok(out.into_owned())
}

/// A path as text, for a command line.
pub fn text(path: &Path) -> Result<&str> {
    path.to_str().with_context(|| format!("{} is not UTF-8", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_does_not_end_is_stopped_and_named() {
        let message = output(1, "sleep", &["60"], &root()).unwrap_err().to_string();
        assert_eq!(message, "sleep did not end within 1 s");
    }

    #[test]
    fn the_output_of_a_failing_program_is_in_the_error() {
        let error = stdout_of(9, "sh", &["-c", "echo out; echo err >&2; exit 3"], &root()).unwrap_err().to_string();
        assert!(error.contains("exit status: 3") && error.contains("out\nerr"), "{error}");
    }
}
