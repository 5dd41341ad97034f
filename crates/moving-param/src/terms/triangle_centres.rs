//! Weak samples of the triangles between the points, and of the edges of their rim.

use fit_ls::{BlockEquations, SortedPoints};
use ndarray::Array2;
use thb_core::ParameterBox;

use crate::Error;
use crate::equations::Linearization;
use crate::points::frame::{Frame, frames_at};
use crate::points::vector::{Vector, cross, difference, dot, point, unit};
use crate::state::{State, StepStart};
use crate::term::Term;
use crate::terms::rim_edges::{RimEdge, curved_middle};

/// `½ Σ_t r_tᵀ W_t r_t`, `r_t = s(u_t) − p_t`: `p_t` are the centres of triangles over the points and of the edges of their rim, `u_t`
/// those of their parameters. `W_t = τ ω_t I + (1 − τ) ω_t n nᵀ` for a triangle with unit normal n: a centre is held across its triangle
/// by `ω_t`, along it by `τ ω_t`; that of an edge with unit direction n is held along it by `τ ω_t`, across it by `ω_t`.
///
/// Held constant are `p_t` and `W_t`, and in the equations of a step, not in the energy of a trial, `u_t`: it depends on the parameters
/// of several points. So a step of the coefficients knows nothing of what it does to the centre by moving the corners, but whether it
/// is taken is decided by what it really costs.
///
/// A point whose parameter is free holds the surface in one direction only. Where few points lie the surface may then swing
/// between them at no distance from any; and beyond the rim, where it only has to grow, a few points outweigh nothing while others
/// crowd in the same cell. One term does for both, since centres of triangles and of edges are samples of one kind.
#[derive(Debug)]
pub(crate) struct TriangleCentres {
    simplices: Vec<Simplex>,
    /// The centres, `(t, N)`.
    centres: Array2<f64>,
}

/// A triangle, or an edge of the rim.
#[derive(Debug)]
struct Simplex {
    corners: Corners,
    /// Unit normal of a triangle, unit direction of an edge.
    axis: Vector,
    /// How strongly residuals count along the axis.
    along: f64,
    /// And across it.
    across: f64,
}

/// The points of a triangle or an edge, by index.
#[derive(Clone, Copy, Debug)]
enum Corners {
    Triangle([u32; 3]),
    Edge([u32; 2]),
}

impl Corners {
    fn indices(&self) -> &[u32] {
        match self {
            Self::Triangle(corners) => corners,
            Self::Edge(ends) => ends,
        }
    }
}

/// `τ`: how much less a centre holds along its triangle or edge. With 1 the parameters of centres are held where a map that is
/// linear over triangles has them, which costs control points; with 0 more edges remain between points.
const ALONG: f64 = 0.03;

/// Cells with this many points for each of their functions hold the surface by themselves where these lie evenly. Triangles as small
/// as they then are get left out, which spares most of the work on dense clouds.
const ENOUGH: usize = 2;

/// Weight of the centre of an edge against that of a triangle. Of 0, 0.3 and 1, on seven scans, 0 left spikes beyond the
/// rim, and 1 took more control points on a noisy one.
const RIM: f64 = 0.3;

impl TriangleCentres {
    /// Samples of those triangles, by indices of points, and of the edges of their rim, that lie in cells with few points or stand for
    /// many; `None` if there are none. Triangles and edges with a corner of weight 0 are not there.
    pub(crate) fn new<const D: usize, S: ParameterBox<D>>(
        triangles: &[[u32; 3]],
        rim: &[RimEdge],
        space: &S,
        points: &SortedPoints<D>,
        weight: f64,
    ) -> Result<Option<Self>, Error> {
        let at_of = points.places();
        let stands_for = |corners| stands_for(space, points, &at_of, corners);
        let (mut faces, mut edges) = (Vec::new(), Vec::new());
        let counts = |i: &u32| points.weights().is_none_or(|weights| weights[at_of[*i as usize]] > 0.0);
        let counted: Vec<[u32; 3]> = triangles.iter().filter(|corners| corners.iter().all(counts)).copied().collect();
        let triangles = &counted;
        for &corners in triangles {
            faces.extend(stands_for(Corners::Triangle(corners))?.map(|count| (corners, count)));
        }
        for edge in rim.iter().filter(|edge| edge.ends.iter().all(counts)) {
            edges.extend(stands_for(Corners::Edge(edge.ends))?.map(|count| (edge, count)));
        }
        if faces.is_empty() && edges.is_empty() {
            return Ok(None);
        }
        let point = |i: u32| point(points, at_of[i as usize]);
        let normals = (points.dim() == 3).then(|| vertex_normals(triangles, points.len(), point));
        let mut simplices = Vec::with_capacity(faces.len() + edges.len());
        let mut centres = Array2::zeros((faces.len() + edges.len(), points.dim()));
        let mut add = |simplex, centre: Vector| {
            centres.row_mut(simplices.len()).iter_mut().zip(centre).for_each(|(target, x)| *target = x);
            simplices.push(simplex);
        };
        for (corners, count) in faces {
            let [a, b, c] = corners.map(point);
            let axis = unit(cross(&difference(&b, &a), &difference(&c, &a)));
            let along = weight * count.max(1.0);
            let simplex = Simplex { corners: Corners::Triangle(corners), axis, along, across: ALONG * along };
            add(simplex, curved_centre([a, b, c], normals.as_ref().map(|n| corners.map(|i| n[i as usize]))));
        }
        for (edge, count) in edges {
            let [a, b] = edge.ends.map(point);
            let across = RIM * weight * count.max(1.0);
            let axis = unit(difference(&b, &a));
            let simplex = Simplex { corners: Corners::Edge(edge.ends), axis, along: ALONG * across, across };
            let beside = |i: Option<u32>| i.filter(counts).map(point);
            add(simplex, curved_middle(beside(edge.before), [a, b], beside(edge.after)));
        }
        Ok(Some(Self { simplices, centres }))
    }

    /// The samples where the points have some parameters, sorted by cell.
    fn samples<const D: usize, S: ParameterBox<D>>(&self, at: &State<'_, D, S>) -> Result<SortedPoints<D>, Error> {
        let space = at.map.space().as_ref();
        let mut parameters = Array2::zeros((self.simplices.len(), D));
        for (mut row, simplex) in parameters.outer_iter_mut().zip(&self.simplices) {
            let centre = centre(space, |place| at.parameters[place], at.places, &simplex.corners);
            row.iter_mut().zip(centre).for_each(|(target, u)| *target = u);
        }
        let mut samples = SortedPoints::new(parameters.view(), self.centres.view(), None)?;
        samples.sort(space, |_| None)?;
        Ok(samples)
    }

    /// `W r` at a sample.
    fn force<const D: usize>(&self, samples: &SortedPoints<D>, at: usize, residual: &Vector) -> Vector {
        let Simplex { axis, along, across, .. } = &self.simplices[samples.order()[at] as usize];
        let further = (along - across) * dot(residual, axis);
        std::array::from_fn(|k| across * residual[k] + further * axis[k])
    }
}

impl<const D: usize, S: ParameterBox<D>> Term<D, S> for TriangleCentres {
    fn name(&self) -> &'static str {
        "triangle centres"
    }

    fn energy(&self, at: &State<'_, D, S>) -> Result<f64, Error> {
        let samples = self.samples(at)?;
        let frames = frames_at(at.map, &samples)?;
        let cost =
            |(place, frame): (usize, &Frame<D>)| dot(&frame.residual, &self.force(&samples, place, &frame.residual));
        Ok(0.5 * frames.iter().enumerate().map(cost).sum::<f64>())
    }

    fn linearize(&self, at: &StepStart<'_, D, S>, _: &[u32], into: &mut Linearization<'_, D>) -> Result<(), Error> {
        let map = at.state.map;
        let samples = self.samples(&at.state)?;
        let frames = frames_at(map, &samples)?;
        let n = samples.dim();
        let part = |vectors: &[Vector], k: usize| -> Vec<f64> { vectors.iter().map(|v| v[k]).collect() };
        let mut weights = Vec::with_capacity(n * (n + 1) / 2);
        for a in 0..n {
            let axis = std::array::from_fn(|k| f64::from(u8::from(k == a)));
            let column: Vec<Vector> = (0..samples.len()).map(|place| self.force(&samples, place, &axis)).collect();
            weights.extend((a..n).map(|b| part(&column, b)));
        }
        let pull = |(place, frame): (usize, &Frame<D>)| self.force(&samples, place, &frame.residual).map(|x| -x);
        let pulls: Vec<Vector> = frames.iter().enumerate().map(pull).collect();
        let right: Vec<Vec<f64>> = (0..n).map(|k| part(&pulls, k)).collect();
        let equations = BlockEquations::new(map.space().as_ref(), into.pattern, &samples, &weights, &right)?;
        into.coefficients.add_blocks(equations);
        Ok(())
    }
}

/// The mean of the corners, moved half way to the mean of its projections to their tangent planes: for a surface of second
/// order that is its point over the centre.
fn curved_centre(corners: [Vector; 3], normals: Option<[Vector; 3]>) -> Vector {
    let mut centre: Vector = std::array::from_fn(|k| corners.iter().map(|c| c[k]).sum::<f64>() / 3.0);
    let Some(normals) = normals else { return centre };
    let heights: [f64; 3] = std::array::from_fn(|i| dot(&difference(&corners[i], &centre), &normals[i]));
    for (normal, height) in normals.iter().zip(heights) {
        (0..3).for_each(|k| centre[k] += 0.5 * height * normal[k] / 3.0);
    }
    centre
}

/// Unit normals at the points: those of the triangles around them, by area; zero where there are none.
fn vertex_normals(triangles: &[[u32; 3]], points: usize, point: impl Fn(u32) -> Vector) -> Vec<Vector> {
    let mut normals = vec![[0.0; 4]; points];
    for &triangle in triangles {
        let [a, b, c] = triangle.map(&point);
        let area = cross(&difference(&b, &a), &difference(&c, &a));
        triangle.iter().for_each(|&i| (0..3).for_each(|k| normals[i as usize][k] += area[k]));
    }
    normals.into_iter().map(unit).collect()
}

/// How many points would lie in a triangle, or along an edge, were those of its cell spread evenly over it. `None` where points
/// hold the surface by themselves: there are enough of them in the cell, and it is no larger than then.
fn stands_for<const D: usize, S: ParameterBox<D>>(
    space: &S,
    points: &SortedPoints<D>,
    at_of: &[usize],
    corners: Corners,
) -> Result<Option<f64>, Error> {
    let parameter = |at: usize| points.parameter(at);
    let cell = space.locate_cell(centre(space, parameter, at_of, &corners))?;
    let size = space.cell(cell).size();
    // The way between two corners, in sizes of the cell.
    let scaled = |[from, to]: [u32; 2]| -> [f64; D] {
        let way = space.way(parameter(at_of[from as usize]), parameter(at_of[to as usize]));
        std::array::from_fn(|d| way[d] / size[d])
    };
    let of = |points: f64| match corners {
        // There are two triangles to a point.
        Corners::Triangle([a, b, c]) => {
            let (p, q) = (scaled([a, b]), scaled([a, c]));
            (p[0] * q[D - 1] - p[D - 1] * q[0]).abs() * points
        }
        Corners::Edge(ends) => scaled(ends).iter().fold(0.0_f64, |longest, x| longest.max(x.abs())) * points.sqrt(),
    };
    let enough = (ENOUGH * space.degree().iter().map(|p| p + 1).product::<usize>()) as f64;
    let count = (points.offsets()[cell + 1] - points.offsets()[cell]) as f64;
    Ok((count < enough || of(enough) >= 1.0).then(|| of(count)))
}

/// The centre of the parameters of a triangle or an edge, which may lie across a seam.
fn centre<const D: usize, S: ParameterBox<D>>(
    space: &S,
    parameter: impl Fn(usize) -> [f64; D],
    at_of: &[usize],
    corners: &Corners,
) -> [f64; D] {
    let [first, others @ ..] = corners.indices() else { return [0.0; D] };
    let from = parameter(at_of[*first as usize]);
    let mut way = [0.0; D];
    for &other in others {
        let to_other = space.way(from, parameter(at_of[other as usize]));
        (0..D).for_each(|d| way[d] += to_other[d]);
    }
    space.to_domain(std::array::from_fn(|d| from[d] + way[d] / (others.len() + 1) as f64))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::state::Snapshot;
    use crate::terms::rim_edges::rim;
    use thb_core::{HierarchicalSpace, Kind, KnotVector, SplineMap};

    /// One biquadratic patch over the unit square.
    fn patch() -> Arc<HierarchicalSpace<2>> {
        let knots = KnotVector::uniform(2, 1).unwrap();
        Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap())
    }

    /// Points of the plane at their parameters, sorted.
    fn flat(parameters: &[[f64; 2]], space: &HierarchicalSpace<2>) -> SortedPoints<2> {
        let parameters = Array2::from_shape_fn((parameters.len(), 2), |(i, k)| parameters[i][k]);
        let places =
            Array2::from_shape_fn((parameters.nrows(), 3), |(i, k)| if k < 2 { parameters[[i, k]] } else { 0.0 });
        let mut points = SortedPoints::new(parameters.view(), places.view(), None).unwrap();
        points.sort_refined(space, None).unwrap();
        points
    }

    #[test]
    fn large_simplices_stand_for_the_points_that_would_lie_there() {
        let space = patch();
        // A corner, and 99 points crowded along the line from another corner to a third.
        let mut parameters = vec![[0.0, 0.0]];
        parameters.extend((0..99).map(|i| [1.0, f64::from(i) / 98.0]));
        let points = flat(&parameters, &space);
        let stands = |corners| stands_for(space.as_ref(), &points, &points.places(), corners).unwrap();
        // Half of the square has half of the points, 1 of 98 parts of it and of a side have too few to be needed.
        assert_eq!(stands(Corners::Triangle([0, 1, 99])), Some(100.0));
        assert_eq!(stands(Corners::Triangle([0, 1, 2])), None);
        assert_eq!(stands(Corners::Edge([0, 1])), Some(10.0));
        assert_eq!(stands(Corners::Edge([1, 2])), None);
        // With few points all are needed.
        let points = flat(&parameters[..12], &space);
        assert!(stands_for(space.as_ref(), &points, &points.places(), Corners::Edge([1, 2])).unwrap().is_some());
    }

    #[test]
    fn a_surface_is_held_where_it_grows_beyond_the_rim() {
        let space = patch();
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let points = flat(&corners, &space);
        let triangles = [[0, 1, 2], [0, 2, 3]];
        let rim = rim(&triangles);
        assert_eq!(rim.len(), 4);
        let centres = TriangleCentres::new(&triangles, &rim, space.as_ref(), &points, 1.0).unwrap().unwrap();
        // The middle control point of the side v = 0 is moved: the middle of the side moves by half of that.
        let energy = |way: [f64; 3]| {
            let along = KnotVector::uniform(2, 1).unwrap().greville();
            let mut coefficients = Array2::zeros((9, 3));
            for (i, mut row) in coefficients.outer_iter_mut().enumerate() {
                (row[0], row[1]) = (along[i % 3], along[i / 3]);
            }
            (0..3).for_each(|k| coefficients[[1, k]] += way[k]);
            let map = SplineMap::new(space.clone(), coefficients).unwrap();
            let snapshot = Snapshot::new(&map, &points, |_| 1.0).unwrap();
            centres.energy(&snapshot.start(&map, &points).state).unwrap()
        };
        assert!(energy([0.0; 3]) < 1e-30);
        // An edge as long as the cell stands for two of four points, each triangle for four.
        let of_triangles = 0.5
            * 4.0
            * 0.4_f64.powi(2)
            * [4.0 / 9.0, 1.0 / 9.0].map(|v: f64| (v * 4.0 / 9.0).powi(2)).iter().sum::<f64>();
        let of_edge = 0.5 * RIM * 2.0 * 0.2_f64.powi(2);
        for (way, expected) in [
            ([0.0, -0.4, 0.0], of_edge + ALONG * of_triangles),
            ([0.4, 0.0, 0.0], ALONG * (of_edge + of_triangles)),
            ([0.0, 0.0, 0.4], of_edge + of_triangles),
        ] {
            assert!((energy(way) - expected).abs() < 1e-12, "{way:?}: {} for {expected}", energy(way));
        }
    }
}
