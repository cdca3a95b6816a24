//! `cargo xtask ci`: the parts that a change can break. What `cargo xtask test` holds is not repeated.
//!
//! ```text
//! PARTS ─inputs▶ hash ─┬─ that of ci/passed.toml: skipped, with the date          --all: run
//!                      └─ another, or none:       run ─▶ its line in ci/passed.toml
//! ```
//!
//! Of the parts that would be skipped, the one that has gone unrun for longest is run too. A failure ends the run after what is under way.

mod inputs;
mod parts;
mod passed;

use std::collections::VecDeque;
use std::fs;
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use xtask::debian::need;
use xtask::shell::{root, stdout_of, target};

use inputs::Tree;
use parts::{PARTS, Part, Runs};
use passed::{Pass, Passed};

/// Into this file a task writes the processor time that it took.
const PROCESSOR_TIME: &str = "XTASK_PROCESSOR_TIME";

/// A part and why it is run or not.
struct Planned {
    part: &'static Part,
    hash: String,
    why: String,
    is_due: bool,
}

/// What `ci` knows.
const FLAGS: [&str; 2] = ["--all", "--list"];

/// Runs what is due; `--all`: every part; `--list`: says which and why.
pub(crate) fn ci(flags: &[&str]) -> Result<()> {
    if let Some(unknown) = flags.iter().find(|flag| !FLAGS.contains(flag)) {
        bail!("no such flag: {unknown}; there are --all and --list");
    }
    let passed = Passed::read(root().join("ci/passed.toml"))?;
    let planned = plan(&passed, flags.contains(&"--all"))?;
    for Planned { part, why, is_due, .. } in &planned {
        println!("{} {:18} {why}", if *is_due { "run " } else { "skip" }, part.name);
    }
    if flags.contains(&"--list") {
        return Ok(());
    }
    let due: Vec<&Planned> = planned.iter().filter(|planned| planned.is_due).collect();
    let tools: Vec<_> = due.iter().flat_map(|planned| planned.part.tools.concat()).collect();
    need(&tools)?;
    run(&due, passed, run_one)
}

fn plan(passed: &Passed, all: bool) -> Result<Vec<Planned>> {
    let tree = Tree::read()?;
    let plan = |part: &'static Part| -> Result<Planned> {
        let hash = tree.hash(&tree.inputs(part)?)?;
        let (is_due, why) = match passed.of(part.name) {
            _ if all => (true, "--all".to_owned()),
            None => (true, "has not passed".to_owned()),
            Some(pass) if pass.inputs == hash => (false, format!("passed on {}, the same inputs since", pass.date)),
            Some(pass) => (true, format!("an input has changed since it passed on {}", pass.date)),
        };
        Ok(Planned { part, hash, why, is_due })
    };
    let mut planned = PARTS.iter().map(plan).collect::<Result<Vec<_>>>()?;
    let date = |planned: &Planned| passed.of(planned.part.name).map(|pass| pass.date.clone());
    let oldest = planned.iter_mut().filter(|planned| !planned.is_due).min_by_key(|planned| date(planned));
    if let Some(oldest) = oldest {
        (oldest.is_due, oldest.why) = (true, format!("{}: none has gone unrun for longer", oldest.why));
    }
    Ok(planned)
}

/// Parts that wait, and what has come of the others.
struct Work<'a> {
    on_all: VecDeque<&'a Planned>,
    /// Of each row one after the other.
    on_one: VecDeque<Vec<&'a Planned>>,
    passed: Passed,
    table: String,
    failed: Vec<&'static str>,
}

/// Runs parts, each by `run_one`.
fn run(due: &[&Planned], passed: Passed, run_one: impl Fn(&Planned) -> Result<Pass> + Copy + Sync) -> Result<()> {
    let mut work =
        Work { on_all: VecDeque::new(), on_one: VecDeque::new(), passed, table: String::new(), failed: Vec::new() };
    for planned in due {
        match (planned.part.runs, work.on_one.back_mut()) {
            (Runs::OnAll, _) => work.on_all.push_back(planned),
            (Runs::AfterTheOneBefore, Some(row)) => row.push(planned),
            _ => work.on_one.push_back(vec![planned]),
        }
    }
    let work = Mutex::new(work);
    let wall = Instant::now();
    thread::scope(|scope| {
        // Who has run the one list helps with the other, so that no processor waits.
        scope.spawn(|| take(&work, run_one, |work| work.on_one.pop_front()));
        take(&work, run_one, |work| work.on_all.pop_front().map(|one| vec![one]).or_else(|| work.on_one.pop_front()));
    });
    let work = work.into_inner().unwrap_or_else(PoisonError::into_inner);
    println!("{:18} {:>8} {:>12}\n{}", "part", "wall, s", "processor, s", work.table);
    ensure!(work.failed.is_empty(), "failed: {}", work.failed.join(", "));
    println!("ci: {} parts passed in {:.0} s", due.len(), wall.elapsed().as_secs_f64());
    Ok(())
}

/// Takes rows of parts until there is none, or one has failed.
fn take<'a>(
    work: &Mutex<Work<'a>>,
    run_one: impl Fn(&Planned) -> Result<Pass>,
    next: impl Fn(&mut Work<'a>) -> Option<Vec<&'a Planned>>,
) {
    let locked = || work.lock().unwrap_or_else(PoisonError::into_inner);
    loop {
        let row = {
            let mut work = locked();
            if work.failed.is_empty() { next(&mut work) } else { None }
        };
        let Some(row) = row else { return };
        for planned in row {
            let name = planned.part.name;
            // The lock must not be held while the part runs.
            let forgotten = locked().passed.forget(name);
            let ended = forgotten.and_then(|()| run_one(planned));
            let mut work = locked();
            let kept = ended.and_then(|pass| {
                work.table += &format!("{name:18} {:8} {:12}\n", pass.wall_s, pass.processor_s);
                work.passed.add(name, pass)
            });
            if let Err(error) = kept {
                eprintln!("ci: {name} failed: {error:#}\nonce more: cargo xtask {}", planned.part.task.join(" "));
                work.failed.push(name);
                return;
            }
        }
    }
}

/// A process of its own, which knows the processor time of all that it started. The output of parts that run next to others is shown when
/// they end, so that it does not mix.
fn run_one(planned: &Planned) -> Result<Pass> {
    let Planned { part, hash, .. } = planned;
    println!("ci: {}", part.name);
    let wall = Instant::now();
    let times = target().join(format!("ci-{}", part.name.replace(' ', "-")));
    fs::create_dir_all(target())?;
    let mut task = Command::new(std::env::current_exe()?);
    task.args(part.task).env(PROCESSOR_TIME, &times).current_dir(root()).stdin(Stdio::null());
    let status = if part.runs == Runs::OnAll {
        task.status()?
    } else {
        let output = task.output()?;
        println!("ci: {}:\n{}", part.name, String::from_utf8_lossy(&[output.stdout, output.stderr].concat()));
        output.status
    };
    ensure!(status.success(), "{status}");
    let processor_s = fs::read_to_string(&times).context("the part has not said its processor time")?;
    fs::remove_file(&times)?;
    Ok(Pass {
        inputs: hash.clone(),
        date: stdout_of(9, "date", &["-u", "+%F"], &root())?.trim().to_owned(),
        wall_s: wall.elapsed().as_secs(),
        processor_s: processor_s.trim().parse::<f64>()?.round() as u64,
    })
}

/// Says the processor time of all that this process started, where `ci` asks for it.
pub(crate) fn tell_processor_time() -> Result<()> {
    let Some(path) = std::env::var_os(PROCESSOR_TIME) else { return Ok(()) };
    fs::write(path, format!("{:.1}", processor_s()?))?;
    Ok(())
}

/// Processor time of all child processes that have ended, s: proc(5), where it is in hundredths.
pub(crate) fn processor_s() -> Result<f64> {
    of_children(&fs::read_to_string("/proc/self/stat").context("cannot read /proc/self/stat")?)
}

fn of_children(stat: &str) -> Result<f64> {
    // The name in parentheses may hold blanks; the sixteenth field is the fourteenth behind it.
    let (_, fields) = stat.rsplit_once(") ").context("/proc/self/stat has no name")?;
    let fields: Vec<&str> = fields.split(' ').collect();
    let ticks = |at: usize| fields.get(at).and_then(|field| field.parse::<f64>().ok());
    let (user, system) = ticks(13).zip(ticks(14)).context("/proc/self/stat is too short")?;
    Ok((user + system) / 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_of_children_is_read_behind_any_name() {
        let stat = "7 (a) b) S 1 2 3 4 5 6 7 8 9 10 111 222 250 50 20 0 1 0";
        assert_eq!(of_children(stat).unwrap(), 3.0);
        assert!(of_children("7 (a) S 1").is_err());
    }

    /// The workflow cannot run here: its commands, and those of .ci/run, are tasks of xtask.
    #[test]
    fn the_workflow_runs_what_there_is() {
        for path in [".github/workflows/ci.yml", ".ci/run"] {
            let text = fs::read_to_string(root().join(path)).unwrap();
            let lines = text.lines().filter(|line| !line.trim_start().starts_with('#'));
            let commands: Vec<&str> = lines.filter_map(|line| Some(line.split_once("cargo xtask ")?.1)).collect();
            for (at, command) in ["test", "ci"].iter().enumerate() {
                assert_eq!(commands[at], *command, "{path}");
            }
            for command in commands {
                let words: Vec<&str> = command.split(' ').collect();
                let known = crate::HELP.lines().any(|line| line.starts_with(&format!("cargo xtask {} ", words[0])));
                assert!(known && words[1..].iter().all(|flag| FLAGS.contains(flag)), "{path}: cargo xtask {command}");
            }
        }
    }

    /// Its line is gone from when it begins, so that an interruption leaves none either.
    #[test]
    fn a_failed_part_loses_its_line_and_one_that_passes_gets_its_own() {
        let path = target().join(format!("passed-{}.toml", std::process::id()));
        let line = |name| {
            format!("\"{name}\" = {{ inputs = \"old\", passed = \"2026-11-01\", wall_s = 1, processor_s = 1 }}\n")
        };
        fs::create_dir_all(target()).unwrap();
        fs::write(&path, ["c", "deny", "fpga"].map(line).concat()).unwrap();
        let planned = |name: &str| Planned {
            part: PARTS.iter().find(|part| part.name == name).unwrap(),
            hash: "new".to_owned(),
            why: String::new(),
            is_due: true,
        };
        let lines = || fs::read_to_string(&path).unwrap();
        let (passes, fails) = (planned("deny"), planned("fpga"));
        let ended = run(&[&passes, &fails], Passed::read(path.clone()).unwrap(), |planned| {
            ensure!(!lines().contains(planned.part.name), "its line is there while it runs");
            ensure!(planned.part.name != "fpga", "it fails");
            Ok(Pass { inputs: planned.hash.clone(), date: "2026-11-27".to_owned(), wall_s: 2, processor_s: 2 })
        });
        assert_eq!(ended.unwrap_err().to_string(), "failed: fpga");
        let left = Passed::parse(&lines()).unwrap();
        assert_eq!(left.of("fpga"), None);
        assert_eq!(left.of("c").unwrap().inputs, "old");
        // One that another's failure has kept from running has its line still.
        assert!(["new", "old"].contains(&left.of("deny").unwrap().inputs.as_str()));
        run(&[&passes], Passed::read(path.clone()).unwrap(), |planned| {
            Ok(Pass { inputs: planned.hash.clone(), date: "2026-11-27".to_owned(), wall_s: 2, processor_s: 2 })
        })
        .unwrap();
        assert_eq!(Passed::parse(&lines()).unwrap().of("deny").unwrap().inputs, "new");
        fs::remove_file(path).unwrap();
    }

    #[test]
    fn without_a_pass_each_part_is_due_and_with_all_the_oldest_alone() {
        let none = plan(&Passed::default(), false).unwrap();
        assert!(none.iter().all(|planned| planned.is_due) && none.len() == PARTS.len());
        let mut text = String::new();
        for (day, planned) in (10..).zip(&none) {
            let (name, hash) = (planned.part.name, &planned.hash);
            let day = if name == "wheel" { 1 } else { day };
            text += &format!(
                "\"{name}\" = {{ inputs = \"{hash}\", passed = \"2026-11-{day:02}\", wall_s = 1, processor_s = 1 }}\n"
            );
        }
        let due = |text: &str, all: bool| -> Vec<&str> {
            let planned = plan(&Passed::parse(text).unwrap(), all).unwrap();
            planned.iter().filter(|planned| planned.is_due).map(|planned| planned.part.name).collect()
        };
        assert_eq!(due(&text, false), ["wheel"]);
        assert_eq!(due(&text, true).len(), PARTS.len());
        let of_c = &none.iter().find(|planned| planned.part.name == "c").unwrap().hash;
        assert_eq!(due(&text.replacen(of_c, "another", 1), false), ["c", "wheel"]);
    }
}
