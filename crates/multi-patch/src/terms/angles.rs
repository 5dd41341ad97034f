//! The angles between the tangent planes of patches that meet along smooth arcs.
//!
//! At a point of an arc, T is the derivative along it, D_L and D_R are the derivatives into the two patches, and a = |D ⊥ T| is the length of
//! the part of D across T. The planes agree if the vector
//!
//! ```text
//! v = D_L / a_L + D_R / a_R − γ T,    γ = (D_L / a_L + D_R / a_R) · T / |T|²,
//! ```
//!
//! vanishes; in general |v| = 2 sin(θ/2) for an angle θ between the half planes. To first order |v| is also the sine
//!
//! ```text
//! θ = det(T, D_L, D_R) / (|T| a_L a_R).
//! ```
//!
//! [`Kinks`] is the form |v|² with factors held: it leaves coordinates apart and tells a fold (θ = 180°, |v| = 2) from a smooth join, where the sine
//! is zero both times. [`Angles`] is θ² itself.

use point_cloud::vec3::{add, cross, dot, norm, scale as scaled, sub};
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

/// The sine of the angle.
fn sine([t, left, right]: &Derivatives, lengths: &Lengths) -> f64 {
    dot(cross(*t, *left), *right) / lengths.product()
}

/// `scale · Σ_arcs Σ_k w_k |v|²` with the factors 1/a_L, 1/a_R and γ held where they were frozen: quadratic.
pub(crate) struct Kinks<'a> {
    elements: &'a [ArcElement],
    scale: f64,
    /// Of each element's points the factors of D_L, D_R and T.
    factors: Vec<Vec<[f64; 3]>>,
}

impl<'a> Kinks<'a> {
    /// Freezes the factors at the coefficients.
    pub(crate) fn frozen(elements: &'a [ArcElement], scale: f64, coefficients: &[f64]) -> Self {
        let factor = |element: &ArcElement, point: &ArcPoint| {
            let derivatives = element.derivatives(point, coefficients);
            let lengths = Lengths::of(&derivatives);
            let [t, left, right] = derivatives;
            let [alpha, beta] = lengths.across.map(f64::recip);
            let both = add(scaled(alpha, left), scaled(beta, right));
            [alpha, beta, -dot(both, t) / (lengths.along * lengths.along)]
        };
        let factors = elements.iter().map(|e| e.points.iter().map(|point| factor(e, point)).collect()).collect();
        Self { elements, scale, factors }
    }
}

/// What an element adds: a matrix in its functions, or in their three coordinates each, and a right-hand side.
struct Added {
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl Kinks<'_> {
    /// v as a combination of the element's functions.
    fn weights(point: &ArcPoint, [alpha, beta, gamma]: [f64; 3]) -> Vec<f64> {
        let sides = point.inward[0].iter().zip(&point.inward[1]);
        sides.zip(&point.along).map(|((left, right), along)| alpha * left + beta * right + gamma * along).collect()
    }

    fn value(element: &ArcElement, weights: &[f64], coefficients: &[f64]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (&function, weight) in element.functions.iter().zip(weights) {
            (0..3).for_each(|k| sum[k] += weight * coefficients[3 * function as usize + k]);
        }
        sum
    }
}

impl Term for Kinks<'_> {
    fn energy(&self, at: &State<'_>) -> f64 {
        let mut sum = 0.0;
        for (element, factors) in self.elements.iter().zip(&self.factors) {
            for (point, &factors) in element.points.iter().zip(factors) {
                let v = Self::value(element, &Self::weights(point, factors), at.coefficients);
                sum += point.weight * dot(v, v);
            }
        }
        self.scale * sum
    }

    fn linearize(&self, at: &State<'_>, equations: &mut Equations) {
        let add = |(element, factors): (&ArcElement, &Vec<[f64; 3]>)| {
            let n = element.functions.len();
            let mut added = Added { matrix: vec![0.0; n * n], right: vec![0.0; 3 * n] };
            for (point, &factors) in element.points.iter().zip(factors) {
                let weights = Self::weights(point, factors);
                let v = Self::value(element, &weights, at.coefficients);
                for (i, wi) in weights.iter().enumerate() {
                    let factor = self.scale * point.weight * wi;
                    (0..3).for_each(|k| added.right[3 * i + k] -= factor * v[k]);
                    let row = &mut added.matrix[i * n..(i + 1) * n];
                    row.iter_mut().zip(&weights).for_each(|(m, wj)| *m += factor * wj);
                }
            }
            added
        };
        let all: Vec<Added> = self.elements.par_iter().zip(&self.factors).map(add).collect();
        for (element, added) in self.elements.iter().zip(all) {
            equations.alike.add_cell(&element.functions, &added.matrix);
            add_right(equations, element, &added.right);
        }
    }
}

fn add_right(equations: &mut Equations, element: &ArcElement, right: &[f64]) {
    for (&function, row) in element.functions.iter().zip(right.chunks_exact(3)) {
        (0..3).for_each(|k| equations.right[3 * function as usize + k] += row[k]);
    }
}

/// `scale · Σ_arcs Σ_k w_k θ_k²`.
pub(crate) struct Angles<'a> {
    pub(crate) elements: &'a [ArcElement],
    pub(crate) scale: f64,
}

impl<'a> Angles<'a> {
    /// Its value at coefficients.
    pub(crate) fn energy(&self, coefficients: &[f64]) -> f64 {
        let mut sum = 0.0;
        for element in self.elements {
            for point in &element.points {
                let derivatives = element.derivatives(point, coefficients);
                sum += point.weight * sine(&derivatives, &Lengths::of(&derivatives)).powi(2);
            }
        }
        self.scale * sum
    }

    /// The term with its denominators |T| a_L a_R held.
    pub(crate) fn frozen(&self, coefficients: &[f64]) -> FrozenAngles<'a> {
        let lengths = |element: &ArcElement| {
            let of = |point: &ArcPoint| Lengths::of(&element.derivatives(point, coefficients));
            element.points.iter().map(of).collect()
        };
        let lengths = self.elements.iter().map(lengths).collect();
        FrozenAngles { elements: self.elements, scale: self.scale, lengths }
    }
}

/// [`Angles`] with denominators held. The determinant is trilinear: its derivatives by T, D_L and D_R are D_L × D_R, D_R × T and T × D_L.
pub(crate) struct FrozenAngles<'a> {
    elements: &'a [ArcElement],
    scale: f64,
    lengths: Vec<Vec<Lengths>>,
}

impl FrozenAngles<'_> {
    /// Derivatives of θ by the coefficients of the element's functions.
    fn slopes(point: &ArcPoint, [t, left, right]: Derivatives, lengths: &Lengths) -> Vec<[f64; 3]> {
        let by = [cross(left, right), cross(right, t), cross(t, left)].map(|g| scaled(1.0 / lengths.product(), g));
        let weights = point.along.iter().zip(point.inward[0].iter().zip(&point.inward[1]));
        weights.map(|(t, (l, r))| add(scaled(*t, by[0]), add(scaled(*l, by[1]), scaled(*r, by[2])))).collect()
    }

    fn add_of(&self, element: &ArcElement, lengths: &[Lengths], coefficients: &[f64]) -> Added {
        let n = element.functions.len();
        let mut added = Added { matrix: vec![0.0; 9 * n * n], right: vec![0.0; 3 * n] };
        for (point, lengths) in element.points.iter().zip(lengths) {
            let derivatives = element.derivatives(point, coefficients);
            let (theta, slopes) = (sine(&derivatives, lengths), Self::slopes(point, derivatives, lengths));
            let weight = self.scale * point.weight;
            let slopes = slopes.as_flattened();
            for (i, si) in slopes.iter().enumerate() {
                added.right[i] -= weight * theta * si;
                let row = &mut added.matrix[3 * n * i..][..3 * n];
                row.iter_mut().zip(slopes).for_each(|(m, sj)| *m += weight * si * sj);
            }
        }
        added
    }
}

impl Term for FrozenAngles<'_> {
    fn energy(&self, at: &State<'_>) -> f64 {
        let mut sum = 0.0;
        for (element, lengths) in self.elements.iter().zip(&self.lengths) {
            for (point, lengths) in element.points.iter().zip(lengths) {
                sum += point.weight * sine(&element.derivatives(point, at.coefficients), lengths).powi(2);
            }
        }
        self.scale * sum
    }

    fn linearize(&self, at: &State<'_>, equations: &mut Equations) {
        let pairs = self.elements.par_iter().zip(&self.lengths);
        let all: Vec<Added> = pairs.map(|(element, lengths)| self.add_of(element, lengths, at.coefficients)).collect();
        for (element, added) in self.elements.iter().zip(all) {
            let unknowns: Vec<u32> = element.functions.iter().flat_map(|f| (3 * f)..(3 * f + 3)).collect();
            if let Some(coupled) = &mut equations.coupled {
                coupled.add_cell(&unknowns, &added.matrix);
            }
            add_right(equations, element, &added.right);
        }
    }
}
