//! Imperatore 2024, chapter 5, at the printed settings and nothing else: two rings of cells are refined with every marked one
//! (Algorithms 7 and 8), no guard, the smoothing weight of the text.

use std::path::Path;

use anyhow::Result;
use moving_param::{Blend, Distance, Method, Schedule};
use ndarray::Axis;
use param_classic::{BOUNDARY_TOLERANCE, BoundaryParameters};
use param_nn::Bidgcn;
use point_cloud::{BoundingBox, Normalization};

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
    text += &on_the_face(&by_network(&file("face_v9000.xml")?)?, log)?;
    text += &from_coarse_and_fine(&Cloud::read(&data.join("deepdrawingC.xml"))?, log)?;
    text += &with_exact_parameters(&file("shipHull_v1000_scattered.xml")?, log)?;
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
    let curvatures = cen.curvatures()?;
    let curvature = || Distance::Hybrid(Blend::CurvatureDriven(curvatures.clone()));
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
    Ok(Cloud { points, parameters })
}

/// Example 5.3.3 (b).
fn on_nefertiti(own: &Cloud, log: &mut dyn FnMut(&str)) -> Result<String> {
    let learned = Cloud { points: own.points.clone(), ..by_network(own)? };
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

/// Example 5.2.2 (c) on another face.
fn on_the_face(face: &Cloud, log: &mut dyn FnMut(&str)) -> Result<String> {
    let mut rows = Vec::new();
    for (degree, tolerance) in [(3, 8e-4), (4, 6.5e-4)] {
        let name = format!("A-PDM, 1, degree {degree}, ε = {tolerance:e}");
        log(&name);
        let start = settings([1, 1], tolerance);
        let settings = Settings { degree, lambda: 1e-6, max_iterations: 8, ..start };
        rows.push(row(&name, &Run::of(&name, face, Some(alternating(Distance::Point, 1)), &settings)?));
    }
    Ok(String::from(FACE) + &table(&HEADER, &rows))
}

/// Fits with fixed parameters and with one correction, from coarse and fine meshes.
fn fixed_and_moving(
    cloud: &Cloud,
    starts: &[(usize, bool)],
    settings: impl Fn(usize) -> Settings,
    log: &mut dyn FnMut(&str),
) -> Result<Vec<Vec<String>>> {
    let one = |&(elements, moves): &(usize, bool)| {
        let method = moves.then(|| alternating(Distance::Point, 1));
        let name = format!("{}, {elements} × {elements} elements", if moves { "A-PDM, 1" } else { "LS" });
        log(&name);
        Ok(row(&name, &Run::of(&name, cloud, method, &settings(elements))?))
    };
    starts.iter().map(one).collect()
}

/// Figure 5.5 on another part.
fn from_coarse_and_fine(sheet: &Cloud, log: &mut dyn FnMut(&str)) -> Result<String> {
    let diagonal = BoundingBox::of(sheet.points.view())?.diagonal();
    let sheet = Cloud { points: &sheet.points / diagonal, parameters: sheet.parameters.clone() };
    let settings = |n| Settings { lambda: 1e-6, ..settings([n, n], 2e-3) };
    let starts = [(4, false), (4, true), (16, false), (16, true)];
    Ok(String::from(COARSE) + &table(&HEADER, &fixed_and_moving(&sheet, &starts, settings, log)?))
}

/// Example 5.2.2 (a) on a smaller cloud.
fn with_exact_parameters(hull: &Cloud, log: &mut dyn FnMut(&str)) -> Result<String> {
    let points = Normalization::of(hull.points.view())?.apply(hull.points.view())?;
    let hull = Cloud { points, parameters: hull.parameters.clone() };
    let settings = |n| Settings { lambda: 1e-6, ..settings([n, n], 1e-4) };
    Ok(String::from(EXACT) + &table(&HEADER, &fixed_and_moving(&hull, &[(4, false), (4, true)], settings, log)?))
}

const FACE: &str = "
## Stand-in for example 5.2.2 (c): a face

`face_v9000.xml`, 9093 points in the unit cube; the text's face has 9283 and is not public. Parameters of BIDGCN, those of the network that comes with
`param-nn`, the boundary being that of the file; from one element, eight iterations, λ = 1e-6. The text: degree 3, ε = 8e-4, 2687 control points, MSE 1.45e-8, MAX
1.03e-3; degree 4, ε = 6.5e-4, 2793, 1.44e-8, 1.07e-3.

";

const COARSE: &str = "
## Stand-in for Figure 5.5: too coarse a start

`deepdrawingC.xml` in units of its diagonal, ε = 2e-3 (the text's part is not public; its ε is 2e-3 of its length), λ = 1e-6. The text: LS from 4 × 4
elements 1136 control points and MAX 8.33e-5 m, A-PDM from 4 × 4 elements 969 and 3.059e-4 m with self-intersections, from 16 × 16 elements 607 and
8.467e-5 m.

";

const EXACT: &str = "
## Stand-in for example 5.2.2 (a): exact parameters

`shipHull_v1000_scattered.xml`, 1132 points in the unit cube with the parameters of the file; the text's hull has 9636 points and is not public, its ε is not
printed, ours is 1e-4; λ = 1e-6. The text: LS 7173 control points and MSE 5.54e-5, A-PDM 4277 and 4.25e-6.

";

const INTRODUCTION: &str = "\
# Moving parameters at the printed settings

    RAYON_NUM_THREADS=1 cargo xtask tables printed --data DIR

computes this page anew; DIR has the public clouds of the authors in `thesis/`, and `deepdrawingC.xml`. Nothing here is tuned: degree 2, λ = 1e-7, two
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
