//! The Rust core on this machine against the vectors; refusal of texts that are not vector files.

use std::path::{Path, PathBuf};

use sagnac_vectors::{BadFile, Failure, MAGIC, Module, check};

fn files() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/vectors");
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths
}

#[test]
fn every_file_passes() {
    let mut ticks = [0; 8];
    let files = files();
    assert_eq!(files.len(), 15, "{files:?}");
    for path in files {
        let passed = check(&std::fs::read(&path).unwrap()).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        println!("{}: {passed:?}", path.display());
        ticks[passed.module as usize] += passed.ticks;
    }
    // A million ticks of the compensator over a full profile; at least 100,000 of each of the others but the watch, which has one update in
    // a temperature period.
    assert!(ticks[Module::Compensator as usize] >= 1_000_000, "{ticks:?}");
    assert!(ticks[2..6].iter().all(|n| *n >= 100_000), "{ticks:?}");
    assert!(ticks[Module::Watch as usize] >= 40_000, "{ticks:?}");
}

/// Any changed word is reported with its place.
#[test]
fn a_changed_word_is_reported() {
    let path = files().into_iter().find(|path| path.ends_with("quadrature.hex")).unwrap();
    let text = std::fs::read_to_string(path).unwrap();
    let last = text.trim_end().rfind('\n').unwrap() + 1;
    // The first output of the last record.
    let at = last + 9 * 9;
    let mut changed = text.clone();
    changed.replace_range(at..at + 8, "deadbeef");
    match check(changed.as_bytes()) {
        Err(Failure::Differs { module: Module::Quadrature, record: 122, output: 0, expected: 0xdead_beef, .. }) => {}
        other => panic!("{other:?}"),
    }
}

#[test]
fn other_texts_are_refused() {
    let cases: [(&str, BadFile); 7] = [
        ("", BadFile::TooShort),
        ("// nothing but a comment", BadFile::TooShort),
        ("00000001", BadFile::NotVectors),
        ("5a67ac01 9 0 0", BadFile::UnknownModule(9)),
        ("5a67ac01 1 ffffffff 0", BadFile::LongTable(u32::MAX)),
        ("5a67ac01 4 0\n 0 xyz", BadFile::NotAWord { line: 2 }),
        ("5a67ac01 4 0\n 0\n1", BadFile::TooLong { line: 3 }),
    ];
    assert_eq!(MAGIC, 0x5a67_ac01);
    for (text, why) in cases {
        assert_eq!(check(text.as_bytes()), Err(Failure::File(why)), "{text:?}");
    }
    assert_eq!(check(b"5a67ac01 1 4 0 0"), Err(Failure::Table));
    let operation = format!("5a67ac01 4 0 1 {}", "7 ".repeat(16));
    assert_eq!(check(operation.as_bytes()), Err(Failure::Operation { record: 0, operation: 7 }));
}
