//! Checks archive and package: packed again to the same bytes, unpacked, installed, run.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use xtask::debian::is_root;
use xtask::shell::{root, sh_in, stdout_of, text};

use super::pack::{Packed, pack};
use super::{Release, binary, empty};

/// Makes all checks in a folder of their own.
pub(super) fn check(release: &Release, packed: &Packed, folder: &Path) -> Result<()> {
    empty(folder)?;
    same_bytes(release, packed, &folder.join("again"))?;
    unpacked(release, packed, &folder.join("archive"))?;
    installed(release, packed, &folder.join("system"))
}

/// Packs again in another folder; every byte must be the same.
fn same_bytes(release: &Release, packed: &Packed, folder: &Path) -> Result<()> {
    let again = pack(release, folder)?;
    for (first, second) in [(&packed.archive, &again.archive), (&packed.deb, &again.deb)] {
        ensure!(fs::read(first)? == fs::read(second)?, "{} and {} differ", first.display(), second.display());
    }
    println!("check: archive and package: packed twice, the same bytes");
    Ok(())
}

fn unpacked(release: &Release, packed: &Packed, folder: &Path) -> Result<()> {
    empty(folder)?;
    sh_in(folder, "tar", &["--extract", "--file", text(&packed.archive)?], &[])?;
    let inside = folder.join(format!("sagnac-{}-x86_64-linux", release.version));
    for name in ["README.md", "LICENSE-MIT", "LICENSE-APACHE", "THIRD-PARTY.txt", "completions/sagnac.fish"] {
        ensure!(fs::metadata(inside.join(name)).is_ok_and(|file| file.len() > 500), "the archive has no {name}");
    }
    manual(&fs::read_to_string(inside.join("man/man1/sagnac-calibrate.1"))?)?;
    completes(&inside.join("completions/sagnac.bash"))?;
    runs(release, &inside.join("sagnac"), &folder.join("work"))?;
    println!("check: archive: unpacked, run");
    Ok(())
}

/// As root, dpkg installs the package into an empty system; for other users dpkg-deb unpacks it.
fn installed(release: &Release, packed: &Packed, system: &Path) -> Result<()> {
    empty(system)?;
    let depends = stdout_of(60, "dpkg-deb", &["--field", text(&packed.deb)?, "Depends"], &root())?;
    ensure!(depends.trim() == binary::needs(&release.program)?.depends(), "Depends: {depends}");
    let how = if is_root() {
        install(packed, system)?;
        "installed by dpkg"
    } else {
        sh_in(&root(), "dpkg-deb", &["--extract", text(&packed.deb)?, text(system)?], &[])?;
        "unpacked by dpkg-deb (installing takes root)"
    };
    let share = system.join("usr/share");
    manual(&stdout_of(60, "gzip", &["-dc", text(&share.join("man/man1/sagnac-calibrate.1.gz"))?], &root())?)?;
    completes(&share.join("bash-completion/completions/sagnac"))?;
    for name in ["zsh/vendor-completions/_sagnac", "fish/vendor_completions.d/sagnac.fish", "doc/sagnac/copyright"] {
        ensure!(share.join(name).is_file(), "the package has no usr/share/{name}");
    }
    runs(release, &system.join("usr/bin/sagnac"), &system.join("work"))?;
    println!("check: package: {how}, run; Depends: {}", depends.trim());
    Ok(())
}

/// Into an empty system, where only the packages that it depends on are missing.
fn install(packed: &Packed, system: &Path) -> Result<()> {
    let state = system.join("var/lib/dpkg");
    for folder in ["info", "updates", "triggers"] {
        fs::create_dir_all(state.join(folder))?;
    }
    fs::write(state.join("status"), "")?;
    let root_flag = format!("--root={}", text(system)?);
    sh_in(&root(), "dpkg", &[&root_flag, "--force-depends", "--install", text(&packed.deb)?], &[])?;
    let admin = format!("--admindir={}", text(&state)?);
    let stdout = stdout_of(60, "dpkg-query", &[&admin, "--show", "--showformat=${Status}", "sagnac"], &root())?;
    ensure!(stdout == "install ok installed", "after dpkg --install: {stdout}");
    Ok(())
}

fn manual(page: &str) -> Result<()> {
    ensure!(page.contains(".TH sagnac-calibrate 1"), "not the manual of sagnac calibrate:\n{page}");
    Ok(())
}

/// A bash that reads the file then completes a command and a flag of it.
fn completes(file: &Path) -> Result<()> {
    let asked = "source \"$0\"; complete -p sagnac >&2; \
                 ask() { COMP_WORDS=(sagnac \"$@\"); COMP_CWORD=$#; COMPREPLY=(); _sagnac sagnac \"${!#}\" sagnac; echo \"${COMPREPLY[@]}\"; }; \
                 ask calib; ask verify --lim";
    let stdout = stdout_of(60, "bash", &["-c", asked, text(file)?], &root())?;
    ensure!(
        stdout == "calibrate\n--limits\n",
        "completions of `sagnac calib` and `sagnac verify --lim` are {stdout:?}"
    );
    Ok(())
}

/// The main job on the log in testdata/, in a folder of its own.
fn runs(release: &Release, program: &Path, work: &Path) -> Result<()> {
    empty(work)?;
    let data = |name: &str| root().join("testdata/chamber").join(name);
    let sagnac = |args: &[&str]| stdout_of(300, text(program)?, args, work);
    let version = sagnac(&["--version"])?;
    ensure!(version.trim() == format!("sagnac {}", release.version), "--version prints {version}");
    let logs = ["cycle-1", "cycle-2", "retest"].map(|name| data(&format!("{name}.csv.gz")));
    let (setup, limits) = (data("bench.toml"), data("limits.toml"));
    let (first, second, retest) = (text(&logs[0])?, text(&logs[1])?, text(&logs[2])?);
    let calibrated = sagnac(&["calibrate", first, second, "--setup", text(&setup)?, "-o", "unit.cal.json"])?;
    ensure!(calibrated.contains("cubic + dT/dt"), "calibrate prints\n{calibrated}");
    let verified = sagnac(&["verify", "unit.cal.json", retest, "--limits", text(&limits)?, "--report", "unit.html"])?;
    ensure!(verified.contains("ACCEPTED - 3 limits met"), "verify prints\n{verified}");
    let report = fs::read_to_string(work.join("unit.html")).context("verify wrote no report")?;
    ensure!(report.contains("</html>"), "the report has no end");
    // The feature for Parquet is compiled in: a table is written and read again.
    sagnac(&["inspect", first, "--setup", text(&setup)?, "--windows", "w.parquet"])?;
    let inspected = sagnac(&["inspect", "w.parquet"])?;
    ensure!(inspected.contains("windows of a log"), "inspect of a table of windows prints\n{inspected}");
    Ok(())
}
