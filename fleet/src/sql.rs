//! `sagnac-fleet sql`: questions to the table of a fleet.

use std::io::Write;
use std::path::PathBuf;

use datafusion::arrow::util::pretty::pretty_format_batches;
use datafusion::prelude::{ParquetReadOptions, SessionContext};
use sagnac::fleet::TABLE;
use sagnac::{Error, Result};

/// Query the table of a fleet, `fleet`, with SQL
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac-fleet sql fleet/ \"SELECT lot, count(*), avg(residual_dph) FROM fleet GROUP BY lot ORDER BY lot\"
  sagnac-fleet sql fleet/ \"SELECT unit, reason FROM fleet WHERE outcome <> 'calibrated'\"")]
pub(crate) struct Args {
    /// Folder of `fleet calibrate`, or its fleet.parquet
    fleet: PathBuf,
    /// SQL query
    query: String,
    /// Comma-separated values instead of a table
    #[arg(long)]
    csv: bool,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    let table = if args.fleet.is_dir() { args.fleet.join(TABLE) } else { args.fleet.clone() };
    if !table.is_file() {
        return Err(Error::input("there is no table of a fleet", "give the folder that `fleet calibrate` wrote")
            .file(table.display().to_string()));
    }
    let name = table.to_str().ok_or_else(|| Error::input("the name is not Unicode", "rename the file"))?;
    let batches = crate::runtime()?.block_on(async {
        let context = SessionContext::new();
        context.register_parquet("fleet", name, ParquetReadOptions::default()).await?;
        // Only questions: a table of results is written by `calibrate` alone.
        let options = datafusion::execution::context::SQLOptions::new()
            .with_allow_ddl(false)
            .with_allow_dml(false)
            .with_allow_statements(false);
        context.sql_with_options(&args.query, options).await?.collect().await
    });
    let batches = batches.map_err(|e| {
        Error::input(
            format!("the query failed: {}", e.strip_backtrace()),
            "correct the query: SELECT * FROM fleet LIMIT 5 shows the columns",
        )
    })?;
    let broken = |e: &dyn std::fmt::Display| Error::defect(format!("the answer cannot be shown: {e}"));
    if !args.csv {
        let table = pretty_format_batches(&batches).map_err(|e| broken(&e))?;
        // A reader that has gone is no failure.
        let _ = writeln!(std::io::stdout(), "{table}");
        return Ok(());
    }
    let mut out = datafusion::arrow::csv::Writer::new(std::io::stdout().lock());
    batches.iter().try_for_each(|batch| out.write(batch)).map_err(|e| broken(&e))
}
