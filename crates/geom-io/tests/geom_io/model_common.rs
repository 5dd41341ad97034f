//! Models for the tests of the model formats.
#![allow(dead_code, reason = "each test file uses a part")]

use std::f64::consts::TAU;
use std::sync::Arc;

use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap, transfer};

/// Numbers in [-0.5, 0.5).
pub(crate) struct Noise(u64);

impl Noise {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed | 1)
    }

    pub(crate) fn draw(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
    }
}

/// A space refined at random places: `choices` picks one leaf cell a round.
pub(crate) fn random_space<const D: usize>(
    kind: Kind,
    degree: [usize; D],
    elements: [usize; D],
    choices: &[u16],
) -> HierarchicalSpace<D> {
    let knots = std::array::from_fn(|d| KnotVector::uniform(degree[d], elements[d]).unwrap());
    let mut space = HierarchicalSpace::new(kind, knots).unwrap();
    for (round, &choice) in choices.iter().enumerate() {
        let cell = usize::from(choice) % space.n_cells();
        let extension = [[0, 2, 3, 4][round % 4]; D];
        space = space.refine(&[cell], &Refinement { extension, max_levels: 6, ..Refinement::default() }).unwrap();
    }
    space
}

/// A map with arbitrary coefficients, some of them awkward to print.
pub(crate) fn random_map<const D: usize>(space: HierarchicalSpace<D>, dim: usize, seed: u64) -> SplineMap<D> {
    let mut noise = Noise::new(seed);
    let awkward = [-0.0, 5e-324, 1.0 / 3.0, -1e90, 0.1, 1e-7];
    let mut count = 0;
    let coefficients = Array2::from_shape_simple_fn((space.n_functions(), dim), || {
        count += 1;
        if count % 11 == 0 { awkward[count % awkward.len()] } else { noise.draw() * 1e3_f64.powf(4.0 * noise.draw()) }
    });
    SplineMap::new(Arc::new(space), coefficients).unwrap()
}

/// A wavy sheet over 100 × 60, refined towards the curve v = 0.3 + 0.4 u², with detail of each level.
pub(crate) fn sheet(kind: Kind, degree: [usize; 2], elements: [usize; 2], n_levels: usize) -> SplineMap<2> {
    let curve = |u: f64| 0.3 + 0.4 * u * u;
    let near = |lower: [f64; 2], upper: [f64; 2]| curve(lower[0]) < upper[1] && curve(upper[0]) > lower[1];
    let place =
        |u: f64, v: f64| [100.0 * u + 5.0 * (6.0 * v).sin(), 60.0 * v, 12.0 * (5.0 * u).sin() * (4.0 * v).cos()];
    surface(kind, open_knots(degree, elements), n_levels, near, place)
}

/// Places refined in [`spots`].
const SPOTS: [[f64; 2]; 5] = [[0.13, 0.21], [0.71, 0.68], [0.2, 0.83], [0.55, 0.31], [0.93, 0.07]];

/// A wavy sheet refined at a few places only.
pub(crate) fn spots(degree: [usize; 2], elements: [usize; 2], n_levels: usize) -> SplineMap<2> {
    let inside = |lower: [f64; 2], upper: [f64; 2]| {
        SPOTS.iter().any(|spot| (0..2).all(|d| lower[d] <= spot[d] && spot[d] < upper[d]))
    };
    let place = |u: f64, v: f64| [100.0 * u, 60.0 * v + 4.0 * u * u, 10.0 * (3.0 * u + 2.0 * v).sin()];
    surface(Kind::Thb, open_knots(degree, elements), n_levels, inside, place)
}

/// A dome: its side v = 1 is one point, its sides u = 0 and u = 1 are apart.
pub(crate) fn dome(n_levels: usize) -> SplineMap<2> {
    let near = |lower: [f64; 2], upper: [f64; 2]| lower[0] < 0.3 && upper[1] > 0.9;
    let place = |u: f64, v: f64| {
        let (angle, radius) = (3.0 * u, 10.0 * (1.0 - v));
        [radius * angle.cos(), radius * angle.sin(), 8.0 * v * (2.0 - v)]
    };
    surface(Kind::Thb, open_knots([2, 3], [5, 4]), n_levels, near, place)
}

/// A tube, closed in u, or a torus, closed in u and v, refined on both sides of the seam.
pub(crate) fn ring(kind: Kind, degree: [usize; 2], elements: [usize; 2], torus: bool, n_levels: usize) -> SplineMap<2> {
    let mut knots = open_knots(degree, elements);
    for d in 0..if torus { 2 } else { 1 } {
        knots[d] = KnotVector::uniform_periodic(degree[d], elements[d]).unwrap();
    }
    let near = |lower: [f64; 2], upper: [f64; 2]| {
        let seam = lower[0] == 0.0 && upper[1] > 0.4 || upper[0] == 1.0 && lower[1] < 0.3;
        seam || torus && lower[1] == 0.0 && lower[0] < 0.6
    };
    let place = |u: f64, v: f64| {
        let ((s, c), (sine, cosine)) = ((TAU * u).sin_cos(), (TAU * v).sin_cos());
        let radius = if torus { 30.0 + 12.0 * cosine } else { 20.0 + 5.0 * v };
        [radius * c, radius * s, if torus { 12.0 * sine } else { 60.0 * v }]
    };
    surface(kind, knots, n_levels, near, place)
}

/// A cap, closed in u: its side v = 1 is one point.
pub(crate) fn cap(n_levels: usize) -> SplineMap<2> {
    let knots = [KnotVector::uniform_periodic(3, 7).unwrap(), KnotVector::uniform(2, 4).unwrap()];
    let near = |lower: [f64; 2], upper: [f64; 2]| lower[0] == 0.0 && upper[1] > 0.6;
    let place = |u: f64, v: f64| {
        let (sine, cosine) = (TAU * u).sin_cos();
        [20.0 * (1.0 - v) * cosine, 20.0 * (1.0 - v) * sine, 15.0 * v * (2.0 - v)]
    };
    surface(Kind::Thb, knots, n_levels, near, place)
}

fn open_knots(degree: [usize; 2], elements: [usize; 2]) -> [KnotVector; 2] {
    std::array::from_fn(|d| KnotVector::uniform(degree[d], elements[d]).unwrap())
}

/// A surface whose control points of level 0 are `place` at the Greville abscissae, refined from level to level where
/// `refine(lower, upper)` says so of a cell, with noise on the coefficients of finer levels away from v = 1.
pub(crate) fn surface(
    kind: Kind,
    knots: [KnotVector; 2],
    n_levels: usize,
    refine: impl Fn([f64; 2], [f64; 2]) -> bool,
    place: impl Fn(f64, f64) -> [f64; 3],
) -> SplineMap<2> {
    let degree = [knots[0].degree(), knots[1].degree()];
    let space = HierarchicalSpace::new(kind, knots).unwrap();
    let (u, v) = (space.knots(0, 0).unwrap().greville(), space.knots(0, 1).unwrap().greville());
    let points = |(i, k)| place(u[i % u.len()], v[i / u.len()])[k];
    let coefficients = Array2::from_shape_fn((space.n_functions(), 3), points);
    let mut map = SplineMap::new(Arc::new(space), coefficients).unwrap();
    let mut noise = Noise::new(7);
    for level in 1..n_levels {
        let space = map.space();
        let marked: Vec<usize> = (0..space.n_cells())
            .filter(|&cell| space.mesh().level(space.node(cell)) == level - 1)
            .filter(|&cell| refine(space.cell(cell).lower, space.cell(cell).upper))
            .collect();
        let extension = degree.map(|p| 2 * p.div_ceil(2));
        let options = Refinement { extension, admissible: Some(2), ..Refinement::default() };
        let finer = space.refine(&marked, &options).unwrap();
        let mut coefficients = transfer(&map, &finer).unwrap();
        let size = 0.5_f64.powi(level as i32);
        let columns = finer.function_counts(level);
        let last_row = ((columns[1] - 1) * columns[0]) as u64;
        let own = coefficients.outer_iter_mut().skip(finer.first_of_level(level));
        for (mut row, &function) in own.zip(finer.active_functions(level)) {
            if function < last_row {
                row[0] += 2.0 * size * noise.draw();
                row[2] += 5.0 * size * noise.draw();
            }
        }
        map = SplineMap::new(Arc::new(finer), coefficients).unwrap();
    }
    map
}

/// A curve in space with a few levels.
pub(crate) fn curve(degree: usize) -> SplineMap<1> {
    let knots = KnotVector::uniform(degree, 5).unwrap();
    let mut space = HierarchicalSpace::new(Kind::Thb, [knots]).unwrap();
    for u in [0.35, 0.36, 0.37, 0.9] {
        let cell = space.locate_cell([u]).unwrap();
        space = space.refine(&[cell], &Refinement { extension: [4], ..Refinement::default() }).unwrap();
    }
    let mut noise = Noise::new(3);
    let coefficients =
        Array2::from_shape_fn((space.n_functions(), 3), |(i, k)| i as f64 * [1.0, 0.5, 0.1][k] + noise.draw());
    SplineMap::new(Arc::new(space), coefficients).unwrap()
}
