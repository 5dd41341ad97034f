//! Columns i, j and k: indices in a grid, or the normal of the surface at the point.

use point_cloud::GridShape;

use super::super::Scan;
use crate::error::ReadErrorKind;

/// Largest difference of indices: beyond, whole numbers are no longer exact in `f64`.
const MAX_INDEX: f64 = 9_007_199_254_740_992.0;

/// Largest distance of the length of a unit normal from 1.
///
/// Limit: normals written with two digits.
const UNIT: f64 = 0.02;

/// Share of the normals that have to be of unit length where their components are whole numbers, so that they are not taken for
/// the indices of a block: a flat face has the normal (0, 0, 1) everywhere, while few indices have all but one 0.
const UNIT_SHARE: f64 = 0.9;

/// What columns i, j and perhaps k hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Meaning {
    Indices,
    Normals,
    Neither,
}

/// What columns i and j (and k, if it is there) hold; values that are missing are NaN.
pub(super) fn meaning(i: &[f64], j: &[f64], k: Option<&[f64]>) -> Meaning {
    let are_whole = |values: &[f64]| values.iter().all(|value| value.fract() == 0.0 && value.abs() < MAX_INDEX);
    let are_indices = are_whole(i) && are_whole(j);
    let Some(k) = k else { return if are_indices { Meaning::Indices } else { Meaning::Neither } };
    let lengths = (0..k.len()).map(|row| [i[row], j[row], k[row]].iter().map(|c| c * c).sum::<f64>().sqrt());
    let unit = lengths.filter(|length| (length - 1.0).abs() <= UNIT).count();
    if are_indices && are_whole(k) && (unit as f64) < UNIT_SHARE * k.len() as f64 {
        Meaning::Indices
    } else {
        Meaning::Normals
    }
}

/// Sorts a scan into row order by its grid indices, one pair a point, which may start anywhere and go up by any step. Points of
/// a grid with gaps, or with two points at a place, stay as they are, without order; a note says so. Returns whether it is a grid.
pub(super) fn to_grid(scan: &mut Scan, indices: &[[f64; 2]], names: &str) -> bool {
    let axis = |k: usize| {
        let mut values: Vec<f64> = indices.iter().map(|pair| pair[k]).collect();
        values.sort_unstable_by(f64::total_cmp);
        values.dedup();
        let step = values.windows(2).fold(0.0, |step, pair| common_divisor(step, pair[1] - pair[0]));
        let first = values.first().copied().unwrap_or(0.0);
        let last = values.last().copied().unwrap_or(0.0);
        let step = if step == 0.0 { 1.0 } else { step };
        (first, step, ((last - first) / step) as usize + 1)
    };
    let [(first_i, step_i, n_u), (first_j, step_j, n_v)] = [axis(0), axis(1)];
    let place = |pair: &[f64; 2]| (((pair[0] - first_i) / step_i) as u64, ((pair[1] - first_j) / step_j) as u64);
    let mut order: Vec<usize> = (0..indices.len()).collect();
    order.sort_by_key(|&row| place(&indices[row]));
    if let Some(pair) = order.windows(2).find(|pair| place(&indices[pair[0]]) == place(&indices[pair[1]])) {
        let [i, j] = indices[pair[0]];
        let lines: Vec<String> = pair.iter().filter_map(|&row| scan.line(row)).map(|line| line.to_string()).collect();
        scan.notes.push(format!(
            "columns {names} were ignored: two points have the indices ({i}, {j}), on lines {}",
            lines.join(" and ")
        ));
        return false;
    }
    let places = n_u.saturating_mul(n_v);
    let missing = places - indices.len();
    if missing > 0 {
        let first_gap = (0..).zip(&order).find(|(k, row)| place(&indices[**row]) != (*k / n_v as u64, *k % n_v as u64));
        let at = first_gap.map_or(indices.len() as u64, |(k, _)| k);
        let i = first_i + step_i * (at / n_v as u64) as f64;
        let j = first_j + step_j * (at % n_v as u64) as f64;
        scan.notes.push(format!(
            "the grid of columns {names} has no point at {missing} of its {n_u} × {n_v} places, the first ({i}, {j}): \
             its points were read without order"
        ));
        return false;
    }
    if !order.is_sorted() {
        scan.select(&order);
        scan.notes.push(format!("rows were sorted by ({})", names.replace(',', ", ")));
    }
    scan.cloud.grid = Some(GridShape { n_u, n_v });
    true
}

/// Greatest common divisor of two whole numbers that are not negative.
fn common_divisor(mut a: f64, mut b: f64) -> f64 {
    while b > 0.0 {
        (a, b) = (b, a % b);
    }
    a
}

/// The error for indices that an option names and that are none.
pub(super) fn not_indices(rows: &[[f64; 2]], line: impl Fn(usize) -> usize) -> ReadErrorKind {
    let wrong = |pair: &[f64; 2]| pair.iter().any(|v| v.fract() != 0.0 || !v.is_finite() || v.abs() >= MAX_INDEX);
    let row = rows.iter().position(wrong).unwrap_or(0);
    let value = rows.get(row).and_then(|pair| pair.iter().find(|v| v.fract() != 0.0 || !v.is_finite()));
    ReadErrorKind::GridIndex { line: line(row), text: value.map_or_else(String::new, f64::to_string) }
}
