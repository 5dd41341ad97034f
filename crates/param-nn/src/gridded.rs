//! Point sequences and grids on random curves and surfaces, with the parameters they were sampled at.

use ndarray::Array2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::bezier::LARGEST_DEGREE;
use crate::error::NnError;
use crate::parcnn::{SplineCurve, SplineSpace};
use crate::synthetic::{normal, uniform_rotation};

/// What is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A polynomial curve with normally distributed control points.
    Curve {
        /// Degree.
        degree: usize,
        /// 2 in the plane, 3 in space.
        dimension: usize,
    },
    /// a₀ + Σ aⱼ cos jt + Σ bⱼ sin jt for t from 0 to 1, normally distributed coefficients (Imperatore 2024, §4.1.6 (c)). The
    /// text is silent on the range of t; with whole periods classical errors are a hundred times the printed ones.
    Trigonometric {
        /// The largest j.
        order: usize,
        /// 2 in the plane, 3 in space.
        dimension: usize,
    },
    /// A polynomial surface: x and y of the control points at the Greville abscissae, z from \[0, 1\]; turned at random.
    Surface {
        /// Degree in both directions.
        degree: usize,
    },
}

/// A random grid (Imperatore 2024, Algorithm 5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GriddedSpec {
    /// What is sampled.
    pub shape: Shape,
    /// Points along each direction; a curve has one line.
    pub size: [usize; 2],
    /// Standard deviation of the normally distributed noise on each coordinate, before scaling.
    pub noise: f64,
}

/// A grid with the parameters it was sampled at.
#[derive(Clone, Debug, PartialEq)]
pub struct GriddedCloud {
    /// Points, shape `(m, N)`; the first index of the grid runs slowest.
    pub points: Array2<f64>,
    /// Parameters, shape `(m, D)`.
    pub parameters: Array2<f64>,
    /// Points along each direction.
    pub size: [usize; 2],
}

/// Sorted random numbers, scaled so that the first is 0 and the last is 1.
pub(crate) fn sorted_parameters(count: usize, random: &mut ChaCha8Rng) -> Vec<f64> {
    let mut along: Vec<f64> = (0..count).map(|_| random.random()).collect();
    along.sort_by(f64::total_cmp);
    normalize_parameters(&mut along);
    along
}

/// Maps the first to 0 and the last to 1.
pub(crate) fn normalize_parameters(along: &mut [f64]) {
    let (Some(&first), Some(&last)) = (along.first(), along.last()) else { return };
    let span = if last > first { last - first } else { 1.0 };
    along.iter_mut().for_each(|t| *t = (*t - first) / span);
}

impl GriddedSpec {
    /// A random grid.
    ///
    /// # Errors
    /// [`NnError::BadOption`].
    pub fn sample(&self, random: &mut ChaCha8Rng) -> Result<GriddedCloud, NnError> {
        let bad = |name, value: usize, range| Err(NnError::BadOption { name, value: value as f64, range });
        let surface = matches!(self.shape, Shape::Surface { .. });
        let (degree, dimension) = match self.shape {
            Shape::Curve { degree, dimension } | Shape::Trigonometric { order: degree, dimension } => {
                (degree, dimension)
            }
            Shape::Surface { degree } => (degree, 3),
        };
        if !(1..=LARGEST_DEGREE).contains(&degree) {
            return bad("degree", degree, "from 1 to 8");
        }
        if !(2..=3).contains(&dimension) {
            return bad("dimension", dimension, "2 or 3");
        }
        if self.size[0] < 2 || (surface && self.size[1] < 2) {
            return bad("size", self.size[0].min(self.size[1]), "at least 2 along each direction");
        }
        if !surface && self.size[1] != 1 {
            return bad("size", self.size[1], "1 across a curve");
        }
        if !(self.noise >= 0.0 && self.noise.is_finite()) {
            return Err(NnError::BadOption { name: "noise", value: self.noise, range: "finite and at least 0" });
        }
        let (mut points, parameters) = match self.shape {
            Shape::Curve { degree, .. } => {
                let curve = SplineCurve::random(SplineSpace::polynomials(degree), dimension, random);
                let along = sorted_parameters(self.size[0], random);
                (along.iter().map(|&t| curve.point(t)).collect(), column(&along))
            }
            Shape::Trigonometric { order, .. } => {
                let curve = Trigonometric::random(order, dimension, 1.0, random);
                let along = sorted_parameters(self.size[0], random);
                (along.iter().map(|&t| curve.point(t)).collect(), column(&along))
            }
            Shape::Surface { degree } => surface_grid(degree, self.size, random),
        };
        if self.noise > 0.0 {
            points.iter_mut().for_each(|p| p[..dimension].iter_mut().for_each(|x| *x += self.noise * normal(random)));
        }
        scale_to_unit_box(&mut points);
        let points = Array2::from_shape_fn((points.len(), dimension), |(i, k)| points[i][k]);
        Ok(GriddedCloud { points, parameters, size: self.size })
    }
}

fn column(along: &[f64]) -> Array2<f64> {
    Array2::from_shape_fn((along.len(), 1), |(i, _)| along[i])
}

/// A random trigonometric curve on \[0, 1\].
pub(crate) struct Trigonometric {
    /// Angle that the whole curve goes through at j = 1.
    range: f64,
    /// a₀, then pairs (aⱼ, bⱼ).
    coefficients: Vec<[f64; 3]>,
}

impl Trigonometric {
    pub(crate) fn random(order: usize, dimension: usize, range: f64, random: &mut ChaCha8Rng) -> Self {
        let coefficients = (0..=2 * order).map(|_| vector(dimension, random)).collect();
        Self { range, coefficients }
    }

    pub(crate) fn point(&self, t: f64) -> [f64; 3] {
        std::array::from_fn(|k| {
            let mut sum = self.coefficients[0][k];
            for (j, pair) in self.coefficients[1..].chunks_exact(2).enumerate() {
                let (sine, cosine) = (self.range * t * (j + 1) as f64).sin_cos();
                sum += pair[0][k] * cosine + pair[1][k] * sine;
            }
            sum
        })
    }
}

/// Normally distributed coordinates; those beyond the dimension are 0.
pub(crate) fn vector(dimension: usize, random: &mut ChaCha8Rng) -> [f64; 3] {
    std::array::from_fn(|k| if k < dimension { normal(random) } else { 0.0 })
}

fn surface_grid(degree: usize, size: [usize; 2], random: &mut ChaCha8Rng) -> (Vec<[f64; 3]>, Array2<f64>) {
    let n = degree + 1;
    let heights: Vec<f64> = (0..n * n).map(|_| random.random()).collect();
    let rotation = uniform_rotation(random);
    let along = size.map(|count| sorted_parameters(count, random));
    let space = SplineSpace::polynomials(degree);
    let values = along.each_ref().map(|along| along.iter().map(|&t| space.values(t)).collect::<Vec<_>>());
    let mut points = Vec::with_capacity(size[0] * size[1]);
    for (u, bu) in along[0].iter().zip(&values[0]) {
        for (v, bv) in along[1].iter().zip(&values[1]) {
            let z: f64 = (0..n * n).map(|k| bu[k / n] * bv[k % n] * heights[k]).sum();
            points.push(std::array::from_fn(|k| rotation[[k, 0]] * u + rotation[[k, 1]] * v + rotation[[k, 2]] * z));
        }
    }
    let parameters =
        Array2::from_shape_fn((points.len(), 2), |(i, k)| along[k][if k == 0 { i / size[1] } else { i % size[1] }]);
    (points, parameters)
}

/// Scales each coordinate by one common factor so that the box touches \[0, 1\] in its longest direction.
pub(crate) fn scale_to_unit_box(points: &mut [[f64; 3]]) {
    let range =
        |k: usize| points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p[k]), b.max(p[k])));
    let ranges: [(f64, f64); 3] = std::array::from_fn(range);
    let longest = ranges.iter().fold(0.0f64, |l, (a, b)| l.max(b - a));
    let factor = if longest > 0.0 { longest.recip() } else { 1.0 };
    points.iter_mut().for_each(|p| (0..3).for_each(|k| p[k] = (p[k] - ranges[k].0) * factor));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parcnn::{CONSTANTS, GridFit};
    use crate::synthetic::stream;

    fn spec(shape: Shape, size: [usize; 2]) -> GriddedSpec {
        GriddedSpec { shape, size, noise: 0.0 }
    }

    #[test]
    fn grids_lie_on_a_shape_of_their_degree_in_the_unit_box() {
        for degree in 2..=5 {
            let space = SplineSpace::polynomials(degree);
            for (shape, size) in [
                (Shape::Curve { degree, dimension: 2 }, [30, 1]),
                (Shape::Curve { degree, dimension: 3 }, [30, 1]),
                (Shape::Surface { degree }, [12, 10]),
            ] {
                let cloud = spec(shape, size).sample(&mut stream(1, degree as u64)).unwrap();
                assert_eq!(cloud.points.nrows(), size[0] * size[1]);
                assert!(cloud.points.iter().all(|x| (0.0..=1.0 + 1e-12).contains(x)));
                assert!(cloud.points.iter().any(|&x| x > 1.0 - 1e-12));
                let padded =
                    |row: ndarray::ArrayView1<'_, f64>| std::array::from_fn(|k| row.get(k).copied().unwrap_or(0.0));
                let xyz: Vec<[f64; 3]> = cloud.points.rows().into_iter().map(padded).collect();
                let uv: Vec<[f64; 2]> = cloud
                    .parameters
                    .rows()
                    .into_iter()
                    .map(|row| [row[0], row.get(1).copied().unwrap_or(0.0)])
                    .collect();
                let spaces = [space, if size[1] == 1 { CONSTANTS } else { space }];
                let mse = GridFit::new(spaces, &uv, &xyz).mse;
                assert!(mse < 1e-22, "{shape:?}: {mse}");
            }
        }
    }

    #[test]
    fn parameters_rise_from_zero_to_one() {
        let cloud = spec(Shape::Trigonometric { order: 5, dimension: 2 }, [50, 1]).sample(&mut stream(2, 0)).unwrap();
        let t = cloud.parameters.column(0);
        assert_eq!((t[0], t[49]), (0.0, 1.0));
        assert!(t.windows(2).into_iter().all(|w| w[0] < w[1]));
    }

    #[test]
    fn options_out_of_range_are_errors() {
        let curve = |degree, dimension| Shape::Curve { degree, dimension };
        for (shape, size, wrong) in [
            (curve(9, 2), [20, 1], "degree"),
            (curve(2, 4), [20, 1], "dimension"),
            (curve(2, 2), [1, 1], "size"),
            (curve(2, 2), [20, 2], "size"),
            (Shape::Surface { degree: 2 }, [20, 1], "size"),
        ] {
            let error = spec(shape, size).sample(&mut stream(0, 0));
            assert!(matches!(error, Err(NnError::BadOption { name, .. }) if name == wrong), "{error:?}");
        }
        let noisy = GriddedSpec { noise: -1.0, ..spec(curve(2, 2), [20, 1]) };
        assert!(matches!(noisy.sample(&mut stream(0, 0)), Err(NnError::BadOption { name: "noise", .. })));
    }
}
