//! The surfaces, and where on them points lie.

use std::f64::consts::TAU;
use std::sync::Arc;

use anyhow::{Result, ensure};
use clap::ValueEnum;
use ndarray::Array2;
use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use thb_core::{CellSpace, KnotVector, SplineMap, TensorSpace};

/// The surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// One side of Wigley's hull, `y = B/2 (1 − (2x/L)²)(1 − (z/T)²)`, with L = 10, B = 1, T = 0.625.
    Wigley,
    /// A biquadratic B-spline in the shape of a car bonnet, about 1.2 × 1.4.
    Bonnet,
    /// A bicubic B-spline in the shape of a turbine blade, 60 long, tapered and twisted; open at root, tip and trailing
    /// edge.
    Blade,
    /// Imperatore 2024, (3.13): a height field with three cusps over [−1, 1]², at random points.
    Peaks,
    /// A tube round u, 5 long: an oval section that turns and swells from v = 0 to v = 1.
    Tube,
    /// A torus with radii 3 and 1, closed in u and v, with waves.
    Torus,
    /// The same on a grid, as in the example of reweighted least squares in §3.1.6 (64 × 64 points there).
    Rwls,
}

impl Kind {
    /// Where its points lie by default.
    pub fn layout(self) -> Layout {
        match self {
            Self::Wigley | Self::Bonnet | Self::Blade | Self::Tube | Self::Torus => Layout::Scattered,
            Self::Peaks => Layout::Random,
            Self::Rwls => Layout::Grid,
        }
    }

    /// Whether the parameters of a point follow from the point.
    pub fn is_height_field(self) -> bool {
        matches!(self, Self::Peaks | Self::Rwls)
    }

    pub(super) fn surface(self) -> Result<Surface> {
        Ok(match self {
            Self::Wigley => Surface::Formula(wigley),
            Self::Peaks | Self::Rwls => Surface::Formula(peaks),
            Self::Tube => Surface::Formula(tube),
            Self::Torus => Surface::Formula(torus),
            Self::Bonnet => Surface::Spline(spline(2, [6, 8], bonnet_control_point)?),
            Self::Blade => Surface::Spline(spline(3, [8, 10], blade_control_point)?),
        })
    }
}

/// Places in the parameter square.
pub(super) struct Places {
    pub(super) parameters: Vec<[f64; 2]>,
    /// Points per direction, of a grid; the second direction runs first.
    pub(super) grid: Option<[usize; 2]>,
}

/// Where points lie in the parameter square.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Layout {
    /// A square grid; the number of points must be a square.
    Grid,
    /// Evenly along the four sides, evenly but without order inside; in random order, like a cleaned scan.
    Scattered,
    /// Uniformly random, none on the boundary.
    Random,
}

impl Layout {
    pub(super) fn places(self, count: usize, random: &mut ChaCha8Rng) -> Result<Places> {
        ensure!(count >= 4, "{count} points are too few, at least 4 are needed");
        let side = count.isqrt();
        let (parameters, grid) = match self {
            Self::Grid => {
                ensure!(side * side == count, "a grid needs a square number of points, {count} is none");
                let at = |i: usize| i as f64 / (side - 1) as f64;
                ((0..count).map(|k| [at(k / side), at(k % side)]).collect(), Some([side, side]))
            }
            Self::Scattered => (scattered(count, side - 1, random), None),
            Self::Random => ((0..count).map(|_| [random.random(), random.random()]).collect(), None),
        };
        Ok(Places { parameters, grid })
    }
}

/// Points along the sides with `intervals` intervals each, the rest inside.
fn scattered(count: usize, intervals: usize, random: &mut ChaCha8Rng) -> Vec<[f64; 2]> {
    /// The solution of x³ = x + 1; multiples of its negative powers fill the square evenly (Roberts 2018, sequence R₂).
    const PLASTIC: f64 = 1.324_717_957_244_746;
    /// Shift of inner points against the even sequence, in units of the boundary's spacing.
    const JITTER: f64 = 0.25;
    /// Distance of the inner points from the boundary, in the same units, before they are shifted.
    const MARGIN: f64 = 0.6;

    let spacing = 1.0 / intervals as f64;
    let mut places = Vec::with_capacity(count);
    for i in 0..intervals {
        let t = i as f64 * spacing;
        places.extend([[t, 0.0], [1.0, t], [1.0 - t, 1.0], [0.0, 1.0 - t]]);
    }
    let start: [f64; 2] = random.random();
    for n in 0..count - places.len() {
        places.push([0, 1].map(|d| {
            let even = (start[d] + (n + 1) as f64 * PLASTIC.powi(-(d as i32 + 1))).fract();
            let shift = JITTER * spacing * (2.0 * random.random::<f64>() - 1.0);
            MARGIN * spacing + (1.0 - 2.0 * MARGIN * spacing) * even + shift
        }));
    }
    places.shuffle(random);
    places
}

pub(super) enum Surface {
    Formula(fn([f64; 2]) -> [f64; 3]),
    Spline(SplineMap<2, TensorSpace<2>>),
}

impl Surface {
    pub(super) fn point(&self, uv: [f64; 2]) -> Result<[f64; 3]> {
        match self {
            Self::Formula(formula) => Ok(formula(uv)),
            Self::Spline(map) => {
                let point = map.eval(uv)?;
                Ok([point[0], point[1], point[2]])
            }
        }
    }
}

fn wigley([u, v]: [f64; 2]) -> [f64; 3] {
    const LENGTH: f64 = 10.0;
    const BEAM: f64 = 1.0;
    const DRAUGHT: f64 = 0.625;
    let (x, z) = (LENGTH * (u - 0.5), DRAUGHT * (v - 1.0));
    let y = 0.5 * BEAM * (1.0 - (2.0 * x / LENGTH).powi(2)) * (1.0 - (z / DRAUGHT).powi(2));
    [x, y, z]
}

fn peaks([u, v]: [f64; 2]) -> [f64; 3] {
    let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let cusp = |shift: f64| (-(10.0 * x + shift).hypot(10.0 * y + shift)).exp();
    [x, y, 2.0 / 3.0 * (cusp(-3.0) + cusp(3.0) + cusp(0.0))]
}

fn tube([u, v]: [f64; 2]) -> [f64; 3] {
    const LENGTH: f64 = 5.0;
    let (sine, cosine) = (TAU * u).sin_cos();
    // Harmonics of the angle only: the tube is smooth across its seam.
    let radius = 1.0 + 0.25 * (2.0 * TAU * u + 2.0 * v).cos() + 0.5 * v * (1.0 - v) + 0.1 * v * (3.0 * TAU * u).sin();
    [radius * cosine + 0.4 * v * v, radius * sine, LENGTH * v]
}

fn torus([u, v]: [f64; 2]) -> [f64; 3] {
    let ((sine, cosine), (rise, reach)) = ((TAU * u).sin_cos(), (TAU * v).sin_cos());
    let tube = 1.0 + 0.15 * (3.0 * TAU * u).cos() * (2.0 * TAU * v).sin();
    let radius = 3.0 + tube * reach;
    [radius * cosine, radius * sine, tube * rise]
}

/// A B-spline whose control points follow from their Greville abscissae.
fn spline(
    degree: usize,
    elements: [usize; 2],
    control_point: fn([f64; 2]) -> [f64; 3],
) -> Result<SplineMap<2, TensorSpace<2>>> {
    let [first, second] = elements.map(|n| KnotVector::uniform(degree, n));
    let knots = [first?, second?];
    let (u, v) = (knots[0].greville(), knots[1].greville());
    let space = TensorSpace::new(knots)?;
    let coefficients =
        Array2::from_shape_fn((space.n_functions(), 3), |(i, k)| control_point([u[i % u.len()], v[i / u.len()]])[k]);
    Ok(SplineMap::new(Arc::new(space), coefficients)?)
}

/// From windscreen (u = 0) to grille (u = 1); v runs across the car. Only arithmetic, so that all machines agree.
fn bonnet_control_point([u, v]: [f64; 2]) -> [f64; 3] {
    let across = 2.0 * v - 1.0;
    let crown = 1.0 - across * across;
    // A ridge on either side, sharper towards the windscreen.
    let ridge = (1.0 - 4.0 * (across.abs() - 0.55).abs()).max(0.0) * (1.0 - 0.6 * u);
    let x = 1.05 * u + 0.14 * crown * u;
    let y = 0.7 * across * (1.0 - 0.12 * u * u);
    [x, y, 0.09 * crown - 0.2 * u * u * u + 0.025 * ridge]
}

/// From root (u = 0) to tip (u = 1); v runs from the trailing edge of one side round the nose to that of the other.
fn blade_control_point([u, v]: [f64; 2]) -> [f64; 3] {
    const SPAN: f64 = 60.0;
    let round = 2.0 * v - 1.0;
    let chord = 4.2 - 3.4 * u;
    let thickness = 0.3 - 0.18 * u;
    let (along, across) = (round * round - 0.3, thickness * round * (1.0 - 0.9 * round * round) + 0.05 * round * round);
    // Twist by the angle of half-tangent t.
    let t = 0.12 * (1.0 - u) * (1.0 - u);
    let (sine, cosine) = (2.0 * t / (1.0 + t * t), (1.0 - t * t) / (1.0 + t * t));
    let prebend = 2.5 * u * u;
    [chord * (cosine * along - sine * across), chord * (sine * along + cosine * across) + prebend, SPAN * u]
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn layouts_give_the_number_of_points_asked_for() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        for count in [4, 9, 100, 1600] {
            for layout in [Layout::Grid, Layout::Scattered, Layout::Random] {
                let parameters = layout.places(count, &mut random).unwrap().parameters;
                assert_eq!(parameters.len(), count);
                assert!(parameters.iter().flatten().all(|u| (0.0..=1.0).contains(u)));
            }
            assert!(Layout::Grid.places(count + 1, &mut random).is_err());
        }
    }

    #[test]
    fn scattered_points_lie_on_all_sides_and_apart() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let parameters = Layout::Scattered.places(400, &mut random).unwrap().parameters;
        for (d, side) in [(0, 0.0), (0, 1.0), (1, 0.0), (1, 1.0)] {
            assert_eq!(parameters.iter().filter(|uv| uv[d] == side).count(), 20);
        }
        for (i, a) in parameters.iter().enumerate() {
            for b in &parameters[..i] {
                assert!((a[0] - b[0]).hypot(a[1] - b[1]) > 0.1 / 19.0, "{a:?} and {b:?}");
            }
        }
    }

    #[test]
    fn the_hull_ends_at_stem_stern_and_keel_and_is_widest_amidships() {
        for t in [0.0, 0.3, 1.0] {
            for edge in [[0.0, t], [1.0, t], [t, 0.0]] {
                assert_eq!(wigley(edge)[1], 0.0);
            }
        }
        assert_eq!(wigley([0.5, 1.0]), [0.0, 0.5, 0.0]);
    }

    #[test]
    fn tube_and_torus_close() {
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-13);
        for t in [0.0, 0.2, 0.7, 1.0] {
            assert!(near(tube([0.0, t]), tube([1.0, t])) && !near(tube([t, 0.0]), tube([t, 1.0])));
            assert!(near(torus([0.0, t]), torus([1.0, t])) && near(torus([t, 0.0]), torus([t, 1.0])));
        }
    }

    #[test]
    fn the_blade_is_open_at_its_trailing_edge() {
        for u in [0.0, 0.5, 1.0] {
            let (a, b) = (blade_control_point([u, 0.0]), blade_control_point([u, 1.0]));
            let gap = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
            assert!(gap > 0.01, "gap {gap} at u = {u}");
        }
    }
}
