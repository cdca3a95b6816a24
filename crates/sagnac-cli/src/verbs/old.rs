//! Verbs of earlier versions: each is answered with the command that does the same now.

use sagnac::Error;

use crate::output::shell::command_line;

/// An old verb, and what it is now.
const VERBS: [(&str, &[&str]); 1] = [("window", &["inspect"])];

/// The error for an old command, with the new one to copy; `None` for what never was a command.
pub(crate) fn answer(words: &[String]) -> Option<Error> {
    let (verb, rest) = words.split_first()?;
    let (_, now) = VERBS.iter().find(|(old, _)| old == verb)?;
    let rest = rest.iter().map(|word| if verb == "window" { windows_flag(word) } else { word.clone() });
    let command: Vec<String> = ["sagnac"].iter().chain(*now).map(|word| (*word).to_owned()).chain(rest).collect();
    Some(Error::input(format!("`{verb}` is no command any more")).help(command_line(&command)))
}

/// The flag for the table of windows, which `sagnac window` had as its output.
fn windows_flag(word: &str) -> String {
    if word == "-o" || word == "--output" {
        return "--windows".to_owned();
    }
    match word.strip_prefix("--output=").or_else(|| word.strip_prefix("-o")) {
        Some(file) => format!("--windows={file}"),
        None => word.to_owned(),
    }
}
