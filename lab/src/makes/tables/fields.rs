//! The fields of the calibration record as tables in `docs/reference/record.md`.
//!
//! The schema comes from the program's own types, so the page cannot contradict the program.

use std::fmt::Write;

use anyhow::{Context, Result};
use serde_json::{Map, Value};

/// The schema itself, then each of its definitions in the schema's order.
pub(crate) fn tables(schema: &Value) -> Result<String> {
    let title = schema["title"].as_str().context("a schema without a title")?;
    let mut out = table(title, schema);
    for (name, definition) in schema["$defs"].as_object().into_iter().flatten() {
        out += &table(name, definition);
    }
    Ok(out)
}

/// Heading, description, and a row for each field; for a choice, a row for each alternative.
fn table(name: &str, schema: &Value) -> String {
    let mut out = format!("\n### {name}\n\n{}\n", description(schema));
    let alternatives = schema["oneOf"].as_array().or_else(|| schema["anyOf"].as_array());
    if let Some(alternatives) = alternatives {
        out += "\n| one of | |\n|---|---|\n";
        for alternative in alternatives {
            let _ = writeln!(out, "| {} | {} |", cell(&kind(alternative)), cell(&description(alternative)));
        }
        for alternative in alternatives.iter().filter(|alternative| alternative["properties"].is_object()) {
            let _ = write!(out, "\n{}\n{}", description(alternative), fields(alternative));
        }
    }
    out + &fields(schema)
}

/// Table of an object's fields.
fn fields(schema: &Value) -> String {
    let Some(properties) = schema["properties"].as_object() else { return String::new() };
    let required: Vec<&str> = schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    let mut out = String::from("\n| field | type | |\n|---|---|---|\n");
    for (name, field) in properties {
        let optional = if required.contains(&name.as_str()) { "" } else { ", may be absent" };
        let _ = writeln!(out, "| `{name}` | {}{optional} | {} |", cell(&kind(field)), cell(&description(field)));
    }
    out
}

fn description(schema: &Value) -> String {
    schema["description"].as_str().unwrap_or_default().to_owned()
}

/// A cell of a table: one line, bars escaped.
fn cell(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}

/// The type of a value of this schema, in words; a definition is a link to its table.
fn kind(schema: &Value) -> String {
    if let Some(name) = schema["$ref"].as_str().and_then(|path| path.strip_prefix("#/$defs/")) {
        return format!("[{name}](#{})", name.to_lowercase());
    }
    if let Some(value) = schema.get("const") {
        return format!("`{value}`");
    }
    if let Some(any) = schema["anyOf"].as_array().or_else(|| schema["oneOf"].as_array()) {
        return any.iter().map(kind).collect::<Vec<_>>().join(" or ");
    }
    match &schema["type"] {
        Value::String(name) => of_type(name, schema),
        Value::Array(names) => {
            let names: Vec<String> = names.iter().filter_map(Value::as_str).map(|name| of_type(name, schema)).collect();
            names.join(" or ")
        }
        _ => "any".to_owned(),
    }
}

fn of_type(name: &str, schema: &Value) -> String {
    let empty = Map::new();
    match name {
        "array" => match (schema.get("items"), schema["prefixItems"].as_array(), &schema["minItems"]) {
            (_, Some(items), _) => format!("[{}]", items.iter().map(kind).collect::<Vec<_>>().join(", ")),
            (Some(items), None, count) if count.is_u64() && *count == schema["maxItems"] => {
                format!("{count} of {}", kind(items))
            }
            (Some(items), None, _) => format!("list of {}", kind(items)),
            (None, None, _) => "list".to_owned(),
        },
        "object" => {
            let names: Vec<String> =
                schema["properties"].as_object().unwrap_or(&empty).keys().map(|name| format!("`{name}`")).collect();
            if names.is_empty() { "object".to_owned() } else { format!("object of {}", names.join(", ")) }
        }
        other => other.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use xtask::shell::root;

    use super::*;
    use crate::places::CALIBRATION_SCHEMA;

    /// The committed schema, and a page of its tables.
    fn committed() -> (Value, String) {
        let schema = std::fs::read_to_string(root().join(CALIBRATION_SCHEMA)).unwrap();
        let schema = serde_json::from_str(&schema).unwrap();
        let page = tables(&schema).unwrap();
        (schema, page)
    }

    #[test]
    fn every_field_of_the_record_is_in_a_table() {
        let (schema, page) = committed();
        assert!(page.starts_with("\n### Calibration\n") && page.ends_with("|\n"), "{page}");
        let definitions = schema["$defs"].as_object().unwrap();
        assert!(definitions.len() > 30);
        for (name, definition) in definitions {
            assert!(page.contains(&format!("\n### {name}\n")), "{name}");
            for field in definition["properties"].as_object().into_iter().flatten().map(|(field, _)| field) {
                assert!(page.contains(&format!("\n| `{field}` | ")), "{name}.{field}");
            }
        }
    }

    #[test]
    fn every_link_has_a_heading() {
        let (_, page) = committed();
        let headings: Vec<String> =
            page.lines().filter_map(|line| line.strip_prefix("### ")).map(str::to_lowercase).collect();
        let mut links = 0;
        for link in page.split("](#").skip(1).filter_map(|rest| rest.split(')').next()) {
            assert!(headings.iter().any(|heading| heading == link), "{link}");
            links += 1;
        }
        assert!(links > 30, "{links}");
    }

    #[test]
    fn types_are_written_in_words() {
        let schema = |text: &str| kind(&serde_json::from_str(text).unwrap());
        assert_eq!(schema(r#"{"type":["number","null"]}"#), "number or null");
        assert_eq!(schema(r#"{"type":"array","items":{"type":"number"},"minItems":2,"maxItems":2}"#), "2 of number");
        assert_eq!(schema(r##"{"anyOf":[{"$ref":"#/$defs/Lag"},{"type":"null"}]}"##), "[Lag](#lag) or null");
        assert_eq!(schema(r#"{"type":"string","const":"row"}"#), "`\"row\"`");
        assert_eq!(schema("{}"), "any");
    }
}
