//! Sequences and grids on random curves and surfaces, the training and test data of PARCNN.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use candle_core::{Device, Tensor};
use clap::ValueEnum;
use ndarray::Array2;
use param_nn::{GriddedCloud, GriddedSpec, Shape, stream};

/// What is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// A polynomial curve in the plane.
    PlaneCurve,
    /// A polynomial curve in space.
    SpaceCurve,
    /// A trigonometric curve in the plane; the degree is its order.
    Trigonometric,
    /// A polynomial surface.
    Surface,
}

impl Kind {
    /// The shape of a degree.
    pub fn shape(self, degree: usize) -> Shape {
        match self {
            Self::PlaneCurve => Shape::Curve { degree, dimension: 2 },
            Self::SpaceCurve => Shape::Curve { degree, dimension: 3 },
            Self::Trigonometric => Shape::Trigonometric { order: degree, dimension: 2 },
            Self::Surface => Shape::Surface { degree },
        }
    }
}

/// How items are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FileFormat {
    /// Columns `u,x,y` or `u,x,y,z` for curves, `u,v,x,y,z` for surfaces, the first index of the grid running slowest.
    /// Numbers have all their digits.
    Csv,
    /// Arrays `parameters` and `points` of NumPy, of shape `(m, 1)` and `(m, N)` for curves, `(m₁, m₂, 2)` and
    /// `(m₁, m₂, 3)` for surfaces.
    Npz,
}

/// Writes items 0, 1, … of a seed as `gridded_0000.csv` or `gridded_0000.npz`, … and returns their paths.
///
///
/// # Errors
/// Options out of range; what writing meets.
pub fn write(spec: &GriddedSpec, format: FileFormat, seed: u64, count: u64, folder: &Path) -> Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let one = |index: u64| {
        let cloud = spec.sample(&mut stream(seed, index))?;
        let extension = match format {
            FileFormat::Csv => "csv",
            FileFormat::Npz => "npz",
        };
        let path = folder.join(format!("gridded_{index:04}.{extension}"));
        match format {
            FileFormat::Csv => {
                std::fs::write(&path, csv(&cloud)?).with_context(|| format!("cannot write {}", path.display()))?;
            }
            FileFormat::Npz => write_npz(&cloud, spec.size, &path)?,
        }
        Ok(path)
    };
    (0..count).map(one).collect()
}

fn csv(cloud: &GriddedCloud) -> Result<String> {
    let names = [&["u", "v"][..cloud.parameters.ncols()], &["x", "y", "z"][..cloud.points.ncols()]].concat();
    let mut text = names.join(",") + "\n";
    for (uv, p) in cloud.parameters.rows().into_iter().zip(cloud.points.rows()) {
        let numbers: Vec<String> = uv.iter().chain(p).map(f64::to_string).collect();
        writeln!(text, "{}", numbers.join(","))?;
    }
    Ok(text)
}

/// Writes the arrays of an item.
fn write_npz(cloud: &GriddedCloud, [along, across]: [usize; 2], path: &Path) -> Result<()> {
    let tensor = |rows: &Array2<f64>| -> Result<Tensor> {
        let numbers: Vec<f64> = rows.iter().copied().collect();
        Ok(match cloud.parameters.ncols() {
            1 => Tensor::from_vec(numbers, rows.dim(), &Device::Cpu)?,
            _ => Tensor::from_vec(numbers, (along, across, rows.ncols()), &Device::Cpu)?,
        })
    };
    let arrays = [("parameters", tensor(&cloud.parameters)?), ("points", tensor(&cloud.points)?)];
    Tensor::write_npz(&arrays, path).with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_of_numpy_read_back_bit_by_bit() {
        let folder = std::env::temp_dir().join(format!("gridded-{}", std::process::id()));
        for (kind, size, shape) in [(Kind::SpaceCurve, [9, 1], vec![9]), (Kind::Surface, [4, 5], vec![4, 5])] {
            let spec = GriddedSpec { shape: kind.shape(3), size, noise: 0.01 };
            let paths = write(&spec, FileFormat::Npz, 4, 2, &folder).unwrap();
            assert!(paths[1].ends_with("gridded_0001.npz"), "{paths:?}");
            let cloud = spec.sample(&mut stream(4, 1)).unwrap();
            let arrays = Tensor::read_npz_by_name(&paths[1], &["parameters", "points"]).unwrap();
            for (array, rows) in arrays.iter().zip([&cloud.parameters, &cloud.points]) {
                assert_eq!(array.dims(), [&shape[..], &[rows.ncols()]].concat());
                let numbers = array.flatten_all().unwrap().to_vec1::<f64>().unwrap();
                assert_eq!(numbers, rows.iter().copied().collect::<Vec<f64>>());
            }
        }
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn written_items_read_back_bit_by_bit() {
        for (kind, size, header) in [
            (Kind::PlaneCurve, [9, 1], "u,x,y"),
            (Kind::SpaceCurve, [9, 1], "u,x,y,z"),
            (Kind::Trigonometric, [9, 1], "u,x,y"),
            (Kind::Surface, [4, 5], "u,v,x,y,z"),
        ] {
            let cloud = GriddedSpec { shape: kind.shape(3), size, noise: 0.01 }.sample(&mut stream(4, 2)).unwrap();
            let text = csv(&cloud).unwrap();
            assert_eq!(text.lines().next(), Some(header));
            let rows: Vec<Vec<f64>> =
                text.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect();
            assert_eq!(rows.len(), size[0] * size[1]);
            for (i, row) in rows.iter().enumerate() {
                let expected = [cloud.parameters.row(i).to_vec(), cloud.points.row(i).to_vec()].concat();
                assert_eq!(*row, expected);
            }
        }
    }
}
