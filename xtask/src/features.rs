//! `cargo xtask features`: every crate that has features compiles without any of them, and with each single one.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use xtask::shell::{root, sh};

/// Checks every crate. All features together are built by everything else.
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

/// Name and features of a package, if it has any; `default` is not one.
fn with_features(manifest: &str) -> Option<(&str, Vec<&str>)> {
    let package = manifest.lines().find_map(|line| line.strip_prefix("name = "))?.trim_matches('"');
    let section = manifest.split("\n[features]\n").nth(1)?.split("\n[").next()?;
    let names = section.lines().filter_map(|line| line.split_once(" = ")).map(|(name, _)| name);
    let names: Vec<&str> = names.filter(|name| !name.starts_with('#') && *name != "default").collect();
    (!names.is_empty()).then_some((package, names))
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
    fn features_are_the_keys_of_their_section() {
        let manifest = "[package]\nname = \"a\"\n\n[features]\ndefault = [\"b\"]\n# Words = no key.\nb = [\"dep:x\"]\nc = []\n\n[dependencies]\nx = { version = \"1\" }\n";
        assert_eq!(with_features(manifest), Some(("a", vec!["b", "c"])));
        assert_eq!(with_features("[package]\nname = \"a\"\n\n[dependencies]\n"), None);
    }
}
