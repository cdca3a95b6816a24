//! What a command reads and writes: no output is an input, no two outputs are one file, and each can be written.
//!
//! One rule, before the work. Files are compared by what they are (device and number), so that a link, another spelling of a path
//! or a name that the command derives does not get around it. Devices and pipes are not files: they are written to and never replaced.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use sagnac::{Error, Result};
use sagnac_log::write::try_writing;

use crate::files::loading::has_extension;

/// The files of one command.
#[derive(Default)]
pub(crate) struct Files {
    reads: Vec<PathBuf>,
    writes: Vec<PathBuf>,
    folders: Vec<PathBuf>,
    reads_all_in: Vec<PathBuf>,
    figures: Vec<PathBuf>,
}

impl Files {
    pub(crate) fn new() -> Self {
        Self::default()
    }

    /// Files that are read.
    pub(crate) fn reads(mut self, paths: impl IntoIterator<Item = impl AsRef<Path>>) -> Self {
        self.reads.extend(paths.into_iter().map(|path| path.as_ref().to_owned()));
        self
    }

    /// Folders and files; all files in them count as read.
    pub(crate) fn reads_all_in(mut self, folders: impl IntoIterator<Item = impl AsRef<Path>>) -> Self {
        self.reads_all_in.extend(folders.into_iter().map(|path| path.as_ref().to_owned()));
        self
    }

    /// Files that are written.
    pub(crate) fn writes(mut self, paths: impl IntoIterator<Item = impl AsRef<Path>>) -> Self {
        self.writes.extend(paths.into_iter().map(|path| path.as_ref().to_owned()));
        self
    }

    /// Folders that are made where they are not there.
    pub(crate) fn makes(mut self, folders: impl IntoIterator<Item = impl AsRef<Path>>) -> Self {
        self.folders.extend(folders.into_iter().map(|path| path.as_ref().to_owned()));
        self
    }

    /// A folder that gets figures, whose names are those of a report.
    pub(crate) fn figures_in(mut self, folder: &Option<PathBuf>) -> Self {
        self.figures.extend(folder.clone());
        self.makes(folder)
    }

    /// Refuses an output that is an input, or another output, or that cannot be written.
    pub(crate) fn check(&self) -> Result<()> {
        self.compare()?;
        let in_new_folder = |path: &&PathBuf| {
            let is_new = path.parent().is_some_and(|folder| !folder.exists());
            is_new && self.folders.iter().any(|planned| path.starts_with(planned))
        };
        self.writes.iter().filter(|path| !in_new_folder(path)).try_for_each(|path| try_writing(path))?;
        self.folders.iter().try_for_each(|folder| try_making(folder))
    }

    /// Refuses an output that is an input, or another output.
    pub(crate) fn compare(&self) -> Result<()> {
        let read: HashSet<Identity> = self.reads.iter().filter_map(|path| identity(path)).collect();
        let mut written: HashSet<Identity> = HashSet::new();
        for path in &self.writes {
            let Some(it) = identity(path) else { continue };
            let refused = |what: &str, help: &str| Err(Error::input(what, help).file(path.display().to_string()));
            if read.contains(&it) || self.is_in_a_folder_read(path) {
                return refused("the command reads this file", "write to another file");
            }
            if !written.insert(it) {
                return refused("two outputs have this name", "give each output its own name");
            }
        }
        if let Some(link) = self.figures.iter().find_map(|folder| linked_figure(folder)) {
            return Err(Error::input(
                "this is a link, and a figure may get its name",
                "give the figures a folder of their own",
            )
            .file(link.display().to_string()));
        }
        if let Some(path) =
            self.figures.iter().find(|folder| self.reads.contains(folder) || self.writes.contains(folder))
        {
            return Err(Error::input(
                "a folder for figures has the name of another file",
                "give the figures a folder of their own",
            )
            .file(path.display().to_string()));
        }
        let among_figures =
            |path: &&PathBuf| has_extension(path, "svg") && self.figures.iter().any(|at| is_in(path, at));
        match self.reads.iter().chain(&self.writes).find(among_figures) {
            None => Ok(()),
            Some(path) => {
                Err(Error::input("a figure may get the name of this file", "give the figures a folder of their own")
                    .file(path.display().to_string()))
            }
        }
    }
}

/// A link in a folder that could stand for a figure.
fn linked_figure(folder: &Path) -> Option<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).find(|path| has_extension(path, "svg") && path.is_symlink())
}

/// A file whose folder is this one.
fn is_in(path: &Path, folder: &Path) -> bool {
    let own = path.parent().filter(|own| !own.as_os_str().is_empty()).unwrap_or(Path::new("."));
    own.canonicalize().ok().zip(folder.canonicalize().ok()).is_some_and(|(own, folder)| own == folder)
}

impl Files {
    fn is_in_a_folder_read(&self, path: &Path) -> bool {
        let Ok(path) = path.canonicalize() else { return false };
        self.reads_all_in.iter().filter_map(|folder| folder.canonicalize().ok()).any(|folder| path.starts_with(folder))
    }
}

/// Tries whether a folder takes a file, or can be made.
fn try_making(folder: &Path) -> Result<()> {
    if folder.is_dir() {
        return try_writing(&folder.join("any-name"));
    }
    if let Some(file) = folder.ancestors().find(|path| path.exists() && !path.is_dir()) {
        return Err(Error::input("this is a file, and a folder is needed", "give the name of a folder")
            .file(file.display().to_string()));
    }
    // The folder, or the first of those above it that has to be made too.
    let is_under_a_folder =
        |path: &&Path| path.parent().is_some_and(|above| above.as_os_str().is_empty() || above.is_dir());
    folder.ancestors().find(is_under_a_folder).map_or(Ok(()), try_writing)
}

/// What a path means, whatever its spelling.
#[derive(Debug, PartialEq, Eq, Hash)]
enum Identity {
    /// A file that is there: device and number.
    #[cfg(unix)]
    There(u64, u64),
    /// One that is not, or on a system without numbers: its folder and name.
    Named(PathBuf),
}

/// `None` for what is no file and is never replaced: devices, pipes, folders, `-`.
fn identity(path: &Path) -> Option<Identity> {
    match std::fs::metadata(path) {
        Ok(metadata) if !metadata.is_file() => None,
        #[cfg(unix)]
        Ok(metadata) => {
            use std::os::unix::fs::MetadataExt;
            Some(Identity::There(metadata.dev(), metadata.ino()))
        }
        #[cfg(not(unix))]
        Ok(_) => path.canonicalize().ok().map(Identity::Named),
        Err(_) => {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
            Some(Identity::Named(folder.join(path.file_name()?)))
        }
    }
}
