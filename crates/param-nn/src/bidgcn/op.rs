//! The network and its loss as operations of candle's automatic differentiation.

use std::sync::{Arc, Mutex, PoisonError};

use candle_core::{CpuStorage, CustomOp1, Error, Result, Shape, Tensor, WithDType};

use super::layout::Layout;
use super::network::{Input, Tape, backward, forward};
use crate::bezier::BezierFit;
use crate::real::Real;

/// From the vector of all weights to the logits of the interior parameters, shape `(n, 2)`. One operation: its forward
/// and its backward pass are the closed forms of the kernels.
pub(crate) struct Network<T> {
    pub(crate) layout: Arc<Layout>,
    pub(crate) input: Arc<Input<T>>,
    tape: Mutex<Option<Tape<T>>>,
}

impl<T: Real> Network<T> {
    pub(crate) fn new(layout: Arc<Layout>, input: Arc<Input<T>>) -> Self {
        Self { layout, input, tape: Mutex::new(None) }
    }
}

fn contiguous<'a, T: Real + WithDType>(storage: &'a CpuStorage, layout: &candle_core::Layout) -> Result<&'a [T]> {
    let (start, end) = layout.contiguous_offsets().ok_or_else(|| Error::msg("the argument is not contiguous"))?;
    Ok(&storage.as_slice::<T>()?[start..end])
}

impl<T: Real + WithDType> CustomOp1 for Network<T> {
    fn name(&self) -> &'static str {
        "bidgcn"
    }

    fn cpu_fwd(&self, storage: &CpuStorage, layout: &candle_core::Layout) -> Result<(CpuStorage, Shape)> {
        let (logits, tape) = forward(&self.layout, contiguous(storage, layout)?, &self.input, None);
        *self.tape.lock().unwrap_or_else(PoisonError::into_inner) = Some(tape);
        Ok((T::to_cpu_storage_owned(logits), (self.input.len(), 2).into()))
    }

    fn bwd(&self, theta: &Tensor, _logits: &Tensor, gradient: &Tensor) -> Result<Option<Tensor>> {
        let tape = self.tape.lock().unwrap_or_else(PoisonError::into_inner);
        let tape = tape.as_ref().ok_or_else(|| Error::msg("backward before forward"))?;
        let weights = theta.to_vec1::<T>()?;
        let given = gradient.flatten_all()?.to_vec1::<T>()?;
        let gradient = backward(&self.layout, &weights, &self.input, tape, &given);
        Ok(Some(Tensor::from_vec(gradient, theta.shape(), theta.device())?))
    }
}

/// From the interior parameters, shape `(n, 2)`, to the mean squared error of the Bézier patch of least squares through all
/// points at all parameters (Imperatore 2024, (4.15)); in double precision inside.
pub(crate) struct PatchError {
    /// Interior points, then those of the boundary.
    pub(crate) xyz: Arc<Vec<[f64; 3]>>,
    pub(crate) boundary_uv: Arc<Vec<[f64; 2]>>,
    pub(crate) degree: usize,
    gradient: Mutex<Vec<[f64; 2]>>,
}

impl PatchError {
    pub(crate) fn new(xyz: Arc<Vec<[f64; 3]>>, boundary_uv: Arc<Vec<[f64; 2]>>, degree: usize) -> Self {
        Self { xyz, boundary_uv, degree, gradient: Mutex::new(Vec::new()) }
    }
}

impl CustomOp1 for PatchError {
    fn name(&self) -> &'static str {
        "patch-error"
    }

    fn cpu_fwd(&self, storage: &CpuStorage, layout: &candle_core::Layout) -> Result<(CpuStorage, Shape)> {
        let pairs = |x: Vec<f64>| -> Vec<[f64; 2]> { x.as_chunks().0.to_vec() };
        let single = matches!(storage, CpuStorage::F32(_));
        let mut uv = pairs(match single {
            true => contiguous::<f32>(storage, layout)?.iter().map(|&x| f64::from(x)).collect(),
            false => contiguous::<f64>(storage, layout)?.to_vec(),
        });
        let interior = uv.len();
        uv.extend_from_slice(&self.boundary_uv);
        let fit = BezierFit::solve(&uv, &self.xyz, self.degree);
        let mut gradient = fit.gradient(&uv, &self.xyz);
        gradient.truncate(interior);
        *self.gradient.lock().unwrap_or_else(PoisonError::into_inner) = gradient;
        let storage = if single { CpuStorage::F32(vec![fit.mse as f32]) } else { CpuStorage::F64(vec![fit.mse]) };
        Ok((storage, Shape::from(())))
    }

    fn bwd(&self, uv: &Tensor, _error: &Tensor, factor: &Tensor) -> Result<Option<Tensor>> {
        let gradient: Vec<f64> =
            self.gradient.lock().unwrap_or_else(PoisonError::into_inner).iter().flatten().copied().collect();
        let gradient = Tensor::from_vec(gradient, uv.shape(), uv.device())?.to_dtype(uv.dtype())?;
        Ok(Some(gradient.broadcast_mul(factor)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bidgcn::cloud::Cloud;
    use crate::bidgcn::layout::Variant;
    use crate::graph::Neighbours;
    use crate::synthetic::{ControlPoints, ScatteredSpec, stream};
    use candle_core::{Device, Var};

    /// The whole chain in double precision: weights, logits, parameters, error.
    #[test]
    fn the_gradient_of_the_loss_agrees_with_a_difference() {
        let spec = ScatteredSpec { control_points: ControlPoints::Greville, degree: 2, interior: 40, noise: 0.0 };
        let sample = spec.sample(&mut stream(3, 0)).unwrap();
        let cloud = Cloud::of_sample(&sample);
        let layout = Arc::new(Layout::new(Variant::Bidgcn));
        let input = Arc::new(cloud.input::<f64>(true, Neighbours::default()));
        let theta: Vec<f64> = crate::train::initial_weights(layout.slots(), 1).into_iter().map(f64::from).collect();
        let graphs = forward(&layout, &theta, &input, None).1.graphs;
        let loss = |theta: &Tensor| {
            let logits = theta.apply_op1(Network::new(layout.clone(), input.clone())).unwrap();
            let uv = candle_nn::ops::sigmoid(&logits).unwrap();
            let error = PatchError::new(Arc::new(cloud.xyz.clone()), Arc::new(cloud.boundary_uv().to_vec()), 2);
            uv.apply_op1(error).unwrap()
        };
        let var = Var::from_vec(theta.clone(), layout.len(), &Device::Cpu).unwrap();
        let gradients = loss(var.as_tensor()).backward().unwrap();
        let gradient = gradients.get(&var).unwrap().to_vec1::<f64>().unwrap();
        let norm = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        // Along the gradient, with a step that changes no graph.
        let moved = |h: f64| -> Vec<f64> { theta.iter().zip(&gradient).map(|(t, g)| t + h * g / norm).collect() };
        let h = 1e-6;
        for side in [-h, h] {
            assert_eq!(forward(&layout, &moved(side), &input, None).1.graphs, graphs);
        }
        let at = |h: f64| {
            let theta = Tensor::from_vec(moved(h), layout.len(), &Device::Cpu).unwrap();
            loss(&theta).to_scalar::<f64>().unwrap()
        };
        let difference = (at(h) - at(-h)) / (2.0 * h);
        assert!((difference / norm - 1.0).abs() < 1e-5, "{difference} against {norm}");
    }
}
