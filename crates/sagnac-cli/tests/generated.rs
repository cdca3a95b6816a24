//! Files that the program makes, or whose text it prints: the committed files equal its output.

use sagnac_lab::{Program, parse_commands};

fn program() -> Program {
    Program::at(env!("CARGO_BIN_EXE_sagnac"))
}

/// CI skips these: `bless --check` does the same for all files.
mod generated_files_are_as_they_are_made {
    use sagnac_lab::bless::stale;

    use super::program;

    fn holds(name: &str) {
        let stale = stale(&[name], &program()).unwrap();
        assert!(stale.is_empty(), "{}\nrun `cargo xtask bless {name}`", stale.join("\n"));
    }

    #[test]
    fn the_manual_is_made_from_the_program() {
        holds("cli");
    }

    #[test]
    fn every_broken_input_is_reported_by_name_and_place() {
        holds("errors");
    }

    #[test]
    fn every_fault_in_every_scenario() {
        holds("faults");
    }

    #[test]
    fn pages_show_what_the_program_prints() {
        holds("pages");
    }
}

#[test]
fn commands_on_pages_can_be_parsed() {
    let parsed = parse_commands(&program()).unwrap();
    assert!(parsed > 30, "{parsed} commands");
}
