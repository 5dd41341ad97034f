//! Imperatore 2024, chapter 5, at the printed settings and nothing else: two rings of cells are refined with every marked one
//! (Algorithms 7 and 8), no guard, the smoothing weight of the text.

use std::path::Path;

use anyhow::Result;
use moving_param::{Blend, Distance, Method, Schedule};
use ndarray::Axis;
use param_classic::{BOUNDARY_TOLERANCE, BoundaryParameters};
use param_nn::Bidgcn;
use point_cloud::Normalization;

use super::super::markdown::{figure, table};
use super::run::{Cloud, Run, Settings, in_first_space};

/// Two rings of cells are four cells of the next level.
const TWO_RINGS: usize = 4;

/// The constant weights of Figure 5.2.
const CONSTANTS: [f64; 6] = [1e-3, 1e-2, 0.1, 0.25, 0.5, 0.75];

/// Corrections after which the figures of §5.1.3 end.
const COUNTS: [usize; 2] = [10, 30];

/// A way to fit, and its name.
type Named = (&'static str, Method);

fn alternating(distance: Distance, corrections: usize) -> Method {
    Method::Alternating { distance, corrections }
}

fn hybrid(gamma: f64) -> Distance {
    Distance::Hybrid(Blend::Constant(gamma))
}

fn settings(elements: [usize; 2], tolerance: f64) -> Settings {
    Settings { extension: TWO_RINGS, ..Settings::published(elements, tolerance) }
}

/// The page, given the folder with `thesis/`.
///
/// # Errors
/// What reading and fitting meet.
pub(super) fn page(data: &Path, log: &mut dyn FnMut(&str)) -> Result<String> {
    let file = |name: &str| Cloud::read(&data.join("thesis").join(name));
    let cen = file("shiphull_cen.xml")?;
    let mut text = String::from(INTRODUCTION);
    text += &first_space(&cen, &file("shiphull_chl.xml")?, log)?;
    text += &on_the_hull(&cen, log)?;
    text += &on_nefertiti(&file("nefertiti_up.xml")?, log)?;
    Ok(text)
}

/// §5.1.3: no refinement at all.
fn first_space(cen: &Cloud, chl: &Cloud, log: &mut dyn FnMut(&str)) -> Result<String> {
    let start = settings([5, 2], 0.0);
    let row = |cloud: &Cloud, name: &str, distance: &Distance| -> Result<Vec<String>> {
        let mut row = vec![name.to_owned()];
        for corrections in COUNTS {
            row.push(figure(in_first_space(cloud, alternating(distance.clone(), corrections), &start)?.mse));
        }
        Ok(row)
    };
    log("§5.1.3");
    let header = ["weights", "MSE after 10 corrections", "after 30"];
    let constants: Vec<_> =
        CONSTANTS.iter().map(|&g| row(cen, &format!("γ = {g:e}"), &hybrid(g))).collect::<Result<_>>()?;
    let mut text = String::from(CONSTANT_WEIGHTS) + &table(&header, &constants);
    for (cloud, heading) in [(cen, CENTRIPETAL), (chl, CHORD_LENGTH)] {
        let choices = [
            ("A-PDM", Distance::Point),
            ("A-HDM, γ = 1e-2", hybrid(1e-2)),
            ("A-HDM, error", Distance::Hybrid(Blend::ErrorDriven)),
            ("A-HDM, curvature", Distance::Hybrid(Blend::CurvatureDriven(cloud.curvatures()?))),
        ];
        let rows: Vec<_> = choices.iter().map(|(name, distance)| row(cloud, name, distance)).collect::<Result<_>>()?;
        text += heading;
        text += &table(&header, &rows);
    }
    Ok(text)
}

const HEADER: [&str; 6] = ["method", "DOFs", "MAX", "MSE", "creases", "stop"];

fn row(name: &str, run: &Run) -> Vec<String> {
    let deviation = run.deviation();
    let (max, mse) = (figure(deviation.max), figure(deviation.mse));
    vec![name.into(), run.dofs().to_string(), max, mse, format!("{:.4}", run.creases), run.stop.into()]
}

/// Examples 5.2.2 (f) and 5.3.3 (a).
fn on_the_hull(cen: &Cloud, log: &mut dyn FnMut(&str)) -> Result<String> {
    let curvature = || Distance::Hybrid(Blend::CurvatureDriven(cen.curvatures().unwrap_or_default()));
    let mut rows = |methods: Vec<Named>, tolerance: f64| -> Result<Vec<Vec<String>>> {
        let one = |(name, method): Named| {
            log(name);
            Ok(row(name, &Run::of(name, cen, Some(method), &settings([5, 2], tolerance))?))
        };
        methods.into_iter().map(one).collect()
    };
    let few = vec![
        ("A-PDM, 1", alternating(Distance::Point, 1)),
        ("A-HDM, 1, curvature", alternating(curvature(), 1)),
        ("A-HDM, 1, γ = 1e-2", alternating(hybrid(1e-2), 1)),
        ("A-PDM, 5", alternating(Distance::Point, 5)),
        ("A-HDM, 5, curvature", alternating(curvature(), 5)),
        ("A-HDM, 5, γ = 1e-2", alternating(hybrid(1e-2), 5)),
    ];
    let many = vec![
        ("A-PDM, 10", alternating(Distance::Point, 10)),
        ("J-PDM (a)", Method::JointLbfgs(Schedule::A)),
        ("J-PDM (b)", Method::JointLbfgs(Schedule::B)),
    ];
    let mut text = String::from(LOOP) + &table(&HEADER, &rows(few, 1e-4)?);
    text += JOINT;
    text += &table(&HEADER, &rows(many, 1e-5)?);
    Ok(text)
}

/// Parameters by the network that comes with the crate, the boundary being that of the file.
fn by_network(cloud: &Cloud) -> Result<Cloud> {
    let points = Normalization::of(cloud.points.view())?.apply(cloud.points.view())?;
    let depth = |row: usize| cloud.parameters.row(row).iter().fold(1.0f64, |d, x| d.min(*x).min(1.0 - x));
    let rows: Vec<usize> = (0..points.nrows()).filter(|&row| depth(row) <= BOUNDARY_TOLERANCE).collect();
    let boundary = BoundaryParameters {
        points: rows.iter().map(|&row| row as u32).collect(),
        parameters: cloud.parameters.select(Axis(0), &rows),
    };
    let parameters = Bidgcn::embedded()?.predict(points.view(), &boundary.points, boundary.parameters.view())?;
    Ok(Cloud { points: cloud.points.clone(), parameters })
}

/// Example 5.3.3 (b).
fn on_nefertiti(own: &Cloud, log: &mut dyn FnMut(&str)) -> Result<String> {
    let learned = by_network(own)?;
    let methods: [(Named, usize); 3] = [
        (("A-PDM, 1", alternating(Distance::Point, 1)), 2249),
        (("A-HDM, 1, γ = 1/3", alternating(hybrid(1.0 / 3.0), 1)), 2197),
        (
            (
                "J-PDM, η = 1e-5, K = 100",
                Method::JointLbfgs(Schedule::Constant { gradient: 1e-5, max_iterations: 100 }),
            ),
            2116,
        ),
    ];
    let mut rows = Vec::new();
    for (cloud, whose) in [(&learned, "BIDGCN's parameters"), (own, "those of the file")] {
        for ((name, method), most) in &methods {
            let name = format!("{name}, {whose}");
            log(&name);
            let settings = Settings { max_dofs: *most, ..settings([1, 1], 2.5e-3) };
            rows.push(row(&name, &Run::of(&name, cloud, Some(method.clone()), &settings)?));
        }
    }
    Ok(String::from(NEFERTITI) + &table(&HEADER, &rows))
}

const INTRODUCTION: &str = "\
# Moving parameters at the printed settings

    RAYON_NUM_THREADS=1 cargo xtask tables printed --data DIR

computes this page anew; DIR has the public clouds of the authors in `thesis/`. Nothing here is tuned: degree 2, λ = 1e-7, two
rings of cells refined with each marked one, the printed corrections, tolerances and schedules, no guard. What the printed text
leaves open is ours: after its tangent steps A-HDM moves each parameter to its foot point once more, the curvatures are those of the cloud, and the
iterations end at 20. Our own settings stand in [moving.md](moving.md). MAX and MSE are of the points at their parameters, in
the units of the cloud.
";

const CONSTANT_WEIGHTS: &str = "
## One space, constant weights (Figure 5.2)

`shiphull_cen.xml`, 5 × 2 elements, no refinement; MSE at the foot points. The text finds γ = 1e-2 best.

";

const CENTRIPETAL: &str = "
## One space, choices of weights, centripetal parameters (Figure 5.3)

The text: any A-HDM gains about an order over A-PDM; curvature weights are worst after ten corrections, and after thirty better than
error weights and as good as the constant one.

";

const CHORD_LENGTH: &str = "
## One space, choices of weights, chord-length parameters (Figure 5.4)

";

const LOOP: &str = "
## In the adaptive loop (example 5.2.2 (f))

`shiphull_cen.xml`, 5 × 2 elements, ε = 1e-4. The text: with one correction the constant weight is better than A-PDM and curvature is
not; with five both are, the constant one needs the fewest control points, curvature about 35 % more and A-PDM about 55 % more.

";

const JOINT: &str = "
## Joint minimization (example 5.3.3 (a))

The same with ε = 1e-5. The text: A-PDM 2329 control points, J-PDM (a) more than 1000, J-PDM (b) less than 400.

";

const NEFERTITI: &str = "
## Nefertiti (example 5.3.3 (b))

`nefertiti_up.xml`, one element, ε = 2.5e-3; at most as many control points as the text prints for each method: A-PDM 2249 and MAX 2.00e-2,
A-HDM 2197 and 8.35e-3, J-PDM 2116 and 7.96e-3. The text starts from BIDGCN's parameters; ours are those of the network that comes with
`param-nn`, read once, not of the published training, with the boundary of the file.

";
