//! What is typed: the command line's parser, and the parsers of its values.

use std::fmt::{Debug, Display};
use std::str::FromStr;
use std::sync::{LazyLock, Mutex};

use clap::{CommandFactory, FromArgMatches};
use reconstruct::{
    BlendChoice, ClosedChoice, CornerChoice, Crop, CurveParameters, Ends, GivenCorners, KnotChoice, LambdaChoice,
    LossChoice, Mark, MarkerChoice, Method, Pair, ParameterChoice, RadiusChoice, Sharp, Smoothness, Tolerance,
    UpdateChoice,
};

use super::messages;
use crate::args::{Cli, Command};
use crate::bounds::{Bounds, bounded};

/// Bytes that the program's own list of options stands for.
const BYTES: usize = 1 << 14;

/// Takes the lines as what is typed, and the whole as a value of each option.
pub(super) fn run(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    bounded(Bounds::of_reading(BYTES + bytes.len(), BYTES + bytes.len()), || {
        match parse(std::iter::once("thb").chain(text.lines())) {
            Ok(cli) => check(cli.command),
            // Help and usage have several lines.
            Err(error) => assert!(!error.to_string().trim().is_empty(), "a message is empty"),
        }
        values(&text);
    });
}

/// What the program makes of what is typed. The list of options is kept: making it takes far longer than what is done with it.
fn parse<'a>(typed: impl Iterator<Item = &'a str>) -> Result<Cli, clap::Error> {
    static COMMAND: LazyLock<Mutex<clap::Command>> = LazyLock::new(|| Mutex::new(Cli::command()));
    let mut command = COMMAND.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let matches = command.try_get_matches_from_mut(typed)?;
    Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
}

fn check(command: Command) {
    let result = match command {
        Command::Fit(args) => {
            let options = args.part.options(args.run.threads);
            let as_solid = options.solid.check();
            args.part.solid.check_unused().and_then(|()| options.surface.check()).and(as_solid)
        }
        Command::FitCurve(args) => args.options().check(),
        Command::Param(args) => args.layout.options().check(),
        Command::Compare { read, .. } | Command::Info { read, .. } => {
            let _ = read.options();
            return;
        }
        Command::Eval { .. } | Command::Convert { .. } | Command::Index { .. } => return,
    };
    if let Err(error) = result {
        messages::check(&error.to_string());
    }
}

fn values(text: &str) {
    value::<BlendChoice>(text);
    value::<ClosedChoice>(text);
    value::<CornerChoice>(text);
    value::<Crop>(text);
    value::<CurveParameters>(text);
    value::<Ends>(text);
    value::<GivenCorners>(text);
    value::<KnotChoice>(text);
    value::<LambdaChoice>(text);
    value::<LossChoice>(text);
    value::<Mark>(text);
    value::<MarkerChoice>(text);
    value::<Method>(text);
    value::<Pair>(text);
    value::<ParameterChoice>(text);
    value::<RadiusChoice>(text);
    value::<Sharp>(text);
    value::<Smoothness>(text);
    value::<Tolerance>(text);
    value::<UpdateChoice>(text);
}

/// Checks that a value reads back as it is written: reports write options as they are typed.
fn value<T: FromStr<Err: Display> + Display + Debug>(text: &str) {
    match text.parse::<T>() {
        Ok(value) => {
            let typed = value.to_string();
            let again = typed.parse::<T>();
            let again = again.unwrap_or_else(|error| panic!("{text:?} is written {typed:?}: {error}"));
            // NaN is not equal to itself, so texts are compared.
            assert_eq!(format!("{again:?}"), format!("{value:?}"), "{text:?} is written {typed:?}");
        }
        Err(error) => assert!(!error.to_string().trim().is_empty(), "a message is empty"),
    }
}
