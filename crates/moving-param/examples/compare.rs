//! Methods with moving parameters side by side on one cloud, iteration by iteration.
//!
//!     compare cloud.csv degree=2 elements=4x4 lambda=1e-7 tolerance=5e-5 methods=fixed,a-pdm:1,joint:20
//!
//! The file has the columns u, v, x, y, z. Further settings: `extension` (2), `iterations` (20), `levels`, `dofs`,
//! `share` (of the points to refine for, 0 for all beyond the tolerance), `boundary` (kept or free), `guard` (on or off),
//! `barrier` (on or off: whether the Delaunay triangles of the parameters must not fold), `moves` (on to print what moved),
//! `within` (share of the points that must be met); of quasi-interpolation `nmin`, `nloc` (0 for the usual ones), `density`,
//! `splits` and `local` (constant, points or area: how the smoothing weight is scaled).
//! Methods: `fixed`, `qi`, `a-qi:k`, `a-pdm:k`, `a-tdm:k`, `a-hdm:k:γ` (or `error` for γ),
//! `joint:steps:decrease:polish:emphasis:stiffness:between:regularity:cohesion`,
//! `j-pdm:a`, `j-pdm:b`, `j-pdm:η:K`, `map:n:steps:decrease:barrier` (n × n control points).

use std::collections::HashMap;
use std::error::Error;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use adaptive::{Iteration, Marking, Outcome, Solve, run};
use fit_ls::{Lambda, LeastSquares};
use fit_qi::{LocalLambda, QuasiInterpolation};
use moving_param::{
    Blend, Boundary, Distance, JointOptions, Method, MovingFit, MovingQuasi, Options, QuasiOptions, Schedule,
    SquareMapOptions,
};
use ndarray::{Array2, Axis};
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};
use thb_core::{HierarchicalSpace, Kind, KnotVector, Quadrature, Refinement};

type Failure = Box<dyn Error>;

#[expect(clippy::print_stdout, reason = "an example prints its result")]
fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or("name a CSV file with the columns u, v, x, y, z")?;
    let settings: HashMap<String, String> =
        arguments.filter_map(|a| a.split_once('=').map(|(key, value)| (key.to_owned(), value.to_owned()))).collect();
    let text = |key: &str, default: &str| settings.get(key).cloned().unwrap_or_else(|| default.to_owned());
    let number = |key: &str, default: f64| -> Result<f64, Failure> { Ok(text(key, &default.to_string()).parse()?) };
    let (parameters, points) = read(&std::fs::read_to_string(&file)?)?;
    let elements = text("elements", "4x4");
    let (nu, nv) = elements.split_once('x').ok_or("elements are given as 4x4")?;
    let degree = number("degree", 2.0)? as usize;
    let knots = [KnotVector::uniform(degree, nu.parse()?)?, KnotVector::uniform(degree, nv.parse()?)?];
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, knots)?);
    let tolerance = number("tolerance", 1e-3)?;
    let share = number("share", 0.0)?;
    let adaptive = adaptive::Options {
        tolerance,
        within: number("within", 1.0)?,
        marking: if share > 0.0 { Marking::Share(share) } else { Marking::Threshold },
        refinement: Refinement {
            extension: [number("extension", 2.0)? as usize; 2],
            max_levels: number("levels", 16.0)? as usize,
            ..Refinement::default()
        },
        max_dofs: number("dofs", 20_000.0)? as usize,
        max_iterations: number("iterations", 20.0)? as usize,
    };
    let lambda = Lambda::Fixed(number("lambda", 1e-7)?);
    let fitting = fit_ls::Options { lambda, quadrature: Quadrature::GaussP, ..fit_ls::Options::default() };
    let boundary = if text("boundary", "kept") == "free" { Boundary::Free } else { Boundary::Kept };
    let guard = text("guard", "on") == "on";
    let local = local_options(&text, &number)?;
    let triangles = delaunay(&parameters)?;
    for name in text("methods", "fixed,a-pdm:1,a-pdm:3,a-hdm:3:0.01,joint,j-pdm:b").split(',') {
        println!("{name}");
        let clock = Instant::now();
        if name == "fixed" {
            let mut method = LeastSquares::new(parameters.view(), points.view(), None, fitting.clone())?;
            finish(&mut method, &space, &adaptive, clock)?;
            continue;
        }
        // Supports of functions are refined as they are.
        let by_functions =
            adaptive::Options { refinement: Refinement { extension: [0; 2], ..adaptive.refinement }, ..adaptive };
        if name == "qi" {
            let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, local)?;
            finish(&mut method, &space, &by_functions, clock)?;
            continue;
        }
        if let Some(corrections) = name.strip_prefix("a-qi:") {
            let options =
                QuasiOptions { corrections: corrections.parse()?, boundary, tolerance, ..QuasiOptions::default() };
            let mut method = MovingQuasi::new(parameters.view(), points.view(), None, local, options)?;
            finish(&mut method, &space, &by_functions, clock)?;
            continue;
        }
        let options = Options { method: parse(name)?, boundary, tolerance, guard, ..Options::default() };
        let mut method = MovingFit::new(parameters.view(), points.view(), None, fitting.clone(), options)?;
        method = if text("barrier", "off") == "on" {
            method.with_triangles(&triangles)?
        } else {
            method.with_centres(&triangles)
        };
        finish(&mut method, &space, &adaptive, clock)?;
        if text("moves", "off") == "on" {
            for moves in method.reports() {
                println!("    {moves:?}");
            }
        }
    }
    Ok(())
}

/// What quasi-interpolation is told.
fn local_options(
    text: &dyn Fn(&str, &str) -> String,
    number: &dyn Fn(&str, f64) -> Result<f64, Failure>,
) -> Result<fit_qi::Options<2>, Failure> {
    let given = |key| number(key, 0.0).map(|n| (n > 0.0).then_some(n as usize));
    let weight = number("lambda", 1e-7)?;
    Ok(fit_qi::Options {
        lambda: match text("local", "constant").as_str() {
            "points" => LocalLambda::PerPoint(weight),
            "area" => LocalLambda::PerArea(weight),
            _ => LocalLambda::Constant(weight),
        },
        n_min: given("nmin")?,
        n_loc: given("nloc")?,
        density: number("density", 0.3)?,
        splits: [number("splits", 1.0)? as usize; 2],
    })
}

#[expect(clippy::print_stdout, reason = "an example prints its result")]
fn finish<S: Solve<2>>(
    method: &mut S,
    space: &Arc<HierarchicalSpace<2>>,
    options: &adaptive::Options<2>,
    clock: Instant,
) -> Result<(), Failure>
where
    S::Error: 'static,
{
    let mut print = |i: &Iteration| {
        let (d, seconds) = (i.deviation, clock.elapsed().as_secs_f64());
        println!(
            "  {:2} {:6} dofs, MAX {:.3e}, MSE {:.3e}, within {:.4}, {seconds:.2} s",
            i.iteration, i.dofs, d.max, d.mse, d.within
        );
        ControlFlow::Continue(())
    };
    let Outcome { stop, failure, .. } = run(method, space.clone(), options, &mut print)?;
    println!("  {} {}", stop.name(), failure.map_or(String::new(), |e| e.to_string()));
    Ok(())
}

fn parse(name: &str) -> Result<Method, Failure> {
    let mut parts = name.split(':');
    let kind = parts.next().unwrap_or_default();
    let parts: Vec<&str> = parts.collect();
    let number = |at: usize, default: f64| parts.get(at).map_or(Ok(default), |text| text.parse::<f64>());
    let corrections = number(0, 1.0);
    let alternating = |distance| -> Result<Method, Failure> {
        Ok(Method::Alternating { distance, corrections: corrections.clone()? as usize })
    };
    Ok(match kind {
        "a-pdm" => alternating(Distance::Point)?,
        "a-tdm" => alternating(Distance::Tangent { damping: number(1, 1e-6)? })?,
        "a-hdm" if parts.get(1) == Some(&"error") => alternating(Distance::Hybrid(Blend::ErrorDriven))?,
        "a-hdm" => alternating(Distance::Hybrid(Blend::Constant(number(1, 0.01)?)))?,
        "joint" => {
            let default = JointOptions::default();
            Method::Joint(JointOptions {
                max_steps: number(0, default.max_steps as f64)? as usize,
                decrease: number(1, default.decrease)?,
                polish: number(2, default.polish as f64)? as usize,
                emphasis: number(3, default.emphasis as f64)? as usize,
                stiffness: number(4, default.stiffness)?,
                between: number(5, default.between)?,
                regularity: number(6, default.regularity)?,
                cohesion: number(7, default.cohesion)?,
            })
        }
        "map" => {
            let default = SquareMapOptions::default();
            Method::SquareMap(SquareMapOptions {
                per_side: number(0, default.per_side as f64)? as usize,
                max_steps: number(1, default.max_steps as f64)? as usize,
                decrease: number(2, default.decrease)?,
                barrier: number(3, default.barrier)?,
            })
        }
        "j-pdm" => Method::JointLbfgs(match parts[..] {
            ["a"] => Schedule::A,
            ["b"] => Schedule::B,
            _ => Schedule::Constant { gradient: number(0, 1e-5)?, max_iterations: number(1, 100.0)? as u64 },
        }),
        _ => return Err(format!("no method {name}").into()),
    })
}

fn read(text: &str) -> Result<(Array2<f64>, Array2<f64>), Failure> {
    let values =
        text.lines().skip(1).flat_map(|line| line.split(',')).map(str::parse).collect::<Result<Vec<f64>, _>>()?;
    let table = Array2::from_shape_vec((values.len() / 5, 5), values)?;
    let (parameters, points) = table.view().split_at(Axis(1), 2);
    Ok((parameters.to_owned(), points.to_owned()))
}

/// A point of the parameter plane with its index.
struct Vertex(Point2<f64>, u32);

impl HasPosition for Vertex {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.0
    }
}

/// The Delaunay triangles of the parameters.
fn delaunay(parameters: &Array2<f64>) -> Result<Vec<[u32; 3]>, Failure> {
    let vertices =
        parameters.outer_iter().enumerate().map(|(i, u)| Vertex(Point2::new(u[0], u[1]), i as u32)).collect();
    let triangulation = DelaunayTriangulation::<Vertex>::bulk_load_stable(vertices)?;
    Ok(triangulation.inner_faces().map(|face| face.vertices().map(|v| v.data().1)).collect())
}
