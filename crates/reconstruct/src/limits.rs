//! Comparisons as a gate: limits that they keep or not; and their points one by one.

use std::path::Path;

use crate::{Comparison, Error, Tolerance, write_text};

/// Limits that a comparison has to keep.
#[derive(Clone, Copy, Debug, Default)]
pub struct Limits {
    /// For the largest distance of the scan from the surface.
    pub max: Option<Tolerance>,
    /// For the distance that 95 % of the scan's area (of a cloud, of the points weighed by their spacing) have at most.
    pub p95: Option<Tolerance>,
}

/// A limit that was not kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exceeded {
    /// The limit's name: `max` or `p95`.
    pub name: &'static str,
    /// What was measured.
    pub found: f64,
    /// What was allowed, in the units of the points.
    pub limit: f64,
}

impl Limits {
    /// Checks that limits are positive.
    ///
    /// # Errors
    /// [`Error::OptionRange`].
    pub fn check(&self) -> Result<(), Error> {
        self.max.map_or(Ok(()), |limit| limit.check_as("--max"))?;
        self.p95.map_or(Ok(()), |limit| limit.check_as("--p95"))
    }

    /// The limits that a comparison does not keep.
    pub fn exceeded(&self, comparison: &Comparison) -> Vec<Exceeded> {
        let found = &comparison.deviation.scan_to_surface;
        let pairs = [("max", self.max, found.max), ("p95", self.p95, found.p95)];
        let given = pairs.into_iter().filter_map(|(name, limit, found)| {
            Some(Exceeded { name, found, limit: limit?.resolve(comparison.diagonal) })
        });
        // What is no number is not below a limit.
        given.filter(|exceeded| exceeded.found.is_nan() || exceeded.found > exceeded.limit).collect()
    }
}

/// Writes the points of a comparison as CSV: `row` in the file from 0, coordinates, distance, the closest point and its parameters.
///
/// # Errors
/// [`Error::Write`], [`Error::Io`].
pub fn write_distances(path: &Path, comparison: &Comparison) -> Result<(), Error> {
    let dim = comparison.at_points.first().map_or(3, |point| point.point.len());
    let axes = &["x", "y", "z"][..dim.min(3)];
    let closest: Vec<String> = axes.iter().map(|axis| format!("closest_{axis}")).collect();
    let mut text = format!("row,{},distance,{},u,v\n", axes.join(","), closest.join(","));
    for at in &comparison.at_points {
        let numbers = at.point.iter().chain([&at.distance]).chain(&at.closest).chain(&at.parameters);
        text += &at.row.to_string();
        numbers.for_each(|number| text += &format!(",{number}"));
        text.push('\n');
    }
    write_text(path, &text)
}
