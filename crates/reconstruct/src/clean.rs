//! What is removed from a scan before it is laid out.

use std::array;
use std::path::Path;

use geom_io::{ReadOptions, Scan, read_scan};
use ndarray::{Array2, ArrayView2};
use point_cloud::{
    CloudPieces, Duplicates, FarValues, GridShape, Neighbours, Pieces, TriangleMesh, check_surface_cloud,
    find_isolated, find_outliers, find_stray_pieces, merge_duplicate_vertices, thin, weld,
};
use rstar::primitives::GeomWithData;
use rstar::{AABB, RTree};
use serde::Serialize;

use crate::options::{Clean, ParameterChoice};
use crate::parameters::boundary::named_rows;
use crate::parameters::layout::{MIN_POINTS, extent, spread_over_square};
use crate::{Error, Event, ParameterOptions, Watch};

/// Neighbours and robust standard deviations that make a point an outlier.
const OUTLIERS: (usize, f64) = (12, 5.0);
/// Neighbours, and spacings over which they still belong to one piece.
const PIECES: (usize, f64) = (24, 3.0);
/// Share of the points up to which those off the largest piece of a cloud are stray. Rows far apart are pieces too.
const STRAY_MOST: f64 = 0.5;
/// Points up to which copies and stray pieces are looked for unasked: it takes a second for each 4·10⁵ points. Larger clouds are
/// laid out through a well-spread subset, in which no copies are left.
const LOOKED_AT: usize = 200_000;

/// Rows that a report lists at most; the counts are those of all.
const LISTED: usize = 1000;

/// Largest distance of a parameter from where its point is in the extents of x and y, if it was made from these.
///
/// Limit: round-off of parameters that were computed from coordinates with an offset of 10⁶ extents.
const SAME_PLACE: f64 = 1e-9;

/// What was set aside unasked. Rows are those of the file, from 0; of long lists the first thousand.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CleaningReport {
    /// Points that were there before: those of the file without cells that hold no data and what options left out.
    pub given: usize,
    /// Points with values far beyond the rest: fill values, coordinates that went wrong.
    pub sentinels: usize,
    /// How many of these share such a value with others, as cells without data do.
    pub fill_values: usize,
    /// Rows of the sentinels.
    pub sentinel_rows: Vec<u32>,
    /// Points that stand alone, away from the surface.
    pub outliers: usize,
    /// Their rows.
    pub outlier_rows: Vec<u32>,
    /// Points that are equal to others or nearly so, and were made one with the first of these.
    pub merged: usize,
}

impl CleaningReport {
    /// Share of the different points that were set aside: sentinels and outliers, but neither copies nor fill values, which are no points.
    pub fn share_set_aside(&self) -> f64 {
        (self.sentinels - self.fill_values.min(self.sentinels) + self.outliers) as f64
            / (self.given - self.merged.min(self.given)).max(1) as f64
    }

    fn warnings(&self) -> Vec<String> {
        let share = |count: usize| 100.0 * count as f64 / self.given.max(1) as f64;
        let told = [
            (self.sentinels, "have values far beyond the rest", "sentinel_rows"),
            (self.outliers, "stand alone, away from the surface", "outlier_rows"),
        ];
        told.into_iter()
            .filter(|(count, ..)| *count > 0)
            .map(|(count, what, rows)| {
                format!(
                    "{count} of {} points ({:.2} %) {what}, and were set aside; their rows are in cleaning.{rows}, --clean none keeps them",
                    self.given,
                    share(count)
                )
            })
            .collect()
    }
}

/// A scan without what was to be removed.
pub(crate) struct Cleaned {
    pub(crate) scan: Scan,
    pub(crate) found: Found,
    /// What was set aside unasked.
    pub(crate) report: CleaningReport,
    /// Points of a grid without data, with coordinates from their neighbours so that the grid is full: to be left out again once it
    /// has parameters. Increasing.
    pub(crate) gaps: Vec<usize>,
    /// Neighbours of the points as they are, once searched: enough for all that is looked for.
    neighbours: Option<Neighbours>,
}

/// What was found; `None` where it was not looked for.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Found {
    pub(crate) outliers: Option<usize>,
    pub(crate) stray: Option<usize>,
    pub(crate) pieces: Option<usize>,
    /// Whether most points lie off the largest piece, so that they are not stray.
    pub(crate) are_parts: bool,
}

/// Crops, masks, sets aside what cannot be of the surface, cleans and thins.
pub(crate) fn clean(scan: Scan, options: &ParameterOptions, watch: &mut Watch<'_>) -> Result<Cleaned, Error> {
    let m = scan.cloud.points.nrows();
    let spreads = is_height_field(&scan, options);
    let mut cleaned = Cleaned::new(scan);
    cleaned.crop_and_mask(options, watch)?;
    let asked = |what| options.clean.contains(&what);
    cleaned.report.given = cleaned.scan.rows.len();
    let is_free = !asked(Clean::Nothing);
    if is_free {
        cleaned.set_far_values_aside(options)?;
    }
    if cleaned.scan.rows.len() < m && spreads {
        cleaned.spread_heights(options.closed.directions());
    }
    let scattered = cleaned.scan.cloud.grid.is_none() && cleaned.scan.triangles.is_none();
    let by_shape = scattered && cleaned.scan.cloud.parameters.is_none() && is_laid_out_by_shape(options);
    let is_small = cleaned.scan.rows.len() <= LOOKED_AT;
    if by_shape && is_free {
        let _ = watch(Event::Step("looking for copies and outliers"));
        let named = named_rows(&cleaned.scan, options)?;
        let is_named = |row: &u32| named.binary_search(row).is_ok();
        if is_small {
            cleaned.merge_copies(&is_named)?;
        }
        if !asked(Clean::Outliers) {
            cleaned.set_isolated_aside(&is_named)?;
        }
    }
    if let Some(piece) = options.piece {
        let _ = watch(Event::Step("looking for pieces"));
        cleaned.keep_piece(piece)?;
    }
    if asked(Clean::Stray) || by_shape && is_small && is_free {
        let _ = watch(Event::Step("looking for stray pieces"));
        cleaned.stray(asked(Clean::Stray))?;
    }
    if asked(Clean::Outliers) {
        let _ = watch(Event::Step("looking for outliers"));
        cleaned.outliers()?;
    }
    if let Some(n) = options.thin {
        let _ = watch(Event::Step("thinning"));
        let kept = thin(cleaned.scan.cloud.points.view(), n)?.kept;
        cleaned.keep(kept, "--thin")?;
    }
    cleaned.scan.notes.extend(cleaned.report.warnings());
    Ok(cleaned)
}

/// A scan in pieces.
pub(crate) struct Pieced {
    /// What options that crop and mask leave of it.
    pub(crate) scan: Scan,
    /// The piece of each point, the largest being 0; none for points without triangles in a mesh.
    pub(crate) piece_of: Vec<Option<usize>>,
    /// Triangles of each piece, of a cloud points, largest first.
    pub(crate) sizes: Vec<usize>,
    /// `mesh` or `cloud`.
    pub(crate) what: &'static str,
}

/// Crops and masks a scan and finds its pieces.
pub(crate) fn split(scan: Scan, options: &ParameterOptions, watch: &mut Watch<'_>) -> Result<Pieced, Error> {
    let mut cleaned = Cleaned::new(scan);
    cleaned.crop_and_mask(options, watch)?;
    let _ = watch(Event::Step("looking for pieces"));
    let (MeshPieces { piece_of, sizes }, what) = cleaned.pieces()?;
    Ok(Pieced { scan: cleaned.scan, piece_of, sizes, what })
}

/// Whether x and y are the parameters of a scan.
fn is_height_field(scan: &Scan, options: &ParameterOptions) -> bool {
    let (points, Some(parameters)) = (scan.cloud.points.view(), &scan.cloud.parameters) else { return false };
    let is_column = |d: usize| {
        let (lower, upper) = extent(points.column(d));
        let place = |x: f64| (0.5 * x - 0.5 * lower) / (0.5 * upper - 0.5 * lower);
        points.column(d).iter().zip(parameters.column(d)).all(|(&x, &u)| (place(x) - u).abs() <= SAME_PLACE)
    };
    (options.read.height_field || scan.cell.is_some())
        && points.ncols() == 3
        && parameters.ncols() == 2
        && (0..2).all(is_column)
}

/// Places without data in a grid with points `(n_u · n_v, 3)` get points from the lines through them: between the nearest two
/// points, or else on from these. Whether all have.
fn fill_gaps(points: &mut Array2<f64>, grid: GridShape, gaps: &[usize]) -> bool {
    let shape = [grid.n_u, grid.n_v];
    let row = |at: [usize; 2]| at[0] * shape[1] + at[1];
    let is_gap = |row: usize| gaps.binary_search(&row).is_ok();
    let given = points.clone();
    gaps.iter().all(|&gap| {
        let at = [gap / shape[1], gap % shape[1]];
        let (mut between, mut beside): (Vec<[f64; 3]>, Vec<[f64; 3]>) = (Vec::new(), Vec::new());
        for d in 0..2 {
            let along = |k: usize| row(array::from_fn(|e| if e == d { k } else { at[e] }));
            let before = || (0..at[d]).rev().filter(|&k| !is_gap(along(k)));
            let after = || (at[d] + 1..shape[d]).filter(|&k| !is_gap(along(k)));
            let two = match (before().next(), after().next()) {
                (Some(a), Some(b)) => Some((a, b, true)),
                (Some(a), None) => before().nth(1).map(|b| (a, b, false)),
                (None, Some(a)) => after().nth(1).map(|b| (a, b, false)),
                (None, None) => None,
            };
            if let Some((a, b, is_between)) = two {
                let t = (at[d] as f64 - a as f64) / (b as f64 - a as f64);
                let place = array::from_fn(|k| (1.0 - t) * given[[along(a), k]] + t * given[[along(b), k]]);
                if is_between { &mut between } else { &mut beside }.push(place);
            }
        }
        let chosen = if between.is_empty() { beside } else { between };
        for k in 0..3 {
            points[[gap, k]] = chosen.iter().map(|place| place[k]).sum::<f64>() / chosen.len().max(1) as f64;
        }
        !chosen.is_empty()
    })
}

/// The far values of a scan, as a mesh where it has triangles.
pub(crate) fn far_values(points: ArrayView2<'_, f64>, triangles: Option<&[[u32; 3]]>) -> Result<FarValues, Error> {
    Ok(match triangles {
        Some(triangles) => {
            FarValues::of_mesh(&TriangleMesh { vertices: points.to_owned(), triangles: triangles.to_vec() })?
        }
        None => FarValues::of_cloud(points)?,
    })
}

/// Whether a cloud without order would be laid out by its shape, so that stray points matter.
pub(crate) fn is_laid_out_by_shape(options: &ParameterOptions) -> bool {
    !matches!(options.param, ParameterChoice::Given | ParameterChoice::Chord | ParameterChoice::Centripetal)
}

impl Cleaned {
    fn new(scan: Scan) -> Self {
        let (found, report) = (Found::default(), CleaningReport::default());
        Self { scan, found, report, gaps: Vec::new(), neighbours: None }
    }

    fn crop_and_mask(&mut self, options: &ParameterOptions, watch: &mut Watch<'_>) -> Result<(), Error> {
        if let Some(crop) = options.crop {
            let points = &self.scan.cloud.points;
            let kept = (0..points.nrows()).filter(|&i| crop.holds(points[[i, 0]], points[[i, 1]])).collect();
            self.keep(kept, "--crop")?;
        }
        if let Some(path) = &options.mask {
            let _ = watch(Event::Step("masking"));
            let kept = unmasked(path, &self.scan)?;
            self.keep(kept, "--mask")?;
        }
        Ok(())
    }

    /// Keeps points, which loses the order of a grid, and triangles of which all vertices stay.
    fn keep(&mut self, kept: Vec<usize>, option: &'static str) -> Result<(), Error> {
        let given = self.scan.rows.len();
        if kept.len() == given {
            return Ok(());
        }
        if kept.is_empty() {
            return Err(Error::NothingLeft { option, given });
        }
        self.scan.notes.push(format!("{option} left out {} of {given} points", given - kept.len()));
        if self.scan.cloud.grid.is_some() && self.scan.cloud.parameters.is_none() {
            self.scan.notes.push(format!("the grid order was lost by {option}"));
        }
        self.scan.select(&kept);
        self.neighbours = None;
        Ok(())
    }

    /// Keeps the points that are not listed, without a note.
    fn set_aside(&mut self, places: &[u32]) {
        let kept: Vec<usize> =
            (0..self.scan.rows.len()).filter(|&i| places.binary_search(&(i as u32)).is_err()).collect();
        self.scan.select(&kept);
        self.neighbours = None;
    }

    fn listed(&self, places: &[u32]) -> Vec<u32> {
        let mut rows: Vec<u32> = places.iter().map(|&i| self.scan.rows[i as usize]).collect();
        rows.sort_unstable();
        rows.truncate(LISTED);
        rows
    }

    /// Sets points with values far beyond the rest aside. A grid that is laid out along its lines stays full, with gaps.
    fn set_far_values_aside(&mut self, options: &ParameterOptions) -> Result<(), Error> {
        let FarValues { rows: far, fills, .. } =
            far_values(self.scan.cloud.points.view(), self.scan.triangles.as_deref())?;
        self.report.fill_values = fills;
        if far.is_empty() {
            return Ok(());
        }
        (self.report.sentinels, self.report.sentinel_rows) = (far.len(), self.listed(&far));
        let along_lines = matches!(
            options.param,
            ParameterChoice::Auto
                | ParameterChoice::Chord
                | ParameterChoice::Centripetal
                | ParameterChoice::Parcnn
                | ParameterChoice::Uniform
        );
        let is_plain = self.scan.cloud.parameters.is_none() && self.scan.triangles.is_none() && options.thin.is_none();
        if let Some(grid) = self.scan.cloud.grid.filter(|_| along_lines && is_plain && options.clean.is_empty()) {
            let gaps: Vec<usize> = far.iter().map(|&i| i as usize).collect();
            if fill_gaps(&mut self.scan.cloud.points, grid, &gaps) {
                self.gaps = gaps;
                return Ok(());
            }
        }
        if self.scan.cloud.grid.is_some() && self.scan.cloud.parameters.is_none() {
            self.scan.notes.push("the grid order was lost with points that have values far beyond the rest".to_owned());
        }
        self.set_aside(&far);
        Ok(())
    }

    /// Spreads x and y of what is left over the square, which closed directions fill already.
    fn spread_heights(&mut self, closed: [bool; 2]) {
        let cloud = &mut self.scan.cloud;
        if let Some(parameters) = &mut cloud.parameters {
            for d in (0..2).filter(|&d| !closed[d]) {
                parameters.column_mut(d).assign(&cloud.points.column(d));
            }
            spread_over_square(parameters, closed);
        }
    }

    fn merge_copies(&mut self, is_named: &dyn Fn(&u32) -> bool) -> Result<(), Error> {
        let rows = &self.scan.rows;
        let groups = Duplicates::find_near(self.scan.cloud.points.view(), |i| is_named(&rows[i]))?;
        self.report.merged = groups.count();
        if groups.count() == 0 {
            return Ok(());
        }
        if let Some(weights) = &mut self.scan.weights {
            // A point counts as much as the best of its copies.
            for (i, &at) in groups.map.iter().enumerate() {
                let first = groups.kept[at];
                weights[first] = weights[first].max(weights[i]);
            }
        }
        let note = format!("{} points are equal to others, or nearly so, and were made one with these", groups.count());
        self.scan.notes.push(note);
        self.scan.select(&groups.kept);
        self.neighbours = None;
        Ok(())
    }

    fn set_isolated_aside(&mut self, is_named: &dyn Fn(&u32) -> bool) -> Result<(), Error> {
        let mut isolated = find_isolated(self.scan.cloud.points.view())?;
        isolated.retain(|&i| !is_named(&self.scan.rows[i as usize]));
        self.found.outliers = Some(isolated.len());
        (self.report.outliers, self.report.outlier_rows) = (isolated.len(), self.listed(&isolated));
        if !isolated.is_empty() {
            self.set_aside(&isolated);
        }
        Ok(())
    }

    fn neighbours(&mut self) -> Result<&Neighbours, Error> {
        let found = match self.neighbours.take() {
            Some(found) => found,
            None => Neighbours::nearest(self.scan.cloud.points.view(), PIECES.0.max(OUTLIERS.0))?,
        };
        Ok(self.neighbours.insert(found))
    }

    fn cloud_pieces(&mut self) -> Result<CloudPieces, Error> {
        check_surface_cloud(self.scan.cloud.points.view(), MIN_POINTS)?;
        Ok(find_stray_pieces(self.neighbours()?, PIECES.1)?)
    }

    fn stray(&mut self, remove: bool) -> Result<(), Error> {
        if let Some(MeshPieces { piece_of, .. }) = mesh_pieces(&self.scan)? {
            let kept: Vec<usize> = (0..self.scan.rows.len()).filter(|&i| piece_of[i] == Some(0)).collect();
            self.found.stray = Some(self.scan.rows.len() - kept.len());
            return if remove { self.keep(kept, "--clean stray") } else { Ok(()) };
        }
        let pieces = self.cloud_pieces()?;
        let kept: Vec<usize> = (0..self.scan.rows.len()).filter(|&i| pieces.piece_of[i] == 0).collect();
        self.found.stray = Some(self.scan.rows.len() - kept.len());
        self.found.pieces = Some(pieces.sizes.len());
        let given = self.scan.rows.len();
        self.found.are_parts = (given - kept.len()) as f64 > STRAY_MOST * given as f64;
        match (remove, self.found.are_parts) {
            (false, _) => Ok(()),
            (true, true) => Err(Error::NotStray { kept: kept.len(), given }),
            (true, false) => self.keep(kept, "--clean stray"),
        }
    }

    /// The pieces, by triangles or by points, and what they are pieces of: `mesh` or `cloud`.
    fn pieces(&mut self) -> Result<(MeshPieces, &'static str), Error> {
        Ok(match mesh_pieces(&self.scan)? {
            Some(pieces) => (pieces, "mesh"),
            None => {
                let CloudPieces { piece_of, sizes, .. } = self.cloud_pieces()?;
                (MeshPieces { piece_of: piece_of.into_iter().map(Some).collect(), sizes }, "cloud")
            }
        })
    }

    /// Keeps one piece, counted from 1.
    fn keep_piece(&mut self, asked: usize) -> Result<(), Error> {
        let (MeshPieces { piece_of, sizes }, what) = self.pieces()?;
        if asked > sizes.len() {
            return Err(Error::NoSuchPiece { asked, what, sizes });
        }
        let kept = (0..self.scan.rows.len()).filter(|&i| piece_of[i] == asked.checked_sub(1)).collect();
        self.keep(kept, "--piece")
    }

    fn outliers(&mut self) -> Result<(), Error> {
        let (k, factor) = OUTLIERS;
        let outliers = find_outliers(self.neighbours()?, k, factor)?;
        self.found.outliers = Some(outliers.removed.len());
        self.keep(outliers.kept, "--clean outliers")
    }
}

/// The pieces of a mesh whose vertices may stand there several times.
pub(crate) struct MeshPieces {
    /// The piece of each vertex, the largest being 0; none for vertices without triangles.
    pub(crate) piece_of: Vec<Option<usize>>,
    /// Triangles of each piece, largest first.
    pub(crate) sizes: Vec<usize>,
}

/// The pieces of a scan with triangles; `None` without.
pub(crate) fn mesh_pieces(scan: &Scan) -> Result<Option<MeshPieces>, Error> {
    let Some(triangles) = &scan.triangles else { return Ok(None) };
    let mesh = TriangleMesh { vertices: scan.cloud.points.clone(), triangles: triangles.clone() };
    let (exact, mut duplicates, _) = merge_duplicate_vertices(&mesh);
    let (mut joined, mut pieces) = (exact.triangles.clone(), Pieces::find(&exact)?);
    if pieces.sizes.len() > 1 {
        // Corners that differ in their last digits only are looked for where it matters.
        let welded = weld(&mesh)?;
        pieces = Pieces::find(&welded.mesh)?;
        (joined, duplicates) = (welded.mesh.triangles, welded.duplicates);
    }
    let mut of_joined: Vec<Option<usize>> = vec![None; duplicates.kept.len()];
    for (triangle, &piece) in joined.iter().zip(&pieces.piece_of) {
        for &vertex in triangle {
            let of_vertex = &mut of_joined[vertex as usize];
            // Where two pieces meet in a vertex, it is of the larger one.
            *of_vertex = Some(of_vertex.map_or(piece, |other| other.min(piece)));
        }
    }
    let piece_of = duplicates.map.iter().map(|&at| of_joined[at]).collect();
    Ok(Some(MeshPieces { piece_of, sizes: pieces.sizes }))
}

/// Points over a cell of the grid file that has a value other than 0.
fn unmasked(path: &Path, scan: &Scan) -> Result<Vec<usize>, Error> {
    let mask = read_scan(path, &ReadOptions::default())?;
    let reach = mask.cell.ok_or_else(|| Error::Mask { path: path.to_owned() })?.map(|side| 0.5 * side * (1.0 + 1e-9));
    let cells = &mask.cloud.points;
    let sites = cells.outer_iter().map(|c| GeomWithData::new([c[0], c[1]], c[2])).collect();
    let tree: RTree<GeomWithData<[f64; 2], f64>> = RTree::bulk_load(sites);
    let points = &scan.cloud.points;
    let is_kept = |i: &usize| {
        let place = [points[[*i, 0]], points[[*i, 1]]];
        let around =
            AABB::from_corners(array::from_fn(|d| place[d] - reach[d]), array::from_fn(|d| place[d] + reach[d]));
        // On the side of two cells either will do.
        tree.locate_in_envelope(around).any(|cell| cell.data != 0.0)
    };
    Ok((0..points.nrows()).filter(is_kept).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_of_a_grid_are_filled_along_its_lines() {
        let grid = GridShape { n_u: 5, n_v: 7 };
        let plane = Array2::from_shape_fn((35, 3), |(row, k)| {
            let (i, j) = ((row / 7) as f64, (row % 7) as f64);
            [2.0 * i + 100.0, 0.5 * j - i, 3.0 * i - j][k]
        });
        // Inside, side by side, at a corner, along a side.
        for gaps in [vec![17], vec![16, 17, 18, 23], vec![0], vec![6, 13, 20], (0..7).collect()] {
            let mut points = plane.clone();
            gaps.iter().for_each(|&gap| points.row_mut(gap).fill(-9999.0));
            assert!(fill_gaps(&mut points, grid, &gaps));
            assert!((&points - &plane).iter().all(|off| off.abs() < 1e-12), "{gaps:?}");
        }
        // Nothing is left of the lines through a place.
        let cross: Vec<usize> = (0..35).filter(|row| row / 7 == 2 || row % 7 == 3).collect();
        assert!(!fill_gaps(&mut plane.clone(), grid, &cross));
    }

    #[test]
    fn the_share_set_aside_leaves_out_copies_and_fill_values() {
        let report = CleaningReport {
            given: 1100,
            sentinels: 12,
            fill_values: 10,
            outliers: 8,
            merged: 100,
            ..Default::default()
        };
        assert_eq!(report.share_set_aside(), 0.01);
        assert_eq!(CleaningReport::default().share_set_aside(), 0.0);
    }
}
