//! Corners of a sequence: points where it turns, and its neighbourhood does not.

use ndarray::ArrayView2;

/// Turning, in degrees, from which on a point may be a corner. Smooth curves turn less at a point unless they are sampled
/// with fewer than nine points a turn.
const SHARP: f64 = 40.0;

/// How many times as much as each of its neighbours a corner turns. The turning of a rough curve varies less regularly,
/// but then its neighbours turn sharply too.
const STANDS_OUT: f64 = 3.0;

/// Neighbours on each side that are compared.
const NEIGHBOURS: usize = 2;

/// The corners of points `(m, N)`, increasing; of a closed sequence the neighbours of the first point are the second and
/// the last one. Ends of an open sequence are no corners.
pub(super) fn find_corners(points: ArrayView2<'_, f64>, closed: bool) -> Vec<usize> {
    let m = points.nrows();
    if m < 2 * NEIGHBOURS + 1 {
        return Vec::new();
    }
    let turning: Vec<f64> = (0..m)
        .map(|i| {
            let inside = i > 0 && i + 1 < m;
            if inside || closed { turn(points, (i + m - 1) % m, i, (i + 1) % m) } else { 0.0 }
        })
        .collect();
    let stands_out = |i: usize| {
        (1..=NEIGHBOURS).all(|k| {
            let (before, after) = ((i + m - k) % m, (i + k) % m);
            let smooth = |other: usize, there: bool| !there || turning[i] >= STANDS_OUT * turning[other];
            smooth(before, closed || i >= k) && smooth(after, closed || i + k < m)
        })
    };
    (0..m).filter(|&i| turning[i] >= SHARP && stands_out(i)).collect()
}

/// The angle, in degrees, between the chords that meet at a point; 0 where one has no length.
fn turn(points: ArrayView2<'_, f64>, before: usize, at: usize, after: usize) -> f64 {
    let (a, b, c) = (points.row(before), points.row(at), points.row(after));
    let (incoming, outgoing) = (&b - &a, &c - &b);
    let lengths = incoming.dot(&incoming).sqrt() * outgoing.dot(&outgoing).sqrt();
    if lengths > 0.0 { (incoming.dot(&outgoing) / lengths).clamp(-1.0, 1.0).acos().to_degrees() } else { 0.0 }
}
