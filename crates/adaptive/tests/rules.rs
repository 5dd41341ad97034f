//! The loop with a method whose errors are known.

use std::ops::ControlFlow;
use std::sync::Arc;

use adaptive::{Deviation, Estimate, Iteration, Marking, Missed, Options, Outcome, Solution, Solve, Stop, run};
use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, Mark, Refinement, SplineMap};

/// The only error of [`Prescribed`].
#[derive(Debug, PartialEq)]
struct Refused;

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("refused")
    }
}

impl std::error::Error for Refused {}

/// A method that fits nothing: one point in the middle of each cell of a fine grid, whose error is a function of the point
/// and of the size of its cell.
struct Prescribed<E> {
    error: E,
    /// Number of solves that succeed.
    patience: usize,
    /// Whether the result before was handed over, solve by solve.
    handed_over: Vec<bool>,
    offsets: Vec<usize>,
    errors: Vec<f64>,
    /// What it misses once its points are near enough, the last one first.
    missed: Vec<Missed>,
    /// How often it has changed where the loop would end.
    again: usize,
}

/// Points per direction.
const GRID: usize = 32;

impl<E: Fn([f64; 2], f64) -> f64> Prescribed<E> {
    fn new(error: E) -> Self {
        let (offsets, errors, missed) = (Vec::new(), Vec::new(), Vec::new());
        Self { error, patience: usize::MAX, handed_over: Vec::new(), offsets, errors, missed, again: 0 }
    }
}

impl<E: Fn([f64; 2], f64) -> f64> Solve<2> for Prescribed<E> {
    type Error = Refused;

    fn solve(
        &mut self,
        space: &Arc<HierarchicalSpace<2>>,
        previous: Option<&SplineMap<2>>,
    ) -> Result<Solution<2>, Refused> {
        if self.handed_over.len() >= self.patience {
            return Err(Refused);
        }
        self.handed_over.push(previous.is_some());
        let map = SplineMap::new(space.clone(), Array2::zeros((space.n_functions(), 1))).map_err(|_| Refused)?;
        Ok(Solution { map, assemble_seconds: 0.0, solve_seconds: 0.0 })
    }

    fn estimate(&mut self, map: &SplineMap<2>) -> Result<Estimate<'_>, Refused> {
        let space = map.space();
        let mut of_cells = vec![Vec::new(); space.n_cells()];
        for k in 0..GRID * GRID {
            let u = [k % GRID, k / GRID].map(|i| (i as f64 + 0.5) / GRID as f64);
            let cell = space.locate_cell(u).map_err(|_| Refused)?;
            of_cells[cell].push((self.error)(u, space.cell(cell).size()[0]));
        }
        self.offsets = std::iter::once(0)
            .chain(of_cells.iter().scan(0, |sum, c| {
                *sum += c.len();
                Some(*sum)
            }))
            .collect();
        self.errors = of_cells.concat();
        Ok(Estimate { offsets: &self.offsets, errors: &self.errors, children: &[] })
    }

    fn missed(&mut self, _map: &SplineMap<2>) -> Result<Missed, Refused> {
        Ok(self.missed.pop().unwrap_or(Missed::Nothing))
    }

    fn is_to_solve_again(&mut self, _map: &SplineMap<2>) -> Result<bool, Refused> {
        let again = self.again > 0;
        self.again -= usize::from(again);
        Ok(again)
    }
}

fn start() -> Arc<HierarchicalSpace<2>> {
    let knots = KnotVector::uniform(2, 4).unwrap();
    Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap())
}

fn go<E: Fn([f64; 2], f64) -> f64>(method: &mut Prescribed<E>, options: &Options<2>) -> Outcome<2, Refused> {
    run(method, start(), options, &mut |_: &Iteration| ControlFlow::Continue(())).unwrap()
}

fn levels(max_levels: usize) -> Refinement<2> {
    Refinement { extension: [0; 2], admissible: None, max_levels }
}

#[test]
fn the_loop_ends_when_enough_points_are_within_the_tolerance() {
    // Errors fall with the size of the cells, 1/4 at first: within 1/32 after three refinements.
    let options = Options { tolerance: 1.0 / 32.0, within: 1.0, refinement: levels(9), ..Options::default() };
    let mut method = Prescribed::new(|_, size| size);
    let outcome = go(&mut method, &options);
    assert_eq!(outcome.stop, Stop::ToleranceReached);
    assert_eq!(outcome.history.iter().map(|i| i.levels).collect::<Vec<_>>(), [1, 2, 3, 4]);
    assert_eq!(outcome.history.iter().map(|i| i.iteration).collect::<Vec<_>>(), [0, 1, 2, 3]);
    let last = outcome.history[3];
    assert_eq!((last.dofs, last.cells), (outcome.map.space().n_functions(), outcome.map.space().n_cells()));
    assert_eq!(last.deviation, Deviation { points: 1024, max: 1.0 / 32.0, mse: 1.0 / 1024.0, within: 1.0 });
    assert_eq!(method.handed_over, [false, true, true, true]);
    // A quarter of the points is good from the beginning.
    let options = Options { within: 0.25, ..options };
    let outcome = go(&mut Prescribed::new(|u, _| if u[0] < 0.25 { 0.0 } else { 1.0 }), &options);
    assert_eq!((outcome.stop, outcome.history.len()), (Stop::ToleranceReached, 1));
}

#[test]
fn cells_are_refined_where_errors_are_large_and_nowhere_else() {
    let options = Options { tolerance: 0.1, within: 1.0, refinement: levels(4), ..Options::default() };
    let in_corner = |u: [f64; 2]| u[0] < 0.25 && u[1] < 0.25;
    let outcome = go(&mut Prescribed::new(move |u, _| if in_corner(u) { 1.0 } else { 0.0 }), &options);
    assert_eq!(outcome.stop, Stop::Levels);
    let space = outcome.map.space();
    assert_eq!(space.n_levels(), 4);
    // The corner is one cell of level 0; it is split to level 3, the other 15 cells are whole.
    assert_eq!(space.n_cells(), 15 + 64);
    // The extension takes the cells around with it.
    let refinement = Refinement { extension: [2, 0], ..levels(2) };
    let outcome =
        go(&mut Prescribed::new(move |u, _| if in_corner(u) { 1.0 } else { 0.0 }), &Options { refinement, ..options });
    assert_eq!(outcome.map.space().n_cells(), 14 + 2 * 4);
}

#[test]
fn the_share_marks_the_worst() {
    // Errors grow along u; the worst eighth of the points lies in the last half column of cells.
    let options = Options {
        tolerance: 0.0,
        within: 1.0,
        marking: Marking::Share(0.125),
        refinement: levels(2),
        max_iterations: 2,
        ..Options::default()
    };
    let outcome = go(&mut Prescribed::new(|u, _| u[0]), &options);
    assert_eq!(outcome.map.space().n_cells(), 12 + 4 * 4);
}

#[test]
fn the_limit_on_functions_is_kept_and_used_for_the_worst_cells() {
    // Errors 1 in one corner, 0.5 elsewhere.
    let corner = |u: [f64; 2]| if u[0] > 0.75 && u[1] > 0.75 { 1.0 } else { 0.5 };
    let everything = go(
        &mut Prescribed::new(move |u, _| corner(u)),
        &Options { tolerance: 0.1, within: 1.0, refinement: levels(2), ..Options::default() },
    );
    let all = everything.map.space().n_functions();
    let refinement = Refinement { extension: [2; 2], ..levels(2) };
    for max_dofs in 36..all + 3 {
        let options = Options { tolerance: 0.1, within: 1.0, max_dofs, refinement, ..Options::default() };
        let outcome = go(&mut Prescribed::new(move |u, _| corner(u)), &options);
        let space = outcome.map.space();
        assert!(space.n_functions() <= max_dofs, "{} functions of {max_dofs}", space.n_functions());
        let expected = if space.n_functions() == all { Stop::Levels } else { Stop::Dofs };
        assert_eq!(outcome.stop, expected, "{max_dofs}");
        // The worst cell comes first.
        let worst = space.locate_cell([0.9, 0.9]).unwrap();
        assert!(space.n_levels() == 1 || space.cell(worst).size()[0] == 0.125, "{max_dofs}");
    }
}

#[test]
fn errors_that_do_not_fall_are_stagnation() {
    let options = Options { tolerance: 0.1, within: 1.0, refinement: levels(12), ..Options::default() };
    // One point keeps its error whatever is refined around it.
    let stubborn = |u: [f64; 2], _: f64| if u[0] < 0.02 && u[1] < 0.02 { 1.0 } else { 0.0 };
    let outcome = go(&mut Prescribed::new(stubborn), &options);
    assert_eq!(outcome.stop, Stop::Stagnation);
    assert!(outcome.history.len() < 12);
    // A slow but steady fall is none.
    let slow = |u: [f64; 2], size: f64| stubborn(u, size) * size.powf(0.05);
    assert_eq!(go(&mut Prescribed::new(slow), &options).stop, Stop::Levels);
}

#[test]
fn the_other_ends() {
    let options = Options { tolerance: 1e-9, within: 1.0, refinement: levels(4), ..Options::default() };
    let outcome = go(&mut Prescribed::new(|_, size| size), &Options { max_iterations: 2, ..options });
    assert_eq!((outcome.stop, outcome.history.len()), (Stop::Iterations, 2));
    assert_eq!(go(&mut Prescribed::new(|_, size| size), &options).stop, Stop::Levels);

    let mut seen = Vec::new();
    let mut twice = |record: &Iteration| {
        seen.push(record.iteration);
        if record.iteration == 1 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let outcome = run(&mut Prescribed::new(|_, size| size), start(), &options, &mut twice).unwrap();
    assert_eq!((outcome.stop, outcome.history.len()), (Stop::Interrupted, 2));
    assert_eq!(seen, [0, 1]);

    // A method that fails later keeps what was reached; at the first solve there is nothing to keep.
    let mut failing = Prescribed { patience: 2, ..Prescribed::new(|_, size| size) };
    let outcome = go(&mut failing, &options);
    assert_eq!((outcome.stop, outcome.failure, outcome.history.len()), (Stop::Failed, Some(Refused), 2));
    assert_eq!(outcome.map.space().n_levels(), 2);
    let mut failing = Prescribed { patience: 0, ..Prescribed::new(|_, size| size) };
    let error = run(&mut failing, start(), &options, &mut |_: &Iteration| ControlFlow::Continue(())).unwrap_err();
    assert_eq!(error, Refused);
}

#[test]
fn what_a_method_misses_is_done_although_all_points_are_near() {
    let knots = KnotVector::uniform(2, 2).unwrap();
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    let mut method = Prescribed::new(|_, _| 0.0);
    // Solved again on the same space, then refined in one cell, then done.
    method.missed = vec![Missed::Places(vec![Mark::whole(0)]), Missed::Again];
    let mut all = |_: &Iteration| ControlFlow::Continue(());
    let found = run(&mut method, space.clone(), &Options::default(), &mut all).unwrap();
    let dofs: Vec<usize> = found.history.iter().map(|iteration| iteration.dofs).collect();
    assert_eq!((dofs.len(), found.stop), (3, Stop::ToleranceReached));
    assert_eq!([dofs[0], dofs[1]], [space.n_functions(); 2]);
    assert!(dofs[2] > dofs[1]);
    assert_eq!(method.handed_over, [false, true, true]);
    // Without a place nothing can be refined.
    let mut method = Prescribed::new(|_, _| 0.0);
    method.missed = vec![Missed::Places(Vec::new())];
    assert_eq!(run(&mut method, space, &Options::default(), &mut all).unwrap().stop, Stop::Data);
}

#[test]
fn a_method_may_go_on_where_refinement_does_not() {
    // Two levels are allowed, and every error asks for a third; the method has changed twice by then.
    let options = Options { tolerance: 1e-9, refinement: levels(2), ..Options::default() };
    let mut method = Prescribed { again: 2, ..Prescribed::new(|_, size| size) };
    let outcome = go(&mut method, &options);
    assert_eq!(outcome.stop, Stop::Levels);
    let dofs: Vec<usize> = outcome.history.iter().map(|iteration| iteration.dofs).collect();
    assert!(dofs.len() == 4 && dofs[0] < dofs[1] && dofs[1..] == [dofs[1]; 3], "{dofs:?}");
    // What the loop was told to do it does: the tolerance is reached, or it was interrupted.
    let mut method = Prescribed { again: 1, ..Prescribed::new(|_, _| 0.0) };
    assert_eq!((go(&mut method, &options).stop, method.again), (Stop::ToleranceReached, 1));
    let mut method = Prescribed { again: 1, ..Prescribed::new(|_, size| size) };
    let outcome = run(&mut method, start(), &options, &mut |_: &Iteration| ControlFlow::Break(())).unwrap();
    assert_eq!((outcome.stop, method.again), (Stop::Interrupted, 1));
}
