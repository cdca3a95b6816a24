//! The inputs of a part, derived from its source.
//!
//! ```text
//! source ─┬─ crate::, super::, mod  further sources of the same crate; not what stands next to it in a folder above
//!         ├─ sagnac_core::         packages, each with all that it is built from (`cargo metadata`)
//!         ├─ "firmware/c"          files and folders of the tree; one with a Cargo.toml brings its packages too
//!         └─ places::VECTORS       the same, by the value of that constant
//! packages, files, Cargo.lock, the compiler ─▶ git hash-object ─▶ one hash
//! ```
//!
//! A name that is put together at run time is not seen: write the whole path.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Write as _;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use xtask::shell::{root, stdout_of, text};

use super::parts::{Packages, Part};
use crate::source::modules::{Module, modules, used};
use crate::source::packages::{self, Package};
use crate::source::paths::{code, paths};

/// The sources of the lab.
const LAB: &str = "lab/src";
/// The constants of the lab's paths.
const PLACES: &str = "lab/src/places.rs";
/// Every part depends on it, and on the compiler.
const ALWAYS: &str = "Cargo.lock";

/// The tree as git knows it: committed, changed and new files, none that it ignores.
pub(crate) struct Tree {
    files: BTreeSet<String>,
    packages: BTreeMap<String, Package>,
    /// The modules of the lab, whose sources follow each other.
    lab: Vec<Module>,
    compiler: String,
}

impl Tree {
    pub(crate) fn read() -> Result<Self> {
        let listed = ["ls-files", "--cached", "--others", "--exclude-standard", "-z"];
        let listed = stdout_of(60, "git", &listed, &root()).context("inputs are derived from a checkout of git")?;
        let is_there = |path: &&str| root().join(path).is_file();
        let files: BTreeSet<String> = listed.split_terminator('\0').filter(is_there).map(str::to_owned).collect();
        let mut packages = packages::packages(".", true)?;
        for manifest in files.iter().filter(|path| path.ends_with("/Cargo.toml")) {
            let folder = manifest.trim_end_matches("/Cargo.toml");
            if packages.values().all(|package| package.folder != folder) {
                packages.extend(packages::packages(folder, false)?);
            }
        }
        let compiler = stdout_of(60, "rustc", &["--version"], &root())?;
        Ok(Self { files, packages, lab: modules(&root().join(LAB))?, compiler })
    }

    /// The files that a part depends on.
    pub(crate) fn inputs(&self, part: &Part) -> Result<BTreeSet<String>> {
        let (mut packages, with_tests) = match part.packages {
            Packages::Built(names) => (owned(names), false),
            Packages::Tested(names) => (owned(names), true),
            Packages::Every => {
                let members = self.packages.iter().filter(|(_, package)| package.is_member);
                (members.map(|(name, _)| name.clone()).collect(), true)
            }
        };
        let mut files = BTreeSet::from([ALWAYS.to_owned()]);
        let mut sources: Vec<String> = part.sources.iter().flat_map(|path| self.below(path)).collect();
        ensure!(part.sources.is_empty() || !sources.is_empty(), "part {}: no file of {:?}", part.name, part.sources);
        let mut read = BTreeSet::new();
        while let Some(source) = sources.pop() {
            if !read.insert(source.clone()) {
                continue;
            }
            // Of the paths in that file a part reads those that it names.
            if source.ends_with(".rs") && source != PLACES {
                let code = code(&fs::read_to_string(root().join(&source))?);
                let named = self.named(&source, &code, part)?;
                packages.extend(named.packages);
                files.extend(named.files);
                sources.extend(named.sources);
            }
            files.insert(source);
        }
        let is_every = matches!(part.packages, Packages::Every);
        let tested = if with_tests { packages.clone() } else { BTreeSet::new() };
        for package in self.closure(packages, with_tests)? {
            let folder = &self.packages[&package].folder;
            let mut of_package = self.of_package(folder, is_every)?;
            if !tested.contains(&package) {
                of_package.retain(|file| !is_of_tests(file, folder));
            }
            files.extend(of_package);
        }
        Ok(files)
    }

    /// The files of a package. Others are built from its library alone where it also has a program, as xtask does.
    fn of_package(&self, folder: &str, whole: bool) -> Result<Vec<String>> {
        let (mut files, library) = (self.below(folder), format!("{folder}/src/lib.rs"));
        if whole || !self.files.contains(&library) || !self.files.contains(&format!("{folder}/src/main.rs")) {
            return Ok(files);
        }
        let declared = code(&fs::read_to_string(root().join(&library))?);
        let modules: Vec<&str> = declared.lines().filter_map(module_of).chain(["lib"]).collect();
        let source = format!("{folder}/src/");
        files.retain(|file| {
            let name = file.strip_prefix(&source).and_then(|below| below.split(['/', '.']).next());
            name.is_none_or(|name| modules.contains(&name))
        });
        Ok(files)
    }

    /// A package with all that it is built from. Of several, the tests of the first alone count.
    fn closure(&self, first: BTreeSet<String>, with_tests: bool) -> Result<BTreeSet<String>> {
        let mut open: Vec<String> = first.iter().cloned().collect();
        let mut closed = BTreeSet::new();
        while let Some(name) = open.pop() {
            let package = self.packages.get(&name).with_context(|| format!("no package {name} in this tree"))?;
            open.extend(package.uses.iter().filter(|used| !closed.contains(*used)).cloned());
            if with_tests && first.contains(&name) {
                open.extend(package.tests_use.iter().filter(|used| !closed.contains(*used)).cloned());
            }
            closed.insert(name);
        }
        Ok(closed)
    }

    /// A file, or all of a folder.
    fn below(&self, path: &str) -> Vec<String> {
        if self.files.contains(path) {
            return vec![path.to_owned()];
        }
        let folder = format!("{path}/");
        self.files.range(folder.clone()..).take_while(|file| file.starts_with(&folder)).cloned().collect()
    }

    /// The packages, files and sources that a source names.
    fn named(&self, source: &str, code: &str, part: &Part) -> Result<Named> {
        let mut named = Named::default();
        for name in self.packages.keys() {
            let path = format!("{}::", name.replace('-', "_"));
            let is_word = |at: usize| !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':');
            if code.match_indices(&path).any(|(at, _)| is_word(at)) {
                named.packages.insert(name.clone());
            }
        }
        let places = match code.contains("places::") {
            true => constants(&fs::read_to_string(root().join(PLACES))?, code),
            false => Vec::new(),
        };
        let quoted = code.split('"').skip(1).step_by(2).map(str::to_owned).chain(places);
        for literal in quoted.filter(|literal| literal.len() > 2) {
            if self.packages.contains_key(&literal) && literal.contains('-') {
                named.packages.insert(literal);
                continue;
            }
            let mut below = self.below(literal.trim_start_matches("../"));
            let manifests = below.iter().filter_map(|file| file.strip_suffix("/Cargo.toml"));
            let folders: Vec<String> = manifests.map(str::to_owned).collect();
            let of_folder = self.packages.iter().filter(|(_, package)| folders.contains(&package.folder));
            for (name, package) in of_folder {
                named.packages.insert(name.clone());
                below.retain(|file| package.folder == literal || !is_of_tests(file, &package.folder));
            }
            named.files.extend(below);
        }
        // The tasks of xtask start processes, and name what these read; they call each other's helpers.
        if !source.starts_with("xtask/") {
            named.sources = self.followed(source)?;
            let folder = source.strip_suffix("/mod.rs").unwrap_or(source.trim_end_matches(".rs"));
            if part.sources.iter().all(|path| !path.starts_with(&format!("{folder}/"))) {
                let children = code.lines().filter_map(module_of);
                let files =
                    children.flat_map(|name| [format!("{folder}/{name}.rs"), format!("{folder}/{name}/mod.rs")]);
                named.sources.extend(files.filter(|file| self.files.contains(file)));
            }
        }
        Ok(named)
    }

    /// The files that define what a source of the lab names.
    fn followed(&self, source: &str) -> Result<Vec<String>> {
        let Some(module) = self.lab.iter().find(|module| module.file == root().join(source)) else {
            return Ok(Vec::new());
        };
        let file = |module: &Module| Ok(text(module.file.strip_prefix(root())?)?.to_owned());
        used(&self.lab, module).into_iter().map(file).collect()
    }

    /// One hash of these files as they are, and of the compiler.
    pub(crate) fn hash(&self, files: &BTreeSet<String>) -> Result<String> {
        let listed: String = files.iter().map(|file| format!("{file}\n")).collect();
        let hashes = git_hash(&["--stdin-paths"], &listed)?;
        ensure!(hashes.lines().count() == files.len(), "git has hashed {} of {}", hashes.lines().count(), files.len());
        let pairs = files.iter().zip(hashes.lines()).map(|(file, hash)| format!("{file} {hash}\n"));
        Ok(git_hash(&["--stdin"], &(self.compiler.clone() + &pairs.collect::<String>()))?.trim().to_owned())
    }
}

/// Names in a source.
#[derive(Default)]
struct Named {
    packages: BTreeSet<String>,
    files: BTreeSet<String>,
    sources: Vec<String>,
}

fn owned(names: &[&str]) -> BTreeSet<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

fn git_hash(flags: &[&str], input: &str) -> Result<String> {
    let mut git = Command::new("git");
    git.args(["hash-object", "--no-filters"]).args(flags).current_dir(root());
    let mut git = git.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().context("cannot start git")?;
    let mut stdin = git.stdin.take().context("git takes no input")?;
    // git answers while it reads: a thread writes, so that neither waits for the other.
    let output = std::thread::scope(|scope| {
        scope.spawn(move || stdin.write_all(input.as_bytes()));
        git.wait_with_output()
    })?;
    ensure!(output.status.success(), "git hash-object failed ({})", output.status);
    String::from_utf8(output.stdout).context("git hash-object")
}

/// True for the tests, examples and benchmarks of a package, which nothing is built from.
fn is_of_tests(file: &str, folder: &str) -> bool {
    let below = file.strip_prefix(folder).and_then(|below| below.strip_prefix('/'));
    below.is_some_and(|below| ["tests/", "examples/", "benches/"].iter().any(|tests| below.starts_with(tests)))
}

/// The module that a line declares.
fn module_of(line: &str) -> Option<&str> {
    Some(line.strip_suffix(';')?.rsplit_once("mod ")?.1)
}

/// Values of the constants of [`PLACES`] that a text names: `places::VECTORS`, or by the function of that name, `places::vectors()`.
fn constants(source: &str, named_in: &str) -> Vec<String> {
    let declared = source.lines().filter_map(|line| line.strip_prefix("pub(crate) const ")?.split_once(": &str = \""));
    let imported = paths(named_in).into_iter().filter(|path| path.len() > 2 && path[1] == "places");
    let mut names: BTreeSet<String> = imported.map(|path| path[2].to_uppercase()).collect();
    let behind = named_in.split("places::").skip(1);
    names.extend(
        behind.map(|rest| {
            rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>().to_uppercase()
        }),
    );
    declared
        .filter(|(name, _)| names.contains(*name))
        .map(|(_, value)| value.trim_end_matches("\";").to_owned())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::parts::PARTS;
    use super::*;

    #[test]
    fn constants_are_those_that_are_named() {
        let declared = "pub(crate) const A: &str = \"a/b\";\npub(crate) const AB: &str = \"c\";";
        assert_eq!(constants(declared, "use crate::places::{A, X};\nb::AB"), ["a/b"]);
        assert_eq!(constants(declared, "places::ab()"), ["c"]);
    }

    /// What a change can break: every part, by a file of each kind that it reads.
    #[test]
    fn each_part_comes_due_when_its_inputs_change() {
        let tree = Tree::read().unwrap();
        let reads: [(&str, &[&str]); 20] = [
            ("clippy", &["crates/sagnac/src/lib.rs", "lab/src/main.rs", "fuzz/Cargo.toml", "clippy.toml"]),
            (
                "studies of fit",
                &["crates/sagnac/src/fit/mod.rs", "crates/sagnac/tests/studies.rs", "crates/sagnac-sim/src/lib.rs"],
            ),
            ("studies of verify", &["crates/sagnac/src/verify/mod.rs", "crates/sagnac-core/src/lib.rs"]),
            ("studies of noise", &["crates/sagnac-noise/src/lib.rs", "crates/sagnac-noise/tests/studies.rs"]),
            ("browser", &["crates/sagnac-report/src/page.rs", "crates/sagnac-cli/tests/browser/report.rs"]),
            ("features", &["crates/sagnac-log/Cargo.toml", "crates/sagnac/src/lib.rs"]),
            ("docs", &["docs/SUMMARY.md", "site/src/main.rs", "crates/sagnac-core/src/lib.rs"]),
            ("deny", &["deny.toml", "Cargo.lock", "Cargo.toml"]),
            ("dist", &["xtask/src/dist/pack.rs", "crates/sagnac-cli/src/main.rs", "crates/sagnac/src/lib.rs"]),
            ("corpus", &["lab/src/corpus/crafted.rs", "docs/reference/errors.md", "crates/sagnac-cli/src/main.rs"]),
            ("hunt", &["lab/src/hunts/logs.rs", "crates/sagnac-log/src/lib.rs"]),
            ("fuzz", &["fuzz/fuzz_targets/image.rs", "fuzz/counted.sh", "crates/sagnac-bench/src/lib.rs"]),
            ("fleet", &["fleet/src/store.rs", "fleet/Cargo.lock", "crates/sagnac/src/lib.rs"]),
            ("fpga", &["ports/verilog/sagnac_fast.v", "testdata/vectors/watch.hex", "crates/sagnac-core/src/lib.rs"]),
            (
                "firmware",
                &["firmware/gyro/src/lib.rs", "lab/src/targets/firmware/build.rs", "crates/sagnac-board/src/lib.rs"],
            ),
            (
                "closed-loop",
                &["firmware/gyro/closed-loop", "firmware/gyro/src/lib.rs", "crates/sagnac-cli/src/main.rs"],
            ),
            ("c", &["ports/c/sagnac_board.c", "firmware/c/check_line.c", "crates/sagnac-signature/src/lib.rs"]),
            ("wheel", &["python/src/calibration.rs", "python/requirements.txt", "crates/sagnac-cli/src/main.rs"]),
            ("conserve", &["lab/src/targets/conserve.rs", "crates/sagnac-core/src/lib.rs"]),
            ("formats", &["lab/src/measures/formats/make.py", "crates/sagnac-cli/src/main.rs"]),
        ];
        for (part, (name, wanted)) in PARTS.iter().zip(reads) {
            assert_eq!(part.name, name);
            let inputs = tree.inputs(part).unwrap();
            let before = tree.hash(&inputs).unwrap();
            for path in wanted {
                let changed = tree.below(path).into_iter().next().unwrap_or_default();
                assert!(inputs.contains(&changed), "{name} does not depend on {path}");
                // The tree without it: as after any change of the file.
                let without = inputs.iter().filter(|file| **file != changed).cloned().collect();
                assert_ne!(tree.hash(&without).unwrap(), before, "{name}, {path}");
            }
            assert!(!inputs.contains("ci/passed.toml"), "{name} depends on what CI writes");
        }
    }

    /// The hunt runs the program, which no test is built into; a study is a test of one crate alone.
    #[test]
    fn tests_are_inputs_of_the_parts_that_run_them() {
        let tree = Tree::read().unwrap();
        let of_tests = |name: &str| -> BTreeSet<String> {
            let part = PARTS.iter().find(|part| part.name == name).unwrap();
            let folders = tree.packages.values().map(|package| package.folder.as_str());
            let inputs = tree.inputs(part).unwrap();
            folders.filter(|folder| inputs.iter().any(|file| is_of_tests(file, folder))).map(str::to_owned).collect()
        };
        for name in ["hunt", "dist", "features", "firmware", "fpga", "conserve"] {
            assert!(of_tests(name).is_empty(), "{name} depends on tests in {:?}", of_tests(name));
        }
        assert_eq!(of_tests("studies of fit"), owned(&["crates/sagnac"]));
        assert_eq!(of_tests("wheel"), owned(&["python"]));
        // The flash that fails is a file of the core's tests.
        assert_eq!(of_tests("c"), owned(&["crates/sagnac-core"]));
    }

    #[test]
    fn a_change_of_the_fit_leaves_the_target_alone() {
        let tree = Tree::read().unwrap();
        // `c` and `fpga` search faults in images with the limits of the export, which is in the crate of the fit.
        for name in ["conserve", "deny", "studies of noise"] {
            let part = PARTS.iter().find(|part| part.name == name).unwrap();
            let inputs = tree.inputs(part).unwrap();
            let of_fit: Vec<&String> = inputs.iter().filter(|file| file.starts_with("crates/sagnac/src/")).collect();
            assert!(
                inputs.iter().all(|file| !file.starts_with("docs/")),
                "{name} depends on {:?}",
                inputs.iter().find(|file| file.starts_with("docs/"))
            );
            assert!(inputs.iter().all(|file| !file.starts_with("xtask/src/ci")), "{name} depends on this program");
            assert!(of_fit.is_empty(), "{name} depends on {} files of sagnac, {}", of_fit.len(), of_fit[0]);
        }
    }
}
