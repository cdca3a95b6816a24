//! The packages of this tree, as `cargo metadata` reads their manifests.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result};
use serde_json::Value;
use xtask::shell::{root, stdout_of, text};

/// A package of this tree.
pub(crate) struct Package {
    /// Relative to the tree.
    pub(crate) folder: String,
    /// Packages of the tree that it is built from.
    pub(crate) uses: BTreeSet<String>,
    /// Those that only its tests are built from.
    pub(crate) tests_use: BTreeSet<String>,
    pub(crate) is_member: bool,
}

/// The packages of a workspace, by `cargo metadata`, which needs no network for them.
pub(crate) fn packages(folder: &str, is_member: bool) -> Result<BTreeMap<String, Package>> {
    let manifest = root().join(folder).join("Cargo.toml");
    let args = ["metadata", "--no-deps", "--format-version", "1", "--manifest-path", text(&manifest)?];
    let told: Value = serde_json::from_str(&stdout_of(120, "cargo", &args, &root())?)?;
    let package = |package: &Value| -> Result<(String, Package)> {
        let name = package["name"].as_str().context("a package without a name")?;
        let manifest = Path::new(package["manifest_path"].as_str().context("a package without a manifest")?);
        let folder = manifest.parent().context("a manifest without a folder")?;
        let folder =
            text(folder.strip_prefix(root().canonicalize()?).or_else(|_| folder.strip_prefix(root()))?)?.to_owned();
        let (mut uses, mut tests_use) = (BTreeSet::new(), BTreeSet::new());
        for dependency in package["dependencies"].as_array().into_iter().flatten() {
            if dependency["path"].is_string() {
                let into = if dependency["kind"] == "dev" { &mut tests_use } else { &mut uses };
                into.extend(dependency["name"].as_str().map(str::to_owned));
            }
        }
        Ok((name.to_owned(), Package { folder, uses, tests_use, is_member }))
    };
    told["packages"].as_array().context("cargo metadata without packages")?.iter().map(package).collect()
}
