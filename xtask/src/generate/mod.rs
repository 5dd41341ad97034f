//! Synthetic clouds and meshes. The same arguments give the same bytes.

pub mod fixtures;
mod format;
pub mod gridded;
mod mesh;
pub mod scattered;
pub mod solids;
pub mod surface;

use std::f64::consts::TAU;
use std::path::Path;
use std::str::FromStr;

use anyhow::{Context, Result, bail};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use self::format::Format;
use self::surface::{Kind, Layout};

/// Numbers are written with this many decimals: far below any tolerance of a fit, far above the differences between
/// the mathematical libraries of machines.
const DECIMALS: i32 = 9;

/// Standard deviation of the noise that is added to each coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Noise {
    /// In units of the surface.
    Absolute(f64),
    /// In percent of the diagonal of the bounding box.
    Percent(f64),
}

impl FromStr for Noise {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Self> {
        let (number, of): (&str, fn(f64) -> Self) = match text.strip_suffix('%') {
            Some(number) => (number, Self::Percent),
            None => (text, Self::Absolute),
        };
        let value: f64 = number.trim().parse().with_context(|| format!("{text:?} is not a number"))?;
        if !(value.is_finite() && value >= 0.0) {
            bail!("noise {value} is negative or not finite");
        }
        Ok(of(value))
    }
}

/// What to sample, and how.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// The surface.
    pub kind: Kind,
    /// Where points lie in the parameter square.
    pub layout: Layout,
    /// Number of points.
    pub points: usize,
    /// The noise.
    pub noise: Noise,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Sampled points with their parameters.
#[derive(Clone, Debug)]
pub struct Cloud {
    /// Parameters in the unit square.
    pub parameters: Vec<[f64; 2]>,
    /// Points, noise included.
    pub points: Vec<[f64; 3]>,
    /// Points per direction, of a grid.
    pub grid: Option<[usize; 2]>,
}

impl Sample {
    /// The points.
    ///
    /// # Errors
    /// A number of points that the layout does not allow.
    pub fn cloud(&self) -> Result<Cloud> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let surface::Places { mut parameters, grid } = self.layout.places(self.points, &mut random)?;
        // Rounded before they are used, so that the written parameters are those of the written points.
        parameters.iter_mut().flatten().for_each(|u| *u = rounded(*u));
        let surface = self.kind.surface()?;
        let mut points = parameters.iter().map(|&uv| surface.point(uv)).collect::<Result<Vec<_>>>()?;
        let deviation = match self.noise {
            Noise::Absolute(value) => value,
            Noise::Percent(value) => 0.01 * value * diagonal(&points),
        };
        if deviation > 0.0 {
            points.iter_mut().flatten().for_each(|x| *x += deviation * normal(&mut random));
        }
        points.iter_mut().flatten().for_each(|x| *x = rounded(*x));
        Ok(Cloud { parameters, points, grid })
    }

    /// The file's content in the format that the extension of a name stands for.
    ///
    /// # Errors
    /// As [`Sample::cloud`]; an unknown extension.
    pub fn bytes(&self, name: &Path) -> Result<Vec<u8>> {
        let format = Format::from_path(name)?;
        format.bytes(&self.cloud()?, self.kind).with_context(|| format!("cannot generate {}", name.display()))
    }

    /// Writes a file.
    ///
    /// # Errors
    /// As [`Sample::bytes`]; what writing meets.
    pub fn write(&self, path: &Path) -> Result<()> {
        std::fs::write(path, self.bytes(path)?).with_context(|| format!("cannot write {}", path.display()))
    }
}

fn rounded(x: f64) -> f64 {
    let scale = 10.0_f64.powi(DECIMALS);
    // The sum turns −0 into 0.
    (x * scale).round() / scale + 0.0
}

/// A normally distributed number (Box & Muller 1958).
fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (radius, angle) = (1.0 - random.random::<f64>(), random.random::<f64>());
    (-2.0 * radius.ln()).sqrt() * (TAU * angle).cos()
}

fn diagonal(points: &[[f64; 3]]) -> f64 {
    let extent = |k: usize| {
        let values = || points.iter().map(|p| p[k]);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    (0..3).map(|k| extent(k).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_read_in_units_and_in_percent() {
        assert_eq!("0.5".parse::<Noise>().unwrap(), Noise::Absolute(0.5));
        assert_eq!("0.1%".parse::<Noise>().unwrap(), Noise::Percent(0.1));
        for wrong in ["-1", "nan", "inf%", "", "%", "1 m"] {
            assert!(wrong.parse::<Noise>().is_err(), "{wrong:?} was read");
        }
    }

    #[test]
    fn noise_has_the_deviation_asked_for_and_depends_on_the_seed() {
        let sample = |noise, seed| {
            let layout = Layout::Random;
            Sample { kind: Kind::Wigley, layout, points: 4000, noise, seed }.cloud().unwrap().points
        };
        let (exact, noisy) = (sample(Noise::Absolute(0.0), 3), sample(Noise::Absolute(0.01), 3));
        let squares: f64 = exact.iter().flatten().zip(noisy.iter().flatten()).map(|(a, b)| (a - b).powi(2)).sum();
        // The root mean square of 12000 normal numbers scatters by 1/√24000 = 0.65 %; four times that is allowed.
        let deviation = (squares / 12_000.0).sqrt();
        assert!((deviation - 0.01).abs() < 2.6e-4, "deviation {deviation}");
        assert_ne!(noisy, sample(Noise::Absolute(0.01), 4));
        assert_eq!(noisy, sample(Noise::Absolute(0.01), 3));
    }
}
