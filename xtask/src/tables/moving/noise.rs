//! Parameters that move point by point, and parameters that one smooth map moves, on a planted surface with noise.

use anyhow::Result;
use moving_param::{Blend, Distance, JointOptions, Method, SquareMapOptions};
use ndarray::Array2;
use point_cloud::BoundingBox;
use rand::RngExt;
use std::sync::Arc;
use thb_core::{ClosestPoints, HierarchicalSpace, Kind, KnotVector, SplineMap};

use super::super::markdown::{figure, table};
use super::run::{Cloud, Run, Settings};

/// Seed of surface, parameters and noise; its number means nothing.
const SEED: u64 = 54;

/// Points per direction.
const SIDE: usize = 60;

/// Standard deviations of the noise of each coordinate, as shares of the diagonal.
const NOISE: [f64; 3] = [0.0, 1e-3, 1e-2];

/// Elements of the planted surface, and of the one that is fitted: it could follow far more than is there.
const ELEMENTS: [usize; 2] = [8, 16];

/// How far the map that spoils the parameters moves its control points across, at most.
const WARP: f64 = 0.16;

/// Tolerance where there is no noise, as a share of the diagonal.
const EXACT: f64 = 1e-5;

/// The map of the square with `per_side`² control points.
pub(super) fn by_map(per_side: usize) -> Method {
    Method::SquareMap(SquareMapOptions { per_side, ..SquareMapOptions::default() })
}

/// Points of a planted surface without noise, at exact parameters, and the parameters that methods start from.
struct Planted {
    clean: Array2<f64>,
    exact: Array2<f64>,
    start: Array2<f64>,
    diagonal: f64,
}

impl Planted {
    fn new() -> Result<Self> {
        let mut random = param_nn::stream(SEED, 0);
        let spline =
            |degree, elements, mut control_point: Box<dyn FnMut(f64, f64) -> Vec<f64>>| -> Result<SplineMap<2>> {
                let knots = KnotVector::uniform(degree, elements)?;
                let sites = knots.greville();
                let n = sites.len();
                let rows: Vec<Vec<f64>> = (0..n * n).map(|j| control_point(sites[j % n], sites[j / n])).collect();
                let coefficients = Array2::from_shape_fn((n * n, rows[0].len()), |(j, k)| rows[j][k]);
                Ok(SplineMap::new(Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?), coefficients)?)
            };
        let heights: Vec<f64> = (0..(ELEMENTS[0] + 2).pow(2)).map(|_| 0.4 * random.random::<f64>()).collect();
        let shifts: Vec<f64> = (0..2 * 36).map(|_| WARP * (random.random::<f64>() - 0.5)).collect();
        let mut next = heights.into_iter();
        let sheet = spline(2, ELEMENTS[0], Box::new(move |u, v| vec![u, v, next.next().unwrap_or(0.0)]))?;
        let mut next = shifts.into_iter();
        let mut shifted = move |u: f64| u + if u > 0.0 && u < 1.0 { next.next().unwrap_or(0.0) } else { 0.0 };
        let warp = spline(3, 3, Box::new(move |u, v| vec![shifted(u), shifted(v)]))?;
        let start =
            Array2::from_shape_fn((SIDE * SIDE, 2), |(i, d)| [i % SIDE, i / SIDE][d] as f64 / (SIDE - 1) as f64);
        // Round-off leaves the square.
        let exact = warp.eval_batch(start.view())?.mapv(|u| u.clamp(0.0, 1.0));
        let clean = sheet.eval_batch(exact.view())?;
        let diagonal = BoundingBox::of(clean.view())?.diagonal();
        Ok(Self { clean, exact, start, diagonal })
    }

    fn noisy(&self, sigma: f64) -> Array2<f64> {
        let mut random = param_nn::stream(SEED, 1);
        // The method of Box and Muller.
        let mut normal = || {
            let (radius, angle): (f64, f64) = (random.random(), random.random());
            (-2.0 * (1.0 - radius).ln()).sqrt() * (std::f64::consts::TAU * angle).cos()
        };
        self.clean.mapv(|x| x + sigma * normal())
    }

    /// Root mean square and largest distance of the points without noise to a surface.
    fn errors(&self, map: &SplineMap<2>) -> Result<[f64; 2]> {
        let closest = ClosestPoints::new(map.bezier().clone())?;
        let distances: Vec<f64> =
            self.clean.outer_iter().map(|p| closest.closest(&[p[0], p[1], p[2]]).distance).collect();
        let mse = distances.iter().map(|d| d * d).sum::<f64>() / distances.len() as f64;
        Ok([mse.sqrt(), distances.iter().copied().fold(0.0, f64::max)])
    }
}

/// The section.
pub(super) fn section(log: &mut dyn FnMut(&str)) -> Result<String> {
    let planted = Planted::new()?;
    let alternating = |distance| Some(Method::Alternating { distance, corrections: 10 });
    let methods = [
        ("exact parameters, fixed", None),
        ("fixed", None),
        ("A-PDM, 10", alternating(Distance::Point)),
        ("A-HDM, 10, γ = 1e-2", alternating(Distance::Hybrid(Blend::Constant(1e-2)))),
        ("joint, plain", Some(Method::Joint(JointOptions::WITHOUT_SPRINGS))),
        ("joint, as shipped", Some(Method::Joint(JointOptions::DEFAULT))),
        ("map, 6 × 6", Some(by_map(6))),
        ("map, 8 × 8", Some(by_map(8))),
        ("map, 10 × 10", Some(by_map(10))),
    ];
    let mut rows = Vec::new();
    for share in NOISE {
        log(&format!("noise {share}"));
        let sigma = share * planted.diagonal;
        let points = planted.noisy(sigma);
        for (name, method) in &methods {
            let parameters = if name.starts_with("exact") { &planted.exact } else { &planted.start };
            let cloud = Cloud { points: points.clone(), parameters: parameters.clone() };
            let tolerance = sigma.max(EXACT * planted.diagonal);
            let settings = Settings { max_iterations: 1, ..Settings::published([ELEMENTS[1]; 2], tolerance) };
            let run = Run::of(name, &cloud, method.clone(), &settings)?;
            let [rms, max] = planted.errors(&run.map)?.map(|e| e / planted.diagonal);
            rows.push(vec![
                format!("{} %", 100.0 * share),
                (*name).into(),
                figure(run.deviation().rmse() / planted.diagonal),
                figure(rms),
                figure(max),
                format!("{:.4}", run.creases),
                format!("{:.2}", run.seconds),
            ]);
        }
    }
    let header = ["noise", "method", "RMS to noisy points", "RMS, clean", "MAX, clean", "creases", "CPU-s"];
    Ok(format!("{TEXT}{}", table(&header, &rows)))
}

const TEXT: &str = "
## One smooth map instead of parameters point by point

A planted biquadratic surface of 8 × 8 elements, 60 × 60 points; methods start from parameters that a smooth map of the square has spoiled
(bicubic, 6 × 6 control points moved by up to 0.08), so the exact ones are within reach of the maps. Normal noise on all three
coordinates, its standard deviation in percent of the diagonal. One space for all, 16 × 16 biquadratic elements, λ = 1e-7, no refinement,
no guard; steps or corrections end at a tolerance of one standard deviation, without noise of 1e-5 diagonals.
*RMS to noisy points* is what a fit sees; *clean* are the distances of the points without noise to the surface, in diagonals: those are what
matters. *As shipped* is what `thb fit --method joint` does.

";
