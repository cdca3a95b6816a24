//! What a command reads and writes, by the arguments that name files: the guard asks before any work, and the manual lists it.
//!
//! Every argument that names a file is an input unless [`use_of`] says otherwise, so that a new one is protected from the start.

use std::any::TypeId;
use std::path::{Path, PathBuf};

use clap::{Arg, ArgMatches, Command};

use crate::files::Files;

/// What becomes of the file that an argument names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Use {
    Reads,
    Writes,
    /// A folder, or a port: the command knows the files in it, and compares them itself.
    WritesInto,
    Figures,
}

/// `None` for an argument that names no file. `command` has the words behind `sagnac`.
pub(crate) fn use_of(command: &str, arg: &Arg) -> Option<Use> {
    let is_path = arg.get_value_parser().type_id() == TypeId::of::<PathBuf>();
    Some(match (command, arg.get_id().as_str()) {
        // A file, or the name of a set.
        (_, "limits") => Use::Reads,
        _ if !is_path => return None,
        (_, "figures") => Use::Figures,
        ("export" | "fleet calibrate" | "fleet demo" | "manual", "output") => Use::WritesInto,
        (of, "output") if of.starts_with("line send") => Use::WritesInto,
        (_, "output" | "windows" | "page" | "truth") | ("bench", "calibration") => Use::Writes,
        _ => Use::Reads,
    })
}

/// The files that the arguments of a command line name.
pub(crate) fn named(program: &Command, found: &ArgMatches) -> Files {
    let (mut words, mut command, mut found) = (Vec::new(), program, found);
    while let Some((name, own)) = found.subcommand() {
        let Some(next) = command.find_subcommand(name) else { break };
        words.push(name);
        (command, found) = (next, own);
    }
    let words = words.join(" ");
    let mut files = Files::new();
    for arg in command.get_arguments() {
        let Some(used) = use_of(&words, arg) else { continue };
        let values = found.try_get_raw(arg.get_id().as_str()).ok().flatten().into_iter().flatten().map(Path::new);
        files = match used {
            Use::Reads => files.reads(values),
            Use::Writes => files.writes(values),
            Use::WritesInto => files,
            Use::Figures => values.fold(files, |files, folder| files.figures_in(&Some(folder.to_owned()))),
        };
    }
    files
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    /// Each command with its own words.
    fn commands(command: &Command, words: &str, all: &mut Vec<(String, Command)>) {
        all.push((words.to_owned(), command.clone()));
        for own in command.get_subcommands().filter(|own| own.get_name() != "help") {
            commands(own, format!("{words} {}", own.get_name()).trim(), all);
        }
    }

    /// A value that an argument takes.
    fn value(arg: &Arg) -> String {
        let possible = arg.get_possible_values().first().map(|value| value.get_name().to_owned());
        possible.unwrap_or_else(|| {
            if use_of("", arg).is_some() { format!("other-{}", arg.get_id()) } else { "1".to_owned() }
        })
    }

    fn with_value(arg: &Arg, value: &str) -> Vec<String> {
        let times = arg.get_num_args().map_or(1, |values| values.min_values().max(1));
        let flag = arg.get_long().map(|long| format!("--{long}"));
        flag.into_iter().chain(std::iter::repeat_n(value.to_owned(), times)).collect()
    }

    /// Every argument that a command reads a file by, with every one that it writes a file by: one file for both is refused.
    #[test]
    fn no_command_writes_a_file_that_it_reads() {
        let mut program = crate::Cli::command();
        program.build();
        let mut all = Vec::new();
        commands(&program, "", &mut all);
        let file = tempfile::NamedTempFile::new().unwrap();
        let path = file.path().to_str().unwrap();
        let mut pairs = 0;
        for (words, command) in &all {
            let uses = |wanted: Use| command.get_arguments().filter(move |arg| use_of(words, arg) == Some(wanted));
            for (reads, writes) in
                uses(Use::Reads).flat_map(|reads| uses(Use::Writes).map(move |writes| (reads, writes)))
            {
                let others =
                    command.get_arguments().filter(|arg| arg.is_required_set() && ![reads, writes].contains(arg));
                let others = others.flat_map(|arg| with_value(arg, &value(arg)));
                let line = ["sagnac".to_owned()].into_iter().chain(words.split(' ').map(str::to_owned)).chain(others);
                let line = line.chain(with_value(writes, path)).chain(with_value(reads, path));
                let line: Vec<String> = line.collect();
                let found = program.clone().try_get_matches_from(&line).unwrap_or_else(|e| panic!("{line:?}: {e}"));
                let refusal = named(&program, &found).compare().unwrap_err();
                assert_eq!(refusal.what, "the command reads this file", "{line:?}");
                pairs += 1;
            }
        }
        assert!(pairs > 30, "{pairs}");
    }
}
