//! A program in C that checks the constants of a unit: corrected counts over its own temperatures, as the Rust target computes them.
//!
//! ```text
//! image ─▶ Compensator: temperature up and down over the span, random counts ─▶ codes, raw counts, corrected counts, status ─▶ tables in C
//! ```
//!
//! Built with the correction and run on the part, it says whether compiler and part compute this unit as the host did.

use std::fmt::Write as _;

use sagnac_core::{Compensator, Image, State, ValueSource};

/// Slow updates of a check: a step between two of them is small enough for most thermometers.
const UPDATES: usize = 64;

/// Splitmix64: counts that are no constant.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// One slow update and the ticks behind it.
struct Row {
    codes: Vec<i32>,
    raw: [i32; 2],
    counts: [i32; 2],
    status: [u32; 2],
}

/// The code at a place of an input's span, 0 to 1; beyond both ends outside.
fn code_at(image: &Image, input: usize, place: f64) -> i32 {
    let Some(spec) = image.inputs().get(input) else { return 0 };
    let span = (spec.span_hi_q24 as f64) - (spec.span_lo_q24 as f64);
    let value_q24 = spec.span_lo_q24 as f64 + place * span;
    let per_code = f64::from(spec.gain.mantissa) / 2_f64.powi(i32::from(spec.gain.shift));
    ((value_q24 - f64::from(spec.offset_q24)) / per_code).clamp(f64::from(i32::MIN), f64::from(i32::MAX)) as i32
}

/// Up and down the span, a twentieth beyond both ends.
fn rows(image: &Image) -> Vec<Row> {
    let compensator = Compensator::new(*image);
    let d = image.description();
    let mut state = State::new();
    let mut chance = u64::from(d.axis);
    let inputs = image.inputs().len();
    let row = |at: usize| {
        let phase = at as f64 / (UPDATES - 1) as f64;
        let place = -0.05 + 1.1 * (1.0 - (2.0 * phase - 1.0).abs());
        let codes: Vec<i32> = (0..inputs).map(|input| code_at(image, input, place)).collect();
        let given: Vec<Option<i32>> = codes.iter().copied().map(Some).collect();
        let raw = [(); 2].map(|()| (random(&mut chance) % 2001) as i32 - 1000);
        // Periods have two ticks or more, or the second part is none.
        compensator.update(&mut state, &given).ok()?;
        let first = compensator.tick(&mut state, raw[0]).ok()?;
        let rest = d.period_ticks.saturating_sub(1);
        let second = if rest == 0 { first } else { compensator.advance(&mut state, raw[1], rest).ok()? };
        let both = [first, second];
        Some(Row { codes, raw, counts: both.map(|o| o.counts), status: both.map(|o| u32::from(o.status.bits())) })
    };
    (0..UPDATES).filter_map(row).collect()
}

/// The program, for the images that the export's `sagnac_unit.c` holds under these names.
pub(crate) fn unit_check(images: &[(String, &Image)], about: &str) -> String {
    let mut out = about.to_owned();
    out.push_str(
        "/* Checks this unit's correction on your compiler or part: temperatures up and down its span, counts by chance, and the corrected counts as\n \
         * the host computed them. Build it with sagnac_unit.c, sagnac_compensator.c and sagnac_integer.c; it returns 0 where every value is equal. */\n\
         #include <stdio.h>\n\n#include \"sagnac_unit.h\"\n\n\
         typedef struct {\n    int32_t codes[SAGNAC_MAX_INPUTS];\n    int32_t raw[2];\n    int32_t counts[2];\n    uint32_t status[2];\n} row;\n\n",
    );
    for (name, image) in images {
        let _ = writeln!(out, "static const row {name}_rows[] = {{");
        for Row { codes, raw, counts, status } in rows(image) {
            let list = |values: &[i32]| values.iter().map(|v| literal(*v)).collect::<Vec<_>>().join(", ");
            let _ = writeln!(
                out,
                "    {{{{{}}}, {{{}}}, {{{}}}, {{{}U, {}U}}}},",
                list(&codes),
                list(&raw),
                list(&counts),
                status[0],
                status[1]
            );
        }
        out.push_str("};\n\n");
    }
    out.push_str(CHECK);
    for (name, image) in images {
        let is_code = |at: usize| image.inputs().get(at).is_some_and(|input| input.source == ValueSource::Code);
        let present = (0..image.inputs().len()).filter(|at| is_code(*at)).fold(0_u32, |bits, at| bits | 1 << at);
        let _ = writeln!(
            out,
            "    wrong += check(\"{name}\", &{name}, {name}_rows, (uint32_t)(sizeof({name}_rows) / sizeof({name}_rows[0])), {present}U);"
        );
    }
    out + "    return (wrong == 0U) ? 0 : 1;\n}\n"
}

/// A constant of C; the lowest has no literal.
fn literal(value: i32) -> String {
    if value == i32::MIN { "(-2147483647 - 1)".to_owned() } else { value.to_string() }
}

/// The loop over the rows of an axis, and the beginning of `main`.
const CHECK: &str = r#"static uint32_t check(const char *name, const sagnac_image *image, const row *rows, uint32_t count, uint32_t present)
{
    sagnac_compensator_state state;
    sagnac_output output;
    uint32_t at;
    uint32_t part;
    uint32_t wrong = 0U;
    sagnac_compensator_start(&state);
    for (at = 0U; at < count; at++) {
        if (sagnac_compensator_update(image, &state, rows[at].codes, present) != SAGNAC_OK) {
            wrong++;
        }
        for (part = 0U; part < 2U; part++) {
            const uint32_t ticks = (part == 0U) ? 1U : (image->period_ticks - 1U);
            if (ticks == 0U) {
                continue;
            }
            if ((sagnac_compensator_advance(image, &state, rows[at].raw[part], ticks, &output) != SAGNAC_OK) ||
                (output.counts != rows[at].counts[part]) || (output.status != rows[at].status[part])) {
                wrong++;
            }
        }
    }
    (void)printf("%s: %lu updates, %lu values differ\n", name, (unsigned long)count, (unsigned long)wrong);
    return wrong;
}

int main(void)
{
    uint32_t wrong = 0U;
"#;
