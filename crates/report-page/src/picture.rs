//! A picture of a scan, coloured by its distances from the surface, for where nothing else can be drawn: in place of the viewer, and small
//! in the page of a batch.

use crate::decimate::bounds;
use crate::{Part, Scan};

/// Bands of signed deviation: up to how many tolerances each reaches, and its colour. Blue and orange differ for every kind of colour
/// blindness, and light and dark for all eyes.
pub const BANDS: [(f64, [u8; 3]); 9] = [
    (-4.0, [8, 48, 107]),
    (-2.0, [33, 102, 172]),
    (-1.0, [80, 150, 205]),
    (-0.5, [178, 210, 232]),
    (0.5, [232, 232, 228]),
    (1.0, [252, 214, 168]),
    (2.0, [244, 153, 62]),
    (4.0, [204, 85, 16]),
    (f64::INFINITY, [122, 38, 0]),
];

/// Samples per pixel and direction.
const FINER: usize = 2;

/// Share of the picture's smaller side that is left free on each side.
const MARGIN: f64 = 0.04;

/// Largest radius of a point, in samples.
const MOST_RADIUS: f64 = 6.0;

/// Mean length of the normals of a surface, each weighed by area, from which on it is looked at from where they point: a surface that
/// closes has 0.
const FACES_ONE_WAY: f64 = 0.35;

/// Component along z from which on one looks along it.
const ALONG: f64 = 0.7;

/// Height in widths from which on a part is laid down.
const TALL: f64 = 2.2;

/// From where things are looked at.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct View {
    /// Towards the eye, of length 1.
    pub eye: [f64; 3],
    /// Upward, of length 1 and across `eye`.
    pub up: [f64; 3],
}

impl View {
    /// In front of where the surfaces face, a little from above and from the side; of closed ones from a corner of their box. `up` is the
    /// axis that points upward, if one is known to.
    pub fn of(parts: &[Part], up: Option<[f64; 3]>) -> Self {
        let (mut sum, mut area) = ([0.0; 3], 0.0);
        for surface in parts.iter().map(|part| &part.surface) {
            for corners in &surface.triangles {
                let [p, q, r] = corners.map(|v| surface.vertices[v as usize]);
                let normal = cross(sub(q, p), sub(r, p));
                // Normals of vertices are on the outside; triangles go by the parameters.
                let outside = surface.normals.get(corners[0] as usize).copied().unwrap_or(normal);
                let sign = if dot(normal, outside) < 0.0 { -1.0 } else { 1.0 };
                sum = [0, 1, 2].map(|k| sum[k] + sign * normal[k]);
                area += norm(normal);
            }
        }
        let faces_one_way = area > 0.0 && norm(sum) > FACES_ONE_WAY * area;
        let front = if faces_one_way { unit(sum) } else { unit([0.6, -1.0, 0.5]) };
        let axis = |k: usize| [0, 1, 2].map(|j| if j == k { 1.0 } else { 0.0 });
        // z is up in CAD; where one looks along it, y.
        let usual = if front[2].abs() < ALONG { axis(2) } else { axis(1) };
        let upward = up.map_or(usual, |up| if dot(up, front).abs() < 0.999 { up } else { axis(1) });
        let up_of = |eye: [f64; 3]| unit(sub(upward, eye.map(|x| x * dot(upward, eye))));
        if !faces_one_way {
            return Self { eye: front, up: up_of(front) }.lying(parts, up.is_some());
        }
        let (above, side) = (up_of(front), cross(up_of(front), front));
        // Heights are looked at from lower down: from straight above they show nothing.
        let (tilt, turn) = if up.is_some() { (-0.9, 0.35) } else { (0.25, 0.35) };
        let eye = unit([0, 1, 2].map(|k| front[k] + tilt * above[k] + turn * side[k]));
        Self { eye, up: up_of(eye) }.lying(parts, up.is_some())
    }

    /// The same from where long parts lie, as pictures are wide; what is up stays up.
    fn lying(self, parts: &[Part], is_up_known: bool) -> Self {
        let right = cross(self.up, self.eye);
        let vertices = parts.iter().flat_map(|part| part.surface.vertices.iter());
        let (lower, upper) = bounds(vertices.map(|&p| [dot(p, right), dot(p, self.up), 0.0]));
        let is_tall = upper[1] - lower[1] > TALL * (upper[0] - lower[0]);
        if is_tall && !is_up_known { Self { up: right.map(|x| -x), ..self } } else { self }
    }
}

/// A picture with samples that have a depth.
pub struct Picture {
    size: [usize; 2],
    colours: Vec<[u8; 4]>,
    depths: Vec<f32>,
}

/// Draws scans, coloured by bands of deviation, in front of their surfaces; `size` in pixels.
pub fn draw(parts: &[Part], tolerance: f64, view: View, size: [usize; 2]) -> Picture {
    let mut picture = Picture::new(size.map(|pixels| FINER * pixels));
    let right = cross(view.up, view.eye);
    let flat = |p: [f64; 3]| [dot(p, right), dot(p, view.up), dot(p, view.eye)];
    let all = || parts.iter().flat_map(|part| part.surface.vertices.iter().chain(&part.scan.points)).copied();
    let (lower, upper) = bounds(all().map(flat));
    let room = picture.size.map(|samples| samples as f64 * (1.0 - 2.0 * MARGIN));
    let extent = [0, 1].map(|k| (upper[k] - lower[k]).max(f64::MIN_POSITIVE));
    let scale = (room[0] / extent[0]).min(room[1] / extent[1]).min(f64::MAX);
    let middle = [0, 1].map(|k| 0.5 * (lower[k] + upper[k]));
    let [width, height] = picture.size.map(|samples| samples as f64);
    let place = |p: [f64; 3]| {
        let [x, y, z] = flat(p);
        [0.5 * width + scale * (x - middle[0]), 0.5 * height - scale * (y - middle[1]), scale * z]
    };
    // What is drawn of the scan wins where both are in one place.
    let back = 0.004 * width;
    for part in parts {
        let vertices: Vec<[f64; 3]> = part.surface.vertices.iter().map(|&p| place(p)).collect();
        for corners in &part.surface.triangles {
            let [p, q, r] = corners.map(|v| vertices[v as usize]).map(|[x, y, z]| [x, y, z - back]);
            picture.triangle([p, q, r], |_| [190, 192, 196]);
        }
        draw_scan(&mut picture, &part.scan, tolerance, view.eye, &place);
    }
    picture
}

fn draw_scan(picture: &mut Picture, scan: &Scan, tolerance: f64, eye: [f64; 3], place: &dyn Fn([f64; 3]) -> [f64; 3]) {
    let at: Vec<[f64; 3]> = scan.points.iter().map(|&p| place(p)).collect();
    let deviation = |i: u32| scan.deviations.get(i as usize).copied().unwrap_or(0.0) / tolerance;
    if !scan.triangles.is_empty() {
        for corners in &scan.triangles {
            let known = |v: u32| at.get(v as usize).copied().unwrap_or_default();
            let of_corners = corners.map(deviation);
            picture.triangle(corners.map(known), |w| colour((0..3).map(|k| w[k] * of_corners[k]).sum()));
        }
        return;
    }
    let (lower, upper) = bounds(at.iter().copied());
    let area = (upper[0] - lower[0]) * (upper[1] - lower[1]);
    let radius = (0.7 * (area / at.len().max(1) as f64).sqrt()).clamp(1.0, MOST_RADIUS);
    for (i, &p) in at.iter().enumerate() {
        let facing = scan.normals.get(i).map_or(1.0, |&normal| dot(normal, eye).abs());
        picture.disc(p, radius, colour(deviation(i as u32)).map(|c| (f64::from(c) * (0.55 + 0.45 * facing)) as u8));
    }
}

/// The colour of a deviation in tolerances.
fn colour(deviation: f64) -> [u8; 3] {
    BANDS.iter().find(|(upper, _)| deviation <= *upper).unwrap_or(&BANDS[BANDS.len() - 1]).1
}

impl Picture {
    fn new(size: [usize; 2]) -> Self {
        let count = size[0] * size[1];
        Self { size, colours: vec![[0; 4]; count], depths: vec![f32::NEG_INFINITY; count] }
    }

    fn set(&mut self, x: usize, y: usize, depth: f64, [r, g, b]: [u8; 3]) {
        let at = y * self.size[0] + x;
        if depth as f32 > self.depths[at] {
            self.depths[at] = depth as f32;
            self.colours[at] = [r, g, b, 255];
        }
    }

    /// The samples from one place to another in a direction, within the picture.
    fn samples(&self, d: usize, from: f64, to: f64) -> std::ops::Range<usize> {
        let most = self.size[d] as f64;
        // Conversions saturate, and NaN becomes 0.
        from.ceil().clamp(0.0, most) as usize..(to.floor() + 1.0).clamp(0.0, most) as usize
    }

    /// A triangle, shaded by how it faces the eye; `colour` is asked with barycentric coordinates.
    fn triangle(&mut self, [p, q, r]: [[f64; 3]; 3], colour: impl Fn([f64; 3]) -> [u8; 3]) {
        let normal = cross(sub(q, p), sub(r, p));
        let twice = normal[2];
        if twice.abs() < 1e-12 || !twice.is_finite() {
            return;
        }
        let shade = 0.55 + 0.45 * (twice / norm(normal)).abs();
        let range = |d: usize| {
            let (low, high) = (p[d].min(q[d]).min(r[d]), p[d].max(q[d]).max(r[d]));
            (low, high)
        };
        let ((x0, x1), (y0, y1)) = (range(0), range(1));
        for y in self.samples(1, y0, y1) {
            for x in self.samples(0, x0, x1) {
                let at = [x as f64, y as f64];
                let part = |a: [f64; 3], b: [f64; 3]| {
                    ((a[0] - at[0]) * (b[1] - at[1]) - (a[1] - at[1]) * (b[0] - at[0])) / twice
                };
                let w = [part(q, r), part(r, p), part(p, q)];
                if w.iter().all(|&w| w >= -1e-9) {
                    let depth = w[0] * p[2] + w[1] * q[2] + w[2] * r[2];
                    self.set(x, y, depth, colour(w).map(|c| (f64::from(c) * shade) as u8));
                }
            }
        }
    }

    fn disc(&mut self, [px, py, depth]: [f64; 3], radius: f64, colour: [u8; 3]) {
        for y in self.samples(1, py - radius, py + radius) {
            for x in self.samples(0, px - radius, px + radius) {
                if (x as f64 - px).hypot(y as f64 - py) <= radius {
                    self.set(x, y, depth, colour);
                }
            }
        }
    }

    /// The picture as a PNG file, clear where nothing is.
    pub fn to_png(&self) -> Vec<u8> {
        let [width, height] = self.size.map(|samples| samples / FINER);
        let mut pixels = Vec::with_capacity(4 * width * height);
        for y in 0..height {
            for x in 0..width {
                let of = (0..FINER * FINER)
                    .map(|k| self.colours[(FINER * y + k / FINER) * self.size[0] + FINER * x + k % FINER]);
                let (mut sum, mut solid) = ([0u32; 3], 0u32);
                for [r, g, b, a] in of {
                    let weight = u32::from(a) / 255;
                    sum = [
                        sum[0] + weight * u32::from(r),
                        sum[1] + weight * u32::from(g),
                        sum[2] + weight * u32::from(b),
                    ];
                    solid += weight;
                }
                pixels.extend(sum.map(|c| (c / solid.max(1)) as u8));
                pixels.push((255 * solid / (FINER * FINER) as u32) as u8);
            }
        }
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, width as u32, height as u32);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        // Writing into a vector does not fail; a picture without pixels has no file.
        let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&pixels));
        if written.is_ok() { file } else { Vec::new() }
    }
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = norm(a);
    if length > 0.0 { a.map(|x| x / length) } else { [0.0, 0.0, 1.0] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Surface;

    fn square() -> Part {
        let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let surface = Surface { vertices: points.clone(), triangles: vec![[0, 1, 2], [0, 2, 3]], ..Surface::default() };
        Part {
            scan: Scan { points, deviations: vec![-9.0, 9.0, 9.0, -9.0], ..Scan::default() },
            surface,
            ..Part::default()
        }
    }

    #[test]
    fn colours_go_with_the_sign() {
        let mut part = square();
        let view = View { eye: [0.0, 0.0, 1.0], up: [0.0, 1.0, 0.0] };
        part.scan.triangles = part.surface.triangles.clone();
        let picture = draw(&[part], 1.0, view, [40, 40]);
        let at = |x: usize, y: usize| picture.colours[y * 80 + x];
        let (left, right) = (at(8, 40), at(71, 40));
        assert!(left[2] > left[0] && right[0] > right[2], "{left:?} {right:?}");
        assert_eq!(at(1, 1), [0; 4]);
        assert_eq!(&picture.to_png()[1..4], b"PNG");
    }

    #[test]
    fn an_open_surface_is_looked_at_from_its_front() {
        let view = View::of(&[square()], None);
        assert!(view.eye[2] > 0.8 && dot(view.eye, view.up).abs() < 1e-12 && (norm(view.eye) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn long_parts_lie() {
        for axis in 0..2 {
            let mut part = square();
            part.surface.vertices.iter_mut().for_each(|p| p[axis] *= 9.0);
            let view = View::of(&[part], None);
            assert!(view.up[axis].abs() < 0.5 && dot(view.eye, view.up).abs() < 1e-12, "{view:?}");
        }
    }

    #[test]
    fn nothing_and_a_single_point_have_a_picture_too() {
        let view = View::of(&[], None);
        assert!(draw(&[], 1.0, view, [8, 8]).colours.iter().all(|c| *c == [0; 4]));
        let scan = Scan { points: vec![[5.0; 3]], deviations: vec![0.0], ..Scan::default() };
        let part = Part { scan, ..Part::default() };
        draw(&[part], 0.0, view, [8, 8]).to_png();
    }
}
