//! No bytes make a reader panic, hang or reserve memory without bound.

use crate::scan_files;
use geom_io::{Format, ReadOptions, parse_scan};
use proptest::prelude::*;

fn read(format: Format, bytes: &[u8]) -> Result<geom_io::Scan, geom_io::ReadErrorKind> {
    parse_scan(bytes, format, &ReadOptions::default())
}

/// What holds of anything that was read.
fn check_invariants(scan: &geom_io::Scan) {
    let cloud = &scan.cloud;
    let m = cloud.points.nrows();
    assert!(m > 0 && cloud.points.iter().all(|c| c.is_finite()));
    if let Some(parameters) = &cloud.parameters {
        assert!(parameters.nrows() == m && parameters.iter().all(|c| c.is_finite()));
    }
    assert!(cloud.grid.is_none_or(|grid| grid.n_u * grid.n_v == m));
    assert!(scan.triangles.iter().flatten().flatten().all(|&index| (index as usize) < m));
}

/// A valid small file of each format whose reader is ours; PLY and PCD in three encodings.
fn samples() -> Vec<(Format, Vec<u8>)> {
    let ply = |encoding: &str, body: &[u8]| {
        let header = format!(
            "ply\nformat {encoding} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             property uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        );
        (Format::Ply, [header.as_bytes(), body].concat())
    };
    let binary = |float: fn(f32) -> [u8; 4], int: fn(i32) -> [u8; 4]| {
        let mut body = Vec::new();
        for k in 0..3 {
            body.extend([k as f32, 0.5, -1.0].map(float).concat());
            body.push(200);
        }
        body.push(3);
        body.extend([0, 1, 2].map(int).concat());
        body
    };
    vec![
        ply("ascii", b"0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2\n"),
        ply("binary_little_endian", &binary(f32::to_le_bytes, i32::to_le_bytes)),
        ply("binary_big_endian", &binary(f32::to_be_bytes, i32::to_be_bytes)),
        (Format::Obj, b"v 0 0 0\nv 1 0 0\nvt 0 1\nv 0 1 0\nf 1/1 2/1 3/1\nf -3 -2 -1\n".to_vec()),
        (Format::Off, b"COFF\n# c\n3 1 3\n0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2\n".to_vec()),
        (Format::Stl, scan_files::STL_TEXT.into()),
        (Format::Stl, scan_files::stl(b"title")),
        (Format::Pcd, scan_files::pcd_text()),
        (Format::Pcd, scan_files::pcd_binary()),
        (Format::Pcd, scan_files::pcd_compressed()),
        (Format::Xyz, b"3\n# c\n0 0 0\n1,\t0 0 // c\n0 1 0\n".to_vec()),
        (Format::Xyz, b"x; y; z\n0;0;0\n1;0;0;\n0;1;0\n".to_vec()),
        (Format::Csv, b"i,j,u,v,x,y,z,n\n1,1,0,0,0,0,1,a\n1,2,0,1,0,1,1,\n2,2,1,1,1,1,1,b\n2,1,1,0,1,0,1,c\n".to_vec()),
        (
            Format::Csv,
            b"Row;Col;X [mm];Y [mm];Z [mm];nx;ny;nz\n1;1;0,5;0;1;0;0;1\n1;2;0;1;nan;0;0;1\n2;1;1;0;1;0;0;1\n".to_vec(),
        ),
        (
            Format::Csv,
            b"id,x,y,z,i,j,k,\"a \"\"b\"\"\"\n1,0,0,0,0,0,1,\"c, d\"\n2,1,0,0,0,0,1,e\n3,0,1,1,0,0,1,\n".to_vec(),
        ),
        (Format::SurferGrid, b"DSAA\n2 2\n0 1\n0 1\n1 3\n1 2\n3 1.70141e38\n".to_vec()),
        (
            Format::Ptx,
            b"1\n2\n1 2 3\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 2 3 1\n0 1 2 0.5\n0 0 0 0.5\n".to_vec(),
        ),
        (
            Format::EsriGrid,
            b"ncols 2\nnrows 2\nxllcorner 1\nyllcorner 2\ncellsize 3\nNODATA_value -9\n1 2\n3 -9\n".to_vec(),
        ),
        (
            Format::GismoXml,
            b"<?xml version=\"1.0\"?><xml><Matrix rows=\"2\" cols=\"2\" id=\"0\">0 1\n0 1</Matrix>\
              <Matrix rows=\"3\" cols=\"2\" id=\"1\">0 1 0 1 0 1</Matrix></xml>"
                .to_vec(),
        ),
    ]
}

#[test]
fn cut_after_any_byte() {
    for (format, bytes) in samples() {
        for end in 0..bytes.len() {
            if let Ok(scan) = read(format, &bytes[..end]) {
                check_invariants(&scan);
            }
        }
    }
}

/// Formats that other crates decode: an error or a cloud, and no more memory than the file's size warrants.
#[test]
fn decoders_of_other_crates() {
    let samples = [
        (Format::Las, scan_files::las(0, false)),
        (Format::Las, scan_files::las(6, false)),
        (Format::Las, scan_files::las(1, true)),
        (Format::E57, scan_files::e57()),
        (Format::Xyz, scan_files::gzip("0 0 0\n1 2 3\n")),
    ];
    for (format, bytes) in samples {
        // Every byte of headers and small files, some of a long one.
        let step = 1 + bytes.len() / 500;
        for end in (0..bytes.len()).step_by(step) {
            if let Ok(scan) = read(format, &bytes[..end]) {
                check_invariants(&scan);
            }
            for byte in [0, 0x7f, 0xff] {
                let mut changed = bytes.clone();
                changed[end] = byte;
                if let Ok(scan) = read(format, &changed) {
                    check_invariants(&scan);
                }
            }
        }
    }
}

/// Sizes in a header reserve nothing that the file has no room for.
#[test]
fn announced_sizes_of_las() {
    for compressed in [false, true] {
        let whole = scan_files::las(6, compressed);
        for record in [0, 1, 19, 20, 31, 0x7fff, 0xffff_u16] {
            for points in [1, 5, u32::MAX] {
                let mut bytes = whole.clone();
                bytes[105..107].copy_from_slice(&record.to_le_bytes());
                bytes[107..111].copy_from_slice(&points.to_le_bytes());
                bytes[247..255].copy_from_slice(&u64::from(points).to_le_bytes());
                // A point may be longer than its format, if there are enough bytes.
                let is_possible = record == 31 && points == 1 && !compressed || record == 30;
                assert!(read(Format::Las, &bytes).is_err() || is_possible, "{compressed} {record} {points}");
            }
        }
    }
    // The newer points are compressed in layers, whose sizes follow the first point and the number of points of a chunk.
    let whole = scan_files::las(6, true);
    let points = u32::from_le_bytes(*whole[96..].first_chunk().unwrap()) as usize;
    for layer in 0..9 {
        let mut bytes = whole.clone();
        let size = points + 8 + 30 + 4 + 4 * layer;
        bytes[size..size + 4].copy_from_slice(&u32::MAX.to_le_bytes());
        let error = read(Format::Las, &bytes).unwrap_err().to_string();
        assert!(error.contains("chunk 0 (counted from 0) has layers beyond the end"), "{error}");
    }
}

/// A binary PLY file that lacks even its last byte is an error; so is one cut in its header.
#[test]
fn binary_ply_is_never_read_in_part() {
    for (format, bytes) in
        samples().into_iter().filter(|(f, bytes)| *f == Format::Ply && bytes.windows(6).any(|w| w == b"binary"))
    {
        assert!(read(format, &bytes).is_ok());
        for end in 0..bytes.len() {
            assert!(read(format, &bytes[..end]).is_err(), "cut at {end} of {}", bytes.len());
        }
    }
}

#[test]
fn any_byte_replaced() {
    for (format, bytes) in samples() {
        for place in 0..bytes.len() {
            for byte in [0, b'\n', b' ', b',', b'-', b'9', b'e', b'"', b'<', 0x7f, 0xff] {
                let mut changed = bytes.clone();
                changed[place] = byte;
                if let Ok(scan) = read(format, &changed) {
                    check_invariants(&scan);
                }
            }
        }
    }
}

proptest! {
    #[test]
    fn several_bytes_replaced(
        sample in any::<prop::sample::Index>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let samples = samples();
        let (format, bytes) = sample.get(&samples);
        let mut changed = bytes.clone();
        for (place, byte) in changes {
            let place = place.index(changed.len());
            changed[place] = byte;
        }
        if let Ok(scan) = read(*format, &changed) {
            check_invariants(&scan);
        }
    }

    #[test]
    fn garbage(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        for format in Format::ALL {
            if let Ok(scan) = read(format, &bytes) {
                check_invariants(&scan);
            }
        }
    }

    /// Text made of the pieces that the formats consist of gets further into the readers than random bytes.
    #[test]
    fn shuffled_pieces(pieces in prop::collection::vec(prop::sample::select(PIECES), 0..40)) {
        let text = pieces.concat();
        for format in Format::ALL {
            if let Ok(scan) = read(format, text.as_bytes()) {
                check_invariants(&scan);
            }
        }
    }

    /// A header in order, then anything.
    #[test]
    fn garbage_after_a_ply_header(
        vertices in 0_u64..5, faces in any::<u64>(), bytes in prop::collection::vec(any::<u8>(), 0..100),
        encoding in prop::sample::select(&["ascii", "binary_little_endian", "binary_big_endian"][..]),
        list in prop::sample::select(&["char int", "uint double", "float uchar", "double float"][..]),
    ) {
        let header = format!(
            "ply\nformat {encoding} 1.0\nelement vertex {vertices}\nproperty short x\nproperty char y\nproperty uchar z\n\
             element face {faces}\nproperty list {list} other\nproperty list {list} vertex_indices\nend_header\n"
        );
        if let Ok(scan) = read(Format::Ply, &[header.as_bytes(), &bytes].concat()) {
            check_invariants(&scan);
        }
    }
}

const PIECES: &[&str] = &[
    "\n",
    "\n",
    "\n",
    "\r\n",
    "\r",
    " ",
    " ",
    "\t",
    ",",
    ";",
    "#",
    "//",
    "/",
    "\"",
    "0",
    "1",
    "2",
    "3",
    "-1",
    "1.5",
    "1e400",
    "nan",
    "99999999999999999999",
    "18446744073709551615",
    "ply\n",
    "format ascii 1.0\n",
    "element vertex 2\n",
    "element face 1\n",
    "property float x\n",
    "property list uchar int vertex_indices\n",
    "end_header\n",
    "v ",
    "f ",
    "vt ",
    "OFF\n",
    "COFF ",
    "x,y,z\n",
    "i,j,x,y\n",
    "u v x y\n",
    "ncols ",
    "nrows ",
    "xllcorner ",
    "yllcenter ",
    "cellsize ",
    "NODATA_value ",
    "solid\n",
    "facet ",
    "outer loop\n",
    "vertex ",
    "endfacet\n",
    "endsolid\n",
    "FIELDS x y z\n",
    "SIZE 4 4 4\n",
    "COUNT ",
    "WIDTH 2\n",
    "DATA ascii\n",
    "DATA binary\n",
    "DATA binary_compressed\n",
    "<xml>",
    "</xml>",
    "<Matrix id=\"0\" rows=\"2\" cols=\"1\">",
    "</Matrix>",
    "\u{feff}",
    "é",
];
