//! Fresh training clouds: sizes, degrees, noise, uneven densities and boundary parameters are mixed.

use ndarray::Axis;
use param_classic::{Rule, side_parameters};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::bidgcn::cloud::Cloud;
use crate::error::NnError;
use crate::synthetic::{ControlPoints, ScatteredSpec};

/// Share of the control points of §4.2.6, the flatter ones; the others are those of §4.3.4.
const GREVILLE_SHARE: f64 = 0.2;

/// Shares of the degrees from 2 on.
const DEGREE_SHARES: [f64; 4] = [0.55, 0.2, 0.15, 0.1];

/// Share of clouds with noise, and its smallest and largest standard deviation, in logarithmic measure.
const NOISY_SHARE: f64 = 0.3;
const NOISE: [f64; 2] = [1e-3, 3e-2];

/// Share of clouds of uneven density, and the largest unevenness.
const UNEVEN_SHARE: f64 = 0.25;
const UNEVENNESS: f64 = 0.7;

/// Share of clouds whose boundary gets parameters by chord length in place of the true ones, as measured clouds do.
const CHORD_SHARE: f64 = 0.15;

/// A training cloud and the degree of its patch. `sizes` are the interior points of the smallest and the largest cloud; their
/// logarithm is evenly distributed.
pub(super) fn draw(sizes: [f64; 2], random: &mut ChaCha8Rng) -> Result<(Cloud, usize), NnError> {
    let mut chance = |share: f64| random.random::<f64>() < share;
    let greville = chance(GREVILLE_SHARE);
    let (noisy, uneven, chord) = (chance(NOISY_SHARE), chance(UNEVEN_SHARE), chance(CHORD_SHARE));
    let mut logarithmic = |[low, high]: [f64; 2]| low * (high / low).powf(random.random::<f64>());
    let interior = logarithmic(sizes).round() as usize;
    let deviation = logarithmic(NOISE);
    let mut place: f64 = random.random();
    let degree = 2 + DEGREE_SHARES
        .iter()
        .take_while(|share| {
            place -= **share;
            place >= 0.0
        })
        .count()
        .min(DEGREE_SHARES.len() - 1);
    let unevenness = if uneven { UNEVENNESS } else { 0.0 };
    let spec = ScatteredSpec {
        control_points: if greville { ControlPoints::Greville } else { ControlPoints::Jittered },
        degree,
        interior,
        noise: if noisy { deviation } else { 0.0 },
    };
    let sample = spec.sample_unevenly([0; 2].map(|_| unevenness * (2.0 * random.random::<f64>() - 1.0)), random)?;
    let mut cloud = Cloud::of_sample(&sample);
    if chord {
        let rows: Vec<usize> = (interior..cloud.xyz.len()).collect();
        let side = rows.len() / 4;
        let outline = sample.points.select(Axis(0), &rows);
        // Two equal points would be an error; the true parameters then stay.
        if let Ok(parameters) = side_parameters(outline.view(), [0, side, 2 * side, 3 * side], Rule::ChordLength) {
            for (uv, given) in cloud.uv[interior..].iter_mut().zip(parameters.rows()) {
                *uv = [given[0], given[1]];
            }
        }
    }
    Ok((cloud, degree))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::stream;

    #[test]
    fn all_kinds_are_drawn() {
        let drawn: Vec<(Cloud, usize)> = (0..200).map(|k| draw([200.0, 2000.0], &mut stream(0, k)).unwrap()).collect();
        for degree in 2..=5 {
            assert!(drawn.iter().any(|(_, d)| *d == degree), "no degree {degree}");
        }
        let sizes: Vec<usize> = drawn.iter().map(|(cloud, _)| cloud.interior).collect();
        assert!(sizes.iter().all(|n| (200..=2000).contains(n)));
        assert!(sizes.iter().any(|n| *n < 300) && sizes.iter().any(|n| *n > 1500));
        for (cloud, _) in &drawn {
            assert!(cloud.boundary_uv().iter().all(|uv| uv.iter().any(|&x| x == 0.0 || x == 1.0)));
        }
    }
}
