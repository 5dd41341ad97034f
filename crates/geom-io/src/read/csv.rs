//! Tables with named columns: coordinates, and optionally parameters and grid indices.

use point_cloud::GridShape;

use super::text::{Line, Lines, Separator, is_text, parse_count, parse_number, quote, trim};
use super::{Format, ReadOptions, Scan, rows, xyz};
use crate::error::ReadErrorKind;

/// Largest grid index: beyond, whole numbers are no longer exact in `f64`.
const MAX_GRID_INDEX: f64 = 9_007_199_254_740_992.0;

/// Columns by name: `x`, `y`, `z` (or those of the options), `u`, `v`, `i`, `j`, `boundary`.
/// `#` at the start of a line opens a comment.
pub(super) fn read(bytes: &[u8], options: &ReadOptions) -> Result<Scan, ReadErrorKind> {
    read_lines(bytes, options, |text| if trim(text).starts_with(b"#") { b"" } else { text })
}

/// The same with the comments of another format.
pub(super) fn read_lines<'a>(
    bytes: &'a [u8],
    options: &ReadOptions,
    before_comment: impl Fn(&'a [u8]) -> &'a [u8],
) -> Result<Scan, ReadErrorKind> {
    let mut lines = Lines::new(bytes);
    // Not trimmed: a tab at the end closes an empty field.
    let mut next_line = || {
        lines.find_map(|line| {
            let text = before_comment(line.text);
            (!trim(text).is_empty()).then_some(Line { text, ..line })
        })
    };
    let header = next_line().ok_or(ReadErrorKind::NoPoints)?;
    if !is_text(header.text) {
        return Err(ReadErrorKind::NotText { line: header.number });
    }
    let separator = match Separator::of(header.text) {
        Separator::Blanks if header.text.contains(&b'\t') => Separator::Byte(b'\t'),
        other => other,
    };
    let fields: Vec<_> = separator.fields(header.text).map(unquote).collect();
    if fields.iter().all(|field| parse_number(field).is_some()) {
        let mut scan = xyz::read(bytes, options)?;
        if options.columns.is_empty() {
            scan.notes.push("no line names the columns; they were taken as x, y, z".to_owned());
        }
        return Ok(scan);
    }

    let columns = Columns::find(&fields, options)?;
    let (mut points, mut parameters, mut places, mut on_boundary) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut weights = Vec::new();
    let mut row = Vec::with_capacity(fields.len());
    while let Some(line) = next_line() {
        row.clear();
        row.extend(separator.fields(line.text).map(unquote));
        if row.len() + 1 == fields.len() && separator.ends(line.text) {
            row.push(b"");
        }
        if row.len() != fields.len() {
            return Err(line.row_length(fields.len(), row.len()));
        }
        for &column in &columns.coordinates {
            points.push(line.coordinate(row[column])?);
        }
        for &column in &columns.parameters {
            parameters.push(line.coordinate(row[column])?);
        }
        if let Some(column) = columns.boundary {
            on_boundary.push(line.coordinate(row[column])? != 0.0);
        }
        if let Some(column) = columns.weights {
            let value = line.coordinate(row[column])?;
            if value < 0.0 {
                return Err(ReadErrorKind::NegativeWeight { line: line.number, value });
            }
            weights.push(value);
        }
        if let Some([i, j]) = columns.grid {
            places.push(Place {
                i: grid_index(line, row[i])?,
                j: grid_index(line, row[j])?,
                row: places.len(),
                line: line.number,
            });
        }
    }

    let mut scan = Scan::new(Format::Csv, rows(points, columns.coordinates.len()));
    if !columns.parameters.is_empty() {
        scan.cloud.parameters = Some(rows(parameters, columns.parameters.len()));
    }
    scan.notes = columns.notes;
    scan.on_boundary = columns.boundary.map(|_| on_boundary);
    scan.weights = columns.weights.map(|_| weights);
    if !places.is_empty() {
        to_grid(&mut scan, places)?;
    }
    Ok(scan)
}

/// Whether the fields of a line are the names of the columns looked for; numbers would fit any line.
pub(super) fn names_coordinates(fields: &[&[u8]], options: &ReadOptions) -> bool {
    let fields: Vec<_> = fields.iter().map(|field| unquote(field)).collect();
    let by_name = options.columns.iter().all(|column| parse_count(column.as_bytes()).is_none());
    by_name && Columns::find(&fields, options).is_ok()
}

fn unquote(field: &[u8]) -> &[u8] {
    field.strip_prefix(b"\"").and_then(|f| f.strip_suffix(b"\"")).unwrap_or(field)
}

fn grid_index(line: Line<'_>, field: &[u8]) -> Result<usize, ReadErrorKind> {
    match parse_number(field) {
        Some(index) if (0.0..MAX_GRID_INDEX).contains(&index) && index.fract() == 0.0 => Ok(index as usize),
        _ => Err(ReadErrorKind::GridIndex { line: line.number, text: quote(field) }),
    }
}

/// Which column holds what.
struct Columns {
    coordinates: Vec<usize>,
    parameters: Vec<usize>,
    grid: Option<[usize; 2]>,
    boundary: Option<usize>,
    weights: Option<usize>,
    notes: Vec<String>,
}

impl Columns {
    fn find(names: &[&[u8]], options: &ReadOptions) -> Result<Self, ReadErrorKind> {
        let find = |name: &str| {
            let mut places = (0..names.len()).filter(|&k| names[k].eq_ignore_ascii_case(name.as_bytes()));
            match (places.next(), places.next()) {
                (Some(_), Some(_)) => Err(ReadErrorKind::DuplicateColumn { name: name.to_owned() }),
                (place, _) => Ok(place),
            }
        };
        let required = match &options.columns[..] {
            [] => vec!["x", "y"],
            given => given.iter().map(String::as_str).collect(),
        };
        let mut coordinates = Vec::new();
        let mut missing = Vec::new();
        let by_number =
            |name: &str| parse_count(name.as_bytes()).filter(|n| (1..=names.len()).contains(n)).map(|n| n - 1);
        for name in required {
            match find(name)?.or_else(|| by_number(name)) {
                Some(column) => coordinates.push(column),
                None => missing.push(name.to_owned()),
            }
        }
        let mut weights = None;
        if let Some(name) = &options.weights {
            weights = find(name)?.or_else(|| by_number(name));
            if weights.is_none() {
                missing.push(name.clone());
            }
        }
        if !missing.is_empty() {
            let found = names.iter().map(|name| quote(name)).collect();
            return Err(ReadErrorKind::ColumnsNotFound { missing, found });
        }
        if options.columns.is_empty() {
            coordinates.extend(find("z")?);
        }
        // One parameter is that of a curve; v without u says nothing.
        let parameters = match (find("u")?, find("v")?) {
            (Some(u), v) => std::iter::once(u).chain(v).collect(),
            (None, _) => Vec::new(),
        };
        let grid = find("i")?.zip(find("j")?).map(|(i, j)| [i, j]);

        let boundary = find("boundary")?.filter(|column| !coordinates.contains(column));

        let used = |k: &usize| {
            coordinates.contains(k)
                || parameters.contains(k)
                || grid.is_some_and(|columns| columns.contains(k))
                || boundary == Some(*k)
                || weights == Some(*k)
        };
        let ignored: Vec<_> = (0..names.len()).filter(|k| !used(k)).map(|k| quote(names[k])).collect();
        let notes = match ignored.is_empty() {
            true => Vec::new(),
            false => vec![format!("columns that were ignored: {}", ignored.join(", "))],
        };
        Ok(Self { coordinates, parameters, grid, boundary, weights, notes })
    }
}

/// Place of a point in its grid, as the file counts, and its row and line there.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Place {
    i: usize,
    j: usize,
    row: usize,
    line: usize,
}

/// Sorts a scan into row order. All places of the rectangle must be filled once.
fn to_grid(scan: &mut Scan, mut places: Vec<Place>) -> Result<(), ReadErrorKind> {
    let sorted = places.is_sorted();
    places.sort_unstable();
    // Counted from 0, or from 1 where no index is 0.
    let base = |least: usize| least.min(1);
    let base_i = base(places.iter().map(|p| p.i).min().unwrap_or(0));
    let base_j = base(places.iter().map(|p| p.j).min().unwrap_or(0));
    let n_u = places.iter().map(|p| p.i).max().unwrap_or(0) - base_i + 1;
    let n_v = places.iter().map(|p| p.j).max().unwrap_or(0) - base_j + 1;

    if let Some(pair) = places.windows(2).find(|pair| (pair[0].i, pair[0].j) == (pair[1].i, pair[1].j)) {
        return Err(ReadErrorKind::GridDuplicate { i: pair[1].i, j: pair[1].j, line: pair[1].line });
    }
    // Walking the sorted places needs no memory for a rectangle that wrong indices make huge.
    let due = |k: usize| (base_i + k / n_v, base_j + k % n_v);
    let first_gap = (0..places.len()).find(|&k| (places[k].i, places[k].j) != due(k));
    let missing = n_u.saturating_mul(n_v) - places.len();
    if missing > 0 {
        let (i, j) = due(first_gap.unwrap_or(places.len()));
        return Err(ReadErrorKind::GridHole { i, j, missing, n_u, n_v });
    }

    if !sorted {
        let order: Vec<_> = places.iter().map(|p| p.row).collect();
        scan.select(&order);
        scan.notes.push("rows were sorted by (i, j)".to_owned());
    }
    scan.cloud.grid = Some(GridShape { n_u, n_v });
    Ok(())
}
