//! Tools that cargo installs if they are missing.

use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use xtask::shell::{root, sh_in};

/// A tool: the command that prints its version, and the one that installs it.
struct CargoTool {
    name: &'static str,
    version: &'static [&'static str],
    install: &'static [&'static str],
    /// Start of the required version; any other version is refused.
    wanted: &'static str,
}

const TOOLS: [CargoTool; 3] = [
    CargoTool {
        name: "deny",
        version: &["cargo", "deny", "--version"],
        install: &["cargo-deny"],
        wanted: "cargo-deny ",
    },
    CargoTool {
        name: "fuzz",
        version: &["cargo", "fuzz", "--version"],
        install: &["cargo-fuzz"],
        wanted: "cargo-fuzz ",
    },
    CargoTool {
        name: "mdbook",
        version: &["mdbook", "--version"],
        // Without the parts that use the network or serve pages.
        install: &["mdbook", "--version", "0.5.4", "--no-default-features", "--features", "search"],
        wanted: "mdbook v0.5.",
    },
];

/// Installs a tool if it is missing, without optimisation and checks: the build takes a quarter of the time, and each tool
/// runs for a second only.
pub(crate) fn need_cargo_tool(name: &str) -> Result<()> {
    let Some(tool) = TOOLS.iter().find(|tool| tool.name == name) else { bail!("no such tool: {name}") };
    let install = [&["install", "--locked"], tool.install].concat();
    let Some(version) = version(tool) else {
        let quick = [
            ("CARGO_PROFILE_DEV_DEBUG", "false"),
            ("CARGO_PROFILE_DEV_DEBUG_ASSERTIONS", "false"),
            ("CARGO_PROFILE_DEV_OVERFLOW_CHECKS", "false"),
            ("CARGO_INCREMENTAL", "0"),
        ];
        return sh_in(&root(), "cargo", &[&install[..], &["--debug"]].concat(), &quick)
            .with_context(|| format!("{name} is missing and cannot be installed"));
    };
    ensure!(version.starts_with(tool.wanted), "found {version}, wanted {}*: cargo {}", tool.wanted, install.join(" "));
    Ok(())
}

fn version(tool: &CargoTool) -> Option<String> {
    let (program, args) = tool.version.split_first()?;
    let output = Command::new(program).args(args).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
