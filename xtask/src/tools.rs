//! Programs that come from Debian: installed if they are missing, which takes root.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use anyhow::{Context, Result, bail, ensure};

use crate::checks::sh;

/// A program and the package it is in.
type Tool = (&'static str, &'static str);

/// Makes sure that all of these are there.
pub(crate) fn need(tools: &[Tool]) -> Result<()> {
    let packages: Vec<&str> =
        tools.iter().filter(|(program, _)| !is_there(program)).map(|(_, package)| *package).collect();
    if packages.is_empty() {
        return Ok(());
    }
    println!("missing: {}", packages.join(", "));
    sh("apt-get", &["update", "-qq"])?;
    sh("apt-get", &[&["install", "-y", "-qq", "--no-install-recommends"], &packages[..]].concat())
}

/// A program by its name, or a file.
fn is_there(program: &str) -> bool {
    let paths = std::env::var_os("PATH").unwrap_or_default();
    Path::new(program).is_absolute() && Path::new(program).exists()
        || std::env::split_paths(&paths).any(|folder| folder.join(program).is_file())
}

/// Runs a program that ends by itself within so many seconds (`timeout` of the coreutils sees to that); what it said.
pub(crate) fn output(seconds: u32, program: &str, args: &[&str], folder: &Path) -> Result<Output> {
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
pub(crate) fn said(seconds: u32, program: &str, args: &[&str], folder: &Path) -> Result<String> {
    let output = output(seconds, program, args, folder)?;
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    ensure!(output.status.success(), "{program} {}: {}\n{out}{err}", args.join(" "), output.status);
    Ok(out.into_owned())
}

/// Where a file of the workspace is, as text.
pub(crate) fn text(path: &Path) -> Result<&str> {
    path.to_str().context("the workspace's path is not UTF-8")
}
