//! Outlines in the plane, of straight and round sections.

/// A stretch of an outline in the plane.
#[derive(Clone, Copy, Debug)]
pub(super) enum Section {
    /// From one point to another.
    Line([f64; 2], [f64; 2]),
    /// From one angle to another round a centre.
    Arc { centre: [f64; 2], radius: f64, from: f64, to: f64 },
}

/// Directions that differ by more, as the sine of the angle, meet at a corner.
///
/// Limit: tangents of neighbours that are one differ by round-off.
const SHARP_SINE: f64 = 1e-6;

impl Section {
    pub(super) fn length(&self) -> f64 {
        match *self {
            Self::Line(a, b) => (b[0] - a[0]).hypot(b[1] - a[1]),
            Self::Arc { radius, from, to, .. } => radius * (to - from).abs(),
        }
    }

    /// The point at a share of the length.
    pub(super) fn at(&self, t: f64) -> [f64; 2] {
        match *self {
            Self::Line(a, b) => [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])],
            Self::Arc { centre, radius, from, to } => {
                let (sin, cos) = (from + t * (to - from)).sin_cos();
                [centre[0] + radius * cos, centre[1] + radius * sin]
            }
        }
    }

    /// The direction at a share of the length.
    pub(super) fn direction(&self, t: f64) -> [f64; 2] {
        match *self {
            Self::Line(a, b) => {
                let length = self.length();
                [(b[0] - a[0]) / length, (b[1] - a[1]) / length]
            }
            Self::Arc { from, to, .. } => {
                let (sin, cos) = (from + t * (to - from)).sin_cos();
                let way = (to - from).signum();
                [-way * sin, way * cos]
            }
        }
    }

    /// Whether there is a corner between the end of another section and the start of this one.
    pub(super) fn starts_sharp(&self, before: &Self) -> bool {
        let (a, b) = (before.direction(1.0), self.direction(0.0));
        (a[0] * b[1] - a[1] * b[0]).abs() > SHARP_SINE
    }

    /// Shares of the length of the vertices between both ends, for edges of about those lengths on straight and round sections.
    pub(super) fn inner(&self, edges: [f64; 2], odd: bool) -> Vec<f64> {
        let edge = edges[usize::from(matches!(self, Self::Arc { .. }))];
        let count = (self.length() / edge).round().max(1.0) as usize;
        if odd && count > 1 {
            return (0..count).map(|k| (k as f64 + 0.5) / count as f64).collect();
        }
        (1..count).map(|k| k as f64 / count as f64).collect()
    }

    /// Twice the area between the section and the origin, counter-clockwise.
    pub(super) fn doubled_area(&self) -> f64 {
        let (a, b) = (self.at(0.0), self.at(1.0));
        let chord = a[0] * b[1] - a[1] * b[0];
        match *self {
            Self::Line(..) => chord,
            Self::Arc { radius, from, to, .. } => chord + radius * radius * ((to - from) - (to - from).sin()),
        }
    }
}

/// A closed polygon with its corners rounded by these radii; 0 leaves a corner as it is.
pub(super) fn rounded(points: &[[f64; 2]], radii: &[f64]) -> Vec<Section> {
    let count = points.len();
    let straight = |k: usize| Section::Line(points[k % count], points[(k + 1) % count]);
    // Of each corner: how long the tangents are, and the angle by which the outline turns.
    let corners: Vec<(f64, f64)> = (0..count)
        .map(|k| {
            let (a, b) = (straight(k + count - 1).direction(1.0), straight(k).direction(0.0));
            let turn = (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1]);
            (radii[k] * (0.5 * turn).tan().abs(), turn)
        })
        .collect();
    let mut sections = Vec::new();
    for k in 0..count {
        let (tangent, turn) = corners[k];
        let (side, d) = (straight(k), straight(k).direction(0.0));
        let from = side.at(tangent / side.length());
        if radii[k] > 0.0 {
            let way = turn.signum();
            // The centre is beside the point where the next straight section begins.
            let centre = [from[0] - way * radii[k] * d[1], from[1] + way * radii[k] * d[0]];
            let to = (from[1] - centre[1]).atan2(from[0] - centre[0]);
            sections.push(Section::Arc { centre, radius: radii[k], from: to - turn, to });
        }
        let length = side.length();
        sections.push(Section::Line(from, side.at(1.0 - corners[(k + 1) % count].0 / length)));
    }
    sections
}

/// The area inside an outline.
pub(super) fn area(outline: &[Section]) -> f64 {
    0.5 * outline.iter().map(Section::doubled_area).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rounded_square_has_its_area_and_closes() {
        let square = [[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0]];
        let outline = rounded(&square, &[0.5, 0.0, 0.5, 0.5]);
        assert_eq!(outline.len(), 7);
        let expected = 6.0 - 3.0 * 0.25 * (1.0 - std::f64::consts::FRAC_PI_4);
        assert!((area(&outline) - expected).abs() < 1e-12, "{}", area(&outline));
        let sharp = (0..7).filter(|&k| outline[k].starts_sharp(&outline[(k + 6) % 7])).count();
        assert_eq!(sharp, 1);
        for k in 0..7 {
            let (a, b) = (outline[k].at(1.0), outline[(k + 1) % 7].at(0.0));
            assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 1e-12, "section {k} does not end where the next begins");
        }
    }
}
