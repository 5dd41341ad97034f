//! What `thb fit` is to do: options of all layers put together, and the parts.

use std::path::{Path, PathBuf};

use clap::ArgMatches;
use reconstruct::{BatchOptions, BatchPart, Error, LayoutChoice, makes_solid, scans_in};

use crate::fit_args::{FitArgs, PartArgs, RunArgs, SaidArgs, Shard};
use crate::manifest::{Row, rows_of};
use crate::print_config::config_text;
use crate::settings::{Config, Place, Schema, Settings, UsageError, text_of};
use crate::{report_file, toml_file};

/// What a file may say.
#[derive(clap::Args, Debug)]
struct FileArgs {
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    part: PartArgs,
}

/// What is to be done.
pub(crate) enum Plan {
    /// Parts to fit.
    Fit(Box<Fits>),
    /// A text to print.
    Print(String),
}

/// Parts to fit.
pub(crate) struct Fits {
    pub(crate) parts: Vec<BatchPart>,
    pub(crate) run: RunArgs,
    pub(crate) batch: BatchOptions,
    /// What the user should know beforehand.
    pub(crate) warnings: Vec<String>,
}

/// What the arguments, and the files that they name, ask for.
pub(crate) fn plan(args: &FitArgs, matches: &ArgMatches) -> anyhow::Result<Plan> {
    let schema = Schema::of::<FileArgs>();
    let config = config_of(&schema, &args.said)?;
    let preset = preset_of(&schema, &args.said)?;
    let settings = preset.overridden_by(config.settings).overridden_by(schema.typed_ones(matches));
    if args.said.print_config {
        return Ok(Plan::Print(config_text(&schema, &settings)?));
    }
    let FileArgs { run, part } = schema.parse(&settings)?;
    if run.outputs.is_empty() {
        return Err(UsageError("no output: --output names a file or a directory".to_owned()).into());
    }
    let mut warnings = Vec::new();
    let mut parts = match &args.said.manifest {
        Some(_) if !args.inputs.is_empty() => {
            return Err(UsageError("inputs stand in --manifest or on the command line, not in both".to_owned()).into());
        }
        Some(path) => {
            let rows = rows_of(&Schema::of::<PartArgs>(), path)?;
            rows.into_iter().map(|row| part_of_row(&schema, &settings, row)).collect::<Result<_, _>>()?
        }
        None => {
            let inputs = inputs_of(args, config.input, &mut warnings)?;
            let options = part.options(run.threads);
            inputs.into_iter().map(|input| BatchPart::new(input, options.clone())).collect::<Vec<_>>()
        }
    };
    if let Some(name) = &run.name {
        let [part] = parts.as_slice() else {
            return Err(UsageError(format!("--name {name} names one part, and there are {}", parts.len())).into());
        };
        parts = vec![part.clone().named(name)];
    }
    if let Some(Shard { number, of }) = args.said.shard {
        parts = parts.into_iter().skip(number - 1).step_by(of).collect();
    }
    check_unused(&parts, &part, &run.outputs)?;
    let batch = BatchOptions {
        outputs: run.outputs.clone(),
        reports: run.reports.clone(),
        pages: !run.no_html,
        index: !run.no_html && args.said.shard.is_none(),
        resume: run.resume,
        summary: run.summary.clone(),
        jobs: run.jobs.into(),
    };
    Ok(Plan::Fit(Box::new(Fits { parts, run, batch, warnings })))
}

fn config_of(schema: &Schema, said: &SaidArgs) -> Result<Config, UsageError> {
    let Some(path) = &said.config else { return Ok(Config::default()) };
    let text = text_of(path)?;
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json")) {
        return report_file::config_of(schema, path, &text);
    }
    Ok(Config { settings: toml_file::settings_of(schema, path, &text)?, input: None })
}

fn preset_of(schema: &Schema, said: &SaidArgs) -> Result<Settings, UsageError> {
    let Some(preset) = said.preset else { return Ok(Settings::default()) };
    toml_file::settings_of(schema, Path::new("preset"), preset.text())
}

/// A part of a manifest, whose own options come last.
fn part_of_row(schema: &Schema, settings: &Settings, row: Row) -> Result<BatchPart, UsageError> {
    let FileArgs { run, part } = schema.parse(&settings.clone().overridden_by(row.settings))?;
    let of_row = BatchPart::new(row.input, part.options(run.threads));
    Ok(match row.name {
        Some(name) => of_row.named(&name),
        None => of_row,
    })
}

/// The scans that are named, those in directories that are named, or else that of the report which is done again.
fn inputs_of(
    args: &FitArgs,
    of_report: Option<(PathBuf, Option<String>)>,
    warnings: &mut Vec<String>,
) -> anyhow::Result<Vec<PathBuf>> {
    if args.inputs.is_empty() {
        let Some((input, hash)) = of_report else {
            return Err(UsageError("no input: name scans, a directory of scans, or a --manifest".to_owned()).into());
        };
        if hash.is_some() && hash != reconstruct::fingerprint(&input) {
            warnings.push(Place { file: &input, line: 0 }.error("it is not what it was for the report").0);
        }
        return Ok(vec![input]);
    }
    let mut inputs = Vec::new();
    for input in &args.inputs {
        if input.is_dir() { inputs.extend(scans_in(input)?) } else { inputs.push(input.clone()) }
    }
    Ok(inputs)
}

/// Options that nothing would come of, where no whole part is made.
fn check_unused(parts: &[BatchPart], args: &PartArgs, outputs: &[PathBuf]) -> Result<(), Error> {
    let is_one_sheet = match (parts, &args.solid.layout) {
        (_, LayoutChoice::One) => true,
        ([part], LayoutChoice::Auto) if args.solid.is_used() => {
            !makes_solid(&part.input, outputs, &part.options.solid.read)
        }
        _ => false,
    };
    if is_one_sheet { args.solid.check_unused() } else { Ok(()) }
}
