//! `cargo xtask features`: every crate with features compiles without any of them, and with each alone.

use std::fs;

use anyhow::{Context, Result, ensure};
use xtask::shell::{root, sh};

/// Checks them all. Defaults together are what everything else builds.
pub(crate) fn features() -> Result<()> {
    let mut checked = 0;
    for folder in ["crates"] {
        let entries = fs::read_dir(root().join(folder))?.map(|entry| Ok(entry?.path().join("Cargo.toml")));
        let mut manifests = entries.collect::<Result<Vec<_>>>()?;
        manifests.sort();
        for manifest in manifests {
            let text = fs::read_to_string(&manifest).with_context(|| format!("{}", manifest.display()))?;
            let (package, features) = features_of(&text).with_context(|| format!("{}", manifest.display()))?;
            checked += features.len();
            for feature in [""].into_iter().chain(features).filter(|_| has_features(&text)) {
                check(package, feature)?;
            }
        }
    }
    ensure!(checked > 0, "no crate has features: this checks nothing");
    println!("features: {checked} features, each alone and none of them");
    Ok(())
}

fn check(package: &str, feature: &str) -> Result<()> {
    let args = ["check", "--quiet", "--locked", "--package", package, "--no-default-features", "--features", feature];
    sh("cargo", &args).with_context(|| format!("{package} with `{feature}` alone"))
}
