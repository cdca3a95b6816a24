//! `calibrate_unit(recipe, unit)`: the function of one unit, as the engine calls it.
//!
//! Both arguments and the answer are JSON: [`Recipe::to_json`], [`Asked`], [`Answer`]. Whatever goes wrong with a unit is an answer, for an
//! error here would end the job of all others. The function is volatile, so that no planner computes it where the plan is made.

use std::sync::Arc;

use datafusion::arrow::array::{Array, ArrayRef, StringArray};
use datafusion::arrow::datatypes::DataType;
use datafusion::common::cast::as_string_array;
use datafusion::common::{Result as EngineResult, exec_err};
use datafusion::logical_expr::{ColumnarValue, ScalarFunctionArgs, ScalarUDF, ScalarUDFImpl, Signature, Volatility};
use sagnac::fleet::{Answer, Recipe, Unit, answer, by_one_thread};
use sagnac::{Error, Result};
use sagnac_log::memory::MemoryBudget;
use serde::{Deserialize, Serialize};

use crate::store::{Patience, Stores};

/// Name of the function in a plan.
pub(crate) const NAME: &str = "calibrate_unit";

/// A unit, and the key that it has from before.
#[derive(Serialize, Deserialize)]
pub(crate) struct Asked {
    pub(crate) unit: Unit,
    pub(crate) before: Option<String>,
}

/// The function on an executor; on a scheduler and in a driver the same, where it is never called.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct CalibrateUnit {
    signature: &'static Signature,
    patience: Patience,
    memory: MemoryBudget,
}

/// The function, for who plans and for who executes.
pub(crate) fn calibrate_unit(patience: Patience, memory: MemoryBudget) -> Arc<ScalarUDF> {
    static SIGNATURE: std::sync::LazyLock<Signature> =
        std::sync::LazyLock::new(|| Signature::exact(vec![DataType::Utf8, DataType::Utf8], Volatility::Volatile));
    Arc::new(ScalarUDF::new_from_impl(CalibrateUnit { signature: &SIGNATURE, patience, memory }))
}

impl ScalarUDFImpl for CalibrateUnit {
    fn name(&self) -> &str {
        NAME
    }

    fn signature(&self) -> &Signature {
        self.signature
    }

    fn return_type(&self, _: &[DataType]) -> EngineResult<DataType> {
        Ok(DataType::Utf8)
    }

    fn invoke_with_args(&self, args: ScalarFunctionArgs) -> EngineResult<ColumnarValue> {
        let arrays = ColumnarValue::values_to_arrays(&args.args)?;
        let [recipes, units] = &arrays[..] else { return exec_err!("{NAME} has two arguments") };
        let (recipes, units) = (as_string_array(recipes)?, as_string_array(units)?);
        let one = |row: usize| self.answered(recipes.value(row), units.value(row));
        let answers: StringArray = (0..units.len()).map(|row| Some(one(row))).collect();
        Ok(ColumnarValue::Array(Arc::new(answers) as ArrayRef))
    }
}

impl CalibrateUnit {
    /// On a thread of its own: the engine's threads have small stacks, and must answer their scheduler.
    fn answered(&self, recipe: &str, asked: &str) -> String {
        let work = || by_one_thread(|| self.answer(recipe, asked));
        let answer = std::thread::scope(|scope| {
            let thread = std::thread::Builder::new().stack_size(sagnac_log::threads::STACK_BYTES);
            match thread.spawn_scoped(scope, work) {
                Ok(thread) => {
                    thread.join().unwrap_or_else(|_| failed(asked, Error::defect("a unit ended without a result")))
                }
                Err(e) => failed(
                    asked,
                    Error::input(
                        format!("the machine allows no thread for a unit: {e}"),
                        "raise the limit of threads (`ulimit -u`), or lower --threads",
                    ),
                ),
            }
        });
        // An answer is strings and finite numbers: it has a text.
        serde_json::to_string(&answer).unwrap_or_default()
    }

    fn answer(&self, recipe: &str, asked: &str) -> Answer {
        let done = || -> Result<Answer> {
            let recipe = Recipe::from_json(recipe)?;
            let Asked { unit, before } = of_text(asked)?;
            by_files(&Stores::new(self.patience)?, &unit, &|unit| answer(unit, &recipe, self.memory, before.as_deref()))
        };
        done().unwrap_or_else(|e| failed(asked, e))
    }
}

/// What came of a unit whose logs may be objects of a store.
pub(crate) fn by_files(stores: &Stores, unit: &Unit, answer: &dyn Fn(&Unit) -> Answer) -> Result<Answer> {
    let fetched = stores.fetch(unit)?;
    let mut answer = answer(&fetched.unit);
    answer.rename(fetched.names());
    fetched.close();
    Ok(answer)
}

fn of_text(asked: &str) -> Result<Asked> {
    serde_json::from_str(asked).map_err(|e| {
        Error::input(format!("not a unit of a fleet: {e}"), "run the same version on the scheduler and the executors")
    })
}

fn failed(asked: &str, error: Error) -> Answer {
    let unit = of_text(asked).map(|asked| asked.unit).unwrap_or_default();
    Answer::failed(&unit, error)
}
