//! A penalty that keeps surfaces from folding over.

use ndarray::Array2;
use rayon::prelude::*;
use thb_core::{CellSpace, HierarchicalSpace, SplineMap, SymmetricMatrix, bernstein};

use crate::Error;
use crate::points::patch::{Vector, cross, dot, unit};
use crate::system::{StepSystem, stepped};

/// Samples per direction and cell, those at its ends included: surfaces crease where knot lines lose their area first. Folds
/// are narrower than cells; of 4 and 8 samples only 8 kept them out.
const SAMPLES: usize = 8;

/// Samples of a cell.
const PER_CELL: usize = SAMPLES * SAMPLES;

/// `ε`: the share of its cell's mean area below which a sample is pushed.
const LEAST_AREA: f64 = 0.2;

/// Times that a step is computed anew because further samples would fold.
const EXTENSIONS: usize = 3;

/// What is kept, in turn, of the step of the functions around samples that still turn over.
const KEPT: [f64; 6] = [0.5, 0.5, 0.0, 0.0, 0.0, 0.0];

/// Adds `½ ω Σ_g max(0, ε − J_g)²` to the objective of the joint method, over samples g of all cells of a surface in space.
///
/// `J_g = (S_u × S_v) · n_g / a_g` says how the area around a sample has changed against the map before the step, which has
/// the mean unit normal `n_g` around the sample and the mean area `a_g` in its cell. Where parameters move, points can
/// leave a part of the domain whose image then folds at no distance from any of them.
#[derive(Debug)]
pub(crate) struct Regularity {
    /// For each sample of a cell the derivatives of the Bernstein polynomials in both directions, on the unit square.
    slopes: Vec<[Vec<f64>; 2]>,
}

impl Regularity {
    /// For surfaces of a degree.
    pub(crate) fn new<const D: usize>(degree: [usize; D]) -> Self {
        let [p, q] = [degree[0], degree[D - 1]];
        let basis = |degree: usize, order: usize, sample: usize| {
            let mut values = [0.0; thb_core::MAX_DEGREE + 1];
            bernstein::derivatives(degree, order, sample as f64 / (SAMPLES - 1) as f64, &mut values);
            values
        };
        let products = |sample: usize, orders: [usize; 2]| {
            let (along, across) = (basis(p, orders[0], sample % SAMPLES), basis(q, orders[1], sample / SAMPLES));
            across[..=q].iter().flat_map(|b| along[..=p].iter().map(move |a| a * b)).collect::<Vec<f64>>()
        };
        let slopes = (0..PER_CELL).map(|g| [products(g, [1, 0]), products(g, [0, 1])]).collect();
        Self { slopes }
    }

    /// `S_u` and `S_v` at a sample.
    fn tangents<const D: usize>(&self, map: &SplineMap<D>, sample: usize) -> [Vector; 2] {
        let bezier = map.bezier();
        let (cell, local) = (sample / PER_CELL, sample % PER_CELL);
        let coefficients = bezier.cell_coefficients(cell);
        let (lower, upper) = bezier.cell_box(cell);
        [0, D - 1].map(|d| {
            let mut tangent = [0.0; 4];
            for (slope, row) in self.slopes[local][usize::from(d > 0)].iter().zip(coefficients.chunks_exact(3)) {
                (0..3).for_each(|k| tangent[k] += slope * row[k]);
            }
            tangent.map(|x| x / (upper[d] - lower[d]))
        })
    }

    /// `S_u × S_v` at all samples.
    fn area_vectors<const D: usize>(&self, map: &SplineMap<D>) -> Vec<Vector> {
        let area = |sample: usize| {
            let [u, v] = self.tangents(map, sample);
            cross(&u, &v)
        };
        (0..map.space().n_cells() * PER_CELL).into_par_iter().with_min_len(PER_CELL).map(area).collect()
    }

    /// Whether a surface has turned over at samples where one before it had not.
    pub(crate) fn turned<const D: usize>(&self, map: &SplineMap<D>, before: &SplineMap<D>) -> bool {
        let sheet = Sheet::new(self, before, 0.0);
        sheet.turns_more(&sheet.folds(map))
    }
}

/// A surface before a step, at the samples.
pub(crate) struct Sheet<'a, const D: usize> {
    regularity: &'a Regularity,
    /// `ω`.
    weight: f64,
    /// `n_g`.
    normals: Vec<Vector>,
    /// `a_g` of each cell.
    areas: Vec<f64>,
    own: Folds,
}

/// What a surface costs.
#[derive(Clone, Debug)]
struct Folds {
    energy: f64,
    /// Samples below `ε`, increasing.
    low: Vec<u32>,
    /// Those of them that have turned over.
    turned: Vec<u32>,
}

impl<'a, const D: usize> Sheet<'a, D> {
    /// The sheet of a map, with the weight `64 ω` of a cell.
    pub(crate) fn new(regularity: &'a Regularity, map: &SplineMap<D>, weight: f64) -> Self {
        let vectors = regularity.area_vectors(map);
        let areas = vectors
            .chunks_exact(PER_CELL)
            .map(|cell| cell.iter().map(|v| dot(v, v).sqrt()).sum::<f64>() / PER_CELL as f64);
        let normals = vectors.chunks_exact(PER_CELL).flat_map(|cell| (0..PER_CELL).map(|g| mean_normal(cell, g)));
        let (areas, normals) = (areas.collect(), normals.collect());
        let own = Folds { energy: 0.0, low: Vec::new(), turned: Vec::new() };
        let mut sheet = Self { regularity, weight: weight / PER_CELL as f64, normals, areas, own };
        sheet.own = sheet.folds_among(&vectors);
        sheet
    }

    /// What the surface before the step costs.
    pub(crate) fn energy(&self) -> f64 {
        self.own.energy
    }

    fn folds(&self, map: &SplineMap<D>) -> Folds {
        self.folds_among(&self.regularity.area_vectors(map))
    }

    fn folds_among(&self, vectors: &[Vector]) -> Folds {
        let mut folds = Folds { energy: 0.0, low: Vec::new(), turned: Vec::new() };
        for (sample, vector) in vectors.iter().enumerate() {
            let share = self.share(sample, vector);
            if share < LEAST_AREA {
                folds.energy += 0.5 * self.weight * (LEAST_AREA - share).powi(2);
                folds.low.push(sample as u32);
                folds.turned.extend((share <= 0.0).then_some(sample as u32));
            }
        }
        folds
    }

    /// Whether more samples have turned over than before the step.
    fn turns_more(&self, folds: &Folds) -> bool {
        folds.turned.len() > self.own.turned.len()
    }

    /// The functions of the cells with samples that had not turned over before, increasing.
    fn around_turned(&self, space: &HierarchicalSpace<D>, folds: &Folds) -> Vec<u32> {
        let new = folds.turned.iter().filter(|sample| self.own.turned.binary_search(sample).is_err());
        let mut cells: Vec<usize> = new.map(|&sample| sample as usize / PER_CELL).collect();
        cells.dedup();
        let mut functions: Vec<u32> = cells.into_iter().flat_map(|cell| space.cell(cell).functions.to_vec()).collect();
        functions.sort_unstable();
        functions.dedup();
        functions
    }

    /// `J_g`; 1 in cells without area.
    fn share(&self, sample: usize, vector: &Vector) -> f64 {
        let area = self.areas[sample / PER_CELL];
        if area > 0.0 { dot(vector, &self.normals[sample]) / area } else { 1.0 }
    }

    /// Adds the linearized penalty of some samples, increasing, to the equations of a step from the map of this sheet.
    fn add(&self, map: &SplineMap<D>, low: &[u32], matrix: &mut SymmetricMatrix, right: &mut Array2<f64>) {
        let of_one_cell = |a: &u32, b: &u32| a / PER_CELL as u32 == b / PER_CELL as u32;
        let cells: Vec<&[u32]> = low.chunk_by(of_one_cell).collect();
        let parts: Vec<CellPart> = cells.into_par_iter().map(|samples| self.part(map, samples)).collect();
        for CellPart { unknowns, matrix: values, right: pull } in parts {
            matrix.add_cell(&unknowns, &values);
            unknowns.iter().zip(pull).for_each(|(&unknown, x)| right[[unknown as usize, 0]] += x);
        }
    }

    /// The linearized penalty of samples of one cell.
    fn part(&self, map: &SplineMap<D>, samples: &[u32]) -> CellPart {
        let number = samples[0] as usize / PER_CELL;
        let (cell, area) = (map.space().cell(number), self.areas[number]);
        let size = cell.size();
        let unknowns: Vec<u32> = cell.functions.iter().flat_map(|&f| (0..3).map(move |k| 3 * f + k)).collect();
        let n = unknowns.len();
        let mut part = CellPart { unknowns, matrix: vec![0.0; n * n], right: vec![0.0; n] };
        let (mut gradient, mut scratch) = (Vec::new(), Vec::new());
        for sample in samples.iter().map(|&g| g as usize) {
            let normal = &self.normals[sample];
            let [u, v] = self.regularity.tangents(map, sample);
            let lack = self.weight * (LEAST_AREA - self.share(sample, &cross(&u, &v)));
            // dJ = (dS_u · (S_v × n) + dS_v · (n × S_u)) / a.
            let along =
                [cross(&v, normal).map(|x| x / (size[0] * area)), cross(normal, &u).map(|x| x / (size[D - 1] * area))];
            let [across_u, across_v] = &self.regularity.slopes[sample % PER_CELL];
            gradient.clear();
            for (a, b) in across_u.iter().zip(across_v) {
                gradient.extend((0..3).map(|k| a * along[0][k] + b * along[1][k]));
            }
            cell.pull_back(&mut gradient, 3, &mut scratch);
            for (i, a) in gradient.iter().enumerate() {
                part.right[i] += lack * a;
                let row = &mut part.matrix[i * n..][..=i];
                row.iter_mut().zip(&gradient).for_each(|(x, b)| *x += self.weight * a * b);
            }
        }
        part
    }
}

/// The linearized penalty of one cell: what it adds to the equations of some unknowns.
struct CellPart {
    unknowns: Vec<u32>,
    /// The lower triangle, row-major.
    matrix: Vec<f64>,
    right: Vec<f64>,
}

/// The direction of the sum of the area vectors at a sample of a cell and its neighbours in the cell.
fn mean_normal(cell: &[Vector], sample: usize) -> Vector {
    let around = |i: usize| i.saturating_sub(1)..(i + 2).min(SAMPLES);
    let mut sum = [0.0; 4];
    for j in around(sample / SAMPLES) {
        for i in around(sample % SAMPLES) {
            (0..3).for_each(|k| sum[k] += cell[i + SAMPLES * j][k]);
        }
    }
    unit(sum)
}

/// The map after the step that solves the equations and, where there is a sheet, keeps its samples from folding; and what
/// it costs. Where samples would turn over the functions around them are held back; the others go on. `None` if the equations are
/// singular, or more samples turn over than had before.
pub(crate) fn step<const D: usize>(
    system: &mut StepSystem,
    equations: &fit_ls::BlockEquations,
    map: &SplineMap<D>,
    sheet: Option<&Sheet<'_, D>>,
) -> Result<Option<(SplineMap<D>, f64)>, Error> {
    let (space, coefficients) = (map.space(), map.coefficients().to_owned());
    let none = Vec::new();
    let Some(sheet) = sheet else {
        let step = system.step(equations, 0.0, &none, |_, _| ())?;
        return step.map(|step| Ok((stepped(space, &coefficients, &step)?, 0.0))).transpose();
    };
    let mut low = sheet.own.low.clone();
    let mut extensions = 0;
    loop {
        let solved = system.step(equations, 0.0, &none, |matrix, right| sheet.add(map, &low, matrix, right))?;
        let Some(mut step) = solved else { return Ok(None) };
        let mut trial = stepped(space, &coefficients, &step)?;
        let mut folds = sheet.folds(&trial);
        let known = low.len();
        low.extend(&folds.low);
        low.sort_unstable();
        low.dedup();
        if low.len() > known && extensions < EXTENSIONS {
            extensions += 1;
            continue;
        }
        for kept in KEPT {
            if !sheet.turns_more(&folds) {
                break;
            }
            let functions = sheet.around_turned(space.as_ref(), &folds);
            for function in functions {
                step.row_mut(function as usize).mapv_inplace(|x| kept * x);
            }
            trial = stepped(space, &coefficients, &step)?;
            folds = sheet.folds(&trial);
        }
        return Ok((!sheet.turns_more(&folds)).then_some((trial, folds.energy)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;
    use std::sync::Arc;
    use thb_core::{HierarchicalSpace, Kind, KnotVector, SymmetricPattern};

    /// A slightly bent sheet over the Greville sites, with one site moved in x.
    fn sheet(moved: f64) -> SplineMap<2> {
        let knots = KnotVector::uniform(2, 4).unwrap();
        let sites = knots.greville();
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
        let n = sites.len();
        let mut coefficients = Array2::from_shape_fn((n * n, 3), |(i, k)| {
            let (u, v) = (sites[i % n], sites[i / n]);
            [u, v, 0.1 * (u * u + 0.5 * u * v)][k]
        });
        coefficients[[n * (n / 2) + n / 2, 0]] += moved;
        SplineMap::new(space, coefficients).unwrap()
    }

    #[test]
    fn a_site_pushed_beyond_its_neighbours_turns_the_surface() {
        let turned = |moved: f64| Regularity::new([2, 2]).turned(&sheet(moved), &sheet(0.0));
        assert!(!turned(0.0));
        assert!(!turned(0.1));
        assert!(turned(0.9));
    }

    #[test]
    fn functions_are_held_back_around_samples_that_turn_and_nowhere_else() {
        let (flat, folded) = (sheet(0.0), sheet(0.9));
        let regularity = Regularity::new([2, 2]);
        let before = Sheet::new(&regularity, &flat, 0.0);
        let around = before.around_turned(flat.space(), &before.folds(&folded));
        // Of 6 × 6 functions the one in column 3 of row 3 was moved.
        assert!(around.contains(&21) && around.len() < 36, "{around:?}");
        // What had turned before is no reason.
        let own = Sheet::new(&regularity, &folded, 0.0);
        assert!(own.around_turned(flat.space(), &own.folds(&folded)).is_empty());
    }

    #[test]
    fn the_linearized_penalty_has_the_gradient_of_the_penalty() {
        let map = sheet(0.42);
        let before = sheet(0.0);
        let regularity = Regularity::new([2, 2]);
        // Against the sheet of the map itself nothing is low; against the one before it something is.
        let sheet = Sheet::new(&regularity, &before, 640.0);
        let folds = sheet.folds(&map);
        assert!(!folds.low.is_empty() && folds.energy > 0.0);
        let pattern = SymmetricPattern::new(map.space().as_ref()).blocked(3);
        let mut matrix = SymmetricMatrix::zeros(&pattern);
        let mut right = Array2::zeros((pattern.n(), 1));
        sheet.add(&map, &folds.low, &mut matrix, &mut right);
        let mut largest = 0.0_f64;
        for unknown in 0..pattern.n() {
            let energy = |shift: f64| {
                let mut coefficients = map.coefficients().to_owned();
                coefficients[[unknown / 3, unknown % 3]] += shift;
                sheet.folds(&SplineMap::new(map.space().clone(), coefficients).unwrap()).energy
            };
            let h = 1e-6;
            let slope = (energy(h) - energy(-h)) / (2.0 * h);
            assert!((slope + right[[unknown, 0]]).abs() < 1e-5 * (1.0 + slope.abs()), "{unknown}: {slope} {right:?}");
            largest = largest.max(slope.abs());
        }
        assert!(largest > 0.1, "{largest}");
    }
}
