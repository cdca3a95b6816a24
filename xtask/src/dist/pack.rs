//! Archive and Debian package: the same input gives the same bytes.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use xtask::shell::{root, sh_in, stdout_of, text};

use super::files::{File, files, place};
use super::{Release, binary, empty};

/// Paths of archive and package.
pub(super) struct Packed {
    pub(super) archive: PathBuf,
    pub(super) deb: PathBuf,
}

/// Makes both in a folder.
pub(super) fn pack(release: &Release, folder: &Path) -> Result<Packed> {
    let files = files(release, &folder.join("files"))?;
    Ok(Packed { archive: archive(release, &files, folder)?, deb: deb(release, &files, folder)? })
}

/// `sagnac-VERSION-x86_64-linux.tar.gz`, with one folder of that name in it.
fn archive(release: &Release, files: &[File], folder: &Path) -> Result<PathBuf> {
    let name = format!("sagnac-{}-x86_64-linux", release.version);
    let tree = folder.join("archive");
    empty(&tree)?;
    for file in files.iter().filter(|file| file.in_archive != "copyright") {
        place(&file.from, &tree.join(&name).join(&file.in_archive))?;
    }
    let tar = folder.join(format!("{name}.tar"));
    let time = format!("--mtime=@{}", release.time);
    // Independent of the order of a folder's entries and of the user.
    let same =
        ["--sort=name", "--owner=0", "--group=0", "--numeric-owner", "--mode=u+rwX,go=rX", "--format=gnu", &time];
    let what = ["--create", "--file", text(&tar)?, &name];
    sh_in(&tree, "tar", &[&same[..], &what].concat(), &[])?;
    sh_in(folder, "gzip", &["--force", "--no-name", "--best", text(&tar)?], &[])?;
    Ok(tar.with_extension("tar.gz"))
}

/// `sagnac_VERSION_amd64.deb`.
fn deb(release: &Release, files: &[File], folder: &Path) -> Result<PathBuf> {
    let tree = folder.join("deb");
    empty(&tree)?;
    let mut size = 0;
    for file in files {
        let to = tree.join(&file.in_deb);
        place(&file.from, &to)?;
        let to = if file.compressed { compressed(&to)? } else { to };
        size += fs::metadata(to)?.len();
    }
    let control = tree.join("DEBIAN/control");
    fs::create_dir(control.parent().context("a file without a folder")?)?;
    fs::write(&control, control_text(release, size)?)?;
    fs::set_permissions(&control, fs::Permissions::from_mode(0o644))?;
    open_folders(&tree)?;
    let path = folder.join(format!("sagnac_{}_amd64.deb", release.version));
    // dpkg-deb sets later times to this one; all files are later.
    let time = [("SOURCE_DATE_EPOCH", release.time.as_str())];
    let args = ["--root-owner-group", "-Zxz", "--build", text(&tree)?, text(&path)?];
    sh_in(folder, "dpkg-deb", &args, &time)?;
    Ok(path)
}

fn compressed(path: &Path) -> Result<PathBuf> {
    sh_in(&root(), "gzip", &["--force", "--no-name", "--best", text(path)?], &[])?;
    let name = path.file_name().and_then(|name| name.to_str()).context("a file without a name")?;
    Ok(path.with_file_name(format!("{name}.gz")))
}

/// Independent of the umask of this shell.
fn open_folders(folder: &Path) -> Result<()> {
    fs::set_permissions(folder, fs::Permissions::from_mode(0o755))?;
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            open_folders(&path)?;
        }
    }
    Ok(())
}

fn control_text(release: &Release, bytes: u64) -> Result<String> {
    let architecture = stdout_of(60, "dpkg", &["--print-architecture"], &root())?;
    ensure!(architecture.trim() == "amd64", "the package is for amd64, this machine is {architecture}");
    let manifest = fs::read_to_string(root().join("Cargo.toml"))?;
    let field = |name: &str| {
        let line = manifest.lines().find(|line| line.starts_with(name)).with_context(|| format!("no {name}"))?;
        Ok::<_, anyhow::Error>(line.split('"').nth(1).unwrap_or_default().to_owned())
    };
    Ok(format!(
        "Package: sagnac\nVersion: {}\nArchitecture: amd64\nMaintainer: {}\nInstalled-Size: {}\nDepends: {}\nSection: science\n\
         Priority: optional\nHomepage: {}\nDescription: thermal calibration of ring laser gyros\n \
         Reads thermal-test logs, fits how bias and scale factor move with temperature,\n \
         writes the coefficients as a flash image, and proves on another test what was\n \
         gained. Fiber-optic and MEMS gyros go through the same steps.\n",
        release.version,
        field("authors")?,
        bytes.div_ceil(1024),
        binary::needs(&release.program)?.depends(),
        field("repository")?,
    ))
}
