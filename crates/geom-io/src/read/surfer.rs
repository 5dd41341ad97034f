//! Surfer text grids (`DSAA`): heights at the nodes of a grid, the southern row first.

use super::heights::{self, Axis, Grid, NoData};
use super::number::{NumberStyle, Value};
use super::table::decimal_of;
use super::text::{Line, Lines};
use super::{Format, ReadOptions, Scan};
use crate::error::ReadErrorKind;

/// From this number on a node has no data, as Golden Software's description of the format says.
const BLANK: f64 = 1.70141e38;

/// Whether a file is a Surfer grid by its first bytes; binary ones are, too.
pub(super) fn opens(bytes: &[u8]) -> bool {
    [b"DSAA", b"DSBB", b"DSRB"].iter().any(|mark| bytes.starts_with(*mark))
}

pub(super) fn read(mut lines: Lines<'_>, options: &ReadOptions) -> Result<Scan, ReadErrorKind> {
    let decimal = decimal_of(lines.clone(), options.decimal)?;
    let first = lines.next_filled().ok_or(ReadErrorKind::NoPoints)?;
    if first.text != b"DSAA" {
        let reason = match opens(first.text) {
            true => "a binary Surfer grid cannot be read; save it as a text grid (DSAA)",
            false => "expected DSAA, which opens a Surfer text grid",
        };
        return Err(if first.text.starts_with(b"DS") || super::text::is_text(first.text) {
            ReadErrorKind::Header {
                line: first.number,
                text: super::text::quote(&first.text[..first.text.len().min(4)]),
                reason,
            }
        } else {
            ReadErrorKind::NotText { line: first.number }
        });
    }
    let mut pair = || -> Result<(Line<'_>, [&[u8]; 2]), ReadErrorKind> {
        let line = lines.next_filled().ok_or(ReadErrorKind::MissingKey { key: "size or range" })?;
        let fields: Vec<&[u8]> = line.fields().collect();
        let fields = fields.try_into().map_err(|_| line.bad_header("expected two numbers"))?;
        Ok((line, fields))
    };
    let (line, fields) = pair()?;
    let [n_u, n_v] = fields.map(heights::count);
    let (n_u, n_v) = n_u.zip(n_v).ok_or_else(|| line.bad_header("expected the numbers of columns and rows"))?;
    let mut range = |count: usize| -> Result<Axis, ReadErrorKind> {
        let (line, fields) = pair()?;
        let style = NumberStyle { decimal, grouped: false };
        let [Value::Number(lower), Value::Number(upper)] = fields.map(|field| style.value(field)) else {
            return Err(line.bad_header("expected the least and the greatest coordinate"));
        };
        let step = (upper - lower) / count.saturating_sub(1).max(1) as f64;
        match step > 0.0 && step.is_finite() {
            true => Ok(Axis { origin: lower, step, shift: 0.0, count }),
            false => Err(line.bad_header("the greatest coordinate must be above the least")),
        }
    };
    let (x, y) = (range(n_u)?, range(n_v)?);
    // The range of the heights tells nothing that they don't.
    pair()?;
    let grid = Grid { format: Format::SurferGrid, x, y, from_north: false, no_data: NoData::From(BLANK) };
    heights::read(lines, &grid, decimal)
}
