//! Which column of a table holds what.

use super::super::ReadOptions;
use super::super::text::{parse_count, quote};
use super::Order;
use super::counter::{Counter, Written, first_is};
use super::dialect::Dialect;
use super::fields::Field;
use super::grid::Meaning;
use super::names::{Ijk, Names};
use crate::error::ReadErrorKind;
use crate::read::TakenColumn;
use crate::read::number::Value;

/// Names of coordinates in reports.
const AXES: [&str; 3] = ["x", "y", "z"];

/// The columns that are read, from 0.
#[derive(Clone, Debug, Default)]
pub(super) struct Roles {
    pub(super) coordinates: Vec<usize>,
    pub(super) parameters: Vec<usize>,
    pub(super) boundary: Option<usize>,
    pub(super) weights: Option<usize>,
    /// Columns of a normal, by their names or by the option.
    pub(super) normals: Option<[usize; 3]>,
    /// Columns of grid indices, by their names or by the option.
    pub(super) grid: Option<[usize; 2]>,
    /// Whether an option says that they are.
    pub(super) grid_is_given: bool,
    /// Columns that hold the one or the other.
    pub(super) ijk: Option<Ijk>,
    pub(super) notes: Vec<String>,
}

impl Roles {
    /// By names.
    ///
    /// # Errors
    /// [`ReadErrorKind::ColumnsNotFound`], [`ReadErrorKind::DuplicateColumn`], [`ReadErrorKind::OptionColumns`].
    pub(super) fn by_names(names: &Names, options: &ReadOptions) -> Result<Self, ReadErrorKind> {
        let mut missing = Vec::new();
        let mut roles = Self::default();
        let mut taken_for = None;
        if options.columns.is_empty() {
            match names.coordinates()? {
                Ok(found) => {
                    let other = |(&column, axis): (&usize, &&str)| !names.written[column].eq_ignore_ascii_case(axis);
                    if found.columns.iter().zip(&AXES).any(other) {
                        let written = names.listed(found.columns.iter().copied());
                        let axes = &AXES[..written.len()];
                        taken_for = Some(format!("columns {} were taken as {}", written.join(", "), axes.join(", ")));
                    }
                    roles.coordinates = found.columns;
                }
                Err(names) => missing = names,
            }
        }
        let mut find = |name: &String| -> Result<usize, ReadErrorKind> {
            let column = names.find_or_number(name)?;
            if column.is_none() {
                missing.push(name.clone());
            }
            Ok(column.unwrap_or_default())
        };
        for name in &options.columns {
            roles.coordinates.push(find(name)?);
        }
        roles.weights = options.weights.as_ref().map(&mut find).transpose()?;
        let normals = options.normals.iter().flatten().map(&mut find).collect::<Result<Vec<_>, _>>()?;
        let grid = options.grid.iter().flatten().map(&mut find).collect::<Result<Vec<_>, _>>()?;
        if !missing.is_empty() {
            let found = names.listed(0..names.written.len());
            return Err(ReadErrorKind::ColumnsNotFound { missing, found });
        }
        roles.set_given(&normals, &grid, options)?;
        if options.normals.is_none() {
            roles.normals = names.normals()?;
        }
        // One parameter is that of a curve; v without u says nothing.
        roles.parameters = match (names.find("u")?, names.find("v")?) {
            (Some(u), v) => std::iter::once(u).chain(v).filter(|column| !roles.coordinates.contains(column)).collect(),
            (None, _) => Vec::new(),
        };
        roles.boundary = names.find("boundary")?.filter(|column| !roles.coordinates.contains(column));
        // Who names the columns means no others, unless by options of their own.
        if options.columns.is_empty() && options.grid.is_none() {
            roles.grid = names.row_and_column()?;
            let ijk = names.ijk()?;
            let has_normals = options.normals.is_some() || roles.normals.is_some();
            // Where normals have other columns, i and j are indices, if they can be.
            roles.ijk = ijk.filter(|ijk| !has_normals || ijk.k.is_none());
        }
        roles.notes.extend(taken_for);
        Ok(roles)
    }

    /// By numbers, or by what the columns hold; `sample` are rows.
    ///
    /// # Errors
    /// [`ReadErrorKind::ColumnNumber`], [`ReadErrorKind::RowLength`], [`ReadErrorKind::NoNames`].
    pub(super) fn by_place(
        dialect: &Dialect,
        sample: &[Vec<Field<'_>>],
        first_row: usize,
        options: &ReadOptions,
    ) -> Result<Self, ReadErrorKind> {
        let number = |column: &String| {
            let number = parse_count(column.as_bytes()).filter(|&number| number > 0);
            number.map(|number| number - 1).ok_or_else(|| ReadErrorKind::ColumnNumber { column: column.clone() })
        };
        let numbers = |columns: &[String]| columns.iter().map(number).collect::<Result<Vec<_>, _>>();
        let mut roles = Self { coordinates: numbers(&options.columns)?, ..Self::default() };
        if let Some(weights) = &options.weights {
            roles.weights = Some(number(weights).map_err(|_| ReadErrorKind::NoNames { option: "weights" })?);
        }
        let normals = numbers(options.normals.as_deref().unwrap_or_default())?;
        let grid = numbers(options.grid.as_deref().unwrap_or_default())?;
        roles.set_given(&normals, &grid, options)?;
        if !roles.coordinates.is_empty() {
            return Ok(roles);
        }
        let columns = &dialect.number_columns[..];
        if columns.len() < 2 {
            let words = |row: &[Field<'_>]| row.iter().position(|f| dialect.style.value(f.text) == Value::Words);
            if let Some((row, column)) = sample.first().and_then(|row| Some((row, words(row)?))) {
                let text = quote(row[column].text);
                return Err(ReadErrorKind::NotANumberInTable { line: first_row, column: column + 1, text });
            }
            return Err(ReadErrorKind::RowLength { line: first_row, expected: 2, found: columns.len() });
        }
        let counter = if columns.len() > 3 { first_is(&written(dialect, sample)) } else { None };
        let first = usize::from(counter.is_some());
        roles.coordinates = columns[first..columns.len().min(first + 3)].to_vec();
        let listed = |columns: &[usize], sign: &str| {
            columns.iter().map(|column| (column + 1).to_string()).collect::<Vec<_>>().join(sign)
        };
        let taken = || {
            let axes = &AXES[..roles.coordinates.len()];
            format!("columns {} were taken as {}", listed(&roles.coordinates, ", "), axes.join(", "))
        };
        let note = match counter {
            Some(counter) => {
                let what = match counter {
                    Counter::Number => "only counts the points",
                    Counter::Time => "goes up by like steps, as a time does,",
                };
                let as_it_is = listed(&columns[..3], ",");
                let number = columns[0] + 1;
                Some(format!("column {number} {what} and was skipped: {}; --columns {as_it_is} takes it as x", taken()))
            }
            None if roles.coordinates.iter().enumerate().any(|(k, &column)| k != column) => {
                Some(format!("{}: those before them hold no numbers", taken()))
            }
            None => None,
        };
        let last = roles.coordinates.last().map_or(0, |last| last + 1);
        roles.notes.extend(note);
        if dialect.most_filled > last {
            roles.notes.push(match dialect.most_filled - last {
                1 => format!("column {} was ignored", last + 1),
                _ => format!("columns {} to {} were ignored", last + 1, dialect.most_filled),
            });
        }
        Ok(roles)
    }

    fn set_given(&mut self, normals: &[usize], grid: &[usize], options: &ReadOptions) -> Result<(), ReadErrorKind> {
        let wrong = |option, expected, given| ReadErrorKind::OptionColumns { option, expected, given };
        if options.normals.as_ref().is_some_and(|names| !names.is_empty()) {
            self.normals = Some(normals.try_into().map_err(|_| wrong("normals", 3, normals.len()))?);
        }
        if options.grid.as_ref().is_some_and(|names| !names.is_empty()) {
            self.grid = Some(grid.try_into().map_err(|_| wrong("grid", 2, grid.len()))?);
            self.grid_is_given = true;
        }
        Ok(())
    }

    /// The columns that every row must have.
    pub(super) fn needed(&self) -> usize {
        let all = self.coordinates.iter().chain(&self.parameters).chain(&self.weights);
        all.chain(&self.boundary).max().map_or(0, |last| last + 1)
    }

    /// What was taken, once it is known what i, j and k mean.
    pub(super) fn taken(&self, order: Order, names: Option<&Names>) -> Vec<TakenColumn> {
        let mut taken: Vec<(usize, &'static str)> = Vec::new();
        taken.extend(
            self.coordinates
                .iter()
                .zip(["x", "y", "z"].into_iter().chain(std::iter::repeat("coordinate")))
                .map(|(&column, axis)| (column, axis)),
        );
        taken.extend(self.parameters.iter().copied().zip(["u", "v"]));
        taken.extend(self.boundary.map(|column| (column, "boundary")));
        taken.extend(self.weights.map(|column| (column, "weight")));
        let normals = self.normals.or_else(|| {
            let Ijk { ij: [i, j], k } = self.ijk.filter(|_| order.ijk == Some(Meaning::Normals))?;
            Some([i, j, k?])
        });
        taken.extend(normals.into_iter().flatten().zip(["normal x", "normal y", "normal z"]));
        let grid = self.grid.or_else(|| self.ijk.map(|ijk| ijk.ij)).filter(|_| order.is_grid);
        taken.extend(grid.into_iter().flatten().zip(["grid row", "grid column"]));
        let name = |column: usize| names.and_then(|names| names.written.get(column).cloned());
        taken.into_iter().map(|(column, role)| TakenColumn { number: column + 1, name: name(column), role }).collect()
    }
}

/// The number columns of a sample of rows.
fn written(dialect: &Dialect, sample: &[Vec<Field<'_>>]) -> Vec<Written> {
    let mut columns = vec![Written::new(); dialect.number_columns.len().min(4)];
    'rows: for row in sample {
        let mut values = [0.0; 4];
        for (value, &column) in values.iter_mut().zip(&dialect.number_columns) {
            match row.get(column).map(|field| dialect.style.value(field.text)) {
                Some(Value::Number(number)) => *value = number,
                _ => continue 'rows,
            }
        }
        for ((written, value), &column) in columns.iter_mut().zip(values).zip(&dialect.number_columns) {
            written.push(row[column].text, value);
        }
    }
    columns
}
