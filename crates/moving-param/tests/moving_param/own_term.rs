//! Terms and watches of the caller in the joint method.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};

use adaptive::Solve;
use fit_ls::{BlockEquations, Lambda, SortedPoints};
use moving_param::{
    Error, JointOptions, Linearization, Method, MovingFit, Options, Spring, State, Step, StepStart, StepWatch, Term,
};
use ndarray::Array2;
use thb_core::{HierarchicalSpace, Kind, KnotVector, ParameterBox, SplineMap};

/// `½ κ |s(u) − q|²`: the map should meet a place at a parameter.
#[derive(Debug)]
struct Through {
    parameter: [f64; 2],
    place: [f64; 3],
    stiffness: f64,
}

impl Through {
    fn residual<S: ParameterBox<2>>(&self, map: &SplineMap<2, S>) -> [f64; 3] {
        let value = map.eval(self.parameter).unwrap();
        std::array::from_fn(|k| value[k] - self.place[k])
    }
}

impl<S: ParameterBox<2>> Term<2, S> for Through {
    fn name(&self) -> &'static str {
        "through a place"
    }

    fn energy(&self, at: &State<'_, 2, S>) -> Result<f64, Error> {
        Ok(0.5 * self.stiffness * self.residual(at.map).iter().map(|r| r * r).sum::<f64>())
    }

    fn linearize(&self, at: &StepStart<'_, 2, S>, _: &[u32], into: &mut Linearization<'_, 2>) -> Result<(), Error> {
        let map = at.state.map;
        let (parameter, place) = (Array2::from(vec![self.parameter]), Array2::from(vec![self.place]));
        let mut sample = SortedPoints::new(parameter.view(), place.view(), None)?;
        sample.sort(map.space().as_ref(), |_| None)?;
        let weights: Vec<Vec<f64>> = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0].map(|w| vec![w * self.stiffness]).to_vec();
        let right: Vec<Vec<f64>> = self.residual(map).map(|r| vec![-self.stiffness * r]).to_vec();
        let equations = BlockEquations::new(map.space().as_ref(), into.pattern, &sample, &weights, &right)?;
        into.coefficients.add_blocks(equations);
        Ok(())
    }
}

/// `½ (u_i − a)ᵀ diag(k) (u_i − a)` for one point i of weight 1.
#[derive(Debug)]
struct Hold {
    index: usize,
    spring: Spring<2>,
}

impl<S: ParameterBox<2>> Term<2, S> for Hold {
    fn name(&self) -> &'static str {
        "held point"
    }

    fn energy(&self, at: &State<'_, 2, S>) -> Result<f64, Error> {
        Ok(0.5 * self.spring.squared(at.map.space().as_ref(), at.parameters[at.places[self.index]]))
    }

    fn linearize(&self, at: &StepStart<'_, 2, S>, _: &[u32], into: &mut Linearization<'_, 2>) -> Result<(), Error> {
        let place = at.state.places[self.index];
        into.points[place].add_spring(&self.spring, at.state.map.space().as_ref(), at.state.parameters[place]);
        Ok(())
    }
}

/// Keeps all steps, and breaks at one.
#[derive(Debug)]
struct Steps {
    all: Arc<Mutex<Vec<Step>>>,
    last: usize,
}

impl StepWatch for Steps {
    fn stepped(&mut self, step: &Step) -> ControlFlow<()> {
        self.all.lock().unwrap().push(*step);
        if step.number == self.last { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

const PER_SIDE: usize = 20;

/// A bumpy sheet over the unit square, whose parameters are off.
fn sheet() -> (Array2<f64>, Array2<f64>) {
    let along = |i: usize| (i as f64 + 0.5) / PER_SIDE as f64;
    let uv = |i: usize| [along(i % PER_SIDE), along(i / PER_SIDE)];
    let off = |u: f64| u + 0.02 * (9.0 * u).sin();
    let parameters = Array2::from_shape_fn((PER_SIDE * PER_SIDE, 2), |(i, d)| off(uv(i)[d]));
    let points = Array2::from_shape_fn((PER_SIDE * PER_SIDE, 3), |(i, k)| {
        let [u, v] = uv(i);
        [u, v, 0.1 * (6.0 * u).sin() * (5.0 * v).cos()][k]
    });
    (parameters, points)
}

fn fit(configure: impl FnOnce(MovingFit<2>) -> MovingFit<2>) -> (SplineMap<2>, MovingFit<2>) {
    let (parameters, points) = sheet();
    let knots = KnotVector::uniform(3, 4).unwrap();
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    let fitting = fit_ls::Options { lambda: Lambda::Fixed(1e-9), ..fit_ls::Options::default() };
    let joint = JointOptions { max_steps: 20, decrease: 1e-4, ..JointOptions::WITHOUT_SPRINGS };
    let options = Options { method: Method::Joint(joint), tolerance: 1e-5, guard: false, ..Options::default() };
    let mut method = configure(MovingFit::new(parameters.view(), points.view(), None, fitting, options).unwrap());
    let map = method.solve(&space, None).unwrap().map;
    (map, method)
}

#[test]
fn a_term_of_the_caller_takes_part_in_the_fit() {
    let through = || Through { parameter: [0.5, 0.5], place: [0.5, 0.5, 0.05], stiffness: 1e3 };
    let off = |map: &SplineMap<2>| through().residual(map).map(f64::abs).into_iter().fold(0.0, f64::max);
    let (plain, _) = fit(|method| method);
    let (held, mut method) = fit(|method| method.with_term(Box::new(through())));
    assert!(off(&plain) > 0.05 && off(&held) < 0.01, "{} and {}", off(&plain), off(&held));
    // Most points still say where the surface is.
    let mut distances = method.estimate(&held).unwrap().errors.to_vec();
    distances.sort_by(f64::total_cmp);
    assert!(distances[distances.len() / 2] < 0.01, "{}", distances[distances.len() / 2]);
}

#[test]
fn a_spring_of_the_caller_holds_a_parameter() {
    let index = PER_SIDE * PER_SIDE / 2 + PER_SIDE / 2;
    let from = [0, 1].map(|d| sheet().0[[index, d]]);
    let at = from.map(|u| u + 0.05);
    let away = |stiffness: f64| {
        let spring = Spring { at, stiffness: [stiffness; 2] };
        let (_, method) = fit(|method| method.with_term(Box::new(Hold { index, spring })));
        let reached = method.parameters();
        (0..2).map(|d| (reached[[index, d]] - at[d]).abs()).fold(0.0, f64::max)
    };
    let (free, held) = (away(0.0), away(1e3));
    assert!(free > 0.02 && held < 1e-2, "{free} and {held}");
}

#[test]
fn a_watch_is_told_of_each_step_and_may_end_them() {
    let run = |last: usize| {
        let all = Arc::new(Mutex::new(Vec::new()));
        let watch = Steps { all: all.clone(), last };
        let (_, method) = fit(|method| method.with_watch(Box::new(watch)));
        let steps = all.lock().unwrap().clone();
        assert_eq!(steps.len(), method.reports()[0].corrections);
        steps
    };
    let all = run(0);
    assert!(all.len() > 2 && all.iter().all(|step| step.after < step.before), "{all:?}");
    let first = run(1);
    assert_eq!(first[0], all[0]);
    assert!(first.len() < all.len(), "{first:?}");
}
