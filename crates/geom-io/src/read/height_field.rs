//! Heights over a plane: x and y as parameters.

use super::Scan;
use crate::error::ReadErrorKind;

/// Gives points without parameters their x and y, each from 0 to 1 over its own extent.
pub(super) fn parameterize(scan: &mut Scan) -> Result<(), ReadErrorKind> {
    if scan.cloud.parameters.is_some() {
        scan.notes.push("the file has parameters; x and y were not taken in their place".to_owned());
        return Ok(());
    }
    let points = &scan.cloud.points;
    if points.ncols() != 3 {
        return Err(ReadErrorKind::HeightFieldColumns { columns: points.ncols() });
    }
    let mut parameters = points.select(ndarray::Axis(1), &[0, 1]);
    for (mut column, axis) in parameters.columns_mut().into_iter().zip(["x", "y"]) {
        let lower = column.iter().copied().fold(f64::INFINITY, f64::min);
        let upper = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // Halves, so that no extent overflows.
        let half_extent = 0.5 * upper - 0.5 * lower;
        if half_extent == 0.0 {
            return Err(ReadErrorKind::FlatHeightField { axis, value: lower });
        }
        column.mapv_inplace(|value| ((0.5 * value - 0.5 * lower) / half_extent).clamp(0.0, 1.0));
    }
    scan.cloud.parameters = Some(parameters);
    Ok(())
}
