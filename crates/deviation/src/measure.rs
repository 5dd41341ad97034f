//! A surface against a scan.

use ndarray::ArrayView2;
use point_cloud::vec3::{add, cross, diagonal, dot, norm, scale, sub};
use rayon::prelude::*;
use serde::Serialize;
use thb_core::SplineMap;

use crate::gathered::Node;
use crate::parts::{Judged, Piece, farthest, for_each_part, for_each_place, pieces, radius, worth_cutting};
use crate::scan::{Cloud, Kind, Mesh};
use crate::search::{Foot, SurfaceSearch};
use crate::{
    Crossings, Distances, Error, Gathered, Scan, TessellatedPatch, Tessellation, Thresholds, curvature_radii,
    self_crossings,
};

/// Widening of the band between facet and curved triangle: the curved one is no exact surface either.
///
/// Derived: the definition of what counts (docs, "What counts").
const BAND_WIDTH: f64 = 1.15;

/// Width of the band in tolerances, at most.
///
/// Derived: the definition of what counts (docs, "What counts").
const WIDEST_BAND: f64 = 2.0;

/// A sagitta of a smaller share of the tolerance is none: one search instead of two.
///
/// Limit: shares change by less than the accuracy that is promised for them.
const NEGLIGIBLE_SAGITTA: f64 = 0.02;

/// A place is between facet and curved triangle where its distances to both add up to theirs, up to this share.
///
/// Derived: the definition of what counts (docs, "What counts").
const BETWEEN: f64 = 0.1;

/// Chord error of the triangles that a surface is measured on, in tolerances. Distances of the scan to the surface are exact all the
/// same: the triangles are only where Newton's method begins.
///
/// Derived: a twentieth of the tolerance changes a share of the area by a few 10⁻³ at most.
const CHORD: f64 = 0.05;

/// Chord error in diagonals of the surface's box that is asked at least, however small the tolerance.
///
/// Limit: the number of triangles.
const FINEST_CHORD: f64 = 2e-6;

/// Vertices of the triangles that a surface is measured on, at most.
///
/// Limit: time and memory.
const MAX_VERTICES: usize = 400_000;

/// Reach of the middle of a triangle's part, in edges of an equilateral triangle of its area: parts that touch have middles within the
/// sum of their reaches.
///
/// Derived: the definition of gathered misses (docs, "What counts").
const REACH: f64 = 0.8;

/// Edge of an equilateral triangle of area 1.
const EDGE_OF_AREA: f64 = 1.519_671_371_303_185;

/// Distance in tolerances up to which the point of the surface near a parameter is taken for the nearest one without looking further.
///
/// Derived: larger distances are then those to the nearest point, and so is the largest one, if it is at least that.
pub(crate) const NEAR_ENOUGH: f64 = 0.5;

/// Points of a cloud whose nearest points are looked for again, at most, for the largest distance.
///
/// Limit: time.
const MOST_SEARCHED_AGAIN: usize = 10_000;

/// Points of a cloud that may be looked at in the time in which the nearest one is found.
///
/// Limit: time, where very many points are within reach, as of heights in metres over degrees.
const POINTS_OF_PLACE: usize = 50;

/// Change of a distance along a surface, per length, that is always allowed for in search of the largest: a place from which the distance
/// does not change at first may lie beside a higher one.
///
/// Limit: the places that are searched.
const LEAST_SLOPE: f64 = 0.05;

/// Reach of a point of a cloud in spacings, half of the distance up to which points are joined.
///
/// Derived: the definition of gathered misses (docs, "What counts").
const REACH_OF_POINT: f64 = 1.5;

/// Parts of the surface's area that are measured at least.
///
/// Derived: shares then change by less than 0.003 (two standard deviations of 10⁴ independent samples are 0.01 at worst, those of a
/// grid far less).
const SURFACE_PARTS: f64 = 1e4;

/// Distance beyond the nearest facet, in tolerances, up to which facets are asked for their normals before the surface counts as
/// folded.
///
/// Derived: at a sharp edge the surface may cut the corner by the tolerance, and the nearest facet then is the other face's.
const ASKED_AROUND: f64 = 1.0;

/// How well a surface lies on a scan. Lengths are in the units of the scan.
#[derive(Clone, Debug, Serialize)]
pub struct Deviation {
    /// What the scan consists of: `mesh` or `cloud`.
    pub scan: &'static str,
    /// The tolerance of all shares.
    pub tolerance: f64,
    /// From the scan to the surface: its area, each triangle known up to its sagitta; of a cloud its points, weighed by the square of
    /// their spacing, and beyond the rim of the surface only across it.
    pub scan_to_surface: Distances,
    /// From the surface's area inside the scan's outline and not over its holes to the scan, each triangle known up to its sagitta; from
    /// all of its area to the points of a cloud, less their spacing there.
    pub surface_to_scan: Distances,
    /// As `scan_to_surface` for the flat facets of a mesh; `null` for a cloud.
    pub facets_to_surface: Option<Distances>,
    /// As `surface_to_scan` for the flat facets of a mesh; `null` for a cloud.
    pub surface_to_facets: Option<Distances>,
    /// Height of the curved triangles over the facets, 95th percentile by area; `null` for a cloud.
    pub sagitta_p95: Option<f64>,
    /// Mean signed distance of the scan, positive on the side of the scan's normals; `null` for a cloud.
    pub signed_mean: Option<f64>,
    /// Angle in degrees between normals of the scan and of the surface; `null` for a cloud.
    pub normal_angles: Option<Distances>,
    /// Patches of the scan beyond the tolerance.
    pub gathered: Gathered,
    /// Share of the scan that lies beyond the rim of the surface by more than the tolerance and the spacing there.
    pub beyond_rim: f64,
    /// Share of the surface's area beyond the outline of the scan or over its holes.
    pub beyond_outline: f64,
    /// Diagonal of the surface's box, in diagonals of the scan's.
    pub box_ratio: f64,
    /// Largest distance of any place of the surface to the scan, beyond its outline and over its holes too; to the points of a cloud
    /// less their spacing there.
    pub farthest: f64,
    /// Area of the surface.
    pub area: f64,
    /// Share of the surface's area whose normal is more than a right angle from those of the scan around it; `null` for a cloud
    /// over which no triangles were spanned.
    pub folded: Option<f64>,
    /// Places where the surface passes through itself.
    pub crossings: Crossings,
    /// How tightly the surface bends: how far it can be offset to either side before it folds.
    pub bend: Bend,
}

/// The smallest radii of curvature of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bend {
    /// The smallest one; `null` for a plane.
    pub smallest_radius: f64,
    /// Where that is.
    pub place: [f64; 3],
    /// One hundredth of the area has smaller ones; `null` for a plane.
    pub percentile_radius: f64,
}

impl Deviation {
    /// Adds `by` to all places, where surface and scan were measured elsewhere than they lie.
    pub fn moved(mut self, by: [f64; 3]) -> Self {
        let optional = [&mut self.facets_to_surface, &mut self.surface_to_facets, &mut self.normal_angles];
        let distances = optional.into_iter().flatten().chain([&mut self.scan_to_surface, &mut self.surface_to_scan]);
        let places = distances
            .map(|distances| &mut distances.place)
            .chain(self.gathered.patches.iter_mut().map(|patch| &mut patch.place))
            .chain(self.crossings.places.iter_mut().map(|crossing| &mut crossing.place))
            .chain([&mut self.bend.place]);
        places.for_each(|place| *place = add(*place, by));
        self
    }
}

/// A place of the scan beyond the tolerance, and where the surface is nearest to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Miss {
    /// The place on the scan.
    pub place: [f64; 3],
    /// Its distance to the surface.
    pub distance: f64,
    /// The cell that the nearest point of the surface lies in.
    pub cell: usize,
    /// The parameter of that point.
    pub parameter: [f64; 2],
    /// Share of the scan's area of the patch of misses that this one belongs to; 0 of one that is alone.
    pub gathered: f64,
}

/// The scan against a surface: one direction of a [`Deviation`].
#[derive(Clone, Debug)]
pub struct ScanSide {
    /// Distances with the band of the sagitta.
    pub distances: Distances,
    /// Distances of flat facets.
    pub facets: Option<Distances>,
    /// Mean signed distance.
    pub signed_mean: Option<f64>,
    /// Angles between normals.
    pub normal_angles: Option<Distances>,
    /// Patches beyond the tolerance.
    pub gathered: Gathered,
    /// Share beyond the rim of the surface.
    pub beyond_rim: f64,
    /// All places beyond the tolerance.
    pub misses: Vec<Miss>,
}

/// A surface that is being measured: its triangles, and searches among them.
pub struct Measured<'a> {
    map: &'a SplineMap<2>,
    tessellation: &'a Tessellation,
    pub(crate) search: SurfaceSearch<'a>,
}

/// The triangles that a surface is measured on at a tolerance.
///
/// # Errors
/// [`Error`]; the surface has to lie in space.
pub fn tessellate(map: &SplineMap<2>, tolerance: f64) -> Result<Tessellation, Error> {
    let rows: Vec<[f64; 3]> = map.coefficients().outer_iter().map(|row| std::array::from_fn(|k| row[k])).collect();
    let chord = (CHORD * tolerance).max(FINEST_CHORD * diagonal(&rows));
    Tessellation::new(map, chord, MAX_VERTICES)
}

/// Measures a surface against a scan. `parameters`, one row for each point of the scan, are where searches begin; without them the whole
/// surface is searched for every place.
///
/// # Errors
/// [`Error`].
pub fn measure(
    map: &SplineMap<2>,
    scan: &Scan<'_>,
    parameters: Option<ArrayView2<'_, f64>>,
    tolerance: f64,
    thresholds: &Thresholds,
) -> Result<Deviation, Error> {
    let tessellation = tessellate(map, tolerance)?;
    Measured::new(map, &tessellation)?.against(scan, parameters, tolerance, thresholds)
}

impl<'a> Measured<'a> {
    /// Prepares a surface and its triangles.
    ///
    /// # Errors
    /// [`Error::NoArea`].
    pub fn new(map: &'a SplineMap<2>, tessellation: &'a Tessellation) -> Result<Self, Error> {
        Ok(Self { map, tessellation, search: SurfaceSearch::new(map, tessellation)? })
    }

    /// All measures. Where the scan passes through itself the surface may.
    ///
    /// # Errors
    /// [`Error::Space`].
    pub fn against(
        &self,
        scan: &Scan<'_>,
        parameters: Option<ArrayView2<'_, f64>>,
        tolerance: f64,
        thresholds: &Thresholds,
    ) -> Result<Deviation, Error> {
        let from_scan = self.scan_side_with(scan, parameters, tolerance, thresholds, Largest::Searched);
        let from_surface = match &scan.kind {
            Kind::Mesh(mesh) => self.surface_to_mesh(mesh, tolerance, Largest::Searched),
            Kind::Cloud(cloud) => {
                let folded_over = |mesh: &Mesh| self.surface_to_mesh(mesh, tolerance, Largest::OfPlaces).folded;
                let folded = cloud.spanned.as_deref().and_then(folded_over);
                SurfaceSide { folded, ..self.surface_to_cloud(scan.points, cloud, tolerance) }
            }
        };
        let crossings = self.crossings(scan, tolerance)?.for_report();
        let radii = curvature_radii(self.map, self.tessellation)?;
        Ok(Deviation {
            crossings,
            bend: Bend { smallest_radius: radii.smallest, place: radii.place, percentile_radius: radii.percentile },
            scan: if scan.is_mesh() { "mesh" } else { "cloud" },
            tolerance,
            scan_to_surface: from_scan.distances,
            surface_to_scan: from_surface.distances,
            facets_to_surface: from_scan.facets,
            surface_to_facets: from_surface.facets,
            sagitta_p95: scan.sagitta_p95(),
            signed_mean: from_scan.signed_mean,
            normal_angles: from_scan.normal_angles,
            gathered: from_scan.gathered,
            beyond_rim: from_scan.beyond_rim,
            beyond_outline: from_surface.beyond_outline,
            box_ratio: diagonal(&self.tessellation.vertices) / scan.diagonal(),
            farthest: from_surface.farthest,
            area: from_surface.area,
            folded: from_surface.folded,
        })
    }

    /// The places where the surface passes through itself and the scan does not, the largest first.
    ///
    /// # Errors
    /// [`Error::Space`].
    pub fn crossings(&self, scan: &Scan<'_>, tolerance: f64) -> Result<Crossings, Error> {
        let Self { map, tessellation, .. } = *self;
        let mut crossings = self_crossings(&[TessellatedPatch { map, tessellation }], 0.0)?;
        crossings.forgive(scan.points, scan.sheet(), tolerance);
        Ok(crossings)
    }

    /// The measures from the scan to the surface alone. The largest distance is that of the places that are measured anyway, which is
    /// quicker to find than the one of all places.
    pub fn scan_side(
        &self,
        scan: &Scan<'_>,
        parameters: Option<ArrayView2<'_, f64>>,
        tolerance: f64,
        thresholds: &Thresholds,
    ) -> ScanSide {
        self.scan_side_with(scan, parameters, tolerance, thresholds, Largest::OfPlaces)
    }

    fn scan_side_with(
        &self,
        scan: &Scan<'_>,
        parameters: Option<ArrayView2<'_, f64>>,
        tolerance: f64,
        thresholds: &Thresholds,
        largest: Largest,
    ) -> ScanSide {
        let parameter = |i: u32| parameters.map(|p| [p[[i as usize, 0]], p[[i as usize, 1]]]);
        match &scan.kind {
            Kind::Mesh(mesh) => self.mesh_to_surface(mesh, &parameter, tolerance, thresholds, largest),
            Kind::Cloud(cloud) => self.cloud_to_surface(scan.points, cloud, &parameter, tolerance, thresholds, largest),
        }
    }

    fn mesh_to_surface(
        &self,
        mesh: &Mesh,
        parameter: &(dyn Fn(u32) -> Option<[f64; 2]> + Sync),
        tolerance: f64,
        thresholds: &Thresholds,
        largest: Largest,
    ) -> ScanSide {
        let periods = self.search.periods();
        let judged = |t: usize, w: [f64; 3], area: f64, reach: f64| {
            let place = mesh.curved.on_facet(t, w);
            let start = interpolate(mesh.curved.triangles()[t].map(parameter), w, periods);
            let foot = self.search.nearest(place, start, NEAR_ENOUGH * tolerance);
            let facet = mesh.curved.facet_normal(t);
            let sagitta = mesh.curved.sagitta(t, w);
            let band = BAND_WIDTH * sagitta.clamp(-WIDEST_BAND * tolerance, WIDEST_BAND * tolerance);
            let mut distance = foot.distance;
            let mut most = foot.distance + reach * steepest(way_to(&foot), facet);
            if band.abs() > NEGLIGIBLE_SAGITTA * tolerance {
                let curved = add(place, scale(band, facet));
                let other = self.search.nearest(curved, start, NEAR_ENOUGH * tolerance);
                let is_between = (foot.distance + other.distance - band.abs()).abs() < BETWEEN * band.abs();
                distance = if is_between { 0.0 } else { foot.distance.min(other.distance) };
                let bend = BAND_WIDTH * mesh.curved.change_of_sagitta(t, w, reach);
                most = most.min(other.distance + reach * steepest(way_to(&other), facet) + bend);
            }
            let edge = EDGE_OF_AREA * mesh.curved.areas()[t].sqrt();
            let beyond_rim = foot.on_rim && foot.split().1 > tolerance + edge;
            let signed = foot.distance.copysign(dot(foot.offset, facet));
            let cosine = dot(facet, foot.normal);
            let part = Part::new(place, &foot, distance, area, beyond_rim);
            Part { cosine, signed, triangle: t as u32, most, ..part }
        };
        let of_triangle = |t: usize| {
            let n = mesh.parts_per_side(t);
            let mut parts = Vec::with_capacity(n * n);
            let area = mesh.curved.areas()[t] / (n * n) as f64;
            let reach = radius(mesh.curved.corners(t)) / n as f64;
            for_each_part(n, |w| parts.push(judged(t, w, area, reach)));
            // Along its sides a curved triangle is flat, or as good as flat; places all over the parts give that its share of the area,
            // which the middles never see.
            if mesh.curved.sagitta(t, [1.0 / 3.0; 3]).abs() > NEGLIGIBLE_SAGITTA * tolerance {
                parts.iter_mut().for_each(|part| part.area = 0.0);
                for_each_place(n, t * n * n, |w| parts.push(Part { gathers: 0.0, ..judged(t, w, area, 2.0 * reach) }));
            }
            parts
        };
        let mut parts: Vec<Part> = (0..mesh.curved.areas().len()).into_par_iter().flat_map_iter(of_triangle).collect();
        let reach = |t: usize| radius(mesh.curved.corners(t));
        let known = parts.iter().map(|part| part.distance).fold(0.0, f64::max);
        let worth = worth_cutting(known, tolerance);
        let of_one = |parts: &[Part]| {
            let t = parts[0].triangle;
            // Behind the parts stand places of them, which say no more.
            let judged = |k: usize| Judged::new(parts[k].distance, parts[k].most);
            let is_worth = parts.iter().any(|part| part.most > worth);
            let all = if is_worth { pieces(t, mesh.parts_per_side(t as usize), judged) } else { Vec::new() };
            all.into_iter().filter(|piece| piece.judged.most > worth)
        };
        let open = || parts.chunk_by(|a, b| a.triangle == b.triangle).flat_map(of_one).collect();
        let judge = |t: u32, weights: [f64; 3], reach: f64| {
            let Part { distance, most, .. } = judged(t as usize, weights, 0.0, reach);
            Judged::new(distance, most)
        };
        let highest = match largest {
            Largest::Searched => farthest(open(), known, tolerance, &|t| reach(t as usize), &judge),
            Largest::OfPlaces => None,
        };
        parts.extend(highest.map(|(t, weights)| judged(t as usize, weights, 0.0, 0.0)));
        // Vertices have no area, but may be the farthest places.
        let of_vertex = |&v: &u32| {
            let place = mesh.curved.vertices()[v as usize];
            let foot = self.search.nearest(place, parameter(v), NEAR_ENOUGH * tolerance);
            Part::new(place, &foot, foot.distance, 0.0, false)
        };
        parts.par_extend(mesh.used.par_iter().map(of_vertex));
        let reach = |part: &Part| REACH * EDGE_OF_AREA * part.gathers.sqrt();
        // The surface's normals may all run against the scan's.
        let turned = parts.iter().map(|part| part.area * part.cosine).sum::<f64>() < 0.0;
        let sign = if turned { -1.0 } else { 1.0 };
        let angles = parts.iter().map(|p| ((sign * p.cosine).clamp(-1.0, 1.0).acos().to_degrees(), p.area, p.place));
        let signed = sum(parts.iter().map(|p| p.area * p.signed));
        let found = side(&parts, &reach, tolerance, thresholds);
        // Flat triangles are their own curved ones.
        let is_flat = parts.iter().all(|p| p.distance == p.facet);
        let of_facets = || summary(parts.iter().map(|p| (p.facet, p.area, p.place)), tolerance);
        ScanSide {
            facets: Some(if is_flat { found.distances } else { of_facets() }),
            signed_mean: Some(signed / mesh.area),
            normal_angles: Some(summary(angles, ACROSS_DEGREES)),
            ..found
        }
    }

    fn cloud_to_surface(
        &self,
        points: &[[f64; 3]],
        cloud: &Cloud,
        parameter: &(dyn Fn(u32) -> Option<[f64; 2]> + Sync),
        tolerance: f64,
        thresholds: &Thresholds,
        largest: Largest,
    ) -> ScanSide {
        let judged = |i: usize, enough: f64| {
            let foot = self.search.nearest(points[i], parameter(i as u32), enough);
            let (across, along) = foot.split();
            let distance = if foot.on_rim { across } else { foot.distance };
            let beyond_rim = foot.on_rim && along > tolerance + cloud.spacing[i];
            Part::new(points[i], &foot, distance, cloud.weights[i], beyond_rim)
        };
        let enough = NEAR_ENOUGH * tolerance;
        let mut parts: Vec<Part> = (0..points.len()).into_par_iter().map(|i| judged(i, enough)).collect();
        if largest == Largest::Searched {
            search_largest(&mut parts, enough, &|i| judged(i, 0.0));
        }
        // The weight of a point is the square of its spacing.
        side(&parts, &|part| REACH_OF_POINT * part.gathers.sqrt(), tolerance, thresholds)
    }

    /// Calls `part` with the triangle, the barycentric coordinates of the middle and the area of each part of the surface, and once more,
    /// without area, for the place that is farthest, if that is searched: `judges` tell the distance of what `part` returned and what it
    /// is at most within a reach, the first one of all parts, the second one where the farthest place is looked for.
    fn parts<T: Send + Sync>(
        &self,
        tolerance: f64,
        part: &(dyn Fn(u32, [f64; 3], f64) -> T + Sync),
        judges: [Judge<'_, T>; 2],
        largest: Largest,
    ) -> Vec<T> {
        let corners = |t: usize| self.tessellation.corners(t);
        let area = |t: usize| {
            let [p, q, r] = corners(t);
            0.5 * norm(cross(sub(q, p), sub(r, p)))
        };
        let total: f64 = (0..self.tessellation.triangles.len()).map(area).sum();
        let per_side = |t: usize| ((area(t) * SURFACE_PARTS / total).sqrt().ceil() as usize).clamp(1, 100);
        let of_triangle = |t: usize| {
            let (corners, area) = (corners(t), area(t));
            let n = per_side(t);
            let reach = radius(corners) / n as f64;
            let mut made = Vec::with_capacity(n * n);
            let mut known = f64::NEG_INFINITY;
            for_each_part(n, |weights| {
                let found = part(t as u32, weights, area / (n * n) as f64);
                known = known.max(judges[0](&found, reach).distance);
                made.push(found);
            });
            (made, known)
        };
        let (made, known): (Vec<Vec<T>>, Vec<f64>) =
            (0..self.tessellation.triangles.len()).into_par_iter().map(of_triangle).unzip();
        if largest == Largest::OfPlaces {
            return made.into_iter().flatten().collect();
        }
        let known = known.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let worth = worth_cutting(known, tolerance);
        let open = |(t, of_one): (usize, &Vec<T>)| {
            let n = per_side(t);
            let reach = radius(corners(t)) / n as f64;
            let all = pieces(t as u32, n, |k| judges[0](&of_one[k], reach));
            all.into_iter().filter(|piece| piece.judged.most > worth).collect::<Vec<Piece>>()
        };
        let open: Vec<Vec<Piece>> = made.par_iter().enumerate().map(open).collect();
        let at = |t: u32, weights: [f64; 3]| part(t, weights, 0.0);
        let judge_at = |t: u32, weights: [f64; 3], reach: f64| judges[1](&at(t, weights), reach);
        let highest = farthest(open.concat(), known, tolerance, &|t| radius(corners(t as usize)), &judge_at);
        made.into_iter().flatten().chain(highest.map(|(t, weights)| at(t, weights))).collect()
    }

    fn surface_to_mesh(&self, mesh: &Mesh, tolerance: f64, largest: Largest) -> SurfaceSide {
        struct Found {
            place: [f64; 3],
            facet: f64,
            band: f64,
            area: f64,
            /// How fast the distance changes along the surface at most.
            steepest: f64,
            /// Beyond the outline, how far within the plane of the nearest facet; 0 inside.
            beyond: f64,
            on_rim: bool,
            cosine: f64,
            normal: [f64; 3],
        }
        let part = |triangle: u32, weights: [f64; 3], area: f64| {
            let (place, normal) = self.search.place_and_normal(triangle, weights);
            let foot = mesh.tree.nearest(place);
            let t = foot.triangle as usize;
            let facet = mesh.curved.facet_normal(t);
            let offset = sub(place, mesh.curved.on_facet(t, foot.barycentric));
            let distance = foot.squared_distance.sqrt();
            let signed = distance.copysign(dot(offset, facet));
            let widest = WIDEST_BAND * tolerance;
            let band = BAND_WIDTH * mesh.curved.sagitta(t, foot.barycentric).clamp(-widest, widest);
            let on_rim = mesh.is_on_rim(foot.triangle, foot.barycentric);
            let is_inside_facet = foot.barycentric.iter().all(|&w| w > 0.0);
            let within_plane = (foot.squared_distance - dot(offset, facet).powi(2)).max(0.0).sqrt();
            Found {
                place,
                facet: distance,
                band: (band.min(0.0) - signed).max(signed - band.max(0.0)).max(0.0),
                area,
                steepest: steepest(if is_inside_facet { facet } else { offset }, normal),
                beyond: if on_rim { within_plane } else { 0.0 },
                on_rim,
                cosine: dot(facet, normal),
                normal,
            }
        };
        let none = f64::NEG_INFINITY;
        let judge = |found: &Found, reach: f64| {
            let distance = if found.on_rim { none } else { found.band };
            let most = if found.beyond > reach { none } else { found.band + reach * found.steepest };
            Judged::new(distance, most)
        };
        let found = self.parts(tolerance, &part, [&judge, &judge], largest);
        let area: f64 = found.iter().map(|f| f.area).sum();
        let inside: Vec<&Found> = found.iter().filter(|f| !f.on_rim).collect();
        let inner: f64 = inside.iter().map(|f| f.area).sum();
        let turned = found.iter().map(|f| f.area * f.cosine).sum::<f64>() < 0.0;
        let sign = if turned { -1.0 } else { 1.0 };
        let around = ASKED_AROUND * tolerance;
        let is_folded = |f: &Found| {
            sign * f.cosine < 0.0 && !mesh.has_like_normal(f.place, f.facet + around, scale(sign, f.normal))
        };
        let folded: Vec<f64> = inside.par_iter().map(|f| if is_folded(f) { f.area } else { 0.0 }).collect();
        SurfaceSide {
            distances: summary(inside.iter().map(|f| (f.band, f.area, f.place)), tolerance),
            facets: Some(summary(inside.iter().map(|f| (f.facet, f.area, f.place)), tolerance)),
            farthest: found.iter().map(|f| f.facet).fold(0.0, f64::max),
            beyond_outline: if area > 0.0 { (1.0 - inner / area).max(0.0) } else { 0.0 },
            area,
            folded: (area > 0.0).then(|| sum(folded.into_iter()) / area),
        }
    }

    fn surface_to_cloud(&self, points: &[[f64; 3]], cloud: &Cloud, tolerance: f64) -> SurfaceSide {
        struct Found {
            place: [f64; 3],
            distance: f64,
            nearest: u32,
            counted: f64,
            area: f64,
        }
        let part = |triangle: u32, weights: [f64; 3], area: f64| {
            let (place, _) = self.search.place_and_normal(triangle, weights);
            let (distance, nearest) = cloud.tree.nearest(place);
            let counted = (distance - cloud.spacing[nearest as usize]).max(0.0);
            Found { place, distance, nearest, counted, area }
        };
        // Within the reach another point may be the nearest, whose spacing is smaller: probably a neighbour of the nearest one, certainly
        // one from which the plane half-way to the nearest is within reach.
        let judged = |found: &Found, reach: f64, least_spacing: f64| {
            Judged::new(found.counted, found.distance + reach - least_spacing)
        };
        let probably = |found: &Found, reach: f64| judged(found, reach, cloud.least_spacing[found.nearest as usize]);
        let certainly = |found: &Found, reach: f64| {
            let (mut least, mut visited) = (f64::INFINITY, 0);
            let farthest = (found.distance + 2.0 * reach).next_up();
            let nearest = points[found.nearest as usize];
            cloud.tree.for_each_within(found.place, farthest, |k| {
                visited += 1;
                let other = points[k as usize];
                let offset = sub(other, found.place);
                let behind = dot(offset, offset) - found.distance * found.distance;
                if behind <= 2.0 * reach * norm(sub(other, nearest)) {
                    least = least.min(cloud.spacing[k as usize]);
                }
            });
            Judged { cost: 1 + visited / POINTS_OF_PLACE, ..judged(found, reach, least) }
        };
        let found = self.parts(tolerance, &part, [&probably, &certainly], Largest::Searched);
        let area: f64 = found.iter().map(|f| f.area).sum();
        // Where no point is within two spacings the surface spans a void or reaches beyond the outline.
        let is_beyond = |f: &&Found| f.counted > 0.5 * f.distance && f.counted > tolerance;
        let beyond = sum(found.iter().filter(is_beyond).map(|f| f.area));
        SurfaceSide {
            distances: summary(found.iter().map(|f| (f.counted, f.area, f.place)), tolerance),
            facets: None,
            farthest: found.iter().map(|f| f.counted).fold(0.0, f64::max),
            beyond_outline: if area > 0.0 { beyond / area } else { 0.0 },
            area,
            folded: None,
        }
    }
}

/// Angle in degrees up to which normals count as alike, in the share `within` of the angles between normals.
const ACROSS_DEGREES: f64 = 15.0;

/// A part of a scan with its nearest point on the surface.
struct Part {
    place: [f64; 3],
    /// What counts, and the distance to the nearest point.
    distance: f64,
    facet: f64,
    /// Estimate of the largest distance in a part of a triangle.
    most: f64,
    /// Area of a triangle's part, weight of a cloud's point.
    area: f64,
    /// The same where misses gather: a triangle's parts gather by their middles.
    gathers: f64,
    beyond_rim: bool,
    /// Of the angle between the normals of scan and surface; of a triangle's part only.
    cosine: f64,
    /// The distance to the nearest point, negative behind the surface; of a triangle's part only.
    signed: f64,
    /// The triangle that it is a part of; of a triangle's part only.
    triangle: u32,
    /// Where the nearest point is.
    cell: u32,
    parameter: [f64; 2],
}

impl Part {
    fn new(place: [f64; 3], foot: &Foot, distance: f64, area: f64, beyond_rim: bool) -> Self {
        let (facet, cell, parameter) = (foot.distance, foot.cell as u32, foot.parameter);
        Self {
            place,
            distance,
            facet,
            most: distance,
            area,
            gathers: area,
            beyond_rim,
            cosine: 1.0,
            signed: facet,
            triangle: 0,
            cell,
            parameter,
        }
    }
}

/// Which place is taken for the farthest.
#[derive(Clone, Copy, PartialEq)]
enum Largest {
    /// The one of all places ([`farthest`]).
    Searched,
    /// The one of those that are measured anyway.
    OfPlaces,
}

/// The distance of a place of which more is known, and what it is at most within a reach.
type Judge<'a, T> = &'a (dyn Fn(&T, f64) -> Judged + Sync);

/// The measures from the surface to the scan.
struct SurfaceSide {
    distances: Distances,
    facets: Option<Distances>,
    beyond_outline: f64,
    farthest: f64,
    area: f64,
    folded: Option<f64>,
}

/// How fast the distance to something `offset` away changes along a plane, at most: by the sine of the angle between offset and normal,
/// which is allowed to double nearby.
fn steepest(offset: [f64; 3], normal: [f64; 3]) -> f64 {
    let sine = norm(cross(offset, normal)) / norm(offset).max(f64::MIN_POSITIVE);
    (2.0 * sine + LEAST_SLOPE).min(1.0)
}

/// The direction to a foot: the normal, which is exact where the place all but lies on the surface, unless the foot is on the rim.
fn way_to(foot: &Foot) -> [f64; 3] {
    if foot.on_rim { foot.offset } else { foot.normal }
}

/// Makes the largest distance of a cloud's points that to a nearest point. Those up to `enough` are only bounds: where none is larger,
/// the nearest points of the largest ones are looked for, by `nearest`, until no bound exceeds a distance that is known.
fn search_largest(parts: &mut [Part], enough: f64, nearest: &dyn Fn(usize) -> Part) {
    if parts.iter().any(|part| part.distance > enough) {
        return;
    }
    let mut by_distance: Vec<usize> = (0..parts.len()).collect();
    by_distance.sort_unstable_by(|&a, &b| parts[b].distance.total_cmp(&parts[a].distance).then(a.cmp(&b)));
    let mut known = 0.0_f64;
    for i in by_distance.into_iter().take(MOST_SEARCHED_AGAIN) {
        if parts[i].distance <= known {
            break;
        }
        parts[i] = nearest(i);
        known = known.max(parts[i].distance);
    }
}

fn side(parts: &[Part], reach: &dyn Fn(&Part) -> f64, tolerance: f64, thresholds: &Thresholds) -> ScanSide {
    let total = sum(parts.iter().map(|part| part.area));
    let beyond = sum(parts.iter().filter(|part| part.beyond_rim).map(|part| part.area));
    let missing: Vec<&Part> = parts.iter().filter(|part| part.distance > tolerance && part.gathers > 0.0).collect();
    let nodes: Vec<Node> = missing
        .iter()
        .map(|part| Node { place: part.place, distance: part.distance, weight: part.gathers, reach: reach(part) })
        .collect();
    let (gathered, shares) = Gathered::of(&nodes, total, thresholds.gathered);
    let miss = |(part, share): (&&Part, f64)| Miss {
        place: part.place,
        distance: part.distance,
        cell: part.cell as usize,
        parameter: part.parameter,
        gathered: share,
    };
    ScanSide {
        distances: summary(parts.iter().map(|part| (part.distance, part.area, part.place)), tolerance),
        facets: None,
        signed_mean: None,
        normal_angles: None,
        gathered,
        beyond_rim: if total > 0.0 { beyond / total } else { 0.0 },
        misses: missing.iter().zip(shares).map(miss).collect(),
    }
}

/// The sum of numbers; zero, not −0, of none.
fn sum(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.fold(0.0, |sum, x| sum + x)
}

/// Statistics of distances with their weights and places.
fn summary(found: impl Iterator<Item = (f64, f64, [f64; 3])> + Clone, tolerance: f64) -> Distances {
    let worst = found.clone().max_by(|a, b| a.0.total_cmp(&b.0)).map_or([0.0; 3], |worst| worst.2);
    Distances::of(found.map(|(distance, weight, _)| (distance, weight)).collect(), tolerance, worst)
}

/// The parameter of a point of a triangle; `None` if a corner has none, or if the triangle lies across a seam.
fn interpolate(corners: [Option<[f64; 2]>; 3], w: [f64; 3], periods: [Option<f64>; 2]) -> Option<[f64; 2]> {
    let [Some(a), Some(b), Some(c)] = corners else { return None };
    let crosses = |d: usize| {
        let (low, high) = (a[d].min(b[d]).min(c[d]), a[d].max(b[d]).max(c[d]));
        periods[d].is_some_and(|period| high - low > 0.5 * period)
    };
    let at = |d: usize| w[0] * a[d] + w[1] * b[d] + w[2] * c[d];
    (!crosses(0) && !crosses(1)).then(|| [at(0), at(1)])
}

#[cfg(test)]
mod tests;
