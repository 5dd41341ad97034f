//! Grids of heights: what those of ESRI, Surfer and GeoTIFF have in common.

use point_cloud::{GridShape, MAX_COORDINATE};

use super::number::{Decimal, NumberStyle, Value, is_declared};
use super::text::{Lines, parse_count};
use super::{Format, Scan, rows, with_room};
use crate::error::ReadErrorKind;

/// Centres of the cells along one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    pub(super) origin: f64,
    pub(super) step: f64,
    /// Where the first centre lies, in steps from the origin.
    pub(super) shift: f64,
    pub(super) count: usize,
}

impl Axis {
    fn centre(self, k: usize) -> f64 {
        self.origin + (k as f64 + self.shift) * self.step
    }
}

/// What a header says of the heights that follow it.
pub(super) struct Grid {
    pub(super) format: Format,
    pub(super) x: Axis,
    pub(super) y: Axis,
    /// Whether the first line of heights is the northern one.
    pub(super) from_north: bool,
    /// Whether a value stands for no data.
    pub(super) no_data: NoData,
}

/// Values that stand for no data, beside those that are no numbers.
#[derive(Clone, Copy, Debug)]
pub(super) enum NoData {
    /// None.
    None,
    /// A number.
    Number(f64),
    /// All numbers from one on.
    From(f64),
}

impl NoData {
    fn holds(self, value: f64) -> bool {
        match self {
            Self::None => false,
            Self::Number(declared) => is_declared(value, declared),
            Self::From(least) => value >= least,
        }
    }
}

impl Grid {
    /// Checks that there are enough cells, none of them too far away.
    pub(super) fn check(&self) -> Result<(), ReadErrorKind> {
        let (n_u, n_v) = (self.x.count, self.y.count);
        if n_u.min(n_v) < 2 {
            return Err(ReadErrorKind::GridTooSmall { n_u, n_v });
        }
        for (axis, name) in [(self.x, "x"), (self.y, "y")] {
            let ends = [axis.centre(0), axis.centre(axis.count - 1)];
            if let Some(&value) = ends.iter().find(|value| value.is_nan() || value.abs() > MAX_COORDINATE) {
                return Err(ReadErrorKind::GridRange { axis: name, value, limit: MAX_COORDINATE });
            }
        }
        Ok(())
    }

    /// A height as it is kept: NaN where there is none.
    pub(super) fn height(&self, value: f64) -> f64 {
        if self.no_data.holds(value) { f64::NAN } else { value }
    }
}

/// Reads the heights from text.
pub(super) fn read(lines: Lines<'_>, grid: &Grid, decimal: Decimal) -> Result<Scan, ReadErrorKind> {
    grid.check()?;
    let style = NumberStyle { decimal, grouped: false };
    let (n_u, n_v) = (grid.x.count, grid.y.count);
    let cells = n_u.saturating_mul(n_v);
    let mut heights = Vec::new();
    // A cell takes two bytes at least, its digit and a blank. NaN marks one without data.
    let room = cells.min(lines.rest().len() / 2 + 1);
    heights.try_reserve_exact(room).map_err(|_| ReadErrorKind::Memory { bytes: 8 * room })?;
    let mut lines = lines;
    while let Some(line) = lines.next_filled() {
        for field in line.fields() {
            heights.push(match style.value(field) {
                Value::Number(value) => grid.height(value),
                Value::Missing => f64::NAN,
                Value::Words => return Err(line.not_a_number(field)),
            });
        }
    }
    match heights.len() {
        found if found < cells => {
            return Err(ReadErrorKind::Truncated { element: "cell".to_owned(), expected: cells, found });
        }
        found if found > cells => return Err(ReadErrorKind::Surplus { expected: cells, found }),
        _ => {}
    }
    scan(&heights, grid)
}

/// The scan of a grid with all its heights, in the order of the file, NaN where there is none. Points are the cells' centres, parameters
/// `(i/(n_u−1), j/(n_v−1))`: 0 and 1 at the outermost centres.
pub(super) fn scan(heights: &[f64], grid: &Grid) -> Result<Scan, ReadErrorKind> {
    let (n_u, n_v) = (grid.x.count, grid.y.count);
    let cells = heights.len();
    let (mut points, mut parameters) = (with_room(3 * cells)?, with_room(2 * cells)?);
    let mut numbers = with_room(cells)?;
    for i in 0..n_u {
        for j in 0..n_v {
            let row = if grid.from_north { n_v - 1 - j } else { j };
            let number = row * n_u + i;
            let height: f64 = heights[number];
            if height.is_nan() {
                continue;
            }
            numbers.push(number as u32);
            points.extend([grid.x.centre(i), grid.y.centre(j), height]);
            parameters.extend([i as f64 / (n_u - 1) as f64, j as f64 / (n_v - 1) as f64]);
        }
    }
    let skipped = cells - numbers.len();
    let mut scan = Scan::new(grid.format, rows(points, 3));
    scan.cloud.parameters = Some(rows(parameters, 2));
    scan.rows = numbers;
    scan.cell = Some([grid.x.step, grid.y.step]);
    match skipped {
        0 => scan.cloud.grid = Some(GridShape { n_u, n_v }),
        _ => scan.notes.push(format!("{skipped} of {cells} cells have no data and were skipped")),
    }
    Ok(scan)
}

/// A number of cells along a direction.
pub(super) fn count(field: &[u8]) -> Option<usize> {
    parse_count(field).filter(|&n| n > 0)
}
