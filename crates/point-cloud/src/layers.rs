//! Two layers of one surface: scans that were joined a little apart.
//!
//! Where two layers lie over each other, heights over a local quadric gather about two values, `+a` and `−a`, with few between;
//! those of one layer, noisy or full of detail, do not. Each neighbourhood is fitted by the quadric `q` and the half distance `a` that
//! minimize `Σ (z − q(x, y) − s a)²`, each height on the side `s = ±1` where it lies, in turns (k-means with a common quadric).
//! The point in question is left out of its fit, so that its own height over `q` is independent evidence.

use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;

use crate::local_frame::median;
use crate::neighbour_lists::Neighbours;
use crate::neighbours::rows;
use crate::quadric::{basis, factorize, principal_axes, solve};
use crate::search::CloudTree;
use crate::vec3::{cross, dot, scale, sub};
use crate::{CloudError, Normalization, SPACING_NEIGHBOURS};

/// Neighbours of a fit.
///
/// Calibrated: of 32 and 64, on layers planted 4 σ apart and on 24 scans of one layer. With 32 the split of plain noise is as deep as that
/// of layers (distance over deviation 3.6 at the 90th percentile, layers 4.0).
const NEIGHBOURS: usize = 64;

/// Clouds of fewer points are not looked at.
///
/// Derived: three neighbourhoods of [`NEIGHBOURS`], the least over which a share of 30 % is more than one of them.
const FEWEST_POINTS: usize = 200;

/// Points among which layers are looked for; of larger clouds as many are drawn, which bounds the time.
///
/// Limit: about half a second of one core on a quiet machine.
const MOST_SEARCHED: usize = 12_000;

/// Points of a first look.
///
/// Limit: a twentieth of the time of the full search, which most clouds are spared.
const SCREENED: usize = 600;

/// Distance over deviation of a neighbourhood from which on it counts in the first look, and the share of such ones that asks for a
/// full search.
///
/// Calibrated: noise alone reaches 3.7 in 1 to 4 % of the neighbourhoods, layers 4 σ apart over 30 % of the points in 25 %.
const SCREEN: (f64, f64) = (3.7, 0.06);

/// Rounds of fitting and sorting by sides.
///
/// Limit: sides change in none of the cases after the fourth but for single points.
const ROUNDS: usize = 4;

/// Half width, in half distances, of the intervals about 0, +1 and −1 in which heights are counted.
///
/// Derived: for layers 4 σ apart the density at 0 is 0.27 of that at the peaks; over intervals of this width it is 0.31.
const BIN: f64 = 0.25;

/// Density of heights between the layers, as a share of that on them, below which a point lies where there are two.
///
/// Calibrated: one normally distributed layer has 1.4, evenly distributed heights 1.0, layers 4 σ apart 0.3 to 0.4.
const LOCAL_VALLEY: f64 = 0.6;

/// Share of the points that must lie where there are two layers.
///
/// Calibrated: layers that have 30 % of the points in common reach 0.22 to 0.29, those that have 46 % 0.34 to 0.5. Of single layers most
/// stay below 0.18; those beyond (coarse faces, the tip of a blade) fail by the next conditions.
const LEAST_SHARE: f64 = 0.2;

/// Density between the layers over all of these points.
///
/// Calibrated: planted layers 0.04 to 0.46. Details of single layers may have as little, and fail by the next two.
const MOST_VALLEY: f64 = 0.5;

/// Least median distance over deviation, and the most the distances may spread (interquartile range over median), where the rest of
/// the cloud is thinner ([`MOST_CONTRAST`]).
///
/// Calibrated: layers 4 σ apart have 3.81 to 4.36 and a spread of 0.08 to 0.17; faces, hulls, terrain, car bodies and noise at most 3.79,
/// with spreads of 0.35 to 2.8 where they exceed 3.7.
const NEAR_LAYERS: (f64, f64) = (3.78, 0.25);

/// The same for layers that are well apart, whose distance may vary, as where one was turned against the other, or where the split
/// of a part without noise finds some small distance.
///
/// Calibrated: shifted layers have 4.2 to 6.3 and a spread up to 0.53, exact ones 60 and more and up to 0.7; all single layers stay
/// below 3.9 but for rounded ones.
const FAR_LAYERS: [(f64, f64); 2] = [(4.5, 0.6), (8.0, 1.0)];

/// Largest distance that the split finds outside, as a share of that inside, where outside is half of the points or more.
///
/// Derived: of one layer 2 · 0.8 σ is found, of two 4 σ or more: 0.4. Evenly distributed noise, which in up to a fifth of its places
/// looks like two layers 4 σ apart, has 1. Where less is outside, much of it may be places of two layers that chance left unrecognized.
const MOST_CONTRAST: f64 = 0.75;
const LEAST_OUTSIDE: f64 = 0.5;

/// Largest distance, in mean distances to the six nearest points. Sheets farther apart are seen as two, and walls are such sheets.
///
/// Calibrated: a blade of 117 m at its tip has 1.75, trees over terrain 1.4, walls of parts 1.3 to 2.8; planted layers 0.1 to 0.87.
const MOST_SPACINGS: f64 = 1.0;

/// Least distance, in the same. A quadric leaves a little of any surface, and regular points may part what it leaves in two.
///
/// Calibrated: planted layers 0.1 to 0.87; exact points of a cylinder in a regular order 10⁻⁴.
const LEAST_SPACINGS: f64 = 0.02;

/// Distances up to as many rounding steps of a coordinate come from rounding.
///
/// Derived: heights on both sides of a rounding limit are one step apart.
const ROUNDING_STEPS: f64 = 1.5;

/// Points per distinct value of a coordinate from which on it is rounded.
///
/// Calibrated: heights of 2601 points in steps of 0.05 have 40 a value; random coordinates of four decimals 1.1.
const POINTS_PER_VALUE: usize = 4;

/// Neighbours where there are two layers that a point needs to be moved.
///
/// Derived: an eighth of a neighbourhood, where the point is at its rim.
const FEWEST_BESIDE: usize = 8;

/// Heights over one quadric, in half distances, at which neighbours are parted to begin with.
///
/// Derived: inside, the quadric runs midway. At the end of a layer it leans to the other one, whose points are then at height 0 and all of
/// one side.
const STARTS: [f64; 3] = [0.0, -0.5, 0.5];

/// Share of the squared heights over one quadric that two layers must leave.
///
/// Derived: for layers 4 σ apart of which one has the share f of the points, two leave 1 / (1 + 16 f (1 − f)): 0.5 at f = 0.07.
const EXPLAINED: f64 = 0.5;

/// Share of a neighbourhood on its less populated side from which on the point counts as lying where there are two layers, as a share of
/// the median one.
///
/// Derived: within the overlap of equally dense layers a half of the neighbours is on each side, at its edge a third.
const BOTH: f64 = 0.67;

/// Mean sides of a neighbourhood up to which its points go to the middle, and from which on they stay.
///
/// Derived: of 64 sides drawn by chance the weighted mean exceeds 0.5 in 0.3 % of the cases; near the end of one layer the
/// mean rises to 1 over the radius of a neighbourhood, and the surface with it, without a step.
const RAMP: (f64, f64) = (0.5, 0.95);

/// Two layers of one surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers {
    /// Median distance between them, in the units of the points.
    pub distance: f64,
    /// Share of the points that lie where there are two.
    pub share: f64,
    /// The points, shape `(m, 3)`: those where there are two layers moved along the normals to the middle between them, towards
    /// the end of one layer gradually to the other one. Each keeps its own deviation from its layer.
    pub middle: Array2<f64>,
}

/// Looks for two layers of one surface in `points`, shape `(m, 3)`; `None` where there is one, or none can be told.
///
/// Found are layers at least 4 standard deviations of their noise and at most one spacing apart that share 30 % of
/// their extent or more. O(m log m); the time is that of some thousand points, whatever the size of the cloud.
///
/// # Errors
/// [`CloudError::WrongDimension`], those of [`crate::check_finite`].
pub fn find_layers(points: ArrayView2<'_, f64>) -> Result<Option<Layers>, CloudError> {
    rows(points)?;
    if points.nrows() < FEWEST_POINTS {
        return Ok(None);
    }
    let normalization = Normalization::of(points)?;
    let all = rows(normalization.apply(points)?.view())?;
    let drawn = draw(all.len());
    let places: Vec<[f64; 3]> = drawn.iter().map(|&i| all[i as usize]).collect();
    let tree = CloudTree::new(&places)?;
    if !is_worth_a_search(&tree) {
        return Ok(None);
    }
    let search = Search::of(&tree);
    let Some(distance) = search.distance(&places) else { return Ok(None) };
    let drawn_as = |i: usize| drawn.binary_search(&(i as u32)).ok();
    let to_middle = |i: usize| {
        let near = match drawn_as(i) {
            Some(at) => search.neighbours.of(at).to_vec(),
            None => tree.nearest_to(all[i], NEIGHBOURS).into_iter().map(|n| n.1).collect(),
        };
        search.move_to_middle(&places, all[i], &near)
    };
    let moves: Vec<Option<Moved>> = (0..all.len()).into_par_iter().map(to_middle).collect();
    let smaller = BOTH * median(moves.iter().flatten().map(|moved| moved.smaller).collect());
    let both = moves.iter().flatten().filter(|moved| moved.smaller >= smaller).count();
    let (unit, mut middle) = (normalization.scale(), points.to_owned());
    for (mut row, moved) in middle.rows_mut().into_iter().zip(&moves) {
        if let Some(Moved { way, .. }) = moved {
            row.iter_mut().zip(way).for_each(|(x, d)| *x += unit * d);
        }
    }
    let layers = Layers { distance: distance * unit, share: both as f64 / all.len() as f64, middle };
    tracing::info!(distance = layers.distance, share = layers.share, "found two layers");
    Ok(Some(layers))
}

/// All of `m` rows, or [`MOST_SEARCHED`] of them by a fixed hash, increasing. Not well-spread ones: a distance between
/// them would keep one layer only.
fn draw(m: usize) -> Vec<u32> {
    let mut drawn: Vec<u32> = (0..m as u32).collect();
    if m > MOST_SEARCHED {
        drawn.sort_by_cached_key(|&i| hash(u64::from(i)));
        drawn.truncate(MOST_SEARCHED);
        drawn.sort_unstable();
    }
    drawn
}

/// The finalizer of SplitMix64 (Steele, Lea & Flood 2014).
fn hash(i: u64) -> u64 {
    let x = i.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

fn is_worth_a_search(tree: &CloudTree<'_>) -> bool {
    let m = tree.points.len();
    let step = m.div_ceil(SCREENED);
    let sample: Vec<usize> = (0..m).step_by(step).collect();
    let is_split = |&&i: &&usize| {
        let near: Vec<u32> = tree.nearest(i, NEIGHBOURS).into_iter().map(|n| n.1).collect();
        Split::at(tree.points, tree.points[i], &near).is_some_and(|split| split.separation() > SCREEN.0)
    };
    let split = sample.par_iter().filter(is_split).count();
    split as f64 >= SCREEN.1 * sample.len() as f64
}

/// A neighbourhood in the frame of its principal axes, seen from its own point.
struct Neighbourhood {
    /// The directions of the two wider axes and of the thin one.
    axes: [[f64; 3]; 3],
    /// Heights along the thin axis, without the own point, whose height is 0.
    heights: Vec<f64>,
    /// `1, x, y, x², xy, y²` at each of them, places divided by the radius.
    basis: Vec<[f64; 6]>,
    /// Cholesky factor of the normal matrix.
    factor: [[f64; 6]; 6],
    /// The quadric through all heights.
    plain: [f64; 6],
}

impl Neighbourhood {
    fn of(points: &[[f64; 3]], own: [f64; 3], near: &[u32]) -> Option<Self> {
        let offsets: Vec<[f64; 3]> =
            std::iter::once([0.0; 3]).chain(near.iter().map(|&j| sub(points[j as usize], own))).collect();
        let [_, second, first] = principal_axes(&offsets).directions;
        let axes = [first, second, cross(first, second)];
        let local: Vec<[f64; 3]> = offsets[1..].iter().map(|o| axes.map(|axis| dot(*o, axis))).collect();
        let radius = local.iter().map(|p| p[0] * p[0] + p[1] * p[1]).fold(0.0, f64::max).sqrt();
        if radius == 0.0 {
            return None;
        }
        let basis: Vec<[f64; 6]> = local.iter().map(|p| basis(p[0] / radius, p[1] / radius)).collect();
        let mut matrix = [[0.0; 6]; 6];
        for row in &basis {
            for r in 0..6 {
                for c in 0..=r {
                    matrix[r][c] += row[r] * row[c];
                }
            }
        }
        let factor = factorize(matrix, basis.len())?;
        let heights: Vec<f64> = local.iter().map(|p| p[2]).collect();
        let plain = solve(&factor, weighted_sum(&basis, &heights));
        Some(Self { axes, heights, basis, factor, plain })
    }

    /// Heights over a quadric.
    fn over(&self, quadric: &[f64; 6]) -> Vec<f64> {
        self.basis.iter().zip(&self.heights).map(|(row, z)| z - value(row, quadric)).collect()
    }

    /// Two layers, `half` above and below a quadric, from the heights over one quadric split at `start`.
    fn part(&self, single: &[f64], start: f64, half: f64) -> Parted {
        let mut side: Vec<f64> = single.iter().map(|&height| if height > start { 1.0 } else { -1.0 }).collect();
        let mut quadric = self.plain;
        for _ in 0..ROUNDS {
            let along_sides = solve(&self.factor, weighted_sum(&self.basis, &side));
            quadric = self.between(&along_sides, half);
            side = sides(&self.over(&quadric));
        }
        let rest = |(height, s): (&f64, &f64)| (height - s * half).powi(2);
        let left = self.over(&quadric).iter().zip(&side).map(rest).sum();
        Parted { side, quadric, left }
    }

    /// The quadric less its part along the sides, times `half`: what fits `z − s half` best.
    fn between(&self, along_sides: &[f64; 6], half: f64) -> [f64; 6] {
        std::array::from_fn(|k| self.plain[k] - half * along_sides[k])
    }
}

/// A neighbourhood parted in two layers of a given distance.
struct Parted {
    /// The side of each neighbour.
    side: Vec<f64>,
    /// The middle.
    quadric: [f64; 6],
    /// Sum of the squared heights over the layers.
    left: f64,
}

fn value(row: &[f64; 6], quadric: &[f64; 6]) -> f64 {
    row.iter().zip(quadric).map(|(b, c)| b * c).sum()
}

fn weighted_sum(basis: &[[f64; 6]], weights: &[f64]) -> [f64; 6] {
    let mut sum = [0.0; 6];
    for (row, weight) in basis.iter().zip(weights) {
        sum = std::array::from_fn(|k| sum[k] + weight * row[k]);
    }
    sum
}

fn sides(over: &[f64]) -> Vec<f64> {
    over.iter().map(|&height| if height > 0.0 { 1.0 } else { -1.0 }).collect()
}

/// A neighbourhood split in two layers.
#[derive(Clone, Copy, Debug)]
struct Split {
    normal: [f64; 3],
    /// Half the distance of the layers.
    half: f64,
    /// Height of the own point, which was not fitted, over the middle.
    own: f64,
    /// Standard deviation of the heights from their layers.
    deviation: f64,
}

impl Split {
    fn at(points: &[[f64; 3]], own: [f64; 3], near: &[u32]) -> Option<Self> {
        let around = Neighbourhood::of(points, own, near)?;
        let n = around.heights.len() as f64;
        let (mut side, mut half, mut quadric) = (sides(&around.over(&around.plain)), 0.0, around.plain);
        for _ in 0..ROUNDS {
            let sum = weighted_sum(&around.basis, &side);
            let along_sides = solve(&around.factor, sum);
            // The Schur complement of the quadric's block in the normal equations.
            let rest = n - value(&sum, &along_sides);
            let moment: f64 = side.iter().zip(&around.heights).map(|(s, z)| s * z).sum();
            if rest <= f64::EPSILON * n {
                return None;
            }
            half = (moment - value(&sum, &around.plain)) / rest;
            quadric = around.between(&along_sides, half);
            side = sides(&around.over(&quadric));
        }
        let half: f64 = f64::abs(half);
        let rest = |(height, s): (&f64, &f64)| (height - s * half).powi(2);
        let squares: f64 = around.over(&quadric).iter().zip(&side).map(rest).sum();
        // Seven numbers were fitted.
        let deviation = (squares / (n - 7.0).max(1.0)).sqrt();
        Some(Self { normal: around.axes[2], half, own: -quadric[0], deviation })
    }

    /// Distance of the layers in standard deviations.
    fn separation(&self) -> f64 {
        let deviation = self.deviation.max(f64::EPSILON * self.half);
        if deviation > 0.0 { 2.0 * self.half / deviation } else { 0.0 }
    }

    /// Absolute height of the own point in half distances.
    fn relative(&self) -> f64 {
        if self.half > 0.0 { self.own.abs() / self.half } else { f64::INFINITY }
    }
}

/// Numbers of heights between the layers and on them.
#[derive(Clone, Copy, Default)]
struct Counts {
    between: usize,
    on: usize,
}

impl Counts {
    fn of(relative: impl Iterator<Item = f64>) -> Self {
        let mut counts = Self::default();
        for height in relative {
            counts.between += usize::from(height < BIN);
            counts.on += usize::from((height - 1.0).abs() < BIN);
        }
        counts
    }

    fn and(self, other: Self) -> Self {
        Self { between: self.between + other.between, on: self.on + other.on }
    }

    /// Density between the layers over that on them: heights are absolute, so the first interval is half as wide.
    fn valley(self) -> f64 {
        2.0 * self.between as f64 / (self.on as f64).max(f64::MIN_POSITIVE)
    }
}

/// What all neighbourhoods say.
struct Search {
    neighbours: Neighbours,
    splits: Vec<Option<Split>>,
    /// Whether a point lies where there are two layers.
    is_double: Vec<bool>,
}

/// What was measured where there seem to be two layers.
#[derive(Clone, Copy, Debug)]
struct Evidence {
    /// Share of the points.
    share: f64,
    /// Density of heights between the layers over that on them.
    valley: f64,
    /// Median distance over deviation.
    separation: f64,
    /// Interquartile range of the distances over their median.
    spread: f64,
    /// Median distance in local spacings.
    spacings: f64,
    /// Median distance that the split finds elsewhere over that here; 0 where elsewhere are too few points.
    contrast: f64,
}

impl Evidence {
    /// Whether there are two layers.
    fn is_clear(&self) -> bool {
        self.share >= LEAST_SHARE
            && self.valley <= MOST_VALLEY
            && (LEAST_SPACINGS..=MOST_SPACINGS).contains(&self.spacings)
            && (FAR_LAYERS.into_iter().any(|far| self.exceeds(far))
                || self.exceeds(NEAR_LAYERS) && self.contrast <= MOST_CONTRAST)
    }
}

impl Evidence {
    fn exceeds(&self, (least, most): (f64, f64)) -> bool {
        self.separation >= least && self.spread <= most
    }
}

impl Search {
    fn of(tree: &CloudTree<'_>) -> Self {
        let points = tree.points;
        let neighbours = tree.all_nearest(NEIGHBOURS);
        let split = |i: usize| Split::at(points, points[i], neighbours.of(i));
        let splits: Vec<Option<Split>> = (0..points.len()).into_par_iter().map(split).collect();
        let relative: Vec<f64> =
            splits.iter().map(|split| split.as_ref().map_or(f64::INFINITY, Split::relative)).collect();
        let around = |i: usize| std::iter::once(i as u32).chain(neighbours.of(i).iter().copied());
        let counted = |i: usize| Counts::of(around(i).map(|j| relative[j as usize]));
        let counts: Vec<Counts> = (0..points.len()).into_par_iter().map(counted).collect();
        // Once more over the neighbours: one neighbourhood has so few heights between that chance empties some.
        let is_double =
            |i: usize| around(i).fold(Counts::default(), |sum, j| sum.and(counts[j as usize])).valley() < LOCAL_VALLEY;
        let is_double = (0..points.len()).into_par_iter().map(is_double).collect();
        Self { neighbours, splits, is_double }
    }

    /// The distance of the layers if there are two.
    fn distance(&self, points: &[[f64; 3]]) -> Option<f64> {
        let double = || (0..points.len()).filter(|&i| self.is_double[i]).filter_map(|i| Some((i, self.splits[i]?)));
        let mut distances: Vec<f64> = double().map(|(_, split)| 2.0 * split.half).collect();
        let count = distances.len();
        if (count as f64) < LEAST_SHARE * points.len() as f64 {
            return None;
        }
        distances.sort_unstable_by(f64::total_cmp);
        let distance = distances[count / 2];
        let spacing = |i: usize| {
            let near = &self.neighbours.distances_of(i)[..SPACING_NEIGHBOURS];
            near.iter().sum::<f64>() / near.len() as f64
        };
        let outside = (0..points.len()).filter(|&i| !self.is_double[i]);
        let outside: Vec<f64> = outside.filter_map(|i| Some(2.0 * self.splits[i]?.half)).collect();
        let contrast =
            if outside.len() as f64 >= LEAST_OUTSIDE * points.len() as f64 { median(outside) / distance } else { 0.0 };
        let evidence = Evidence {
            contrast,
            share: count as f64 / points.len() as f64,
            valley: Counts::of(double().map(|(_, split)| split.relative())).valley(),
            separation: median(double().map(|(_, split)| split.separation()).collect()),
            spread: (distances[3 * count / 4] - distances[count / 4]) / distance,
            spacings: median(double().map(|(i, split)| 2.0 * split.half / spacing(i)).collect()),
        };
        let steps = rounding_steps(points);
        let is_rounding = |split: &Split| {
            let along = |&a: &usize, &b: &usize| split.normal[a].abs().total_cmp(&split.normal[b].abs());
            let axis = (0..3).max_by(along).unwrap_or(0);
            2.0 * split.half <= ROUNDING_STEPS * steps[axis]
        };
        let rounded = double().filter(|(_, split)| is_rounding(split)).count();
        tracing::debug!(?evidence, distance, rounded, "looked for two layers");
        (evidence.is_clear() && 2 * rounded < count).then_some(distance)
    }

    /// The way of a point of any layer to the middle; `None` where there is one layer.
    fn move_to_middle(&self, points: &[[f64; 3]], own: [f64; 3], near: &[u32]) -> Option<Moved> {
        let beside = near.iter().filter(|&&j| self.is_double[j as usize]);
        let halves: Vec<f64> = beside.filter_map(|&j| Some(self.splits[j as usize]?.half)).collect();
        if halves.len() < FEWEST_BESIDE {
            return None;
        }
        let half = median(halves);
        let around = Neighbourhood::of(points, own, near)?;
        let single = around.over(&around.plain);
        let parted = STARTS.map(|start| around.part(&single, start * half, half));
        let Parted { side, quadric, left } = parted.into_iter().min_by(|a, b| a.left.total_cmp(&b.left))?;
        if left > EXPLAINED * single.iter().map(|height| height * height).sum::<f64>() {
            return None;
        }
        // Falls to zero at the radius, so that points entering a neighbourhood change nothing at once.
        let weight = |row: &[f64; 6]| (1.0 - row[3] - row[5]).max(0.0).powi(2);
        let weights: Vec<f64> = around.basis.iter().map(weight).collect();
        let mean = side.iter().zip(&weights).map(|(s, w)| s * w).sum::<f64>() / weights.iter().sum::<f64>();
        let level = ramp(mean);
        let own_side = if quadric[0] < 0.0 { 1.0 } else { -1.0 };
        let above = side.iter().filter(|s| **s > 0.0).count() as f64 / side.len() as f64;
        Some(Moved { way: scale(half * (level - own_side), around.axes[2]), smaller: above.min(1.0 - above) })
    }
}

/// How a point goes to the middle.
struct Moved {
    way: [f64; 3],
    /// Share of the neighbours on the side of fewer.
    smaller: f64,
}

/// Where the surface goes between the layers at −1 and 1, from the mean side of the points around: the middle unless most of them are
/// on one side.
fn ramp(mean: f64) -> f64 {
    let t = ((mean.abs() - RAMP.0) / (RAMP.1 - RAMP.0)).clamp(0.0, 1.0);
    mean.signum() * t * t * (3.0 - 2.0 * t)
}

/// The step to which each coordinate is rounded, 0 where it isn't.
fn rounding_steps(points: &[[f64; 3]]) -> [f64; 3] {
    std::array::from_fn(|k| {
        let mut values: Vec<f64> = points.iter().map(|p| p[k]).collect();
        values.sort_unstable_by(f64::total_cmp);
        let steps: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).filter(|&step| step > f64::EPSILON).collect();
        if POINTS_PER_VALUE * (steps.len() + 1) > points.len() { 0.0 } else { median(steps) }
    })
}

#[cfg(test)]
#[path = "layers_tests.rs"]
mod tests;
