//! The parts of `cargo xtask ci`: a task, and what its inputs are derived from.

use xtask::debian::{self, Tool};

/// A part.
pub(crate) struct Part {
    /// Its name in `ci/passed.toml`.
    pub(crate) name: &'static str,
    /// The arguments of `cargo xtask`.
    pub(crate) task: &'static [&'static str],
    /// The source of that task, files or folders of `xtask` and `lab`: the packages and files that it names are inputs.
    pub(crate) sources: &'static [&'static str],
    /// Packages that it builds and the source does not name.
    pub(crate) packages: Packages,
    /// Debian packages.
    pub(crate) tools: &'static [&'static [Tool]],
    /// How it fills the machine.
    pub(crate) runs: Runs,
}

/// Packages of the workspace.
#[derive(Clone, Copy)]
pub(crate) enum Packages {
    /// These, with all that they are built from.
    Built(&'static [&'static str]),
    /// The same with what their tests are built from.
    Tested(&'static [&'static str]),
    /// All.
    Every,
}

/// How a part fills the machine.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Runs {
    /// It compiles, or has threads for all processors: one of these at a time.
    OnAll,
    /// Mostly on one processor, next to the others: simulators, emulators, programs of Python.
    OnOne,
    /// The same, in the folder of the part before it and after that has ended.
    AfterTheOneBefore,
}

use Packages::{Built, Every, Tested};
use Runs::{AfterTheOneBefore, OnAll, OnOne};

/// A part of the lab: its folder names what it reads.
const fn of_lab(
    name: &'static str,
    task: &'static [&'static str],
    sources: &'static [&'static str],
    tools: &'static [&'static [Tool]],
    runs: Runs,
) -> Part {
    Part { name, task, sources, packages: Built(&[]), tools, runs }
}

/// A part that a program of tests is.
const fn of_tests(name: &'static str, task: &'static [&'static str], tested: &'static [&'static str]) -> Part {
    Part { name, task, sources: &[], packages: Tested(tested), tools: &[], runs: OnAll }
}

/// In the order in which they are run. The longest of those on one processor come first.
pub(crate) const PARTS: [Part; 20] = [
    Part { name: "clippy", task: &["clippy"], sources: &["clippy.toml"], packages: Every, tools: &[], runs: OnAll },
    of_tests("studies of fit", &["studies", "fit"], &["sagnac"]),
    of_tests("studies of verify", &["studies", "verify"], &["sagnac"]),
    of_tests("studies of noise", &["studies", "noise"], &["sagnac-noise"]),
    Part { tools: &[debian::BROWSER], ..of_tests("browser", &["browser"], &["sagnac-cli"]) },
    Part {
        name: "features",
        task: &["features"],
        sources: &["xtask/src/features.rs"],
        packages: Built(&[]),
        tools: &[],
        runs: OnAll,
    },
    Part {
        name: "docs",
        task: &["docs", "--check"],
        sources: &["xtask/src/docs.rs"],
        packages: Every,
        tools: &[],
        runs: OnAll,
    },
    Part {
        name: "deny",
        task: &["deny"],
        sources: &["xtask/src/deny.rs"],
        packages: Built(&[]),
        tools: &[],
        runs: OnAll,
    },
    Part {
        name: "dist",
        task: &["dist", "--check"],
        sources: &["xtask/src/dist"],
        packages: Built(&["sagnac-cli"]),
        tools: &[debian::DIST],
        runs: OnAll,
    },
    of_lab("corpus", &["bless", "--check", "errors"], &["lab/src/makes/errors.rs"], &[debian::CORPUS], OnAll),
    of_lab("hunt", &["hunt", "--cases", HUNTED], &["lab/src/hunts"], &[debian::CORPUS], OnAll),
    Part {
        name: "fuzz",
        task: &["fuzz", "--smoke"],
        sources: &["xtask/src/fuzz.rs", "lab/src/corpus"],
        packages: Built(&["sagnac-fuzz"]),
        tools: &[],
        runs: OnAll,
    },
    Part {
        name: "fleet",
        task: &["fleet"],
        sources: &["xtask/src/fleet.rs"],
        packages: Built(&[]),
        tools: &[debian::PLACE],
        runs: OnOne,
    },
    of_lab("fpga", &["fpga"], &["lab/src/targets/fpga"], &[debian::FPGA], OnOne),
    of_lab("firmware", &["firmware"], &["lab/src/targets/firmware"], &[debian::FIRMWARE], OnOne),
    of_lab("closed-loop", &["closed-loop"], &["lab/src/targets/closed_loop"], &[debian::FIRMWARE], AfterTheOneBefore),
    of_lab("c", &["c"], &["lab/src/targets/c"], &[debian::C], OnOne),
    Part {
        name: "wheel",
        task: &["wheel"],
        sources: &["xtask/src/wheel.rs"],
        packages: Built(&["sagnac-cli"]),
        tools: &[debian::WHEEL],
        runs: OnOne,
    },
    of_lab("conserve", &["conserve"], &["lab/src/targets/conserve.rs"], &[], OnOne),
    of_lab("formats", &["formats"], &["lab/src/measures/formats"], &[debian::FORMATS], OnOne),
];

/// Cases of the hunt: so many are the same on every machine, so many minutes are not.
const HUNTED: &str = "6000";
