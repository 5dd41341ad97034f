//! Files of binary formats, written by the formats' own crates or by hand.

use std::io::{Cursor, Write};

use e57::{E57Writer, Quaternion, Record, RecordValue, Transform, Translation};
use flate2::{Compression, write::GzEncoder};
use las::point::{Classification, Format};
use las::{Builder, Color, Point, Vlr, Writer};

/// Points whose coordinates all formats hold exactly.
pub(crate) const POINTS: [[f64; 3]; 4] = [[0.0, 0.0, 1.5], [1.0, 0.0, -2.0], [0.0, 1.0, 0.25], [1.0, 1.0, 8.0]];

pub(crate) fn gzip(bytes: impl AsRef<[u8]>) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes.as_ref()).unwrap();
    encoder.finish().unwrap()
}

/// A LAS or LAZ file of a point format with [`POINTS`]; the classes are 2, 5, 2, 6, and a last point is withheld.
pub(crate) fn las(point_format: u8, compressed: bool) -> Vec<u8> {
    let mut builder = Builder::from((1, 4));
    builder.point_format = Format::new(point_format).unwrap();
    builder.point_format.is_compressed = compressed;
    for transform in [&mut builder.transforms.x, &mut builder.transforms.y, &mut builder.transforms.z] {
        (transform.scale, transform.offset) = (0.25, 1.0);
    }
    let mut writer = Writer::new(Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    let format = Format::new(point_format).unwrap();
    let marked = POINTS.into_iter().zip([2, 5, 2, 6]).map(|point| (point, false));
    for (([x, y, z], class), is_withheld) in marked.chain([(([9.0; 3], 2), true)]) {
        let classification = Classification::new(class).unwrap();
        let gps_time = format.has_gps_time.then_some(0.0);
        let color = format.has_color.then(Color::default);
        let point = Point { x, y, z, classification, is_withheld, gps_time, color, ..Point::default() };
        writer.write_point(point).unwrap();
    }
    writer.into_inner().unwrap().into_inner()
}

/// A LAZ file of so many points, in chunks of which the table tells the numbers of points.
pub(crate) fn variable_chunks(count: usize) -> Vec<u8> {
    let mut builder = Builder::from((1, 4));
    builder.point_format = Format::new(6).unwrap();
    builder.point_format.is_compressed = true;
    let items = laz::LazItemRecordBuilder::default_for_point_format_id(6, 0).unwrap();
    let record = laz::LazVlrBuilder::new(items).with_variable_chunk_size().build();
    let mut data = Vec::new();
    record.write_to(&mut data).unwrap();
    let user_id = laz::LazVlr::USER_ID.to_owned();
    builder.vlrs.push(Vlr { user_id, record_id: laz::LazVlr::RECORD_ID, description: String::new(), data });
    let mut writer = Writer::new(Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    for k in 0..count {
        let [x, y, z] = [k % 40, k / 40, k * k % 97].map(|c| c as f64);
        writer.write_point(Point { x, y, z, gps_time: Some(k as f64), ..Point::default() }).unwrap();
    }
    writer.into_inner().unwrap().into_inner()
}

/// A LAS file with one point and a record of the coordinate system.
pub(crate) fn las_with_record(record_id: u16, data: Vec<u8>) -> Vec<u8> {
    let mut builder = Builder::from((1, 4));
    builder.has_wkt_crs = record_id == 2112;
    builder.vlrs.push(Vlr { user_id: "LASF_Projection".to_owned(), record_id, description: String::new(), data });
    let mut writer = Writer::new(Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    writer.write_point(Point::default()).unwrap();
    writer.into_inner().unwrap().into_inner()
}

/// A LAZ file of so many equal points, which take next to no room.
pub(crate) fn equal_points(count: usize) -> Vec<u8> {
    let mut builder = Builder::from((1, 4));
    builder.point_format = Format::new(6).unwrap();
    builder.point_format.is_compressed = true;
    let mut writer = Writer::new(Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    for _ in 0..count {
        writer.write_point(Point { gps_time: Some(0.0), ..Point::default() }).unwrap();
    }
    writer.into_inner().unwrap().into_inner()
}

/// An E57 file with [`POINTS`] in two scans; the second is shifted by its pose and has a point without position.
pub(crate) fn e57() -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut file, "file").unwrap();
    for (guid, points, shift) in [("first", &POINTS[..2], 0.0), ("second", &POINTS[2..], 4.0)] {
        let prototype = vec![
            Record::CARTESIAN_X_F64,
            Record::CARTESIAN_Y_F64,
            Record::CARTESIAN_Z_F64,
            Record::CARTESIAN_INVALID_STATE,
        ];
        let mut scan = writer.add_pointcloud(guid, prototype).unwrap();
        scan.set_transform(Some(Transform {
            rotation: Quaternion { w: 1.0, x: 0.0, y: 0.0, z: 0.0 },
            translation: Translation { x: shift, y: 0.0, z: 0.0 },
        }));
        for [x, y, z] in points {
            let xyz = [x - shift, *y, *z].map(RecordValue::Double);
            scan.add_point(xyz.into_iter().chain([RecordValue::Integer(0)]).collect()).unwrap();
        }
        let nowhere = [0.0; 3].map(RecordValue::Double);
        scan.add_point(nowhere.into_iter().chain([RecordValue::Integer(2)]).collect()).unwrap();
        scan.finalize().unwrap();
    }
    writer.finalize().unwrap();
    drop(writer);
    file.into_inner()
}

/// Two triangles over [`POINTS`], which share no points.
pub(crate) fn stl(title: &[u8]) -> Vec<u8> {
    let mut bytes = title.to_vec();
    bytes.resize(80, 0);
    bytes.extend(2_u32.to_le_bytes());
    for corners in [[0, 1, 2], [1, 3, 2]] {
        bytes.extend([0; 12]);
        for corner in corners {
            bytes.extend(POINTS[corner].map(|c| (c as f32).to_le_bytes()).concat());
        }
        bytes.extend([7, 7]);
    }
    bytes
}

pub(crate) const STL_TEXT: &str = "solid part\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 1.5\n   VERTEX 1 0 -2\n\
   vertex 0 1 2.5e-1\n  endloop\n endfacet\n facet normal 0 0 1\n  outer loop\n   vertex 1 0 -2\n   vertex 1 1 8\n\
   vertex 0 1 0.25\n  endloop\n endfacet\nendsolid part\n";

fn pcd_header(data: &str) -> String {
    format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS rgb x y n z\nSIZE 4 8 4 1 2\nTYPE U F F U I\nCOUNT 1 1 1 3 1\nWIDTH 2\nHEIGHT 2\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA {data}\n"
    )
}

/// Integer heights: the field z has two bytes.
pub(crate) const PCD_POINTS: [[f64; 3]; 4] = [[0.0, 0.5, 1.0], [-3.0, 0.25, -2.0], [0.0, 1.0, 300.0], [1e90, 1.0, 8.0]];

pub(crate) fn pcd_text() -> Vec<u8> {
    let row = |[x, y, z]: [f64; 3]| format!("255 {x:e} {y} 1 2 3 {z}\n");
    (pcd_header("ascii") + &PCD_POINTS.map(row).concat()).into_bytes()
}

pub(crate) fn pcd_binary() -> Vec<u8> {
    let mut bytes = pcd_header("binary").into_bytes();
    for [x, y, z] in PCD_POINTS {
        bytes.extend(255_u32.to_le_bytes());
        bytes.extend(x.to_le_bytes());
        bytes.extend((y as f32).to_le_bytes());
        bytes.extend([1, 2, 3]);
        bytes.extend((z as i16).to_le_bytes());
    }
    bytes
}

/// Field by field, in literals alone but for the colours, which are a copy of their own first.
pub(crate) fn pcd_compressed() -> Vec<u8> {
    let mut fields = Vec::new();
    fields.extend(PCD_POINTS.map(|[x, _, _]| x.to_le_bytes()).concat());
    fields.extend(PCD_POINTS.map(|[_, y, _]| (y as f32).to_le_bytes()).concat());
    fields.extend([1, 2, 3].repeat(4));
    fields.extend(PCD_POINTS.map(|[_, _, z]| (z as i16).to_le_bytes()).concat());
    // Four bytes of the first colour, then a copy of 2 + 7 + 3 = 12 from 4 back.
    let mut data = [&[3][..], &255_u32.to_le_bytes(), &[7 << 5, 3, 3]].concat();
    for literals in fields.chunks(32) {
        data.push(literals.len() as u8 - 1);
        data.extend(literals);
    }
    let sizes = [data.len() as u32, 16 + fields.len() as u32].map(u32::to_le_bytes).concat();
    [pcd_header("binary_compressed").into_bytes(), sizes, data].concat()
}
