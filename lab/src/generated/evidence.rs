//! Coverage, power and risk as measured by the tests: one table of the lines that they print.
//!
//! ```text
//! cargo test … --nocapture --test-threads 1 ─▶ `test NAME ...`, `evidence: CLAIM | MEASURED | BOUND | RECORDS | FILE` ─▶ rows
//! page ─▶ the rows of tests that were run anew are replaced, the others stay                       bless evidence, bless study
//! page ─▶ each claim and bound is in the test that the page names                                  bless --check
//! ```
//!
//! Rows of single files: `bless evidence=hidden,copies`. The tests take minutes, so `--check` does not run them. CI runs them as tests, where they check the bounds. The study takes
//! hours: CI compiles it, `bless study` runs it.

use std::collections::BTreeMap;
use std::fs;

use anyhow::{Context, Result, bail};
use xtask::shell::{root, stdout_of};

use crate::bless::Made;
use crate::places::EVIDENCE;

/// The files of tests that measure, by their packages.
type Tests = [(&'static str, &'static [&'static str])];
/// Those that CI runs.
const TESTS: &Tests = &[
    (
        "sagnac",
        &[
            "acceptance",
            "compare_limits",
            "copies",
            "counts",
            "coverage",
            "enough",
            "entanglement",
            "harmonics",
            "hidden",
            "how_sure",
            "image_ranges",
            "inputs",
            "many_files",
            "paper",
            "plan",
            "prior",
            "rate_table",
            "retest_intervals",
            "turned",
            "two_lags",
            "warm_up",
        ],
    ),
    ("sagnac-noise", &["terms"]),
];
/// Those that CI only compiles: hundreds of records of each truth and number of runs.
const STUDY: &Tests = &[("sagnac", &["selection_study", "plan_study", "enough_study"])];
/// Time limit of the tests, s.
const LONGEST_S: u32 = 4 * 3600;
/// Start of a figure's line.
const MARK: &str = "evidence: ";

const HEAD: &str = "# Evidence

Made by `cargo xtask bless evidence`; do not edit.

Each row is a figure that a test measures on records with a known truth, with the bound that the test asserts. The records come from
generators that share no code with the fit, or from the simulator, whose truth the fit does not see. A figure without a unit is a fraction
of the records, or a ratio. A bound applies to the measured fraction, not to the true one: where all of $n$ records agree, the true fraction
is above $0.05^{1/n}$ with 95 % confidence, that is 0.741 for 10 records, 0.951 for 60 and 0.970 for 100. The seeds are fixed, so a second
run measures the same. CI runs the tests and checks the bounds; `selection_study.rs` takes hours and is run by `cargo xtask bless study`
alone. [Decision](decision.md) explains the figures of a verdict.

| claim | measured | bound | records | test |
|---|---|---|---|---|
";

/// A row of the page.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Figure {
    /// `crates/NAME/tests/FILE.rs::TEST`.
    test: String,
    /// Line of the page.
    at: usize,
    claim: String,
    measured: String,
    bound: String,
    records: String,
}

impl Figure {
    fn row(&self) -> String {
        let Self { test, claim, measured, bound, records, .. } = self;
        format!("| {claim} | {measured} | {bound} | {records} | `{test}` |\n")
    }

    fn of_row(at: usize, row: &str) -> Option<Self> {
        let cells: Vec<&str> = row.strip_prefix("| ")?.strip_suffix(" |")?.split(" | ").collect();
        let [claim, measured, bound, records, test] = cells[..] else { return None };
        let test = test.strip_prefix('`')?.strip_suffix('`')?.to_owned();
        let [claim, measured, bound, records] = [claim, measured, bound, records].map(str::to_owned);
        Some(Self { test, at, claim, measured, bound, records })
    }
}

/// Runs the tests of CI, all or those of some files, and replaces their rows.
pub(crate) fn make(files: &[&str]) -> Result<Vec<Made>> {
    replaced(TESTS, files, &[])
}

/// Runs the study, all or some files of it, and replaces its rows.
pub(crate) fn make_study(files: &[&str]) -> Result<Vec<Made>> {
    replaced(STUDY, files, &["--ignored"])
}

/// The page with the rows of some tests measured anew. What they printed stays in `target/evidence`.
fn replaced(run: &Tests, files: &[&str], more: &[&str]) -> Result<Vec<Made>> {
    let all: Vec<&str> = run.iter().flat_map(|(_, tests)| tests.iter().copied()).collect();
    if let Some(unknown) = files.iter().find(|file| !all.contains(file)) {
        bail!("no file of tests named {unknown} measures; there are: {}", all.join(", "));
    }
    let kept = root().join("target/evidence");
    fs::create_dir_all(&kept).with_context(|| format!("cannot make {}", kept.display()))?;
    let mut figures = committed()?;
    for (package, tests) in run {
        let tests: Vec<&str> = tests.iter().copied().filter(|test| files.is_empty() || files.contains(test)).collect();
        if tests.is_empty() {
            continue;
        }
        let modules: Vec<String> = tests.iter().map(|test| format!("{test}::")).collect();
        let mut args = vec!["test", "--locked", "-p", package];
        // Several files are modules of one program, a single one is a program itself.
        if root().join(path(package, "main")).exists() {
            args.extend(["--test", "tests", "--"]);
            args.extend(modules.iter().map(String::as_str));
        } else {
            tests.iter().for_each(|test| args.extend(["--test", test]));
            args.push("--");
        }
        args.extend(["--nocapture", "--test-threads", "1"]);
        args.extend(more);
        let output = stdout_of(LONGEST_S, "cargo", &args, &root())?;
        fs::write(kept.join(format!("{package}.txt")), &output).context("cannot keep what the tests printed")?;
        figures
            .retain(|figure| tests.iter().all(|test| !figure.test.starts_with(&format!("{}::", path(package, test)))));
        figures.extend(printed(&output)?);
    }
    figures.sort();
    let page = HEAD.to_owned() + &figures.iter().map(Figure::row).collect::<String>();
    let wrong = wrong(&page)?;
    wrong.iter().for_each(|wrong| eprintln!("{wrong}"));
    Ok(vec![Made::new(EVIDENCE, page)])
}

/// The rows of the committed page, in its order.
fn committed() -> Result<Vec<Figure>> {
    let page = fs::read_to_string(root().join(EVIDENCE)).with_context(|| format!("cannot read {EVIDENCE}"))?;
    Ok(page.lines().enumerate().filter_map(|(at, row)| Figure::of_row(at, row)).collect())
}

fn path(package: &str, file: &str) -> String {
    format!("crates/{package}/tests/{file}.rs")
}

/// The figures in what tests printed.
fn printed(output: &str) -> Result<Vec<Figure>> {
    let (mut figures, mut test) = (Vec::new(), None);
    for line in output.lines() {
        if let Some((name, _)) = line.strip_prefix("test ").and_then(|rest| rest.split_once(" ... ")) {
            test = Some(name);
        }
        let Some(figure) = line.strip_prefix(MARK) else { continue };
        let cells: Vec<&str> = figure.split(" | ").collect();
        let [claim, measured, bound, records, file] = cells[..] else { bail!("five cells: {line}") };
        figures.push(Figure {
            test: format!("{file}::{}", in_file(test.with_context(|| format!("no test printed {line}"))?, file)),
            at: figures.len(),
            claim: claim.to_owned(),
            measured: three_digits(measured.parse().with_context(|| line.to_owned())?),
            bound: bound.to_owned(),
            records: records.to_owned(),
        });
    }
    Ok(figures)
}

/// The name of a test within its file, which may be a module of the program.
fn in_file<'a>(test: &'a str, file: &str) -> &'a str {
    match test.split_once("::") {
        Some((module, name)) if file.ends_with(&format!("/{module}.rs")) => name,
        _ => test,
    }
}

/// Rounded to three digits; whole numbers as they are.
fn three_digits(value: f64) -> String {
    if value.fract() == 0.0 {
        return value.to_string();
    }
    let places = (2 - value.abs().log10().floor() as i32).max(0) as usize;
    format!("{value:.places$}")
}

/// Errors of the committed page that are found without running a test.
pub(crate) fn stale() -> Result<Vec<String>> {
    let page = fs::read_to_string(root().join(EVIDENCE)).with_context(|| format!("cannot read {EVIDENCE}"))?;
    wrong(&page)
}

/// Rows whose test is missing or does not contain their claim and bound, and figures of tests without a row.
fn wrong(page: &str) -> Result<Vec<String>> {
    if !page.starts_with(HEAD) {
        return Ok(vec![format!("{EVIDENCE}: its head is out of date")]);
    }
    let rows = page.lines().enumerate().skip(HEAD.lines().count());
    let mut claimed: BTreeMap<String, Vec<Figure>> = BTreeMap::new();
    let mut wrong = Vec::new();
    for (at, row) in rows {
        match Figure::of_row(at + 1, row) {
            Some(figure) => claimed.entry(figure.test.clone()).or_default().push(figure),
            None => wrong.push(format!("{EVIDENCE}:{}: no row: {row}", at + 1)),
        }
    }
    for (package, files) in TESTS.iter().chain(STUDY) {
        for file in *files {
            let path = path(package, file);
            let source = fs::read_to_string(root().join(&path)).with_context(|| format!("cannot read {path}"))?;
            // The truths of the study share one function, which makes their claims.
            let shares = STUDY.iter().any(|(_, of_study)| of_study.contains(file));
            for (name, body) in tests(&source).map(|(name, body)| (name, if shares { &*source } else { body })) {
                let test = format!("{path}::{name}");
                let figures = claimed.remove(&test).unwrap_or_default();
                if figures.is_empty() && body.contains("evidence(") && !shares {
                    wrong.push(format!("{EVIDENCE}: no figure of {test}; run `cargo xtask bless evidence`"));
                }
                wrong.extend(figures.iter().filter_map(|figure| differs(figure, body)));
            }
        }
    }
    let missing = claimed.into_values().flatten();
    wrong.extend(missing.map(|figure| format!("{EVIDENCE}:{}: there is no test {}", figure.at, figure.test)));
    Ok(wrong)
}

/// Claim and bound of a figure are literals of its test; `{…}` of a format stands for any text.
fn differs(figure: &Figure, body: &str) -> Option<String> {
    let is_literal = |text: &str| body.split('"').skip(1).any(|literal| is_made_by(literal, text));
    let missing = [&figure.claim, &figure.bound].into_iter().find(|text| !is_literal(text))?;
    Some(format!("{EVIDENCE}:{}: {} has no \"{missing}\"; run `cargo xtask bless evidence`", figure.at, figure.test))
}

/// True for a text that a format makes and of which at least a third is its own.
fn is_made_by(format: &str, text: &str) -> bool {
    let (first, places) = format.split_once('{').unwrap_or((format, ""));
    let Some(mut rest) = text.strip_prefix(first) else { return false };
    let (mut own, mut ends_in_place) = (first.len(), false);
    for place in places.split('{').filter(|place| !place.is_empty()) {
        let Some((_, part)) = place.split_once('}') else { return false };
        let Some(at) = rest.find(part) else { return false };
        rest = &rest[at + part.len()..];
        (own, ends_in_place) = (own + part.len(), part.is_empty());
    }
    (rest.is_empty() || ends_in_place) && 3 * own >= text.len()
}

/// Names and bodies of the tests in a source, as rustfmt writes them.
fn tests(source: &str) -> impl Iterator<Item = (&str, &str)> {
    source.split("#[test]\n").skip(1).filter_map(|rest| {
        let rest = rest.strip_prefix("fn ").or_else(|| Some(rest.split_once("]\nfn ")?.1))?;
        let body = rest.split_once("\n}\n").map_or(rest, |(body, _)| body);
        Some((rest.split_once('(')?.0, body))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: &str =
        "#[test]\nfn one() {\n    evidence(\"a\", x, \"≥ 0.97\", 60);\n}\n\nfn other() {\n    \"b\";\n}\n";

    #[test]
    fn figures_are_read_from_what_tests_print() {
        let row = "| a | 0.983 | ≥ 0.97 | 60 | `crates/x/tests/y.rs::one` |\n";
        let of = |test: &str| {
            let output = format!(
                "running 2 tests\ntest {test} ... \nevidence: a | 0.98333 | ≥ 0.97 | 60 | crates/x/tests/y.rs\nok\n\
                 test two ... ok\n"
            );
            printed(&output).unwrap()
        };
        let figures = of("one");
        assert_eq!((figures[0].row().as_str(), of("y::one")[0].row().as_str()), (row, row));
        let again = Figure::of_row(0, figures[0].row().trim_end()).unwrap();
        assert_eq!(again, figures[0]);
        assert!(printed("evidence: a | 1 | ≥ 1 | 1 | y.rs\n").is_err(), "before any test");
    }

    #[test]
    fn a_claim_or_a_bound_that_its_test_does_not_have_is_named() {
        let found: Vec<_> = tests(SOURCE).collect();
        assert_eq!((found.len(), found[0].0), (1, "one"));
        let figure = |claim: &str, bound: &str| {
            Figure::of_row(9, &format!("| {claim} | 0.98 | {bound} | 60 | `y.rs::one` |")).unwrap()
        };
        assert_eq!(differs(&figure("a", "≥ 0.97"), found[0].1), None);
        for (claim, bound) in [("b", "≥ 0.97"), ("a", "≥ 0.9")] {
            assert!(differs(&figure(claim, bound), found[0].1).unwrap().contains("y.rs::one"));
        }
    }

    #[test]
    fn a_claim_may_come_from_a_format() {
        for (format, text, is_made) in [
            ("σ of {name}, runs: {runs}", "σ of weak cubic, runs: 4", true),
            ("σ of {name}, runs: {runs}, all", "σ of weak cubic, runs: 4", false),
            ("σ of {name}", "rms of weak cubic", false),
            ("{name} covers", "curve covers", true),
            ("{name} covers", "curve covers not", false),
            ("{name covers", "curve covers", false),
            ("{found:?}", "curve covers", false),
            ("", "a", false),
        ] {
            assert_eq!(is_made_by(format, text), is_made, "{format} {text}");
        }
    }

    #[test]
    fn figures_have_three_digits() {
        let shown = [0.0, 1.0, 1.000_97, 0.983_33, 0.1, 12.345, 0.001_234].map(three_digits);
        assert_eq!(shown, ["0", "1", "1.00", "0.983", "0.100", "12.3", "0.00123"]);
    }
}
