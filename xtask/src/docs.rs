//! `cargo xtask docs`: the book of `docs/` with its equations, and rustdoc, as a site that needs no network.

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use xtask::shell::{root, sh, sh_in};

use crate::cargo_tools::need_cargo_tool;

/// Builds `target/site` and prints the findings in it; with `strict` any finding is an error.
pub(crate) fn docs(strict: bool) -> Result<()> {
    need_cargo_tool("mdbook")?;
    rustdoc()?;
    sh("cargo", &["build", "--quiet", "--locked", "--package", "sagnac-site"])?;
    book(strict)?;
    let site = root().join("target/site");
    // mdBook copies every file next to the pages.
    fs::remove_file(site.join("book.toml")).context("mdBook's output is not in target/site")?;
    copy(&root().join("target/doc"), &site.join("api"))?;
    let check = ["run", "--quiet", "--locked", "--package", "sagnac-site", "--", "check", "docs", "target/site"];
    match sh("cargo", &check) {
        Ok(()) => println!("docs: every link and anchor has its target, nothing is loaded from the network"),
        Err(error) if strict => return Err(error.context("the site has the findings above")),
        Err(_) => println!("docs: the site has the findings above; `cargo xtask docs --check` fails on them"),
    }
    println!("docs: target/site/index.html");
    Ok(())
}

/// The pages of `docs/`. With `strict` a warning of mdBook is an error: the page would show something unintended.
fn book(strict: bool) -> Result<()> {
    println!("$ mdbook build docs");
    let output =
        Command::new("mdbook").args(["build", "docs"]).current_dir(root()).output().context("cannot start mdbook")?;
    let findings = [output.stdout, output.stderr].concat();
    let findings = String::from_utf8_lossy(&findings);
    print!("{findings}");
    ensure!(output.status.success(), "mdbook build docs failed ({})", output.status);
    ensure!(!strict || !findings.contains("WARN"), "mdbook has a warning about a page: see above");
    Ok(())
}

/// The library's own pages; a broken link in them is an error.
fn rustdoc() -> Result<()> {
    let args = ["doc", "--workspace", "--no-deps", "--document-private-items", "--locked"];
    sh_in(&root(), "cargo", &args, &[("RUSTDOCFLAGS", "-D warnings")])
}

/// A folder with all that is in it.
fn copy(from: &Path, to: &Path) -> Result<()> {
    if !from.is_dir() {
        bail!("{} is no folder", from.display());
    }
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), &target).with_context(|| format!("cannot write {}", target.display()))?;
        }
    }
    Ok(())
}
