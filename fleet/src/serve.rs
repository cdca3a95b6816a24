//! `sagnac-fleet scheduler` and `sagnac-fleet executor`: Ballista's own, with the function of one unit registered.
//!
//! An executor that says nothing for [`DEAD_S`] counts as dead, and its units are done again by the others. Neither asks who sends it a job:
//! they belong on a network of their own, and are on this machine's loopback unless another address is given.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;

use ballista_core::registry::BallistaFunctionRegistry;
use ballista_executor::executor_process::{ExecutorProcessConfig, start_executor_process};
use ballista_scheduler::cluster::BallistaCluster;
use ballista_scheduler::config::SchedulerConfig;
use ballista_scheduler::scheduler_process::start_server;
use datafusion::common::Result as EngineResult;
use datafusion::execution::{FunctionRegistry, SessionState};
use datafusion::prelude::SessionConfig;
use sagnac::{Error, Result};
use sagnac_log::memory::MemoryBudget;

use crate::function::calibrate_unit;
use crate::store::Patience;

/// Interval of the heartbeat of an executor, and the time after which it counts as dead, s.
const HEARTBEAT_S: u64 = 2;
const DEAD_S: u64 = 15;
/// Interval of the checks of executors, s.
const LOOK_S: u64 = 3;
/// Longest wait of an executor for its scheduler, s.
const CONNECT_S: u16 = 60;
/// A unit that this many executors died of has failed.
const MOST_FAILURES: usize = 4;

/// Run the scheduler of a cluster
#[derive(clap::Args)]
pub(crate) struct SchedulerArgs {
    /// Address to listen on
    #[arg(long, default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    bind: IpAddr,
    /// Port to listen on
    #[arg(long, default_value_t = 50050)]
    port: u16,
}

/// Run an executor of a cluster: all executors read the logs by the same paths or from the same object store
#[derive(clap::Args)]
pub(crate) struct ExecutorArgs {
    /// The scheduler, as host:port
    #[arg(long, default_value = "127.0.0.1:50050", value_name = "HOST:PORT")]
    scheduler: String,
    /// Address to listen on
    #[arg(long, default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    bind: IpAddr,
    /// Name or address for the other machines [default: that of --bind]
    #[arg(long, value_name = "HOST")]
    host: Option<String>,
    /// Port for results; the next port takes orders
    #[arg(long, default_value_t = 50051)]
    port: u16,
    /// Units at a time [default: one for each processor]
    #[arg(long, value_name = "N")]
    slots: Option<std::num::NonZeroUsize>,
    /// Folder for answers until they are fetched [default: a temporary one]
    #[arg(long, value_name = "FOLDER")]
    work: Option<PathBuf>,
    /// Memory for the data of one unit, such as 512MiB [default: 1GiB]
    #[arg(long, value_name = "SIZE")]
    memory: Option<bytesize::ByteSize>,
    #[command(flatten)]
    patience: Patience,
}

fn told(e: impl std::fmt::Display) -> Error {
    Error::input(format!("the engine has ended: {e}"), "start it again, and read its log for the cause")
}

pub(crate) fn scheduler(args: &SchedulerArgs) -> Result<()> {
    let config = SchedulerConfig {
        bind_host: args.bind.to_string(),
        external_host: args.bind.to_string(),
        bind_port: args.port,
        executor_timeout_seconds: DEAD_S,
        expire_dead_executor_interval_seconds: LOOK_S,
        no_executors_grace_period_seconds: u64::from(CONNECT_S),
        task_max_failures: MOST_FAILURES,
        stage_max_failures: MOST_FAILURES,
        override_session_builder: Some(Arc::new(session)),
        override_config_producer: Some(Arc::new(crate::cluster::session_config)),
        ..SchedulerConfig::default()
    };
    let address = SocketAddr::new(args.bind, args.port);
    crate::runtime()?.block_on(async {
        let cluster = BallistaCluster::new_from_config(&config).await.map_err(told)?;
        eprintln!("scheduler at {address}");
        tokio::select! {
            ended = start_server(cluster, address, Arc::new(config)) => ended.map_err(told),
            _ = tokio::signal::ctrl_c() => Ok(()),
        }
    })
}

/// What plans jobs: the function by its name; it is never called there.
fn session(config: SessionConfig) -> EngineResult<SessionState> {
    let mut state = ballista_core::utils::default_session_builder(config)?;
    state.register_udf(calibrate_unit(Patience::default(), MemoryBudget::default()))?;
    Ok(state)
}

pub(crate) fn executor(args: &ExecutorArgs) -> Result<()> {
    let (host, port) = args
        .scheduler
        .rsplit_once(':')
        .and_then(|(host, port)| Some((host.to_owned(), port.parse::<u16>().ok()?)))
        .ok_or_else(|| {
            Error::input("not an address", "write it as HOST:PORT, such as --scheduler localhost:50050")
                .column("--scheduler")
                .value(&args.scheduler)
        })?;
    let orders = args
        .port
        .checked_add(1)
        .ok_or_else(|| Error::input("no port follows this one", "give a port below 65535").column("--port"))?;
    let mut functions = BallistaFunctionRegistry::default();
    let memory = match args.memory {
        Some(size) => MemoryBudget::of_bytes(size.as_u64()).ok_or_else(|| {
            let least = bytesize::ByteSize(MemoryBudget::LEAST);
            Error::input(format!("a unit needs at least {least}"), format!("set --memory {least} or more"))
                .column("--memory")
                .value(size.to_string())
        })?,
        None => MemoryBudget::default(),
    };
    let function = calibrate_unit(args.patience, memory);
    functions.scalar_functions.insert(crate::function::NAME.to_owned(), function);
    let slots = args.slots.or_else(|| std::thread::available_parallelism().ok()).map_or(1, std::num::NonZeroUsize::get);
    let config = ExecutorProcessConfig {
        bind_host: args.bind.to_string(),
        external_host: Some(args.host.clone().unwrap_or_else(|| args.bind.to_string())),
        port: args.port,
        grpc_port: orders,
        scheduler_host: host,
        scheduler_port: port,
        scheduler_connect_timeout_seconds: CONNECT_S,
        vcores: slots,
        work_dir: args.work.as_ref().map(|folder| folder.display().to_string()),
        executor_heartbeat_interval_seconds: HEARTBEAT_S,
        // Answers are fetched within minutes; their files need not stay.
        job_data_ttl_seconds: 3600,
        job_data_clean_up_interval_seconds: 600,
        override_function_registry: Some(Arc::new(functions)),
        override_config_producer: Some(Arc::new(crate::cluster::session_config)),
        ..ExecutorProcessConfig::default()
    };
    eprintln!("executor at {}:{} of {}", args.bind, args.port, args.scheduler);
    crate::runtime()?.block_on(start_executor_process(Arc::new(config))).map_err(told)
}
