//! The surface where a function is 0 (negative inside), by surface nets (Gibson 1998): one vertex for each cell of a grid with both
//! signs at its corners, one quadrilateral for each edge of the grid with both.

use anyhow::{Result, ensure};

use super::part::{Part, Point};

/// Most corners of a grid: 2 GB of values.
///
/// Limit: guards memory; 50,000 triangles of a slender shape take 2 · 10⁷.
const MOST_CORNERS: usize = 250_000_000;

/// Passes in which signs are changed.
///
/// Limit: a change may cause another beside it; two or three passes do.
const MOST_PASSES: usize = 20;

/// Values at the corners of a grid.
struct Grid {
    low: Point,
    edge: f64,
    counts: [usize; 3],
    values: Vec<f64>,
}

impl Grid {
    fn new(field: &dyn Fn(Point) -> f64, low: Point, high: Point, edge: f64) -> Result<Self> {
        let counts = [0, 1, 2].map(|k| ((high[k] - low[k]) / edge).ceil() as usize + 1);
        let corners = counts.iter().product::<usize>();
        ensure!(corners <= MOST_CORNERS, "a grid of {corners} corners is more than {MOST_CORNERS}");
        let mut grid = Self { low, edge, counts, values: Vec::with_capacity(corners) };
        for k in 0..counts[2] {
            for j in 0..counts[1] {
                for i in 0..counts[0] {
                    let value = field(grid.corner([i, j, k]));
                    grid.values.push(value);
                }
            }
        }
        for _ in 0..MOST_PASSES {
            if !grid.settle() {
                break;
            }
        }
        Ok(grid)
    }

    /// Where the corners of a side of a cell have both signs by turns, nets are not closed surfaces: the sign of the smallest value is
    /// changed. Whether any was.
    fn settle(&mut self) -> bool {
        let mut changed = false;
        for at in places(self.counts) {
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                if at[u] + 1 == self.counts[u] || at[v] + 1 == self.counts[v] {
                    continue;
                }
                let corner = |du: usize, dv: usize| {
                    let mut corner = at;
                    corner[u] += du;
                    corner[v] += dv;
                    self.index(corner)
                };
                let round = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                let inside = round.map(|k| self.values[k] < 0.0);
                if inside[0] == inside[2] && inside[1] == inside[3] && inside[0] != inside[1] {
                    let size = |&k: &usize| self.values[k].abs();
                    if let Some(least) = round.into_iter().min_by(|a, b| size(a).total_cmp(&size(b))) {
                        // A value of 0 counts as outside.
                        let value = self.values[least];
                        self.values[least] = if value == 0.0 { -f64::MIN_POSITIVE } else { -value };
                        changed = true;
                    }
                }
            }
        }
        changed
    }

    fn corner(&self, at: [usize; 3]) -> Point {
        [0, 1, 2].map(|k| self.low[k] + self.edge * at[k] as f64)
    }

    fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * self.counts[1] + j) * self.counts[0] + i
    }

    fn value(&self, at: [usize; 3]) -> f64 {
        self.values[self.index(at)]
    }

    /// The mean of the places where edges of a cell cross the surface; nothing where none does.
    fn vertex(&self, cell: [usize; 3]) -> Option<Point> {
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for axis in 0..3 {
            for side in 0..4 {
                let mut from = cell;
                from[(axis + 1) % 3] += side & 1;
                from[(axis + 2) % 3] += side >> 1;
                let mut to = from;
                to[axis] += 1;
                let (a, b) = (self.value(from), self.value(to));
                if (a < 0.0) != (b < 0.0) {
                    let mut place = self.corner(from);
                    place[axis] += self.edge * a / (a - b);
                    (0..3).for_each(|k| sum[k] += place[k]);
                    count += 1.0;
                }
            }
        }
        (count > 0.0).then(|| sum.map(|x| x / count))
    }
}

/// Triangles over the surface in a box, which it must not leave, with edges of about that length.
pub(super) fn surface(field: &dyn Fn(Point) -> f64, low: Point, high: Point, edge: f64) -> Result<Part> {
    let grid = Grid::new(field, low, high, edge)?;
    let mut part = Part::default();
    let mut vertices = vec![usize::MAX; grid.values.len()];
    let cells = grid.counts.map(|count| count - 1);
    for at in places(cells) {
        if let Some(place) = grid.vertex(at) {
            vertices[grid.index(at)] = part.add(place);
        }
    }
    for at in places(grid.counts) {
        for axis in 0..3 {
            let mut to = at;
            to[axis] += 1;
            if to[axis] == grid.counts[axis] || (grid.value(at) < 0.0) == (grid.value(to) < 0.0) {
                continue;
            }
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            ensure!(
                at[u] > 0 && at[v] > 0 && at[u] < cells[u] && at[v] < cells[v],
                "the surface leaves its box at {:?}",
                grid.corner(at)
            );
            let cell = |du: usize, dv: usize| {
                let mut cell = at;
                cell[u] -= du;
                cell[v] -= dv;
                vertices[grid.index(cell)]
            };
            let mut round = [cell(1, 1), cell(0, 1), cell(0, 0), cell(1, 0)];
            if grid.value(at) >= 0.0 {
                round.reverse();
            }
            part.triangle([round[0], round[1], round[2]]);
            part.triangle([round[0], round[2], round[3]]);
        }
    }
    Ok(part)
}

fn places(counts: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..counts[2]).flat_map(move |k| (0..counts[1]).flat_map(move |j| (0..counts[0]).map(move |i| [i, j, k])))
}
