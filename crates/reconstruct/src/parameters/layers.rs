//! Two layers of one surface in a cloud without order.

use std::fmt;

use geom_io::Scan;
use ndarray::Array2;
use point_cloud::find_layers;
use serde::Serialize;

use crate::clean::is_laid_out_by_shape;
use crate::{Error, Event, ParameterOptions, Watch};

/// Two layers of one surface: scans that were joined a little apart.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LayersReport {
    /// Median distance between them, in the units of the input.
    pub distance: f64,
    /// Share of the points that lie where there are two.
    pub share: f64,
}

impl fmt::Display for LayersReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { distance, share } = self;
        write!(
            f,
            "two layers, {distance:.4e} apart over {:.0} % of the points: the surface runs between them",
            100.0 * share
        )
    }
}

/// Layers whose points were moved to the middle.
pub(super) struct Merged {
    pub(super) report: LayersReport,
    /// The points as they were.
    pub(super) scanned: Array2<f64>,
}

/// Moves the points of two layers to the middle between them, in clouds that are laid out by their shape: triangles, grids and given
/// parameters say by themselves what lies beside what.
pub(super) fn to_middle(
    scan: &mut Scan,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Result<Option<Merged>, Error> {
    let is_scattered = scan.cloud.grid.is_none() && scan.triangles.is_none() && scan.cloud.parameters.is_none();
    if !is_scattered || !is_laid_out_by_shape(options) {
        return Ok(None);
    }
    let _ = watch(Event::Step("looking for two layers"));
    let Some(found) = find_layers(scan.cloud.points.view())? else { return Ok(None) };
    let scanned = std::mem::replace(&mut scan.cloud.points, found.middle);
    Ok(Some(Merged { report: LayersReport { distance: found.distance, share: found.share }, scanned }))
}
