//! Parameters of an ordered sequence of points.

use ndarray::{Array1, ArrayView2};
use point_cloud::{CloudError, check_finite};

use crate::ParamError;

/// How the parameter interval is shared out among the steps of a sequence (Lee, Choosing nodes in parametric curve
/// interpolation, Computer-Aided Design 21, 1989: steps proportional to a power of their length).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rule {
    /// Equal steps (power 0).
    Uniform,
    /// Steps proportional to the distance of neighbours (power 1).
    #[default]
    ChordLength,
    /// Steps proportional to the square root of the distance of neighbours (power 1/2).
    Centripetal,
}

impl Rule {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Uniform => "the uniform rule",
            Self::ChordLength => "chord-length",
            Self::Centripetal => "the centripetal rule",
        }
    }

    fn step(self, distance: f64) -> f64 {
        match self {
            Self::Uniform => 1.0,
            Self::ChordLength => distance,
            Self::Centripetal => distance.sqrt(),
        }
    }
}

/// Parameters of `points`, shape `(m, N)`, taken in order: shape `(m,)`, non-decreasing from exactly 0 to exactly 1.
///
/// Two equal neighbours get the same parameter by chord-length and centripetal, since their distance is zero; the
/// uniform rule keeps them apart. A closed sequence repeats its first point at the end.
///
/// # Errors
/// Coordinates not finite, [`CloudError::TooFewPoints`] below two points, [`ParamError::NoLength`] if all points are
/// equal and the rule is not uniform.
pub fn parameterize_sequence(points: ArrayView2<'_, f64>, rule: Rule) -> Result<Array1<f64>, ParamError> {
    check_finite(points)?;
    if points.nrows() < 2 {
        return Err(CloudError::TooFewPoints { given: points.nrows(), required: 2 }.into());
    }
    sequence_parameters(points, rule).ok_or(ParamError::NoLength {
        what: "the sequence",
        rule: rule.name(),
        points: points.nrows(),
    })
}

/// As [`parameterize_sequence`], for two finite points or more; `None` if the steps sum to zero.
pub(crate) fn sequence_parameters(points: ArrayView2<'_, f64>, rule: Rule) -> Option<Array1<f64>> {
    let m = points.nrows();
    let mut sums = Array1::<f64>::zeros(m);
    for i in 1..m {
        let (a, b) = (points.row(i - 1), points.row(i));
        // The largest difference taken out: no square under- or overflows.
        let size = a.iter().zip(b).fold(0.0, |s: f64, (x, y)| s.max((y - x).abs()));
        let relative = a.iter().zip(b).map(|(x, y)| ((y - x) / size).powi(2)).sum::<f64>();
        let distance = if size > 0.0 { size * relative.sqrt() } else { 0.0 };
        sums[i] = sums[i - 1] + rule.step(distance);
    }
    let total = sums[m - 1];
    // Division, not multiplication by the reciprocal: the last parameter is exactly 1.
    (total > 0.0).then(|| sums / total)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, array};
    use proptest::prelude::*;

    const RULES: [Rule; 3] = [Rule::Uniform, Rule::ChordLength, Rule::Centripetal];

    #[test]
    fn steps_of_1_4_9_have_known_parameters() {
        let points = array![[0.0, 0.0], [1.0, 0.0], [1.0, 4.0], [10.0, 4.0]];
        let expected =
            [[0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0], [0.0, 1.0 / 14.0, 5.0 / 14.0, 1.0], [0.0, 1.0 / 6.0, 3.0 / 6.0, 1.0]];
        for (rule, expected) in RULES.into_iter().zip(expected) {
            let t = parameterize_sequence(points.view(), rule).unwrap();
            assert!(t.iter().zip(expected).all(|(t, e)| (t - e).abs() < 1e-15), "{rule:?}: {t}");
        }
    }

    #[test]
    fn equal_points_have_no_length_but_uniform_parameters() {
        let points = Array2::<f64>::ones((4, 3));
        assert_eq!(
            parameterize_sequence(points.view(), Rule::Centripetal),
            Err(ParamError::NoLength { what: "the sequence", rule: "the centripetal rule", points: 4 })
        );
        let t = parameterize_sequence(points.view(), Rule::Uniform).unwrap();
        assert_eq!(t, array![0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0]);
        let one = Array2::<f64>::ones((1, 3));
        assert_eq!(
            parameterize_sequence(one.view(), Rule::Uniform),
            Err(CloudError::TooFewPoints { given: 1, required: 2 }.into())
        );
        assert!(parameterize_sequence(array![[0.0], [f64::NAN]].view(), Rule::Uniform).is_err());
    }

    proptest! {
        /// Rules see distances only: they are monotone, and a similarity of space changes nothing.
        #[test]
        fn parameters_are_monotone_and_invariant_under_similarities(
            coordinates in prop::collection::vec(-10.0..10.0f64, 6..40), angle in 0.0..6.3f64, exponent in -80..80i32,
        ) {
            let m = coordinates.len() / 2;
            let points = Array2::from_shape_fn((m, 2), |(i, k)| coordinates[2 * i + k]);
            let (s, c) = angle.sin_cos();
            let moved = points.dot(&array![[c, s], [-s, c]]) * 10f64.powi(exponent);
            for rule in RULES {
                let t = parameterize_sequence(points.view(), rule).unwrap();
                prop_assert_eq!((t[0], t[m - 1]), (0.0, 1.0));
                prop_assert!(t.windows(2).into_iter().all(|w| w[0] <= w[1]));
                let same = parameterize_sequence(moved.view(), rule).unwrap();
                // The square root of a distance near round-off has half the digits.
                prop_assert!((&same - &t).iter().all(|d| d.abs() < 1e-7));
            }
        }
    }
}
