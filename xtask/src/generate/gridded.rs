//! Sequences and grids on random curves and surfaces, the training and test data of PARCNN.

use std::fmt::Write as _;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::ValueEnum;
use ndarray::Array2;
use ndarray_npy::NpzWriter;
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
        let (extension, bytes) = match format {
            FileFormat::Csv => ("csv", csv(&cloud)?.into_bytes()),
            FileFormat::Npz => ("npz", npz(&cloud, spec.size)?),
        };
        let path = folder.join(format!("gridded_{index:04}.{extension}"));
        std::fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
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

fn npz(cloud: &GriddedCloud, [along, across]: [usize; 2]) -> Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    let mut file = NpzWriter::new(&mut bytes);
    let mut add = |name: &str, rows: &Array2<f64>| -> Result<()> {
        if cloud.parameters.ncols() == 1 {
            file.add_array(name, rows)?;
        } else {
            file.add_array(name, &rows.to_shape((along, across, rows.ncols()))?)?;
        }
        Ok(())
    };
    add("parameters", &cloud.parameters)?;
    add("points", &cloud.points)?;
    file.finish()?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array3, Ix2};
    use ndarray_npy::NpzReader;

    #[test]
    fn arrays_of_numpy_read_back_bit_by_bit() {
        let sample = |kind: Kind, size| {
            GriddedSpec { shape: kind.shape(3), size, noise: 0.01 }.sample(&mut stream(4, 2)).unwrap()
        };
        let curve = sample(Kind::SpaceCurve, [9, 1]);
        let mut file = NpzReader::new(Cursor::new(npz(&curve, [9, 1]).unwrap())).unwrap();
        assert_eq!(file.by_name::<ndarray::OwnedRepr<f64>, Ix2>("points").unwrap(), curve.points);
        assert_eq!(file.by_name::<ndarray::OwnedRepr<f64>, Ix2>("parameters").unwrap(), curve.parameters);
        let surface = sample(Kind::Surface, [4, 5]);
        let mut file = NpzReader::new(Cursor::new(npz(&surface, [4, 5]).unwrap())).unwrap();
        let points: Array3<f64> = file.by_name("points").unwrap();
        assert_eq!(points.dim(), (4, 5, 3));
        assert!((0..4).all(|i| (0..5).all(|j| (0..3).all(|k| points[[i, j, k]] == surface.points[[5 * i + j, k]]))));
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
