//! Scattered clouds on random polynomial surfaces, with the parameters they were sampled at.

use std::f64::consts::{PI, TAU};

use ndarray::Array2;
use point_cloud::Normalization;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::bezier::{BezierFit, LARGEST_DEGREE};
use crate::error::NnError;

/// Where the control points of a random surface lie before it is turned, and how it is turned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControlPoints {
    /// Imperatore 2024, §4.2.6: x and y at the Greville abscissae, z from \[0, 1\]; turned by an angle from \[0, π\] round
    /// an axis with coordinates from \[0, 1\].
    Greville,
    /// Imperatore 2024, §4.3.4, for any degree d: x and y up to 1/(2d) from the Greville abscissae, z from \[−1, 1\].
    /// All turns are equally likely; the text leaves this open, and its code prefers axes with positive coordinates.
    Jittered,
}

/// What to sample (Imperatore 2024, Algorithm 6).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScatteredSpec {
    /// The control points.
    pub control_points: ControlPoints,
    /// Degree of the surface in both directions, from 1 to [`LARGEST_DEGREE`].
    pub degree: usize,
    /// Points inside, n. The boundary gets 4(⌈√n⌉ + 1) further ones: the corners and ⌈√n⌉ on each edge.
    pub interior: usize,
    /// Standard deviation of the normally distributed noise on each coordinate, before the cloud is scaled.
    pub noise: f64,
}

/// A cloud with the parameters it was sampled at.
#[derive(Clone, Debug, PartialEq)]
pub struct ScatteredCloud {
    /// Points, shape `(m, 3)`: the interior ones, then the boundary counter-clockwise from the corner at (0, 0). Scaled
    /// into the unit cube by one common factor.
    pub points: Array2<f64>,
    /// Parameters, shape `(m, 2)`; those of the boundary points lie on the boundary of the unit square.
    pub parameters: Array2<f64>,
    /// Number of interior points.
    pub interior: usize,
}

/// Random numbers of item `index` of the set that `seed` stands for: items do not depend on each other.
pub fn stream(seed: u64, index: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(index);
    random
}

impl ScatteredSpec {
    /// Points on the boundary.
    pub fn boundary(&self) -> usize {
        4 * (self.per_edge() + 1)
    }

    /// Points on an edge between its corners.
    fn per_edge(&self) -> usize {
        (self.interior as f64).sqrt().ceil() as usize
    }

    /// A random cloud.
    ///
    /// # Errors
    /// [`NnError::BadOption`].
    pub fn sample(&self, random: &mut ChaCha8Rng) -> Result<ScatteredCloud, NnError> {
        self.sample_unevenly([0.0; 2], random)
    }

    /// A random cloud of uneven density: parameters t along each direction become t + a sin(2πt)/(2π), with \|a\| < 1.
    pub(crate) fn sample_unevenly(
        &self,
        unevenness: [f64; 2],
        random: &mut ChaCha8Rng,
    ) -> Result<ScatteredCloud, NnError> {
        if !(1..=LARGEST_DEGREE).contains(&self.degree) {
            return Err(NnError::BadOption { name: "degree", value: self.degree as f64, range: "from 1 to 8" });
        }
        if !(self.noise >= 0.0 && self.noise.is_finite()) {
            return Err(NnError::BadOption { name: "noise", value: self.noise, range: "finite and at least 0" });
        }
        let surface = self.surface(random);
        let mut parameters = self.parameters(random);
        for (a, mut along) in unevenness.into_iter().zip(parameters.columns_mut()) {
            // The ends stay where they are, bit by bit.
            let inside = along.iter_mut().filter(|t| **t > 0.0 && **t < 1.0);
            inside.for_each(|t| *t = (*t + a * (TAU * *t).sin() / TAU).clamp(0.0, 1.0));
        }
        let mut points = Array2::zeros((parameters.nrows(), 3));
        for (mut point, uv) in points.rows_mut().into_iter().zip(parameters.rows()) {
            let exact = surface.point([uv[0], uv[1]]);
            point.iter_mut().zip(exact).for_each(|(x, e)| *x = e);
        }
        if self.noise > 0.0 {
            points.iter_mut().for_each(|x| *x += self.noise * normal(random));
        }
        let points = Normalization::of(points.view())?.apply(points.view())?;
        Ok(ScatteredCloud { points, parameters, interior: self.interior })
    }

    fn surface(&self, random: &mut ChaCha8Rng) -> BezierFit {
        let d = self.degree as f64;
        let mut control = Array2::zeros(((self.degree + 1) * (self.degree + 1), 3));
        for (index, mut point) in control.rows_mut().into_iter().enumerate() {
            let greville = [index % (self.degree + 1), index / (self.degree + 1)].map(|i| i as f64 / d);
            let mut between = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
            let place = match self.control_points {
                ControlPoints::Greville => [greville[0], greville[1], between(0.0, 1.0)],
                ControlPoints::Jittered => {
                    let [x, y] = greville.map(|g| g + between(-0.5, 0.5) / d);
                    [x, y, between(-1.0, 1.0)]
                }
            };
            point.iter_mut().zip(place).for_each(|(x, p)| *x = p);
        }
        let rotation = match self.control_points {
            ControlPoints::Greville => {
                let axis: [f64; 3] = random.random();
                let (sine, cosine) = (PI * random.random::<f64>() / 2.0).sin_cos();
                let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
                rotation_of([cosine, axis[0] * sine / length, axis[1] * sine / length, axis[2] * sine / length])
            }
            ControlPoints::Jittered => uniform_rotation(random),
        };
        BezierFit { degree: self.degree, coefficients: control.dot(&rotation.t()), mse: 0.0 }
    }

    /// Interior parameters, then those of the boundary, counter-clockwise.
    fn parameters(&self, random: &mut ChaCha8Rng) -> Array2<f64> {
        let mut parameters = Array2::zeros((self.interior + self.boundary(), 2));
        let mut rows = parameters.rows_mut().into_iter();
        let mut put = |uv: [f64; 2]| {
            if let Some(mut row) = rows.next() {
                row.iter_mut().zip(uv).for_each(|(x, u)| *x = u);
            }
        };
        for _ in 0..self.interior {
            // 1 − x is in (0, 1]: an interior parameter of exactly 0 has no chance worth naming, as one of exactly 1.
            put([1.0 - random.random::<f64>(), 1.0 - random.random::<f64>()]);
        }
        for edge in 0..4 {
            let mut along: Vec<f64> = (0..self.per_edge()).map(|_| random.random()).collect();
            along.sort_by(f64::total_cmp);
            for t in std::iter::once(0.0).chain(along) {
                put(match edge {
                    0 => [t, 0.0],
                    1 => [1.0, t],
                    2 => [1.0 - t, 1.0],
                    _ => [0.0, 1.0 - t],
                });
            }
        }
        parameters
    }
}

/// A rotation, all being equally likely: a normally distributed quaternion has no preferred direction.
pub(crate) fn uniform_rotation(random: &mut ChaCha8Rng) -> Array2<f64> {
    let quaternion: [f64; 4] = std::array::from_fn(|_| normal(random));
    let length = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
    rotation_of(quaternion.map(|x| x / length))
}

/// The rotation matrix, shape `(3, 3)`, of a unit quaternion, its real part first.
fn rotation_of([w, x, y, z]: [f64; 4]) -> Array2<f64> {
    ndarray::array![
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// A normally distributed number (Box & Muller 1958).
pub(crate) fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (radius, angle) = (1.0 - random.random::<f64>(), random.random::<f64>());
    (-2.0 * radius.ln()).sqrt() * (TAU * angle).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [ControlPoints; 2] = [ControlPoints::Greville, ControlPoints::Jittered];

    #[test]
    fn clouds_lie_on_a_patch_of_their_degree_in_the_unit_cube() {
        for control_points in KINDS {
            for degree in 2..=5 {
                let spec = ScatteredSpec { control_points, degree, interior: 200, noise: 0.0 };
                let cloud = spec.sample(&mut stream(7, degree as u64)).unwrap();
                assert_eq!(cloud.points.dim(), (264, 3));
                let fit = BezierFit::new(cloud.parameters.view(), cloud.points.view(), degree).unwrap();
                assert!(fit.mse < 1e-24, "{}", fit.mse);
                assert!(cloud.points.iter().all(|x| (0.0..=1.0).contains(x)));
                assert!(cloud.points.iter().any(|&x| x == 1.0));
            }
        }
    }

    #[test]
    fn interior_and_boundary_are_told_apart_by_order() {
        let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree: 2, interior: 1000, noise: 0.0 };
        let cloud = spec.sample(&mut stream(1, 0)).unwrap();
        assert_eq!((spec.boundary(), cloud.points.nrows()), (132, 1132));
        let on_boundary = |i: usize| cloud.parameters.row(i).iter().any(|&x| x == 0.0 || x == 1.0);
        assert!((0..1000).all(|i| !on_boundary(i)) && (1000..1132).all(on_boundary));
    }

    #[test]
    fn noise_has_the_deviation_asked_for() {
        let spec = |noise| ScatteredSpec { control_points: ControlPoints::Greville, degree: 2, interior: 2000, noise };
        let noisy = spec(0.01).sample(&mut stream(3, 0)).unwrap();
        let fit = BezierFit::new(noisy.parameters.view(), noisy.points.view(), 2).unwrap();
        // Three coordinates, the scale of the cube between 0.5 and 1, and nine control points taken out.
        let deviation = (fit.mse / 3.0).sqrt();
        assert!((0.005..0.0103).contains(&deviation), "{deviation}");
    }

    #[test]
    fn streams_repeat_and_differ() {
        let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree: 3, interior: 20, noise: 0.1 };
        let cloud = |seed, index| spec.sample(&mut stream(seed, index)).unwrap();
        assert_eq!(cloud(1, 5), cloud(1, 5));
        assert_ne!(cloud(1, 5), cloud(1, 6));
        assert_ne!(cloud(1, 5), cloud(2, 5));
    }

    #[test]
    fn rotations_are_orthogonal_and_proper() {
        let r = uniform_rotation(&mut stream(0, 0));
        let unit = r.dot(&r.t()) - Array2::<f64>::eye(3);
        assert!(unit.iter().all(|x| x.abs() < 1e-15));
        let det = r[[0, 0]] * (r[[1, 1]] * r[[2, 2]] - r[[1, 2]] * r[[2, 1]])
            - r[[0, 1]] * (r[[1, 0]] * r[[2, 2]] - r[[1, 2]] * r[[2, 0]])
            + r[[0, 2]] * (r[[1, 0]] * r[[2, 1]] - r[[1, 1]] * r[[2, 0]]);
        assert!((det - 1.0).abs() < 1e-14);
    }

    #[test]
    fn options_out_of_range_are_errors() {
        let spec = ScatteredSpec { control_points: ControlPoints::Greville, degree: 9, interior: 20, noise: 0.0 };
        assert!(matches!(spec.sample(&mut stream(0, 0)), Err(NnError::BadOption { name: "degree", .. })));
        let spec = ScatteredSpec { degree: 2, noise: f64::NAN, ..spec };
        assert!(matches!(spec.sample(&mut stream(0, 0)), Err(NnError::BadOption { name: "noise", .. })));
    }
}
