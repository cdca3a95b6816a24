//! `cargo xtask features`: every crate that has features compiles without any of them, and with each single one.
//!
//! A single feature that is the default is what everything else builds, and is not compiled once more for that.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use xtask::shell::{root, sh};

/// Checks every crate. Its default, mostly all features together, is built by everything else.
pub(crate) fn features() -> Result<()> {
    let mut checked = 0;
    for manifest in manifests()? {
        let text = fs::read_to_string(&manifest).with_context(|| format!("{}", manifest.display()))?;
        let Some((package, features)) = with_features(&text) else { continue };
        check(package, "")?;
        for feature in &features {
            check(package, feature)?;
        }
        checked += features.len();
    }
    ensure!(checked > 0, "no crate with features was found");
    println!("features: each of {checked} by itself, and each crate without any");
    Ok(())
}

fn manifests() -> Result<Vec<PathBuf>> {
    let folders = fs::read_dir(root().join("crates"))?;
    let mut manifests = folders.map(|entry| Ok(entry?.path().join("Cargo.toml"))).collect::<Result<Vec<_>>>()?;
    manifests.sort();
    Ok(manifests)
}

/// Name of a package and its features, if it has any, without `default` and the one that is all of it.
fn with_features(manifest: &str) -> Option<(&str, Vec<&str>)> {
    let package = manifest.lines().find_map(|line| line.strip_prefix("name = "))?.trim_matches('"');
    let section = manifest.split("\n[features]\n").nth(1)?.split("\n[").next()?;
    let features =
        || section.lines().filter_map(|line| line.split_once(" = ")).filter(|(name, _)| !name.starts_with('#'));
    let default = features().find(|(name, _)| *name == "default").map(|(_, of)| of.trim_matches(['[', ']', '"']));
    let names = features().map(|(name, _)| name).filter(|name| *name != "default" && Some(*name) != default);
    Some((package, names.collect()))
}

fn check(package: &str, feature: &str) -> Result<()> {
    let args = ["check", "--quiet", "--locked", "--package", package, "--no-default-features", "--features", feature];
    let what = if feature.is_empty() { "without features".to_owned() } else { format!("with only `{feature}`") };
    sh("cargo", &args).with_context(|| format!("{package} {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_are_the_keys_of_their_section_but_the_default_alone() {
        let manifest = "[package]\nname = \"a\"\n\n[features]\ndefault = [\"b\"]\n# Words = no key.\nb = [\"dep:x\"]\nc = []\n\n[dependencies]\nx = { version = \"1\" }\n";
        assert_eq!(with_features(manifest), Some(("a", vec!["c"])));
        let both = manifest.replace("[\"b\"]", "[\"b\", \"c\"]");
        assert_eq!(with_features(&both), Some(("a", vec!["b", "c"])));
        assert_eq!(with_features("[package]\nname = \"a\"\n\n[dependencies]\n"), None);
    }
}
