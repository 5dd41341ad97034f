//! Weights that follow the errors: outliers, markers, and the rules for the smoothing weight. Figure 3.7 of Imperatore 2024 and
//! what its §3.1.7–3.1.9 and example 5.2.2 (e) claim, on data that are public or generated.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use adaptive::{Iteration, Outcome, run};
use anyhow::{Context, Result};
use fit_ls::{
    Detection, Lambda, LeastSquares, Loss, MarkerRules, Markers, Options, Reweighted, Reweighting, Robust,
    detect_markers,
};
use ndarray::{Array2, ArrayView1};
use point_cloud::BoundingBox;
use rand::RngExt;
use reconstruct::{ParameterOptions, parameterize_file};
use thb_core::{HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap};

use super::crossings;
use super::markdown::{figure, table};
use crate::generate::surface::{self, Layout};
use crate::generate::{Noise, Sample};
use crate::process::Clock;

/// Seed of the outliers; its number means nothing.
const SEED: u64 = 39;

/// Share of the points that become outliers.
const SHARE: f64 = 0.2;

/// Least and largest distance of an outlier from its place, as shares of the diagonal.
const GROSS: [f64; 2] = [0.02, 0.3];

/// Points of a generated cloud.
const POINTS: usize = 20_000;

/// Points of a noisy one.
const NOISY: usize = 8000;

/// Most levels of the fits.
const LEVELS: usize = 6;

/// Fits that are timed together: one alone takes less than the clock can tell.
const REPEATED: usize = 20;

/// The generated surfaces.
const SURFACES: [(&str, surface::Kind); 4] = [
    ("function (3.13)", surface::Kind::Peaks),
    ("car bonnet", surface::Kind::Bonnet),
    ("turbine blade", surface::Kind::Blade),
    ("Wigley's hull", surface::Kind::Wigley),
];

/// Clouds of the data folder: name, file.
const FILES: [(&str, &str); 2] =
    [("`nefertiti_up`", "thesis/nefertiti_up.xml"), ("`nefertiti_head_8933`", "nefertiti_head_8933.obj")];

/// Points with parameters in the unit square, scaled by the diagonal of their box.
struct Cloud {
    points: Array2<f64>,
    parameters: Array2<f64>,
}

impl Cloud {
    fn of(points: Array2<f64>, parameters: Array2<f64>) -> Result<Self> {
        let points = &points / BoundingBox::of(points.view())?.diagonal();
        Ok(Self { points, parameters })
    }

    fn generated(kind: surface::Kind, count: usize, layout: Layout) -> Result<Self> {
        let sample = Sample { kind, layout, points: count, noise: Noise::Absolute(0.0), seed: SEED };
        let cloud = sample.cloud()?;
        let points = Array2::from_shape_fn((count, 3), |(i, k)| cloud.points[i][k]);
        Self::of(points, Array2::from_shape_fn((count, 2), |(i, d)| cloud.parameters[i][d]))
    }

    fn read(path: &Path) -> Result<Self> {
        let laid_out = parameterize_file(path, &ParameterOptions::default(), &mut |_| ControlFlow::Continue(()))
            .with_context(|| format!("cannot lay out {}", path.display()))?;
        Self::of(laid_out.points, laid_out.parameters)
    }

    /// The generated clouds, and those of the folder.
    fn all(data: Option<&Path>) -> Result<Vec<(&'static str, Self)>> {
        let mut clouds = Vec::new();
        for (name, kind) in SURFACES {
            clouds.push((name, Self::generated(kind, POINTS, kind.layout())?));
        }
        for (name, file) in FILES.iter().filter(|_| data.is_some()) {
            clouds.push((name, Self::read(&data.unwrap_or(Path::new("")).join(file))?));
        }
        Ok(clouds)
    }

    /// The same parameters with outliers in random directions, or all of them towards the third coordinate; and which they
    /// are.
    fn with_outliers(&self, one_sided: bool) -> (Array2<f64>, Vec<bool>) {
        let mut random = param_nn::stream(SEED, u64::from(one_sided));
        let mut points = self.points.clone();
        let flags: Vec<bool> = (0..points.nrows()).map(|_| random.random::<f64>() < SHARE).collect();
        for (mut row, _) in points.outer_iter_mut().zip(&flags).filter(|(_, flag)| **flag) {
            let size = GROSS[0] + (GROSS[1] - GROSS[0]) * random.random::<f64>();
            // A direction by its height and angle.
            let (height, angle) = (2.0 * random.random::<f64>() - 1.0, std::f64::consts::TAU * random.random::<f64>());
            let across = (1.0 - height * height).sqrt();
            let direction =
                if one_sided { [0.0, 0.0, 1.0] } else { [across * angle.cos(), across * angle.sin(), height] };
            (0..3).for_each(|k| row[k] += size * direction[k]);
        }
        (points, flags)
    }
}

/// What came of a fit.
struct Figures {
    map: SplineMap<2>,
    dofs: usize,
    history: Vec<Iteration>,
    seconds: f64,
    gross: Vec<bool>,
}

impl Figures {
    /// Root mean squared and largest error to points `(m, 3)`, over those that are flagged or not.
    fn errors(&self, parameters: &Array2<f64>, points: &Array2<f64>, flags: &[bool], flag: bool) -> Result<[f64; 2]> {
        let image = self.map.eval_batch(parameters.view())?;
        let distance = |a: ArrayView1<'_, f64>, b: ArrayView1<'_, f64>| (&a - &b).mapv(|x| x * x).sum();
        let squares: Vec<f64> =
            (0..flags.len()).filter(|&i| flags[i] == flag).map(|i| distance(image.row(i), points.row(i))).collect();
        let largest = squares.iter().copied().fold(0.0, f64::max);
        Ok([(squares.iter().sum::<f64>() / squares.len() as f64).sqrt(), largest.sqrt()])
    }
}

/// Settings of the adaptive fits.
#[derive(Clone, Copy)]
struct Settings {
    elements: usize,
    lambda: Lambda,
    tolerance: f64,
    within: f64,
}

fn fit(parameters: &Array2<f64>, points: &Array2<f64>, rules: &Reweighting, settings: Settings) -> Result<Figures> {
    let Settings { elements, lambda, tolerance, within } = settings;
    let options = Options { lambda, ..Options::default() };
    let clock = Clock::start();
    let mut method = Reweighted::<2>::new(parameters.view(), points.view(), None, options, rules)?;
    let limits = adaptive::Options {
        tolerance,
        within,
        refinement: Refinement { extension: [2; 2], max_levels: LEVELS, ..Refinement::default() },
        max_dofs: points.nrows(),
        ..adaptive::Options::default()
    };
    let mut observer = |_: &Iteration| ControlFlow::Continue(());
    let Outcome { map, history, .. } = run(&mut method, uniform(elements)?, &limits, &mut observer)?;
    let dofs = history.last().map_or(0, |last| last.dofs);
    Ok(Figures { map, dofs, history, seconds: clock.seconds(), gross: method.weights().gross().to_vec() })
}

fn uniform(elements: usize) -> Result<Arc<HierarchicalSpace<2>>> {
    let knots = KnotVector::uniform(3, elements)?;
    Ok(Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?))
}

/// The document; `data` is a folder with the clouds.
///
/// # Errors
/// What reading, laying out and fitting meet.
pub fn document(data: Option<&Path>) -> Result<String> {
    let mut text = String::from(INTRODUCTION);
    if data.is_none() {
        text += "\nMeasured clouds are left out: `--data DIR` was not given.\n";
    }
    let clouds = Cloud::all(data)?;
    outliers(&clouds, &mut text)?;
    patches(&clouds, &mut text)?;
    sharp_features(&mut text)?;
    smoothing(&mut text)?;
    if data.is_some() {
        text += CONCLUSIONS;
    }
    Ok(text)
}

/// A fifth of gross outliers: clean points fitted by least squares, all points by least squares and robustly.
fn outliers(clouds: &[(&str, Cloud)], text: &mut String) -> Result<()> {
    *text += OUTLIERS;
    let tolerance = 2e-3;
    let settings = Settings { elements: 8, lambda: Lambda::Auto { tolerance }, tolerance, within: 0.95 };
    let losses = [
        ("Huber", Loss::Huber),
        ("Tukey", Loss::Tukey),
        ("Geman–McClure", Loss::GemanMcClure),
        ("ℓp, p = 1.2", Loss::Power(1.2)),
    ];
    let header = [
        "cloud",
        "outliers",
        "fit",
        "RMSE",
        "of the clean fit's",
        "MAX",
        "DOFs",
        "missed",
        "wrongly set aside",
        "CPU-s",
    ];
    let mut rows = Vec::new();
    for (name, cloud) in clouds {
        let nothing = Reweighting::default();
        for one_sided in [false, true] {
            let (points, flags) = cloud.with_outliers(one_sided);
            let kind = if one_sided { "one side" } else { "all directions" };
            let mut clean_error = None;
            let mut row = |method: &str, found: &Figures| -> Result<()> {
                let [rmse, max] = found.errors(&cloud.parameters, &cloud.points, &flags, false)?;
                let clean = *clean_error.get_or_insert(rmse);
                let count = |outlier: bool, gross: bool| {
                    (0..flags.len()).filter(|&i| flags[i] == outlier && found.gross[i] == gross).count()
                };
                let robust = found.gross.contains(&true);
                let shown = |count: usize| if robust { count.to_string() } else { String::new() };
                rows.push(vec![
                    (*name).to_owned(),
                    kind.to_owned(),
                    method.to_owned(),
                    figure(rmse),
                    format!("{:.2}", rmse / clean),
                    figure(max),
                    found.dofs.to_string(),
                    shown(count(true, false)),
                    shown(count(false, true)),
                    format!("{:.2}", found.seconds),
                ]);
                Ok(())
            };
            row("LS, clean", &fit(&cloud.parameters, &cloud.points, &nothing, settings)?)?;
            row("LS", &fit(&cloud.parameters, &points, &nothing, settings)?)?;
            for (method, loss) in losses {
                // A fifth of the points are outliers.
                let robust = Some(Robust { max_set_aside: 0.3, ..Robust::adaptive::<2>(loss, tolerance) });
                let rules = Reweighting { robust, ..Reweighting::default() };
                row(method, &fit(&cloud.parameters, &points, &rules, settings)?)?;
            }
        }
    }
    *text += &table(&header, &rows);
    Ok(())
}

/// Tolerances of Figure 3.7; the text chooses ones that lead to about as many DOFs.
const LADDER: [f64; 9] = [1e-2, 7e-3, 5e-3, 3.5e-3, 2.5e-3, 2e-3, 1.5e-3, 1e-3, 7e-4];

/// The tolerance whose iterations are shown.
const SHOWN: f64 = 1e-3;

/// Centre and radius of the corrupted patch in the parameter square.
const PATCH: ([f64; 2], f64) = ([0.5, 0.45], 0.1);

/// Size of the corruption: each coordinate of a point is off by at most this share of the diagonal.
const CORRUPTION: f64 = 0.05;

/// Samples per direction over the patch and its surroundings, for self-intersections.
const SAMPLES: usize = 160;

/// A corrupted patch: least squares, and markers of type II.
fn patches(clouds: &[(&str, Cloud)], text: &mut String) -> Result<()> {
    *text += PATCHES;
    let tolerance = 2e-3;
    let settings = Settings { elements: 8, lambda: Lambda::Fixed(1e-6), tolerance, within: 1.0 };
    let header = [
        "cloud",
        "markers",
        "fit",
        "RMSE outside",
        "MAX outside",
        "RMSE to the clean patch",
        "DOFs",
        "self-intersections",
    ];
    let mut rows = Vec::new();
    for (name, cloud) in clouds {
        let (centre, radius) = PATCH;
        let u = &cloud.parameters;
        let inside: Vec<bool> = u.outer_iter().map(|u| (u[0] - centre[0]).hypot(u[1] - centre[1]) < radius).collect();
        let patch: Vec<usize> = (0..inside.len()).filter(|&i| inside[i]).collect();
        let mut random = param_nn::stream(SEED, 7);
        let mut points = cloud.points.clone();
        for &i in &patch {
            (0..3).for_each(|k| points[[i, k]] += CORRUPTION * (2.0 * random.random::<f64>() - 1.0));
        }
        let markers = Markers { met: Vec::new(), ignored: patch.clone() };
        let marked = |rules| Reweighting { markers: Some((markers.clone(), rules)), ..Reweighting::default() };
        let fits = [
            ("LS", Reweighting::default()),
            ("rWLS, (3.14)", marked(MarkerRules::algorithm_2(tolerance, tolerance))),
            ("rWLS, ignored from the start", marked(MarkerRules::new(tolerance, tolerance))),
        ];
        for (method, rules) in fits {
            let found = fit(u, &points, &rules, settings)?;
            let outside = found.errors(u, &cloud.points, &inside, false)?;
            let within = found.errors(u, &cloud.points, &inside, true)?;
            let reach = 1.5 * radius;
            let crossing = crossings::count(&found.map, centre.map(|c| c - reach), centre.map(|c| c + reach), SAMPLES)?;
            rows.push(vec![
                (*name).to_owned(),
                patch.len().to_string(),
                method.to_owned(),
                figure(outside[0]),
                figure(outside[1]),
                figure(within[0]),
                found.dofs.to_string(),
                crossing.to_string(),
            ]);
        }
    }
    *text += &table(&header, &rows);
    Ok(())
}

/// Figure 3.7: function (3.13) on a grid, MAX against DOFs, with markers by the error of a first fit.
fn sharp_features(text: &mut String) -> Result<()> {
    *text += FEATURES;
    // The heights themselves: they are errors of the function.
    let sample = Sample {
        kind: surface::Kind::Rwls,
        layout: Layout::Grid,
        points: 10_000,
        noise: Noise::Absolute(0.0),
        seed: SEED,
    };
    let cloud = sample.cloud()?;
    let points = Array2::from_shape_fn((10_000, 3), |(i, k)| cloud.points[i][k]);
    let parameters = Array2::from_shape_fn((10_000, 2), |(i, d)| cloud.parameters[i][d]);
    let (u, p) = (parameters.view(), points.view());
    let lambda = Lambda::Fixed(1e-6);
    let mut ends = Vec::new();
    let mut curves = String::new();
    for tolerance in LADDER {
        let settings = Settings { elements: 15, lambda, tolerance, within: 1.0 };
        let options = Options { lambda, ..Options::default() };
        let detection = Detection { threshold: tolerance, standing_out: false, outliers: false, max_outliers: 0.0 };
        let markers = detect_markers(u, p, None, &uniform(15)?, options, detection)?;
        let count = markers.met.len();
        let rules = MarkerRules {
            update: fit_ls::Update::Constant(1.25),
            ..MarkerRules::algorithm_2(10.0 * tolerance, 10.0 * tolerance)
        };
        let marked = Reweighting { markers: Some((markers, rules)), ..Reweighting::default() };
        let plain = fit(&parameters, &points, &Reweighting::default(), settings)?;
        let weighted = fit(&parameters, &points, &marked, settings)?;
        if tolerance == SHOWN {
            curves = history_table(&plain.history, &weighted.history);
        }
        let end = |found: &Figures| found.history.last().map_or((0, 0.0), |last| (last.dofs, last.deviation.max));
        ends.push((tolerance, count, end(&plain), end(&weighted)));
    }
    let rows = ends.iter().map(|&(tolerance, count, (dofs, max), (w_dofs, w_max))| {
        let better = ends.iter().find(|(.., end)| end.0 < dofs && end.1 < max);
        vec![
            format!("{tolerance:e}"),
            count.to_string(),
            dofs.to_string(),
            figure(max),
            w_dofs.to_string(),
            figure(w_max),
            better.map_or("–".to_owned(), |(at, .., end)| format!("{} and {} (ε = {at:e})", end.0, figure(end.1))),
        ]
    });
    let header =
        ["ε", "markers", "DOFs, LS", "MAX, LS", "DOFs, rWLS", "MAX, rWLS", "fewer DOFs and smaller MAX than this LS"];
    *text += &table(&header, &rows.collect::<Vec<_>>());
    writeln!(text, "\nThe iterations with ε = {SHOWN:e}:\n")?;
    *text += &curves;
    Ok(())
}

/// MAX and RMSE against DOFs, iteration by iteration.
fn history_table(plain: &[Iteration], weighted: &[Iteration]) -> String {
    let header = ["iteration", "DOFs, LS", "MAX, LS", "RMSE, LS", "DOFs, rWLS", "MAX, rWLS", "RMSE, rWLS"];
    let cells = |history: &[Iteration], k: usize| match history.get(k) {
        Some(i) => [i.dofs.to_string(), figure(i.deviation.max), figure(i.deviation.rmse())],
        None => [const { String::new() }; 3],
    };
    let row = |k: usize| std::iter::once(k.to_string()).chain(cells(plain, k)).chain(cells(weighted, k)).collect();
    table(&header, &(0..plain.len().max(weighted.len())).map(row).collect::<Vec<_>>())
}

/// Rules for the smoothing weight against the best of a grid, by the error to the truth.
fn smoothing(text: &mut String) -> Result<()> {
    *text += SMOOTHING;
    let header = [
        "surface",
        "noise, %",
        "elements",
        "best RMSE",
        "with λ",
        "gcv: of the best",
        "with λ",
        "time of a fit",
        "discrepancy: of the best",
        "auto: of the best",
    ];
    let mut rows = Vec::new();
    for (name, kind) in SURFACES {
        let truth = Cloud::generated(kind, NOISY, kind.layout())?;
        for (percent, elements) in [(0.1, 24), (1.0, 24), (5.0, 24), (1.0, 48)] {
            let mut random = param_nn::stream(SEED, (10.0 * percent) as u64);
            // The sum of twelve uniform numbers is normal for all that matters here.
            let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
            let noise = percent / 100.0;
            let points = truth.points.mapv(|x| x + noise * normal());
            let space = uniform(elements)?;
            let one = |lambda: Lambda| -> Result<(f64, f64)> {
                let options = Options { lambda, ..Options::default() };
                let mut method = LeastSquares::new(truth.parameters.view(), points.view(), None, options)?;
                let image = method.fit(&space)?.eval_batch(truth.parameters.view())?;
                let squares = (&image - &truth.points).mapv(|x| x * x).sum() / NOISY as f64;
                Ok((squares.sqrt(), method.lambda().unwrap_or(0.0)))
            };
            let mut best = (f64::INFINITY, 0.0);
            for k in -36..=8 {
                let found = one(Lambda::Fixed(10.0_f64.powf(f64::from(k) / 4.0)))?;
                if found.0 < best.0 {
                    best = found;
                }
            }
            let gcv = one(Lambda::CrossValidation)?;
            // Three coordinates with this noise each.
            let discrepancy = one(Lambda::Discrepancy { noise: 3.0_f64.sqrt() * noise })?;
            let auto = one(Lambda::Auto { tolerance: f64::INFINITY })?;
            let timed = |lambda: Lambda| -> Result<f64> {
                let clock = Clock::start();
                for _ in 0..REPEATED {
                    let options = Options { lambda, ..Options::default() };
                    LeastSquares::new(truth.parameters.view(), points.view(), None, options)?.fit(&space)?;
                }
                Ok(clock.seconds() / REPEATED as f64)
            };
            let ratio = timed(Lambda::CrossValidation)? / timed(Lambda::Fixed(gcv.1))?;
            rows.push(vec![
                name.to_owned(),
                percent.to_string(),
                format!("{elements} × {elements}"),
                figure(best.0),
                format!("{:.1e}", best.1),
                format!("{:.3}", gcv.0 / best.0),
                format!("{:.1e}", gcv.1),
                format!("{ratio:.1}"),
                format!("{:.2}", discrepancy.0 / best.0),
                format!("{:.2}", auto.0 / best.0),
            ]);
        }
    }
    *text += &table(&header, &rows);
    Ok(())
}

const INTRODUCTION: &str = "\
# Weights that follow the errors

    cargo xtask tables rwls --data DIR

computes this page anew. DIR has `thesis/nefertiti_up.xml` and `nefertiti_head_8933.obj`; without it only generated clouds are
left. Points are scaled by the diagonal of their bounding box. CPU-s is user time over all threads.
";

const OUTLIERS: &str = "
## A fifth of gross outliers

Every fifth point, at random, is moved by 2 to 30 % of the diagonal: in all directions, or all of them towards +z. Parameters are
those of the clean points. Bicubic, 8 × 8 elements, ε = 2e-3, ν = 0.95, automatic λ. RMSE and MAX are over the clean points;
what is missed are outliers that were not set aside in the end.

";

const PATCHES: &str = "
## A corrupted patch

All points of a disk of radius 0.1 of the parameter square are scattered by up to 5 % of the diagonal in each coordinate, and marked as
type II. Bicubic, 8 × 8 elements, ε = tol_II = 2e-3, ν = 1, λ = 1e-6. `(3.14)` is Algorithm 2 as printed: type II has weight 1 at first
and loses it in the course of the loop. Self-intersections are pairs of triangles of 160 × 160 samples over the patch and half
its radius around it.

";

const FEATURES: &str = "
## Figure 3.7

Function (3.13) on 100 × 100 points, bicubic, 15 × 15 elements, λ = 1e-6, ν = 1, at most 6 levels. Markers of type I are the points whose
error in the first fit is above ε; tol_I = 10 ε, and the weights of markers that are not met grow by 25 % an iteration, as in example
3.1.9 (c). The figure's curves are lost in the text: its claim is that rWLS reaches a smaller MAX with fewer DOFs than LS, ε being chosen
so that both end with about as many. The last column is the first rWLS of any ε that does.

";

const SMOOTHING: &str = "
## The smoothing weight

8000 points of a surface with normal noise in each coordinate, in percent of the diagonal; bicubic splines on a uniform mesh. RMSE is that of
the fit to the points without noise. The best is that of a grid of λ, four a power of ten from 1e-9 to 1e2. The time of a fit with gcv, sorting
and assembly counted, is given in units of that with λ known, both as user time over twenty runs. discrepancy is given the true noise;
auto has no tolerance.

";

const CONCLUSIONS: &str = "
## What the tables say

**Outliers.** On all six clouds the robust fits have an RMSE at most 1.15 times that of the fit to the clean points, with up to 36 % more
DOFs; least squares has 17 times and more, and refines until there are as many DOFs as points. What is wrongly set aside are points
at cusps and sharp edges; the largest errors of the head are there.

**Patches.** Least squares follows the patch, and so does (3.14) as printed, whose factor 1/(1 + e) hardly differs from 1 for errors of
some per cent: it needs markers whose weight is small from the start. With these no surface passes through itself.

**Figure 3.7.** From ε = 5e-3 on, rWLS has fewer DOFs and a smaller MAX than LS; with λ = 1e-6 the MAX of LS ends at 7e-3, at the
cusps, whatever the DOFs. For the two coarsest fits there is no rWLS with fewer DOFs that is better.

**Smoothing.** gcv is within 4 % of the best λ everywhere, in at most 3.5 times the time of one fit. auto keeps noise that has no
tolerance; the more so the larger it is.
";
