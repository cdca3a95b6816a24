//! The files of archive and package, made once, with the place of each in both.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use xtask::shell::{root, stdout_of, text};

use super::{Release, empty, licences};

/// A file and its place.
pub(super) struct File {
    pub(super) from: PathBuf,
    /// In the archive, below its folder.
    pub(super) in_archive: String,
    /// In the package, below the root.
    pub(super) in_deb: String,
    /// Debian has manuals and changelogs compressed.
    pub(super) compressed: bool,
}

/// Makes the generated files in an empty folder.
pub(super) fn files(release: &Release, folder: &Path) -> Result<Vec<File>> {
    empty(folder)?;
    let mut files = vec![plain(release.program.clone(), "sagnac", "usr/bin/sagnac")];
    files.extend(manuals(release, folder)?);
    files.extend(completions(release, folder)?);
    let licences = folder.join("THIRD-PARTY.txt");
    fs::write(&licences, licences::third_parties()?)?;
    let copyright = folder.join("copyright");
    fs::write(&copyright, copyright_text()?)?;
    for name in ["README.md", "LICENSE-MIT", "LICENSE-APACHE", "CHANGELOG.md"] {
        files.push(document(root().join(name), name));
    }
    files.push(document(licences, "THIRD-PARTY.txt"));
    files.push(document(copyright, "copyright"));
    Ok(files)
}

fn plain(from: PathBuf, in_archive: &str, in_deb: &str) -> File {
    File { from, in_archive: in_archive.to_owned(), in_deb: in_deb.to_owned(), compressed: false }
}

fn document(from: PathBuf, name: &str) -> File {
    let compressed = name == "CHANGELOG.md";
    let debian = if compressed { "changelog" } else { name };
    File { compressed, ..plain(from, name, &format!("usr/share/doc/sagnac/{debian}")) }
}

/// A page for the program and one for each command, by the program itself.
fn manuals(release: &Release, folder: &Path) -> Result<Vec<File>> {
    let pages = folder.join("man");
    stdout_of(60, text(&release.program)?, &["manual", "man", "--output", text(&pages)?], &root())?;
    let mut files = Vec::new();
    for entry in fs::read_dir(&pages)? {
        let path = entry?.path();
        let name = path.file_name().and_then(|name| name.to_str()).context("a page without a name")?.to_owned();
        let (in_archive, in_deb) = (format!("man/man1/{name}"), format!("usr/share/man/man1/{name}"));
        files.push(File { compressed: true, ..plain(path, &in_archive, &in_deb) });
    }
    files.sort_by(|a, b| a.in_deb.cmp(&b.in_deb));
    ensure!(files.len() > 5, "only {} pages of manual", files.len());
    Ok(files)
}

fn completions(release: &Release, folder: &Path) -> Result<Vec<File>> {
    let places = [
        ("bash", "sagnac.bash", "usr/share/bash-completion/completions/sagnac"),
        ("zsh", "_sagnac", "usr/share/zsh/vendor-completions/_sagnac"),
        ("fish", "sagnac.fish", "usr/share/fish/vendor_completions.d/sagnac.fish"),
    ];
    let made = places.map(|(shell, name, in_deb)| {
        let path = folder.join(name);
        fs::write(&path, stdout_of(60, text(&release.program)?, &["manual", shell], &root())?)?;
        Ok(plain(path, &format!("completions/{name}"), in_deb))
    });
    made.into_iter().collect()
}

/// Text of Debian's copyright file; the licence texts are installed next to it.
fn copyright_text() -> Result<String> {
    let mit = fs::read_to_string(root().join("LICENSE-MIT"))?;
    let holder = mit.lines().find(|line| line.starts_with("Copyright")).context("LICENSE-MIT names no holder")?;
    Ok(format!(
        "Sagnac. {holder}\n\nLicensed under MIT (LICENSE-MIT) or Apache-2.0 (LICENSE-APACHE; on Debian also\n\
         /usr/share/common-licenses/Apache-2.0), at your option. Libraries compiled in: THIRD-PARTY.txt.\n\n{mit}"
    ))
}

/// Copies a file to its place, readable for everyone, and executable if it is a program.
pub(super) fn place(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to.parent().context("a place without a folder")?)?;
    fs::copy(from, to).with_context(|| format!("cannot copy {} to {}", from.display(), to.display()))?;
    let mode = if to.file_name().is_some_and(|name| name == "sagnac") && to.extension().is_none() && is_program(to)? {
        0o755
    } else {
        0o644
    };
    Ok(fs::set_permissions(to, fs::Permissions::from_mode(mode))?)
}

fn is_program(path: &Path) -> Result<bool> {
    Ok(fs::read(path)?.starts_with(b"\x7fELF"))
}
