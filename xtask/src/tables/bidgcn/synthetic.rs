//! Clouds on random patches.

use std::fmt::Write as _;

use anyhow::Result;
use param_nn::{
    BezierFit, Bidgcn, ControlPoints, Neighbours, Recipe, ScatteredSpec, TrainOptions, Trainer, Variant, stream,
};

use super::{AVERAGED, BIDGCN, LPSP, Networks, text};
use crate::tables::mapped::{Method, boundary};
use crate::tables::markdown::{factor, figure, table};
use crate::tables::parcnn::fitting::{jointly_moved, polynomials};

/// Seed of all test clouds; its number means nothing.
pub(super) const SEED: u64 = 48;

/// Interior points.
pub(super) const SIZES: [usize; 4] = [200, 500, 1000, 2000];

/// Degrees with the standard deviations of the noise that are tested with them.
const CASES: [(usize, &[f64]); 4] =
    [(2, &[0.0, 5e-3, 1e-2, 5e-2]), (3, &[0.0, 1e-2]), (4, &[0.0, 1e-2]), (5, &[0.0, 1e-2])];

/// Rate and seed of the short trainings.
const RATE: f64 = 3e-3;
const TRAIN_SEED: u64 = 1;

/// Means over the clouds of a cell.
#[derive(Clone, Debug, Default)]
struct Cell {
    /// Of each cloud that came out.
    errors: Vec<f64>,
    seconds: f64,
    /// Clouds for which the radius 3/√m was enough.
    radius_sufficed: u64,
    /// Of the fit after two joint steps, where it was asked for.
    joint: f64,
    joint_seconds: f64,
}

impl Cell {
    fn mean(&self, sum: f64) -> f64 {
        sum / self.errors.len() as f64
    }

    fn mse(&self) -> f64 {
        self.mean(self.errors.iter().sum())
    }

    /// The middle one, or the mean of the two in the middle.
    fn median(&self) -> f64 {
        let mut errors = self.errors.clone();
        errors.sort_by(f64::total_cmp);
        let middle = errors.len() / 2;
        if errors.len() % 2 == 1 { errors[middle] } else { 0.5 * (errors[middle] + errors[middle.saturating_sub(1)]) }
    }

    /// On how many clouds the error is below that of another method, where both came out on all.
    fn below(&self, other: &Self) -> usize {
        self.errors.iter().zip(&other.errors).filter(|(a, b)| a < b).count()
    }
}

/// Cells of methods on the same clouds; joint steps after those that `with_joint` names.
fn cells(spec: ScatteredSpec, methods: &[(&str, Method<'_>)], with_joint: &[usize], clouds: u64) -> Result<Vec<Cell>> {
    let mut cells = vec![Cell::default(); methods.len()];
    let space = polynomials::<2>(spec.degree)?;
    for index in 0..clouds {
        let cloud = spec.sample(&mut stream(SEED, index))?;
        let fixed = boundary(&cloud);
        for (k, (cell, (_, method))) in cells.iter_mut().zip(methods).enumerate() {
            let Ok(mapped) = method.map(cloud.points.view(), &fixed) else { continue };
            cell.radius_sufficed += u64::from(mapped.radius_sufficed);
            cell.seconds += mapped.seconds;
            cell.errors.push(BezierFit::new(mapped.parameters.view(), cloud.points.view(), spec.degree)?.mse);
            if with_joint.contains(&k) {
                let clock = crate::tables::mapped::ProcessorClock::start();
                cell.joint += jointly_moved(&mapped.parameters, cloud.points.view(), &space)?.mse();
                cell.joint_seconds += clock.seconds();
            }
        }
    }
    Ok(cells)
}

/// Figures 4.24 and 4.26 to 4.29.
pub(super) fn tables(networks: &Networks, clouds: u64, tell: &mut dyn FnMut(&str)) -> Result<String> {
    let methods = networks.methods();
    let names: Vec<&str> = methods.iter().map(|(name, _)| *name).collect();
    let mut out = String::from(text::BEFORE_ERRORS);
    let (mut times, mut shares, mut medians) = (Vec::new(), Vec::new(), Vec::new());
    for (degree, noises) in CASES {
        for &noise in noises {
            let mut rows = Vec::new();
            for interior in SIZES {
                let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree, interior, noise };
                let cells = cells(spec, &methods, &[LPSP, BIDGCN], clouds)?;
                tell(&format!("degree {degree}, noise {noise:.0e}, {interior} points"));
                let mse: Vec<f64> = cells.iter().map(Cell::mse).collect();
                let joint: Vec<f64> = cells.iter().map(|cell| cell.mean(cell.joint)).collect();
                let mut row = vec![interior.to_string()];
                row.extend(mse.iter().copied().map(figure));
                row.extend([factor(mse[BIDGCN], mse[LPSP]), factor(mse[AVERAGED], mse[LPSP])]);
                row.extend([figure(joint[BIDGCN]), factor(joint[BIDGCN], mse[LPSP])]);
                row.extend([figure(joint[LPSP]), factor(joint[LPSP], mse[LPSP])]);
                rows.push(row);
                if degree == 2 {
                    let noisy = if noise > 0.0 { format!(", noise {noise:.0e}") } else { String::new() };
                    let mut row = vec![format!("{interior}{noisy}"), figure(cells[LPSP].median())];
                    for k in [BIDGCN, AVERAGED] {
                        let median = cells[k].median();
                        row.extend([figure(median), factor(median, cells[LPSP].median())]);
                        row.push(format!("{} of {clouds}", cells[k].below(&cells[LPSP])));
                    }
                    medians.push(row);
                }
                if degree == 2 && noise == 0.0 {
                    let mut row = vec![interior.to_string()];
                    row.extend(cells.iter().map(|cell| format!("{:.1}", 1e3 * cell.mean(cell.seconds))));
                    row.push(format!("{:.1}", 1e3 * cells[BIDGCN].mean(cells[BIDGCN].joint_seconds)));
                    times.push(row);
                }
                if degree == 2 && noise == 5e-2 {
                    let mut row = vec![interior.to_string()];
                    row.extend(cells.iter().map(|cell| format!("{} ({})", cell.errors.len(), cell.radius_sufficed)));
                    shares.push(row);
                }
            }
            writeln!(out, "\n{}\n", text::caption(degree, noise))?;
            let ratios = [
                "BIDGCN / LPSP",
                "averaged / LPSP",
                "BIDGCN and 2 joint steps",
                "/ LPSP",
                "LPSP and 2 joint steps",
                "/ LPSP",
            ];
            let header = [&["points inside"][..], &names, &ratios].concat();
            out += &table(&header, &rows);
        }
    }
    out += text::BEFORE_MEDIANS;
    let of_network = |name: &'static str| [name, "/ LPSP", "below LPSP"];
    let header = [&["points inside", "LPSP"][..], &of_network("BIDGCN"), &of_network("BIDGCN, averaged")].concat();
    out += &table(&header, &medians);
    out += text::BEFORE_TIMES;
    out += &table(&[&["points inside"][..], &names, &["2 joint steps"]].concat(), &times);
    writeln!(out, "{}", text::before_shares(clouds))?;
    out += &table(&[&["points inside"][..], &names].concat(), &shares);
    Ok(out)
}

/// The network in a few steps: as shipped, as published, and without its boundary layer.
pub(super) fn trained(shipped: &Bidgcn, steps: u64, clouds: u64, tell: &mut dyn FnMut(&str)) -> Result<String> {
    let train = |variant, frame| -> Result<Bidgcn> {
        let neighbours = Neighbours::WithinRadius;
        let options =
            TrainOptions { variant, frame, neighbours, recipe: Recipe::AdamW, steps, rate: RATE, seed: TRAIN_SEED };
        let mut trainer = Trainer::new(options);
        while trainer.step_count() < steps {
            trainer.step()?;
        }
        Ok(trainer.network(""))
    };
    let mut networks = Vec::new();
    for (name, variant, frame) in [
        ("as shipped", Variant::Bidgcn, true),
        ("plain, as published", Variant::Bidgcn, false),
        ("DGCNN", Variant::Dgcnn, true),
        ("DGCNN, plain", Variant::Dgcnn, false),
    ] {
        networks.push((name, train(variant, frame)?));
        tell(&format!("trained: {name}"));
    }
    let mut methods = vec![super::CLASSICAL[LPSP], ("shipped", Method::Bidgcn(shipped))];
    methods.extend(networks.iter().map(|(name, network)| (*name, Method::Bidgcn(network))));
    let mut rows = Vec::new();
    for noise in [0.0, 1e-2] {
        for interior in SIZES {
            let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree: 2, interior, noise };
            let cells = cells(spec, &methods, &[], clouds)?;
            let noisy = if noise > 0.0 { ", noise 1e-2" } else { "" };
            let mut row = vec![format!("{interior}{noisy}")];
            row.extend(cells.iter().map(|cell| figure(cell.mse())));
            rows.push(row);
        }
    }
    let names: Vec<&str> = methods.iter().map(|(name, _)| *name).collect();
    Ok(text::before_trained(steps, RATE, TRAIN_SEED) + &table(&[&["points inside"][..], &names].concat(), &rows))
}
