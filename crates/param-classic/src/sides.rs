//! The boundary of the unit square and the points that lie on it.

use ndarray::{Array2, ArrayView2, Axis};

use crate::ParamError;
use crate::sequence::{Rule, parameterize_sequence};

/// A set of sides of the square; side k begins at corner k.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SideSet(pub(crate) u8);

impl SideSet {
    pub(crate) const NONE: Self = Self(0);
    pub(crate) const ALL: Self = Self(0b1111);

    pub(crate) fn holds(self, side: usize) -> bool {
        self.0 & (1 << side) != 0
    }
}

/// For each side the coordinate that is constant on it, and its value there.
pub(crate) const CONSTANT_ON_SIDE: [(usize, f64); 4] = [(1, 0.0), (0, 1.0), (1, 1.0), (0, 0.0)];

/// Points of a cloud that lie on the boundary of its parameter domain, and their parameters there.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundaryParameters {
    /// Rows of the boundary points in the cloud.
    pub points: Vec<u32>,
    /// Their parameters, shape `(points.len(), 2)`, all on the boundary of the unit square.
    pub parameters: Array2<f64>,
}

/// Parameters of a closed loop of points, shape `(n, N)`, in order: shape `(n, 2)`, on the boundary of the unit square.
///
/// `corners` are the places of the points in the loop that come to (0, 0), (1, 0), (1, 1), (0, 1), cyclically
/// increasing; the points of each side are spread over it by `rule`. Different points get different parameters.
///
/// # Errors
/// [`ParamError::BadCorners`]; those of [`parameterize_sequence`] for a side; [`ParamError::ShortEdge`] with places in
/// the loop where two neighbours are so close that their parameters agree.
pub fn side_parameters(
    loop_points: ArrayView2<'_, f64>,
    corners: [usize; 4],
    rule: Rule,
) -> Result<Array2<f64>, ParamError> {
    Ok(place_sides(loop_points, corners, rule)?.0)
}

/// As [`side_parameters`], with the sides that each point of the loop lies on.
pub(crate) fn place_sides(
    loop_points: ArrayView2<'_, f64>,
    corners: [usize; 4],
    rule: Rule,
) -> Result<(Array2<f64>, Vec<SideSet>), ParamError> {
    let n = loop_points.nrows();
    // Steps forward from each corner to the next one; once round the loop if they are in order.
    let steps: [usize; 4] = std::array::from_fn(|k| (corners[(k + 1) % 4] + n).saturating_sub(corners[k]) % n.max(1));
    if corners.iter().any(|&c| c >= n) || steps.contains(&0) || steps.iter().sum::<usize>() != n {
        return Err(ParamError::BadCorners { corners, points: n });
    }
    let mut uv = Array2::zeros((n, 2));
    let mut sides = vec![SideSet::NONE; n];
    for (k, (constant, value)) in CONSTANT_ON_SIDE.into_iter().enumerate() {
        let places: Vec<usize> = (0..=steps[k]).map(|step| (corners[k] + step) % n).collect();
        let points = loop_points.select(Axis(0), &places);
        let t = parameterize_sequence(points.view(), rule)?;
        if let Some(i) = (1..t.len()).find(|&i| t[i] <= t[i - 1]) {
            let difference = &points.row(i) - &points.row(i - 1);
            let vertices = [places[i - 1] as u32, places[i] as u32];
            return Err(ParamError::ShortEdge { vertices, length: difference.dot(&difference).sqrt() });
        }
        for (&place, &t) in places.iter().zip(&t) {
            // Sides 2 and 3 run backwards along their axis.
            uv[[place, 1 - constant]] = if k < 2 { t } else { 1.0 - t };
            uv[[place, constant]] = value;
            sides[place].0 |= 1 << k;
        }
    }
    Ok((uv, sides))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn a_rectangle_is_scaled_onto_the_square() {
        let outline = array![[0., 0.], [3., 0.], [6., 0.], [6., 2.], [1.5, 2.], [0., 2.], [0., 0.5]];
        let uv = side_parameters(outline.view(), [0, 2, 3, 5], Rule::ChordLength).unwrap();
        let exact = &outline / &array![[6.0, 2.0]];
        assert!((&uv - &exact).iter().all(|d| d.abs() < 1e-15), "{uv}");
        // The same loop, begun elsewhere.
        let turned = side_parameters(outline.view(), [2, 3, 5, 0], Rule::ChordLength).unwrap();
        assert_eq!((turned.row(2), turned.row(0)), (uv.row(0), uv.row(5)));
    }

    #[test]
    fn corners_out_of_order_and_equal_points_are_errors() {
        let outline = array![[0., 0.], [1., 0.], [1., 1.], [1., 1.], [0., 1.]];
        for corners in [[0, 2, 1, 4], [0, 1, 1, 4], [0, 1, 2, 5]] {
            let result = side_parameters(outline.view(), corners, Rule::Uniform);
            assert_eq!(result, Err(ParamError::BadCorners { corners, points: 5 }));
        }
        let result = side_parameters(outline.view(), [0, 1, 2, 4], Rule::ChordLength);
        assert_eq!(result, Err(ParamError::ShortEdge { vertices: [2, 3], length: 0.0 }));
    }
}
