//! Scattered clouds on random polynomial surfaces, the training and test data of the networks.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::ValueEnum;
use param_nn::{ControlPoints, ScatteredCloud, ScatteredSpec, stream};

/// Families of control points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Family {
    /// Imperatore 2024, §4.2.6: on Greville abscissae.
    Greville,
    /// Imperatore 2024, §4.3.4: up to half a step from them.
    Jittered,
}

impl From<Family> for ControlPoints {
    fn from(family: Family) -> Self {
        match family {
            Family::Greville => Self::Greville,
            Family::Jittered => Self::Jittered,
        }
    }
}

/// Writes clouds 0, 1, … of a seed as `scattered_0000.csv`, … and returns their paths.
///
/// Columns `u,v,x,y,z,boundary`; the last is 1 for the points of the boundary, which stand last, counter-clockwise.
/// Numbers have all their digits.
///
/// # Errors
/// Options out of range; what writing meets.
pub fn write(spec: &ScatteredSpec, seed: u64, count: u64, folder: &Path) -> Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let one = |index: u64| {
        let cloud = spec.sample(&mut stream(seed, index))?;
        let path = folder.join(format!("scattered_{index:04}.csv"));
        std::fs::write(&path, csv(&cloud)?).with_context(|| format!("cannot write {}", path.display()))?;
        Ok(path)
    };
    (0..count).map(one).collect()
}

fn csv(cloud: &ScatteredCloud) -> Result<String> {
    let mut text = String::from("u,v,x,y,z,boundary\n");
    for (index, (uv, p)) in cloud.parameters.rows().into_iter().zip(cloud.points.rows()).enumerate() {
        let boundary = u8::from(index >= cloud.interior);
        writeln!(text, "{},{},{},{},{},{boundary}", uv[0], uv[1], p[0], p[1], p[2])?;
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_clouds_read_back_bit_by_bit() {
        let spec = ScatteredSpec { control_points: Family::Jittered.into(), degree: 3, interior: 30, noise: 0.01 };
        let cloud = spec.sample(&mut stream(4, 2)).unwrap();
        let text = csv(&cloud).unwrap();
        let rows: Vec<Vec<f64>> =
            text.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect();
        assert_eq!(rows.len(), cloud.points.nrows());
        for (i, row) in rows.iter().enumerate() {
            assert_eq!(row[..2], cloud.parameters.row(i).to_vec());
            assert_eq!(row[2..5], cloud.points.row(i).to_vec());
            assert_eq!(row[5] == 1.0, i >= 30);
        }
    }
}
