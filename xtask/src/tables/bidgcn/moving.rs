//! Example 5.2.2 (c) and (d) of Imperatore 2024: adaptive fits with moving parameters, from several starts.

use std::ops::ControlFlow;
use std::path::Path;

use anyhow::{Context, Result};
use fit_ls::{Lambda, Options};
use moving_param::{Distance, Method, MovingFit};
use ndarray::Array2;

use super::real::RealCloud;
use super::{AVERAGED, LPSP, Networks, text};
use crate::tables::markdown::{factor, figure, table};
use crate::tables::parcnn::fitting::polynomials;

/// A fit of the thesis: cloud, degree, control points that are aimed at.
struct Example {
    name: &'static str,
    file: &'static str,
    degree: usize,
    dofs: usize,
}

const EXAMPLES: [Example; 2] = [
    Example { name: "(d), Nefertiti", file: "thesis/nefertiti_v9000_boundary_correction.xml", degree: 2, dofs: 5404 },
    Example { name: "(c), face", file: "thesis/face_v9000.xml", degree: 3, dofs: 2687 },
];

/// Adaptive iterations, each with one correction of the parameters, and the smoothing weight.
const ITERATIONS: usize = 8;
const LAMBDA: f64 = 1e-6;

/// Tolerances between which that of the wanted number of control points lies, in the unit cube.
const TOLERANCES: [f64; 2] = [1e-5, 3e-2];

/// Halvings of that range, in logarithmic measure.
const HALVINGS: usize = 9;

/// Control points count as equally many within this share.
const ALIKE: f64 = 0.02;

/// Control points, mean squared and largest distance.
#[derive(Clone, Copy)]
struct Fitted {
    dofs: usize,
    mse: f64,
    max: f64,
}

/// A-PDM from a single element.
fn adaptive_fit(points: &Array2<f64>, parameters: &Array2<f64>, degree: usize, tolerance: f64) -> Result<Fitted> {
    let fitting = Options { lambda: Lambda::Fixed(LAMBDA), ..Options::default() };
    let method = Method::Alternating { distance: Distance::Point, corrections: 1 };
    let options = moving_param::Options { method, tolerance, ..moving_param::Options::default() };
    let mut method = MovingFit::new(parameters.view(), points.view(), None, fitting, options)?;
    let rules =
        adaptive::Options { tolerance, within: 1.0, max_iterations: ITERATIONS, ..adaptive::Options::default() };
    let go_on = &mut |_: &adaptive::Iteration| ControlFlow::Continue(());
    let outcome = adaptive::run(&mut method, polynomials::<2>(degree)?, &rules, go_on)?;
    let last = outcome.history.last().context("no iteration")?;
    Ok(Fitted { dofs: last.dofs, mse: last.deviation.mse, max: last.deviation.max })
}

/// The fit whose number of control points comes nearest to the wanted one, by the choice of the tolerance.
fn with_dofs(points: &Array2<f64>, parameters: &Array2<f64>, example: &Example) -> Result<Fitted> {
    let [mut low, mut high] = TOLERANCES.map(f64::ln);
    let off = |fitted: &Fitted| fitted.dofs.abs_diff(example.dofs);
    let mut best: Option<Fitted> = None;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        let fitted = adaptive_fit(points, parameters, example.degree, middle.exp())?;
        if fitted.dofs > example.dofs {
            low = middle
        } else {
            high = middle
        }
        best = Some(best.filter(|best| off(best) <= off(&fitted)).unwrap_or(fitted));
        if best.as_ref().is_some_and(|best| off(best) as f64 <= ALIKE * example.dofs as f64) {
            break;
        }
    }
    best.context("no fit")
}

/// The table of both examples.
pub(super) fn tables(networks: &Networks, folder: &Path, tell: &mut dyn FnMut(&str)) -> Result<String> {
    let mut rows = Vec::new();
    for example in &EXAMPLES {
        let cloud = RealCloud::with_parameters(example.name, &folder.join(example.file))?;
        let methods = networks.methods();
        let mut starts = Vec::new();
        for (name, method) in &methods[LPSP..=AVERAGED] {
            starts.push((*name, method.map(cloud.points.view(), &cloud.boundary)?.parameters));
        }
        starts.push(("of the file", cloud.own.clone().context("no parameters of its own")?));
        let mut lpsp = None;
        let mut label = cloud.name.clone();
        for (name, parameters) in &starts {
            let fitted = with_dofs(&cloud.points, parameters, example)?;
            let reference = *lpsp.get_or_insert(fitted.mse);
            rows.push(vec![
                std::mem::take(&mut label),
                (*name).into(),
                fitted.dofs.to_string(),
                figure(fitted.mse),
                factor(fitted.mse, reference),
                figure(fitted.max),
            ]);
            tell(&format!("{}: {name}", example.name));
        }
    }
    let header = ["example", "start", "control points", "MSE", "/ LPSP", "MAX"];
    Ok(String::from(text::BEFORE_MOVING) + &table(&header, &rows) + text::AFTER_MOVING)
}
