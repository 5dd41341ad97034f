//! Whether the equations of a term are the derivatives of its energy, over a grid of spaces, points and weights.

use std::sync::Arc;

use fit_ls::{BlockEquations, SortedPoints};
use ndarray::{Array1, Array2};
use thb_core::{
    HierarchicalSpace, Kind, KnotVector, ParameterBox, Quadrature, Refinement, SplineMap, SymmetricMatrix,
    SymmetricPattern, TensorSpace, ThinPlate,
};

use crate::equations::Equations;
use crate::points::frame::Frame;
use crate::points::vector::{difference, dot, padded, point};
use crate::state::{Snapshot, State, StepStart};
use crate::term::{Objective, Term};
use crate::terms::data::Data;
use crate::terms::lost_area::LostArea;
use crate::terms::rim_edges::rim;
use crate::terms::smoothing::Smoothing;
use crate::terms::springs::Springs;
use crate::terms::triangle_centres::TriangleCentres;
use crate::{Boundary, Constraints, JointOptions};

/// Points of a case.
const POINTS: usize = 64;

/// Of them, those in a row of a rectangle.
const PER_ROW: usize = 8;

/// Directions in which a term is differentiated in each case.
const DIRECTIONS: usize = 5;

/// Way along a direction to either side of a difference.
const STEP: f64 = 1e-5;

/// Numbers from 0 to 1 that look random.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A map and points near it: a third of them of weight 0 or 2, some on a side, where they are held.
pub(crate) struct Case<const D: usize, S> {
    name: String,
    pub(crate) map: SplineMap<D, S>,
    pub(crate) points: SortedPoints<D>,
    pub(crate) constraints: Constraints<D>,
    pub(crate) snapshot: Snapshot<D>,
    /// Parameters by the index of the point.
    pub(crate) start: Vec<[f64; D]>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl<const D: usize, S: ParameterBox<D>> Case<D, S> {
    /// For maps to R^N, N = `dim`.
    pub(crate) fn new(name: String, space: Arc<S>, dim: usize) -> Self {
        let mut random = Random(7);
        // A lattice of points along a line or across a rectangle, on the lower sides but not on the upper ones.
        let per_side = if D == 1 { POINTS } else { PER_ROW };
        let parameters = Array2::from_shape_fn((POINTS, D), |(i, d)| {
            let u = (i / per_side.pow(d as u32) % per_side) as f64 / per_side as f64;
            if u == 0.0 && !space.periodic()[d] { 0.0 } else { u + (0.3 + 0.4 * random.next()) / per_side as f64 }
        });
        let coefficients = Array2::from_shape_simple_fn((space.n_functions(), dim), || random.next());
        let map = SplineMap::new(space, coefficients).unwrap();
        let targets = map.eval_batch(parameters.view()).unwrap().mapv(|x| x + 0.2 * (random.next() - 0.5));
        let weights = Array1::from_shape_fn(POINTS, |i| [1.0, 0.0, 1.0, 2.0, 1.0, 1.0][i % 6]);
        let mut points = SortedPoints::new(parameters.view(), targets.view(), Some(weights.view())).unwrap();
        points.sort(map.space().as_ref(), |_| None).unwrap();
        let constraints = Constraints::in_space(parameters.view(), map.space().as_ref(), Boundary::Kept);
        let snapshot = Snapshot::new(&map, &points, |index| weights[index]).unwrap();
        let start = parameters.outer_iter().map(|row| std::array::from_fn(|d| row[d])).collect();
        let row = PER_ROW as u32;
        let triangles = (0..POINTS as u32 - row)
            .filter(|i| i % row != row - 1)
            .flat_map(|i| [[i, i + 1, i + row + 1], [i, i + row + 1, i + row]]);
        Self { name, constraints, snapshot, start, triangles: triangles.collect(), points, map }
    }

    /// The map and the parameters moved along a direction; held and periodic parameters as they should be.
    fn moved(&self, (by_coefficients, by_parameters): &Direction<D>, length: f64) -> (SplineMap<D, S>, Vec<[f64; D]>) {
        let coefficients = &self.map.coefficients() + &(by_coefficients * length);
        let map = SplineMap::new(self.map.space().clone(), coefficients).unwrap();
        let moved =
            |(u, way): (&[f64; D], &[f64; D])| map.space().to_domain(std::array::from_fn(|d| u[d] + length * way[d]));
        let parameters = self.snapshot.parameters.iter().zip(by_parameters).map(moved).collect();
        (map, parameters)
    }

    fn frames(&self, map: &SplineMap<D, S>, parameters: &[[f64; D]]) -> Vec<Frame<D>> {
        let frame = |(at, &u): (usize, &[f64; D])| Frame {
            residual: difference(&padded(&map.eval(u).unwrap()), &point(&self.points, at)),
            tangents: std::array::from_fn(|d| {
                padded(&map.derivative(u, std::array::from_fn(|e| usize::from(d == e))).unwrap())
            }),
        };
        parameters.iter().enumerate().map(frame).collect()
    }

    fn energy(&self, term: &dyn Term<D, S>, direction: &Direction<D>, length: f64) -> f64 {
        let (map, parameters) = self.moved(direction, length);
        let distances: Vec<f64> = self.frames(&map, &parameters).iter().map(Frame::distance).collect();
        let start = self.snapshot.start(&self.map, &self.points).state;
        let State { points, places, weights, .. } = start;
        let (parameters, distances) = (&parameters[..], &distances[..]);
        term.energy(&State { map: &map, points, places, parameters, distances, weights }).unwrap()
    }

    /// A direction of all coefficients, and of those parameters that may move; of coefficients only, if the term holds parameters
    /// constant.
    fn direction(&self, random: &mut Random, moves_parameters: bool) -> Direction<D> {
        let mut number = || random.next() - 0.5;
        let by_coefficients = Array2::from_shape_simple_fn(self.map.coefficients().raw_dim(), &mut number);
        let way = |&index: &u32| {
            let free = self.constraints.free(index as usize);
            std::array::from_fn(|d| if free[d] && moves_parameters { 0.1 * number() } else { 0.0 })
        };
        (by_coefficients, self.points.order().iter().map(way).collect())
    }
}

/// What coefficients, `(n_functions, N)`, and parameters change by.
type Direction<const D: usize> = (Array2<f64>, Vec<[f64; D]>);

/// What is known of a term.
#[derive(Clone, Copy, Default)]
pub(crate) struct Property {
    /// The equations hold its parameters constant, though the energy of a trial does not.
    pub(crate) holds_parameters: bool,
    /// It is a quadratic function of the coefficients, so that the Gauss–Newton matrix is the Hessian.
    pub(crate) is_quadratic: bool,
    /// Blocks of points have the residuals that go with it.
    pub(crate) is_distance: bool,
}

/// Compares, with what a term holds constant at the start of a step, slopes and curvatures of its energy with those of its equations: at the
/// start and elsewhere. Returns the largest slope.
pub(crate) fn check_term<const D: usize, S: ParameterBox<D>>(
    case: &Case<D, S>,
    term: &mut dyn Term<D, S>,
    property: Property,
) -> f64 {
    let name = format!("{} in {}", term.name(), case.name);
    term.freeze(&case.snapshot.start(&case.map, &case.points)).unwrap();
    let mut random = Random(11);
    let mut steepest = 0.0_f64;
    for round in 0..DIRECTIONS {
        let to = case.direction(&mut random, !property.holds_parameters);
        // What differences are taken around: the start itself, then places away from it.
        let away = if round == 0 { 0.0 } else { 0.1 };
        let (map, parameters) = case.moved(&to, away);
        let frames = case.frames(&map, &parameters);
        let distances: Vec<f64> = frames.iter().map(Frame::distance).collect();
        let State { points, places, weights, .. } = case.snapshot.start(&case.map, &case.points).state;
        let state = State { map: &map, points, places, parameters: &parameters, distances: &distances, weights };
        let mut equations = Equations::new(SymmetricPattern::new(map.space().as_ref()));
        let objective = Objective::new(vec![&mut *term]);
        objective.linearize_at(&StepStart { state, frames: &frames }, &mut equations).unwrap();
        drop(objective);
        let (slope, curvature) = along(&equations, &map, &parameters, &to, property.is_distance);
        let energy = |length: f64| case.energy(term, &to, away + length);
        let difference = (energy(STEP) - energy(-STEP)) / (2.0 * STEP);
        assert!((slope - difference).abs() < 1e-6 * (1.0 + slope.abs()), "{name}: {difference} against {slope}");
        steepest = steepest.max(slope.abs());
        assert!(curvature >= 0.0, "{name}: {curvature}");
        if property.is_quadratic {
            let only = (to.0.clone(), vec![[0.0; D]; to.1.len()]);
            let energy = |length: f64| {
                let (map, _) = case.moved(&only, length);
                let frames = case.frames(&map, &parameters);
                let distances: Vec<f64> = frames.iter().map(Frame::distance).collect();
                term.energy(&State { map: &map, distances: &distances, ..state }).unwrap()
            };
            let difference = energy(away + 1.0) - 2.0 * energy(away) + energy(away - 1.0);
            assert!((curvature - difference).abs() < 1e-9 * (1.0 + curvature), "{name}: {difference}, not {curvature}");
        }
    }
    steepest
}

/// Slope of the objective along a direction, and its curvature along the coefficients of the direction, by the equations.
fn along<const D: usize, S: ParameterBox<D>>(
    equations: &Equations<D>,
    map: &SplineMap<D, S>,
    parameters: &[[f64; D]],
    (by_coefficients, by_parameters): &Direction<D>,
    is_distance: bool,
) -> (f64, f64) {
    let (pattern, n) = (SymmetricPattern::new(map.space().as_ref()), map.dim());
    let change = SplineMap::new(map.space().clone(), by_coefficients.clone()).unwrap();
    let (mut slope, mut curvature) = (0.0, 0.0);
    for ((block, &u), way) in equations.points.iter().zip(parameters).zip(by_parameters) {
        let value = padded(&change.eval(u).unwrap());
        slope += block.weight * dot(&block.residual, &value);
        slope += block.slope().iter().zip(way).map(|(a, b)| a * b).sum::<f64>();
        if is_distance {
            curvature += block.weight * dot(&value, &value);
        }
    }
    let mut gradient = Array2::zeros(by_coefficients.raw_dim());
    equations.add_gradient(&mut gradient);
    slope += (&gradient * by_coefficients).sum();
    let matrices = vec![SymmetricMatrix::zeros(&pattern); n * (n + 1) / 2];
    let mut blocks = BlockEquations { matrices, right: Array2::zeros(by_coefficients.raw_dim()) };
    equations.add_blocks(&mut blocks).unwrap();
    let mut matrix = SymmetricMatrix::from_blocks(&pattern.blocked(n), &blocks.matrices, n).unwrap();
    let mut right = Array2::zeros((by_coefficients.len(), 1));
    equations.add_cells(&mut matrix, &mut right);
    let flat: Vec<f64> = by_coefficients.iter().copied().collect();
    curvature += matrix.multiply(&flat).iter().zip(&flat).map(|(a, b)| a * b).sum::<f64>();
    // Minus the gradient is what all equations have on the right.
    let sum = &blocks.right + &right.into_shape_with_order(gradient.raw_dim()).unwrap() + &gradient;
    assert!(sum.iter().all(|x| x.abs() < 1e-12), "{sum}");
    (slope, curvature)
}

/// What is done with each case.
pub(crate) trait EachCase {
    fn with<const D: usize, S: ParameterBox<D>>(&mut self, case: &Case<D, S>);
}

/// Degrees 1 to 4, D = 1 and 2, N = 2 and 3; tensor-product, periodic and hierarchical spaces.
pub(crate) fn each_case(each: &mut impl EachCase) {
    for degree in 1..=4 {
        for dim in [2, 3] {
            let open = KnotVector::uniform(degree, 3).unwrap();
            let closed = KnotVector::uniform_periodic(degree, 6).unwrap();
            let name = |what: &str| format!("{what} of degree {degree} to R^{dim}");
            let line = Arc::new(TensorSpace::new([open.clone()]).unwrap());
            each.with(&Case::new(name("open line"), line, dim));
            let ring = HierarchicalSpace::new(Kind::Thb, [closed.clone()]).unwrap();
            each.with(&Case::new(name("closed line"), Arc::new(ring), dim));
            for (what, knots) in
                [("rectangle", [&open, &open]), ("tube", [&closed, &open]), ("torus", [&closed, &closed])]
            {
                let space = HierarchicalSpace::new(Kind::Thb, knots.map(Clone::clone)).unwrap();
                let refined = space.refine(&[1], &Refinement { extension: [2; 2], ..Refinement::default() }).unwrap();
                each.with(&Case::new(name(what), Arc::new(refined), dim));
            }
        }
    }
}

const QUADRATIC: Property = Property { is_quadratic: true, holds_parameters: false, is_distance: false };

#[test]
fn distances_have_the_derivatives_of_their_energy() {
    struct Each;
    impl EachCase for Each {
        fn with<const D: usize, S: ParameterBox<D>>(&mut self, case: &Case<D, S>) {
            assert!(check_term(case, &mut Data, Property { is_distance: true, ..QUADRATIC }) > 0.1);
        }
    }
    each_case(&mut Each);
}

#[test]
fn smoothing_has_the_derivatives_of_its_energy() {
    struct Each;
    impl EachCase for Each {
        fn with<const D: usize, S: ParameterBox<D>>(&mut self, case: &Case<D, S>) {
            let space = case.map.space().as_ref();
            let gram = ThinPlate::new(space.degree(), Quadrature::Exact);
            let gram = gram.gram(space, &SymmetricPattern::new(space)).unwrap();
            let steepest = check_term(case, &mut Smoothing::new(gram, 1e-5), QUADRATIC);
            assert!(steepest > 1e-4 || space.degree() == [1; D], "{steepest}");
        }
    }
    each_case(&mut Each);
}

#[test]
fn springs_have_the_derivatives_of_their_energy() {
    struct Each;
    impl EachCase for Each {
        fn with<const D: usize, S: ParameterBox<D>>(&mut self, case: &Case<D, S>) {
            let options = JointOptions { stiffness: 0.1, cohesion: 0.3, ..JointOptions::default() };
            // They have moved from where they started, and so pull.
            let before: Vec<[f64; D]> =
                case.start.iter().map(|u| case.map.space().to_domain(u.map(|x| x + 0.05 * (20.0 * x).sin()))).collect();
            let Snapshot { frames, .. } = &case.snapshot;
            let mut springs = Springs::new(&case.points, frames, before, &case.triangles, &options);
            assert!(check_term(case, &mut springs, QUADRATIC) > 1e-3);
        }
    }
    each_case(&mut Each);
}

#[test]
fn triangle_centres_have_the_derivatives_of_their_energy() {
    struct Each;
    impl EachCase for Each {
        fn with<const D: usize, S: ParameterBox<D>>(&mut self, case: &Case<D, S>) {
            if D == 2 {
                let (triangles, space) = (&case.triangles, case.map.space().as_ref());
                let centres = TriangleCentres::new(triangles, &rim(triangles), space, &case.points, 0.3).unwrap();
                let property = Property { holds_parameters: true, ..QUADRATIC };
                let steepest = check_term(case, &mut centres.unwrap(), property);
                assert!(steepest > 1e-3, "{steepest}");
            }
        }
    }
    each_case(&mut Each);
}

#[test]
fn lost_area_has_the_derivatives_of_its_energy() {
    struct Each;
    impl EachCase for Each {
        fn with<const D: usize, S: ParameterBox<D>>(&mut self, case: &Case<D, S>) {
            if D == 2 && case.map.dim() == 3 {
                let mut lost_area = LostArea::new(case.map.space().degree(), &JointOptions::default(), 0.01);
                assert!(check_term(case, &mut lost_area, Property::default()) > 0.1);
            }
        }
    }
    each_case(&mut Each);
}
