//! An outer boundary that the user names.

use std::path::Path;

use geom_io::Scan;
use ndarray::{ArrayView2, Axis};
use point_cloud::{loop_length, order_loop};

use super::layout::places_of;
use crate::{Error, ParameterOptions};

/// Points that a boundary needs: its corners.
const FEWEST: usize = 4;

/// The outer boundary that a file or a column names, in order, as places among the points of the scan, whose rows in
/// the file are `rows`.
pub(super) fn given(scan: &Scan, rows: &[u32], options: &ParameterOptions) -> Result<Option<Vec<u32>>, Error> {
    let points = scan.cloud.points.view();
    if let Some(path) = &options.outline {
        let named = read_rows(path)?;
        let places = places_of(&named, rows, "--outline")?;
        return in_order(points, places, true).map(Some);
    }
    let Some(labels) = &scan.on_boundary else { return Ok(None) };
    if scan.cloud.parameters.is_some() {
        return Ok(None);
    }
    let places = (0..labels.len() as u32).filter(|&i| labels[i as usize]).collect();
    in_order(points, places, false).map(Some)
}

/// Rows in the file of the points that options name as corners or outline, or that the file names, increasing.
pub(crate) fn named_rows(scan: &Scan, options: &ParameterOptions) -> Result<Vec<u32>, Error> {
    let corners = options.corners.iter().flat_map(|corners| corners.0);
    let labels = scan.on_boundary.iter().flatten().zip(&scan.rows).filter(|(label, _)| **label).map(|(_, &row)| row);
    let mut named: Vec<u32> = corners.chain(labels).collect();
    if let Some(path) = &options.outline {
        // Larger numbers are no rows, which is told where the outline is needed.
        named.extend(read_rows(path)?.into_iter().filter_map(|row| u32::try_from(row).ok()));
    }
    named.sort_unstable();
    Ok(named)
}

/// Puts the points of a loop in order. The given order stays where it is about as short.
fn in_order(points: ArrayView2<'_, f64>, places: Vec<u32>, may_be_in_order: bool) -> Result<Vec<u32>, Error> {
    /// A loop in order that doubles back at a ragged rim is hardly longer than the shortest one.
    const ABOUT: f64 = 1.25;
    let mut sorted = places.clone();
    sorted.sort_unstable();
    if let Some(twice) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(Error::BoundaryTwice { row: twice[0] });
    }
    if places.len() < FEWEST {
        return Err(Error::BoundaryTooShort { given: places.len(), required: FEWEST });
    }
    let select = |places: &[u32]| {
        let rows: Vec<usize> = places.iter().map(|&i| i as usize).collect();
        points.select(Axis(0), &rows)
    };
    let given = select(&places);
    let ordered: Vec<u32> = order_loop(select(&sorted).view())?.iter().map(|&at| sorted[at as usize]).collect();
    let keeps = may_be_in_order && loop_length(given.view()) <= ABOUT * loop_length(select(&ordered).view());
    Ok(if keeps { places } else { ordered })
}

/// Whole numbers, separated by blanks, commas or line ends; `#` begins a comment.
fn read_rows(path: &Path) -> Result<Vec<u64>, Error> {
    let text = geom_io::read_text(path)?;
    let mut rows = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let words = line.split('#').next().unwrap_or_default().split([' ', '\t', ',', ';']);
        for word in words.map(str::trim).filter(|word| !word.is_empty()) {
            let row = word.parse().map_err(|_| Error::BoundaryFile {
                path: path.to_owned(),
                line: number + 1,
                text: word.chars().take(40).collect(),
            })?;
            rows.push(row);
        }
    }
    Ok(rows)
}
