//! Logs in an object store: listed, and fetched into a folder of this machine for as long as a unit is done.
//!
//! ```text
//! s3://bucket/prefix ─list▶ names ─▶ units          s3://bucket/key ─fetch▶ a temporary folder/key's name ─▶ the reader of files
//! ```
//!
//! Readers of Parquet and of gzipped text go back and forth in a file, so that an object is spooled whole; memory holds a piece of it at a
//! time. Address and key come from the environment (`AWS_ENDPOINT`, `AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY`, `AWS_REGION`,
//! `AWS_ALLOW_HTTP`). A store that is busy (5xx) or silent is asked again for as long as [`Patience`] says; after that the unit has failed,
//! with the store's answer, and the next run does it again.

use std::collections::HashMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use backon::{BackoffBuilder, ExponentialBuilder};
use futures::TryStreamExt;
use object_store::aws::AmazonS3Builder;
use object_store::path::Path as Key;
use object_store::{BackoffConfig, ClientOptions, GetOptions, GetRange, ObjectStore, RetryConfig};
use sagnac::fleet::Unit;
use sagnac::{Error, Result};
use tempfile::TempDir;

/// Start of an object's name.
const SCHEME: &str = "s3://";
/// Longest setup or manifest, bytes.
const MOST_BYTES: u64 = 64 << 20;

/// How long a store is asked again, and how long it may be silent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, clap::Args)]
pub(crate) struct Patience {
    /// Time to retry an object store before a log counts as unreadable, s
    #[arg(long, default_value_t = 120, value_name = "SECONDS")]
    store_patience: u64,
    /// Silence of an object store before a retry, s
    #[arg(long, default_value_t = 20, value_name = "SECONDS")]
    store_silence: u64,
}

impl Patience {
    fn silence(self) -> Duration {
        Duration::from_secs(self.store_silence.max(1))
    }
}

impl Default for Patience {
    fn default() -> Self {
        Self { store_patience: 120, store_silence: 20 }
    }
}

/// True for the name of an object, or of many.
pub(crate) fn is_object(name: &Path) -> bool {
    name.to_str().is_some_and(|name| name.starts_with(SCHEME))
}

/// The stores that this program has asked.
pub(crate) struct Stores {
    patience: Patience,
    runtime: tokio::runtime::Runtime,
    known: Mutex<HashMap<String, Arc<dyn ObjectStore>>>,
}

/// A unit whose logs are files of this machine, for as long as this is.
pub(crate) struct Fetched {
    pub(crate) unit: Unit,
    folder: Option<TempDir>,
    names: Vec<(String, String)>,
}

impl Stores {
    pub(crate) fn new(patience: Patience) -> Result<Self> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|e| {
            Error::input(format!("no thread for the network: {e}"), "raise the limit of threads (`ulimit -u`)")
        })?;
        Ok(Self { patience, runtime, known: Mutex::default() })
    }

    /// Names of all objects below a prefix, or that a pattern may match.
    ///
    /// # Errors
    /// A store that does not answer, an empty prefix.
    pub(crate) fn list(&self, source: &str) -> Result<Vec<PathBuf>> {
        let (bucket, key) = parted(source)?;
        // Of a pattern the folders in front of its first sign.
        let fixed: Vec<&str> = key.split('/').take_while(|part| !part.contains(['{', '*', '?', '['])).collect();
        let prefix = Key::from(fixed.join("/"));
        let store = self.of(bucket)?;
        let keys = self.runtime.block_on(listed(&*store, &prefix, source, self.patience))?;
        if keys.is_empty() {
            return Err(Error::input(
                "no object has this name or lies below it",
                "correct the address: s3://BUCKET/FOLDER/",
            )
            .file(source));
        }
        Ok(keys.iter().map(|key| PathBuf::from(format!("{SCHEME}{bucket}/{key}"))).collect())
    }

    /// A unit with its logs and setup fetched, where they are objects.
    ///
    /// # Errors
    /// An object that cannot be read, in the words of its store.
    pub(crate) fn fetch(&self, unit: &Unit) -> Result<Fetched> {
        let mut own = unit.clone();
        if !own.runs.iter().chain(&own.retests).chain(&own.setup).any(|name| is_object(name)) {
            return Ok(Fetched { unit: own, folder: None, names: Vec::new() });
        }
        let folder = tempfile::tempdir().map_err(|e| {
            Error::input(format!("no folder for the logs: {e}"), "free space in the temporary folder, or set TMPDIR")
        })?;
        let (mut names, mut number) = (Vec::new(), 0);
        for name in own.runs.iter_mut().chain(&mut own.retests).chain(&mut own.setup).filter(|name| is_object(name)) {
            // Its own folder, since a record has the name of a log.
            number += 1;
            let path = folder.path().join(number.to_string());
            std::fs::create_dir(&path).map_err(|e| Error::io_path(&path, "make the folder", &e))?;
            let path = path.join(name.file_name().unwrap_or_default());
            self.fetch_one(&name.display().to_string(), &path, u64::MAX)?;
            names.push((path.display().to_string(), name.display().to_string()));
            *name = path;
        }
        Ok(Fetched { unit: own, folder: Some(folder), names })
    }

    /// One object as a file, for a manifest.
    pub(crate) fn fetch_manifest(&self, name: &str) -> Result<(TempDir, PathBuf)> {
        let folder = tempfile::tempdir().map_err(|e| {
            Error::input(
                format!("no folder for the manifest: {e}"),
                "free space in the temporary folder, or set TMPDIR",
            )
        })?;
        let path = folder.path().join("manifest.csv");
        self.fetch_one(name, &path, MOST_BYTES)?;
        Ok((folder, path))
    }

    fn fetch_one(&self, name: &str, path: &Path, most: u64) -> Result<()> {
        let (bucket, key) = parted(name)?;
        let store = self.of(bucket)?;
        let file = File::create(path).map_err(|e| Error::io_path(path, "write", &e))?;
        let mut object = Object { name, key: Key::from(key), most, file, had: 0, of: None };
        self.runtime.block_on(object.fetch(&*store, self.patience))
    }

    fn of(&self, bucket: &str) -> Result<Arc<dyn ObjectStore>> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(store) = known.get(bucket) {
            return Ok(store.clone());
        }
        let silence = self.patience.silence();
        let retry = RetryConfig {
            backoff: BackoffConfig { init_backoff: Duration::from_millis(200), max_backoff: silence, base: 2.0 },
            max_retries: usize::MAX,
            retry_timeout: silence,
        };
        // An object is timed by its pieces, in `Object::go_on`: a large log on a slow line is no fault.
        let client = ClientOptions::new().with_connect_timeout(silence).with_timeout_disabled();
        let builder =
            AmazonS3Builder::from_env().with_bucket_name(bucket).with_retry(retry).with_client_options(client);
        let builder = if std::env::var("AWS_ALLOW_HTTP").is_ok_and(|value| value == "true" || value == "1") {
            builder.with_allow_http(true)
        } else {
            builder
        };
        let store = builder.build().map_err(|e| {
            Error::input(
                format!("the object store cannot be reached with these settings: {e}"),
                "correct AWS_ENDPOINT, AWS_REGION, AWS_ACCESS_KEY_ID or AWS_SECRET_ACCESS_KEY",
            )
        })?;
        let store: Arc<dyn ObjectStore> = Arc::new(store);
        known.insert(bucket.to_owned(), store.clone());
        Ok(store)
    }
}

/// The keys below a prefix. A listing is begun again where its store falters.
async fn listed(store: &dyn ObjectStore, prefix: &Key, source: &str, patience: Patience) -> Result<Vec<Key>> {
    let once = async || -> std::result::Result<Vec<Key>, Failure> {
        let mut objects = store.list(Some(prefix));
        let mut keys = Vec::new();
        loop {
            let next = tokio::time::timeout(patience.silence(), objects.try_next()).await;
            let next = next.map_err(|_| {
                Failure::Again(
                    Error::input("the store is silent", "check the network, and run the command again").file(source),
                )
            })?;
            match next.map_err(|e| Failure::of(source, &e))? {
                Some(object) => keys.push(object.location),
                None => return Ok(keys),
            }
        }
    };
    let mut asked = Asked::new(patience);
    loop {
        match once().await {
            Ok(keys) => return Ok(keys),
            Err(failure) => asked.again(failure).await?,
        }
    }
}

/// An object on its way into a file.
struct Object<'a> {
    name: &'a str,
    key: Key,
    most: u64,
    file: File,
    /// Bytes that are in the file.
    had: u64,
    /// Size and tag, once they are known: all bytes are of one object.
    of: Option<(u64, Option<String>)>,
}

impl Object<'_> {
    /// Goes on where it was, until it is whole or the store has given nothing for as long as its patience.
    async fn fetch(&mut self, store: &dyn ObjectStore, patience: Patience) -> Result<()> {
        let (mut asked, mut had) = (Asked::new(patience), 0);
        while let Err(failure) = self.go_on(store, patience.silence()).await {
            if self.had > had {
                (asked, had) = (Asked::new(patience), self.had);
            }
            asked.again(failure).await?;
        }
        Ok(())
    }

    /// One request, from where the file ends.
    async fn go_on(&mut self, store: &dyn ObjectStore, silence: Duration) -> std::result::Result<(), Failure> {
        let asked = GetOptions {
            range: (self.had > 0).then_some(GetRange::Offset(self.had)),
            if_match: self.of.as_ref().and_then(|(_, tag)| tag.clone()),
            ..GetOptions::default()
        };
        let silent = |_| {
            Failure::Again(
                Error::input("the store is silent", "check the network, and run the command again").file(self.name),
            )
        };
        let object = tokio::time::timeout(silence, store.get_opts(&self.key, asked)).await.map_err(silent)?;
        let object = object.map_err(|e| Failure::of(self.name, &e))?;
        let size = object.meta.size;
        if size > self.most {
            return Err(Failure::Final(
                Error::input(
                    format!("the object has {size} bytes, and the limit is {}", self.most),
                    "split the log into smaller objects",
                )
                .file(self.name),
            ));
        }
        self.of = Some((size, object.meta.e_tag.clone()));
        let mut pieces = object.into_stream();
        loop {
            let silent = |_| {
                Failure::Again(
                    Error::input("the store is silent", "check the network, and run the command again").file(self.name),
                )
            };
            let piece = tokio::time::timeout(silence, pieces.try_next()).await.map_err(silent)?;
            let Some(piece) = piece.map_err(|e| Failure::of(self.name, &e))? else { break };
            let written = self.file.write_all(&piece);
            written.map_err(|e| {
                Failure::Final(
                    Error::input(
                        format!("no room for the log: {e}"),
                        "free space in the temporary folder, or set TMPDIR",
                    )
                    .file(self.name),
                )
            })?;
            self.had += piece.len() as u64;
        }
        if self.had == size {
            return Ok(());
        }
        Err(Failure::Again(
            Error::input(format!("the object ended after {} of {size} bytes", self.had), "run the command again")
                .file(self.name),
        ))
    }
}

/// A store that is asked again, after pauses that double.
struct Asked {
    until: Instant,
    pauses: backon::ExponentialBackoff,
}

impl Asked {
    fn new(patience: Patience) -> Self {
        let pauses = ExponentialBuilder::default().with_min_delay(Duration::from_millis(200));
        let pauses = pauses.with_max_delay(patience.silence()).with_max_times(usize::MAX).build();
        Self { until: Instant::now() + Duration::from_secs(patience.store_patience), pauses }
    }

    /// Waits, or fails where it would fail again or patience has ended.
    async fn again(&mut self, failure: Failure) -> Result<()> {
        match failure {
            Failure::Again(_) if Instant::now() < self.until => {
                tokio::time::sleep(self.pauses.next().unwrap_or_default()).await;
                Ok(())
            }
            Failure::Again(error) | Failure::Final(error) => Err(error),
        }
    }
}

/// Why a request has failed.
enum Failure {
    /// It would fail again.
    Final(Error),
    /// The store may answer another time.
    Again(Error),
}

impl Failure {
    fn of(name: &str, error: &object_store::Error) -> Self {
        let what = failed(name, error);
        match error {
            object_store::Error::NotFound { .. }
            | object_store::Error::PermissionDenied { .. }
            | object_store::Error::Unauthenticated { .. }
            | object_store::Error::InvalidPath { .. } => Self::Final(what),
            object_store::Error::Precondition { .. } => Self::Final(
                Error::input("the object was replaced while it was read", "run the command again after the upload")
                    .file(name),
            ),
            _ => Self::Again(what),
        }
    }
}

impl Fetched {
    /// Files, with the names of their objects.
    pub(crate) fn names(&self) -> &[(String, String)] {
        &self.names
    }

    /// Removes the files; a failure to do so is no failure of the unit.
    pub(crate) fn close(self) {
        drop(self.folder);
    }
}

fn parted(name: &str) -> Result<(&str, &str)> {
    let parts = name.strip_prefix(SCHEME).map(|rest| rest.split_once('/').unwrap_or((rest, "")));
    parts
        .filter(|(bucket, _)| !bucket.is_empty())
        .ok_or_else(|| Error::input("this is not the name of an object", "write it like s3://bucket/prefix").file(name))
}

/// What a store said, without what it was asked with.
fn failed(name: &str, error: &object_store::Error) -> Error {
    let what = match error {
        object_store::Error::NotFound { .. } => "the store has no such object".to_owned(),
        object_store::Error::PermissionDenied { .. } | object_store::Error::Unauthenticated { .. } => {
            "the store refuses it to this key".to_owned()
        }
        error => format!("the store cannot give it: {error}"),
    };
    Error::input(what, "check the name and the credentials of the store").file(name)
}
