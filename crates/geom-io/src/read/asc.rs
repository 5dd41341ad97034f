//! ESRI ASCII grids: heights over a rectangle of cells, the northern row first.

use point_cloud::GridShape;

use super::text::{Line, Lines, Separator, finite, parse_count, parse_number};
use super::{Format, ReadOptions, Scan, rows, xyz};
use crate::error::ReadErrorKind;

/// The mark of a cell without data where the header gives none (Esri's default).
const DEFAULT_NO_DATA: f64 = -9999.0;

/// Points are the cells' centres, parameters `(i/(n_u−1), j/(n_v−1))`: 0 and 1 at the outermost centres.
pub(super) fn read(bytes: &[u8], options: &ReadOptions) -> Result<Scan, ReadErrorKind> {
    let mut lines = Lines::new(bytes);
    let mut line = lines.next_filled();
    if line.is_some_and(opens_point_list) {
        return xyz::read(bytes, options);
    }
    let mut header = Header::default();
    while let Some(current) = line.filter(|&line| !starts_with_number(line)) {
        header.set(current)?;
        line = lines.next_filled();
    }
    let (n_u, n_v) = header.size()?;
    let [x, y] = header.axes()?;

    let cells = n_u.saturating_mul(n_v);
    // A cell takes two bytes at least, its digit and a blank. NaN marks one without data.
    let mut heights = Vec::with_capacity(cells.min(bytes.len() / 2 + 1));
    while let Some(current) = line {
        for field in current.fields() {
            let value = current.number(field)?;
            let no_data = value == header.no_data || (value.is_nan() && header.no_data.is_nan());
            heights.push(if no_data { f64::NAN } else { finite(value, || current.location())? });
        }
        line = lines.next_filled();
    }
    match heights.len() {
        found if found < cells => {
            return Err(ReadErrorKind::Truncated { element: "cell".to_owned(), expected: cells, found });
        }
        found if found > cells => return Err(ReadErrorKind::Surplus { expected: cells, found }),
        _ => {}
    }

    let (mut points, mut parameters) = (Vec::with_capacity(3 * cells), Vec::with_capacity(2 * cells));
    let mut numbers = Vec::with_capacity(cells);
    for i in 0..n_u {
        for j in 0..n_v {
            let number = (n_v - 1 - j) * n_u + i;
            let height: f64 = heights[number];
            if height.is_nan() {
                continue;
            }
            numbers.push(number as u32);
            points.extend([x.centre(i), y.centre(j), height]);
            parameters.extend([i as f64 / (n_u - 1) as f64, j as f64 / (n_v - 1) as f64]);
        }
    }
    let skipped = cells - points.len() / 3;
    let mut scan = Scan::new(Format::EsriGrid, rows(points, 3));
    scan.cloud.parameters = Some(rows(parameters, 2));
    scan.rows = numbers;
    scan.cell = Some([x.step, y.step]);
    match skipped {
        0 => scan.cloud.grid = Some(GridShape { n_u, n_v }),
        _ => scan.notes.push(format!("{skipped} of {cells} cells have no data and were skipped")),
    }
    Ok(scan)
}

/// Point lists, too, come with this extension; they open with a number or a comment.
fn opens_point_list(line: Line<'_>) -> bool {
    starts_with_number(line) || line.text.starts_with(b"#") || line.text.starts_with(b"//")
}

fn starts_with_number(line: Line<'_>) -> bool {
    let separator = Separator::of(line.text);
    separator.fields(line.text).next().is_some_and(|field| parse_number(field).is_some())
}

/// Centres of the cells along one direction.
#[derive(Clone, Copy)]
struct Axis {
    origin: f64,
    step: f64,
    /// Where the first centre lies, in steps from the origin.
    shift: f64,
}

impl Axis {
    fn centre(self, k: usize) -> f64 {
        self.origin + (k as f64 + self.shift) * self.step
    }
}

struct Header {
    columns: Option<usize>,
    rows: Option<usize>,
    /// Origin, and whether it is the corner of the first cell (0.5) or its centre (0).
    x: Option<(f64, f64)>,
    y: Option<(f64, f64)>,
    dx: Option<f64>,
    dy: Option<f64>,
    no_data: f64,
}

impl Default for Header {
    fn default() -> Self {
        Self { columns: None, rows: None, x: None, y: None, dx: None, dy: None, no_data: DEFAULT_NO_DATA }
    }
}

impl Header {
    fn set(&mut self, line: Line<'_>) -> Result<(), ReadErrorKind> {
        let mut fields = line.fields();
        let key = String::from_utf8_lossy(fields.next().unwrap_or_default()).to_ascii_lowercase();
        let value = fields.next().ok_or_else(|| line.bad_header("the key has no value"))?;
        if fields.next().is_some() {
            return Err(line.bad_header("expected one value"));
        }
        let count =
            || parse_count(value).filter(|&n| n > 0).ok_or_else(|| line.bad_header("expected a number of cells"));
        let step = || match line.coordinate(value)? {
            step if step > 0.0 => Ok(step),
            _ => Err(line.bad_header("a cell needs a positive size")),
        };
        match key.as_str() {
            "ncols" => self.columns = Some(count()?),
            "nrows" => self.rows = Some(count()?),
            "xllcorner" => self.x = Some((line.coordinate(value)?, 0.5)),
            "xllcenter" => self.x = Some((line.coordinate(value)?, 0.0)),
            "yllcorner" => self.y = Some((line.coordinate(value)?, 0.5)),
            "yllcenter" => self.y = Some((line.coordinate(value)?, 0.0)),
            "cellsize" => (self.dx, self.dy) = (Some(step()?), Some(step()?)),
            "dx" => self.dx = Some(step()?),
            "dy" => self.dy = Some(step()?),
            "nodata_value" => self.no_data = line.number(value)?,
            _ => return Err(line.bad_header("unknown key of an ESRI ASCII grid")),
        }
        Ok(())
    }

    /// Numbers of columns and rows.
    fn size(&self) -> Result<(usize, usize), ReadErrorKind> {
        let n_u = self.columns.ok_or(ReadErrorKind::MissingKey { key: "ncols" })?;
        let n_v = self.rows.ok_or(ReadErrorKind::MissingKey { key: "nrows" })?;
        match n_u.min(n_v) < 2 {
            true => Err(ReadErrorKind::GridTooSmall { n_u, n_v }),
            false => Ok((n_u, n_v)),
        }
    }

    fn axes(&self) -> Result<[Axis; 2], ReadErrorKind> {
        let axis =
            |origin: Option<(f64, f64)>, step: Option<f64>, origin_key, step_key| -> Result<Axis, ReadErrorKind> {
                let (origin, shift) = origin.ok_or(ReadErrorKind::MissingKey { key: origin_key })?;
                let step = step.ok_or(ReadErrorKind::MissingKey { key: step_key })?;
                Ok(Axis { origin, step, shift })
            };
        Ok([
            axis(self.x, self.dx, "xllcorner or xllcenter", "cellsize or dx")?,
            axis(self.y, self.dy, "yllcorner or yllcenter", "cellsize or dy")?,
        ])
    }
}
