//! The angles between the tangent planes of patches that meet along smooth arcs.
//!
//! At a point of an arc, T is the derivative along it, D_L and D_R are the derivatives into the two patches, and a = |D ⊥ T| is the length of
//! the part of D across T. The planes agree if the vector
//!
//! ```text
//! v = D_L / a_L + D_R / a_R − γ T,    γ = (D_L / a_L + D_R / a_R) · T / |T|²,
//! ```
//!
//! vanishes; in general |v| = 2 sin(θ/2) for an angle θ between the half planes, and v is perpendicular to both T and the plane between them.
//!
//! For a step, 1/a_L, 1/a_R, γ and the normal n of that plane are held where the surface is, and n · v counts: a linear form. What moves
//! along the planes leaves it as it is. (|v|² with these factors held does not: where an arc ends on a crease whose two sides are not quite
//! one direction, it turns T into that of the crease, and in a flat face nothing else holds T. Nor does the sine
//! det(T, D_L, D_R) / (|T| a_L a_R) with lengths held, which vanishes there, too.) Where the surface is folded over, θ beyond 90°, n · v is
//! small, and all of v counts, which is 2 there.

use std::sync::Arc;

use point_cloud::vec3::{add, cross, dot, norm, scale as scaled, sub, unit};
use rayon::prelude::*;

use crate::arc_points::{ArcElement, ArcPoint, Derivatives};
use crate::equations::Equations;
use crate::term::{State, Term};

/// Lengths below this share of the longest of the three derivatives count as this much: a corner where a patch has no plane has no angle,
/// and must not outweigh all others.
///
/// Limit: guards the quotients; the corners of usable layouts are far from it.
const LEAST_SHARE: f64 = 1e-6;

/// Lengths that angles are measured by.
#[derive(Clone, Copy, Debug)]
struct Lengths {
    along: f64,
    across: [f64; 2],
}

impl Lengths {
    fn of([t, left, right]: &Derivatives) -> Self {
        let least = (LEAST_SHARE * norm(*t).max(norm(*left)).max(norm(*right))).max(f64::MIN_POSITIVE);
        let along = norm(*t).max(least);
        let across = |d: [f64; 3]| norm(sub(d, scaled(dot(d, *t) / (along * along), *t))).max(least);
        Self { along, across: [across(*left), across(*right)] }
    }

    fn product(&self) -> f64 {
        self.along * self.across[0] * self.across[1]
    }
}

/// Which part of v counts where the surface is not folded over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// n · v.
    AcrossPlanes,
    /// All of it.
    Whole,
}

/// What an element adds: a matrix in three coordinates of each of its functions, and a right-hand side.
struct Added {
    matrix: Vec<f64>,
    right: Vec<f64>,
}

/// v at a point, its factors held: a combination of the element's functions, and which parts of it count.
struct Held {
    /// 1/a_L, 1/a_R and −γ.
    factors: [f64; 3],
    /// n, if v counts along it alone.
    normal: Option<[f64; 3]>,
}

/// Directions in which all of v counts.
const AXES: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl Held {
    fn new(derivatives: &Derivatives, form: Form) -> Self {
        let lengths = Lengths::of(derivatives);
        let [t, left, right] = *derivatives;
        let factors = lengths.across.map(f64::recip);
        let both = add(scaled(factors[0], left), scaled(factors[1], right));
        let normals = [unit(cross(t, left)), unit(cross(right, t))];
        let is_across = form == Form::AcrossPlanes && dot(normals[0], normals[1]) > 0.0;
        Self {
            factors: [factors[0], factors[1], -dot(both, t) / (lengths.along * lengths.along)],
            normal: is_across.then(|| unit(add(normals[0], normals[1]))),
        }
    }

    /// Unit directions in which v counts.
    fn directions(&self) -> &[[f64; 3]] {
        self.normal.as_ref().map_or(&AXES, std::slice::from_ref)
    }

    /// v as a combination of the element's functions.
    fn weights(&self, point: &ArcPoint) -> Vec<f64> {
        let [alpha, beta, gamma] = self.factors;
        let sides = point.inward[0].iter().zip(&point.inward[1]);
        sides.zip(&point.along).map(|((left, right), along)| alpha * left + beta * right + gamma * along).collect()
    }
}

/// v for coefficients.
fn value(element: &ArcElement, weights: &[f64], coefficients: &[f64]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (&function, weight) in element.functions.iter().zip(weights) {
        (0..3).for_each(|k| sum[k] += weight * coefficients[3 * function as usize + k]);
    }
    sum
}

fn add_right(equations: &mut Equations, element: &ArcElement, right: &[f64]) {
    for (&function, row) in element.functions.iter().zip(right.chunks_exact(3)) {
        (0..3).for_each(|k| equations.right[3 * function as usize + k] += row[k]);
    }
}

/// `scale · Σ_arcs Σ_k w_k θ_k²`, θ by its sine.
pub(crate) fn angle_energy(elements: &[ArcElement], scale: f64, coefficients: &[f64]) -> f64 {
    let mut sum = 0.0;
    for element in elements {
        for point in &element.points {
            let derivatives = element.derivatives(point, coefficients);
            let [t, left, right] = derivatives;
            sum += point.weight * (dot(cross(t, left), right) / Lengths::of(&derivatives).product()).powi(2);
        }
    }
    scale * sum
}

/// `scale · Σ_arcs Σ_k w_k θ_k²` to first order where it was frozen: quadratic.
pub(crate) struct Angles {
    elements: Arc<[ArcElement]>,
    scale: f64,
    held: Vec<Vec<Held>>,
}

impl Angles {
    /// The term at coefficients.
    pub(crate) fn frozen(elements: Arc<[ArcElement]>, scale: f64, form: Form, coefficients: &[f64]) -> Self {
        let of = |e: &ArcElement| e.points.iter().map(|p| Held::new(&e.derivatives(p, coefficients), form)).collect();
        let held = elements.par_iter().map(of).collect();
        Self { elements, scale, held }
    }

    fn add_of(&self, element: &ArcElement, held: &[Held], coefficients: &[f64]) -> Added {
        let n = element.functions.len();
        let mut added = Added { matrix: vec![0.0; 9 * n * n], right: vec![0.0; 3 * n] };
        for (point, held) in element.points.iter().zip(held) {
            let weights = held.weights(point);
            let v = value(element, &weights, coefficients);
            let weight = self.scale * point.weight;
            for &direction in held.directions() {
                let theta = dot(direction, v);
                let slopes: Vec<[f64; 3]> = weights.iter().map(|w| scaled(*w, direction)).collect();
                let slopes = slopes.as_flattened();
                for (i, si) in slopes.iter().enumerate() {
                    added.right[i] -= weight * theta * si;
                    let row = &mut added.matrix[3 * n * i..][..3 * n];
                    row.iter_mut().zip(slopes).for_each(|(m, sj)| *m += weight * si * sj);
                }
            }
        }
        added
    }
}

impl Term for Angles {
    fn energy(&self, at: &State<'_>) -> f64 {
        let mut sum = 0.0;
        for (element, held) in self.elements.iter().zip(&self.held) {
            for (point, held) in element.points.iter().zip(held) {
                let v = value(element, &held.weights(point), at.coefficients);
                sum += point.weight * held.directions().iter().map(|d| dot(*d, v).powi(2)).sum::<f64>();
            }
        }
        self.scale * sum
    }

    fn linearize(&self, at: &State<'_>, equations: &mut Equations) {
        let pairs = self.elements.par_iter().zip(&self.held);
        let all: Vec<Added> = pairs.map(|(element, held)| self.add_of(element, held, at.coefficients)).collect();
        for (element, added) in self.elements.iter().zip(all) {
            let unknowns: Vec<u32> = element.functions.iter().flat_map(|f| (3 * f)..(3 * f + 3)).collect();
            if let Some(coupled) = &mut equations.coupled {
                coupled.add_cell(&unknowns, &added.matrix);
            }
            add_right(equations, element, &added.right);
        }
    }
}
