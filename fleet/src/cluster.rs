//! Units through a cluster: sent as a plan, done where there is room, and written here as they come back.
//!
//! ```text
//! batch of units ─▶ VALUES (place, unit) ─▶ calibrate_unit(recipe, unit) ─▶ UNION of all: a task each ─▶ answers
//! ```
//!
//! The manifest travels in the plan, as values, so that executors need to see logs alone. A leaf of values is one of those that Ballista 55
//! restricts to a task's own part; a leaf of our own is not, and was seen to answer 36 rows for 6. Units are sent in batches, some at a
//! time: what a batch has answered is on disk before the next one goes, a scheduler that is started again loses the batches under way alone,
//! and these are sent again. An executor that dies is the scheduler's concern: it gives its tasks to the others.

use std::sync::Arc;
use std::time::Duration;

use backon::{ExponentialBuilder, Retryable};
use ballista::prelude::SessionContextExt;
use ballista_core::config::BALLISTA_SCHEDULER_MAX_PARTITIONS_PER_TASK;
use ballista_core::extension::SessionConfigExt;
use datafusion::arrow::array::RecordBatch;
use datafusion::common::cast::{as_int64_array, as_string_array};
use datafusion::common::{DataFusionError, Result as EngineResult};
use datafusion::execution::FunctionRegistry;
use datafusion::execution::session_state::SessionStateBuilder;
use datafusion::logical_expr::{LogicalPlan, LogicalPlanBuilder, Union, col, lit};
use datafusion::prelude::{SessionConfig, SessionContext};
use futures::stream::{StreamExt, TryStreamExt};
use sagnac::fleet::{Answer, Done, Recipe, Results, Unit};
use sagnac::{Error, Result};
use sagnac_log::memory::MemoryBudget;

use crate::function::{Asked, calibrate_unit};
use crate::store::{Patience, is_object};

/// Batches under way: while the last units of one are done, those of the next keep the other executors busy.
const UNDER_WAY: usize = 2;
/// A batch is sent again so often, after pauses that double from one second to half a minute.
const SENT_AGAIN: usize = 8;

/// How a cluster is asked.
pub(crate) struct Cluster<'a> {
    /// The scheduler, df://host:port.
    pub(crate) url: &'a str,
    /// Units in a batch.
    pub(crate) batch: usize,
    /// Units in a task, one after the other.
    pub(crate) per_task: usize,
}

/// The session of all sides: a task a unit, and no plan made again on the way.
pub(crate) fn session_config() -> SessionConfig {
    SessionConfig::new_with_ballista()
        .with_batch_size(1)
        .with_target_partitions(1)
        .with_round_robin_repartition(false)
        .with_repartition_file_scans(false)
        .with_ballista_adaptive_query_planner(false)
        .set_usize(BALLISTA_SCHEDULER_MAX_PARTITIONS_PER_TASK, 1)
}

/// Does all units by a cluster; `report` is called with each as it is done.
///
/// # Errors
/// A folder that cannot be written; a cluster that cannot be reached, or that fails a batch again and again.
pub(crate) fn calibrate(
    cluster: &Cluster<'_>,
    units: &[Unit],
    recipe: &Recipe,
    again: bool,
    results: &Results,
    mut report: impl FnMut(Done),
) -> Result<()> {
    let recipe = recipe.to_json()?;
    let sent: Vec<Unit> = units.iter().map(absolute).collect::<Result<_>>()?;
    crate::runtime()?.block_on(async {
        let places: Vec<usize> = (0..units.len()).collect();
        let answered = futures::stream::iter(places.chunks(cluster.batch.max(1)))
            .map(|places| answers_of(cluster, &sent, places, &recipe, again, results))
            .buffered(UNDER_WAY);
        let mut answered = std::pin::pin!(answered);
        while let Some(answers) = answered.try_next().await? {
            for (place, mut answer) in answers {
                let unit = &units[place];
                answer.rename(&names_of(unit, &sent[place]));
                let before = results.before(unit).filter(|_| !again);
                let (result, is_kept) = results.take(unit, before, answer)?;
                report(Done { place, result, is_kept });
            }
        }
        Ok(())
    })
}

/// A unit by names that hold in any folder: an executor has its own.
fn absolute(unit: &Unit) -> Result<Unit> {
    let mut unit = unit.clone();
    for path in unit.runs.iter_mut().chain(&mut unit.retests).chain(&mut unit.setup).filter(|path| !is_object(path)) {
        *path = std::path::absolute(&*path).map_err(|e| Error::io_path(path, "find", &e))?;
    }
    Ok(unit)
}

/// The names of a unit's files as they were sent, and as they were given.
fn names_of(given: &Unit, sent: &Unit) -> Vec<(String, String)> {
    let names = |unit: &Unit| -> Vec<String> {
        unit.runs.iter().chain(&unit.retests).chain(&unit.setup).map(|path| path.display().to_string()).collect()
    };
    names(sent).into_iter().zip(names(given)).collect()
}

/// What the engine says, in one line.
fn words(error: &DataFusionError) -> String {
    error.strip_backtrace().lines().next().unwrap_or_default().chars().take(160).collect()
}

/// A batch, sent until it is answered.
async fn answers_of(
    cluster: &Cluster<'_>,
    units: &[Unit],
    places: &[usize],
    recipe: &str,
    again: bool,
    results: &Results,
) -> Result<Vec<(usize, Answer)>> {
    let asked = |place: &usize| {
        let unit = units[*place].clone();
        let before = results.before(&unit).filter(|_| !again).map(|before| before.key);
        serde_json::to_string(&Asked { unit, before })
            .map(|text| (*place, text))
            .map_err(|e| Error::defect(format!("cannot send a unit: {e}")))
    };
    let asked: Vec<(usize, String)> = places.iter().map(asked).collect::<Result<_>>()?;
    let pauses = ExponentialBuilder::default()
        .with_min_delay(Duration::from_secs(1))
        .with_max_delay(Duration::from_secs(30))
        .with_max_times(SENT_AGAIN);
    let sent = || async { answers(&sent(cluster, &asked, recipe).await?, places) };
    sent.retry(pauses)
        .when(|e| !matches!(e, DataFusionError::Configuration(_)))
        .notify(|e: &DataFusionError, pause: Duration| {
            eprintln!("a batch is sent again in {:.0} s: {}", pause.as_secs_f64(), words(e));
        })
        .await
        .map_err(|e| {
            Error::input(
                format!("the cluster failed: {}", words(&e)),
                "start the scheduler and its executors, and run the command again: finished units are kept",
            )
            .value(cluster.url)
        })
}

/// One try of a batch.
async fn sent(cluster: &Cluster<'_>, asked: &[(usize, String)], recipe: &str) -> EngineResult<Vec<RecordBatch>> {
    let state = SessionStateBuilder::new().with_default_features().with_config(session_config()).build();
    let context = SessionContext::remote_with_state(cluster.url, state).await?;
    let function = calibrate_unit(Patience::default(), MemoryBudget::default());
    context.state_ref().write().register_udf(function.clone())?;
    let of_task = |units: &[(usize, String)]| -> EngineResult<Arc<LogicalPlan>> {
        let row =
            |(place, text): &(usize, String)| vec![lit(i64::try_from(*place).unwrap_or(i64::MAX)), lit(text.as_str())];
        let answer = function.call(vec![lit(recipe), col("column2")]);
        let values = LogicalPlanBuilder::values(units.iter().map(row).collect())?;
        let plan = values.project(vec![col("column1").alias("place"), answer.alias("answer")])?;
        plan.build().map(Arc::new)
    };
    let plans: Vec<Arc<LogicalPlan>> =
        asked.chunks(cluster.per_task.max(1)).map(of_task).collect::<EngineResult<_>>()?;
    let plan = match <[Arc<LogicalPlan>; 1]>::try_from(plans) {
        Ok([one]) => Arc::unwrap_or_clone(one),
        Err(plans) => LogicalPlan::Union(Union::try_new_with_loose_types(plans)?),
    };
    context.execute_logical_plan(plan).await?.collect().await
}

/// The answers of a batch: each unit's once, or the batch is not answered.
fn answers(batches: &[RecordBatch], places: &[usize]) -> EngineResult<Vec<(usize, Answer)>> {
    let mut all = Vec::new();
    for batch in batches {
        let (place, answer) = (as_int64_array(batch.column(0))?, as_string_array(batch.column(1))?);
        for row in 0..batch.num_rows() {
            let answer = serde_json::from_str(answer.value(row))
                .map_err(|e| DataFusionError::Execution(format!("an executor's answer is none: {e}")))?;
            all.push((usize::try_from(place.value(row)).unwrap_or(usize::MAX), answer));
        }
    }
    all.sort_by_key(|(place, _)| *place);
    if all.iter().map(|(place, _)| place).ne(places) {
        let what = format!("{} answers for {} units", all.len(), places.len());
        return Err(DataFusionError::Execution(what));
    }
    Ok(all)
}
