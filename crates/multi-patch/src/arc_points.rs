//! Points along smooth arcs at which the tangent planes of both patches are compared.

use thb_core::bernstein::gauss_legendre;
use thb_core::{ArcUse, CellSpace, Error, MultiPatchSpace, PatchPlace, side_point};

/// The derivatives along and across an arc as linear combinations of coefficients: weights by function of the element.
#[derive(Clone, Debug)]
pub(crate) struct ArcPoint {
    /// Weight in the sum over the arc; Gauss points of an arc sum to 1.
    pub(crate) weight: f64,
    /// Of T, the derivative along the arc.
    pub(crate) along: Vec<f64>,
    /// Of D_L and D_R, the derivatives into the first and the second patch.
    pub(crate) inward: [Vec<f64>; 2],
}

/// An element of an arc with its points.
#[derive(Clone, Debug)]
pub(crate) struct ArcElement {
    pub(crate) arc: usize,
    /// The functions that the derivatives depend on, increasing.
    pub(crate) functions: Vec<u32>,
    pub(crate) points: Vec<ArcPoint>,
}

/// Functions with their weights in T and in D.
type Weights = Vec<(u32, [f64; 2])>;

/// T, D_L and D_R at a point.
pub(crate) type Derivatives = [[f64; 3]; 3];

impl ArcElement {
    /// T, D_L and D_R at a point of the element, with coefficients `(n_functions, 3)`.
    pub(crate) fn derivatives(&self, point: &ArcPoint, coefficients: &[f64]) -> Derivatives {
        [&point.along, &point.inward[0], &point.inward[1]].map(|weights| {
            let mut sum = [0.0; 3];
            for (&function, weight) in self.functions.iter().zip(weights) {
                let row = &coefficients[3 * function as usize..][..3];
                (0..3).for_each(|k| sum[k] += weight * row[k]);
            }
            sum
        })
    }
}

/// The elements of the arcs that have two patches and are not `sharp`. Points are p + 1 Gauss points an element and both ends of each
/// arc, which alone make tangent planes at vertices one; an end has the mean weight of a Gauss point.
pub(crate) fn arc_elements(space: &MultiPatchSpace, sharp: &[bool]) -> Result<Vec<ArcElement>, Error> {
    let gauss = gauss_legendre(space.degree()[0] + 1);
    let mut elements = Vec::new();
    for (arc, _) in sharp.iter().enumerate().filter(|(_, sharp)| !**sharp) {
        let &[left, right] = space.topology().uses(arc) else { continue };
        let n = space.elements(arc);
        let end_weight = 1.0 / (n * gauss.len()) as f64;
        for k in 0..n {
            let mut places: Vec<(f64, f64)> =
                gauss.iter().map(|(x, w)| ((k as f64 + x) / n as f64, w / n as f64)).collect();
            if k == 0 {
                places.insert(0, (0.0, end_weight));
            }
            if k + 1 == n {
                places.push((1.0, end_weight));
            }
            elements.push(arc_element(space, arc, [left, right], &places)?);
        }
    }
    Ok(elements)
}

/// One element, given parameters and weights of its points.
fn arc_element(
    space: &MultiPatchSpace,
    arc: usize,
    sides: [ArcUse; 2],
    places: &[(f64, f64)],
) -> Result<ArcElement, Error> {
    let mut found: Vec<[Weights; 2]> = Vec::with_capacity(places.len());
    for &(t, _) in places {
        found.push([side_derivatives(space, sides[0], t)?, side_derivatives(space, sides[1], t)?]);
    }
    let mut functions: Vec<u32> = found.iter().flatten().flatten().map(|(function, _)| *function).collect();
    functions.sort_unstable();
    functions.dedup();
    let spread = |of: &[(u32, [f64; 2])], which: usize| {
        let mut weights = vec![0.0; functions.len()];
        for (function, pair) in of {
            weights[functions.partition_point(|f| f < function)] = pair[which];
        }
        weights
    };
    let points = places.iter().zip(&found).map(|(&(_, weight), [left, right])| ArcPoint {
        weight,
        along: spread(left, 0),
        inward: [spread(left, 1), spread(right, 1)],
    });
    let points = points.collect();
    Ok(ArcElement { arc, functions, points })
}

/// Weights of the derivatives along the arc and into a patch, for the functions where one of them is not zero.
fn side_derivatives(space: &MultiPatchSpace, on: ArcUse, t: f64) -> Result<Weights, Error> {
    let u = side_point(on.side, if on.reversed { 1.0 - t } else { t });
    let cell = space.cell(space.locate(PatchPlace { patch: on.patch, u })?);
    let (mut first, mut second, mut scratch) = (Vec::new(), Vec::new(), Vec::new());
    cell.derivatives(u, [1, 0], &mut first, &mut scratch);
    cell.derivatives(u, [0, 1], &mut second, &mut scratch);
    let sign = if on.reversed { -1.0 } else { 1.0 };
    let pair = |du: f64, dv: f64| match on.side {
        0 => [sign * du, dv],
        1 => [sign * dv, -du],
        2 => [-sign * du, -dv],
        _ => [-sign * dv, du],
    };
    let all = cell.functions.iter().zip(first.iter().zip(&second)).map(|(&f, (&du, &dv))| (f, pair(du, dv)));
    Ok(all.filter(|(_, pair)| *pair != [0.0; 2]).collect())
}
