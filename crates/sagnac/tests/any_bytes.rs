//! No input causes a panic: random logs, setups, records, limits and models, and damaged valid ones, up to
//! a calibration and a replay. (Image and bytes of it: `sagnac-core`.)

use crate::support;
use proptest::prelude::*;
use sagnac::calibration::Calibration;
use sagnac::fit::{FitOptions, Model, calibrate};
use sagnac::model::ModelSpec;
use sagnac::verify::{CorrectedFormat, Correction, Limits, compensate};
use sagnac::window::WindowBuilder;
use sagnac_log::ingest::{LogReader, ReadMode};
use sagnac_log::setup::{Counter, Setup};
use sagnac_sim::{PaperRig, csv_bytes};

/// Valid and invalid cells of logs.
fn any_cell() -> impl Strategy<Value = String> {
    prop_oneof![
        4 => (-50.0..90.0_f64).prop_map(|v| format!("{v:.3}")),
        4 => (0_i64..5000).prop_map(|v| v.to_string()),
        1 => prop::sample::select(vec![
            "", "nan", "inf", "-inf", "1e308", "-1e308", "9223372036854775807", "-9223372036854775808", "1e-320", "\"", "\"5\"",
            "0x10", "1,5", "5e18", "-5e18", "4611686018427387903", "true", "#", "\u{feff}", "−5",
        ]).prop_map(str::to_owned),
    ]
}

fn any_log() -> impl Strategy<Value = String> {
    let headers = prop::sample::select(vec![
        "time_s",
        "time_ns",
        "time_us",
        "temperature_c",
        "temperature_k_b",
        "counts",
        "counts_y",
        "rate_dps",
        "rate_dph_z",
        "valid",
        "aux_v",
        "reference_rate_dps",
        "note",
    ]);
    let table = (prop::collection::vec(headers, 2..6), prop::sample::select(vec![',', ';', '\t']));
    (table, prop::collection::vec(prop::collection::vec(any_cell(), 1..7), 0..80), any::<bool>()).prop_map(
        |((headers, delimiter), rows, in_order)| {
            let joined = |cells: &[String]| cells.join(&delimiter.to_string());
            let mut text = joined(&headers.iter().map(ToString::to_string).collect::<Vec<_>>()) + "\n";
            for (i, mut row) in rows.into_iter().enumerate() {
                if in_order {
                    row.resize(headers.len(), "7".to_owned());
                    row[0] = i.to_string();
                }
                text += &(joined(&row) + "\n");
            }
            text
        },
    )
}

fn any_setup() -> impl Strategy<Value = Setup> {
    let window = prop::sample::select(vec!["", "window = \"row\"\n", "window = 5\n", "window = 1e6\n"]);
    let more = prop::sample::select(vec![
        "",
        "discard_initial_s = 10\n",
        "temperature_offset_s = -7.5\n",
        "temperature_offset_s = 3600\n",
        "sample_interval_s = 1e-6\n",
        "sample_interval_s = 1e5\n",
        "temperature_period_s = 0.001\n",
        "tick_s = 1.0\ntemperature_period_s = 3600\n",
        "quantum = 1e-6\n",
        "min_span_c = 0.1\nreference_c = 20\n",
    ]);
    (window, more, any::<bool>(), prop::option::of(4_u8..=52)).prop_map(|(window, more, cumulative, bits)| {
        let mut setup = Setup::parse(&format!("arcsec_per_count = 1.5\n{window}{more}")).unwrap();
        if cumulative {
            (setup.counter, setup.counter_bits) = (Some(Counter::Cumulative), bits);
        }
        setup
    })
}

/// All operations on a log.
fn put_through(text: Vec<u8>, setup: &Setup, pace: ReadMode) {
    let open = |pace| LogReader::from_reader("log", Box::new(std::io::Cursor::new(text.clone())), setup, pace);
    let Ok(log) = open(pace) else { return };
    let Ok(windows) = WindowBuilder::read_all(vec![log], setup) else { return };
    let options = FitOptions::new(Model::Auto);
    let Ok(calibration) = calibrate(windows.finish(), setup, &options) else { return };
    let Ok(correction) = Correction::from_calibration(calibration) else { return };
    if let Ok(mut log) = open(ReadMode::LineByLine) {
        let _ = compensate(&correction, &mut log, setup, CorrectedFormat::Csv, &mut Vec::new());
    }
}

fn damaged(mut bytes: Vec<u8>, damage: &[(usize, u8)]) -> Vec<u8> {
    for (at, value) in damage {
        let len = bytes.len();
        bytes[at % len] = *value;
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn any_table_is_answered(log in any_log(), setup in any_setup()) {
        put_through(log.into_bytes(), &setup, ReadMode::BulkWithText);
    }

    #[test]
    fn any_bytes_are_answered(bytes in prop::collection::vec(any::<u8>(), 0..600), gzip in any::<bool>(), setup in any_setup()) {
        let bytes = if gzip { [vec![0x1f, 0x8b, 8], bytes].concat() } else { bytes };
        put_through(bytes, &setup, ReadMode::Bulk);
    }

    #[test]
    fn any_setup_limits_and_model_text_is_answered(text in "[ -~\n\u{e9}\u{2212}]{0,120}") {
        let _ = Setup::parse(&text);
        let _ = Limits::parse(&text);
        let _ = text.parse::<ModelSpec>();
        let _ = Calibration::parse(&text);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn any_damaged_log_is_answered(damage in prop::collection::vec((0_usize..1 << 20, any::<u8>()), 1..40)) {
        let rig = PaperRig { windows: 20, ..PaperRig::PAPER };
        put_through(damaged(csv_bytes(rig.run(1)), &damage), &support::paper_setup(), ReadMode::Bulk);
    }

    #[test]
    fn any_damaged_record_is_answered(damage in prop::collection::vec((0_usize..1 << 20, prop::sample::select(b"0123456789-e.\"{}[],:nulx".to_vec())), 1..4)) {
        let text = support::fit(vec![csv_bytes(PaperRig::PAPER.run(1))], &support::paper_setup(), "bias 2, zones 3").unwrap().to_json().unwrap();
        if let Ok(text) = String::from_utf8(damaged(text.into_bytes(), &damage))
            && let Ok(calibration) = Calibration::parse(&text)
            && let Ok(correction) = Correction::from_calibration(calibration)
        {
            let setup = correction.setup();
            let log = csv_bytes(PaperRig { windows: 2, ..PaperRig::PAPER }.run(2));
            if let Ok(mut log) = LogReader::from_reader("log", Box::new(std::io::Cursor::new(log)), &setup, ReadMode::BulkWithText) {
                let _ = compensate(&correction, &mut log, &setup, CorrectedFormat::Parquet, &mut Vec::new());
            }
        }
    }
}
