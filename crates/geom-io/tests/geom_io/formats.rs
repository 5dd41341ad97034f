//! What each format's variants read as.

use geom_io::{Format, ReadErrorKind, ReadOptions, Scan, parse_scan};
use ndarray::{Array2, arr2};
use point_cloud::GridShape;

fn read(format: Format, bytes: impl AsRef<[u8]>) -> Scan {
    parse_scan(bytes.as_ref(), format, &ReadOptions::default()).unwrap()
}

fn corner() -> Array2<f64> {
    arr2(&[[0.0, 0.0, 1.5], [1.0, 0.0, -2.0], [0.0, 1.0, 3e-3]])
}

#[test]
fn text_points_with_any_separator_line_end_and_comment() {
    for text in [
        "0 0 1.5\n1 0 -2\n0 1 3e-3\n",
        "0 0 1.5\r\n1 0 -2\r\n0 1 3e-3",
        "0 0 1.5\r1 0 -2\r0 1 3e-3\r",
        "\u{feff}# scan\n\n  0\t0 \t1.5  \n// more\n1 0 -2 # low\n0 1 +3E-3 // end\n\n",
        "0,0,1.5\n1, 0, -2\n0 ,1 ,.003\n",
        "0;0;1.5;\n1;0;-2;\n0; 1; 0.003;\n",
        "0,\t0,\t1.5\n1,\t0,\t-2.\n0,\t1,\t0.003\n",
    ] {
        let scan = read(Format::Xyz, text);
        assert_eq!(scan.cloud.points, corner(), "{text:?}");
        assert_eq!((scan.triangles, scan.notes.len()), (None, 0), "{text:?}");
    }
}

#[test]
fn text_points_may_be_planar_and_carry_more_columns_a_title_or_a_count() {
    assert_eq!(read(Format::Xyz, "0 1\n2 3\n").cloud.points, arr2(&[[0.0, 1.0], [2.0, 3.0]]));

    let colours = read(Format::Xyz, "0 0 1.5 255 7 red\n1 0 -2 9\n0 1 3e-3\n");
    assert_eq!(colours.cloud.points, corner());
    assert_eq!(colours.notes, ["columns 4 to 6 were ignored"]);

    let titled = read(Format::Xyz, "RAE 2822\n0 0 1.5\n1 0 -2\n0 1 3e-3\n");
    assert_eq!(titled.cloud.points, corner());
    assert_eq!(titled.notes, ["line 1 is not a point and was skipped"]);

    let counted = read(Format::Xyz, "3\n0 0 1.5 80\n1 0 -2 81\n0 1 3e-3 82\n");
    assert_eq!(counted.cloud.points, corner());
    let too_few = read(Format::Xyz, "2\n0 0 1.5\n1 0 -2\n0 1 3e-3\n");
    assert_eq!(too_few.notes, ["the first line announces 2 points; all 3 were read"]);
}

#[test]
fn a_text_line_that_names_the_columns_is_heeded() {
    let scan = read(Format::Xyz, "u v x y z\n0.25 0.5 0 0 1.5\n0.5 0.5 1 0 -2\n1 1 0 1 3e-3\n");
    assert_eq!(scan.cloud.points, corner());
    assert_eq!(scan.cloud.parameters, Some(arr2(&[[0.25, 0.5], [0.5, 0.5], [1.0, 1.0]])));
}

#[test]
fn csv_finds_columns_by_name() {
    let scan = read(Format::Csv, "label,Z,X,V,Y,U\na,1.5,0,2,0,1\n # note\nb,-2,1,4,0,3\n,3e-3,0,6,1,5\n");
    assert_eq!(scan.cloud.points, corner());
    assert_eq!(scan.cloud.parameters, Some(arr2(&[[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])));
    assert_eq!(scan.notes, ["columns that were ignored: label"]);

    for text in ["x;y;note\n1;2;\n3;4;ok\n", "x\ty\tnote\n1\t2\t\n3\t4\tok\n", "\"x\",\"y\"\n\"1\",2\n3,\"4\"\n"] {
        assert_eq!(read(Format::Csv, text).cloud.points, arr2(&[[1.0, 2.0], [3.0, 4.0]]), "{text:?}");
    }
    let headless = read(Format::Csv, "1,2\n3,4\n");
    assert_eq!(headless.cloud.points, arr2(&[[1.0, 2.0], [3.0, 4.0]]));
    assert_eq!(headless.notes, ["no line names the columns; they were taken as x, y, z"]);

    let named = ReadOptions { columns: vec!["t".to_owned(), "A".to_owned()], ..ReadOptions::default() };
    let scan = parse_scan(b"T,a,x\n1,2,0\n", Format::Csv, &named).unwrap();
    assert_eq!(scan.cloud.points, arr2(&[[1.0, 2.0]]));
    let curve = read(Format::Csv, "u,x,y\n0.5,1,2\n");
    assert_eq!(curve.cloud.parameters, Some(arr2(&[[0.5]])));
}

#[test]
fn csv_grids_are_sorted_from_base_0_or_1() {
    let expected = arr2(&[[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0], [2.0, 0.0], [2.0, 1.0]]);
    for (text, rows) in [
        ("i,j,x,y\n0,0,0,0\n0,1,0,1\n1,0,1,0\n1,1,1,1\n2,0,2,0\n2,1,2,1\n", [0, 1, 2, 3, 4, 5]),
        ("x,y,i,j\n2,1,3,2\n0,1,1,2\n0,0,1,1\n1,1,2,2\n2,0,3,1\n1,0,2,1\n", [2, 1, 5, 3, 4, 0]),
    ] {
        let scan = read(Format::Csv, text);
        assert_eq!(scan.cloud.points, expected);
        assert_eq!(scan.cloud.grid, Some(GridShape { n_u: 3, n_v: 2 }));
        assert_eq!(scan.rows, rows);
        assert_eq!(scan.notes.is_empty(), rows.is_sorted());
    }
    let with_parameters = read(Format::Csv, "i,j,x,y,u,v\n0,1,5,6,7,8\n0,0,1,2,3,4\n");
    assert_eq!(with_parameters.cloud.parameters, Some(arr2(&[[3.0, 4.0], [7.0, 8.0]])));
}

#[test]
fn obj_faces_in_all_spellings() {
    let scan = read(
        Format::Obj,
        "# corner\nmtllib a.mtl\nv 0 0 1.5 1.0\nv 1 0 -2 0.5 0.5 0.5\nvt 0 0\nvn 0 0 1\ng part\n\
         f 1 2 3\nf 1/1 2/1 3/1\nv 0 1 3e-3\nf 1//1 2//1 3//1\nf -3/1/1 -2/1/1 -1/1/1 # last\nf 3 2 1 2\nf 1 2\nl 1 2\n",
    );
    assert_eq!(scan.cloud.points, corner());
    let triangles = [[0, 1, 2], [0, 1, 2], [0, 1, 2], [0, 1, 2], [2, 1, 0], [2, 0, 1]];
    assert_eq!(scan.triangles.as_deref(), Some(&triangles[..]));
    assert_eq!(scan.notes.len(), 4, "{:?}", scan.notes);
    assert_eq!(read(Format::Obj, "v 0 0 1.5\nv 1 0 -2\nv 0 1 3e-3").triangles, None);
}

#[test]
fn off_headers_and_comments() {
    for text in [
        "OFF\n3 1 0\n0 0 1.5\n1 0 -2\n0 1 3e-3\n3 0 1 2\n",
        "OFF 3 1 0\n0 0 1.5\n1 0 -2\n0 1 3e-3\n3 0 1 2 255 0 0\n",
        "# made by hand\nCOFF # colours\n\n3 1\n0 0 1.5 1 0 0 1\n1 0 -2 1 0 0 1\n# half\n0 1 3e-3 1 0 0 1\n3 0 1 2",
        "NOFF\r\n3 1 3\r\n0 0 1.5 0 0 1\r\n1 0 -2 0 0 1\r\n0 1 3e-3 0 0 1\r\n3 0 1 2\r\n",
    ] {
        let scan = read(Format::Off, text);
        assert_eq!(scan.cloud.points, corner(), "{text}");
        assert_eq!(scan.triangles.as_deref(), Some(&[[0, 1, 2]][..]), "{text}");
        assert!(scan.notes.is_empty());
    }
    let quad = read(Format::Off, "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\nmore\n");
    assert_eq!(quad.triangles.as_deref(), Some(&[[0, 1, 2], [0, 2, 3]][..]));
    assert_eq!(quad.notes.len(), 2);
}

/// A PLY file whose header lists things that are not needed, in an unusual order.
fn odd_ply(format: &str, body: &[u8]) -> Vec<u8> {
    let header = format!(
        "ply\nformat {format} 1.0\ncomment x y z\nobj_info none\nelement material 1\nproperty list uchar short ids\n\
         element face 2\nproperty uchar flag\nproperty list ushort uint vertex_index\nproperty list uchar float uv\n\
         element vertex 4\nproperty double z\nproperty char quality\nproperty short x\nproperty float y\nend_header\n"
    );
    [header.as_bytes(), body].concat()
}

/// The body of [`odd_ply`] in a byte order.
macro_rules! odd_body {
    ($to_bytes:ident) => {{
        let mut body = vec![2];
        body.extend([7_i16, -8].map(i16::$to_bytes).concat());
        for (corners, uv) in [(&[0_u32, 1, 2][..], &[0.5_f32][..]), (&[3, 2, 1, 0], &[])] {
            body.push(9);
            body.extend((corners.len() as u16).$to_bytes());
            corners.iter().for_each(|c| body.extend(c.$to_bytes()));
            body.push(uv.len() as u8);
            uv.iter().for_each(|c| body.extend(c.$to_bytes()));
        }
        for [x, y, z] in ODD_POINTS {
            body.extend(z.$to_bytes());
            body.push(0xff);
            body.extend((x as i16).$to_bytes());
            body.extend((y as f32).$to_bytes());
        }
        body
    }};
}

const ODD_POINTS: [[f64; 3]; 4] = [[0.0, 0.5, 0.1], [-300.0, 2.0, 1e90], [7.0, -0.25, 3.0], [1.0, 1.0, -1.0]];

#[test]
fn ply_in_all_encodings_with_things_that_are_not_needed() {
    let ascii = "2 7 -8\n9 3 0 1 2 1 0.5\n\n9 4 3 2 1 0 0\n\
                 0.1 -1 0 0.5\r\n1e90 -1 -300 2\n3 -1 7 -0.25\n-1 -1 1 1\n";
    for (format, body) in [
        ("ascii", ascii.as_bytes().to_vec()),
        ("binary_little_endian", odd_body!(to_le_bytes)),
        ("binary_big_endian", odd_body!(to_be_bytes)),
    ] {
        let scan = read(Format::Ply, odd_ply(format, &body));
        assert_eq!(scan.cloud.points, arr2(&ODD_POINTS), "{format}");
        assert_eq!(scan.triangles.as_deref(), Some(&[[0, 1, 2], [3, 2, 1], [3, 1, 0]][..]), "{format}");
        let notes =
            ["1 records of element material were ignored", "1 faces with more than 3 corners were cut into triangles"];
        assert_eq!(scan.notes, notes, "{format}");
    }
}

#[test]
fn ply_bytes_after_the_end_and_dos_headers() {
    let cloud = "ply\r\nformat binary_little_endian 1.0\r\nelement vertex 1\r\nproperty uchar x\r\n\
                 property uchar y\r\nproperty uchar z\r\nend_header\r\n\x0a\x0d\x01!!";
    let scan = read(Format::Ply, cloud);
    assert_eq!(scan.cloud.points, arr2(&[[10.0, 13.0, 1.0]]));
    assert_eq!((scan.triangles, scan.notes.len()), (None, 1));
}

#[test]
fn esri_grids_run_from_the_south_west() {
    let expected = arr2(&[
        [100.5, 200.5, 4.0],
        [100.5, 201.5, 1.0],
        [101.5, 200.5, 5.0],
        [101.5, 201.5, 2.0],
        [102.5, 200.5, 6.0],
        [102.5, 201.5, 3.0],
    ]);
    let parameters = arr2(&[[0.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 1.0], [1.0, 0.0], [1.0, 1.0]]);
    for text in [
        "ncols 3\nnrows 2\nxllcorner 100\nyllcorner 200\ncellsize 1\nNODATA_value -9999\n1 2 3\n4 5 6\n",
        "NCOLS 3\r\nNROWS 2\r\nXLLCENTER 100.5\r\nYLLCENTER 200.5\r\nDX 1\r\nDY 1.0\r\n1 2\r\n3 4 5 6 \r\n",
    ] {
        let scan = read(Format::EsriGrid, text);
        assert_eq!(scan.cloud.points, expected);
        assert_eq!(scan.cloud.parameters.as_ref(), Some(&parameters));
        assert_eq!(scan.cloud.grid, Some(GridShape { n_u: 3, n_v: 2 }));
        assert!(scan.notes.is_empty());
    }
}

#[test]
fn esri_cells_without_data_are_skipped() {
    for mark in ["-9999", "nan", "-3.5e38"] {
        let scan = read(
            Format::EsriGrid,
            format!("ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ndx 2\ndy 4\nNODATA_value {mark}\n{mark} 2\n3 4\n"),
        );
        assert_eq!(scan.cloud.points, arr2(&[[1.0, 2.0, 3.0], [3.0, 2.0, 4.0], [3.0, 6.0, 2.0]]));
        assert_eq!(scan.cloud.parameters, Some(arr2(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])));
        assert_eq!((scan.cloud.grid, scan.notes.len()), (None, 1));
        // Cells as the file counts them, its northern line first.
        assert_eq!((scan.rows, scan.cell), (vec![2, 3, 1], Some([2.0, 4.0])));
    }
    // Point lists come with this extension, too.
    let list = read(Format::EsriGrid, "//X Y Z\n0 0 1.5\n1 0 -2\n0 1 3e-3\n");
    assert_eq!((list.format, list.cloud.points), (Format::Xyz, corner()));
}

#[test]
fn gismo_clouds_in_both_layouts() {
    let expected_parameters = arr2(&[[-1.0, 0.5], [0.0, 0.25], [2.0, 1.0]]);
    for text in [
        "<?xml version=\"1.0\"?>\n<xml>\n <Matrix rows=\"3\" cols=\"3\" id=\"1\" format=\"ASCII\">0 1 0\n0 0 1\n1.5 -2 3e-3\n\
         </Matrix>\n<!-- parameters --><Matrix rows=\"2\" cols=\"3\" id=\"0\">-1 0 2 <!-- v -->0.5 0.25 1</Matrix></xml>",
        "\u{feff}<xml><Matrix rows='3' cols='2' id='0'>-1 0.5 0 0.25 2 1</Matrix>\
         <Matrix rows='3' cols='3' id='1'>0 0 1.5 1 0 -2 0 1 3e-3</Matrix><Matrix id='2'/></xml>",
    ] {
        let scan = read(Format::GismoXml, text);
        assert_eq!(scan.cloud.points, corner());
        assert_eq!(scan.cloud.parameters.as_ref(), Some(&expected_parameters));
    }
    let mixed =
        "<xml><Matrix rows='2' cols='1' id='0'>7 8</Matrix><Matrix rows='1' cols='3' id='1'>1 2 3</Matrix></xml>";
    assert_eq!(read(Format::GismoXml, mixed).cloud.points, arr2(&[[1.0, 2.0, 3.0]]));
}

#[test]
fn extensions_in_any_case() {
    for format in Format::ALL {
        for extension in format.extensions() {
            let path = format!("a.b/c.{}", extension.to_uppercase());
            assert_eq!(Format::from_path(path.as_ref()).unwrap(), format);
        }
    }
    let Err(ReadErrorKind::UnknownExtension { extension, supported }) = Format::from_path("scan.TAB".as_ref()) else {
        panic!("tab names no format");
    };
    assert_eq!(extension, "tab");
    assert!(supported.contains(".ply") && supported.contains(".xml"));
    assert!(Format::from_path("ply".as_ref()).is_err());
}

#[test]
fn normals_of_vertices() {
    let normals = [[0.0, 0.0, 1.0], [0.0, 0.5, -1.0], [1.0, 0.0, 0.25]];
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float nx\nproperty float ny\nproperty float x\n\
               property float y\nproperty float z\nproperty float nz\nend_header\n0 0 0 0 1.5 1\n0 0.5 1 0 -2 -1\n1 0 0 1 3e-3 0.25\n";
    let pcd = "FIELDS x y z normal_x normal_y normal_z\nSIZE 4 4 4 4 4 4\nTYPE F F F F F F\nCOUNT 1 1 1 1 1 1\nWIDTH 3\nHEIGHT 1\n\
               DATA ascii\n0 0 1.5 0 0 1\n1 0 -2 0 0.5 -1\n0 1 3e-3 1 0 0.25\n";
    let points = "v 0 0 1.5\nv 1 0 -2\nv 0 1 3e-3\n";
    let vn = "vn 0 0 1\nvn 0 0.5 -1\nvn 1 0 0.25\n";
    let numbered = format!("{points}{vn}f 1//1 2/7/2 3//-1\n");
    let read_normals = |format, text: &str| {
        let scan = read(format, text);
        assert_eq!(scan.cloud.points, corner(), "{text}");
        scan.normals
    };
    for (format, text) in
        [(Format::Ply, ply), (Format::Pcd, pcd), (Format::Obj, &numbered), (Format::Obj, &format!("{points}{vn}"))]
    {
        assert_eq!(read_normals(format, text).as_deref(), Some(&normals[..]), "{text}");
    }
    // A vertex has the sum of the normals at its corners; one that is not finite says nothing.
    let twice = format!("{points}vn 1 0 0\nvn 0 2 0\nvn nan nan nan\nf 1//1 2//1 3//3\nf 1//2 2//1 3//9\n");
    assert_eq!(read_normals(Format::Obj, &twice).unwrap(), [[1.0, 2.0, 0.0], [2.0, 0.0, 0.0], [0.0; 3]]);
    assert_eq!(read_normals(Format::Obj, &format!("{points}vn 0 0 1\nf 1 2 3\n")), None);
}
