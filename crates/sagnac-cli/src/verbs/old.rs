//! Verbs of earlier versions: each is answered with the command that does the same now.

use sagnac::Error;

use crate::output::shell::command_line;

/// The messages that stood behind `sagnac line` itself.
const MESSAGES: [&str; 4] = ["confirm", "roll-back", "service", "answer"];

/// The error for an old command, with the new one to copy; `None` for what never was a command.
pub(crate) fn answer(words: &[String]) -> Option<Error> {
    let (verb, rest) = words.split_first()?;
    let is_one_of = |names: &[&str]| rest.iter().any(|word| names.contains(&word.as_str()));
    let now = match verb.as_str() {
        "window" => "inspect",
        "demo" => "simulate --paper",
        "frames" => "line read",
        "line" if is_one_of(&MESSAGES) && !is_one_of(&["read", "send"]) => "line send",
        _ => return None,
    };
    let rest = rest.iter().map(|word| if verb == "window" { windows_flag(word) } else { word.clone() });
    let command = format!("sagnac {now} {}", command_line(&rest.collect::<Vec<_>>()));
    Some(Error::input(format!("`sagnac {verb}` is `sagnac {now}` now"), command.trim_end()))
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
