//! Places where a surface lies on itself, or does not lie as the scan does.

use point_cloud::vec3::{add, dot, norm, scale, sub, unit};

use crate::adjacency::{NONE, Sets, neighbours};
use crate::{Error, Tessellation};

/// Cosine of the turn between neighbouring triangles from which on one of them is folded over.
///
/// Derived: 120° lies between the edge of a box, 90°, which a fit overshoots a little, and the edge of a fold, 180°, which the
/// triangles round off a little.
const FOLD_COSINE: f64 = -0.5;

/// Cosine of the angle from which on a normal is another one: 45°.
///
/// Derived: beside an edge of 90° the normals of both sides are known, so that a surface that rounds it off is within 45° of one.
const TILT_COSINE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// A connected folded part.
#[derive(Clone, Debug, PartialEq)]
pub struct Fold {
    /// The middle of its largest triangle.
    pub place: [f64; 3],
    /// Its parameters.
    pub parameters: [f64; 2],
    /// Area of the part.
    pub area: f64,
    /// Its triangles, increasing.
    pub triangles: Vec<u32>,
}

/// The folded parts of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Folds {
    /// The parts, the largest first.
    pub places: Vec<Fold>,
    /// Their share of the surface's area.
    pub share: f64,
}

/// The folded parts of a surface.
///
/// With `reference`, a normal of the scan near each triangle (any length; zero where it is unknown; all on one side of the scan,
/// whichever), the parts whose normals are turned by more than a right angle from it: a fold that the scan has, too, is none.
///
/// Without, the parts that are cut off from the largest one by edges over which the normal turns by more than 120°: the middle
/// layer of a pleat, whose normals are opposite to those around. Turns that the chord error resolves, such as the round front of a
/// blade, have no such edge; a sharp rear edge has, but both sides of the blade are joined in front.
///
/// # Errors
/// [`Error::Count`] unless there is a normal for each triangle; [`Error::NoArea`].
pub fn folds(tessellation: &Tessellation, reference: Option<&[[f64; 3]]>) -> Result<Folds, Error> {
    let n = tessellation.triangles.len();
    let vectors: Vec<[f64; 3]> = (0..n).map(|t| tessellation.area_vector(t)).collect();
    let areas: Vec<f64> = vectors.iter().map(|&v| norm(v)).collect();
    let total: f64 = areas.iter().sum();
    if total.is_nan() || total <= 0.0 {
        return Err(Error::NoArea);
    }
    let neighbours = neighbours(&tessellation.triangles, tessellation.vertices.len());
    let mut sets = Sets::new(n);
    let folded: Vec<bool> = match reference {
        Some(reference) => {
            if reference.len() != n {
                return Err(Error::Count { what: "reference normals", given: reference.len(), expected: n });
            }
            // The part of each area vector along the reference; most of the area tells its side.
            let along: Vec<f64> = vectors.iter().zip(reference).map(|(&v, &r)| dot(v, unit(r))).collect();
            let side = along.iter().sum::<f64>().signum();
            along.iter().map(|a| a * side < 0.0).collect()
        }
        None => {
            for (t, around) in neighbours.iter().enumerate() {
                for &other in around.iter().filter(|&&other| other != NONE) {
                    let product = areas[t] * areas[other as usize];
                    if dot(vectors[t], vectors[other as usize]) >= FOLD_COSINE * product {
                        sets.join(t as u32, other);
                    }
                }
            }
            let mut area_of_set = vec![0.0; n];
            for t in 0..n {
                area_of_set[sets.root(t as u32) as usize] += areas[t];
            }
            let by_area = |&a: &usize, &b: &usize| area_of_set[a].total_cmp(&area_of_set[b]).then(b.cmp(&a));
            let largest = (0..n).max_by(by_area).unwrap_or(0);
            (0..n).map(|t| sets.root(t as u32) as usize != largest).collect()
        }
    };
    let mut parts = Sets::new(n);
    for (t, around) in neighbours.iter().enumerate() {
        for &other in around.iter().filter(|&&other| other != NONE) {
            if folded[t] && folded[other as usize] {
                parts.join(t as u32, other);
            }
        }
    }
    let mut members: Vec<(u32, u32)> =
        (0..n as u32).filter(|&t| folded[t as usize]).map(|t| (parts.root(t), t)).collect();
    members.sort_unstable();
    let mut places: Vec<Fold> = Vec::new();
    for part in members.chunk_by(|a, b| a.0 == b.0) {
        let triangles: Vec<u32> = part.iter().map(|member| member.1).collect();
        let area = triangles.iter().map(|&t| areas[t as usize]).sum();
        let by_area = |&&a: &&u32, &&b: &&u32| areas[a as usize].total_cmp(&areas[b as usize]).then(b.cmp(&a));
        let Some(&largest) = triangles.iter().max_by(by_area) else { continue };
        let place = middle(tessellation.corners(largest as usize));
        let parameters = tessellation.parameters_at(largest as usize, [1.0 / 3.0; 3]);
        places.push(Fold { place, parameters, area, triangles });
    }
    places.sort_by(|a, b| b.area.total_cmp(&a.area).then(a.triangles.cmp(&b.triangles)));
    // Negative zero would be the sum of none.
    let share = places.iter().fold(0.0, |sum, fold| sum + fold.area) / total;
    Ok(Folds { places, share })
}

/// Share of the length of the edges between triangles over which the normal turns by more than a right angle. A surface that
/// follows a scan has such edges along its sharp edges at most; one with too few points to hold it creases between them, which
/// distances at the points do not tell.
pub fn creases(tessellation: &Tessellation) -> f64 {
    let vectors: Vec<[f64; 3]> = (0..tessellation.triangles.len()).map(|t| tessellation.area_vector(t)).collect();
    let neighbours = neighbours(&tessellation.triangles, tessellation.vertices.len());
    let [mut creased, mut all] = [0.0; 2];
    for (t, around) in neighbours.iter().enumerate() {
        let corners = tessellation.corners(t);
        for (k, &other) in around.iter().enumerate().filter(|&(_, &other)| other != NONE && other > t as u32) {
            let length = norm(sub(corners[(k + 1) % 3], corners[k]));
            all += length;
            if dot(vectors[t], vectors[other as usize]) < 0.0 {
                creased += length;
            }
        }
    }
    if all > 0.0 { creased / all } else { 0.0 }
}

/// Share of the area of a surface whose normal is more than 45° from all the normals that `normals_near` gives for a place, each
/// of length one and with either sign. Distances do not see a narrow fold beside the points, and it need not turn by a right
/// angle. It should give several: a fold may lie beside a sharp edge, with points of both its sides around it.
pub fn tilted<N: AsRef<[[f64; 3]]>>(tessellation: &Tessellation, mut normals_near: impl FnMut([f64; 3]) -> N) -> f64 {
    let [mut tilted, mut all] = [0.0; 2];
    for t in 0..tessellation.triangles.len() {
        let vector = tessellation.area_vector(t);
        let area = norm(vector);
        all += area;
        let near = normals_near(middle(tessellation.corners(t)));
        if !near.as_ref().iter().any(|&normal| dot(vector, normal).abs() > TILT_COSINE * area) {
            tilted += area;
        }
    }
    if all > 0.0 { tilted / all } else { 0.0 }
}

fn middle([p, q, r]: [[f64; 3]; 3]) -> [f64; 3] {
    scale(1.0 / 3.0, add(p, add(q, r)))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;
    use std::sync::Arc;

    use ndarray::Array2;
    use thb_core::{HierarchicalSpace, Kind, KnotVector, SplineMap};

    use super::*;
    use crate::testing::{Random, interpolated, moved, refined_at_random};

    /// A plane sheet of `elements` per direction with one control point moved within the plane.
    fn pushed(degree: usize, elements: usize, by: [f64; 2]) -> SplineMap<2> {
        let knots = KnotVector::uniform(degree, elements).unwrap();
        let sites = knots.greville();
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
        let n = sites.len();
        let mut coefficients = Array2::from_shape_fn((n * n, 3), |(i, k)| [sites[i % n], sites[i / n], 0.0][k]);
        let middle = n * (n / 2) + n / 2;
        coefficients[[middle, 0]] += by[0];
        coefficients[[middle, 1]] += by[1];
        SplineMap::new(space, coefficients).unwrap()
    }

    /// The share of the area of a plane sheet that is turned over, by the sign of the Jacobian on a fine grid.
    fn turned_over(map: &SplineMap<2>) -> f64 {
        let n = 800;
        let [mut over, mut all] = [0.0; 2];
        for k in 0..n * n {
            let u = [(k % n) as f64, (k / n) as f64].map(|i| (i + 0.5) / n as f64);
            let (a, b) = (map.derivative(u, [1, 0]).unwrap(), map.derivative(u, [0, 1]).unwrap());
            let jacobian = a[0] * b[1] - a[1] * b[0];
            all += jacobian.abs();
            over += (-jacobian).max(0.0);
        }
        over / all
    }

    #[test]
    fn the_folded_share_is_that_of_negative_jacobians() {
        let mut random = Random::new(11);
        for degree in 2..=4 {
            for push in [0.0, 0.05, 0.4, 0.8] {
                let angle = random.between(0.0, TAU);
                let map = pushed(degree, 6, [push * angle.cos(), push * angle.sin()]);
                let expected = turned_over(&map);
                let map = moved(&map, &mut random).0;
                let size =
                    norm(sub([map.coefficients()[[0, 0]], map.coefficients()[[0, 1]], map.coefficients()[[0, 2]]], {
                        let last = map.coefficients().nrows() - 1;
                        [map.coefficients()[[last, 0]], map.coefficients()[[last, 1]], map.coefficients()[[last, 2]]]
                    }));
                let tessellation = Tessellation::new(&map, 1e-5 * size, 200_000).unwrap();
                let found = folds(&tessellation, None).unwrap();
                assert!((found.share - expected).abs() < 0.003 + 0.05 * expected, "{} {expected}", found.share);
                assert_eq!(
                    expected > 0.0,
                    found.share > 0.0,
                    "degree {degree}, push {push}: {expected} {}",
                    found.share
                );
                let sum: f64 = found.places.iter().map(|fold| fold.area).sum();
                let total: f64 = (0..tessellation.triangles.len()).map(|t| norm(tessellation.area_vector(t))).sum();
                assert!((sum / total - found.share).abs() < 1e-12);
                // Against the normal of the plane, on either side.
                let first = tessellation.area_vector(0);
                for side in [1.0, -3.0] {
                    let reference = vec![scale(side, first); tessellation.triangles.len()];
                    let by_reference = folds(&tessellation, Some(&reference)).unwrap();
                    assert!((by_reference.share - expected).abs() < 0.003 + 0.05 * expected);
                }
                assert_eq!(creases(&tessellation) > 0.0, expected > 0.0);
            }
        }
    }

    #[test]
    fn round_fronts_sharp_edges_and_poles_are_no_folds() {
        let mut random = Random::new(12);
        for case in 0..8 {
            let thickness = random.between(0.02, 0.2);
            let blade = |u: f64, v: f64| {
                let t = TAU * u;
                [0.5 * (1.0 + t.cos()), thickness * t.sin() * (0.5 * t).sin().abs(), 3.0 * v]
            };
            let sphere = |u: f64, v: f64| {
                let (sin, cos) = (TAU * u).sin_cos();
                let (height, width) = (0.5 * TAU * (v - 0.5)).sin_cos();
                [width * cos, width * sin, thickness * height]
            };
            for map in [
                interpolated([64, 6], [true, false], blade),
                interpolated([64, 6], [false, false], blade),
                interpolated([16, 8], [true, false], sphere),
            ] {
                let map = if case % 2 == 1 { refined_at_random(&map, &mut random) } else { map };
                let tessellation = Tessellation::new(&map, 0.01 * thickness, 400_000).unwrap();
                assert_eq!(folds(&tessellation, None).unwrap().share, 0.0);
                // The surface's own normals as those of the scan.
                let own: Vec<_> = (0..tessellation.triangles.len()).map(|t| tessellation.area_vector(t)).collect();
                assert_eq!(folds(&tessellation, Some(&own)).unwrap().places, []);
            }
        }
    }

    #[test]
    fn only_what_stands_across_the_normals_is_tilted() {
        // A surface of degree 1 with a fin of height h along the middle, two of ten elements wide.
        let knots = KnotVector::uniform(1, 10).unwrap();
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
        let share = |h: f64| {
            let coefficients = Array2::from_shape_fn((121, 3), |(i, k)| match k {
                0 => (i % 11) as f64 / 10.0,
                1 => (i / 11) as f64 / 10.0,
                _ => [0.0, h][usize::from(i % 11 == 5)],
            });
            let map = SplineMap::new(space.clone(), coefficients).unwrap();
            let tessellation = Tessellation::new(&map, 1e-3, 10_000).unwrap();
            tilted(&tessellation, |_| [[0.0, 0.0, -1.0]])
        };
        // Slope 0.9 and 2: the sides of the fin are as long as 0.2 · √5 in 0.8 + 0.2 · √5.
        assert_eq!((share(0.0), share(0.09)), (0.0, 0.0));
        let sides = 0.2 * 5.0_f64.sqrt();
        assert!((share(0.2) - sides / (0.8 + sides)).abs() < 1e-12);
    }

    #[test]
    fn what_has_no_area_or_too_few_normals_is_refused() {
        let flat = Tessellation::new(&interpolated([4, 4], [false, false], |u, _| [u, 0.0, 0.0]), 0.1, 1000).unwrap();
        assert_eq!(folds(&flat, None), Err(Error::NoArea));
        assert_eq!(creases(&flat), 0.0);
        let sheet = Tessellation::new(&interpolated([4, 4], [false, false], |u, v| [u, v, 0.0]), 0.1, 1000).unwrap();
        let given = folds(&sheet, Some(&[[0.0, 0.0, 1.0]]));
        assert!(matches!(given, Err(Error::Count { given: 1, .. })));
    }
}
