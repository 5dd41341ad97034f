//! PTX of Leica's scanners: for each scan its size, the place and axes of the scanner, a matrix that takes its points to the frame
//! of the file, and the points, column by column.

use point_cloud::GridShape;

use super::number::{NumberStyle, Value};
use super::table::decimal_of;
use super::text::{Line, Lines, parse_count};
use super::{Format, ReadOptions, RowLines, Scan, rows};
use crate::error::ReadErrorKind;

/// Numbers in the lines of a header: the sizes, the scanner's place and axes, the matrix.
const HEADER: [usize; 10] = [1, 1, 3, 3, 3, 3, 4, 4, 4, 4];

/// Whether lines open with the header of a scan.
pub(super) fn opens(mut lines: Lines<'_>) -> bool {
    HEADER.iter().enumerate().all(|(k, &count)| {
        lines.next_filled().is_some_and(|line| {
            let is_number = |field: &[u8]| match k {
                0 | 1 => parse_count(field).is_some(),
                _ => [NumberStyle::POINT, NumberStyle::COMMA].iter().any(|style| style.value(field) != Value::Words),
            };
            line.fields().count() == count && line.fields().all(is_number)
        })
    })
}

/// The header of a scan.
struct Header {
    columns: usize,
    rows: usize,
    /// Rows of the matrix that points, as rows (x, y, z, 1), are multiplied by.
    matrix: [[f64; 4]; 4],
}

impl Header {
    fn take(lines: &mut Lines<'_>, style: NumberStyle) -> Result<Option<Self>, ReadErrorKind> {
        let Some(first) = lines.next_filled() else { return Ok(None) };
        let mut next = |line: Option<Line<'_>>, count: usize| -> Result<Vec<f64>, ReadErrorKind> {
            let line = match line {
                Some(line) => line,
                None => lines.next_filled().ok_or_else(|| first.bad_header("the header of a PTX scan is cut off"))?,
            };
            let number = |field| match style.value(field) {
                Value::Number(number) => Ok(number),
                _ => Err(line.not_a_number(field)),
            };
            let numbers = line.fields().map(number).collect::<Result<Vec<f64>, _>>()?;
            if numbers.len() == count { Ok(numbers) } else { Err(line.row_length(count, numbers.len())) }
        };
        let mut size = |line: Option<Line<'_>>| -> Result<usize, ReadErrorKind> {
            let number = next(line, 1)?[0];
            let is_count = number >= 0.0 && number.fract() == 0.0 && number <= f64::from(u32::MAX);
            if is_count { Ok(number as usize) } else { Err(first.bad_header("expected a number of columns or rows")) }
        };
        let (columns, rows) = (size(Some(first))?, size(None)?);
        // The scanner's place and axes are those of the matrix.
        for _ in 0..4 {
            next(None, 3)?;
        }
        let mut matrix = [[0.0; 4]; 4];
        for row in &mut matrix {
            row.copy_from_slice(&next(None, 4)?);
        }
        Ok(Some(Self { columns, rows, matrix }))
    }

    fn placed(&self, point: [f64; 3]) -> [f64; 3] {
        let [x, y, z, shift] = self.matrix;
        [0, 1, 2].map(|k| point[0] * x[k] + point[1] * y[k] + point[2] * z[k] + shift[k])
    }
}

/// Points at (0, 0, 0), the scanner's own place, are those of which nothing came back; they are left out.
pub(super) fn read(mut lines: Lines<'_>, options: &ReadOptions) -> Result<Scan, ReadErrorKind> {
    let style = NumberStyle { decimal: decimal_of(lines.clone(), options.decimal)?, grouped: false };
    let (mut points, mut numbers, mut places) = (Vec::new(), Vec::new(), RowLines::default());
    let (mut row, mut scans) = (0_usize, 0);
    let mut grid = None;
    while let Some(header) = Header::take(&mut lines, style)? {
        scans += 1;
        let expected = header.columns.saturating_mul(header.rows);
        for found in 0..expected {
            let line = lines.next_filled().ok_or_else(|| ReadErrorKind::Truncated {
                element: "point".to_owned(),
                expected,
                found,
            })?;
            places.push(row as u32, line.number);
            row += 1;
            let mut fields = line.fields();
            let mut point = [0.0; 3];
            let mut is_missing = false;
            for (k, coordinate) in point.iter_mut().enumerate() {
                let field = fields.next().ok_or_else(|| line.row_length(4, k))?;
                match style.value(field) {
                    Value::Number(number) => *coordinate = number,
                    Value::Missing => is_missing = true,
                    Value::Words => return Err(line.not_a_number(field)),
                }
            }
            if !is_missing && point != [0.0; 3] {
                points.extend(header.placed(point));
                numbers.push((row - 1) as u32);
            }
        }
        grid = Some(GridShape { n_u: header.columns, n_v: header.rows });
    }
    let blind = row - numbers.len();
    let mut scan = Scan::new(Format::Ptx, rows(points, 3));
    scan.rows = numbers;
    scan.lines = places;
    if scans > 1 {
        scan.notes.push(format!("the points of {scans} scans were put together"));
    }
    if blind > 0 {
        scan.notes.push(format!("{blind} of {row} points saw nothing (0 0 0) and were left out"));
    } else if scans == 1 {
        scan.cloud.grid = grid.filter(|grid| grid.n_u > 1 && grid.n_v > 1);
    }
    Ok(scan)
}
