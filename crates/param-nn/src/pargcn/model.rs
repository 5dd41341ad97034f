//! Trained networks: files, and the parameters they give.

use std::collections::BTreeMap;
use std::sync::Arc;

use ndarray::{Array2, ArrayView2};
use param_classic::{BoundaryParameters, correct_shape};

use super::edges::EdgeGraph;
use super::layout::{FEATURES, Layout, PargcnForm};
use super::network::forward;
use super::prior;
use super::solve::{softmax, solve};
use crate::archive::Archive;
use crate::bidgcn::cloud::Cloud;
use crate::error::NnError;
use crate::real::Real;

/// Version of the weights' format; others are refused.
const VERSION: &str = "1";

/// Radius of the published neighbourhoods in the unit cube, for clouds of 264 points (Imperatore 2024, §4.2.6).
const RADIUS: f64 = 0.2;

/// Points of those clouds.
const POINTS: f64 = 264.0;

/// Trained by the command in its notes.
const EMBEDDED: &[u8] = include_bytes!("../../weights/pargcn.safetensors");

/// How a cloud is mapped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PargcnOptions {
    /// Radius of the neighbourhoods, in the unit cube; by default 0.2 for 264 points, as published, and smaller with the
    /// root of the number of points. It grows where points would have no path to the boundary.
    pub radius: Option<f64>,
    /// Most neighbours of a point, the nearest ones; at least 3.
    pub neighbours: usize,
    /// Whether points have that many neighbours however far these are. The radius is then only the unit in which the guided
    /// form measures ways.
    pub nearest: bool,
    /// Whether the map is corrected (Imperatore 2024, §4.2.5): see [`correct_shape`].
    pub correction: bool,
}

impl Default for PargcnOptions {
    /// 32 neighbours as in training, without a correction.
    fn default() -> Self {
        Self { radius: None, neighbours: 32, nearest: false, correction: false }
    }
}

/// A network that gives the weights of a barycentric map of scattered clouds (Imperatore 2024, §4.2).
#[derive(Clone, Debug)]
pub struct Pargcn {
    pub(crate) layout: Arc<Layout>,
    pub(crate) form: PargcnForm,
    pub(crate) theta: Vec<f32>,
    pub(crate) notes: BTreeMap<String, String>,
}

/// What the network is given.
#[derive(Clone, Debug)]
pub(crate) struct Input<T> {
    pub(crate) graph: EdgeGraph,
    /// [`FEATURES`] numbers an edge.
    pub(crate) features: Vec<T>,
    /// What the logits are added to; empty in the published form.
    pub(crate) prior: Vec<f64>,
    /// Factor of the logits. Weights that lean to one side by δ shift parameters like a drift of δ times the radius, against a
    /// diffusion of the radius squared: for the same map, denser clouds must lean less, in proportion to the radius.
    pub(crate) gain: f64,
}

impl<T: Real> Input<T> {
    pub(crate) fn new(cloud: &Cloud, form: PargcnForm, options: &PargcnOptions) -> Result<Self, NnError> {
        let guided = form == PargcnForm::Guided;
        let points = cloud.scaled(guided);
        let radius = options.radius.unwrap_or(RADIUS * (POINTS / points.len() as f64).sqrt());
        let graph = match options.nearest {
            false => EdgeGraph::new(&points, cloud.interior, radius, options.neighbours)?,
            true => EdgeGraph::nearest(&points, cloud.interior, radius, options.neighbours)?,
        };
        let unit = if guided { RADIUS / graph.radius } else { 1.0 };
        let mut features = Vec::with_capacity(FEATURES * graph.edges());
        for (i, p) in points[..cloud.interior].iter().enumerate() {
            for &j in graph.leaving.of(i) {
                let way = points[j as usize];
                features.extend(p.map(T::from_f64));
                features.extend((0..3).map(|k| T::from_f64(unit * (p[k] - way[k]))));
            }
        }
        let prior = if guided { prior::logits(&graph, &points) } else { Vec::new() };
        let gain = if guided { (graph.radius / RADIUS).min(1.0) } else { 1.0 };
        Ok(Self { graph, features, prior, gain })
    }

    /// Weights of the edges from the logits of the network.
    pub(crate) fn weights(&self, logits: &[T]) -> Vec<f64> {
        let mut logits: Vec<f64> = logits.iter().map(|x| self.gain * x.to_f64()).collect();
        logits.iter_mut().zip(&self.prior).for_each(|(l, p)| *l += p);
        softmax(&self.graph, &logits)
    }
}

impl Pargcn {
    /// The network that comes with this crate.
    ///
    /// # Errors
    /// As [`Pargcn::load`]; none if the crate was built from an undamaged file.
    pub fn embedded() -> Result<Self, NnError> {
        Self::load(EMBEDDED)
    }

    /// A network from the bytes of a weights file.
    ///
    /// # Errors
    /// [`NnError::DamagedWeights`], [`NnError::OtherWeights`].
    pub fn load(bytes: &[u8]) -> Result<Self, NnError> {
        Self::of_archive(Archive::from_bytes(bytes)?)
    }

    pub(crate) fn of_archive(mut archive: Archive) -> Result<Self, NnError> {
        let mut take = |name: &'static str| archive.metadata.remove(name).unwrap_or_default();
        let (version, architecture, form) = (take("version"), take("architecture"), take("form"));
        let other = |what, found: String, required: &'static str| Err(NnError::OtherWeights { what, found, required });
        if version != VERSION {
            return other("format version", version, VERSION);
        }
        if architecture != "pargcn" {
            return other("architecture", architecture, "pargcn");
        }
        let Some(form) = [PargcnForm::Published, PargcnForm::Guided].into_iter().find(|f| f.name() == form) else {
            return other("form", form, "published or guided");
        };
        let layout = Layout::new();
        let theta = layout.slots.take(&mut archive)?;
        Ok(Self { layout: Arc::new(layout), form, theta, notes: archive.metadata })
    }

    /// The bytes of a weights file: safetensors, with the form, a checksum and the notes as metadata.
    pub fn to_bytes(&self) -> Vec<u8> {
        self.to_archive().to_bytes()
    }

    pub(crate) fn to_archive(&self) -> Archive {
        let mut metadata = self.notes.clone();
        for (name, value) in [("version", VERSION), ("architecture", "pargcn"), ("form", self.form.name())] {
            metadata.insert(name.into(), value.into());
        }
        let mut archive = Archive { metadata, ..Archive::default() };
        self.layout.slots.put(&self.theta, &mut archive);
        archive
    }

    /// The form.
    pub fn form(&self) -> PargcnForm {
        self.form
    }

    /// Number of trained weights.
    pub fn weights(&self) -> usize {
        self.theta.len()
    }

    /// What the file says about its making: command, seed, steps.
    pub fn notes(&self) -> &BTreeMap<String, String> {
        &self.notes
    }

    /// Parameters of a cloud `points`, shape `(m, 3)`, in any units: shape `(m, 2)`, in the unit square. The points in the
    /// rows `boundary` have the parameters `boundary_parameters`, shape `(boundary.len(), 2)`, on the boundary of the
    /// square, and keep them; every other point is the mean of its neighbours with positive weights.
    ///
    /// That the map has no folds is not guaranteed. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// Clouds that are no surface; [`NnError::WrongShape`]; [`NnError::BadBoundaryPoint`]; [`NnError::BadOption`];
    /// [`NnError::Classical`] where points cannot be tied to the boundary, or the linear system or the correction fails;
    /// [`NnError::NotFinite`] where the network breaks down.
    pub fn predict(
        &self,
        points: ArrayView2<'_, f64>,
        boundary: &[u32],
        boundary_parameters: ArrayView2<'_, f64>,
        options: &PargcnOptions,
    ) -> Result<Array2<f64>, NnError> {
        let span = tracing::info_span!("pargcn", points = points.nrows());
        let _guard = span.enter();
        if options.neighbours < 3 {
            let value = options.neighbours as f64;
            return Err(NnError::BadOption { name: "neighbours", value, range: "at least 3" });
        }
        if let Some(radius) = options.radius.filter(|radius| !(*radius > 0.0 && radius.is_finite())) {
            return Err(NnError::BadOption { name: "radius", value: radius, range: "positive and finite" });
        }
        let cloud = Cloud::new(points, boundary, boundary_parameters)?;
        if cloud.interior == 0 {
            return Ok(cloud.scattered(&[]));
        }
        let uv = cloud.scattered(&self.interior_parameters(&cloud, options)?);
        if !options.correction {
            return Ok(uv);
        }
        let fixed = BoundaryParameters { points: boundary.to_vec(), parameters: boundary_parameters.to_owned() };
        Ok(correct_shape(points, &fixed, uv.view())?.parameters)
    }

    pub(crate) fn interior_parameters(&self, cloud: &Cloud, options: &PargcnOptions) -> Result<Vec<[f64; 2]>, NnError> {
        let mut input = Input::<f32>::new(cloud, self.form, options)?;
        let features = std::mem::take(&mut input.features);
        let (logits, _) = forward(&self.layout, &self.theta, &input.graph, features, false);
        if let Some(edge) = logits.iter().position(|x| !x.is_finite()) {
            let tail = input.graph.tail(edge);
            return Err(NnError::NotFinite { row: cloud.rows[tail] });
        }
        let weights = input.weights(&logits);
        let (mut uv, _) = solve(&input.graph, &weights, cloud.boundary_uv(), |_| Vec::new())?;
        uv.truncate(cloud.interior);
        Ok(uv)
    }
}

#[cfg(test)]
#[path = "model_tests.rs"]
mod tests;
