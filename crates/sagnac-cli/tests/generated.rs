//! Files that the program makes, or whose text it prints: the committed files equal its output.

use sagnac_lab::bless::{of_program, stale};
use sagnac_lab::{Program, parse_commands};

fn program() -> Program {
    Program::at(env!("CARGO_BIN_EXE_sagnac"))
}

/// But the messages of broken inputs, whose peak memory needs GNU time: `cargo xtask ci` checks them.
#[test]
fn files_made_by_the_program_are_as_they_are_made() {
    let mut names = of_program();
    names.retain(|name| *name != "errors");
    let stale = stale(&names, &program()).unwrap();
    assert!(names.len() > 2 && stale.is_empty(), "{}\nrun `cargo xtask bless`", stale.join("\n"));
}

#[test]
fn commands_on_pages_can_be_parsed() {
    let parsed = parse_commands(&program()).unwrap();
    assert!(parsed > 30, "{parsed} commands");
}
