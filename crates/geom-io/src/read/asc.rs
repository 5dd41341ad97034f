//! ESRI ASCII grids: heights over a rectangle of cells, the northern row first; and those of GRASS, whose header gives the sides of the
//! rectangle in place of a corner and the size of the cells.

use super::heights::{self, Axis, Grid, NoData};
use super::number::{NumberStyle, Value};
use super::table::{before_comment, decimal_of};
use super::text::{Line, Lines};
use super::{Format, ReadOptions, Scan};
use crate::error::ReadErrorKind;

/// The mark of a cell without data where the header gives none (Esri's default).
const DEFAULT_NO_DATA: f64 = -9999.0;

/// Keys that open a header, in lower case. (A mark of no data opens tables, too.)
const KEYS: [&[u8]; 13] = [
    b"ncols",
    b"nrows",
    b"xllcorner",
    b"xllcenter",
    b"yllcorner",
    b"yllcenter",
    b"cellsize",
    b"north:",
    b"south:",
    b"east:",
    b"west:",
    b"rows:",
    b"cols:",
];

/// Whether a line opens an ESRI grid.
pub(super) fn opens(line: Line<'_>) -> bool {
    line.fields().next().is_some_and(|word| KEYS.iter().any(|key| word.eq_ignore_ascii_case(key)))
}

pub(super) fn read(mut lines: Lines<'_>, options: &ReadOptions) -> Result<Scan, ReadErrorKind> {
    let decimal = decimal_of(lines.clone(), options.decimal)?;
    let mut header = Header::new(NumberStyle { decimal, grouped: false });
    let mut heights = lines.clone();
    while let Some(line) = lines.next_data(before_comment).filter(|&line| !header.starts_with_value(line)) {
        header.set(line)?;
        heights = lines.clone();
    }
    let [x, y] = header.axes()?;
    let grid = Grid { format: Format::EsriGrid, x, y, from_north: true, no_data: header.no_data };
    heights::read(heights, &grid, decimal)
}

struct Header {
    style: NumberStyle,
    columns: Option<usize>,
    rows: Option<usize>,
    /// Origin, and whether it is the corner of the first cell (0.5) or its centre (0).
    x: Option<(f64, f64)>,
    y: Option<(f64, f64)>,
    dx: Option<f64>,
    dy: Option<f64>,
    /// The sides of the rectangle: west and east, south and north.
    sides: [[Option<f64>; 2]; 2],
    no_data: NoData,
}

impl Header {
    fn new(style: NumberStyle) -> Self {
        let no_data = NoData::Number(DEFAULT_NO_DATA);
        Self { style, columns: None, rows: None, x: None, y: None, dx: None, dy: None, sides: [[None; 2]; 2], no_data }
    }

    /// Whether a line opens with a height, or with a word for none.
    fn starts_with_value(&self, line: Line<'_>) -> bool {
        line.fields().next().is_some_and(|field| self.style.value(field) != Value::Words)
    }

    fn set(&mut self, line: Line<'_>) -> Result<(), ReadErrorKind> {
        let mut fields = line.fields();
        let key = String::from_utf8_lossy(fields.next().unwrap_or_default()).to_ascii_lowercase();
        let value = fields.next().ok_or_else(|| line.bad_header("the key has no value"))?;
        if fields.next().is_some() {
            return Err(line.bad_header("expected one value"));
        }
        let count = || heights::count(value).ok_or_else(|| line.bad_header("expected a number of cells"));
        let number = || match self.style.value(value) {
            Value::Number(number) => Ok(number),
            _ => Err(line.bad_header("expected a number")),
        };
        let step = || match number()? {
            step if step > 0.0 => Ok(step),
            _ => Err(line.bad_header("a cell needs a positive size")),
        };
        match key.as_str() {
            "ncols" | "cols:" => self.columns = Some(count()?),
            "nrows" | "rows:" => self.rows = Some(count()?),
            "xllcorner" => self.x = Some((number()?, 0.5)),
            "xllcenter" => self.x = Some((number()?, 0.0)),
            "yllcorner" => self.y = Some((number()?, 0.5)),
            "yllcenter" => self.y = Some((number()?, 0.0)),
            "cellsize" => (self.dx, self.dy) = (Some(step()?), Some(step()?)),
            "west:" => self.sides[0][0] = Some(number()?),
            "east:" => self.sides[0][1] = Some(number()?),
            "south:" => self.sides[1][0] = Some(number()?),
            "north:" => self.sides[1][1] = Some(number()?),
            "dx" => self.dx = Some(step()?),
            "dy" => self.dy = Some(step()?),
            // A word for no value, such as nan or null, stands for none in the body, too.
            "nodata_value" | "null:" => {
                self.no_data = match self.style.value(value) {
                    Value::Number(number) => NoData::Number(number),
                    Value::Missing => NoData::None,
                    Value::Words => return Err(line.bad_header("expected a number, nan or null")),
                }
            }
            // Whole or not, single or double: the numbers tell.
            "type:" => {}
            _ => return Err(line.bad_header("unknown key of an ESRI or GRASS ASCII grid")),
        }
        Ok(())
    }

    fn axes(&self) -> Result<[Axis; 2], ReadErrorKind> {
        let count = |count: Option<usize>, key| count.ok_or(ReadErrorKind::MissingKey { key });
        let (columns, rows) = (count(self.columns, "ncols")?, count(self.rows, "nrows")?);
        let axis = |sides: [Option<f64>; 2],
                    origin: Option<(f64, f64)>,
                    step: Option<f64>,
                    count,
                    [origin_key, step_key]: [&'static str; 2]|
         -> Result<Axis, ReadErrorKind> {
            if let [Some(lower), Some(upper)] = sides {
                let step = (upper - lower) / count as f64;
                return match step > 0.0 {
                    true => Ok(Axis { origin: lower, step, shift: 0.5, count }),
                    false => Err(ReadErrorKind::MissingKey { key: "rectangle: east above west, north above south" }),
                };
            }
            let (origin, shift) = origin.ok_or(ReadErrorKind::MissingKey { key: origin_key })?;
            let step = step.ok_or(ReadErrorKind::MissingKey { key: step_key })?;
            Ok(Axis { origin, step, shift, count })
        };
        Ok([
            axis(self.sides[0], self.x, self.dx, columns, ["xllcorner or xllcenter", "cellsize or dx"])?,
            axis(self.sides[1], self.y, self.dy, rows, ["yllcorner or yllcenter", "cellsize or dy"])?,
        ])
    }
}
