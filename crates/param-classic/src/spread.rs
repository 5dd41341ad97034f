//! How well the parameters of a cloud cover the square and follow distances on the surface; what to do about it.

use ndarray::ArrayView2;
use point_cloud::{BoundingBox, CloudTree, check_surface_cloud};
use rayon::prelude::*;

use crate::ParamError;
use crate::quality::MapQuality;
use crate::radius_graph::apart;
use crate::triangulate::triangulate_parameters;
use point_cloud::vec3::{norm, sub};

/// How far a parameterization can be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// Fits as it is.
    Good,
    /// Fits, with more coefficients than the surface needs or with parameter correction.
    Usable,
    /// A fit will have wild or wasted parts; see the hint.
    Poor,
}

/// A verdict and what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Assessment {
    /// The verdict.
    pub verdict: Verdict,
    /// What limits it and what to try, with the numbers; empty if it is good.
    pub hint: String,
}

/// A disc in the square without a parameter in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Void {
    /// Its centre, in the square.
    pub center: [f64; 2],
    /// Its radius, in parameters.
    pub radius: f64,
}

/// Quality of the parameters of a cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct CloudQuality {
    /// The largest empty disc, its centre a corner of a Voronoi cell, brought into the square where it lies outside.
    pub largest_void: Void,
    /// Correlation (Pearson) of distance in space and in parameters over pairs of neighbours in space, in the rectangle
    /// that fits the distances best; near 1 where parameters follow the surface. `None` where all distances agree.
    pub distance_correlation: Option<f64>,
}

/// Neighbours per point in the correlation: as many as a vertex of a triangulation has on average.
const PAIRS_PER_POINT: usize = 6;

/// Largest radius of a void, in mean spacings `1/√m`, of good and of usable parameters. Evenly random points have
/// `√(ln m/π)`, 1.5 for 10³ points and 2.1 for 10⁶; a void of 10 spacings holds some 300 coefficients without data.
const VOIDS: [f64; 2] = [4.0, 10.0];
/// Least correlation of good and of usable parameters. LPSP maps of scanned heads and hulls have 0.83 to
/// 0.97; below 0.5 most of a step in parameters is not a step on the surface.
const CORRELATIONS: [f64; 2] = [0.8, 0.5];
/// Largest area distortion of good and of usable maps: at 100 a surface needs cells ten times as fine in one part as in
/// another, more than three levels of refinement for the map alone.
const AREA_STRETCHES: [f64; 2] = [10.0, 100.0];
/// Largest mean angle distortion of good and of usable maps: cells that long and thin fit a shape they are not made for.
const ANGLE_STRETCHES: [f64; 2] = [3.0, 20.0];

/// Measures parameters `uv`, shape `(m, 2)`, of `points`, shape `(m, 3)`.
///
/// # Errors
/// [`ParamError::WrongShape`], [`ParamError::Triangulation`], [`point_cloud::CloudError`]s of a cloud that is no
/// surface, parameters not finite.
pub fn cloud_quality(points: ArrayView2<'_, f64>, uv: ArrayView2<'_, f64>) -> Result<CloudQuality, ParamError> {
    let m = points.nrows();
    for (what, given, required) in [("points", points.dim(), [m, 3]), ("uv", uv.dim(), [m, 2])] {
        if <[usize; 2]>::from(given) != required {
            return Err(ParamError::WrongShape { what, given: given.into(), required });
        }
    }
    check_surface_cloud(points, 4)?;
    let triangles = triangulate_parameters(uv)?;
    let places: Vec<[f64; 2]> = uv.rows().into_iter().map(|p| [p[0], p[1]]).collect();
    let distance_correlation = distance_correlation(points, &places)?;
    Ok(CloudQuality { largest_void: largest_void(&places, &triangles)?, distance_correlation })
}

fn largest_void(places: &[[f64; 2]], triangles: &[[u32; 3]]) -> Result<Void, ParamError> {
    let tree = CloudTree::new(places)?;
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mut largest = Void { center: [0.5, 0.5], radius: 0.0 };
    let centers = triangles.iter().map(|t| circumcenter(t.map(|v| places[v as usize])));
    for center in centers.chain(corners) {
        let center = center.map(|x| x.clamp(0.0, 1.0));
        let radius = tree.distance(center);
        if radius > largest.radius {
            largest = Void { center, radius };
        }
    }
    Ok(largest)
}

/// The centre of the circle through three points; the first of them where they lie on a line.
fn circumcenter([p, q, r]: [[f64; 2]; 3]) -> [f64; 2] {
    let (d, e) = ([q[0] - p[0], q[1] - p[1]], [r[0] - p[0], r[1] - p[1]]);
    let (dd, ee) = (d[0] * d[0] + d[1] * d[1], e[0] * e[0] + e[1] * e[1]);
    let twice = 2.0 * (d[0] * e[1] - d[1] * e[0]);
    let center = [p[0] + (e[1] * dd - d[1] * ee) / twice, p[1] + (d[0] * ee - e[0] * dd) / twice];
    if center.iter().all(|x| x.is_finite()) { center } else { p }
}

fn distance_correlation(points: ArrayView2<'_, f64>, places: &[[f64; 2]]) -> Result<Option<f64>, ParamError> {
    let bounds = BoundingBox::of(points)?;
    let unit = bounds.longest_side();
    let points: Vec<[f64; 3]> =
        points.rows().into_iter().map(|p| std::array::from_fn(|k| (p[k] - bounds.lower[k]) / unit)).collect();
    let tree = CloudTree::new(&points)?;
    // Of each pair: distance in space, squared differences of the parameters.
    let around: Vec<Vec<u32>> =
        (0..points.len()).into_par_iter().map(|i| apart(tree.nearest(i, PAIRS_PER_POINT))).collect();
    let pairs: Vec<[f64; 3]> = around
        .iter()
        .enumerate()
        .flat_map(|(i, row)| row.iter().map(move |&j| (i, j as usize)))
        .map(|(i, j)| {
            let square = |k: usize| (places[i][k] - places[j][k]).powi(2);
            [norm(sub(points[i], points[j])), square(0), square(1)]
        })
        .collect();
    // The squared sides of the rectangle: least squares of d² ≈ α Δu² + β Δv².
    let sum = |f: &dyn Fn(&[f64; 3]) -> f64| pairs.iter().map(f).sum::<f64>();
    let (uu, uv, vv) = (sum(&|p| p[1] * p[1]), sum(&|p| p[1] * p[2]), sum(&|p| p[2] * p[2]));
    let (ud, vd) = (sum(&|p| p[1] * p[0] * p[0]), sum(&|p| p[2] * p[0] * p[0]));
    let determinant = uu * vv - uv * uv;
    let sides = if determinant > 0.0 {
        [(ud * vv - vd * uv) / determinant, (vd * uu - ud * uv) / determinant].map(|s| s.max(0.0))
    } else {
        [1.0; 2]
    };
    let in_plane = |p: &[f64; 3]| (sides[0] * p[1] + sides[1] * p[2]).sqrt();
    let count = pairs.len() as f64;
    let means = [sum(&|p| p[0]) / count, sum(&in_plane) / count];
    let moment = |f: &dyn Fn(f64, f64) -> f64| sum(&|p| f(p[0] - means[0], in_plane(p) - means[1]));
    let (xx, xy, yy) = (moment(&|x, _| x * x), moment(&|x, y| x * y), moment(&|_, y| y * y));
    let correlation = xy / (xx * yy).sqrt();
    Ok(correlation.is_finite().then_some(correlation))
}

/// Grades a value by its limits for good and usable.
fn grade(value: f64, limits: [f64; 2]) -> Verdict {
    match limits.iter().position(|limit| value <= *limit) {
        Some(0) => Verdict::Good,
        Some(_) => Verdict::Usable,
        None => Verdict::Poor,
    }
}

/// The worst of the findings, with the hints of all that are not good.
fn assess(findings: impl IntoIterator<Item = (Verdict, String)>) -> Assessment {
    let mut assessment = Assessment { verdict: Verdict::Good, hint: String::new() };
    for (verdict, hint) in findings.into_iter().filter(|f| f.0 > Verdict::Good) {
        assessment.verdict = assessment.verdict.max(verdict);
        if !assessment.hint.is_empty() {
            assessment.hint.push_str("; ");
        }
        assessment.hint.push_str(&hint);
    }
    assessment
}

impl CloudQuality {
    /// The verdict on the parameters of `points` points.
    pub fn assessment(&self, points: usize) -> Assessment {
        let void = self.largest_void;
        let spacings = void.radius * (points as f64).sqrt();
        let correlation = self.distance_correlation.unwrap_or(1.0);
        assess([
            (
                grade(spacings, VOIDS),
                format!(
                    "no parameters within {:.3} of ({:.3}, {:.3}), {spacings:.0} mean spacings: check the boundary and corners, or refine the map",
                    void.radius, void.center[0], void.center[1]
                ),
            ),
            (
                grade(-correlation, CORRELATIONS.map(|c| -c)),
                format!(
                    "parameter and surface distance correlate at {correlation:.2} only: look at the picture of the parameters for parts that are squeezed or torn apart"
                ),
            ),
        ])
    }
}

impl MapQuality {
    /// The verdict on the map.
    pub fn assessment(&self) -> Assessment {
        let area = self.area.map_or(1.0, |a| a.max);
        let angle = self.angle.map_or(1.0, |a| a.mean);
        let folds = if self.folded.is_empty() { Verdict::Good } else { Verdict::Poor };
        assess([
            (
                folds,
                format!(
                    "{} of {} triangles are folded: choose other corners, or another way to lay the points out",
                    self.folded.len(),
                    self.triangles
                ),
            ),
            (
                grade(area, AREA_STRETCHES),
                format!(
                    "areas are stretched up to {area:.0} times: refine the map, or choose corners nearer the outline's own"
                ),
            ),
            (
                grade(angle, ANGLE_STRETCHES),
                format!("angles are stretched {angle:.1} times on average: the outline is far from a square"),
            ),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Distortion;
    use ndarray::Array2;

    /// Points of a golden-ratio lattice, thinned by `keep`, and the corners.
    fn spread(n: usize, keep: impl Fn(f64, f64) -> bool) -> Array2<f64> {
        let mut rows: Vec<[f64; 2]> = (0..n)
            .map(|i| [(i as f64 * 0.618_033_988_749_895).fract(), (i as f64 + 0.5) / n as f64])
            .filter(|p| keep(p[0], p[1]))
            .collect();
        rows.extend([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        Array2::from_shape_fn((rows.len(), 2), |(i, k)| rows[i][k])
    }

    fn in_space(uv: &Array2<f64>) -> Array2<f64> {
        Array2::from_shape_fn((uv.nrows(), 3), |(i, k)| [5.0 * uv[[i, 0]], 2.0, uv[[i, 1]]][k])
    }

    #[test]
    fn a_planted_void_is_found() {
        let uv = spread(2000, |u, v| (u - 0.6).hypot(v - 0.3) > 0.2);
        let quality = cloud_quality(in_space(&uv).view(), uv.view()).unwrap();
        let Void { center, radius } = quality.largest_void;
        assert!((0.2..0.225).contains(&radius), "{radius}");
        assert!((center[0] - 0.6).hypot(center[1] - 0.3) < 0.02, "{center:?}");
        let assessment = quality.assessment(uv.nrows());
        assert!(assessment.verdict > Verdict::Good && assessment.hint.contains("no parameters within 0.2"));
    }

    #[test]
    fn the_distances_of_a_stretched_plane_correlate_fully_and_those_of_a_shuffle_do_not() {
        let uv = spread(1500, |u, v| (7.0 * u).sin() + (9.0 * v).sin() > -1.0);
        let points = in_space(&uv);
        let quality = cloud_quality(points.view(), uv.view()).unwrap();
        assert!((quality.distance_correlation.unwrap() - 1.0).abs() < 1e-9);
        let m = uv.nrows();
        let shuffled = Array2::from_shape_fn((m, 2), |(i, k)| uv[[(i * 389) % m, k]]);
        let quality = cloud_quality(points.view(), shuffled.view()).unwrap();
        assert!(quality.distance_correlation.unwrap() < 0.3);
        assert_eq!(quality.assessment(m).verdict, Verdict::Poor);
    }

    #[test]
    fn maps_are_graded_by_their_worst_finding() {
        let with_area = |max: f64| MapQuality {
            triangles: 9,
            folded: vec![],
            collapsed: 0,
            degenerate: 0,
            angle: Some(Distortion { min: 1.0, max: 2.0, mean: 1.5 }),
            area: Some(Distortion { min: 1.0, max, mean: 2.0 }),
        };
        let verdicts = [5.0, 50.0, 500.0].map(|max| with_area(max).assessment().verdict);
        assert_eq!(verdicts, [Verdict::Good, Verdict::Usable, Verdict::Poor]);
        assert!(with_area(5.0).assessment().hint.is_empty());
        let folded = MapQuality { folded: vec![3], ..with_area(5.0) }.assessment();
        assert!(folded.verdict == Verdict::Poor && folded.hint.starts_with("1 of 9 triangles"));
    }
}
