//! A network asked beside a classical map, and the better of the two kept.

use std::sync::Arc;

use fit_ls::{Lambda, LeastSquares, Options};
use ndarray::{Array2, ArrayView2, Axis};
use param_classic::{
    BOUNDARY_TOLERANCE, BoundaryParameters, InjectiveParams, cloud_quality, map_quality, refine_injective,
};
use point_cloud::spread_subset;
use thb_core::{HierarchicalSpace, Kind, KnotVector, SplineMap};

use super::layout::{Layout, NetworkReport};
use super::network;
use crate::Error;

/// A network that is asked.
struct Network {
    name: &'static str,
    /// The name of the method where its parameters are taken.
    guarded: &'static str,
    /// Parameters of a cloud whose boundary has some.
    suggest: fn(ArrayView2<'_, f64>, &BoundaryParameters) -> Result<Array2<f64>, Error>,
    /// Points that it is given at once.
    largest: usize,
}

const NETWORKS: &[Network] = &[
    Network { name: "bidgcn", guarded: "bidgcn, guarded", suggest: network::of_cloud, largest: network::LARGEST },
    Network {
        name: "pargcn",
        guarded: "pargcn, guarded",
        suggest: network::by_learned_weights,
        largest: network::LARGEST_WEIGHTED,
    },
];

/// Elements per direction, and degree, of the map of the square that carries the network's suggestion to all points: it
/// follows what a network says of the shape, and not its noise from point to point.
const REMAP_ELEMENTS: usize = 8;
const REMAP_DEGREE: usize = 3;

/// Smoothing weights, for each point.
const REMAP_SMOOTHING: f64 = 1e-6;
const FIT_SMOOTHING: f64 = 1e-7;

/// Shares of the way to the network's parameters that are tried; a shorter way folds less.
const SHARES: [f64; 3] = [1.0, 0.5, 0.25];

/// Degree and most elements per direction of the finer quick fit; the coarser one has half as many. Fewer where there are not
/// [`POINTS_PER_FUNCTION`], so that a fit does not hide what parameters are worth.
const FIT_DEGREE: usize = 2;
const FIT_ELEMENTS: usize = 32;
const POINTS_PER_FUNCTION: usize = 8;

/// The error of the finer fit must fall at least to this share, and that of the coarser one must not grow. A coarse fit alone
/// says nothing of fine tolerances, and gains of a few percent in a quick fit say nothing of an adaptive one.
const GAIN: f64 = 0.9;

/// A candidate whose error is within this factor of the classical one is refined (see [`refine_injective`]) and tried once more.
const NEAR: f64 = 1.1;

/// The largest void may grow by this factor.
const VOID_GROWTH: f64 = 1.25;

/// Parameters that may replace the classical ones.
struct Candidate {
    network: &'static Network,
    share: f64,
    refined: bool,
    parameters: Array2<f64>,
    errors: [f64; 2],
}

/// The classical map that candidates are compared with.
struct Rival<'a> {
    layout: &'a Layout,
    elements: usize,
    errors: [f64; 2],
    folded: usize,
}

impl Layout {
    /// Asks the networks, and takes the best of their parameters if it folds no more triangles, leaves no larger void and
    /// fits better.
    pub(super) fn ask_networks(&mut self) -> NetworkReport {
        let mut report = NetworkReport {
            taken: false,
            reason: String::new(),
            network: None,
            share: None,
            classical_error: None,
            error: None,
        };
        match self.best_candidate(&mut report) {
            Ok(Some(best)) => {
                self.parameters = best.parameters;
                (self.refined, self.method) = (best.refined, best.network.guarded);
                report.taken = true;
            }
            Ok(None) => {}
            Err(reason) => report.reason = format!("parameters could not be compared: {reason}"),
        }
        tracing::info!(taken = report.taken, reason = report.reason, "asked the networks");
        report
    }

    /// The candidate to take, if there is one; the report gets what was compared and why.
    fn best_candidate(&self, report: &mut NetworkReport) -> Result<Option<Candidate>, Error> {
        let points = self.points.view();
        let elements = fit_elements(points.nrows());
        if elements < 2 {
            report.reason = format!("{} points are too few to compare parameters on", points.nrows());
            return Ok(None);
        }
        let errors = quick_errors(points, &self.parameters, elements)?;
        let rival = Rival { layout: self, elements, errors, folded: self.folded(&self.parameters)? };
        report.classical_error = Some(errors);
        let (mut best, mut fewest, mut failed) = (None, usize::MAX, None);
        for network in NETWORKS {
            match rival.beaten_by(network, &mut fewest) {
                Ok(Some(candidate)) if is_better(&candidate, best.as_ref()) => best = Some(candidate),
                Ok(_) => {}
                Err(reason) => failed = Some(format!("{} gave no parameters: {reason}", network.name)),
            }
        }
        let Some(best) = best else {
            let folds = format!("{fewest} triangles or more are folded, {} by the classical map", rival.folded);
            report.reason = failed.filter(|_| fewest == usize::MAX).unwrap_or(folds);
            return Ok(None);
        };
        (report.network, report.share, report.error) = (Some(best.network.name), Some(best.share), Some(best.errors));
        let (half, [before_coarse, before], [after_coarse, after]) = (elements / 2, errors, best.errors);
        report.reason = format!(
            "quick fits of {half} × {half} and {elements} × {elements} elements leave {after_coarse:.3e} and {after:.3e}; with \
             the classical map {before_coarse:.3e} and {before:.3e}"
        );
        if after_coarse > before_coarse || after > GAIN * before {
            return Ok(None);
        }
        let void = |parameters: &Array2<f64>| cloud_quality(points, parameters.view()).map(|q| q.largest_void.radius);
        let voids = [void(&self.parameters)?, void(&best.parameters)?];
        if voids[1] > VOID_GROWTH * voids[0] {
            report.reason =
                format!("a void of radius {:.3} is left, one of {:.3} by the classical map", voids[1], voids[0]);
            return Ok(None);
        }
        Ok(Some(best))
    }

    fn folded(&self, parameters: &Array2<f64>) -> Result<usize, Error> {
        Ok(map_quality(self.points.view(), &self.triangles, parameters.view())?.folded.len())
    }

    /// Parameters of some points, rows of them increasing, by a network that is given those on the boundary of the square.
    fn suggested(&self, network: &Network, rows: &[usize]) -> Result<Array2<f64>, Error> {
        let part = self.points.select(Axis(0), rows);
        let before = self.parameters.select(Axis(0), rows);
        let fixed: Vec<usize> = (0..rows.len()).filter(|&i| is_on_boundary(before.view(), i)).collect();
        let boundary = BoundaryParameters {
            points: fixed.iter().map(|&i| i as u32).collect(),
            parameters: before.select(Axis(0), &fixed),
        };
        (network.suggest)(part.view(), &boundary)
    }

    /// The network's parameters of a well-spread part of the points, carried to all by a smooth map of the square that takes
    /// the classical parameters to them. Points on the boundary stay.
    fn remapped(&self, network: &Network) -> Result<Array2<f64>, Error> {
        let m = self.points.nrows();
        let mut rows: Vec<usize> = match m > network::LARGEST {
            true => spread_subset(self.points.view(), network::LARGEST)?.iter().map(|&row| row as usize).collect(),
            false => (0..m).collect(),
        };
        rows.extend(self.corners.iter().flatten().map(|&corner| corner as usize));
        rows.sort_unstable();
        rows.dedup();
        let before = self.parameters.select(Axis(0), &rows);
        let suggested = self.suggested(network, &rows)?;
        let space = space(REMAP_DEGREE, REMAP_ELEMENTS)?;
        let mut fit = LeastSquares::new(before.view(), suggested.view(), None, smoothed(REMAP_SMOOTHING, rows.len()))?;
        let mut all = fit.fit(&space)?.eval_batch(self.parameters.view())?;
        for i in 0..m {
            match is_on_boundary(self.parameters.view(), i) {
                true => all.row_mut(i).assign(&self.parameters.row(i)),
                false => all.row_mut(i).mapv_inplace(|x| x.clamp(0.0, 1.0)),
            }
        }
        Ok(all)
    }
}

impl Rival<'_> {
    /// The best candidate of a network among those that fold no more triangles; `fewest` is brought up to date.
    fn beaten_by(&self, network: &'static Network, fewest: &mut usize) -> Result<Option<Candidate>, Error> {
        let (layout, mut best) = (self.layout, None);
        let mut ways = vec![layout.remapped(network)?];
        let all: Vec<usize> = (0..layout.points.nrows()).collect();
        // As they are, a network's parameters fold here and there: of use where the classical map has folds too.
        if self.folded > 0 && all.len() <= network.largest {
            ways.push(layout.suggested(network, &all)?);
        }
        for (to, share) in ways.iter().flat_map(|to| SHARES.map(|share| (to, share))) {
            let parameters = &layout.parameters + &((to - &layout.parameters) * share);
            let candidate = self.candidate(network, share, false, parameters, fewest)?;
            best = [best, candidate].into_iter().flatten().reduce(better);
        }
        // Refinement takes seconds for large clouds, so only what is near gets it.
        if let Some(first) = best.take_if(|best| self.folded == 0 && best.errors[1] < NEAR * self.errors[1]) {
            let params = InjectiveParams { slide: false, ..InjectiveParams::default() };
            let refined =
                refine_injective(layout.points.view(), &layout.triangles, first.parameters.view(), &params)?.parameters;
            let refined = self.candidate(network, first.share, true, refined, fewest)?;
            best = [Some(first), refined].into_iter().flatten().reduce(better);
        }
        Ok(best)
    }

    fn candidate(
        &self,
        network: &'static Network,
        share: f64,
        refined: bool,
        parameters: Array2<f64>,
        fewest: &mut usize,
    ) -> Result<Option<Candidate>, Error> {
        let folded = self.layout.folded(&parameters)?;
        *fewest = folded.min(*fewest);
        if folded > self.folded {
            return Ok(None);
        }
        let errors = quick_errors(self.layout.points.view(), &parameters, self.elements)?;
        Ok(Some(Candidate { network, share, refined, parameters, errors }))
    }
}

fn is_better(candidate: &Candidate, best: Option<&Candidate>) -> bool {
    best.is_none_or(|best| candidate.errors[1] < best.errors[1])
}

fn better(first: Candidate, second: Candidate) -> Candidate {
    if is_better(&second, Some(&first)) { second } else { first }
}

fn is_on_boundary(parameters: ArrayView2<'_, f64>, i: usize) -> bool {
    parameters.row(i).iter().any(|&x| x.min(1.0 - x) <= BOUNDARY_TOLERANCE)
}

/// Elements per direction of the finer quick fit.
fn fit_elements(points: usize) -> usize {
    let functions = ((points / POINTS_PER_FUNCTION) as f64).sqrt() as usize;
    functions.saturating_sub(FIT_DEGREE).min(FIT_ELEMENTS)
}

fn space(degree: usize, elements: usize) -> Result<Arc<HierarchicalSpace<2>>, Error> {
    let knots = KnotVector::uniform(degree, elements)?;
    Ok(Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?))
}

fn smoothed(weight: f64, points: usize) -> Options<2> {
    Options { lambda: Lambda::Fixed(weight * points as f64), ..Options::default() }
}

/// Root mean square errors of a coarse and a fine fit.
fn quick_errors(points: ArrayView2<'_, f64>, parameters: &Array2<f64>, elements: usize) -> Result<[f64; 2], Error> {
    let mut fit = LeastSquares::new(parameters.view(), points, None, smoothed(FIT_SMOOTHING, points.nrows()))?;
    let mut error = |elements: usize| -> Result<f64, Error> {
        let map: SplineMap<2> = fit.fit(&space(FIT_DEGREE, elements)?)?;
        let squared: f64 = fit.distances(&map)?.iter().map(|d| d * d).sum();
        Ok((squared / points.nrows() as f64).sqrt())
    };
    Ok([error(elements / 2)?, error(elements)?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use param_classic::{CloudMapParams, CloudWeights, map_cloud, triangulate_parameters};
    use param_nn::{ControlPoints, ScatteredSpec, stream};

    /// A layout of a random patch with its true boundary parameters by a classical map.
    fn layout(weights: CloudWeights, degree: usize) -> Layout {
        let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree, interior: 600, noise: 0.0 };
        let cloud = spec.sample(&mut stream(3, 1)).unwrap();
        let boundary: Vec<usize> = (600..cloud.points.nrows()).collect();
        let fixed = BoundaryParameters {
            points: boundary.iter().map(|&row| row as u32).collect(),
            parameters: cloud.parameters.select(Axis(0), &boundary),
        };
        let params = CloudMapParams { weights, ..CloudMapParams::default() };
        let parameters = map_cloud(cloud.points.view(), &fixed, &params).unwrap().parameters;
        let triangles = triangulate_parameters(cloud.parameters.view()).unwrap();
        Layout { points: cloud.points, parameters, triangles, method: "classical", ..Layout::default() }
    }

    #[test]
    fn better_parameters_are_taken_and_fold_no_more() {
        let mut layout = layout(CloudWeights::Uniform, 2);
        let (before, fixed) = (layout.parameters.clone(), layout.folded(&layout.parameters).unwrap());
        let report = layout.ask_networks();
        assert!(report.taken && layout.method.ends_with("guarded"), "{report:?}");
        let (error, classical) = (report.error.unwrap(), report.classical_error.unwrap());
        assert!(error[0] <= classical[0] && error[1] <= GAIN * classical[1], "{report:?}");
        assert!(layout.folded(&layout.parameters).unwrap() <= fixed);
        for i in (0..before.nrows()).filter(|&i| is_on_boundary(before.view(), i)) {
            assert_eq!(layout.parameters.row(i), before.row(i));
        }
        assert!(layout.parameters.iter().all(|x| (0.0..=1.0).contains(x)));
    }

    #[test]
    fn the_true_parameters_are_kept() {
        let mut layout = layout(CloudWeights::LocalProjection, 1);
        // A bilinear patch at its own parameters is fitted without error: nothing can be better.
        let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree: 1, interior: 600, noise: 0.0 };
        layout.parameters = spec.sample(&mut stream(3, 1)).unwrap().parameters;
        let before = layout.parameters.clone();
        let report = layout.ask_networks();
        assert!(!report.taken && !report.reason.is_empty(), "{report:?}");
        assert_eq!((layout.parameters, layout.method), (before, "classical"));
    }

    #[test]
    fn few_points_are_not_compared() {
        let mut layout = layout(CloudWeights::LocalProjection, 2);
        layout.points = layout.points.select(Axis(0), &(0..40).collect::<Vec<_>>());
        layout.parameters = layout.parameters.select(Axis(0), &(0..40).collect::<Vec<_>>());
        let report = layout.ask_networks();
        assert!(!report.taken && report.reason.contains("too few"), "{report:?}");
    }
}
