//! A picture of parameters: the triangles over the points, in the unit square, coloured by how much they are stretched.

use std::fmt::Write;

use ndarray::Array2;
use param_classic::{triangulate_parameters, unroll};

use crate::{Error, Parameterized};

/// Side of the square, in pixels.
const SIDE: f64 = 800.0;
/// Room for corners and legend, in pixels.
const MARGIN: f64 = 40.0;
/// Most triangles that are drawn; a picture of more is a large file with nothing more to see.
const DRAWN: usize = 60_000;
/// Stretch of area from which on the colour no longer changes, as a power of two.
const DEEPEST: f64 = 4.0;

/// Draws parameters as SVG. Blue triangles are shrunk, red ones are blown up in the square; folded ones are black.
///
/// # Errors
/// Those of a triangulation, where the points have no triangles.
pub fn draw_parameters(laid_out: &Parameterized) -> Result<String, Error> {
    let Parameterized { points, parameters, boundary, triangles, closed, .. } = laid_out;
    let is_closed = closed.contains(&true);
    let triangulated;
    let triangles = if triangles.is_empty() {
        triangulated = triangulate_parameters(parameters.view())?;
        &triangulated
    } else {
        triangles
    };
    // Triangles across a seam are drawn where they leave the square.
    let cut = unroll(triangles, parameters.view(), *closed);
    let (points, parameters, triangles) = (&cut.vertices(points.view()), &cut.parameters, &cut.triangles);
    let areas: Vec<[f64; 2]> =
        triangles.iter().map(|t| [area_in_space(points, t), area_in_plane(parameters, t)]).collect();
    let [in_space, in_plane] = [0, 1].map(|k| areas.iter().map(|a| a[k].abs()).sum::<f64>());
    let place = |v: u32| {
        let (u, v) = (parameters[[v as usize, 0]], parameters[[v as usize, 1]]);
        [MARGIN + SIDE * u, MARGIN + SIDE * (1.0 - v)]
    };
    let size = SIDE + 2.0 * MARGIN;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {size} {}\" font-family=\"sans-serif\" font-size=\"14\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n<g stroke=\"#333\" stroke-width=\"0.2\">\n",
        size + MARGIN
    );
    let step = triangles.len().div_ceil(DRAWN).max(1);
    for (triangle, area) in triangles.iter().zip(&areas).step_by(step) {
        let stretch = (area[1] / in_plane) / (area[0] / in_space);
        let [a, b, c] = triangle.map(place);
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            "<path d=\"M{:.2} {:.2}L{:.2} {:.2}L{:.2} {:.2}z\" fill=\"{}\"/>",
            a[0],
            a[1],
            b[0],
            b[1],
            c[0],
            c[1],
            colour(stretch)
        );
    }
    svg += "</g>\n";
    if !boundary.is_empty() && !is_closed {
        let path: Vec<String> =
            boundary.iter().map(|&v| place(v)).map(|p| format!("{:.2},{:.2}", p[0], p[1])).collect();
        let _ = writeln!(
            svg,
            "<polygon points=\"{}\" fill=\"none\" stroke=\"black\" stroke-width=\"1.5\"/>",
            path.join(" ")
        );
    }
    svg += &legend(laid_out, triangles.len(), step, size);
    svg += "</svg>\n";
    Ok(svg)
}

fn legend(laid_out: &Parameterized, triangles: usize, step: usize, size: f64) -> String {
    let report = &laid_out.report;
    let mut text = String::new();
    let corners = [("0,0", 0.0, 1.0), ("1,0", 1.0, 1.0), ("1,1", 1.0, 0.0), ("0,1", 0.0, 0.0)];
    for (name, u, v) in corners {
        let below = if v > 0.5 { 22.0 } else { -10.0 };
        let _ = writeln!(
            text,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{name}</text>",
            MARGIN + SIDE * u,
            MARGIN + SIDE * v + below
        );
    }
    let _ = writeln!(
        text,
        "<text x=\"{MARGIN}\" y=\"{:.1}\">{} points, {triangles} triangles{}, {} folded; {}, {}</text>",
        size + 4.0,
        laid_out.points.nrows(),
        if step > 1 { format!(", one in {step} drawn") } else { String::new() },
        report.folded,
        report.method,
        report.verdict,
    );
    let steps = 2 * DEEPEST as i32;
    for k in 0..=steps {
        let power = f64::from(k) - DEEPEST;
        let x = MARGIN + f64::from(k) * 30.0;
        let _ = writeln!(
            text,
            "<rect x=\"{x}\" y=\"{:.1}\" width=\"30\" height=\"12\" fill=\"{}\"/>",
            size + 12.0,
            colour(power.exp2())
        );
    }
    let _ = writeln!(
        text,
        "<text x=\"{:.1}\" y=\"{:.1}\">area in the square over area on the surface, {} to {}</text>",
        MARGIN + f64::from(steps + 1) * 30.0 + 8.0,
        size + 23.0,
        (-DEEPEST).exp2(),
        DEEPEST.exp2()
    );
    text
}

/// White where areas are kept, red where they grow, blue where they shrink, black where they turn over.
fn colour(stretch: f64) -> String {
    if stretch.is_nan() || stretch <= 0.0 {
        return "#000".to_owned();
    }
    let depth = (stretch.log2() / DEEPEST).clamp(-1.0, 1.0);
    let pale = (255.0 * (1.0 - 0.8 * depth.abs())).round() as u8;
    let full = (255.0 * (1.0 - 0.25 * depth.abs())).round() as u8;
    if depth > 0.0 { format!("#{full:02x}{pale:02x}{pale:02x}") } else { format!("#{pale:02x}{pale:02x}{full:02x}") }
}

fn area_in_space(points: &Array2<f64>, t: &[u32; 3]) -> f64 {
    let [a, b, c] = t.map(|v| std::array::from_fn::<f64, 3, _>(|k| points[[v as usize, k]]));
    let e: [f64; 3] = std::array::from_fn(|k| b[k] - a[k]);
    let f: [f64; 3] = std::array::from_fn(|k| c[k] - a[k]);
    let cross = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
    0.5 * cross.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Positive for triangles that are counter-clockwise.
fn area_in_plane(parameters: &Array2<f64>, t: &[u32; 3]) -> f64 {
    let [a, b, c] = t.map(|v| [parameters[[v as usize, 0]], parameters[[v as usize, 1]]]);
    0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
}
