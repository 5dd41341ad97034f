//! One fit of a part on one layout.

use std::path::Path;
use std::sync::Arc;

use deviation::CREASE_DEGREES;
use multi_patch::{Fitted, Problem, Surface};
use quad_layout::QuadLayout;
use thb_core::MultiPatchSpace;

use super::mesh::SolidMesh;
use super::options::{Sharp, SolidOptions};
use super::report::{self, SolidReport};
use super::sampling;
use crate::{Error, Event, Watch};

/// Elements along each side of a patch, unless told.
pub(super) const ELEMENTS: usize = 4;

/// What is fitted.
pub(super) struct Part<'a> {
    pub(super) path: &'a Path,
    pub(super) mesh: &'a SolidMesh,
    pub(super) options: &'a SolidOptions,
}

/// A surface with its report.
pub(super) struct Attempt {
    pub(super) surface: Surface,
    pub(super) samples: multi_patch::Samples,
    pub(super) distances: Vec<f64>,
    pub(super) report: SolidReport,
}

impl Part<'_> {
    /// Fits the patches of a layout.
    pub(super) fn attempt(
        &self,
        layout: &QuadLayout,
        elements: usize,
        watch: &mut Watch<'_>,
    ) -> Result<Attempt, Error> {
        let Self { path, mesh, options } = *self;
        let sharp = match (options.sharp, layout.creases()) {
            (_, Some(creases)) => creases.to_vec(),
            (Sharp::Auto, None) => layout.sharp_arcs(CREASE_DEGREES),
            (Sharp::Angle(degrees), None) => layout.sharp_arcs(degrees),
            (Sharp::Off, None) => vec![false; layout.topology().arcs().len()],
        };
        let space = Arc::new(MultiPatchSpace::uniform(Arc::clone(layout.topology()), options.degree, elements)?);
        let _ = watch(Event::Step("finding parameters"));
        let samples = sampling::samples(mesh, layout, &sharp, &space);
        let _ = watch(Event::Step("fitting"));
        let fit_options = multi_patch::Options {
            plates: options.plates,
            smoothness: options.smoothness.weight(),
            diagonal: mesh.diagonal,
            ..multi_patch::Options::default()
        };
        let problem = Problem {
            space: &space,
            sharp: &sharp,
            sizes: &layout.sizes(),
            samples,
            outward: &|point, normal| mesh.outward(point, normal),
        };
        let fitted = multi_patch::fit(problem, &fit_options)?;
        let _ = watch(Event::Step("measuring"));
        let report = report::measured(path, mesh, layout, &sharp, &fitted, options)?;
        let Fitted { surface, samples, distances, .. } = fitted;
        Ok(Attempt { surface, samples, distances, report })
    }
}
