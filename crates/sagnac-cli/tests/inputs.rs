//! Further inputs on the command line: found, exported, replayed by the record and by the image alone, refused by name.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use sagnac_sim::ManyInputs;
use serde_json::Value;
use tempfile::TempDir;

const UNIT: [&str; 2] = ["--arcsec-per-count", "0.05"];

fn sagnac(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("sagnac").unwrap();
    command.current_dir(folder);
    command
}

fn json(command: &mut Command) -> Value {
    serde_json::from_slice(&command.assert().success().get_output().stdout).unwrap()
}

fn error(command: &mut Command, code: i32) -> String {
    String::from_utf8(command.assert().code(code).get_output().stderr.clone()).unwrap()
}

#[test]
fn inputs_go_from_the_log_to_the_image_and_back() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let rig =
        ManyInputs { voltage_dph_per_v: 5e-4, gradient_dph_per_c: 0.004, cavity_heat_c: 6.0, ..ManyInputs::plain() };
    fs::write(at.join("log.csv"), rig.csv(1)).unwrap();
    fs::write(at.join("retest.csv"), rig.csv(2)).unwrap();
    let flags = ["calibrate", "log.csv", "--serial", "RLG-3", "--reference", "20", "-o", "unit.cal.json"];
    let report = ["--report", "unit.html", "--json"];
    let record = json(sagnac(at).args(flags).args(UNIT).args(report));
    let axis = &record["axes"][0];
    let model = axis["model"].as_str().unwrap();
    assert!(model.contains("cavity - block") && (model.contains("path_length_v") || model.contains("mode")), "{model}");
    let page = fs::read_to_string(at.join("unit.html")).unwrap();
    assert!(
        page.contains("Other inputs")
            && page.contains("its terms, °/h rms")
            && page.contains("Collinearity of the terms")
    );

    // By the record, and by the image alone with the names of what it reads.
    let by_record = json(sagnac(at).args(["verify", "unit.cal.json", "retest.csv", "--json"]));
    sagnac(at).args(["export", "unit.cal.json", "--to", "image", "-o", "unit.img"]).assert().success();
    let own: Vec<&str> = axis["inputs"]
        .as_array()
        .unwrap()
        .iter()
        // The first is the thermometer of the fit.
        .skip(1)
        .filter(|input| input["source"].get("difference").is_none())
        .map(|input| input["name"].as_str().unwrap())
        .collect();
    let names = own.join(",");
    let image = |inputs: &[&str]| {
        let mut command = sagnac(at);
        command
            .args(["verify", "unit.img", "retest.csv", "--thermometer", "block", "--reference", "20", "--json"])
            .args(inputs);
        command
    };
    let by_image = json(&mut image(&["--inputs", &names]));
    assert_eq!(by_image["image_sha256"], by_record["image_sha256"]);
    assert_eq!(by_image["axes"][0]["after"], by_record["axes"][0]["after"]);
    let said = error(&mut image(&[]), 2);
    assert!(said.contains("unnamed inputs") && said.contains("--inputs"), "{said}");
    let inspected = json(sagnac(at).args(["inspect", "unit.img", "--json"]));
    assert!(inspected["thermometers"].as_array().unwrap().iter().any(|t| t["difference"].is_array()), "{inspected}");

    // What a log does not have is named.
    let without = String::from_utf8(rig.csv(2)).unwrap().replacen("temperature_c_cavity", "ignored_cavity", 1);
    fs::write(at.join("without.csv"), without).unwrap();
    let said = error(sagnac(at).args(["verify", "unit.cal.json", "without.csv"]), 2);
    assert!(said.contains("the correction needs the thermometer \"cavity\""), "{said}");
    let said = error(sagnac(at).args(flags).args(UNIT).args(["--model", "bias 2, bias(anode) 1"]), 2);
    assert!(said.contains("no input of this name") && said.contains("cavity - block"), "{said}");
    let said = error(sagnac(at).args(flags).args(UNIT).args(["--model", "bias 2, steps(path_length_v)"]), 3);
    assert!(said.contains("whole numbers"), "{said}");
    let said = error(sagnac(at).args(flags).args(UNIT).args(["--model", "bias 2, bias(block) 1"]), 2);
    assert!(said.contains("without brackets"), "{said}");
    let many = "bias 2, bias(cavity - block) 1, bias(path_length_v) 1, bias(bystander) 1";
    let said = error(sagnac(at).args(flags).args(UNIT).args(["--model", many]), 3);
    assert!(said.contains("an image reads 4"), "{said}");
}
