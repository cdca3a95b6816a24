//! Units in an object store, SeaweedFS: the same bytes as from a folder, also from a store that is busy, silent or cuts an answer short.

mod support;

use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use object_store::aws::AmazonS3Builder;
use object_store::path::Path as Key;
use object_store::{ObjectStore, ObjectStoreExt};
use support::{Cluster, Factory, Process, answers, free_ports, said, until};
use tempfile::TempDir;

const BUCKET: &str = "rlg";
const IDENTITIES: &str = r#"{"identities": [{"name": "factory", "credentials": [{"accessKey": "factory", "secretKey": "of-rings"}],
    "actions": ["Admin", "Read", "Write", "List"]}]}"#;

/// A store of its own, for as long as this is.
struct Store {
    port: u16,
    _server: Process,
    _folder: TempDir,
}

impl Store {
    fn new() -> Self {
        let weed = std::env::var_os("SAGNAC_WEED").map(PathBuf::from).filter(|path| path.exists());
        let weed =
            weed.expect("SAGNAC_WEED names the program of SeaweedFS; `cargo xtask fleet` installs it and sets it");
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("data")).unwrap();
        fs::write(folder.path().join("s3.json"), IDENTITIES).unwrap();
        let first = free_ports(8);
        let port = |at: u16| (first + at).to_string();
        let mut command = Command::new(&weed);
        command.current_dir(folder.path());
        let flags = ["server", "-dir=data", "-ip=127.0.0.1", "-ip.bind=127.0.0.1", "-master.telemetry=false"];
        command.args(flags).args([
            "-volume.max=8",
            "-master.volumeSizeLimitMB=64",
            "-filer",
            "-s3",
            "-s3.config=s3.json",
        ]);
        command.args(["-s3.port.iceberg=0", "-s3.port.lance=0"]);
        let names = ["master.port", "master.port.grpc", "volume.port", "volume.port.grpc"];
        let more = ["filer.port", "filer.port.grpc", "s3.port", "s3.port.grpc"];
        for (name, at) in names.iter().chain(&more).zip(0..) {
            command.arg(format!("-{name}={}", port(at)));
        }
        let server = Process::start(&mut command, folder.path().join("server.log"));
        until("the store", || answers(first + 6));
        let it = Self { port: first + 6, _server: server, _folder: folder };
        let mut shell = Command::new(weed);
        shell.args(["shell", &format!("-master=127.0.0.1:{}.{}", first, first + 1)]);
        shell.arg(format!("-filer=127.0.0.1:{}.{}", first + 4, first + 5));
        let mut shell = shell.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        writeln!(shell.stdin.take().unwrap(), "s3.bucket.create -name {BUCKET}").unwrap();
        let (_, out, problems) = said(shell.wait_with_output().unwrap());
        assert!(out.contains("created bucket"), "{out}{problems}");
        it
    }

    /// What `sagnac-fleet` needs to know, by the store's own port or by that of somebody in between.
    fn environment(port: u16) -> Vec<(String, String)> {
        let endpoint = format!("http://127.0.0.1:{port}");
        let all = [
            ("AWS_ENDPOINT", endpoint.as_str()),
            ("AWS_ALLOW_HTTP", "true"),
            ("AWS_REGION", "us-east-1"),
            ("AWS_ACCESS_KEY_ID", "factory"),
            ("AWS_SECRET_ACCESS_KEY", "of-rings"),
        ];
        all.map(|(name, value)| (name.to_owned(), value.to_owned())).to_vec()
    }

    /// Puts every file below `units/` of a factory into the store.
    fn fill(&self, it: &Factory) {
        let builder =
            AmazonS3Builder::new().with_endpoint(format!("http://127.0.0.1:{}", self.port)).with_allow_http(true);
        let builder = builder.with_region("us-east-1").with_access_key_id("factory").with_secret_access_key("of-rings");
        let store: Arc<dyn ObjectStore> = Arc::new(builder.with_bucket_name(BUCKET).build().unwrap());
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        for (name, bytes) in it.files("units") {
            let key = Key::from(format!("units/{}", name.display()));
            runtime.block_on(store.put(&key, bytes.into())).unwrap();
        }
        let manifest: String =
            "unit,run,lot\nRLG-0,units/RLG-0/run-1.csv,7\nRLG-0,units/RLG-0/run-2.csv,7\n".to_owned();
        runtime.block_on(store.put(&Key::from("manifest.csv"), manifest.into_bytes().into())).unwrap();
    }
}

fn calibrate(it: &Factory, source: &str, folder: &str, port: u16, more: &[&str]) -> (i32, String, String) {
    let mut command = it.command(source, folder, more);
    said(command.envs(Store::environment(port)).output().unwrap())
}

/// Somebody in between who spoils so many connections, then lets all pass.
struct Between {
    port: u16,
    spoiled: Arc<AtomicUsize>,
}

#[derive(Clone, Copy)]
enum Fault {
    /// 503 Slow Down.
    Busy,
    /// Nothing at all.
    Silent,
    /// The answer ends after so many bytes.
    Cut(usize),
}

impl Between {
    fn new(store: u16, fault: Fault, spoils: usize) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let spoiled = Arc::new(AtomicUsize::new(0));
        let count = spoiled.clone();
        thread::spawn(move || {
            for client in listener.incoming().flatten() {
                let spoil = count.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |n| (n < spoils).then_some(n + 1));
                thread::spawn(move || between(client, store, spoil.is_ok().then_some(fault)));
            }
        });
        Self { port, spoiled }
    }
}

/// One connection. What fails here is a connection that ends, which the client sees.
fn between(mut client: TcpStream, store: u16, fault: Option<Fault>) {
    if let Some(Fault::Busy) = fault {
        let mut asked = [0; 4096];
        let _ = client.read(&mut asked);
        let _ = client.write_all(b"HTTP/1.1 503 Slow Down\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
        return;
    }
    if let Some(Fault::Silent) = fault {
        // Reads what is asked until the client has had enough.
        let _ = std::io::copy(&mut client, &mut std::io::sink());
        return;
    }
    let Ok(mut server) = TcpStream::connect(("127.0.0.1", store)) else { return };
    let (Ok(mut from_client), Ok(mut to_server)) = (client.try_clone(), server.try_clone()) else { return };
    thread::spawn(move || {
        let _ = std::io::copy(&mut from_client, &mut to_server);
    });
    let _ = match fault {
        Some(Fault::Cut(bytes)) => std::io::copy(&mut (&mut server).take(bytes as u64), &mut client),
        _ => std::io::copy(&mut server, &mut client),
    };
    let _ = (client.shutdown(std::net::Shutdown::Both), server.shutdown(std::net::Shutdown::Both));
}

/// A prefix, a pattern and a manifest of a store; on threads of this machine and on executors that fetch the logs themselves.
#[test]
fn units_of_a_store_are_those_of_a_folder() {
    let it = Factory::new(4);
    let store = Store::new();
    store.fill(&it);
    let (status, told, _) = it.calibrate("units", "here", &[]);
    assert!(status == 1 && told.contains("5 units: 4 calibrated, 0 refused, 1 failed"), "{told}");
    let (status, from_store, problems) = calibrate(&it, "s3://rlg/units", "there", store.port, &[]);
    assert_eq!(status, 1, "{problems}");
    // The broken log's place is where it was given.
    assert_eq!(from_store, told.replace("here/", "there/").replace("units/RLG-99", "s3://rlg/units/RLG-99"));
    let same = |folder: &str| {
        let (mut here, mut there) = (it.files("here"), it.files(folder));
        for files in [&mut here, &mut there] {
            files.retain(|name, _| !name.ends_with("RLG-99.json") && !name.ends_with("fleet.parquet"));
        }
        assert_eq!(here, there, "{folder}");
    };
    same("there");
    let record = fs::read_to_string(it.path("there/records/RLG-1.cal.json")).unwrap();
    assert!(record.contains("\"first\": \"run-1.csv:"), "where the log lay is not part of its record: {record}");
    let cluster = Cluster::with(2, &Store::environment(store.port));
    let (status, _, problems) =
        calibrate(&it, "s3://rlg/units/", "on-cluster", store.port, &["--cluster", &cluster.url()]);
    assert_eq!(status, 1, "{problems}{}", cluster.logs());
    same("on-cluster");
    assert_eq!(it.files("there"), it.files("on-cluster"));
    let (_, again, _) = calibrate(&it, "s3://rlg/units", "there", store.port, &["--cluster", &cluster.url()]);
    assert!(again.contains("5 unchanged since before"), "{again}");
    let (status, told, problems) = calibrate(&it, "s3://rlg/units/{unit}/run-{run}.csv", "by-name", store.port, &[]);
    assert!(status == 0 && told.contains("4 units: 4 calibrated"), "{told}{problems}");
    assert_eq!(
        fs::read(it.path("by-name/records/RLG-2.cal.json")).unwrap(),
        fs::read(it.path("here/records/RLG-2.cal.json")).unwrap()
    );
    let (status, told, problems) = calibrate(&it, "s3://rlg/manifest.csv", "by-line", store.port, &[]);
    assert!(status == 0 && told.contains("1 unit: 1 calibrated"), "{told}{problems}");
    for (source, why) in [
        ("s3://rlg/nothing", "no object has this name"),
        ("s3://", "this is not the name of an object"),
        ("s3://rlg/units/{gyro}.csv", "{gyro}"),
        ("s3://rlg/units/{unit}/none-{run}.csv", "no file matches"),
    ] {
        let (status, _, problems) = calibrate(&it, source, "none", store.port, &[]);
        assert!(status == 2 && problems.contains(why) && !it.path("none").exists(), "{source}: {problems}");
    }
}

/// 503, silence and answers that are cut short: asked again, and the same bytes at the end.
#[test]
fn a_store_that_falters_is_asked_again() {
    let it = Factory::new(2);
    let store = Store::new();
    store.fill(&it);
    calibrate(&it, "s3://rlg/units", "here", store.port, &[]);
    for (name, fault, spoils) in [("busy", Fault::Busy, 6), ("silent", Fault::Silent, 3), ("cut", Fault::Cut(5000), 6)]
    {
        let between = Between::new(store.port, fault, spoils);
        let more = ["--store-silence", "1", "--store-patience", "60"];
        let (status, told, problems) = calibrate(&it, "s3://rlg/units", name, between.port, &more);
        assert_eq!(status, 1, "{name}: {told}{problems}");
        assert_eq!(between.spoiled.load(Ordering::SeqCst), spoils, "{name}");
        assert_eq!(it.files(name), it.files("here"), "{name}");
    }
}

/// A store that never answers: each unit is a row that says so, within the stated patience, and the next run does them all.
#[test]
fn a_store_that_is_gone_is_a_row_a_unit() {
    let it = Factory::new(2);
    let store = Store::new();
    store.fill(&it);
    let manifest = "unit,run\nRLG-0,s3://rlg/units/RLG-0/run-1.csv\nRLG-1,s3://rlg/units/RLG-1/run-1.csv\n";
    it.write("manifest.csv", manifest.as_bytes());
    for fault in [Fault::Silent, Fault::Busy] {
        let between = Between::new(store.port, fault, usize::MAX);
        let more = ["--store-silence", "1", "--store-patience", "3"];
        let (status, told, problems) = calibrate(&it, "manifest.csv", "there", between.port, &more);
        assert!(status == 1 && told.contains("2 units: 0 calibrated, 0 refused, 2 failed"), "{told}{problems}");
        assert!(told.contains("s3://rlg/units/RLG-0/run-1.csv: the store"), "{told}");
        assert!(!told.contains("of-rings") && !problems.contains("of-rings"), "a key in a message: {told}{problems}");
    }
    let (status, told, problems) = calibrate(&it, "manifest.csv", "there", store.port, &[]);
    assert!(status == 0 && told.contains("2 units: 2 calibrated"), "{told}{problems}");
}
