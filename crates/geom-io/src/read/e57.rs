//! ASTM E2807 (E57): the points of all scans of a file, in the frame of the file, in metres.

use std::io::Cursor;

use e57::{CartesianCoordinate, E57Reader, PointCloud, RecordDataType};

use super::decoder::{malformed, shielded};
use super::{Format, Scan, rows, xml};
use crate::error::ReadErrorKind;
use crate::model::LengthUnit;

const NAME: &str = "E57";

/// Where the length of the XML section stands in the header.
const XML_LENGTH: usize = 32;

/// Poses are applied, spherical coordinates converted. Points without a valid position are left out.
pub(super) fn read(bytes: &[u8]) -> Result<Scan, ReadErrorKind> {
    shielded(NAME, || {
        check_description(bytes)?;
        let mut reader = E57Reader::new(Cursor::new(bytes)).map_err(|error| malformed(NAME, error))?;
        let clouds = reader.pointclouds();
        check_room(&clouds, bytes.len())?;
        let (mut coordinates, mut rows_read) = (Vec::new(), Vec::new());
        let (mut index, mut invalid) = (0_u32, 0_usize);
        for cloud in &clouds {
            let mut points = reader.pointcloud_simple(cloud).map_err(|error| malformed(NAME, error))?;
            points.intensity_to_color(false);
            points.normalize_intensity(false);
            points.normalize_color(false);
            for point in points {
                // The decoder's word for a packet that completes no point; the next one does, or the file ends.
                if matches!(point, Err(e57::Error::Internal { .. })) {
                    continue;
                }
                match point.map_err(|error| malformed(NAME, error))?.cartesian {
                    CartesianCoordinate::Valid { x, y, z } if [x, y, z].iter().all(|c| c.is_finite()) => {
                        coordinates.extend([x, y, z]);
                        rows_read.push(index);
                    }
                    _ => invalid += 1,
                }
                index += 1;
            }
        }
        if coordinates.is_empty() && invalid > 0 {
            return Err(ReadErrorKind::NoneFinite { points: invalid });
        }
        let mut scan = Scan::new(Format::E57, rows(coordinates, 3));
        (scan.rows, scan.unit) = (rows_read, Some(LengthUnit::Metre));
        if clouds.len() > 1 {
            scan.notes.push(format!("the points of {} scans were put together", clouds.len()));
        }
        if invalid > 0 {
            scan.notes.push(format!("{invalid} points have no valid position and were left out"));
        }
        Ok(scan)
    })
}

/// Checks the XML section, of which the decoder builds a tree.
fn check_description(bytes: &[u8]) -> Result<(), ReadErrorKind> {
    let length = bytes.get(XML_LENGTH..).and_then(<[u8]>::first_chunk).map(|&length| u64::from_le_bytes(length));
    if length.is_some_and(|length| length > bytes.len() as u64) {
        return Err(malformed(NAME, "the description is longer than the file"));
    }
    let text = E57Reader::raw_xml(Cursor::new(bytes)).map_err(|error| malformed(NAME, error))?;
    let text = String::from_utf8(text).map_err(|error| malformed(NAME, error))?;
    xml::check(&text).map_err(|reason| malformed(NAME, reason))
}

/// Checks that the announced points have room in the file: they are not compressed, and no two scans share their bits. Of
/// points without bits any number would fit into no bytes.
fn check_room(clouds: &[PointCloud], bytes: usize) -> Result<(), ReadErrorKind> {
    let width = |data_type: &RecordDataType| match data_type {
        RecordDataType::Integer { min, max } | RecordDataType::ScaledInteger { min, max, .. } => {
            u128::from(i64::BITS - max.wrapping_sub(*min).leading_zeros())
        }
        RecordDataType::Single { .. } => 32,
        RecordDataType::Double { .. } => 64,
    };
    let (mut points, mut bits) = (0, 0_u128);
    for cloud in clouds {
        let of_point: u128 = cloud.prototype.iter().map(|record| width(&record.data_type)).sum();
        if cloud.records > 0 && of_point == 0 {
            return Err(malformed(NAME, format!("{} points without any values are announced", cloud.records)));
        }
        points += u128::from(cloud.records);
        bits = bits.saturating_add(of_point.saturating_mul(cloud.records.into()));
    }
    match bits.div_ceil(8) > bytes as u128 {
        true => Err(malformed(NAME, format!("{points} points are announced, for which the file is too short"))),
        false => Ok(()),
    }
}
