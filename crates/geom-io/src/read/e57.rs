//! ASTM E2807 (E57): the points of all scans of a file, in the frame of the file.

use std::io::Cursor;

use e57::{CartesianCoordinate, E57Reader, RecordDataType};

use super::decoder::shielded;
use super::text::finite;
use super::{Format, Scan, rows};
use crate::error::{Location, ReadErrorKind};

const NAME: &str = "E57";

/// Poses are applied, spherical coordinates converted. Points without a valid position are left out.
pub(super) fn read(bytes: &[u8]) -> Result<Scan, ReadErrorKind> {
    shielded(NAME, || {
        let mut reader = E57Reader::new(Cursor::new(bytes)).map_err(malformed)?;
        let clouds = reader.pointclouds();
        let (mut coordinates, mut rows_read) = (Vec::new(), Vec::new());
        let (mut index, mut invalid) = (0, 0_usize);
        for cloud in &clouds {
            // Of records without bits any number fits into no bytes.
            let has_bits = |data_type: &RecordDataType| match data_type {
                RecordDataType::Integer { min, max } | RecordDataType::ScaledInteger { min, max, .. } => min < max,
                RecordDataType::Single { .. } | RecordDataType::Double { .. } => true,
            };
            if cloud.records > 0 && !cloud.prototype.iter().any(|record| has_bits(&record.data_type)) {
                let reason = format!("{} points without any values are announced", cloud.records);
                return Err(ReadErrorKind::Malformed { format: NAME, reason });
            }
            let mut points = reader.pointcloud_simple(cloud).map_err(malformed)?;
            points.intensity_to_color(false);
            points.normalize_intensity(false);
            points.normalize_color(false);
            for point in points {
                // The decoder's word for a packet that completes no point; the next one does, or the file ends.
                if matches!(point, Err(e57::Error::Internal { .. })) {
                    continue;
                }
                match point.map_err(malformed)?.cartesian {
                    CartesianCoordinate::Valid { x, y, z } => {
                        for coordinate in [x, y, z] {
                            let location = || Location::Record { element: "point".to_owned(), index };
                            coordinates.push(finite(coordinate, location)?);
                        }
                        rows_read.push(index as u32);
                    }
                    _ => invalid += 1,
                }
                index += 1;
            }
        }
        let mut scan = Scan::new(Format::E57, rows(coordinates, 3));
        scan.rows = rows_read;
        if clouds.len() > 1 {
            scan.notes.push(format!("the points of {} scans were put together", clouds.len()));
        }
        if invalid > 0 {
            scan.notes.push(format!("{invalid} points have no valid position and were left out"));
        }
        Ok(scan)
    })
}

fn malformed(error: e57::Error) -> ReadErrorKind {
    ReadErrorKind::Malformed { format: NAME, reason: error.to_string() }
}
