//! The spaces that fits begin with.

use std::borrow::Cow;
use std::sync::Arc;

use ndarray::Array2;
use param_classic::triangulate_parameters;
use point_cloud::vec3::norm;
use thb_core::{HierarchicalSpace, Kind, KnotVector};

use crate::knots::uniform_knots;
use crate::options::Domain;
use crate::options::Pair;
use crate::parameters::{Parameterized, extent};
use crate::{Error, FitOptions};

/// Length of a surface in widths from which on a fit that failed begins again with cells of its shape.
///
/// Derived: cells of the usual level 0 are then two refinements longer than wide.
const FAR_LONGER: f64 = 4.0;

/// Elements per direction of such a level 0, at most.
///
/// Limit: there may be no more functions than points.
const MOST_ELEMENTS: f64 = 32.0;

/// The space of level 0 that the options ask for.
pub(crate) fn level_zero(laid_out: &Parameterized, options: &FitOptions) -> Result<Arc<HierarchicalSpace<2>>, Error> {
    Ok(Arc::new(HierarchicalSpace::new(Kind::Thb, level_zero_knots(&laid_out.parameters, options)?)?))
}

/// The options with a level 0 whose cells have the shape of the part, see `elements_by_shape`; `None` where it is as usual.
pub(crate) fn shaped(laid_out: &Parameterized, options: &FitOptions) -> Option<FitOptions> {
    let elements = elements_by_shape(&laid_out.points, &laid_out.parameters, &triangles(laid_out), options)?;
    Some(FitOptions { mesh: Some(Pair(elements)), ..options.clone() })
}

/// The triangles of a scan, or some over its parameters.
fn triangles(laid_out: &Parameterized) -> Cow<'_, [[u32; 3]]> {
    match laid_out.triangles.is_empty() {
        true => Cow::Owned(triangulate_parameters(laid_out.parameters.view()).unwrap_or_default()),
        false => Cow::Borrowed(&laid_out.triangles),
    }
}

/// Elements of a level 0 whose cells are about as long as they are wide on a surface that is far longer than wide, as many as there are
/// by default; `None` for a surface that is not, and where the user names the elements. Refinement halves cells both ways: those of a
/// long strip become narrower than the points are apart before they are short enough.
fn elements_by_shape(
    points: &Array2<f64>,
    parameters: &Array2<f64>,
    triangles: &[[u32; 3]],
    options: &FitOptions,
) -> Option<[usize; 2]> {
    let usual = options.elements();
    if options.mesh.is_some() || options.parameters.closed.directions() != [false; 2] {
        return None;
    }
    // On each triangle points are linear in the parameters.
    let ratio_on = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| i as usize);
        let edge = |table: &Array2<f64>, to: usize, k: usize| table[[to, k]] - table[[a, k]];
        let [[ub, vb], [uc, vc]] = [b, c].map(|to| [edge(parameters, to, 0), edge(parameters, to, 1)]);
        let tangent =
            |wb: f64, wc: f64| norm(std::array::from_fn(|k| wb * edge(points, b, k) + wc * edge(points, c, k)));
        tangent(vc, -vb) / tangent(-uc, ub)
    };
    let mut ratios: Vec<f64> = triangles.iter().map(ratio_on).filter(|r| r.is_finite() && *r > 0.0).collect();
    ratios.sort_unstable_by(f64::total_cmp);
    let ratio = *ratios.get(ratios.len() / 2)?;
    if ratio.max(1.0 / ratio) < FAR_LONGER {
        return None;
    }
    let count = |usual: usize, factor: f64| (usual as f64 * factor.sqrt()).round().clamp(1.0, MOST_ELEMENTS) as usize;
    Some([count(usual[0], ratio), count(usual[1], 1.0 / ratio)])
}

fn level_zero_knots(parameters: &Array2<f64>, options: &FitOptions) -> Result<[KnotVector; 2], Error> {
    let (elements, closed) = (options.elements(), options.parameters.closed.directions());
    let knots = |d: usize| -> Result<KnotVector, Error> {
        let uniform = uniform_knots(options.degree.0[d], elements[d], closed[d])?;
        Ok(match options.parameters.domain {
            Domain::Unit => uniform,
            Domain::Data => {
                let (lower, upper) = extent(parameters.column(d));
                uniform.on_interval(lower, upper)?
            }
        })
    };
    Ok([knots(0)?, knots(1)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_strip_gets_cells_of_its_shape() {
        let grid = |length: f64| {
            let parameters = Array2::from_shape_fn((400, 2), |(i, d)| [i % 20, i / 20][d] as f64 / 19.0);
            let points = Array2::from_shape_fn((400, 3), |(i, k)| match k {
                0 => length * parameters[[i, 0]],
                1 => parameters[[i, 1]],
                _ => 0.0,
            });
            let triangles = triangulate_parameters(parameters.view()).unwrap();
            elements_by_shape(&points, &parameters, &triangles, &FitOptions::default())
        };
        assert_eq!(grid(1.0), None);
        assert_eq!(grid(3.9), None);
        assert_eq!(grid(16.0), Some([16, 1]));
        assert_eq!(grid(1e6), Some([32, 1]));
        assert_eq!(grid(1.0 / 9.0), Some([1, 12]));
    }
}
