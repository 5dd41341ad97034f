//! Foot points and coefficients in turn: A-PDM, A-TDM, A-HDM (Imperatore 2024, §5.1.2).

use fit_ls::{Cholesky, Fixed, NormalEquations, SortedPoints, eliminate};
use ndarray::{Array1, Array2};
use thb_core::{CellSpace, HierarchicalSpace, SplineMap};

use crate::damping::{Damping, DampingRule};
use crate::equations::Equations;
use crate::moving::{Moves, MovingFit};
use crate::state::{Snapshot, State, StepStart};
use crate::step_system::solve;
use crate::term::{Objective, Term};
use crate::terms::data::Data;
use crate::terms::smoothing::Smoothing;
use crate::{Blend, Distance, Error};

/// The damping of steps of the coefficients, relative to the mean diagonal entry of the matrix: as asked for, and more only where the
/// equations of tangent distances are singular. Limit: beyond the mean entry nothing else is left of the matrix.
const RIDGE: DampingRule = DampingRule { first: 0.0, least: 1e-9, most: 1.0, accept: 1.0, refuse: 100.0, pause: 0 };

impl<const D: usize> MovingFit<D> {
    pub(crate) fn alternate(
        &mut self,
        mut map: SplineMap<D>,
        distance: &Distance,
        corrections: usize,
        moves: &mut Moves,
    ) -> Result<SplineMap<D>, Error> {
        for _ in 0..corrections {
            self.correct(&map, moves)?;
            map = match distance {
                Distance::Point => self.fit.fit(map.space())?,
                Distance::Tangent { damping } => self.tangent_step(&map, None, *damping)?,
                Distance::Hybrid(blend) => self.tangent_step(&map, Some(blend), 0.0)?,
            };
        }
        if corrections > 0 && *distance != Distance::Point {
            // Steps of tangent distances leave errors along the surface, which no refinement should follow.
            self.correct(&map, moves)?;
        }
        Ok(map)
    }

    /// The map whose coefficients minimize tangent distances, or a blend of them with point distances, near the given map. The
    /// boundary is fitted first, on its own (Remark 25).
    fn tangent_step(&mut self, map: &SplineMap<D>, blend: Option<&Blend>, damping: f64) -> Result<SplineMap<D>, Error> {
        let space = map.space().clone();
        let constraints = self.constraints();
        let mut system = self.take_system(&space)?;
        let mut smoothing = self.smoothing(&space)?;
        let points = self.fit.points();
        let weights = points.as_given(points.weights().unwrap_or(&vec![1.0; points.len()]));
        let snapshot = Snapshot::new(map, points, |index| weights[index])?;
        let start = snapshot.start(map, points);
        let mut gamma = gammas(&start.state, blend);
        let is_held = |at: usize| constraints.is_held(points.order()[at] as usize);
        let held: Vec<usize> = (0..points.len()).filter(|&at| is_held(at)).collect();
        let boundary = boundary_functions(&space);
        let fixed = if held.is_empty() { None } else { boundary_step(&start, &held, &smoothing, &boundary)? };
        let mut equations = Equations::new(system.pattern().clone());
        let mut data = Data;
        let terms: Vec<&mut dyn Term<D>> = vec![&mut data, &mut smoothing];
        Objective::new(terms).freeze(&start, &mut equations)?;
        for &at in &held {
            gamma[at] = 1.0;
            // Without equations of its own the boundary is fitted together with the rest, by point distances.
            if fixed.is_some() {
                equations.points[at].weight = 0.0;
            }
        }
        let given = fixed.unwrap_or_default();
        // The matrix of point distances has the sum of the weights of a function's points on its diagonal.
        let scale = points.total_weight() / boundary.len() as f64;
        let mut ridge = Damping::new(DampingRule { first: damping, ..RIDGE });
        let reduced = equations.reduced(space.as_ref(), points, &constraints, 0.0, &gamma)?;
        loop {
            if let Some(step) = system.step(&reduced, ridge.value() * scale, &given, |_, _| ())? {
                let stepped = SplineMap::new(space.clone(), &map.coefficients() + &step)?;
                self.system = Some((space, system));
                return Ok(stepped);
            }
            if !ridge.refused() {
                tracing::warn!("tangent distances do not determine the coefficients: point distances instead");
                return Ok(self.fit.fit(&space)?);
            }
        }
    }
}

/// The step of the boundary's coefficients that fits the points of the boundary in the sense of point distances
/// (Imperatore 2024, Remark 25), all others held. `None` if the points do not determine it.
fn boundary_step<const D: usize>(
    start: &StepStart<'_, D>,
    held_points: &[usize],
    smoothing: &Smoothing,
    boundary: &[bool],
) -> Result<Option<Fixed>, Error> {
    let State { map, points, parameters, .. } = start.state;
    let (count, gram) = (held_points.len(), smoothing.gram());
    let targets = Array2::from_shape_fn((count, map.dim()), |(i, k)| -start.frames[held_points[i]].residual[k]);
    let parameters = Array2::from_shape_fn((count, D), |(i, d)| parameters[held_points[i]][d]);
    let weights: Option<Array1<f64>> = points.weights().map(|w| held_points.iter().map(|&at| w[at]).collect());
    let weights = weights.as_ref().map(|w| w.view());
    let mut residuals = SortedPoints::new(parameters.view(), targets.view(), weights)?;
    residuals.sort_refined(map.space(), None)?;
    let NormalEquations { mut matrix, mut right } =
        NormalEquations::new(map.space().as_ref(), gram.pattern(), &residuals)?;
    matrix.values_mut().iter_mut().zip(gram.values()).for_each(|(x, g)| *x += smoothing.lambda() * g);
    right -= &smoothing.gradient(map.coefficients());
    let held: Fixed = (0..boundary.len()).filter(|&j| !boundary[j]).map(|j| (j, vec![0.0; right.ncols()])).collect();
    eliminate(&mut matrix, &mut right, &held)?;
    let mut solver =
        Cholesky::new(matrix.pattern()).map_err(|_| fit_ls::Error::OutOfMemory { functions: boundary.len() })?;
    let Some(step) = solve(&mut solver, &matrix, &right, boundary.len())? else { return Ok(None) };
    Ok(Some((0..boundary.len()).filter(|&j| boundary[j]).map(|j| (j, step.row(j).to_vec())).collect()))
}

/// Which functions do not vanish on the boundary of the domain; a seam is none.
fn boundary_functions<const D: usize>(space: &HierarchicalSpace<D>) -> Vec<bool> {
    let mut boundary = vec![false; space.n_functions()];
    let periodic = space.periodic();
    for level in 0..space.n_levels() {
        let counts = space.function_counts(level);
        let first = space.first_of_level(level);
        for (k, &index) in space.active_functions(level).iter().enumerate() {
            let mut rest = index as usize;
            for (count, periodic) in counts.into_iter().zip(periodic) {
                let i = rest % count;
                boundary[first + k] |= !periodic && (i == 0 || i + 1 == count);
                rest /= count;
            }
        }
    }
    boundary
}

/// The weights γ of the point distance, in the order of the sorted points. Points of weight 0 are left out of the largest distance.
fn gammas<const D: usize>(at: &State<'_, D>, blend: Option<&Blend>) -> Vec<f64> {
    let distances = || at.distances.iter().copied();
    match blend {
        None => vec![0.0; at.distances.len()],
        Some(Blend::Constant(gamma)) => vec![*gamma; at.distances.len()],
        Some(Blend::ErrorDriven) => {
            let counted = distances().enumerate().filter(|&(place, _)| at.counts(place));
            let largest = counted.map(|(_, d)| d).fold(f64::MIN_POSITIVE, f64::max);
            distances().map(|d| (d / (2.0 * largest)).min(0.5)).collect()
        }
        Some(Blend::CurvatureDriven(curvatures)) => distances()
            .zip(at.points.order())
            // d / (d + 1/κ), written so that flat points have γ = 0.
            .map(|(d, &index)| d * curvatures[index as usize].abs() / (d * curvatures[index as usize].abs() + 1.0))
            .collect(),
    }
}
