//! Inputs on which nothing depends are not selected.

use crate::support::evidence::evidence;
use crate::support::fit;
use sagnac::calibration::SearchVerdict;
use sagnac_log::setup::Setup;
use sagnac_sim::ManyInputs;

fn setup() -> Setup {
    Setup { arcsec_per_count: Some(0.05), reference_c: Some(20.0), ..Setup::default() }
}

/// A random walk without effect, a second thermometer that adds nothing, modes without steps: the search selects none.
#[test]
fn irrelevant_inputs_are_not_selected() {
    let mut taken = 0;
    for seed in 0..20 {
        let found = fit(vec![ManyInputs::plain().csv(100 + seed)], &setup(), "auto").unwrap();
        let axis = &found.axes[0];
        taken += usize::from(!axis.other_inputs().is_empty());
        println!("seed {seed}: {}", axis.correction.model);
        assert_eq!(axis.fit.as_ref().unwrap().model_search[0].verdict, SearchVerdict::Start);
        assert!(
            axis.fit
                .as_ref()
                .unwrap()
                .model_search
                .iter()
                .any(|step| step.model.contains("bystander") && step.verdict == SearchVerdict::NoGain)
        );
    }
    evidence("`auto` selects an input on which nothing depends", taken as f64 / 20.0, "≤ 0.05", 20);
}
