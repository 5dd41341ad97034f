//! The damped Gauss–Newton equations of a step, and the elimination of the parameters from them.

use std::sync::Arc;

use fit_ls::{BlockEquations, SortedPoints};
use ndarray::Array2;
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use thb_core::{ParameterBox, SmallCholesky, SymmetricMatrix, SymmetricPattern};

use crate::Error;
use crate::points::constraint::Constraints;
use crate::points::vector::{Vector, dot};

/// Damping that keeps parallel tangents apart. Limit: below it the 2 × 2 matrix of parallel tangents is positive definite or not by
/// round-off.
const LEAST_DAMPING: f64 = 1e-12;

/// Points of one parallel task.
const CHUNK: usize = 512;

/// `½ k (u − a)²` in each direction: what pulls a parameter to a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring<const D: usize> {
    /// `a`.
    pub at: [f64; D],
    /// `k`, by direction.
    pub stiffness: [f64; D],
}

impl<const D: usize> Spring<D> {
    /// None at all.
    pub const NONE: Self = Self { at: [0.0; D], stiffness: [0.0; D] };

    /// `k (u − a)`, the gradient.
    pub fn pull(&self, space: &impl ParameterBox<D>, u: [f64; D]) -> [f64; D] {
        let way = space.way(self.at, u);
        std::array::from_fn(|d| self.stiffness[d] * way[d])
    }

    /// `(u − a)ᵀ diag(k) (u − a)`.
    pub fn squared(&self, space: &impl ParameterBox<D>, u: [f64; D]) -> f64 {
        let way = space.way(self.at, u);
        (0..D).map(|d| self.stiffness[d] * way[d] * way[d]).sum()
    }

    /// The spring that does what two do, but for a constant.
    fn with(&self, other: &Self, space: &impl ParameterBox<D>) -> Self {
        let stiffness: [f64; D] = std::array::from_fn(|d| self.stiffness[d] + other.stiffness[d]);
        if self.stiffness == [0.0; D] {
            return *other;
        }
        let way = space.way(self.at, other.at);
        let share = |d: usize| if other.stiffness[d] > 0.0 { other.stiffness[d] / stiffness[d] } else { 0.0 };
        Self { at: space.to_domain(std::array::from_fn(|d| self.at[d] + share(d) * way[d])), stiffness }
    }
}

/// What a step knows of one point: `ω (½ |r + v + T δu|² + ½ (u + δu − a)ᵀ diag(k) (u + δu − a))`, where `v` is what the step of
/// the coefficients adds to the map at the point, and `δu` the move of its parameter.
#[derive(Clone, Copy, Debug)]
pub struct PointBlock<const D: usize> {
    /// ω.
    pub(crate) weight: f64,
    /// r.
    pub(crate) residual: Vector,
    /// The columns of T.
    pub(crate) tangents: [Vector; D],
    pub(crate) spring: Spring<D>,
    /// The gradient of the spring at the start.
    pub(crate) pull: [f64; D],
}

impl<const D: usize> PointBlock<D> {
    const NONE: Self =
        Self { weight: 0.0, residual: [0.0; 4], tangents: [[0.0; 4]; D], spring: Spring::NONE, pull: [0.0; D] };

    /// Hangs the parameter, which is `u`, on a further spring. Like distances it counts ω times.
    pub fn add_spring(&mut self, spring: &Spring<D>, space: &impl ParameterBox<D>, u: [f64; D]) {
        self.spring = self.spring.with(spring, space);
        self.pull = self.spring.pull(space, u);
    }

    /// `TᵀT`.
    #[inline(always)]
    pub(crate) fn metric(&self) -> [[f64; D]; D] {
        std::array::from_fn(|a| std::array::from_fn(|b| dot(&self.tangents[a], &self.tangents[b])))
    }

    /// The derivative by the parameter.
    pub(crate) fn slope(&self) -> [f64; D] {
        std::array::from_fn(|d| self.weight * (dot(&self.tangents[d], &self.residual) + self.pull[d]))
    }

    /// The move of the parameter that minimizes `½|residual + T δu|² + ½ μ δuᵀ diag(TᵀT) δu` and the energy of the spring
    /// in the free directions. Zero where the tangents are degenerate.
    #[inline(always)]
    pub(crate) fn parameter_step(&self, residual: &Vector, damping: f64, free: [bool; D]) -> [f64; D] {
        self.step_against(residual, &self.pull, damping, free)
    }

    /// The same with another gradient of the spring.
    #[inline(always)]
    pub(crate) fn step_against(&self, residual: &Vector, pull: &[f64; D], damping: f64, free: [bool; D]) -> [f64; D] {
        self.elimination(damping, free).map_or([0.0; D], |factor| self.step_by(&factor, residual, pull))
    }

    /// What moves of the parameter are solved with; `None` where the tangents are degenerate.
    #[inline(always)]
    fn elimination(&self, damping: f64, free: [bool; D]) -> Option<SmallCholesky<D>> {
        let metric = self.metric();
        let mut matrix = metric;
        (0..D).for_each(|a| matrix[a][a] += self.spring.stiffness[a]);
        let added = std::array::from_fn(|a| damping.max(LEAST_DAMPING) * metric[a][a]);
        SmallCholesky::new(&matrix, &added, free)
    }

    #[inline(always)]
    fn step_by(&self, factor: &SmallCholesky<D>, residual: &Vector, pull: &[f64; D]) -> [f64; D] {
        factor.step(&std::array::from_fn(|a| dot(&self.tangents[a], residual) + pull[a]))
    }

    /// `W v + w` for `W = I − T (TᵀT + μ diag(TᵀT) + K)⁻¹ Tᵀ`, where `w` is the move that the force of the spring makes:
    /// what is left of a vector when the parameter has moved. `μ = 0` leaves the part normal to the map, large `μ` the
    /// vector itself.
    #[inline(always)]
    fn reduced(&self, v: &Vector, pull: &[f64; D], elimination: Option<&SmallCholesky<D>>) -> Vector {
        let Some(factor) = elimination else { return *v };
        let step = self.step_by(factor, v, pull);
        let mut rest = *v;
        for a in 0..D {
            (0..4).for_each(|k| rest[k] += step[a] * self.tangents[a][k]);
        }
        rest
    }

    /// The upper triangle of `ω (γ I + (1 − γ) W)`, row by row, and what it makes of the residual.
    #[inline(always)]
    fn eliminated(&self, dim: usize, damping: f64, point_share: f64, free: [bool; D]) -> ([f64; 6], Vector) {
        let elimination = if point_share == 1.0 { None } else { self.elimination(damping, free) };
        let blend = |v: &Vector, pull: &[f64; D]| -> Vector {
            if point_share == 1.0 {
                return v.map(|x| self.weight * x);
            }
            let reduced = self.reduced(v, pull, elimination.as_ref());
            std::array::from_fn(|k| self.weight * (point_share * v[k] + (1.0 - point_share) * reduced[k]))
        };
        let mut entries = [0.0; 6];
        let mut next = 0;
        for a in 0..dim {
            let mut unit = [0.0; 4];
            unit[a] = 1.0;
            let column = blend(&unit, &[0.0; D]);
            for b in a..dim {
                entries[next] = column[b];
                next += 1;
            }
        }
        (entries, blend(&self.residual, &self.pull))
    }
}

/// The elimination of the parameters of a range of points.
struct Elimination<'a, const D: usize> {
    blocks: &'a [PointBlock<D>],
    points: &'a SortedPoints<D>,
    constraints: &'a Constraints<D>,
    damping: f64,
    point_share: &'a [f64],
    first: usize,
    /// The weights, pair by pair of coordinates, then the right-hand sides: of these points.
    columns: Vec<&'a mut [f64]>,
}

impl<const D: usize> WithSimd for Elimination<'_, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { blocks, points, constraints, damping, point_share, first, mut columns } = self;
        let dim = points.dim();
        let (weights, right) = columns.split_at_mut(dim * (dim + 1) / 2);
        for i in 0..right.first().map_or(0, |column| column.len()) {
            let at = first + i;
            let free = constraints.free(points.order()[at] as usize);
            let share = point_share.get(at).copied().unwrap_or(0.0);
            let (entries, residual) = blocks[at].eliminated(dim, damping, share, free);
            weights.iter_mut().zip(entries).for_each(|(column, x)| column[i] = x);
            right.iter_mut().zip(residual).for_each(|(column, x)| column[i] = -x);
        }
    }
}

/// One contribution to the equations `H δc = g` of the coefficients: to minus the gradient g, and to the Gauss–Newton matrix H.
#[derive(Debug)]
enum Contribution {
    /// `H = λ G` for each coordinate alike.
    Uniform { factor: f64, matrix: Arc<SymmetricMatrix>, right: Array2<f64> },
    /// `H = Σ B Bᵀ ⊗ W`.
    Blocks(BlockEquations),
    /// The lower triangle of a dense matrix of some unknowns, row-major.
    Cell { unknowns: Vec<u32>, matrix: Vec<f64>, right: Vec<f64> },
}

/// What one term adds to the equations of the coefficients, in the order in which it was added.
#[derive(Debug, Default)]
pub struct CoefficientBlocks {
    contributions: Vec<Contribution>,
    /// The penalties that were active; `None` before the term is linearized.
    active: Option<Vec<u32>>,
}

impl CoefficientBlocks {
    /// Adds `factor · matrix` for each coordinate, in the pattern of the space, and minus a gradient, `(n_functions, N)`.
    pub fn add_uniform(&mut self, factor: f64, matrix: Arc<SymmetricMatrix>, right: Array2<f64>) {
        self.contributions.push(Contribution::Uniform { factor, matrix, right });
    }

    /// Adds the equations of further points.
    pub fn add_blocks(&mut self, equations: BlockEquations) {
        self.contributions.push(Contribution::Blocks(equations));
    }

    /// Adds a dense matrix of some unknowns, increasing, all functions of one cell: coordinate `k` of function `j` is unknown `j N + k`. Of
    /// the matrix, row-major, the lower triangle counts.
    pub fn add_cell(&mut self, unknowns: Vec<u32>, matrix: Vec<f64>, right: Vec<f64>) {
        self.contributions.push(Contribution::Cell { unknowns, matrix, right });
    }

    /// Adds the contributions that have the same matrix for all pairs of functions of a pair of coordinates.
    fn add_to(&self, equations: &mut BlockEquations) -> Result<(), Error> {
        let dim = equations.right.ncols();
        for contribution in &self.contributions {
            match contribution {
                Contribution::Uniform { factor, matrix, right } => {
                    equations.right += right;
                    let mut diagonal = 0;
                    for a in 0..dim {
                        let values = equations.matrices[diagonal].values_mut();
                        values.iter_mut().zip(matrix.values()).for_each(|(x, g)| *x += factor * g);
                        diagonal += dim - a;
                    }
                }
                Contribution::Blocks(further) => equations.merge(further)?,
                Contribution::Cell { .. } => (),
            }
        }
        Ok(())
    }

    /// Subtracts what is minus the gradient.
    fn add_gradient(&self, gradient: &mut Array2<f64>) {
        let dim = gradient.ncols();
        for contribution in &self.contributions {
            match contribution {
                Contribution::Uniform { right, .. } | Contribution::Blocks(BlockEquations { right, .. }) => {
                    *gradient -= right;
                }
                Contribution::Cell { unknowns, right, .. } => {
                    for (&unknown, x) in unknowns.iter().zip(right) {
                        gradient[[unknown as usize / dim, unknown as usize % dim]] -= x;
                    }
                }
            }
        }
    }
}

/// Where a term adds its equations.
#[derive(Debug)]
pub struct Linearization<'a, const D: usize> {
    /// The pattern of the equations of one coordinate.
    pub pattern: &'a SymmetricPattern,
    /// The points, in their order.
    pub points: &'a mut [PointBlock<D>],
    /// What the term adds to the equations of the coefficients.
    pub coefficients: &'a mut CoefficientBlocks,
}

/// The equations of a step: those of each point, and what terms add to those of the coefficients.
#[derive(Debug)]
pub(crate) struct Equations<const D: usize> {
    pattern: SymmetricPattern,
    pub(crate) points: Vec<PointBlock<D>>,
    coefficients: Vec<CoefficientBlocks>,
}

impl<const D: usize> Equations<D> {
    /// None yet, for maps in a space of some pattern.
    pub(crate) fn new(pattern: SymmetricPattern) -> Self {
        Self { pattern, points: Vec::new(), coefficients: Vec::new() }
    }

    /// Empties them, for points of some weights and a number of terms.
    pub(crate) fn clear(&mut self, weights: &[f64], terms: usize) {
        self.points.clear();
        self.points.extend(weights.iter().map(|&weight| PointBlock { weight, ..PointBlock::NONE }));
        self.coefficients.clear();
        self.coefficients.resize_with(terms, CoefficientBlocks::default);
    }

    /// Where a term has to add its equations if they are not there with these penalties active.
    pub(crate) fn of_term(&mut self, term: usize, active: &[u32]) -> Option<Linearization<'_, D>> {
        let coefficients = &mut self.coefficients[term];
        if coefficients.active.as_deref() == Some(active) {
            return None;
        }
        coefficients.contributions.clear();
        coefficients.active = Some(active.to_vec());
        Some(Linearization { pattern: &self.pattern, points: &mut self.points, coefficients })
    }

    /// The penalties of each term that they know.
    pub(crate) fn active(&self) -> Vec<Vec<u32>> {
        self.coefficients.iter().map(|blocks| blocks.active.clone().unwrap_or_default()).collect()
    }

    /// The equations of the coefficients, without those of single cells, once the parameters are eliminated:
    /// `½ μ ω δuᵀ diag(TᵀT) δu` is added for each point. A share γ of the weight of each point, `point_share`, counts as if its
    /// parameter could not move; none where the array is empty.
    pub(crate) fn reduced<S: ParameterBox<D>>(
        &self,
        space: &S,
        points: &SortedPoints<D>,
        constraints: &Constraints<D>,
        damping: f64,
        point_share: &[f64],
    ) -> Result<BlockEquations, Error> {
        let n = points.dim();
        let pairs = n * (n + 1) / 2;
        let mut columns = vec![vec![0.0; points.len()]; pairs + n];
        let mut parts: Vec<Vec<&mut [f64]>> = Vec::new();
        parts.resize_with(points.len().div_ceil(CHUNK), Vec::new);
        for column in &mut columns {
            parts.iter_mut().zip(column.chunks_mut(CHUNK)).for_each(|(part, rows)| part.push(rows));
        }
        parts.into_par_iter().enumerate().for_each(|(chunk, columns)| {
            let first = chunk * CHUNK;
            let part = Elimination { blocks: &self.points, points, constraints, damping, point_share, first, columns };
            pulp::Arch::new().dispatch(part);
        });
        let (weights, right) = columns.split_at(pairs);
        let mut equations = BlockEquations::new(space, &self.pattern, points, weights, right)?;
        self.add_blocks(&mut equations)?;
        Ok(equations)
    }

    /// Adds the equations that terms have added for all coefficients.
    pub(crate) fn add_blocks(&self, equations: &mut BlockEquations) -> Result<(), Error> {
        self.coefficients.iter().try_for_each(|blocks| blocks.add_to(equations))
    }

    /// Adds the equations of single cells, unknown `k` of function `j` at `j N + k`.
    pub(crate) fn add_cells(&self, matrix: &mut SymmetricMatrix, right: &mut Array2<f64>) {
        for contribution in self.coefficients.iter().flat_map(|blocks| &blocks.contributions) {
            if let Contribution::Cell { unknowns, matrix: values, right: pull } = contribution {
                matrix.add_cell(unknowns, values);
                unknowns.iter().zip(pull).for_each(|(&unknown, x)| right[[unknown as usize, 0]] += x);
            }
        }
    }

    /// Adds the gradient of what terms have added to the equations of the coefficients; that of the points is not in it.
    pub(crate) fn add_gradient(&self, gradient: &mut Array2<f64>) {
        self.coefficients.iter().for_each(|blocks| blocks.add_gradient(gradient));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::JointOptions;
    use crate::methods::unknowns::basis_sums;
    use crate::step_system::StepSystem;
    use crate::term::{Objective, Term};
    use crate::terms::check::Case;
    use crate::terms::data::Data;
    use crate::terms::smoothing::Smoothing;
    use crate::terms::springs::Springs;
    use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, Quadrature, SplineMap, ThinPlate};

    /// The step is where the derivatives of what it minimizes vanish, by each coefficient and by each free parameter.
    #[test]
    fn elimination_solves_the_whole_system() {
        let knots = [KnotVector::uniform_periodic(2, 5).unwrap(), KnotVector::uniform(2, 3).unwrap()];
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, knots).unwrap());
        let case = Case::new("tube".into(), space.clone(), 3);
        let (map, points) = (&case.map, &case.points);
        let gram = ThinPlate::new(space.degree(), Quadrature::Exact);
        let gram = gram.gram(space.as_ref(), &SymmetricPattern::new(space.as_ref())).unwrap();
        let mut smoothing = Smoothing::new(gram.clone(), 1e-4);
        let options = JointOptions { stiffness: 0.1, cohesion: 0.2, ..JointOptions::default() };
        let frames = &case.snapshot.frames;
        let mut springs = Springs::new(points, frames, case.start.clone(), &case.triangles, &options);
        let mut data = Data;
        let terms: Vec<&mut dyn Term<2>> = vec![&mut data, &mut springs, &mut smoothing];
        let mut equations = Equations::new(gram.pattern().clone());
        Objective::new(terms).freeze(&case.snapshot.start(map, points), &mut equations).unwrap();
        let damping = 0.05;
        let reduced = equations.reduced(space.as_ref(), points, &case.constraints, damping, &[]).unwrap();
        let mut system = StepSystem::new(gram.pattern(), 3).unwrap();
        let step = system.step(&reduced, 0.0, &Vec::new(), |_, _| ()).unwrap().unwrap();
        assert!(step.iter().any(|x| x.abs() > 1e-3));
        let change = SplineMap::new(space.clone(), step.clone()).unwrap();
        let mut forces = Vec::new();
        for (at, block) in equations.points.iter().enumerate() {
            let free = case.constraints.free(points.order()[at] as usize);
            let added = crate::points::vector::padded(&change.eval(points.parameter(at)).unwrap());
            let carried: Vector = std::array::from_fn(|k| block.residual[k] + added[k]);
            let move_by = block.parameter_step(&carried, damping, free);
            let left: Vector =
                std::array::from_fn(|k| carried[k] + (0..2).map(|d| block.tangents[d][k] * move_by[d]).sum::<f64>());
            for d in 0..2 {
                let held = (block.spring.stiffness[d] + damping * block.metric()[d][d]) * move_by[d];
                let slope = dot(&block.tangents[d], &left) + block.pull[d] + held;
                assert!(if free[d] { slope.abs() < 1e-12 } else { move_by[d] == 0.0 }, "{at}: {slope} {move_by:?}");
            }
            forces.push(left.map(|x| block.weight * x));
        }
        let parameters: Vec<[f64; 2]> = (0..points.len()).map(|at| points.parameter(at)).collect();
        let stepped = &map.coefficients() + &step;
        let slopes = basis_sums(&space, &parameters, &forces, 3).unwrap() + smoothing.gradient(stepped.view());
        assert!(slopes.iter().all(|x| x.abs() < 1e-10), "{slopes}");
    }
}
