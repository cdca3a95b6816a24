//! Broken documents: scenarios, setups, limits, records and images.

use anyhow::{Result, ensure};

use super::{BENCH, Case, Good, case, changed, good, header, noise, recrc, with_byte};

pub(super) fn scenarios() -> Vec<Case> {
    const LEAST: &str = "[geometry]\nperimeter_m = 0.28\n[[thermometer]]\n[chamber]\nleg = [{ soak_s = 100 }]\n";
    let run = "simulate gyro.toml -o out.json";
    let with = |name, from: &str, to: &str| case(name, run).file("gyro.toml", LEAST.replacen(from, to, 1));
    let good = |name, args| case(name, args).file("gyro.toml", LEAST);
    vec![
        with("scenario with a negative length", "0.28", "-0.28").place("geometry.perimeter_m"),
        with("scenario with an unknown key", "perimeter_m", "perimeter_mm").place("gyro.toml"),
        with("scenario with a profile no chamber reaches", "soak_s = 100", "to_c = 900, rate_cpm = 1").place("leg[0]"),
        with("scenario with a ramp that never ends", "soak_s = 100", "to_c = 50, rate_cpm = 0").place("leg[0]"),
        with("scenario with rows of no whole tick", "[geometry]", "[run]\ninterval_s = 0.00015\n[geometry]")
            .place("run.interval_s"),
        with(
            "scenario with a beat too fast for its step",
            "[geometry]",
            "[run]\nfidelity = \"beat\"\n[input]\nrate_dph = 3.6e6\n[dither]\nfrequency_hz = 2000\namplitude_arcsec = 1000\n[geometry]",
        )
        .place("run.fidelity"),
        with("scenario whose mirror cannot move by a wavelength", "[geometry]", "[path_length]\nrange_low = -40\nrange_high = 40\n[geometry]")
            .place("path_length"),
        case("scenario that is binary", run).file("gyro.toml", vec![0xff, 0xfe, 0x00]).place("gyro.toml"),
        case("scenario that is not there", run).place("gyro.toml"),
        good("fault that is not known", "simulate gyro.toml --fault meteor -o out.json").place("meteor"),
        good("fault without its length", "simulate gyro.toml --fault lock_loss@5 -o out.json").place("lock_loss@5"),
        good("sweep of the loops with a log", "simulate gyro.toml --bode -o out.json").place("--bode"),
    ]
}

pub(super) fn setups(by: &Good) -> Vec<Case> {
    let with = |name: &'static str, setup: &str| {
        case(name, "calibrate log.csv --setup bench.toml -o out.json").file("log.csv", good()).file("bench.toml", setup)
    };
    let at = |name: &'static str, more: &str| with(name, &format!("{BENCH}{more}\n"));
    vec![
        with("setup that is no TOML", "arcsec_per_count = = 1").place("bench.toml:1"),
        at("setup with an unknown key", "arcsec_per_tick = 3").place("bench.toml:4"),
        with("setup with a wrong type", "arcsec_per_count = \"one\"").place("bench.toml:1"),
        with("setup with an absurd scale factor", "arcsec_per_count = -1.0").place("arcsec_per_count"),
        with("setup with a scale factor of infinity", "arcsec_per_count = inf").place("arcsec_per_count"),
        at("setup with an unknown window", "window = \"day\"").place("bench.toml:4"),
        at("setup with a window shorter than a row", "window = 0.01").place("window"),
        at("setup north of the pole", "[earth]\nlatitude_deg = 95.0\naxis_direction = \"up\"").place("latitude_deg"),
        at("setup that maps a header that is not there", "[columns]\ngyro = \"counts\"").place("gyro"),
        at("setup that maps to an unknown header", "[columns]\ncounts = \"pulses\"").place("counts"),
        at("setup whose tick does not fit the period", "tick_s = 0.0003\ntemperature_period_s = 1.0")
            .place("temperature_period_s"),
        with("setup that is binary", "\u{0}\u{1}").place("bench.toml"),
        case("limits with an unknown key", "verify unit.cal.json log.csv --limits limits.toml")
            .file("unit.cal.json", by.record.as_str())
            .file("log.csv", good())
            .file("limits.toml", "sigma_max = 1")
            .place("limits.toml:1"),
        case("limits below zero", "verify unit.cal.json log.csv --limits limits.toml")
            .file("unit.cal.json", by.record.as_str())
            .file("log.csv", good())
            .file("limits.toml", "sigma_dph_max = -1")
            .place("sigma_dph_max"),
    ]
}

pub(super) fn records(by: &Good) -> Result<Vec<Case>> {
    let (good_record, good_image) = (by.record.clone(), by.image.clone());
    let good_record_too = good_record.clone();
    let json = |name: &'static str, text: String| {
        case(name, "export unit.cal.json --to image -o out.json").file("unit.cal.json", text).place("unit.cal.json")
    };
    let edit = |from: &str, to: &str| {
        ensure!(good_record.contains(from), "a record has no {from}");
        Ok(good_record.replacen(from, to, 1))
    };
    let flash = |name: &'static str, bytes: Vec<u8>| {
        case(name, "verify unit.img log.csv").file("unit.img", bytes).file("log.csv", good()).place("unit.img")
    };
    Ok(vec![
        json("calibration that is no JSON", "{ \"format\": ".to_owned()),
        json("calibration cut short", good_record[..good_record.len() / 2].to_owned()),
        json("JSON of something else", "{ \"name\": 1 }".to_owned()).place("format"),
        json("calibration of another version", edit("\"version\": 2", "\"version\": 3")?).place("version"),
        json("calibration with a missing field", edit("\"window_s\": 100.0,", "")?).place("window_s"),
        json("calibration with an extra field", edit("\"window_s\": 100.0,", "\"window_s\": 100.0, \"windows\": 3,")?)
            .place("windows"),
        json("calibration with an infinite number", edit("\"window_s\": 100.0", "\"window_s\": 1e999")?),
        json("calibration with NaN", edit("\"window_s\": 100.0", "\"window_s\": NaN")?),
        json("calibration with a window of zero", edit("\"window_s\": 100.0", "\"window_s\": 0.0")?).place("window_s"),
        json("calibration with an unknown term", edit("\"acts_on\": \"bias\"", "\"acts_on\": \"magic\"")?)
            .place("magic"),
        json("calibration without a serial", edit("\"serial\": \"PAPER-RIG\"", "\"serial\": \"unassigned\"")?)
            .refused(),
        case("calibration of the gyro next to it", "verify unit.cal.json log.csv --serial RLG-8")
            .file("unit.cal.json", good_record.clone())
            .file("log.csv", good())
            .place("serial"),
        flash("image cut short", good_image[..150].to_vec()),
        flash("image with a wrong CRC", with_byte(&good_image, 140, good_image[140] ^ 1)),
        flash("image of another version", recrc(with_byte(&good_image, 8, 9))),
        flash("image of noise", [&good_image[..8], &noise(120)].concat()),
        flash("image with a term of unknown kind", recrc(with_byte(&good_image, 192, 77))),
        case("image of another serial", "verify unit.img log.csv --serial RLG-8")
            .file("unit.img", good_image.clone())
            .file("log.csv", good())
            .place("serial"),
        case("image for another scale factor", "verify unit.img log.csv --arcsec-per-count 2")
            .file("unit.img", good_image.clone())
            .file("log.csv", good())
            .place("arcsec_per_count"),
        case("image for another axis", "verify unit.img log.csv")
            .file("unit.img", good_image)
            .file("log.csv", header("time_s,temperature_c,counts_y"))
            .place("log.csv"),
        case("log instead of a correction", "verify log.csv log.csv").file("log.csv", good()).place("log.csv"),
        case("table of windows", "calibrate w.csv -o out.json")
            .file("w.csv", "run,start_ns,end_ns,duration_ns,samples,first_line,reference_dps\n0,0,100,100,1,2,\n")
            .place("w.csv"),
        case("log of which no row can be corrected", "compensate unit.cal.json log.csv -o out.json")
            .file("unit.cal.json", good_record_too)
            .file("log.csv", changed(|_, fields| fields[2] = "nan".to_owned()))
            .refused()
            .place("log.csv:2"),
        case("corrected log in a format that is not written", "compensate unit.cal.json log.csv -o out.csv.gz")
            .place("out.csv.gz"),
    ])
}
