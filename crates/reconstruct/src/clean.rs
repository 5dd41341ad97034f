//! What is removed from a scan before it is laid out.

use std::array;
use std::path::Path;

use geom_io::{Format, ReadOptions, Scan, read_scan};
use point_cloud::{
    Neighbours, SubMesh, TriangleMesh, check_surface_cloud, find_outliers, find_stray_pieces, largest_piece, thin,
};
use rstar::primitives::GeomWithData;
use rstar::{AABB, RTree};

use crate::parameter_options::{Clean, ParameterChoice};
use crate::parameters::spread_over_square;
use crate::{Error, Event, ParameterOptions, Watch};

/// Neighbours and robust standard deviations that make a point an outlier.
const OUTLIERS: (usize, f64) = (12, 5.0);
/// Neighbours, and spacings over which they still belong to one piece.
const PIECES: (usize, f64) = (24, 3.0);
/// Share of the points up to which those off the largest piece of a cloud are stray. Rows far apart are pieces too.
const STRAY_MOST: f64 = 0.5;
/// Points up to which outliers and stray pieces are looked for unasked: it takes a second for each 4·10⁵ points.
const LOOKED_AT: usize = 200_000;

/// A scan without what was to be removed.
pub(crate) struct Cleaned {
    pub(crate) scan: Scan,
    pub(crate) found: Found,
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

/// Crops, masks, cleans and thins.
pub(crate) fn clean(scan: Scan, options: &ParameterOptions, watch: &mut Watch<'_>) -> Result<Cleaned, Error> {
    let m = scan.cloud.points.nrows();
    let mut cleaned = Cleaned { scan, found: Found::default(), neighbours: None };
    if let Some(crop) = options.crop {
        let points = &cleaned.scan.cloud.points;
        let kept = (0..m).filter(|&i| crop.holds(points[[i, 0]], points[[i, 1]])).collect();
        cleaned.keep(kept, "--crop")?;
    }
    if let Some(path) = &options.mask {
        let _ = watch(Event::Step("masking"));
        let kept = unmasked(path, &cleaned.scan)?;
        cleaned.keep(kept, "--mask")?;
    }
    if cleaned.scan.rows.len() < m && (options.read.height_field || cleaned.scan.format == Format::EsriGrid) {
        // What is left of a height field is spread over the square again.
        cleaned.scan.cloud.parameters.iter_mut().for_each(|uv| spread_over_square(uv, options.closed.directions()));
    }
    let scattered = cleaned.scan.cloud.grid.is_none() && cleaned.scan.triangles.is_none();
    let unasked = scattered
        && cleaned.scan.cloud.parameters.is_none()
        && cleaned.scan.rows.len() <= LOOKED_AT
        && is_laid_out_by_shape(options);
    let asked = |what| options.clean.contains(&what);
    if asked(Clean::Stray) || unasked {
        let _ = watch(Event::Step("looking for stray pieces"));
        cleaned.stray(asked(Clean::Stray))?;
    }
    if asked(Clean::Outliers) || unasked {
        let _ = watch(Event::Step("looking for outliers"));
        cleaned.outliers(asked(Clean::Outliers))?;
    }
    if let Some(n) = options.thin {
        let _ = watch(Event::Step("thinning"));
        let kept = thin(cleaned.scan.cloud.points.view(), n)?.kept;
        cleaned.keep(kept, "--thin")?;
    }
    Ok(cleaned)
}

/// Whether a cloud without order would be laid out by its shape, so that stray points matter.
pub(crate) fn is_laid_out_by_shape(options: &ParameterOptions) -> bool {
    !matches!(options.param, ParameterChoice::Given | ParameterChoice::Chord | ParameterChoice::Centripetal)
}

impl Cleaned {
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

    fn neighbours(&mut self) -> Result<&Neighbours, Error> {
        let found = match self.neighbours.take() {
            Some(found) => found,
            None => Neighbours::nearest(self.scan.cloud.points.view(), PIECES.0.max(OUTLIERS.0))?,
        };
        Ok(self.neighbours.insert(found))
    }

    fn stray(&mut self, remove: bool) -> Result<(), Error> {
        if let Some(triangles) = &self.scan.triangles {
            let mesh = TriangleMesh { vertices: self.scan.cloud.points.clone(), triangles: triangles.clone() };
            let SubMesh { kept, .. } = largest_piece(&mesh)?;
            self.found.stray = Some(self.scan.rows.len() - kept.len());
            return if remove { self.keep(kept, "--clean stray") } else { Ok(()) };
        }
        check_surface_cloud(self.scan.cloud.points.view(), 4)?;
        let pieces = find_stray_pieces(self.neighbours()?, PIECES.1)?;
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

    fn outliers(&mut self, remove: bool) -> Result<(), Error> {
        let (k, factor) = OUTLIERS;
        let outliers = find_outliers(self.neighbours()?, k, factor)?;
        self.found.outliers = Some(outliers.removed.len());
        if remove { self.keep(outliers.kept, "--clean outliers") } else { Ok(()) }
    }
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
