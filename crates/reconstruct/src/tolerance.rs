//! The tolerance of a fit where none is given.

use ndarray::ArrayView2;
use point_cloud::{noise_sigma, relief, ring_radius, rounding_step, thickness, thickness_of_cloud};
use serde::Serialize;

use crate::Error;
use crate::units::four_digits;

/// Share of the diagonal. Calibrated: on the scans of docs/results it is what shows in a shaded picture; it was the default alone before.
const PER_DIAGONAL: f64 = 1e-3;

/// Share of the shape's own measure. Calibrated: a wall whose sides are 2 % of it off keeps its thickness to 4 %, and a tube its section
/// to 2 %; with 10 % the two sides of a blade of a wind turbine cross at its tip.
const PER_MEASURE: f64 = 0.02;

/// Standard deviations of the noise. Derived: within three lie 99.7 % of Gaussian errors.
const PER_NOISE: f64 = 3.0;

/// Standard deviations of the noise below which a given tolerance is told to be too small. Derived: within two lie 95 % of Gaussian errors,
/// the share of the points that is to be within the tolerance.
const HINT_PER_NOISE: f64 = 2.0;

/// Least relief, as a share of the diagonal, that is a shape's own measure. Limit: what is flatter is a plane up to the round-off of
/// its coordinates and of the fit, and has no measure.
const LEAST_RELIEF: f64 = 1e-6;

/// Noise, as a share of the thickness, beyond which it is none. Derived: local fits over both sides of a shape leave half its thickness;
/// with noise of an eighth the two sides, each spread by three standard deviations, would all but meet.
const MAX_NOISE_PER_THICKNESS: f64 = 0.125;

/// What decided on the tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ToleranceRule {
    /// 0.1 % of the diagonal.
    Diagonal,
    /// 2 % of the relief over the best plane.
    Relief,
    /// 2 % of the radius of a tube.
    Radius,
    /// 2 % of the thickness where two sides face each other.
    Thickness,
    /// Three standard deviations of the noise.
    Noise,
    /// The step to which coordinates are rounded.
    Rounding,
}

impl ToleranceRule {
    /// The rule in words.
    pub fn description(self) -> &'static str {
        match self {
            Self::Diagonal => "0.1 % of the diagonal",
            Self::Relief => "2 % of the relief over the best plane",
            Self::Radius => "2 % of the radius of the tube",
            Self::Thickness => "2 % of the thickness where two sides face each other",
            Self::Noise => "three standard deviations of the noise",
            Self::Rounding => "the step to which the coordinates are rounded",
        }
    }
}

/// Lengths that a tolerance is chosen by, in units of the points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ScanMeasures {
    /// Diagonal of the box, without points that lie grossly off.
    pub diagonal: f64,
    /// Height over the best plane, without 1 % of the points on either side; null for a plane.
    pub relief: Option<f64>,
    /// Radius of a tube; null without a closed direction.
    pub radius: Option<f64>,
    /// The thickness that 5 % of the area falls below; null where no two sides face each other.
    pub thickness: Option<f64>,
    /// Standard deviation of the noise; 0 where none can be told from the shape.
    pub noise: f64,
    /// The step to which coordinates are rounded; 0 if they are not.
    pub rounding: f64,
}

/// A tolerance, what decided on it, and the figures that it was chosen by.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DefaultTolerance {
    /// The tolerance, in units of the points.
    pub value: f64,
    /// What decided.
    pub rule: ToleranceRule,
    /// The figures.
    #[serde(flatten)]
    pub measures: ScanMeasures,
}

impl ScanMeasures {
    /// Measures points `(m, 3)` with parameters `(m, 2)`, which are closed in some directions; `triangles` over the points may be none.
    ///
    /// # Errors
    /// Those of [`noise_sigma`] and the other measures of `point-cloud`.
    pub fn of(
        points: ArrayView2<'_, f64>,
        parameters: ArrayView2<'_, f64>,
        triangles: &[[u32; 3]],
        closed: [bool; 2],
        diagonal: f64,
    ) -> Result<Self, Error> {
        let relief = Some(relief(points)?).filter(|relief| *relief > LEAST_RELIEF * diagonal);
        let round = |d: usize| -> Result<f64, Error> { Ok(ring_radius(points, &parameters.column(1 - d).to_vec())?) };
        let mut radius = None;
        for d in (0..2).filter(|&d| closed[d]) {
            radius = Some(radius.unwrap_or(f64::INFINITY).min(round(d)?));
        }
        let thickness = if triangles.is_empty() {
            // Points on a line and the like have no normals; what is wrong with them is said elsewhere.
            thickness_of_cloud(points).unwrap_or(None)
        } else {
            thickness(points, triangles)?
        };
        let most = thickness.map_or(f64::INFINITY, |thickness| MAX_NOISE_PER_THICKNESS * thickness);
        let noise = Some(noise_sigma(points)?).filter(|noise| *noise <= most).unwrap_or(0.0);
        Ok(Self { diagonal, relief, radius, thickness, noise, rounding: rounding_step(points)? })
    }

    /// 0.1 % of the diagonal, at most 2 % of the shape's own measure, at least three standard deviations of the noise and the
    /// step of rounding.
    pub fn tolerance(self) -> DefaultTolerance {
        let mut best = (PER_DIAGONAL * self.diagonal, ToleranceRule::Diagonal);
        let own = [
            (self.relief, ToleranceRule::Relief),
            (self.radius, ToleranceRule::Radius),
            (self.thickness, ToleranceRule::Thickness),
        ];
        for (measure, rule) in own {
            if let Some(most) =
                measure.map(|measure| PER_MEASURE * measure).filter(|most| *most > 0.0 && *most < best.0)
            {
                best = (most, rule);
            }
        }
        for (least, rule) in [(PER_NOISE * self.noise, ToleranceRule::Noise), (self.rounding, ToleranceRule::Rounding)]
        {
            if least > best.0 {
                best = (least, rule);
            }
        }
        DefaultTolerance { value: best.0, rule: best.1, measures: self }
    }
}

/// What the user should know of a tolerance that was given, for points `(m, 3)`.
pub(crate) fn hint(points: ArrayView2<'_, f64>, tolerance: f64) -> Result<Option<String>, Error> {
    let noise = noise_sigma(points)?;
    Ok((tolerance < HINT_PER_NOISE * noise).then(|| {
        format!(
            "the tolerance {tolerance:.3e} is below the noise of the points, whose standard deviation is about {noise:.3e}: the \
             surface follows the noise; try --tol {:.3e}, or leave --tol out",
            PER_NOISE * noise
        )
    }))
}

/// Tolerance, as a share of the diagonal, beyond which it is more likely that another unit or a percentage was meant.
///
/// Limit: a hint and no more; at 5 % a surface of one cell is within the tolerance of most scans.
const HINT_PER_DIAGONAL: f64 = 0.05;

/// What the user should know of a tolerance that is large beside the scan.
pub(crate) fn hint_if_large(tolerance: f64, diagonal: f64) -> Option<String> {
    (tolerance > HINT_PER_DIAGONAL * diagonal).then(|| {
        format!(
            "the tolerance {} is {:.0} % of the diagonal of the scan, {}: little of its shape is asked for; --tol is a \
             length in the unit of the scan, or a percentage of its diagonal, as in --tol 0.5%",
            four_digits(tolerance),
            100.0 * tolerance / diagonal,
            four_digits(diagonal)
        )
    })
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    #[test]
    fn each_rule_decides_where_its_figure_does() {
        let plain = ScanMeasures { diagonal: 1000.0, relief: Some(300.0), ..ScanMeasures::default() };
        for (measures, value, rule) in [
            (plain, 1.0, ToleranceRule::Diagonal),
            (ScanMeasures { relief: None, ..plain }, 1.0, ToleranceRule::Diagonal),
            (ScanMeasures { relief: Some(10.0), ..plain }, 0.2, ToleranceRule::Relief),
            (ScanMeasures { radius: Some(20.0), ..plain }, 0.4, ToleranceRule::Radius),
            (ScanMeasures { radius: Some(20.0), thickness: Some(5.0), ..plain }, 0.1, ToleranceRule::Thickness),
            (ScanMeasures { thickness: Some(80.0), ..plain }, 1.0, ToleranceRule::Diagonal),
            (ScanMeasures { thickness: Some(5.0), noise: 0.1, ..plain }, 0.3, ToleranceRule::Noise),
            (ScanMeasures { relief: Some(10.0), rounding: 0.5, noise: 0.1, ..plain }, 0.5, ToleranceRule::Rounding),
            (ScanMeasures { noise: 0.1, rounding: 0.01, ..plain }, 1.0, ToleranceRule::Diagonal),
        ] {
            let found = measures.tolerance();
            assert!((found.value - value).abs() < 1e-12 && found.rule == rule, "{found:?} for {measures:?}");
        }
    }

    #[test]
    fn a_flat_tube_gets_the_tolerance_of_its_thickness_and_a_plane_that_of_its_diagonal() {
        // Points far closer to one another than the two sides are.
        let (rows, columns) = (80, 160);
        let parameters = Array2::from_shape_fn((rows * columns, 2), |(i, d)| {
            [(i % columns) as f64 / columns as f64, (i / columns) as f64 / (rows - 1) as f64][d]
        });
        let blade = Array2::from_shape_fn((rows * columns, 3), |(i, k)| {
            let t = std::f64::consts::TAU * parameters[[i, 0]];
            [t.cos(), 0.15 * t.sin(), 4.0 * parameters[[i, 1]]][k]
        });
        let at = |i: usize, j: usize| (i * columns + j % columns) as u32;
        let corners = (0..rows - 1).flat_map(|i| (0..columns).map(move |j| (i, j)));
        let triangles: Vec<[u32; 3]> = corners
            .flat_map(|(i, j)| [[at(i, j), at(i, j + 1), at(i + 1, j)], [at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]])
            .collect();
        let measures =
            ScanMeasures::of(blade.view(), parameters.view(), &triangles, [true, false], diagonal(blade.view()))
                .unwrap();
        let found = measures.tolerance();
        assert!(
            found.rule == ToleranceRule::Thickness && found.value < 0.02 * 0.3 && found.value > 0.02 * 0.02,
            "{found:?}"
        );
        let plane = Array2::from_shape_fn((400, 3), |(i, k)| {
            let [u, v] = [i % 20, i / 20].map(|k| k as f64 / 19.0);
            [u, v, 0.3 * u + 0.1 * v][k]
        });
        let uv = plane.select(ndarray::Axis(1), &[0, 1]);
        let found = ScanMeasures::of(plane.view(), uv.view(), &[], [false; 2], 1.5).unwrap().tolerance();
        assert_eq!((found.value, found.rule), (1.5e-3, ToleranceRule::Diagonal));
        assert!(hint(plane.view(), 1e-9).unwrap().is_none());
    }

    fn diagonal(points: ArrayView2<'_, f64>) -> f64 {
        point_cloud::BoundingBox::of(points).unwrap().diagonal()
    }
}
