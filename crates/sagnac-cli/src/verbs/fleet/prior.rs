//! `sagnac fleet prior`: what a fleet says of the next unit.

use std::path::{Path, PathBuf};

use sagnac::fleet::{Prior, parts_of, results_in};
use sagnac::{Error, Result};
use sagnac_log::write::write_bytes;
use sagnac_units::format::{celsius, counted, significant, unit};

use crate::files::Files;
use crate::output::console::{Console, Outcome, Ran};
use crate::output::terminal::table;
use crate::verbs::verb::Verb;

/// Learn the coefficients to expect of the next unit
///
/// Mean and covariance of the units' coefficients on the common basis, without test errors and outliers.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac fleet prior fleet/ -o fleet.prior.json
  sagnac fleet prior fleet/ --without-rig west -o fleet.prior.json
  sagnac fleet prior here.prior.json there.prior.json -o both.prior.json")]
pub(crate) struct Args {
    /// Folders of `sagnac fleet calibrate` and priors of other fleets, to merge
    #[arg(required = true, value_name = "FLEET")]
    fleets: Vec<PathBuf>,
    /// Prior to write
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Use the units with this model [default: the most frequent]
    #[arg(long)]
    model: Option<String>,
    /// Leave out the units of this rig, such as one in `fleet report`; repeatable
    #[arg(long, value_name = "RIG")]
    without_rig: Vec<String>,
    /// One JSON object on standard output, text on standard error
    #[arg(long)]
    json: bool,
}

impl Verb for Args {
    fn json(&self) -> bool {
        self.json
    }

    fn run(&self, console: &mut Console) -> Ran {
        let (folders, files): (Vec<&PathBuf>, Vec<&PathBuf>) = self.fleets.iter().partition(|fleet| fleet.is_dir());
        let parts = folders.into_iter().flat_map(|folder| parts_of(folder));
        Files::new().reads(files).reads_all_in(parts).writes(&self.output).check()?;
        let mut all: Option<Prior> = None;
        for fleet in &self.fleets {
            let one = of(fleet, self)?;
            all = Some(match all {
                Some(all) => all.merged(one).map_err(|e| e.file(fleet.display().to_string()))?,
                None => one,
            });
        }
        let prior =
            all.ok_or_else(|| Error::input("no fleet is given", "give a folder of `sagnac fleet calibrate`"))?;
        console.say(described(&prior));
        if let Some(path) = &self.output {
            write_bytes(path, prior.to_json()?.as_bytes())?;
            console.say(format!("wrote {}", path.display()));
        }
        console.object(&prior)?;
        Ok(Outcome::Done)
    }
}

fn of(fleet: &Path, args: &Args) -> Result<Prior> {
    let here = |e: Error| e.file(fleet.display().to_string());
    if !fleet.is_dir() {
        let prior = Prior::read(fleet)?;
        if let Some(rig) = args.without_rig.first() {
            return Err(here(
                Error::input("a prior does not contain the rigs of its units", "give the fleet's folder")
                    .column("--without-rig")
                    .value(rig),
            ));
        }
        return match &args.model {
            Some(model) if *model != prior.model => Err(here(Error::input(
                format!("the prior is for `{}`, not for `{model}`", prior.model),
                format!("set --model to `{}`, or give the fleet's folder", prior.model),
            ))),
            _ => Ok(prior),
        };
    }
    let mut results = results_in(fleet)?;
    for rig in &args.without_rig {
        let before = results.len();
        results.retain(|unit| unit.rig != *rig);
        if results.len() == before {
            return Err(here(
                Error::input(
                    "no unit of the fleet has this rig",
                    "give a rig name from the column `rig` of the fleet's manifest",
                )
                .column("--without-rig")
                .value(rig),
            ));
        }
    }
    Prior::learned(&results, args.model.as_deref()).map_err(here)
}

/// Terms in a table, then the lots, and what was not used.
fn described(prior: &Prior) -> String {
    let [lo, hi] = prior.span_c.map(celsius);
    let axes = counted(usize::try_from(prior.fleet.axes).unwrap_or(usize::MAX), "axis", "axes");
    let mut out = format!(
        "prior for `{}` of {axes}, {lo} … {hi} °C; they differ beyond their tests in {} of {} directions\n",
        prior.model,
        prior.fleet.directions,
        prior.terms.len()
    );
    let rows = prior.terms.iter().enumerate().map(|(at, term)| {
        let within = prior.within_lots.as_ref().map_or("-".to_owned(), |within| significant(within.sigma(at), 3));
        let of_tests = significant(prior.fleet.sigma_of_tests(at), 3);
        vec![
            term.clone(),
            significant(prior.fleet.mean[at], 4),
            significant(prior.fleet.sigma(at), 3),
            within,
            of_tests,
            unit(&prior.units[at]),
        ]
    });
    out += &table(&["term", "mean", "σ of units", "σ within lots", "σ of their tests", "unit"], rows);
    if prior.within_lots.is_some() {
        let lots: Vec<String> = prior.lots.iter().map(|lot| format!("{} ({})", lot.lot, lot.axes)).collect();
        out += &format!("\n  lots: {}", lots.join(", "));
    }
    for part in &prior.not_used {
        let name = if part.axis.is_empty() { part.axes.to_string() } else { part.axis.clone() };
        out += &format!("\n  not used: {name}, {}", part.reason);
    }
    out
}
