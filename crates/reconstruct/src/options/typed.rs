//! How options are typed, read and told.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::{Serialize, Serializer};

use crate::Error;

/// A number as it was typed.
pub(crate) fn typed(number: Option<usize>) -> String {
    number.map_or_else(String::new, |n| n.to_string())
}

/// The check of an option's range.
pub(crate) fn range(option: &'static str, given: String, allowed: &'static str, ok: bool) -> Result<(), Error> {
    if ok { Ok(()) } else { Err(Error::OptionRange { option, given, allowed }) }
}

/// An option that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{given:?} is not possible: {expected}")]
pub struct ParseOptionError {
    given: String,
    expected: &'static str,
}

pub(crate) fn parse_error(given: &str, expected: &'static str) -> ParseOptionError {
    ParseOptionError { given: given.to_owned(), expected }
}

/// Serializes an option as it is typed.
macro_rules! serialize_as_typed {
    ($($type:ty),*) => {$(
        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.collect_str(self)
            }
        }
    )*};
}
pub(crate) use serialize_as_typed;
/// An option with a fixed set of names.
macro_rules! named {
    ($(#[$doc:meta])* $type:ident, $expected:literal, $($(#[$variant_doc:meta])* $variant:ident = $name:literal),*) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $type { $($(#[$variant_doc])* $variant),* }

        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(match self { $(Self::$variant => $name),* })
            }
        }

        impl std::str::FromStr for $type {
            type Err = $crate::ParseOptionError;

            fn from_str(text: &str) -> Result<Self, $crate::ParseOptionError> {
                match text { $($name => Ok(Self::$variant),)* _ => Err($crate::options::typed::parse_error(text, $expected)) }
            }
        }
    };
}

pub(crate) use named;

/// One number for each direction: `2` for both, or `2,3`; meshes are also written `8x8`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Pair(pub [usize; 2]);

impl FromStr for Pair {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, ParseOptionError> {
        let wrong = || parse_error(text, "one whole number, or two as in 2,3 or 8x8");
        let parts: Result<Vec<usize>, _> = text.split([',', 'x']).map(|part| part.trim().parse()).collect();
        match parts.map_err(|_| wrong())?.as_slice() {
            [both] => Ok(Self([*both; 2])),
            [u, v] => Ok(Self([*u, *v])),
            _ => Err(wrong()),
        }
    }
}

impl fmt::Display for Pair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{}", self.0[0], self.0[1])
    }
}

/// A path as reports have it: what of its name is no text is replaced.
pub(crate) fn shown<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

/// Paths as reports have them.
pub(crate) fn all_shown<'a, S: Serializer>(
    paths: impl IntoIterator<Item = &'a PathBuf>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(paths.into_iter().map(|path| path.to_string_lossy()))
}
