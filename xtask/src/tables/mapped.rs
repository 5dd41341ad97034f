//! Scattered clouds mapped by classical methods and by networks, and what it takes.

use std::time::Instant;

use anyhow::Result;
use ndarray::{Array2, ArrayView2, Axis};
use param_classic::{BoundaryParameters, CloudMapParams, CloudWeights, Radius, map_cloud};
use param_nn::{Bidgcn, Pargcn, PargcnOptions, ScatteredCloud};

/// A way to map a cloud whose boundary has parameters.
#[derive(Clone, Copy, Debug)]
pub(super) enum Method<'a> {
    /// Weights by a formula, radius 3/√m (Imperatore 2024, (4.16)), grown where it ties too few points.
    Classical(CloudWeights),
    /// Weights by a network.
    Pargcn(&'a Pargcn, PargcnOptions),
    /// Parameters by a network.
    Bidgcn(&'a Bidgcn),
}

/// The three classical methods and their names.
pub(super) const CLASSICAL: [(&str, Method<'static>); 3] = [
    ("UNIF", Method::Classical(CloudWeights::Uniform)),
    ("RECD", Method::Classical(CloudWeights::ReciprocalDistance { exponent: 1.0 })),
    ("LPSP", Method::Classical(CloudWeights::LocalProjection)),
];

/// Parameters of a cloud.
pub(super) struct Mapped {
    pub(super) parameters: Array2<f64>,
    /// Seconds of processor time, of all threads.
    pub(super) seconds: f64,
    /// Whether the radius 3/√m was enough; true for networks.
    pub(super) radius_sufficed: bool,
}

impl Method<'_> {
    pub(super) fn map(self, points: ArrayView2<'_, f64>, boundary: &BoundaryParameters) -> Result<Mapped> {
        let clock = ProcessorClock::start();
        let fixed = boundary.parameters.view();
        let (parameters, radius_sufficed) = match self {
            Self::Classical(weights) => {
                let params = CloudMapParams { weights, radius: Radius::Grown, ..CloudMapParams::default() };
                let map = map_cloud(points, boundary, &params)?;
                (map.parameters, map.report.growths == 0)
            }
            Self::Pargcn(network, options) => (network.predict(points, &boundary.points, fixed, &options)?, true),
            Self::Bidgcn(network) => (network.predict(points, &boundary.points, fixed)?, true),
        };
        Ok(Mapped { parameters, seconds: clock.seconds(), radius_sufficed })
    }
}

/// The boundary points of a sampled cloud with their true parameters.
pub(super) fn boundary(cloud: &ScatteredCloud) -> BoundaryParameters {
    let rows: Vec<usize> = (cloud.interior..cloud.points.nrows()).collect();
    BoundaryParameters {
        points: rows.iter().map(|&row| row as u32).collect(),
        parameters: cloud.parameters.select(Axis(0), &rows),
    }
}

/// Processor time of this process, all threads together; by the clock on the wall where the system does not tell.
pub(super) struct ProcessorClock {
    start: Option<f64>,
    wall: Instant,
}

impl ProcessorClock {
    pub(super) fn start() -> Self {
        Self { start: processor_seconds(), wall: Instant::now() }
    }

    pub(super) fn seconds(&self) -> f64 {
        match (self.start, processor_seconds()) {
            (Some(before), Some(now)) => now - before,
            _ => self.wall.elapsed().as_secs_f64(),
        }
    }
}

/// The sum over the threads of the nanoseconds that Linux counts as spent on a processor.
fn processor_seconds() -> Option<f64> {
    let mut sum = 0.0;
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        let text = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        sum += text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9;
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processor_time_is_counted() {
        let clock = ProcessorClock::start();
        let mut sum = 0.0f64;
        while clock.wall.elapsed().as_secs_f64() < 0.3 {
            sum += sum.sin();
        }
        let seconds = clock.seconds();
        assert!(seconds > 1e-3, "{seconds} {sum}");
    }
}
