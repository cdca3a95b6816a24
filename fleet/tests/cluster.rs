//! The same bytes on any number of machines, and whatever happens to them.

mod support;

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use support::{Cluster, Factory, PROGRAM, said};

/// Local threads, then 1, 2 and 4 executors: records, proofs, results and table are the same bytes, and a second run does nothing.
#[test]
fn a_cluster_of_any_size_gives_the_same_bytes() {
    let it = Factory::new(6);
    let (status, told, _) = it.calibrate("units", "here", &["--threads", "1"]);
    assert_eq!(status, 1, "one log is broken: {told}");
    assert!(told.contains("7 units: 6 calibrated, 0 refused, 1 failed"), "{told}");
    let expected = it.files("here");
    assert_eq!(expected.len(), 6 * 3 + 1 + 1, "a result, a record and a proof a unit; the broken one; the table");
    let mut cluster = Cluster::new(0);
    for executors in [1, 2, 4] {
        while cluster.executors() < executors {
            cluster.add_executor();
        }
        let (folder, url) = (format!("of-{executors}"), cluster.url());
        for (batch, per_task, more) in [("64", "3", ""), ("2", "1", ", 7 unchanged since before")] {
            let args = ["--cluster", &url, "--batch", batch, "--per-task", per_task];
            let (status, on_cluster, problems) = it.calibrate("units", &folder, &args);
            assert_eq!(status, 1, "{problems}{}", cluster.logs());
            assert!(on_cluster.contains(more.trim_start_matches(", ")), "{on_cluster}");
            let plain = on_cluster.replace(" (unchanged)", "").replace(&more.replace(", ", "; "), "");
            assert_eq!(plain, told.replace("here/", &format!("{folder}/")));
            assert_eq!(it.files(&folder), expected);
        }
    }
}

/// An executor is killed when it has answered some of a batch: its units are done by the other.
#[test]
fn an_executor_that_dies_loses_nothing() {
    let it = Factory::new(24);
    it.calibrate("units", "here", &[]);
    let mut cluster = Cluster::new(2);
    let url = cluster.url();
    let mut command = it.command("units", "there", &["--cluster", &url]);
    let running = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    support::until("an answer", || cluster.has_answers(1));
    cluster.kill_executor(1);
    assert_eq!(it.done("there"), 0, "the batch is under way");
    let (status, told, problems) = said(running.wait_with_output().unwrap());
    assert_eq!(status, 1, "{told}{problems}{}", cluster.logs());
    assert_eq!(it.files("there"), it.files("here"));
}

/// The scheduler is killed while batches are under way, and is back once the driver has noticed: these are sent again.
#[test]
fn a_scheduler_that_is_started_again_loses_nothing() {
    let it = Factory::new(12);
    it.calibrate("units", "here", &[]);
    let mut cluster = Cluster::new(2);
    let url = cluster.url();
    let mut command = it.command("units", "there", &["--cluster", &url, "--batch", "1"]);
    let mut running = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut problems = BufReader::new(running.stderr.take().unwrap()).lines().map(Result::unwrap);
    support::until("a batch", || it.done("there") > 0);
    cluster.kill_scheduler();
    assert!(it.done("there") < 13, "batches are under way");
    let noticed = problems.find(|line| line.starts_with("a batch is sent again"));
    assert!(noticed.is_some(), "the driver ends without a scheduler");
    cluster.start_scheduler();
    let (status, told, _) = said(running.wait_with_output().unwrap());
    assert_eq!(status, 1, "{told}{}{}", problems.collect::<Vec<_>>().join("\n"), cluster.logs());
    assert_eq!(it.files("there"), it.files("here"));
}

/// The driver is killed at any batch: what it had written stays, and the next run does the others.
#[test]
fn a_driver_that_dies_is_started_again() {
    let it = Factory::new(8);
    it.calibrate("units", "here", &[]);
    let cluster = Cluster::new(1);
    let url = cluster.url();
    for _ in 1..4 {
        let mut command = it.command("units", "there", &["--cluster", &url, "--batch", "1"]);
        let mut running = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let before = it.done("there");
        support::until("a batch", || it.done("there") > before);
        let _ = running.kill();
        let _ = running.wait();
    }
    let (status, told, problems) = it.calibrate("units", "there", &["--cluster", &url]);
    assert_eq!(status, 1, "{problems}");
    assert!(told.contains("unchanged since before"), "{told}");
    assert_eq!(it.files("there"), it.files("here"));
}

/// Nobody there: an error that says what to do, and exit status 2. Two drivers at one folder: the second is refused.
#[test]
fn what_cannot_be_done_is_refused() {
    let it = Factory::new(1);
    let (status, _, problems) = it.calibrate("units", "there", &["--cluster", "no address"]);
    assert!(status == 2 && problems.contains("no address"), "{problems}");
    std::fs::create_dir_all(it.path("taken")).unwrap();
    let lock = std::fs::File::create(it.path("taken/lock")).unwrap();
    lock.lock().unwrap();
    let (status, _, problems) = it.calibrate("units", "taken", &["--cluster", "df://127.0.0.1:9"]);
    assert!(status == 2 && problems.contains("another program writes into this folder"), "{problems}");
}

/// Questions to the table, as a table and as CSV; what is no question is refused.
#[test]
fn the_table_answers_questions() {
    let it = Factory::new(3);
    it.calibrate("units", "here", &[]);
    let ask = |more: &[&str]| said(Command::new(PROGRAM).arg("sql").arg(it.path("here")).args(more).output().unwrap());
    let question = "SELECT outcome, count(*) AS units FROM fleet GROUP BY outcome ORDER BY outcome";
    let (status, answer, problems) = ask(&[question, "--csv"]);
    assert!(status == 0 && answer == "outcome,units\ncalibrated,3\nfailed,1\n", "{answer}{problems}");
    let (status, answer, _) = ask(&[question]);
    assert!(status == 0 && answer.contains("| calibrated | 3     |"), "{answer}");
    for wrong in ["DROP TABLE fleet", "COPY fleet TO 'there.csv'", "SELECT nothing FROM fleet", ""] {
        let (status, _, problems) = ask(&[wrong]);
        assert!(status == 2 && problems.contains("the query failed"), "{wrong}: {problems}");
    }
    assert!(!it.path("there.csv").exists());
}
