//! What is kept of a scan beside the points that were fitted, for those who look at the result.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use geom_io::Scan;
use ndarray::Array2;
use rustc_hash::FxHashSet;
use sha2::{Digest, Sha256};

use crate::Parameterized;
use crate::problem::rows_of;

/// Bytes of a file that are read at a time.
const BLOCK: usize = 1 << 16;

/// What is known of a scan beside the points that were fitted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scanned {
    /// The triangles of a mesh, which name fitted points; empty for a cloud.
    pub triangles: Vec<[u32; 3]>,
    /// Points of the file that were not fitted: set aside, removed or cropped; without copies of fitted ones.
    pub left_out: Vec<[f64; 3]>,
    /// Whether a robust loss or a marker set each fitted point aside; empty where none was.
    pub set_aside: Vec<bool>,
    /// Whether the points are heights over x and y.
    pub has_heights: bool,
    /// Whether the scan tells an outside: by its triangles, by normals, or upward.
    pub has_side: bool,
}

/// Points of a file and their rows, before anything is left out.
pub(crate) struct ReadPoints {
    points: Array2<f64>,
    rows: Vec<u32>,
}

impl ReadPoints {
    pub(crate) fn of(scan: &Scan) -> Self {
        Self { points: scan.cloud.points.clone(), rows: scan.rows.clone() }
    }

    /// Those that were not laid out.
    pub(crate) fn left_out(self, laid_out: &Parameterized) -> Vec<[f64; 3]> {
        if self.points.ncols() != 3 || self.rows.len() <= laid_out.rows.len() {
            return Vec::new();
        }
        let kept: FxHashSet<u32> = laid_out.rows.iter().copied().collect();
        let of_kept: FxHashSet<[u64; 3]> =
            rows_of(laid_out.points.view()).into_iter().map(|p| p.map(f64::to_bits)).collect();
        let points = rows_of(self.points.view()).into_iter().zip(self.rows);
        let apart = points.filter(|(p, row)| !kept.contains(row) && !of_kept.contains(&p.map(f64::to_bits)));
        apart.map(|(p, _)| p).collect()
    }
}

/// The SHA-256 fingerprint of a file, as `sha256sum` prints it; `None` of pipes and of what cannot be read again.
pub fn fingerprint(path: &Path) -> Option<String> {
    let hash = || -> io::Result<String> {
        let mut file = File::open(path)?;
        let (mut sum, mut block) = (Sha256::new(), vec![0; BLOCK]);
        loop {
            let read = file.read(&mut block)?;
            if read == 0 {
                return Ok(sum.finalize().iter().map(|byte| format!("{byte:02x}")).collect());
            }
            sum.update(&block[..read]);
        }
    };
    path.is_file().then(hash)?.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fingerprints_are_those_of_sha256sum() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("abc");
        std::fs::write(&path, "abc").unwrap();
        // The example of FIPS 180-4.
        let known = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(fingerprint(&path).as_deref(), Some(known));
        assert_eq!(fingerprint(folder.path()), None);
        assert_eq!(fingerprint(Path::new("-")), None);
    }
}
