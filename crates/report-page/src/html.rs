//! The page of one fit.

use base64::Engine;
use serde::Serialize;
use serde_json::json;

use crate::bytes::{LARGEST_NUMBER, Section, Sections, quantize};
use crate::decimate::{MOST_POINTS, bounds, shown_points};
use crate::picture::{BANDS, View, draw};
use crate::statistics::quantiles;
use crate::{Part, Scan, Surface};

/// Bytes that a page has at most beside those of its points and vertices, and for each of these.
///
/// Derived: what the documentation of the page promises.
pub(crate) const MOST_BYTES: usize = 3_000_000;
pub(crate) const MOST_BYTES_A_POINT: usize = 12;

/// Shares of the points at which the distribution of the deviation is given, one more than parts.
const QUANTILES: usize = 2000;

/// Points left out before the fit that are shown at most.
const MOST_LEFT_OUT: usize = 20_000;

/// Diagonals from the box of the surfaces within which such points are shown: farther ones would make everything else small.
const SHOWN_AROUND: f64 = 0.5;

/// Pixels of the picture that stands where the viewer cannot run.
const PICTURE: [usize; 2] = [900, 600];

/// How good something is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tone {
    /// As it should be.
    #[default]
    Good,
    /// To be looked at.
    Usable,
    /// Not as it should be.
    Failed,
}

/// What stands at the head of a page.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Headline {
    /// Name of the part.
    pub title: String,
    /// The verdict in one word.
    pub verdict: String,
    /// What to think of it.
    pub tone: Tone,
    /// The few figures that count.
    pub figures: Vec<Fact>,
}

/// A name and a value.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Fact {
    /// What it is.
    pub name: String,
    /// How much it is.
    pub value: String,
}

impl Fact {
    /// A fact.
    pub fn new(name: impl Into<String>, value: impl ToString) -> Self {
        Self { name: name.into(), value: value.to_string() }
    }
}

/// Why the verdict is what it is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reason {
    /// How bad it is.
    pub tone: Tone,
    /// A sentence.
    pub text: String,
    /// Where it is worst, if at one place.
    pub place: Option<[f64; 3]>,
}

/// A place to look at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Place {
    /// What is there.
    pub what: String,
    /// How far off, in the unit of the coordinates; signed where signs are known.
    pub deviation: f64,
    /// Where.
    pub place: [f64; 3],
}

/// A step of the fit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Step {
    /// Control points.
    pub control_points: usize,
    /// Largest distance.
    pub largest: f64,
    /// Root of the mean squared distance.
    pub rms: f64,
    /// Share of the points within the tolerance.
    pub within: f64,
}

/// What a page shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Page {
    /// The head.
    pub headline: Headline,
    /// Why the verdict is what it is.
    pub reasons: Vec<Reason>,
    /// What the user should know besides.
    pub warnings: Vec<String>,
    /// Surfaces and what they were fitted to.
    pub parts: Vec<Part>,
    /// The tolerance.
    pub tolerance: f64,
    /// Share of the scan asked for within it.
    pub within: f64,
    /// The unit of the coordinates.
    pub unit: String,
    /// Whether the scan has a side, so that signs mean something.
    pub is_signed: bool,
    /// What signs mean, or why there are none, in a sentence.
    pub signs: String,
    /// What the shares are of, as in "of the points".
    pub shares_of: String,
    /// How these shares differ from those that the verdict goes by, in a sentence.
    pub shares_note: String,
    /// Places to look at, the worst first.
    pub worst: Vec<Place>,
    /// The steps of the fit.
    pub steps: Vec<Step>,
    /// A table of what else was tried: its head and its rows.
    pub tried: Vec<Vec<String>>,
    /// Where it came from.
    pub facts: Vec<Fact>,
    /// All options.
    pub options: Vec<Fact>,
    /// The direction that is up, if one is.
    pub up: Option<[f64; 3]>,
}

const SHELL: &str = include_str!("../assets/page.html");
const STYLE: &str = include_str!("../assets/page.css");
const THREE: &str = include_str!("../assets/three.js");
const SCRIPTS: [&str; 5] = [
    include_str!("../assets/data.js"),
    include_str!("../assets/shaders.js"),
    include_str!("../assets/viewer.js"),
    include_str!("../assets/plots.js"),
    include_str!("../assets/page.js"),
];

/// How much of a page there is room for.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Detail {
    All,
    WithoutTriangles,
    PointsOnly,
}

impl Page {
    /// The page. What there is no room for is left out: the triangles of the scan first, which then is shown as points.
    pub fn to_html(&self) -> String {
        let view = View::of(&self.parts, self.up);
        let picture = draw(&self.parts, self.tolerance, view, PICTURE).to_png();
        let mut page = String::new();
        for detail in [Detail::All, Detail::WithoutTriangles, Detail::PointsOnly] {
            let (data, letters, shown) = self.data(view, detail);
            page = fill(&self.headline, &picture, &data, &letters);
            if page.len() <= MOST_BYTES + MOST_BYTES_A_POINT * shown {
                break;
            }
        }
        page
    }

    /// A small picture of the parts, as PNG.
    pub fn thumbnail(&self, size: [usize; 2]) -> Vec<u8> {
        draw(&self.parts, self.tolerance, View::of(&self.parts, self.up), size).to_png()
    }

    /// What scripts read, the arrays in letters, and the number of points and vertices among them.
    fn data(&self, view: View, detail: Detail) -> (serde_json::Value, String, usize) {
        let frame = Frame::of(&self.parts);
        let mut sections = Sections::default();
        let mut parts = Vec::new();
        let all: usize = self.parts.iter().map(|part| part.scan.points.len()).sum();
        for (number, part) in self.parts.iter().enumerate() {
            // Each part gets its share of the points that may be shown.
            let most = (MOST_POINTS as u128 * part.scan.points.len() as u128 / all.max(1) as u128) as usize;
            let name = |what: &str| format!("{number}.{what}");
            let left_out = add_scan(&mut sections, &frame, &part.scan, self.tolerance, most, detail, &name);
            add_surface(&mut sections, &frame, &part.surface, detail, &name);
            parts.push(json!({ "name": part.name, "points": part.scan.points.len(), "leftOut": left_out }));
        }
        let is_shown =
            |name: &str| name.ends_with(".points") || name.ends_with(".vertices") || name.ends_with(".control");
        let shown = sections.table.iter().filter(|s| is_shown(&s.name)).map(|s| s.count).sum();
        let table: &[Section] = &sections.table;
        let signed = |i: f64| if self.is_signed { i } else { i.abs() };
        let deviations = self.parts.iter().flat_map(|part| part.scan.deviations.iter().map(|&d| signed(d)));
        let weights: Vec<f64> = self.parts.iter().flat_map(|part| part.scan.weights.iter().copied()).collect();
        let data = json!({
            "sections": table,
            "parts": parts,
            "lower": frame.lower,
            "upper": frame.upper,
            "largest": frame.largest,
            "view": view,
            "tolerance": self.tolerance,
            "within": self.within,
            "unit": self.unit,
            "signed": self.is_signed,
            "signs": self.signs,
            "sharesOf": self.shares_of,
            "sharesNote": self.shares_note,
            "bands": BANDS.map(|(upper, colour)| json!({ "upper": upper.is_finite().then_some(upper), "colour": colour })),
            "quantiles": quantiles(deviations, &weights, QUANTILES),
            "headline": self.headline,
            "reasons": self.reasons,
            "warnings": self.warnings,
            "worst": self.worst,
            "steps": self.steps,
            "tried": self.tried,
            "facts": self.facts,
            "options": self.options,
        });
        (data, sections.to_text(), shown)
    }
}

/// The box that coordinates are numbers in, and the largest deviation.
struct Frame {
    lower: [f64; 3],
    upper: [f64; 3],
    largest: f64,
}

impl Frame {
    fn of(parts: &[Part]) -> Self {
        let of_part = |part: &Part| {
            let scan = part.scan.points.iter();
            scan.chain(&part.surface.vertices).copied().collect::<Vec<_>>()
        };
        let inner = bounds(parts.iter().flat_map(of_part));
        let around = SHOWN_AROUND * distance(inner.0, inner.1);
        let is_near = |p: &[f64; 3]| (0..3).all(|k| p[k] >= inner.0[k] - around && p[k] <= inner.1[k] + around);
        let beside = parts.iter().flat_map(|part| part.scan.left_out.iter().chain(&part.surface.control_points));
        let beside = beside.copied().filter(is_near);
        let (lower, upper) = bounds([inner.0, inner.1].into_iter().chain(beside));
        let deviations = parts.iter().flat_map(|part| &part.scan.deviations);
        let largest = deviations.fold(0.0_f64, |largest, d| largest.max(d.abs()));
        Self { lower, upper, largest }
    }

    fn place(&self, p: [f64; 3]) -> [u16; 3] {
        std::array::from_fn(|k| quantize(p[k], self.lower[k], self.upper[k]))
    }

    fn holds(&self, p: &[f64; 3]) -> bool {
        (0..3).all(|k| p[k] >= self.lower[k] && p[k] <= self.upper[k])
    }
}

/// Adds the arrays of a scan; returns how many points that were left out are shown.
fn add_scan(
    sections: &mut Sections,
    frame: &Frame,
    scan: &Scan,
    tolerance: f64,
    most: usize,
    detail: Detail,
    name: &dyn Fn(&str) -> String,
) -> usize {
    let shown = shown_points(&scan.points, &scan.deviations, tolerance, most);
    let of = |i: &u32| *i as usize;
    let places: Vec<[u16; 3]> = shown.iter().map(|i| frame.place(scan.points[of(i)])).collect();
    sections.add_numbers(&name("points"), &places);
    let deviation = |i: &u32| scan.deviations.get(of(i)).copied().unwrap_or(0.0);
    let deviations: Vec<[u16; 1]> =
        shown.iter().map(|i| [quantize(deviation(i), -frame.largest, frame.largest)]).collect();
    sections.add_numbers(&name("deviations"), &deviations);
    if scan.parameters.len() == scan.points.len() && detail < Detail::PointsOnly {
        let parameters: Vec<[u16; 2]> =
            shown.iter().map(|i| scan.parameters[of(i)].map(|x| (x.clamp(0.0, 1.0) * LARGEST_NUMBER) as u16)).collect();
        sections.add_numbers(&name("parameters"), &parameters);
    }
    if scan.normals.len() == scan.points.len() && detail < Detail::PointsOnly {
        let coarse = |i: &u32| scan.normals[of(i)].map(|x| quantize(x, -1.0, 1.0) & SHADE_BITS);
        sections.add_numbers(&name("shading"), &shown.iter().map(coarse).collect::<Vec<_>>());
    }
    if scan.set_aside.iter().any(|&is_aside| is_aside) {
        let aside: Vec<[u32; 1]> = (0..shown.len() as u32)
            .filter(|&k| scan.set_aside.get(of(&shown[k as usize])).is_some_and(|&is_aside| is_aside))
            .map(|k| [k])
            .collect();
        sections.add_indices(&name("set-aside"), &aside);
    }
    if shown.len() == scan.points.len() && detail == Detail::All {
        sections.add_indices(&name("triangles"), &renumbered(&scan.triangles, &shown));
    }
    let left_out: Vec<[u16; 3]> = scan.left_out.iter().filter(|p| frame.holds(p)).map(|&p| frame.place(p)).collect();
    let step = left_out.len().div_ceil(MOST_LEFT_OUT).max(1);
    let left_out: Vec<[u16; 3]> = left_out.into_iter().step_by(step).collect();
    sections.add_numbers(&name("left-out"), &left_out);
    left_out.len()
}

fn add_surface(
    sections: &mut Sections,
    frame: &Frame,
    surface: &Surface,
    detail: Detail,
    name: &dyn Fn(&str) -> String,
) {
    let places = |points: &[[f64; 3]]| points.iter().map(|&p| frame.place(p)).collect::<Vec<_>>();
    sections.add_numbers(&name("vertices"), &places(&surface.vertices));
    let normals: Vec<[u16; 3]> =
        surface.normals.iter().map(|n| n.map(|x| quantize(x, -1.0, 1.0) & NORMAL_BITS)).collect();
    sections.add_numbers(&name("normals"), &normals);
    sections.add_indices(&name("faces"), &surface.triangles);
    sections.add_indices(&name("cell-lines"), &surface.cell_lines);
    sections.add_indices(&name("face-lines"), &surface.face_lines);
    // Beyond the box a number would stand for another place.
    let is_inside: Vec<bool> = surface.control_points.iter().map(|p| frame.holds(p)).collect();
    let lines = surface.control_lines.iter().filter(|ends| ends.iter().all(|&end| is_inside[end as usize]));
    sections.add_numbers(&name("control"), &places(&surface.control_points));
    sections.add_indices(&name("control-lines"), &lines.copied().collect::<Vec<_>>());
    if detail < Detail::PointsOnly {
        let cells: Vec<[u16; 4]> = surface
            .cells
            .iter()
            .map(|cell| cell.map(|x| (x.clamp(0.0, 1.0) * LARGEST_NUMBER).round() as u16))
            .collect();
        sections.add_numbers(&name("cells"), &cells);
    }
}

/// Bits of a component of a normal: 12, so that reflections are smooth and the rest compresses.
const NORMAL_BITS: u16 = !0xf;

/// Bits of a component of the normal of a point: 8, enough for light and shade.
const SHADE_BITS: u16 = !0xff;

/// Triangles over the points in another order, beginning with their first corner, in the order of that.
fn renumbered(triangles: &[[u32; 3]], order: &[u32]) -> Vec<[u32; 3]> {
    let mut place = vec![0u32; order.len()];
    order.iter().zip(0..).for_each(|(&i, k)| place[i as usize] = k);
    let known = |t: &&[u32; 3]| t.iter().all(|&v| (v as usize) < place.len());
    let mut found: Vec<[u32; 3]> = triangles
        .iter()
        .filter(known)
        .map(|t| {
            let [a, b, c] = t.map(|v| place[v as usize]);
            if a <= b && a <= c {
                [a, b, c]
            } else if b <= c {
                [b, c, a]
            } else {
                [c, a, b]
            }
        })
        .collect();
    found.sort_unstable();
    found
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// Puts everything into the shell.
fn fill(headline: &Headline, picture: &[u8], data: &serde_json::Value, letters: &str) -> String {
    let picture = base64::engine::general_purpose::STANDARD.encode(picture);
    let scripts = SCRIPTS.join("\n");
    let data = json_in_script(data);
    let title = escaped(&headline.title);
    filled(
        SHELL,
        &[
            ("title", &title),
            ("verdict", &escaped(&headline.verdict)),
            ("style", STYLE),
            ("picture", &picture),
            ("data", &data),
            ("arrays", letters),
            ("three", THREE),
            ("scripts", &scripts),
        ],
    )
}

/// A text with `{{name}}` replaced by values; what these hold is not looked at again.
pub(crate) fn filled(shell: &str, values: &[(&str, &str)]) -> String {
    let mut page = String::with_capacity(shell.len() + values.iter().map(|(_, value)| value.len()).sum::<usize>());
    let mut rest = shell;
    while let Some((before, after)) = rest.split_once("{{") {
        let Some((name, behind)) = after.split_once("}}") else { break };
        page += before;
        page += values.iter().find(|(known, _)| *known == name).map_or("", |(_, value)| value);
        rest = behind;
    }
    page + rest
}

/// JSON as the text of a script element: nothing in it can end the element or begin a comment.
pub(crate) fn json_in_script(value: &impl Serialize) -> String {
    let text = serde_json::to_string(value).unwrap_or_else(|_| "null".to_owned());
    text.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026")
}

/// Text in HTML, in elements and in attributes.
pub(crate) fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\'' => escaped += "&#39;",
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests;
