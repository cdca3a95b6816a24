//! Flags for a report, and how it is written: one HTML file, and its figures as files.

use std::path::{Path, PathBuf};

use clap::Args;
use sagnac::{Error, Result};
use sagnac_log::write::write_bytes;
use sagnac_report::Report;

use crate::files::Files;
use crate::files::loading::has_extension;
use crate::output::console::Console;

/// The report that a command writes.
#[derive(Args, Clone, Default)]
pub(crate) struct ReportArgs {
    /// Report to write: one HTML file for screen and paper
    #[arg(long = "report", value_name = "FILE")]
    page: Option<PathBuf>,
    /// Folder for the report's figures, an SVG file each
    #[arg(long, value_name = "FOLDER", hide_short_help = true)]
    figures: Option<PathBuf>,
}

impl ReportArgs {
    /// True where a report or its figures are to be written.
    pub(crate) fn is_asked(&self) -> bool {
        self.page.is_some() || self.figures.is_some()
    }

    /// Checks what will be written next to the other files of the command; refuses what is no page.
    pub(crate) fn check_with(&self, files: Files) -> Result<()> {
        files.writes(&self.page).figures_in(&self.figures).check()?;
        self.check_name()
    }

    /// Refuses what is no page.
    pub(crate) fn check_name(&self) -> Result<()> {
        self.page.as_deref().map_or(Ok(()), refuse_other_endings)
    }

    /// Writes what was asked for and says so; the report is made only then.
    pub(crate) fn write(&self, console: &mut Console, make: impl FnOnce() -> Result<Report>) -> Result<()> {
        self.written(make)?.iter().for_each(|name| console.say(format!("wrote {name}")));
        Ok(())
    }

    /// Writes what was asked for, and names it; the report is made only then.
    pub(crate) fn written(&self, make: impl FnOnce() -> Result<Report>) -> Result<Vec<String>> {
        let mut names = Vec::new();
        if !self.is_asked() {
            return Ok(names);
        }
        let report = make()?;
        if let Some(path) = &self.page {
            write_bytes(path, report.html().as_bytes())?;
            names.push(path.display().to_string());
        }
        if let Some(folder) = &self.figures {
            std::fs::create_dir_all(folder).map_err(|e| Error::io_path(folder, "make", &e))?;
            let mut written = 0;
            for (name, svg) in report.figures() {
                write_bytes(&folder.join(format!("{name}.svg")), svg.as_bytes())?;
                written += 1;
            }
            let plural = if written == 1 { "" } else { "s" };
            names.push(format!("{written} figure{plural} to {}", folder.display()));
        }
        Ok(names)
    }
}

/// A report is a page of HTML; other endings promise another format.
fn refuse_other_endings(path: &Path) -> Result<()> {
    let is = |extension: &str| has_extension(path, extension);
    if is("html") || is("htm") || path.exists() && !path.is_file() {
        return Ok(());
    }
    let refused = |what: &str, help: String| Err(Error::input(what, help).file(path.display().to_string()));
    let page = path.with_extension("html");
    let page = page.display();
    if is("pdf") {
        let print = format!("chromium --headless --no-pdf-header-footer --print-to-pdf={} {page}", path.display());
        return refused("the program writes no PDF", format!("write {page} and print it, in a browser or by: {print}"));
    }
    if ["svg", "png"].iter().any(|extension| is(extension)) {
        return refused(
            "a report has several figures, and this is one image file",
            "write each figure as an SVG file with --figures FOLDER".to_owned(),
        );
    }
    refused("a report is an HTML page", format!("give it the ending .html: {page}"))
}
