//! Options from files and from the command line in one form: what would be typed. The list of options is that of the command line, and
//! there is no other.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::fmt;
use std::path::{Path, PathBuf};

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command};

/// Something wrong with how the program was called, or with a file that says it.
#[derive(Debug)]
pub(crate) struct UsageError(pub(crate) String);

impl fmt::Display for UsageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for UsageError {}

/// Options by their long names, each with the values that would be typed behind it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Settings(BTreeMap<String, Vec<OsString>>);

/// A place in a file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place<'a> {
    pub(crate) file: &'a Path,
    /// From 1; 0 where it is not known.
    pub(crate) line: usize,
}

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if self.line > 0 { write!(f, ":{}", self.line) } else { Ok(()) }
    }
}

impl Place<'_> {
    /// An error at this place.
    pub(crate) fn error(self, message: impl fmt::Display) -> UsageError {
        UsageError(format!("{self}: {message}"))
    }
}

/// The options of some arguments, which a file may hold.
pub(crate) struct Schema {
    command: Command,
}

impl Schema {
    pub(crate) fn of<A: Args>() -> Self {
        let command = A::augment_args(Command::new("thb").no_binary_name(true).disable_help_flag(true));
        let mut command = command;
        command.build();
        Self { command }
    }

    /// All options.
    pub(crate) fn options(&self) -> impl Iterator<Item = &Arg> {
        self.command.get_arguments().filter(|arg| arg.get_long().is_some())
    }

    fn option(&self, name: &str) -> Option<&Arg> {
        let is_alias = |arg: &Arg| arg.get_all_aliases().is_some_and(|aliases| aliases.contains(&name));
        self.options().find(|arg| arg.get_long() == Some(name) || is_alias(arg))
    }

    /// The arguments with these settings.
    pub(crate) fn parse<A: clap::FromArgMatches>(&self, settings: &Settings) -> Result<A, UsageError> {
        let matches = self.matches(settings)?;
        A::from_arg_matches(&matches).map_err(|error| UsageError(said(&error)))
    }

    /// What clap makes of these settings.
    pub(crate) fn matches(&self, settings: &Settings) -> Result<ArgMatches, UsageError> {
        let typed = settings.0.iter().flat_map(|(name, values)| self.typed(name, values));
        self.command.clone().try_get_matches_from(typed).map_err(|error| UsageError(said(&error)))
    }

    /// An option as it is typed.
    fn typed(&self, name: &str, values: &[OsString]) -> Vec<OsString> {
        if self.option(name).is_some_and(is_flag) {
            let is_set = values.iter().any(|value| value == "true");
            return if is_set { vec![format!("--{name}").into()] } else { Vec::new() };
        }
        let with_name = |value: &OsString| {
            let mut typed = OsString::from(format!("--{name}="));
            typed.push(value);
            typed
        };
        values.iter().map(with_name).collect()
    }

    /// Takes an option of a file. `values` are joined by commas where the option is typed once.
    ///
    /// # Errors
    /// An option that is not known, with the one that may be meant; a value that is not possible.
    pub(crate) fn set(
        &self,
        settings: &mut Settings,
        place: Place<'_>,
        key: &str,
        values: &[String],
    ) -> Result<(), UsageError> {
        let option = self.known(place, key)?;
        let name = option.get_long().unwrap_or_default().to_owned();
        let is_repeated = matches!(option.get_action(), ArgAction::Append) && option.get_value_delimiter().is_none();
        let values: Vec<OsString> =
            if is_repeated { values.iter().map(OsString::from).collect() } else { vec![values.join(",").into()] };
        let is_switch = |value: &OsString| value == "true" || value == "false";
        if is_flag(option) && !values.iter().all(is_switch) {
            return Err(place.error(format!("{key}: {} is not possible: true or false", shown(&values))));
        }
        let alone = self.command.clone().try_get_matches_from(self.typed(&name, &values));
        alone.map_err(|error| place.error(format!("{key}: {}", said(&error))))?;
        settings.0.insert(name, values);
        Ok(())
    }

    /// The option of a name in a file, where `_` does for `-`.
    pub(crate) fn known(&self, place: Place<'_>, key: &str) -> Result<&Arg, UsageError> {
        let name = key.replace('_', "-");
        self.option(&name).ok_or_else(|| place.error(self.unknown(key, &name)))
    }

    fn unknown(&self, key: &str, name: &str) -> String {
        let error = self.command.clone().try_get_matches_from([format!("--{name}")]).err();
        let similar = error.as_ref().and_then(|error| error.get(ContextKind::SuggestedArg));
        let meant = match similar {
            Some(ContextValue::String(similar)) => format!("; {} may be meant", similar.trim_start_matches('-')),
            _ => "; thb fit --print-config has all".to_owned(),
        };
        format!("there is no option {key:?}{meant}")
    }

    /// What was typed, of these options.
    pub(crate) fn typed_ones(&self, matches: &ArgMatches) -> Settings {
        let mut settings = Settings::default();
        for option in self.options() {
            let (id, name) = (option.get_id().as_str(), option.get_long().unwrap_or_default());
            if matches.value_source(id) != Some(ValueSource::CommandLine) {
                continue;
            }
            let raw = matches.get_raw(id).map(|values| values.map(OsStr::to_owned).collect());
            let values = if is_flag(option) { vec!["true".into()] } else { raw.unwrap_or_default() };
            settings.0.insert(name.to_owned(), values);
        }
        settings
    }
}

impl Settings {
    /// These, and those of `others` before them.
    #[must_use]
    pub(crate) fn overridden_by(mut self, others: Self) -> Self {
        self.0.extend(others.0);
        self
    }
}

fn is_flag(option: &Arg) -> bool {
    matches!(option.get_action(), ArgAction::SetTrue)
}

fn shown(values: &[OsString]) -> String {
    values.iter().map(|value| format!("{:?}", value.to_string_lossy())).collect::<Vec<_>>().join(", ")
}

/// What clap says, in one line and without what it says about the command line.
fn said(error: &clap::Error) -> String {
    if error.kind() == ErrorKind::ValueValidation
        && let Some(source) = std::error::Error::source(error)
    {
        let value = match error.get(ContextKind::InvalidValue) {
            Some(ContextValue::String(value)) => value.as_str(),
            _ => "",
        };
        let reason = source.to_string();
        return if reason.contains("is not possible") {
            reason
        } else {
            format!("{value:?} is not possible: {reason}")
        };
    }
    let text = error.to_string();
    text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned()
}

/// The text of a file that says options.
pub(crate) fn text_of(path: &Path) -> Result<String, UsageError> {
    std::fs::read_to_string(path).map_err(|error| Place { file: path, line: 0 }.error(error))
}

/// What a file for `--config` says.
#[derive(Debug, Default)]
pub(crate) struct Config {
    pub(crate) settings: Settings,
    /// The scan of a report, and its fingerprint.
    pub(crate) input: Option<(PathBuf, Option<String>)>,
}
