//! SVG: a curve as a path that browsers, drawing programs and cutters read.
//!
//! Each span becomes cubic Bézier segments: exactly up to degree 3, from degree 4 on so finely that they deviate by less
//! than 10⁻⁶ of the diagonal where they are compared. The picture is as large as the curve, in its unit; the y axis points
//! up. A curve in space is drawn in the plane of the two axes along which it extends most. A function (one coordinate) is
//! drawn over its parameter; functions and graphs get a frame of fixed size, with each axis scaled for itself.

use std::fmt::Write;

use ndarray::Array2;
use thb_core::{CellSpace, SplineMap};

use super::{Geometry, Model, ModelErrorKind};

/// Key of a model's metadata that is `true` where the first coordinate of a curve is its parameter.
pub const GRAPH: &str = "graph";

/// What is drawn besides the curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SvgOptions {
    /// Points, `(m, N)`, drawn as dots.
    pub points: Option<Array2<f64>>,
    /// Whether the places of knots are drawn, as small circles.
    pub knots: bool,
}

/// Largest deviation of a cubic from a curve of higher degree, as a share of the diagonal.
const DEVIATION: f64 = 1e-6;
/// Halvings of a span at most, on the way there.
const HALVINGS: usize = 10;
/// Frame of a graph, in millimetres.
const FRAME: [f64; 2] = [160.0, 120.0];
/// Room round the curve, width of lines and radius of dots, as shares of the larger side.
const MARGIN: f64 = 0.04;
const LINE: f64 = 0.003;
const DOT: f64 = 0.004;

/// From coordinates to the page.
struct Page {
    axes: [Option<usize>; 2],
    lower: [f64; 2],
    scale: [f64; 2],
    /// In millimetres, without the margin.
    size: [f64; 2],
}

impl Page {
    /// `None` for the axis of the parameter.
    fn place(&self, u: f64, point: &[f64]) -> [f64; 2] {
        let coordinate = |k: usize| self.axes[k].map_or(u, |axis| point.get(axis).copied().unwrap_or(0.0));
        let [x, y] = [0, 1].map(|k| self.scale[k] * (coordinate(k) - self.lower[k]));
        [x + self.margin(), self.size[1] - y + self.margin()]
    }

    fn margin(&self) -> f64 {
        MARGIN * self.size[0].max(self.size[1])
    }

    fn new(map: &SplineMap<1>, model: &Model, points: Option<&Array2<f64>>) -> Result<Self, ModelErrorKind> {
        let (lower_u, upper_u) = map.space().domain();
        let rows = map.coefficients();
        let extents: Vec<[f64; 2]> = (0..map.dim())
            .map(|k| {
                let drawn = points.filter(|p| p.ncols() == map.dim()).map(|p| p.column(k).to_vec());
                let all = rows.column(k).to_vec().into_iter().chain(drawn.unwrap_or_default());
                all.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)])
            })
            .collect();
        let mut axes: Vec<usize> = (0..map.dim()).collect();
        axes.sort_by(|&a, &b| (extents[b][1] - extents[b][0]).total_cmp(&(extents[a][1] - extents[a][0])));
        axes.truncate(2);
        axes.sort_unstable();
        let is_graph = model.metadata.get(GRAPH) == Some(&serde_json::Value::Bool(true));
        let (axes, [x, y]) = match axes[..] {
            [only] => ([None, Some(only)], [[lower_u[0], upper_u[0]], extents[only]]),
            _ if is_graph => ([Some(0), Some(1)], [extents[0], extents[1]]),
            [first, second, ..] => ([Some(first), Some(second)], [extents[first], extents[second]]),
            [] => return Err(ModelErrorKind::PointDimension { given: 0 }),
        };
        let sides = [x[1] - x[0], y[1] - y[0]];
        let scale = if axes[0].is_none() || is_graph {
            [0, 1].map(|k| if sides[k] > 0.0 { FRAME[k] / sides[k] } else { 1.0 })
        } else {
            [model.unit.millimetres(); 2]
        };
        let size = [0, 1].map(|k| scale[k] * sides[k]);
        if !(size[0].max(size[1]) > 0.0 && size.iter().all(|s| s.is_finite())) {
            return Err(ModelErrorKind::Degenerate {
                lower: lower_u.to_vec(),
                upper: upper_u.to_vec(),
                tolerance: f64::MIN_POSITIVE,
            });
        }
        Ok(Self { axes, lower: [x[0], y[0]], scale, size })
    }
}

/// A picture of a model that is a curve.
///
/// # Errors
/// [`ModelErrorKind::CurvesOnly`] for a surface, [`ModelErrorKind::Degenerate`] for a curve that is a point.
pub fn draw_svg(model: &Model, options: &SvgOptions) -> Result<String, ModelErrorKind> {
    let Geometry::Curve(map) = &model.geometry else {
        return Err(ModelErrorKind::CurvesOnly { format: "SVG" });
    };
    let page = Page::new(map, model, options.points.as_ref())?;
    let [width, height] = page.size.map(|side| side + 2.0 * page.margin());
    let unit = page.size[0].max(page.size[1]);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"{height}mm\" viewBox=\"0 0 {width} \
         {height}\">\n"
    );
    // Writing to a string cannot fail.
    if let Some(points) = &options.points {
        let _ = writeln!(svg, "<g fill=\"#888\">");
        for point in points.outer_iter().filter(|p| p.len() == map.dim()) {
            let [x, y] = page.place(point[0], &point.to_vec());
            let _ = writeln!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{}\"/>", DOT * unit);
        }
        svg += "</g>\n";
    }
    let _ = write!(svg, "<path fill=\"none\" stroke=\"#c22\" stroke-width=\"{}\" d=\"", LINE * unit);
    let mut segments = Vec::new();
    for cell in 0..map.space().n_cells() {
        segments.extend(cubics(map, &page, cell));
    }
    let far = DEVIATION * page.size[0].hypot(page.size[1]);
    let mut before: Option<[f64; 2]> = None;
    for [a, b, c, d] in &segments {
        // The curve may jump at a knot of multiplicity above the degree.
        if before.is_none_or(|p| (p[0] - a[0]).hypot(p[1] - a[1]) > far) {
            let _ = write!(svg, "M{} {}", a[0], a[1]);
        }
        let _ = write!(svg, "\nC{} {} {} {} {} {}", b[0], b[1], c[0], c[1], d[0], d[1]);
        before = Some(*d);
    }
    let closed = map.space().periodic()[0];
    svg += if closed { "Z\"/>\n" } else { "\"/>\n" };
    if options.knots {
        let _ = writeln!(svg, "<g fill=\"white\" stroke=\"#226\" stroke-width=\"{}\">", 0.5 * LINE * unit);
        for cell in 0..map.space().n_cells() {
            for u in std::iter::once(map.space().cell(cell).lower[0])
                .chain((cell + 1 == map.space().n_cells() && !closed).then(|| map.space().cell(cell).upper[0]))
            {
                let [x, y] = page.place(u, &map.eval([u])?);
                let _ = writeln!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{}\"/>", DOT * unit);
            }
        }
        svg += "</g>\n";
    }
    svg += "</svg>\n";
    Ok(svg)
}

type Cubic = [[f64; 2]; 4];

/// The Bézier segments of a span, on the page.
fn cubics(map: &SplineMap<1>, page: &Page, cell: usize) -> Vec<Cubic> {
    let bezier = map.bezier();
    let (lower, upper) = bezier.cell_box(cell);
    let place = |u: f64, order: usize| {
        let mut value = vec![0.0; map.dim()];
        bezier.derivative(cell, [u], [order], &mut value);
        value
    };
    let end = |u: f64| page.place(u, &place(u, 0));
    // Derivatives are differences of places.
    let slope = |u: f64| {
        let (zero, along) = (page.place(0.0, &vec![0.0; map.dim()]), page.place(1.0, &place(u, 1)));
        [along[0] - zero[0], along[1] - zero[1]]
    };
    let hermite = |a: f64, b: f64| -> Cubic {
        let (p, q, s, t, third) = (end(a), end(b), slope(a), slope(b), (b - a) / 3.0);
        [p, [p[0] + third * s[0], p[1] + third * s[1]], [q[0] - third * t[0], q[1] - third * t[1]], q]
    };
    let exact = bezier.degree()[0] <= 3;
    let tolerance = DEVIATION * page.size[0].hypot(page.size[1]);
    let mut segments = Vec::new();
    let mut open = vec![(lower[0], upper[0], 0)];
    while let Some((a, b, depth)) = open.pop() {
        let cubic = hermite(a, b);
        let near = |t: f64| {
            let (p, q) = (at(&cubic, t), end(a + t * (b - a)));
            (p[0] - q[0]).hypot(p[1] - q[1]) <= tolerance
        };
        if exact || depth == HALVINGS || [0.25, 0.5, 0.75].into_iter().all(near) {
            segments.push(cubic);
        } else {
            let middle = 0.5 * (a + b);
            open.extend([(middle, b, depth + 1), (a, middle, depth + 1)]);
        }
    }
    segments
}

fn at([a, b, c, d]: &Cubic, t: f64) -> [f64; 2] {
    let s = 1.0 - t;
    [0, 1].map(|k| s * s * s * a[k] + 3.0 * s * s * t * b[k] + 3.0 * s * t * t * c[k] + t * t * t * d[k])
}
