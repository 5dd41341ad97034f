//! What the tests of this crate share.

use std::sync::Arc;

use ndarray::Array2;
use point_cloud::vec3::{add, dot, norm, scale, sub, unit};
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap};

/// Numbers that look random and are the same in every run (splitmix64: Steele, Lea & Flood 2014).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `n`.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    /// A number between two others.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.next() >> 11) as f64 / (1_u64 << 53) as f64)
    }
}

/// The bicubic surface that equals `shape` at the Greville sites; `elements` per direction, periodic where told.
pub(crate) fn interpolated(
    elements: [usize; 2],
    periodic: [bool; 2],
    shape: impl Fn(f64, f64) -> [f64; 3],
) -> SplineMap<2> {
    let knots: [KnotVector; 2] = std::array::from_fn(|d| {
        if periodic[d] {
            KnotVector::uniform_periodic(3, elements[d]).unwrap()
        } else {
            KnotVector::uniform(3, elements[d]).unwrap()
        }
    });
    let sites = [0, 1].map(|d| knots[d].greville());
    let [m, n] = [sites[0].len(), sites[1].len()];
    let values = Array2::from_shape_fn((n, 3 * m), |(j, column)| shape(sites[0][column / 3], sites[1][j])[column % 3]);
    // First across v, then across u.
    let along_v = solved(&collocation(&knots[1], &sites[1]), values);
    let turned = Array2::from_shape_fn((m, 3 * n), |(i, column)| along_v[[column / 3, 3 * i + column % 3]]);
    let along_u = solved(&collocation(&knots[0], &sites[0]), turned);
    let coefficients = Array2::from_shape_fn((m * n, 3), |(row, k)| along_u[[row % m, 3 * (row / m) + k]]);
    let space = HierarchicalSpace::new(Kind::Thb, knots).unwrap();
    SplineMap::new(Arc::new(space), coefficients).unwrap()
}

/// The same surface with cells split at random.
pub(crate) fn refined_at_random(map: &SplineMap<2>, random: &mut Random) -> SplineMap<2> {
    let space = map.space();
    let marked: Vec<usize> = (0..1 + space.n_cells() / 8).map(|_| random.below(space.n_cells())).collect();
    let finer = space.refine(&marked, &Refinement::default()).unwrap();
    let coefficients = thb_core::transfer(map, &finer).unwrap();
    SplineMap::new(Arc::new(finer), coefficients).unwrap()
}

/// The same surface turned, scaled and moved at random; with the motion of a point.
pub(crate) fn moved(map: &SplineMap<2>, random: &mut Random) -> (SplineMap<2>, impl Fn([f64; 3]) -> [f64; 3] + use<>) {
    let mut axes = [[0.0; 3]; 3];
    for k in 0..3 {
        let mut axis: [f64; 3] = std::array::from_fn(|_| random.between(-1.0, 1.0));
        for earlier in &axes[..k] {
            axis = sub(axis, scale(dot(axis, *earlier), *earlier));
        }
        axes[k] = unit(axis);
    }
    let size = 10_f64.powf(random.between(-2.0, 3.0));
    let offset: [f64; 3] = std::array::from_fn(|_| size * random.between(-5.0, 5.0));
    let motion = move |x: [f64; 3]| add(offset, scale(size, axes.map(|axis| dot(axis, x))));
    let coefficients = map.coefficients();
    let coefficients = Array2::from_shape_fn(coefficients.dim(), |(i, k)| {
        motion([coefficients[[i, 0]], coefficients[[i, 1]], coefficients[[i, 2]]])[k]
    });
    (SplineMap::new(map.space().clone(), coefficients).unwrap(), motion)
}

fn collocation(knots: &KnotVector, sites: &[f64]) -> Vec<Vec<f64>> {
    let n = sites.len();
    let row = |&site: &f64| {
        let (first, values) = knots.basis(site).unwrap();
        let mut row = vec![0.0; n];
        values.iter().enumerate().for_each(|(k, value)| row[(first + k) % n] += value);
        row
    };
    sites.iter().map(row).collect()
}

/// Gaussian elimination with pivots.
fn solved(matrix: &[Vec<f64>], mut right: Array2<f64>) -> Array2<f64> {
    let mut matrix = matrix.to_vec();
    let n = matrix.len();
    let add_row = |right: &mut Array2<f64>, from: usize, to: usize, factor: f64| {
        for k in 0..right.ncols() {
            right[[to, k]] += factor * right[[from, k]];
        }
    };
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| matrix[a][k].abs().total_cmp(&matrix[b][k].abs())).unwrap();
        matrix.swap(k, pivot);
        for column in 0..right.ncols() {
            right.swap([k, column], [pivot, column]);
        }
        for i in 0..n {
            let factor = -matrix[i][k] / matrix[k][k];
            if i != k && factor != 0.0 {
                for j in k..n {
                    matrix[i][j] += factor * matrix[k][j];
                }
                add_row(&mut right, k, i, factor);
            }
        }
    }
    Array2::from_shape_fn(right.dim(), |(i, k)| right[[i, k]] / matrix[i][i])
}

#[test]
fn the_surface_goes_through_the_shape() {
    use std::f64::consts::TAU;
    let shape = |u: f64, v: f64| [(TAU * u).cos(), (TAU * u).sin() + v * v, v];
    let map = interpolated([16, 4], [true, false], shape);
    for (u, v) in [(0.0, 0.0), (0.3, 0.21), (0.99, 1.0), (0.77, 0.5)] {
        let there = map.eval([u, v]).unwrap();
        assert!(norm(sub([there[0], there[1], there[2]], shape(u, v))) < 2e-4, "{u} {v} {there:?}");
    }
}
