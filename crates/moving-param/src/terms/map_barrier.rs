//! The barrier that keeps the Jacobian of a map of a box to itself positive.

use thb_core::KnotVector;

use crate::Error;

/// Samples per direction and span of the knots, those at its ends included.
const PER_SPAN: usize = 4;

/// `w mean_g (J_g − 1 − ln J_g)` over samples g of the unit cube, `J_g` the determinant of the derivative of the map there, relative to the
/// box: least for the identity, infinite where the map folds. Nothing is held constant.
///
/// It is a function of the control points of the map that moves the parameters, not of the coefficients of the surface: so it is
/// no [`Term`](crate::Term), but has what one has.
#[derive(Clone, Debug)]
pub(crate) struct MapBarrier<const D: usize> {
    /// For each sample the functions that do not vanish there, with their gradients.
    active: Vec<Vec<(u32, [f64; D])>>,
    /// Edge lengths of the box, by which the determinant is divided: 1 for the identity.
    lengths: [f64; D],
}

/// Gradient and Gauss–Newton matrix of the barrier, row-major.
pub(crate) struct BarrierEquations {
    pub(crate) gradient: Vec<f64>,
    pub(crate) matrix: Vec<f64>,
}

impl<const D: usize> MapBarrier<D> {
    /// The barrier of maps with the given knots in all directions, of a box with the given edges.
    pub(crate) fn new(knots: &KnotVector, lengths: [f64; D]) -> Result<Self, Error> {
        let per_line = knots.n_spans() * (PER_SPAN - 1) + 1;
        let lines = (0..per_line)
            .map(|i| knots.basis_derivatives(i as f64 / (per_line - 1) as f64, 1))
            .collect::<Result<Vec<_>, _>>()?;
        let count = knots.n_functions();
        let sample = |number: usize| {
            let mut all = vec![(0_u32, [1.0; D])];
            for d in (0..D).rev() {
                let (first, rows) = &lines[number / per_line.pow(d as u32) % per_line];
                all = all
                    .iter()
                    .flat_map(|&(j, gradient)| {
                        (0..rows[0].len()).map(move |i| {
                            let slope = |e: usize| gradient[e] * rows[usize::from(e == d)][i];
                            (j * count as u32 + (first + i) as u32, std::array::from_fn(slope))
                        })
                    })
                    .collect();
            }
            all
        };
        Ok(Self { active: (0..per_line.pow(D as u32)).map(sample).collect(), lengths })
    }

    /// `DΦ` at a sample, relative to the edges.
    fn derivative(&self, sample: usize, control_points: &[[f64; D]]) -> [[f64; D]; D] {
        let mut derivative = [[0.0; D]; D];
        for (j, gradient) in &self.active[sample] {
            for a in 0..D {
                for b in 0..D {
                    derivative[a][b] += control_points[*j as usize][a] * gradient[b] / self.lengths[a];
                }
            }
        }
        derivative
    }

    /// The smallest determinant.
    pub(crate) fn least(&self, control_points: &[[f64; D]]) -> f64 {
        let determinants = (0..self.active.len()).map(|g| determinant(&self.derivative(g, control_points)));
        determinants.fold(f64::INFINITY, f64::min)
    }

    /// The energy of a map, with the weight w.
    pub(crate) fn energy(&self, control_points: &[[f64; D]], weight: f64) -> f64 {
        if weight == 0.0 {
            return 0.0;
        }
        let of = |g| {
            let j = determinant(&self.derivative(g, control_points));
            if j > 0.0 { j - 1.0 - j.ln() } else { f64::INFINITY }
        };
        weight * (0..self.active.len()).map(of).sum::<f64>() / self.active.len() as f64
    }

    /// Its derivatives with respect to some components of control points.
    pub(crate) fn linearize(
        &self,
        control_points: &[[f64; D]],
        free: &[(usize, usize)],
        weight: f64,
    ) -> BarrierEquations {
        let unknowns = free.len();
        let mut sum = BarrierEquations { gradient: vec![0.0; unknowns], matrix: vec![0.0; unknowns * unknowns] };
        if weight == 0.0 {
            return sum;
        }
        let weight = weight / self.active.len() as f64;
        let mut places = vec![None; control_points.len() * D];
        free.iter().enumerate().for_each(|(place, &(j, d))| places[j * D + d] = Some(place));
        for (g, active) in self.active.iter().enumerate() {
            let derivative = self.derivative(g, control_points);
            let (j, cofactors) = (determinant(&derivative), cofactors(&derivative));
            let slopes: Vec<(usize, f64)> = active
                .iter()
                .flat_map(|(function, gradient)| (0..D).map(move |a| (*function as usize, a, gradient)))
                .filter_map(|(function, a, gradient)| {
                    let slope = (0..D).map(|b| cofactors[a][b] * gradient[b]).sum::<f64>() / self.lengths[a];
                    places[function * D + a].map(|place| (place, slope))
                })
                .collect();
            for &(a, slope) in &slopes {
                sum.gradient[a] += weight * (1.0 - 1.0 / j) * slope;
                for &(b, other) in &slopes {
                    sum.matrix[a * unknowns + b] += weight * slope * other / (j * j);
                }
            }
        }
        sum
    }
}

/// The derivatives of the determinant with respect to the entries, for D ≤ 3.
fn cofactors<const D: usize>(m: &[[f64; D]; D]) -> [[f64; D]; D] {
    let entry = |a: usize, b: usize| match D {
        1 => 1.0,
        2 => (if a == b { 1.0 } else { -1.0 }) * m[1 - a][1 - b],
        _ => {
            let (p, q, r, s) = ((a + 1) % D, (a + 2) % D, (b + 1) % D, (b + 2) % D);
            m[p][r] * m[q][s] - m[p][s] * m[q][r]
        }
    };
    std::array::from_fn(|a| std::array::from_fn(|b| entry(a, b)))
}

fn determinant<const D: usize>(m: &[[f64; D]; D]) -> f64 {
    let cofactors = cofactors(m);
    (0..D).map(|b| m[0][b] * cofactors[0][b]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_identity_has_the_determinant_1_and_costs_nothing() {
        let knots = KnotVector::uniform(3, 3).unwrap();
        let sites = knots.greville();
        let points: Vec<[f64; 2]> = (0..36).map(|j| [4.0 * sites[j % 6], 0.5 * sites[j / 6]]).collect();
        let barrier = MapBarrier::new(&knots, [4.0, 0.5]).unwrap();
        assert!((barrier.least(&points) - 1.0).abs() < 1e-12);
        assert!(barrier.energy(&points, 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_gradient_is_the_limit_of_differences_and_a_fold_costs_without_limit() {
        fn check<const D: usize>() {
            let knots = KnotVector::uniform(2, 3).unwrap();
            let sites = knots.greville();
            let count = sites.len().pow(D as u32);
            let mut points: Vec<[f64; D]> = (0..count)
                .map(|j| std::array::from_fn(|d| sites[j / sites.len().pow(d as u32) % sites.len()]))
                .collect();
            for (j, point) in points.iter_mut().enumerate() {
                (0..D).for_each(|d| point[d] += 0.04 * (7.0 * j as f64 + 3.0 * d as f64).sin());
            }
            let barrier = MapBarrier::new(&knots, [1.0; D]).unwrap();
            let free: Vec<(usize, usize)> = (0..count).flat_map(|j| (0..D).map(move |d| (j, d))).collect();
            let gradient = barrier.linearize(&points, &free, 2.0).gradient;
            let largest = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
            for (k, &(j, d)) in free.iter().enumerate() {
                let energy = |shift: f64| {
                    let mut moved = points.clone();
                    moved[j][d] += shift;
                    barrier.energy(&moved, 2.0)
                };
                let difference = (energy(1e-6) - energy(-1e-6)) / 2e-6;
                assert!((difference - gradient[k]).abs() < 1e-6 * largest, "{D}: {k} {difference} {}", gradient[k]);
            }
            points[count / 2][0] += 2.0;
            assert!(barrier.least(&points) < 0.0);
            assert_eq!(barrier.energy(&points, 1.0), f64::INFINITY);
        }
        check::<1>();
        check::<2>();
        check::<3>();
    }
}
