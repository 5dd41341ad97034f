//! Local problems (Imperatore 2024, Algorithm 3).

use thb_core::unravel;

use crate::band::Band;
use crate::cells::{Layout, LevelCells};
use crate::options::LocalLambda;
use crate::order::MortonOrder;
use crate::region::Region;
use crate::span::pair;

/// The points of a region lie on a line, for what follows, if its width is at most this share of the region. The sums that
/// tell are exact to about 1e-16 of its square.
const LINE: f64 = 1e-6;

/// Squared distance of the centre of a B-spline's support from the mean of the points, in their covariance and per
/// direction, up to which they count as lying around it. Points spread evenly over a box have 3 on its sides.
const AROUND: f64 = 3.0;

/// A region with the cells that hold its points.
#[derive(Clone, Debug)]
pub(crate) struct Chosen<const D: usize> {
    pub(crate) region: Region<D>,
    /// Number of each cell and its place in the region.
    pub(crate) cells: Vec<(u32, [u32; D])>,
    pub(crate) points: usize,
    /// Rings by which the support was enlarged.
    pub(crate) rings: usize,
}

/// What a region must hold, and how far it may grow for it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Demand {
    pub(crate) points: usize,
    pub(crate) density: f64,
    pub(crate) rings: usize,
}

/// Enlarges a region until it holds points enough in cells enough, or is the whole domain. `None` if it would have to grow
/// further than it may.
pub(crate) fn choose<const D: usize>(
    level: &LevelCells<D>,
    order: &MortonOrder<D>,
    demand: Demand,
    start: Region<D>,
    rings: usize,
) -> Option<Chosen<D>> {
    let mut chosen = Chosen { region: start, cells: Vec::new(), points: 0, rings };
    loop {
        level.within(order, &chosen.region, &mut chosen.cells);
        chosen.points = chosen.cells.iter().map(|&(cell, _)| level.points(cell as usize).len()).sum();
        let occupied = chosen.cells.len() as f64 / chosen.region.n_cells() as f64;
        if chosen.points >= demand.points && occupied >= demand.density {
            return (chosen.rings <= demand.rings).then_some(chosen);
        }
        match chosen.region.grown(&level.knots) {
            Some(_) if chosen.rings >= demand.rings => return None,
            Some(grown) => chosen.region = grown,
            None => return Some(chosen),
        }
        chosen.rings += 1;
    }
}

/// How a coefficient was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Verdict {
    /// By least squares; the share of its diagonal entry that other unknowns leave.
    Solved(f64),
    /// The points lie on a line of the parameter domain: their mean.
    Collinear,
    /// The points lie on one side of the support's centre: the coefficient would be an extrapolation.
    OneSided,
    /// The equations do not determine it, with this smoothing weight.
    Undetermined(f64),
}

/// A product of B-splines in the directions but the first.
#[derive(Clone, Copy, Debug)]
struct Outer<const D: usize> {
    pair: usize,
    column: [usize; D],
    row: [usize; D],
}

/// The solver of local problems of one degree, with its memory.
pub(crate) struct LocalSolver<const D: usize> {
    layout: Layout<D>,
    /// Pairs of rows and columns of the lower triangle.
    outers: Vec<Outer<D>>,
    band: Band,
    row_sums: Vec<f64>,
    /// Per direction and order of the derivative the band of the univariate Gram matrix, `(n, 2p + 1)`.
    gram: [[Vec<f64>; 3]; D],
}

impl<const D: usize> LocalSolver<D> {
    pub(crate) fn new(layout: Layout<D>) -> Self {
        let orders = layout.degree.map(|p| p + 1);
        // The first direction has one entry here: its indices are looped over inside.
        let outer_orders: [usize; D] = std::array::from_fn(|d| if d == 0 { 1 } else { orders[d] });
        let n_outer: usize = outer_orders.iter().product();
        let mut outers = Vec::new();
        for column in 0..n_outer {
            // Linear indices order as those of the region do, so this is the lower triangle there too.
            for row in column..n_outer {
                let (i, j) = (unravel(row, outer_orders), unravel(column, outer_orders));
                let mut number = 0;
                for d in (1..D).rev() {
                    number = number * (orders[d] * (orders[d] + 1) / 2) + pair(orders[d], i[d], j[d]);
                }
                outers.push(Outer { pair: number, column: j, row: i });
            }
        }
        Self {
            layout,
            outers,
            band: Band::default(),
            row_sums: Vec::new(),
            gram: std::array::from_fn(|_| std::array::from_fn(|_| Vec::new())),
        }
    }

    /// The coefficient of a B-spline in the local problem of a region, to `out` (N numbers).
    pub(crate) fn solve(
        &mut self,
        level: &LevelCells<D>,
        chosen: &Chosen<D>,
        function: [usize; D],
        lambda: LocalLambda,
        out: &mut [f64],
    ) -> Verdict {
        let Chosen { region, cells, .. } = chosen;
        let counts = region.n_local(&level.knots);
        let mut strides = [1; D];
        for d in 1..D {
            strides[d] = strides[d - 1] * counts[d - 1];
        }
        let linear = |index: [usize; D]| (0..D).map(|d| index[d] * strides[d]).sum::<usize>();
        let n: usize = counts.iter().product();
        self.band.reset(n, linear(self.layout.degree), out.len());
        let mut spread = Spread::new(level, region);
        for &(cell, place) in cells {
            let place = place.map(|i| i as usize);
            let first = std::array::from_fn(|d| region.first_local(&level.knots, d, place[d]));
            spread.add(place, level.sums(cell).spread);
            self.add_points(level, cell, first, strides);
        }
        self.band.row_sums(&mut self.row_sums);
        let weight: f64 = self.row_sums.iter().sum();
        if weight <= 0.0 {
            return Verdict::Undetermined(0.0);
        }
        let mut mean = vec![0.0; out.len()];
        for (k, mean) in mean.iter_mut().enumerate() {
            *mean = self.band.right_mut(k).iter().sum::<f64>() / weight;
        }
        let (place, len) = region.place_of(&level.knots, function);
        let centre = std::array::from_fn(|d| 0.5 * (spread.ends[d][place[d]] + spread.ends[d][place[d] + len[d]]));
        let Some(distance) = spread.distance_to_mean(centre) else {
            out.copy_from_slice(&mean);
            return Verdict::Collinear;
        };
        if distance > AROUND * D as f64 && region.grown(&level.knots).is_some() {
            return Verdict::OneSided;
        }
        // Relative to their mean the points are small numbers, and so are the errors of their solution.
        for (k, mean) in mean.iter().enumerate() {
            let right = self.band.right_mut(k).iter_mut();
            right.zip(&self.row_sums).for_each(|(b, sum)| *b -= mean * sum);
        }
        let lambda = lambda.of_region(weight, spread.share_of_domain(level));
        if lambda > 0.0 {
            self.add_energy(level, region, counts, strides, lambda);
        }
        let left = self.band.solve_for(linear(region.local_of(&level.knots, function)), out);
        if left == 0.0 {
            return Verdict::Undetermined(lambda);
        }
        out.iter_mut().zip(mean).for_each(|(c, mean)| *c += mean);
        Verdict::Solved(left)
    }

    /// Adds the sums of a cell whose first B-spline is `first`.
    #[inline]
    fn add_points(&mut self, level: &LevelCells<D>, cell: u32, first: [usize; D], strides: [usize; D]) {
        let sums = level.sums(cell);
        let inner = self.layout.degree[0] + 1;
        let base: usize = (0..D).map(|d| first[d] * strides[d]).sum();
        for outer in &self.outers {
            let block = &sums.products[outer.pair * inner * inner..][..inner * inner];
            let at = |index: [usize; D]| (1..D).map(|d| index[d] * strides[d]).sum::<usize>();
            let (column, row) = (at(outer.column), at(outer.row));
            let below = row - column;
            for (j, block) in block.chunks_exact(inner).enumerate() {
                let target = self.band.column_mut(base + column + j);
                if below == 0 {
                    target.iter_mut().zip(&block[j..]).for_each(|(t, x)| *t += x);
                } else {
                    target[below - j..].iter_mut().zip(block).for_each(|(t, x)| *t += x);
                }
            }
        }
        let columns = self.layout.columns;
        for (line, rows) in sums.right.chunks_exact(inner * columns).enumerate() {
            let outer_orders = std::array::from_fn(|d| if d == 0 { 1 } else { self.layout.degree[d] + 1 });
            let index = unravel::<D>(line, outer_orders);
            let start = base + (1..D).map(|d| index[d] * strides[d]).sum::<usize>();
            for k in 0..columns {
                let target = &mut self.band.right_mut(k)[start..start + inner];
                target.iter_mut().zip(rows.chunks_exact(columns)).for_each(|(t, row)| *t += row[k]);
            }
        }
    }

    /// Adds λ times the thin-plate energy of the region, by Kronecker products of univariate Gram matrices.
    fn add_energy(
        &mut self,
        level: &LevelCells<D>,
        region: &Region<D>,
        counts: [usize; D],
        strides: [usize; D],
        lambda: f64,
    ) {
        self.univariate_grams(level, region, counts);
        let degree = self.layout.degree;
        let widths = degree.map(|p| 2 * p + 1);
        // Columns and rows relative to them in the directions but the first.
        let column_counts: [usize; D] = std::array::from_fn(|d| if d == 0 { 1 } else { counts[d] });
        let row_counts: [usize; D] = std::array::from_fn(|d| if d == 0 { 1 } else { widths[d] });
        let inner = widths[0];
        for column in 0..column_counts.iter().product() {
            let j = unravel(column, column_counts);
            let start: usize = (1..D).map(|d| j[d] * strides[d]).sum();
            for row in 0..row_counts.iter().product() {
                let o = unravel(row, row_counts);
                let below: isize = (1..D).map(|d| (o[d] as isize - degree[d] as isize) * strides[d] as isize).sum();
                if below < 0 {
                    continue;
                }
                // Factors of the first direction's derivatives of order 0, 1, 2.
                let mut factors = [0.0; 3];
                for (a, b) in (0..D).flat_map(|a| (a..D).map(move |b| (a, b))) {
                    let order = |d: usize| usize::from(d == a) + usize::from(d == b);
                    let mixed = if a == b { lambda } else { 2.0 * lambda };
                    let others = (1..D).map(|d| self.gram[d][order(d)][j[d] * widths[d] + o[d]]);
                    factors[order(0)] += mixed * others.product::<f64>();
                }
                let [zeroth, first, second] = &self.gram[0];
                let skipped = if below == 0 { degree[0] } else { 0 };
                for j0 in 0..counts[0] {
                    let entries = j0 * inner + skipped..(j0 + 1) * inner;
                    let target = &mut self.band.column_mut(start + j0)[below as usize + skipped - degree[0]..];
                    let values = zeroth[entries.clone()].iter().zip(&first[entries.clone()]).zip(&second[entries]);
                    for (t, ((x, y), z)) in target.iter_mut().zip(values) {
                        *t += factors[0] * x + factors[1] * y + factors[2] * z;
                    }
                }
            }
        }
    }

    /// Univariate Gram matrices of the region's spans.
    fn univariate_grams(&mut self, level: &LevelCells<D>, region: &Region<D>, counts: [usize; D]) {
        for d in 0..D {
            let (order, width) = (self.layout.degree[d] + 1, 2 * self.layout.degree[d] + 1);
            for gram in &mut self.gram[d] {
                gram.clear();
                gram.resize(counts[d] * width, 0.0);
            }
            for place in 0..region.len[d] {
                let Some(span) = level.spans[d].get(region.span(&level.knots, d, place)) else { continue };
                let first = region.first_local(&level.knots, d, place);
                for (gram, energy) in self.gram[d].iter_mut().zip(&span.energy) {
                    for (j, row) in energy.chunks_exact(order).enumerate() {
                        // Row i relative to column j: the diagonal is in the middle.
                        let start = (first + j) * width + order - 1 - j;
                        gram[start..start + order].iter_mut().zip(row).for_each(|(t, x)| *t += x);
                    }
                }
            }
        }
    }
}

/// How the parameters of a region's points are spread over it.
struct Spread<const D: usize> {
    /// Ends of the region's spans, from 0 to 1 across the region.
    ends: [Vec<f64>; D],
    /// Edge lengths of the region, in parameters.
    size: [f64; D],
    weight: f64,
    first: [f64; D],
    second: [[f64; D]; D],
}

impl<const D: usize> Spread<D> {
    fn new(level: &LevelCells<D>, region: &Region<D>) -> Self {
        let mut size = [0.0; D];
        let ends = std::array::from_fn(|d| {
            let mut ends = vec![0.0];
            for place in 0..region.len[d] {
                let breaks = level.knots[d].breaks();
                let span = region.span(&level.knots, d, place);
                size[d] += breaks[span + 1] - breaks[span];
                ends.push(size[d]);
            }
            ends.iter_mut().for_each(|end| *end /= size[d]);
            ends
        });
        Self { ends, size, weight: 0.0, first: [0.0; D], second: [[0.0; D]; D] }
    }

    /// Adds a cell's sums `Σ ω`, `Σ ω t`, `Σ ω t tᵀ`.
    fn add(&mut self, place: [usize; D], sums: &[f64]) {
        let origin: [f64; D] = std::array::from_fn(|d| self.ends[d][place[d]]);
        let edge: [f64; D] = std::array::from_fn(|d| self.ends[d][place[d] + 1] - origin[d]);
        let weight = sums[0];
        let mut at = 1 + D;
        self.weight += weight;
        for d in 0..D {
            self.first[d] += weight * origin[d] + edge[d] * sums[1 + d];
            for e in d..D {
                let mixed = origin[d] * edge[e] * sums[1 + e] + origin[e] * edge[d] * sums[1 + d];
                self.second[d][e] += weight * origin[d] * origin[e] + mixed + edge[d] * edge[e] * sums[at];
                at += 1;
            }
        }
    }

    /// The squared distance of a place of the region from the mean of the points, in their covariance. `None` if these lie
    /// on a line, or, of a curve, in one place: if the smallest eigenvalue of the covariance is at most `LINE²`.
    fn distance_to_mean(&self, place: [f64; D]) -> Option<f64> {
        let mut shifted = [[0.0; D]; D];
        let mut way: [f64; D] = std::array::from_fn(|d| place[d] - self.first[d] / self.weight);
        for d in 0..D {
            for e in d..D {
                let covariance = self.second[d][e] / self.weight - self.first[d] * self.first[e] / self.weight.powi(2);
                shifted[d][e] = covariance - if d == e { LINE * LINE } else { 0.0 };
            }
        }
        // Elimination: positive definite if all pivots are positive.
        let mut distance = 0.0;
        for k in 0..D {
            let pivot = shifted[k][k];
            if pivot <= 0.0 {
                return None;
            }
            distance += way[k] * way[k] / pivot;
            for d in k + 1..D {
                way[d] -= shifted[k][d] / pivot * way[k];
                for e in d..D {
                    shifted[d][e] -= shifted[k][d] * shifted[k][e] / pivot;
                }
            }
        }
        Some(distance)
    }

    /// The region's share of the area of the domain.
    fn share_of_domain(&self, level: &LevelCells<D>) -> f64 {
        (0..D)
            .map(|d| {
                let (lower, upper) = level.knots[d].domain();
                self.size[d] / (upper - lower)
            })
            .product()
    }
}
