//! Options from the report of a fit, which is done again with them.

use std::path::Path;

use reconstruct::{FitOptions, SolidOptions};
use serde_json::{Map, Value};

use crate::settings::{Config, Place, Schema, Settings, UsageError};

/// The options and the input of a report.
pub(crate) fn config_of(schema: &Schema, path: &Path, text: &str) -> Result<Config, UsageError> {
    let place = Place { file: path, line: 0 };
    let report: Value = serde_json::from_str(text).map_err(|error| place.error(error))?;
    let Some(options) = report["options"].as_object() else {
        return Err(place.error("no report of a fit: it has no options"));
    };
    let mut settings = Settings::default();
    set_all(schema, &mut settings, place, options)?;
    // A sheet, all pieces, a whole part.
    let file = [&report["input"]["file"], &report["file"], &report["input"]].into_iter().find_map(Value::as_str);
    let hash = report["input"]["sha256"].as_str().map(str::to_owned);
    Ok(Config { settings, input: file.map(|file| (file.into(), hash)) })
}

fn set_all(
    schema: &Schema,
    settings: &mut Settings,
    place: Place<'_>,
    options: &Map<String, Value>,
) -> Result<(), UsageError> {
    for (key, value) in options {
        let as_typed = |name: &str, settings: &mut Settings| {
            let Some(values) = words(value) else {
                return Err(place.error(format!("{key}: {value} is not possible")));
            };
            schema.set(settings, place, name, &values)
        };
        match (key.as_str(), value) {
            (_, Value::Null) => {}
            // What cannot be typed is as this program has it.
            ("policy", _) => check_same(place, key, value, &serde_json::json!(FitOptions::default().policy))?,
            ("plates", _) => check_same(place, key, value, &serde_json::json!(SolidOptions::default().plates))?,
            ("read", Value::Object(inner)) => set_all(schema, settings, place, inner)?,
            ("all_pieces", Value::Bool(true)) => schema.set(settings, place, "piece", &["all".to_owned()])?,
            ("all_pieces", Value::Bool(false)) => {}
            ("normals" | "grid", Value::Array(none)) if none.is_empty() => {
                schema.set(settings, place, key, &["none".to_owned()])?;
            }
            (_, Value::Array(none)) if none.is_empty() => {}
            ("classes", _) => as_typed("class", settings)?,
            ("elements", _) => as_typed("mesh", settings)?,
            _ => as_typed(key, settings)?,
        }
    }
    Ok(())
}

fn check_same(place: Place<'_>, key: &str, given: &Value, own: &Value) -> Result<(), UsageError> {
    if given == own {
        return Ok(());
    }
    Err(place.error(format!("{key}: {given} cannot be chosen, and this version of thb has {own}")))
}

fn words(value: &Value) -> Option<Vec<String>> {
    match value {
        Value::String(text) => Some(vec![text.clone()]),
        Value::Number(number) => Some(vec![number.to_string()]),
        Value::Bool(flag) => Some(vec![flag.to_string()]),
        Value::Array(values) => Some(values.iter().map(words).collect::<Option<Vec<_>>>()?.concat()),
        Value::Null | Value::Object(_) => None,
    }
}
