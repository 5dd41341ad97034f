//! All options as a file.

use std::fmt::Write;

use clap::builder::StyledStr;

use crate::settings::{Schema, Settings, UsageError};

/// All options with these settings, as `--config` reads them. Options without a value stand in comments.
pub(crate) fn config_text(schema: &Schema, settings: &Settings) -> Result<String, UsageError> {
    let matches = schema.matches(settings)?;
    let mut headings: Vec<&str> = Vec::new();
    for option in schema.options() {
        let heading = option.get_help_heading().unwrap_or_default();
        if !headings.contains(&heading) {
            headings.push(heading);
        }
    }
    let mut text = String::from("# Options of thb fit, for --config.\n");
    for heading in headings {
        if !heading.is_empty() {
            let _ = write!(text, "\n# == {heading} ==\n");
        }
        for option in schema.options().filter(|option| option.get_help_heading().unwrap_or_default() == heading) {
            let name = option.get_long().unwrap_or_default();
            let _ = writeln!(text, "\n# {}", first_sentence(option.get_help()));
            let raw = matches.get_raw(option.get_id().as_str());
            let values: Vec<String> = raw
                .map(|values| values.map(|value| value.to_string_lossy().into_owned()).collect())
                .unwrap_or_default();
            let _ = match values.as_slice() {
                [] => writeln!(text, "# {name} ="),
                [one] => writeln!(text, "{name} = {}", toml_value(one)),
                several => {
                    let each: Vec<String> = several.iter().map(|value| toml_value(value)).collect();
                    writeln!(text, "{name} = [{}]", each.join(", "))
                }
            };
        }
    }
    Ok(text)
}

fn first_sentence(help: Option<&StyledStr>) -> String {
    let help = help.map(ToString::to_string).unwrap_or_default();
    let end = help.find(". ").unwrap_or(help.len());
    help[..end].split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A word as TOML has it: whole numbers and switches as they are, all else in quotes.
fn toml_value(word: &str) -> String {
    let is_bare =
        matches!(word, "true" | "false") || word.parse::<u32>().is_ok_and(|number| number.to_string() == word);
    // A string of JSON is one of TOML.
    if is_bare { word.to_owned() } else { serde_json::Value::from(word).to_string() }
}
