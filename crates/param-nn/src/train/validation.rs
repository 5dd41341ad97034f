//! Fixed clouds on which networks are compared with LPSP.

use ndarray::Array2;
use param_classic::{BoundaryParameters, CloudMapParams, Radius, map_cloud};

use super::PUBLISHED as BIDGCN_CLOUDS;
use super::pargcn::PUBLISHED as PARGCN_CLOUDS;
use crate::bezier::BezierFit;
use crate::bidgcn::Bidgcn;
use crate::bidgcn::cloud::Cloud;
use crate::error::NnError;
use crate::pargcn::{Pargcn, PargcnOptions};
use crate::synthetic::{ControlPoints, ScatteredSpec, stream};

/// A kind of clouds: a name, control points, interior points, noise. Biquadratic patches.
type Kind = (&'static str, ControlPoints, usize, f64);

const KINDS: [Kind; 5] = [
    ("200", ControlPoints::Jittered, 200, 0.0),
    ("500", ControlPoints::Jittered, 500, 0.0),
    ("1000", ControlPoints::Jittered, 1000, 0.0),
    ("2000", ControlPoints::Jittered, 2000, 0.0),
    ("1000, noise", ControlPoints::Jittered, 1000, 1e-2),
];

/// Smaller ones, of the family of §4.2.6 too.
const SMALL_KINDS: [Kind; 5] = [
    ("100", ControlPoints::Jittered, 100, 0.0),
    ("200", ControlPoints::Jittered, 200, 0.0),
    ("500", ControlPoints::Jittered, 500, 0.0),
    ("200, heights", ControlPoints::Greville, 200, 0.0),
    ("200, heights, noise", ControlPoints::Greville, 200, 1e-2),
];

/// Degree of the patches.
const DEGREE: usize = 2;

/// Fixed clouds, and what LPSP makes of them.
#[derive(Clone, Debug)]
pub struct Validation {
    kinds: Vec<(&'static str, Vec<Cloud>, f64)>,
}

/// Means over the clouds of a kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Interior points and noise.
    pub kind: &'static str,
    /// Mean squared distance of the network's biquadratic fit, the three coordinates summed.
    pub mse: f64,
    /// The same for LPSP with radius 3/√m, grown where needed.
    pub lpsp: f64,
    /// Root mean square of the distance of interior parameters from the true ones; 0.3 and more is a folded map.
    pub parameter_error: f64,
}

impl Validation {
    /// `count` clouds of each kind, of 200 to 2000 interior points.
    ///
    /// # Errors
    /// Those of the classical map.
    pub fn new(seed: u64, count: u64) -> Result<Self, NnError> {
        Self::of_kinds(KINDS, seed, count)
    }

    /// `count` clouds of each kind, of 100 to 500 interior points.
    ///
    /// # Errors
    /// Those of the classical map.
    pub fn small(seed: u64, count: u64) -> Result<Self, NnError> {
        Self::of_kinds(SMALL_KINDS, seed, count)
    }

    /// Clouds as BIDGCN was published to be trained on (Imperatore 2024, §4.3.4).
    ///
    /// # Errors
    /// Those of the classical map.
    pub fn published_bidgcn(seed: u64, count: u64) -> Result<Self, NnError> {
        let ScatteredSpec { control_points, interior, noise, .. } = BIDGCN_CLOUDS;
        Self::of_kinds([("1000", control_points, interior, noise)], seed, count)
    }

    /// Clouds as PARGCN was published to be trained on (Imperatore 2024, §4.2.6).
    ///
    /// # Errors
    /// Those of the classical map.
    pub fn published_pargcn(seed: u64, count: u64) -> Result<Self, NnError> {
        let ScatteredSpec { control_points, interior, noise, .. } = PARGCN_CLOUDS;
        Self::of_kinds([("200 heights", control_points, interior, noise)], seed, count)
    }

    fn of_kinds<const N: usize>(of: [Kind; N], seed: u64, count: u64) -> Result<Self, NnError> {
        let mut kinds = Vec::new();
        for (k, (name, control_points, interior, noise)) in of.into_iter().enumerate() {
            let spec = ScatteredSpec { control_points, degree: DEGREE, interior, noise };
            let (mut clouds, mut lpsp) = (Vec::new(), 0.0);
            for index in 0..count {
                let sample = spec.sample(&mut stream(seed, count * k as u64 + index))?;
                let cloud = Cloud::of_sample(&sample);
                let boundary = BoundaryParameters {
                    points: (interior as u32..cloud.xyz.len() as u32).collect(),
                    parameters: Array2::from_shape_fn((cloud.xyz.len() - interior, 2), |(i, k)| {
                        cloud.uv[interior + i][k]
                    }),
                };
                let params = CloudMapParams { radius: Radius::Grown, ..CloudMapParams::default() };
                let map = map_cloud(sample.points.view(), &boundary, &params)?;
                lpsp += BezierFit::new(map.parameters.view(), sample.points.view(), DEGREE)?.mse / count as f64;
                clouds.push(cloud);
            }
            kinds.push((name, clouds, lpsp));
        }
        Ok(Self { kinds })
    }

    /// Scores of a network, one a kind.
    pub fn scores(&self, network: &Bidgcn) -> Vec<Score> {
        self.scores_of(|cloud| network.interior_parameters(cloud))
    }

    /// Scores of a network that gives weights, one a kind; without the correction. A cloud that it cannot map makes
    /// the mean no number.
    pub fn pargcn_scores(&self, network: &Pargcn) -> Vec<Score> {
        let options = PargcnOptions::default();
        let failed = |cloud: &Cloud| vec![[f64::NAN; 2]; cloud.interior];
        self.scores_of(|cloud| network.interior_parameters(cloud, &options).unwrap_or_else(|_| failed(cloud)))
    }

    fn scores_of(&self, interior_parameters: impl Fn(&Cloud) -> Vec<[f64; 2]>) -> Vec<Score> {
        let one = |(kind, clouds, lpsp): &(&'static str, Vec<Cloud>, f64)| {
            let (mut mse, mut squared) = (0.0, 0.0);
            for cloud in clouds {
                let mut uv = interior_parameters(cloud);
                let distance = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
                squared += uv.iter().zip(&cloud.uv).map(distance).sum::<f64>() / cloud.interior as f64;
                uv.extend_from_slice(cloud.boundary_uv());
                mse += BezierFit::solve(&uv, &cloud.xyz, DEGREE).mse;
            }
            let count = clouds.len().max(1) as f64;
            Score { kind, mse: mse / count, lpsp: *lpsp, parameter_error: (squared / count).sqrt() }
        };
        self.kinds.iter().map(one).collect()
    }
}
