//! Options and parts from TOML.

use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::settings::{Place, Schema, Settings, UsageError};

/// The options of a file.
pub(crate) fn settings_of(schema: &Schema, path: &Path, text: &str) -> Result<Settings, UsageError> {
    let table = parsed(path, text)?;
    let mut settings = Settings::default();
    for (key, value) in &table {
        let place = Place { file: path, line: line_of(text, key) };
        schema.set(&mut settings, place, key.get_ref(), &words(value.get_ref(), place, key.get_ref())?)?;
    }
    Ok(settings)
}

/// A key of a part with its values, and the line that it stands in.
pub(crate) struct Entry {
    pub(crate) key: String,
    pub(crate) values: Vec<String>,
    pub(crate) line: usize,
}

/// The tables `[[part]]` of a file, each with the line that it begins in.
pub(crate) fn parts_of(path: &Path, text: &str) -> Result<Vec<(usize, Vec<Entry>)>, UsageError> {
    let table = parsed(path, text)?;
    let mut parts = Vec::new();
    for (key, value) in &table {
        let place = Place { file: path, line: line_of(text, key) };
        let tables = value.get_ref().as_array().filter(|_| key.get_ref() == "part");
        let Some(tables) = tables else {
            return Err(place.error(format!("{:?} is no table [[part]]", key.get_ref())));
        };
        for value in tables.iter() {
            let line = line_of(text, value);
            let Some(table) = value.get_ref().as_table() else {
                return Err(Place { file: path, line }.error("a part is a table [[part]]"));
            };
            let of_key = |(key, value): (&Spanned<_>, &Spanned<DeValue<'_>>)| {
                let key: &Spanned<toml::de::DeString<'_>> = key;
                let line = line_of(text, key);
                let values = words(value.get_ref(), Place { file: path, line }, key.get_ref())?;
                Ok(Entry { key: key.get_ref().to_string(), values, line })
            };
            parts.push((line, table.iter().map(of_key).collect::<Result<_, UsageError>>()?));
        }
    }
    Ok(parts)
}

fn parsed<'a>(path: &Path, text: &'a str) -> Result<DeTable<'a>, UsageError> {
    DeTable::parse(text).map(Spanned::into_inner).map_err(|error| {
        let line = error.span().map_or(0, |span| line_at(text, span.start));
        Place { file: path, line }.error(error.message())
    })
}

/// A value as it would be typed; of an array each element.
fn words(value: &DeValue<'_>, place: Place<'_>, key: &str) -> Result<Vec<String>, UsageError> {
    Ok(match value {
        DeValue::String(text) => vec![text.to_string()],
        DeValue::Integer(number) if number.radix() == 10 => vec![number.as_str().to_owned()],
        DeValue::Float(number) => vec![number.as_str().to_owned()],
        DeValue::Boolean(flag) => vec![flag.to_string()],
        DeValue::Array(values) => {
            let each = values.iter().map(|value| words(value.get_ref(), place, key));
            each.collect::<Result<Vec<_>, _>>()?.concat()
        }
        other => return Err(place.error(format!("{key}: a {} is not possible", other.type_str()))),
    })
}

fn line_of<T>(text: &str, value: &Spanned<T>) -> usize {
    line_at(text, value.span().start)
}

fn line_at(text: &str, at: usize) -> usize {
    text.as_bytes().iter().take(at).filter(|&&byte| byte == b'\n').count() + 1
}
