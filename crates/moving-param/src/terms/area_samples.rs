//! Samples of the area of a surface, and how they change against another one.

use std::sync::{Arc, Mutex, PoisonError};

use ndarray::Array2;
use rayon::prelude::*;
use thb_core::{ParameterBox, SplineMap, bernstein};

use crate::points::vector::{Vector, cross, dot, unit};

/// Samples per direction and cell, those at its ends included: surfaces crease where knot lines lose their area first. Folds
/// are narrower than cells; of 4 and 8 samples only 8 kept them out.
const SAMPLES: usize = 8;

/// Samples of a cell.
pub(crate) const PER_CELL: usize = SAMPLES * SAMPLES;

/// `ε`: the share of its cell's mean area below which a sample is pushed.
const LEAST_AREA: f64 = 0.2;

/// Samples of the area of surfaces of one degree.
#[derive(Debug)]
pub(crate) struct AreaSamples {
    /// For each sample of a cell the derivatives of the Bernstein polynomials in both directions, on the unit square.
    slopes: Vec<[Vec<f64>; 2]>,
}

impl AreaSamples {
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
    pub(crate) fn tangents<const D: usize, S: ParameterBox<D>>(
        &self,
        map: &SplineMap<D, S>,
        sample: usize,
    ) -> [Vector; 2] {
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
    fn area_vectors<const D: usize, S: ParameterBox<D>>(&self, map: &SplineMap<D, S>) -> Vec<Vector> {
        let area = |sample: usize| {
            let [u, v] = self.tangents(map, sample);
            cross(&u, &v)
        };
        (0..map.space().n_cells() * PER_CELL).into_par_iter().with_min_len(PER_CELL).map(area).collect()
    }
}

/// A surface before a step, at the samples.
#[derive(Debug)]
pub(crate) struct Sheet {
    /// `ω`.
    weight: f64,
    /// `n_g`.
    normals: Vec<Vector>,
    /// `a_g` of each cell.
    areas: Vec<f64>,
    own: Folds,
    /// The coefficients that were looked at last, and what was found: the term and its safeguard ask for the same ones.
    last: Mutex<Option<(Array2<f64>, Arc<Folds>)>>,
}

/// What a surface costs.
#[derive(Clone, Debug)]
pub(crate) struct Folds {
    pub(crate) energy: f64,
    /// Samples below `ε`, increasing.
    pub(crate) low: Vec<u32>,
    /// Those of them that have turned over.
    turned: Vec<u32>,
}

impl Sheet {
    /// The sheet of a map, with the weight `64 ω` of a cell.
    pub(crate) fn new<const D: usize, S: ParameterBox<D>>(
        samples: &AreaSamples,
        map: &SplineMap<D, S>,
        weight: f64,
    ) -> Self {
        let vectors = samples.area_vectors(map);
        let areas = vectors
            .chunks_exact(PER_CELL)
            .map(|cell| cell.iter().map(|v| dot(v, v).sqrt()).sum::<f64>() / PER_CELL as f64);
        let normals = vectors.chunks_exact(PER_CELL).flat_map(|cell| (0..PER_CELL).map(|g| mean_normal(cell, g)));
        let (areas, normals) = (areas.collect(), normals.collect());
        let own = Folds { energy: 0.0, low: Vec::new(), turned: Vec::new() };
        let mut sheet = Self { weight: weight / PER_CELL as f64, normals, areas, own, last: Mutex::new(None) };
        sheet.own = sheet.folds_among(&vectors);
        sheet.last = Mutex::new(Some((map.coefficients().to_owned(), Arc::new(sheet.own.clone()))));
        sheet
    }

    /// The low and turned samples of a map.
    pub(crate) fn folds<const D: usize, S: ParameterBox<D>>(
        &self,
        samples: &AreaSamples,
        map: &SplineMap<D, S>,
    ) -> Arc<Folds> {
        // What another thread left behind when it failed is a whole pair still.
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        match last.as_ref() {
            Some((coefficients, folds)) if coefficients == map.coefficients() => folds.clone(),
            _ => {
                let folds = Arc::new(self.folds_among(&samples.area_vectors(map)));
                *last = Some((map.coefficients().to_owned(), folds.clone()));
                folds
            }
        }
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
    pub(crate) fn turns_more(&self, folds: &Folds) -> bool {
        folds.turned.len() > self.own.turned.len()
    }

    /// The functions of the cells with samples that had not turned over before, increasing.
    pub(crate) fn around_turned<const D: usize, S: ParameterBox<D>>(&self, space: &S, folds: &Folds) -> Vec<u32> {
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

    /// The linearized penalty of samples of one cell.
    pub(crate) fn part<const D: usize, S: ParameterBox<D>>(
        &self,
        samples: &AreaSamples,
        map: &SplineMap<D, S>,
        low: &[u32],
    ) -> CellPart {
        let number = low[0] as usize / PER_CELL;
        let (cell, area) = (map.space().cell(number), self.areas[number]);
        let size = cell.size();
        let unknowns: Vec<u32> = cell.functions.iter().flat_map(|&f| (0..3).map(move |k| 3 * f + k)).collect();
        let n = unknowns.len();
        let mut part = CellPart { unknowns, matrix: vec![0.0; n * n], right: vec![0.0; n] };
        let (mut gradient, mut scratch) = (Vec::new(), Vec::new());
        for sample in low.iter().map(|&g| g as usize) {
            let normal = &self.normals[sample];
            let [u, v] = samples.tangents(map, sample);
            let lack = self.weight * (LEAST_AREA - self.share(sample, &cross(&u, &v)));
            // dJ = (dS_u · (S_v × n) + dS_v · (n × S_u)) / a.
            let along =
                [cross(&v, normal).map(|x| x / (size[0] * area)), cross(normal, &u).map(|x| x / (size[D - 1] * area))];
            let [across_u, across_v] = &samples.slopes[sample % PER_CELL];
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
pub(crate) struct CellPart {
    pub(crate) unknowns: Vec<u32>,
    /// The lower triangle, row-major.
    pub(crate) matrix: Vec<f64>,
    pub(crate) right: Vec<f64>,
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
