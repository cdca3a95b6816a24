//! Documents, images and lines: good ones with values changed, so that they are still what they say they are.

use sagnac_board::frame::{Frame, MAX_PAYLOAD};
use serde_json::{Map, Value};

use super::chance::Chance;
use crate::corpus::recrc;

/// By what a number is multiplied: mostly by little, so that the document remains one that is accepted.
const FACTORS: [f64; 9] = [1.0001, 1.01, 0.9, 1.5, 2.0, -1.0, 1e-6, 1e3, 1e9];

/// Changes values of a JSON document: numbers, texts, kinds, missing and repeated parts.
pub(super) fn json(chance: &mut Chance, text: &str) -> Vec<u8> {
    if chance.one_in(6) {
        return chance.damage(text.as_bytes().to_vec());
    }
    let Ok(mut value) = serde_json::from_str::<Value>(text) else { return Vec::new() };
    for _ in 0..=chance.below(3) {
        change(chance, &mut value);
    }
    let mut out = serde_json::to_string_pretty(&value).unwrap_or_default();
    if chance.one_in(10) {
        out.insert(0, '\u{feff}');
    }
    out.into_bytes()
}

/// Goes down to a part by chance, and changes it there.
fn change(chance: &mut Chance, value: &mut Value) {
    match value {
        Value::Object(fields) if !fields.is_empty() && !chance.one_in(12) => {
            let name = fields.keys().nth(chance.below(fields.len())).cloned().unwrap_or_default();
            if chance.one_in(15) {
                fields.remove(&name);
            } else if let Some(field) = fields.get_mut(&name) {
                change(chance, field);
            }
        }
        Value::Array(items) if !items.is_empty() && !chance.one_in(8) => {
            let at = chance.below(items.len());
            match chance.below(12) {
                0 => drop(items.remove(at)),
                1 => {
                    let item = items[at].clone();
                    let times = chance.pick(&[1, 2, 40, 3000]);
                    items.extend(std::iter::repeat_n(item, times));
                }
                _ => change(chance, &mut items[at]),
            }
        }
        leaf => *leaf = other_leaf(chance, leaf),
    }
}

fn other_leaf(chance: &mut Chance, leaf: &Value) -> Value {
    match (leaf, chance.below(10)) {
        (Value::Number(number), 0..=7) => match (number.as_i64(), chance.below(4)) {
            (Some(_), 0) => {
                Value::from(chance.pick(&[0, 1, -1, 7, 255, 65_536, i64::from(u32::MAX), i64::MAX, i64::MIN]))
            }
            (Some(whole), 1..=2) => Value::from(whole.saturating_add(chance.pick(&[-1, 1, 2, 10]))),
            (_, 0) => Value::from(chance.double()),
            _ => Value::from(number.as_f64().unwrap_or(0.0) * chance.pick(&FACTORS)),
        },
        (Value::String(_), 0..=7) => Value::from(chance.word()),
        (Value::Bool(set), 0..=7) => Value::from(!set),
        (_, 0..=6) => chance.pick(&[
            Value::Null,
            Value::from(0.0),
            Value::from(""),
            Value::Array(vec![]),
            Value::Object(Map::new()),
        ]),
        (_, 7) => (0..200).fold(Value::Null, |inner, _| Value::Array(vec![inner])),
        _ => Value::from(chance.word()),
    }
}

/// Changes lines of a TOML document: values, kinds, missing and repeated keys.
pub(super) fn toml(chance: &mut Chance, text: &str) -> Vec<u8> {
    if chance.one_in(6) {
        return chance.damage(text.as_bytes().to_vec());
    }
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..=chance.below(3) {
        let at = chance.below(lines.len());
        let Some((key, value)) =
            lines[at].split_once('=').map(|(key, value)| (key.to_owned(), value.trim().to_owned()))
        else {
            continue;
        };
        lines[at] = match (value.parse::<f64>(), chance.below(16)) {
            (Ok(number), 0..=7) => format!("{key}= {:?}", number * chance.pick(&FACTORS)),
            (_, 8) => String::new(),
            (_, 9) => format!("{}\n{}", lines[at], lines[at]),
            (_, 10) => format!("{key}= [{value}, {value}]"),
            (_, 11) => format!("{key}= {:?}", chance.word()),
            (_, 12) => format!("{key}= true"),
            (_, 13) => format!("{} = {value}", chance.word()),
            _ => format!("{key}= {}", toml_number(chance)),
        };
    }
    (lines.join("\n") + "\n").into_bytes()
}

fn toml_number(chance: &mut Chance) -> String {
    match chance.below(4) {
        0 => chance.number().to_owned(),
        1 => chance.pick(&["0", "-1", "1", "3", "1000000", "9223372036854775807"]).to_owned(),
        _ => {
            let value = chance.double();
            if value.is_finite() { format!("{value:?}") } else { chance.pick(&["nan", "inf", "-inf"]).to_owned() }
        }
    }
}

/// Bytes of an image changed, mostly with the CRC of what they are then.
pub(super) fn image(chance: &mut Chance, bytes: &[u8]) -> Vec<u8> {
    if chance.one_in(4) {
        return chance.damage(bytes.to_vec());
    }
    let mut bytes = bytes.to_vec();
    for _ in 0..=chance.below(3) {
        let at = 8 + chance.below(bytes.len() - 12);
        let length = chance.pick(&[1, 4, 8]).min(bytes.len() - at);
        let value = (chance.double().to_bits() ^ chance.below(1 << 20) as u64).to_le_bytes();
        bytes[at..at + length].copy_from_slice(&value[..length]);
    }
    recrc(bytes)
}

/// A serial stream: frames with sound CRC and any content, between damaged ones.
pub(super) fn stream(chance: &mut Chance) -> Vec<u8> {
    let mut bytes = Vec::new();
    for _ in 0..chance.below(200) {
        let kind = chance.pick(&[0x01, 0x01, 0x01, 0x02, 0x03, 0x10, 0x20, 0x24, 0x30, 0xff]);
        let length = if kind == 0x01 && !chance.one_in(10) { 41 } else { chance.below(MAX_PAYLOAD + 1) };
        let payload: Vec<u8> = (0..length)
            .map(|_| if chance.one_in(3) { chance.pick(&[0, 0xff, 0x80, 0x1b]) } else { chance.below(256) as u8 })
            .collect();
        if let Some(frame) = Frame::new(kind, &payload) {
            let (whole, length) = frame.bytes();
            bytes.extend_from_slice(&whole[..length]);
        }
    }
    if chance.one_in(3) { chance.damage(bytes) } else { bytes }
}
