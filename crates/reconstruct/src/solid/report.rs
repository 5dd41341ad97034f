//! How good a surface of many faces is.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use deviation::{Crossing, Crossings, TessellatedPatch, self_crossings};
use multi_patch::{AngleReport, Fitted, Step, Surface, TURNED_OVER, angles, folds, integrals};
use point_cloud::vec3::{cross, norm};
use quad_layout::QuadLayout;
use rayon::prelude::*;
use serde::Serialize;
use thb_core::CellSpace;

use super::SolidOptions;
use super::mesh::SolidMesh;
use crate::Error;

/// Largest distance anywhere, in tolerances.
///
/// Derived: a lost detail is no less lost for lying on less than a hundredth of the area; 1 % of the diagonal at the usual tolerance.
pub(crate) const FAR: f64 = 10.0 / 3.0;

/// Angle in degrees between neighbouring faces along a smooth arc from which on the surface is creased there.
///
/// Calibrated: `thb fit PART.off` on 21 closed meshes: 18 have at most 5.5°, `bull` and `camel` 29° and 40° at one place each, and
/// `rotor_small` is turned over.
pub(crate) const KINK: f64 = 10.0;

/// Places in a cell and direction at which the surface is measured against the mesh.
const PLACES: usize = 4;

/// What a fit of a whole part came to.
#[derive(Clone, Debug, Serialize)]
pub struct SolidReport {
    /// Version of this report.
    pub schema: u32,
    /// The file of the mesh.
    pub input: PathBuf,
    /// Triangles of the mesh.
    pub triangles: usize,
    /// Diagonal of its box.
    pub diagonal: f64,
    /// The patches.
    pub layout: SolidLayoutReport,
    /// Functions of the space: control points of the whole surface.
    pub functions: usize,
    /// Samples that were fitted.
    pub samples: usize,
    /// The tolerance.
    pub tolerance: f64,
    /// Distances of the mesh, on its curved triangles, from the surface.
    pub mesh_to_surface: SolidDistances,
    /// Distances of the surface from the mesh; between a facet and the curved triangle over it there is none.
    pub surface_to_mesh: SolidDistances,
    /// Angles between neighbouring faces along smooth arcs, in degrees.
    pub angles: AngleReport,
    /// Faces on which the surface faces the wrong way somewhere.
    pub folded_faces: Vec<usize>,
    /// Places, of 25 in each element, at which it does.
    pub folded_places: usize,
    /// Places where the surface passes through itself and the mesh does not, the largest first; ten at most.
    pub crossings: Crossings,
    /// Volume, of a closed surface.
    pub volume: Option<SolidVolume>,
    /// What happened.
    pub steps: Vec<Step>,
    /// Why the surface is not what was asked for; empty if it is.
    pub reasons: Vec<SolidReason>,
    /// Time taken.
    pub seconds: f64,
    /// The options.
    pub options: SolidOptions,
}

/// The patches of a fit.
#[derive(Clone, Debug, Serialize)]
pub struct SolidLayoutReport {
    /// Faces.
    pub faces: usize,
    /// Arcs between them.
    pub arcs: usize,
    /// Arcs that are creases.
    pub sharp_arcs: usize,
    /// Vertices.
    pub vertices: usize,
    /// Number of vertices of each valence.
    pub valences: BTreeMap<usize, usize>,
    /// Genus of a closed surface.
    pub genus: Option<isize>,
    /// Patches whose given parameters folded, and were found anew.
    pub mapped_anew: Vec<usize>,
}

/// Distances, by area.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SolidDistances {
    /// Root of the mean square.
    pub rms: f64,
    /// Not exceeded on 99 % of the area.
    pub p99: f64,
    /// The largest.
    pub max: f64,
    /// Share of the area within the tolerance.
    pub within: f64,
}

/// Volumes of a closed surface and of the mesh.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SolidVolume {
    /// What the surface encloses; negative if its normals point inward.
    pub surface: f64,
    /// What the facets enclose.
    pub mesh: f64,
}

/// Why a surface is not what was asked for.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "reason", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum SolidReason {
    /// Too much of the area of the mesh, or of the surface, is beyond the tolerance.
    NotWithin {
        /// "mesh" or "surface".
        of: &'static str,
        /// Share within.
        share: f64,
        /// Share asked for.
        asked: f64,
    },
    /// Somewhere the mesh and the surface are far from each other.
    TooFar {
        /// "mesh" or "surface".
        of: &'static str,
        /// The largest distance from the other.
        distance: f64,
        /// The largest that may be.
        limit: f64,
    },
    /// The surface faces the wrong way somewhere.
    Folded {
        /// Number of faces.
        faces: usize,
        /// Number of places.
        places: usize,
    },
    /// The surface passes through itself.
    CrossesItself {
        /// Where it does so along the greatest length.
        place: [f64; 3],
        /// How far one sheet reaches through the other there.
        depth: f64,
        /// How long the place is.
        extent: f64,
    },
    /// Faces that should meet smoothly are creased.
    Kinked {
        /// The largest angle between neighbouring faces, in degrees.
        angle: f64,
    },
    /// A face has turned over at a smooth arc or at the end of one.
    TurnedOver {
        /// The largest angle between neighbouring faces, in degrees.
        angle: f64,
    },
}

impl fmt::Display for SolidReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotWithin { of, share, asked } => {
                let (share, asked) = (100.0 * share, 100.0 * asked);
                write!(
                    f,
                    "{share:.2} % of the area of the {of} is within the tolerance, {asked} % was asked for; \
                    more elements (--mesh) come nearer"
                )
            }
            Self::TooFar { of, distance, limit } => write!(
                f,
                "the {of} is up to {distance:.4e} away, more than {limit:.4e}, {FAR:.2} tolerances; more elements (--mesh) come nearer"
            ),
            Self::Folded { faces, places } => write!(
                f,
                "{faces} faces fold, at {places} places: the corners of the layout's patches \
                there may be too sharp or too flat"
            ),
            Self::CrossesItself { place: [x, y, z], depth, extent } => write!(
                f,
                "the surface passes through itself near ({x:.6}, {y:.6}, {z:.6}), by {depth:.4e} over a length of {extent:.4e}: \
                a wall of the part may be thinner there than the tolerance, a smaller one (--tol) keeps its sides apart"
            ),
            Self::Kinked { angle } => write!(
                f,
                "neighbouring faces that should meet smoothly meet at up to {angle:.0} degrees, more than {KINK} degrees: a patch of the layout \
                is too narrow there, or the mesh has an edge (--sharp)"
            ),
            Self::TurnedOver { angle } => write!(
                f,
                "neighbouring faces that should meet smoothly meet at up to {angle:.0} degrees: one of them is turned over there; \
                the corners of the layout's patches may be too sharp or too flat"
            ),
        }
    }
}

impl SolidReport {
    /// Whether the surface is what was asked for.
    pub fn is_reached(&self) -> bool {
        self.reasons.is_empty()
    }
}

impl SolidDistances {
    fn of(weighted: Vec<(f64, f64)>, tolerance: f64) -> Self {
        let all: f64 = weighted.iter().map(|(_, weight)| weight).sum();
        let squares: f64 = weighted.iter().map(|(distance, weight)| weight * distance * distance).sum();
        let max = weighted.iter().map(|(distance, _)| *distance).fold(0.0, f64::max);
        let within: f64 =
            weighted.iter().filter(|(distance, _)| *distance <= tolerance).map(|(_, weight)| weight).sum();
        let p99 = percentile(weighted, 0.99);
        Self { rms: (squares / all).sqrt(), p99, max, within: within / all }
    }
}

/// The distance not exceeded on a share of the weight.
fn percentile(mut weighted: Vec<(f64, f64)>, share: f64) -> f64 {
    weighted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = weighted.iter().map(|(_, weight)| weight).sum();
    let mut sum = 0.0;
    for (distance, weight) in &weighted {
        sum += weight;
        if sum >= share * all {
            return *distance;
        }
    }
    weighted.last().map_or(0.0, |(distance, _)| *distance)
}

/// The places where a surface passes through itself and the mesh does not.
fn crossings_of(mesh: &SolidMesh, surface: &Surface, tolerance: f64) -> Result<Crossings, Error> {
    let space = surface.space();
    let maps = (0..space.n_patches()).map(|patch| space.patch_map(patch, surface.coefficients()));
    let maps = maps.collect::<Result<Vec<_>, _>>()?;
    let tessellations = maps.par_iter().map(|map| deviation::tessellate(map, tolerance));
    let tessellations = tessellations.collect::<Result<Vec<_>, _>>()?;
    let patches = maps.iter().zip(&tessellations).map(|(map, tessellation)| TessellatedPatch { map, tessellation });
    let mut crossings = self_crossings(&patches.collect::<Vec<_>>(), 0.0)?;
    crossings.forgive(mesh.curved.vertices(), mesh.curved.triangles(), tolerance);
    Ok(crossings)
}

/// Measures a fit.
///
/// # Errors
/// [`Error`], where the surface cannot be evaluated.
pub(super) fn measured(
    path: &Path,
    mesh: &SolidMesh,
    layout: &QuadLayout,
    sharp: &[bool],
    fitted: &Fitted,
    options: &SolidOptions,
) -> Result<SolidReport, Error> {
    let tolerance = options.tol.resolve(mesh.diagonal);
    let surface = &fitted.surface;
    let samples = fitted.samples.as_slice().iter().zip(&fitted.distances);
    let of_area = samples.filter(|(sample, _)| sample.arc.is_none());
    let mesh_to_surface =
        SolidDistances::of(of_area.map(|(sample, &distance)| (distance, sample.weight)).collect(), tolerance);
    let surface_to_mesh = SolidDistances::of(distances_to(mesh, surface), tolerance);
    let folded = folds(surface, |point, normal| mesh.outward(point, normal));
    let folded_places = folded.iter().map(|(_, places)| places).sum();
    let volume =
        layout.topology().is_closed().then(|| SolidVolume { surface: integrals(surface).volume, mesh: mesh.volume() });
    let mut reasons = Vec::new();
    for (of, distances) in [("mesh", &mesh_to_surface), ("surface", &surface_to_mesh)] {
        if distances.within < options.within {
            reasons.push(SolidReason::NotWithin { of, share: distances.within, asked: options.within });
        }
        if distances.max > FAR * tolerance {
            reasons.push(SolidReason::TooFar { of, distance: distances.max, limit: FAR * tolerance });
        }
    }
    if !folded.is_empty() {
        reasons.push(SolidReason::Folded { faces: folded.len(), places: folded_places });
    }
    let crossings = crossings_of(mesh, surface, tolerance)?;
    if let Some(&Crossing { place, depth, extent, .. }) = crossings.places.first() {
        reasons.push(SolidReason::CrossesItself { place, depth, extent });
    }
    let angles = angles(surface, sharp);
    if angles.max >= TURNED_OVER {
        reasons.push(SolidReason::TurnedOver { angle: angles.max });
    } else if angles.max >= KINK {
        reasons.push(SolidReason::Kinked { angle: angles.max });
    }
    Ok(SolidReport {
        schema: 1,
        input: path.to_owned(),
        triangles: mesh.curved.triangles().len(),
        diagonal: mesh.diagonal,
        layout: layout_report(layout, sharp),
        functions: surface.space().n_functions(),
        samples: fitted.samples.len(),
        tolerance,
        mesh_to_surface,
        surface_to_mesh,
        angles,
        folded_faces: folded.into_iter().map(|(patch, _)| patch).collect(),
        folded_places,
        crossings: crossings.for_report(),
        volume,
        steps: fitted.steps.clone(),
        reasons,
        seconds: 0.0,
        options: options.clone(),
    })
}

fn layout_report(layout: &QuadLayout, sharp: &[bool]) -> SolidLayoutReport {
    let topology = layout.topology();
    let mut valences = BTreeMap::new();
    topology.valences().into_iter().for_each(|valence| *valences.entry(valence).or_insert(0) += 1);
    SolidLayoutReport {
        faces: topology.patches().len(),
        arcs: topology.arcs().len(),
        sharp_arcs: sharp.iter().filter(|sharp| **sharp).count(),
        vertices: topology.n_vertices(),
        valences,
        genus: topology.is_closed().then(|| (2 - topology.euler_number()) / 2),
        mapped_anew: layout.mapped_anew().to_vec(),
    }
}

/// Distances from places in the middles of parts of each cell to the mesh, with the areas around them.
fn distances_to(mesh: &SolidMesh, surface: &Surface) -> Vec<(f64, f64)> {
    let bezier = surface.bezier();
    let of_cell = |cell: usize| {
        let (lower, upper) = bezier.cell_box(cell);
        let place = |k: usize| {
            let step = [k % PLACES, k / PLACES].map(|i| (i as f64 + 0.5) / PLACES as f64);
            let u: [f64; 2] = std::array::from_fn(|d| lower[d] + step[d] * (upper[d] - lower[d]));
            let jet = bezier.jet(cell, u);
            let size = (upper[0] - lower[0]) * (upper[1] - lower[1]) / (PLACES * PLACES) as f64;
            let distance = mesh.distance(jet.value);
            (distance, size * norm(cross(jet.first[0], jet.first[1])))
        };
        (0..PLACES * PLACES).map(place).collect::<Vec<_>>()
    };
    (0..surface.space().n_cells()).into_par_iter().flat_map_iter(of_cell).collect()
}
