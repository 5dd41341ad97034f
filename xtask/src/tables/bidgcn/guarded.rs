//! The automatic parameters of measured clouds, with and without networks.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::Path;

use adaptive::Marking;
use anyhow::{Context, Result};
use geom_io::{ReadOptions, Scan, read_scan};
use param_classic::BOUNDARY_TOLERANCE;
use reconstruct::{Fit, FitOptions, GivenCorners, Mark, Method, Networks, ParameterOptions, Tolerance, fit_scan};

use super::real::WITH_PARAMETERS;
use super::text;
use crate::tables::mapped::ProcessorClock;
use crate::tables::markdown::table;

/// Raw scans: points without order, boundary or parameters.
const SCANS: [(&str, &str); 11] = [
    ("bust, 299", "nefertiti_299.xyz"),
    ("Nefertiti, 532", "nefertiti_face_532.xyz"),
    ("Nefertiti, 2040", "nefertiti_face_2040.xyz"),
    ("Nefertiti, 8933", "nefertiti_head_8933.xyz"),
    ("laser scan of a face", "fran_face_scan.xyz"),
    ("raw scan of a face", "humface_raw.xyz"),
    ("random points of a face", "thbs_face_random.xyz"),
    ("bonnet", "beetle_bonnet.xyz"),
    ("half a hull", "dtc_hull_half.xyz"),
    ("crater", "sthelens_crater.xyz"),
    ("ground, from the air", "topography_lidar_ground.xyz"),
];

/// Largest distance of 95 % of the points, of the diagonal.
const TOLERANCE: f64 = 0.5;

/// A cloud, and what the user says of it.
struct Task {
    name: String,
    scan: Scan,
    corners: Option<GivenCorners>,
}

impl Task {
    fn scan(name: &str, path: &Path) -> Result<Self> {
        Ok(Self { name: name.into(), scan: read_scan(path, &ReadOptions::default())?, corners: None })
    }

    /// A cloud with its boundary and corners, which its parameters tell, and without these.
    fn bounded(name: &str, path: &Path) -> Result<Self> {
        let mut scan = read_scan(path, &ReadOptions::default())?;
        let own = scan.cloud.parameters.take().with_context(|| format!("{} has no parameters", path.display()))?;
        let depth = |row: usize| own.row(row).iter().fold(1.0f64, |d, x| d.min(*x).min(1.0 - x));
        scan.on_boundary = Some((0..own.nrows()).map(|row| depth(row) <= BOUNDARY_TOLERANCE).collect());
        let nearest = |corner: [f64; 2]| {
            let distance = |row: usize| (own[[row, 0]] - corner[0]).powi(2) + (own[[row, 1]] - corner[1]).powi(2);
            (0..own.nrows()).min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap_or(0) as u32
        };
        let corners = Some(GivenCorners([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(nearest)));
        Ok(Self { name: format!("{name}, {}", own.nrows()), scan, corners })
    }

    fn fit(&self, networks: Networks) -> Result<(Fit, f64)> {
        let parameters = ParameterOptions { networks, corners: self.corners, ..ParameterOptions::default() };
        let options = FitOptions {
            parameters,
            tol: Tolerance::Percent(TOLERANCE),
            method: Method::Ls,
            mark: Mark(Marking::Threshold),
            ..FitOptions::default()
        };
        let clock = ProcessorClock::start();
        let fit = fit_scan(self.scan.clone(), &self.name, &options, &mut |_| ControlFlow::Continue(()))?;
        Ok((fit, clock.seconds()))
    }
}

/// Which path the automatic parameters took on each cloud, and what the fit needed.
pub(super) fn tables(folder: &Path, tell: &mut dyn FnMut(&str)) -> Result<String> {
    let bounded = WITH_PARAMETERS.iter().map(|(name, file)| Task::bounded(name, &folder.join(file)));
    let scans = SCANS.iter().map(|(name, file)| Task::scan(name, &folder.join(file)));
    let mut out = String::from(text::BEFORE_GUARDED);
    for (kind, tasks) in [
        ("Boundary and corners given:", bounded.collect::<Result<Vec<_>>>()?),
        ("Nothing but points:", scans.collect::<Result<Vec<_>>>()?),
    ] {
        let (mut rows, mut taken) = (Vec::new(), 0);
        for task in &tasks {
            let (without, before) = task.fit(Networks::Off)?;
            let (with, after) = task.fit(Networks::On)?;
            let network = with.report.parameterization.network.as_ref().context("no network was asked")?;
            taken += u32::from(network.taken);
            let ratio = |k: usize| match (network.error, network.classical_error) {
                (Some(error), Some(classical)) => format!("{:.3}", error[k] / classical[k]),
                _ => "–".into(),
            };
            let dofs = |fit: &Fit| {
                let reached = if fit.reached() { "" } else { ", not reached" };
                format!("{}{reached}", fit.report.result.dofs)
            };
            rows.push(vec![
                task.name.clone(),
                without.report.parameterization.method.into(),
                if network.taken { with.report.parameterization.method } else { "–" }.into(),
                ratio(0),
                ratio(1),
                format!("{} / {}", without.report.parameterization.folded, with.report.parameterization.folded),
                dofs(&without),
                dofs(&with),
                format!("{before:.1}"),
                format!("{after:.1}"),
            ]);
            tell(&task.name);
        }
        let header = [
            "cloud",
            "without networks",
            "taken",
            "coarse error, ratio",
            "fine error, ratio",
            "folded without / with",
            "control points without",
            "with",
            "seconds without",
            "with",
        ];
        write!(out, "\n{kind} taken on {taken} of {}.\n\n{}", tasks.len(), table(&header, &rows))?;
    }
    Ok(out)
}
