//! What a batch is made of.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use geom_io::Format;

use crate::output::{NAME, part_name};
use crate::{Error, Fit, FitOptions, LayoutChoice, SolidOptions, makes_solid};

/// A part of a batch.
#[derive(Clone, Debug, PartialEq)]
pub struct BatchPart {
    /// The file.
    pub input: PathBuf,
    /// The name of its files in an output directory.
    pub name: OsString,
    /// The name of the product in STEP files; empty for that of the file.
    pub product: String,
    /// How it is fitted.
    pub options: PartOptions,
}

impl BatchPart {
    /// A part of the name of its file.
    pub fn new(input: PathBuf, options: PartOptions) -> Self {
        Self { name: part_name(&input), product: String::new(), input, options }
    }

    /// The same under another name, which is that of the product, too.
    #[must_use]
    pub fn named(self, name: &str) -> Self {
        Self { name: name.into(), product: name.to_owned(), ..self }
    }

    /// Gives the name of the product, if there is one, to a model.
    pub(super) fn sign(&self, fit: &mut Fit) {
        if !self.product.is_empty() {
            fit.model.metadata.insert(NAME.to_owned(), self.product.clone().into());
        }
    }

    /// Whether it is fitted as a whole part.
    pub(super) fn is_solid(&self, outputs: &[PathBuf]) -> bool {
        match self.options.solid.layout {
            LayoutChoice::One => false,
            LayoutChoice::Auto => makes_solid(&self.input, outputs, &self.options.solid.read),
            LayoutChoice::Patches | LayoutChoice::File(_) => true,
        }
    }
}

/// How a part is fitted: as a sheet of four sides or as a whole part.
#[derive(Clone, Debug, PartialEq)]
pub struct PartOptions {
    /// As a sheet.
    pub surface: FitOptions,
    /// As a whole part. Its layout decides which: a sheet with [`LayoutChoice::One`]; with [`LayoutChoice::Auto`] a whole part if the file
    /// holds one closed mesh, and STEP files are made of it.
    pub solid: SolidOptions,
}

impl Default for PartOptions {
    fn default() -> Self {
        let solid = SolidOptions { layout: LayoutChoice::Auto, ..SolidOptions::default() };
        Self { surface: FitOptions::default(), solid }
    }
}

impl From<FitOptions> for PartOptions {
    /// A sheet.
    fn from(surface: FitOptions) -> Self {
        let solid = SolidOptions { layout: LayoutChoice::One, ..SolidOptions::default() };
        Self { surface, solid }
    }
}

/// The files of a directory that have the extension of a scan, or that and `.gz`, in the order of their names.
///
/// # Errors
/// [`Error::Io`], [`Error::NoScans`].
pub fn scans_in(directory: &Path) -> Result<Vec<PathBuf>, Error> {
    let list = || -> std::io::Result<Vec<PathBuf>> {
        let entries = std::fs::read_dir(directory)?.map(|entry| entry.map(|entry| entry.path()));
        entries.collect()
    };
    let mut files = list().map_err(|source| Error::Io { path: directory.to_owned(), source })?;
    files.retain(|path| path.is_file() && Format::from_path(path).is_ok());
    files.sort();
    if files.is_empty() { Err(Error::NoScans { path: directory.to_owned() }) } else { Ok(files) }
}
