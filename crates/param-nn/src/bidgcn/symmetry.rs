//! Symmetries of the task: turned and mirrored, the square asks the same question.

use super::layers::WIDTH;
#[cfg(test)]
use super::network::Input;
#[cfg(test)]
use crate::real::Real;

/// Over how many images of a cloud a prediction is averaged.
///
/// The square has eight symmetries: u and v may be swapped, and either turned round. A network commutes with them only as
/// nearly as it has learned to. The mean of what it says of the images, turned back, is nearer to the truth. All images take
/// the graphs that the features of the cloud itself span, so even the mean over all eight does not commute exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Symmetries {
    /// The cloud as it is: the network as published.
    #[default]
    One,
    /// Turned by half a turn too.
    Two,
    /// All rotations by quarter turns.
    Four,
    /// The reflections too.
    Eight,
}

impl Symmetries {
    /// Images of each cloud.
    pub fn count(self) -> usize {
        match self {
            Self::One => 1,
            Self::Two => 2,
            Self::Four => 4,
            Self::Eight => 8,
        }
    }

    /// The symmetries, the identity first.
    pub(super) fn all(self) -> impl Iterator<Item = Symmetry> {
        (0..self.count()).map(Symmetry::of_index)
    }
}

/// One symmetry: either parameter may be turned round, then both swapped; the points in the frame of the boundary follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Symmetry {
    turned_round: [bool; 2],
    swapped: bool,
}

impl Symmetry {
    /// The first 2, 4 and 8 are groups.
    fn of_index(index: usize) -> Self {
        let bit = |k: usize| index >> k & 1 == 1;
        let (half_turn, quarter_turn, reflected) = (bit(0), bit(1), bit(2));
        // A quarter turn turns u round, then swaps.
        Self { turned_round: [half_turn ^ quarter_turn ^ reflected, half_turn], swapped: quarter_turn }
    }

    /// What the network is given, as this symmetry has it. The graphs stay: distances are the same.
    #[cfg(test)]
    pub(super) fn image<T: Real>(self, input: &Input<T>) -> Input<T> {
        let mut image = input.clone();
        let zero = T::from_f64(0.0);
        let mut extent = [zero; 3];
        for p in input.interior.as_chunks::<3>().0 {
            (0..3).for_each(|k| extent[k] = if p[k] > extent[k] { p[k] } else { extent[k] });
        }
        for p in input.boundary.as_chunks::<5>().0 {
            (0..3).for_each(|k| extent[k] = if p[k] > extent[k] { p[k] } else { extent[k] });
        }
        // In the frame of the boundary the third axis is the product of the first two: it turns round with each of them.
        let [u, v] = self.turned_round;
        let round = [u, v, u ^ v ^ self.swapped];
        let place = |p: &mut [T]| {
            (0..3).filter(|&k| round[k]).for_each(|k| p[k] = extent[k] - p[k]);
            if self.swapped {
                p.swap(0, 1);
            }
        };
        image.interior.as_chunks_mut::<3>().0.iter_mut().for_each(|p| place(p));
        for row in image.boundary.as_chunks_mut::<5>().0 {
            let (p, uv) = row.split_at_mut(3);
            place(p);
            (0..2).filter(|&k| self.turned_round[k]).for_each(|k| uv[k] = T::from_f64(1.0) - uv[k]);
            if self.swapped {
                uv.swap(0, 1);
            }
        }
        image
    }

    /// Takes the rows of a linear map of the image's coordinates, of points or of points and parameters, to those of the map
    /// of the original ones that differs by a constant only.
    pub(super) fn pull_back(self, rows: &mut [f32]) {
        let [u, v] = self.turned_round;
        let round = [u, v, u ^ v ^ self.swapped, u, v];
        let mut rows: Vec<&mut [f32]> = rows.chunks_exact_mut(WIDTH).collect();
        for first in [0, 3] {
            if self.swapped
                && let Some([a, b]) = rows.get_mut(first..first + 2)
            {
                a.swap_with_slice(b);
            }
        }
        for (row, round) in rows.iter_mut().zip(round) {
            if round {
                row.iter_mut().for_each(|w| *w = -*w);
            }
        }
    }

    /// Parameters in the square as it was, from those in its image.
    pub(super) fn back(self, [u, v]: [f64; 2]) -> [f64; 2] {
        let uv = if self.swapped { [v, u] } else { [u, v] };
        std::array::from_fn(|k| if self.turned_round[k] { 1.0 - uv[k] } else { uv[k] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bidgcn::cloud::Cloud;
    use crate::graph::Neighbours;
    use crate::synthetic::{ControlPoints, ScatteredSpec, stream};

    fn cloud() -> Cloud {
        let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree: 2, interior: 30, noise: 0.0 };
        Cloud::of_sample(&spec.sample(&mut stream(9, 0)).unwrap())
    }

    #[test]
    fn an_image_is_what_the_turned_square_makes_of_the_cloud() {
        let cloud = cloud();
        for symmetry in Symmetries::Eight.all() {
            let mut turned = cloud.clone();
            for uv in &mut turned.uv {
                (0..2).filter(|&k| symmetry.turned_round[k]).for_each(|k| uv[k] = 1.0 - uv[k]);
                if symmetry.swapped {
                    uv.swap(0, 1);
                }
            }
            let (image, expected) = (
                symmetry.image(&cloud.input::<f64>(true, Neighbours::default())),
                turned.input::<f64>(true, Neighbours::default()),
            );
            let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-12);
            assert!(near(&image.interior, &expected.interior), "{symmetry:?}");
            assert!(near(&image.boundary, &expected.boundary), "{symmetry:?}");
            for (uv, given) in turned.uv.iter().zip(&cloud.uv) {
                assert!(near(&symmetry.back(*uv), given), "{symmetry:?}");
            }
        }
    }

    #[test]
    fn two_four_and_eight_are_groups() {
        let compose = |a: Symmetry, b: Symmetry| {
            // Where the composition takes three points that no symmetry but the identity leaves alone.
            [[0.1, 0.2], [0.3, 0.9]].map(|uv| a.back(b.back(uv)).map(|x| (1e3 * x).round() as i64))
        };
        let identity = Symmetry::of_index(0);
        for symmetries in [Symmetries::Two, Symmetries::Four, Symmetries::Eight] {
            let elements: Vec<_> = symmetries.all().map(|s| compose(s, identity)).collect();
            for a in symmetries.all() {
                assert!(symmetries.all().all(|b| elements.contains(&compose(a, b))), "{symmetries:?}");
                assert_eq!(elements.iter().filter(|e| **e == compose(a, identity)).count(), 1);
            }
        }
    }
}
