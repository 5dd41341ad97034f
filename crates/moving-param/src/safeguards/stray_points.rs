//! Points that are far from the map because their foot point is not the nearest one.

use thb_core::SplineMap;

use crate::Error;
use crate::points::constraint::Constraints;
use crate::points::foot_point::{FootPointOptions, Start, seek_anew};
use crate::safeguards::{Admission, Parameters, Safeguard};
use crate::state::State;

/// Samples per direction and cell among which the start of a stray point is sought.
const SAMPLES: usize = 4;

/// Which points are sought anew.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Stray {
    /// Those farther from the map than this.
    FartherThan(f64),
    /// Those of weight 0, which no step moves.
    WithoutWeight,
}

/// Moves stray points to their foot points, sought from their parameters and among samples of the map.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StrayPoints<'a, const D: usize> {
    pub(crate) stray: Stray,
    pub(crate) constraints: &'a Constraints<D>,
    pub(crate) foot_points: FootPointOptions,
}

impl<const D: usize> Safeguard<D> for StrayPoints<'_, D> {
    fn name(&self) -> &'static str {
        "stray points"
    }

    fn admit_parameters(
        &self,
        from: &State<'_, D>,
        map: &SplineMap<D>,
        moved: &mut Parameters<D>,
    ) -> Result<Admission, Error> {
        let is_stray = |at: usize| match self.stray {
            Stray::FartherThan(distance) => from.distances[at] > distance,
            Stray::WithoutWeight => !from.counts(at),
        };
        let places: Vec<usize> = (0..from.points.len()).filter(|&at| is_stray(at)).collect();
        let options = FootPointOptions { start: Start::Both(SAMPLES), ..self.foot_points };
        let found = seek_anew(map, from.points, &places, self.constraints, &options)?;
        for (&at, (u, cell)) in places.iter().zip(found) {
            (moved.values[at], moved.cells[at]) = (u, cell);
        }
        Ok(if places.is_empty() { Admission::Unchanged } else { Admission::Changed(places.len()) })
    }
}
