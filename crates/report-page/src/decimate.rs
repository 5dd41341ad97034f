//! The points that are shown: all beyond the tolerance first, then others, well spread.

/// Points that a page shows at most.
///
/// Limit: what browsers turn without jerking when they draw without a graphics card, and the size of the page.
pub const MOST_POINTS: usize = 200_000;

/// Bits of a coordinate in the curve that orders points.
const BITS: u32 = 10;

/// The points along a curve that fills space, so that neighbours in the list are near each other.
pub fn morton_order(points: &[[f64; 3]]) -> Vec<u32> {
    let (lower, upper) = bounds(points.iter().copied());
    let steps = f64::from((1u32 << BITS) - 1);
    let key = |p: &[f64; 3]| {
        // Without extent the share is NaN, which becomes 0.
        let cell: [u32; 3] =
            std::array::from_fn(|k| (((p[k] - lower[k]) / (upper[k] - lower[k])).clamp(0.0, 1.0) * steps) as u32);
        (0..BITS).fold(0u32, |key, bit| (0..3).fold(key, |key, k| key | ((cell[k] >> bit) & 1) << (3 * bit + k as u32)))
    };
    let mut order: Vec<(u32, u32)> = points.iter().enumerate().map(|(i, p)| (key(p), i as u32)).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, i)| i).collect()
}

/// At most `most` of the points, in [`morton_order`]: all whose deviation exceeds the tolerance, if there are not too many, and of the
/// others every so many along the curve.
pub fn shown_points(points: &[[f64; 3]], deviations: &[f64], tolerance: f64, most: usize) -> Vec<u32> {
    let order = morton_order(points);
    if order.len() <= most {
        return order;
    }
    let is_beyond = |i: u32| deviations.get(i as usize).is_some_and(|d| d.abs() > tolerance);
    let beyond = order.iter().filter(|&&i| is_beyond(i)).count();
    let mut of_beyond = Evenly::new(beyond.min(most), beyond);
    let mut of_others = Evenly::new(most - beyond.min(most), order.len() - beyond);
    order.into_iter().filter(|&i| if is_beyond(i) { of_beyond.takes() } else { of_others.takes() }).collect()
}

/// Takes so many of a row, evenly.
struct Evenly {
    taken: usize,
    of: usize,
    sum: usize,
}

impl Evenly {
    fn new(taken: usize, of: usize) -> Self {
        Self { taken, of, sum: 0 }
    }

    fn takes(&mut self) -> bool {
        self.sum += self.taken;
        let takes = self.sum >= self.of;
        if takes {
            self.sum -= self.of;
        }
        takes
    }
}

/// Lower and upper corner of the box around points; zero without any.
pub(crate) fn bounds(points: impl Iterator<Item = [f64; 3]>) -> ([f64; 3], [f64; 3]) {
    let mut found: Option<([f64; 3], [f64; 3])> = None;
    for p in points {
        let (lower, upper) = found.get_or_insert((p, p));
        for k in 0..3 {
            lower[k] = lower[k].min(p[k]);
            upper[k] = upper[k].max(p[k]);
        }
    }
    found.unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: usize) -> Vec<[f64; 3]> {
        (0..n * n).map(|k| [(k % n) as f64, (k / n) as f64, 0.0]).collect()
    }

    #[test]
    fn all_beyond_the_tolerance_are_kept_and_the_others_are_spread() {
        let points = grid(100);
        let deviations: Vec<f64> = (0..points.len()).map(|i| if i % 37 == 0 { -2.0 } else { 0.5 }).collect();
        let shown = shown_points(&points, &deviations, 1.0, 1000);
        assert_eq!(shown.len(), 1000);
        let beyond = (0..points.len() as u32).filter(|i| i % 37 == 0).count();
        assert_eq!(shown.iter().filter(|&&i| i % 37 == 0).count(), beyond);
        // A tenth of the others, and about as many in each quarter.
        let of_quarter = |x: f64, y: f64| {
            let inside = |&&i: &&u32| {
                points[i as usize][0] < x + 50.0
                    && points[i as usize][0] >= x
                    && points[i as usize][1] < y + 50.0
                    && points[i as usize][1] >= y
            };
            shown.iter().filter(inside).count()
        };
        for (x, y) in [(0.0, 0.0), (50.0, 0.0), (0.0, 50.0), (50.0, 50.0)] {
            assert!((230..270).contains(&of_quarter(x, y)), "{}", of_quarter(x, y));
        }
    }

    #[test]
    fn too_many_beyond_are_thinned_and_few_points_are_kept() {
        let points = grid(20);
        assert_eq!(shown_points(&points, &[5.0; 400], 1.0, 100).len(), 100);
        assert_eq!(shown_points(&points, &[0.0; 400], 1.0, 100).len(), 100);
        let mut all = shown_points(&points, &[], 1.0, 400);
        all.sort_unstable();
        assert_eq!(all, (0..400).collect::<Vec<u32>>());
        assert!(shown_points(&[], &[], 1.0, 10).is_empty());
        assert_eq!(shown_points(&[[1.0; 3]; 3], &[0.0; 3], 1.0, 2).len(), 2);
    }
}
