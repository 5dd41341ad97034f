//! Each way in which a file can be wrong has its own error, with the numbers in it.

use geom_io::{Format, Location, ReadErrorKind as Kind, ReadOptions, parse_scan, read_scan};

fn fail(format: Format, bytes: impl AsRef<[u8]>) -> Kind {
    match parse_scan(bytes.as_ref(), format, &ReadOptions::default()) {
        Ok(scan) => panic!("{format:?} was read as {scan:?}"),
        Err(error) => error,
    }
}

/// Asserts that reading fails with an error of this shape.
macro_rules! fails {
    ($format:ident, $bytes:expr, $pattern:pat $(if $guard:expr)?) => {
        let error = fail(Format::$format, $bytes);
        assert!(matches!(&error, $pattern $(if $guard)?), "{error:?}");
    };
}

const PLY_ASCII: &str = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
                         element face 1\nproperty list uchar int vertex_indices\nend_header\n";

fn ply_binary(vertices: &str, faces: &str, body: &[u8]) -> Vec<u8> {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
         property float z\nelement face {faces}\nproperty list char int vertex_indices\nend_header\n"
    );
    [header.as_bytes(), body].concat()
}

#[test]
fn the_path_stands_in_front() {
    let error = read_scan("no/such/scan.ply".as_ref(), &ReadOptions::default()).unwrap_err();
    assert!(matches!(error.kind, Kind::Io(_)));
    assert!(error.to_string().starts_with("no/such/scan.ply: cannot be read: "), "{error}");
    let error = read_scan("scan.tab".as_ref(), &ReadOptions::default()).unwrap_err();
    assert!(matches!(error.kind, Kind::UnknownExtension { .. }));
}

#[test]
fn names_of_a_file_cannot_steer_a_terminal_or_flood_it() {
    for name in ["\u{1b}[2J", "\u{7f}", "a\u{8}b", &"long".repeat(5000)] {
        let properties = format!("property float {name}\n").repeat(100);
        let element =
            format!("ply\nformat ascii 1.0\nelement {name} 1\nproperty float a\nelement vertex 0\nend_header\n");
        let ply = format!("ply\nformat ascii 1.0\nelement vertex 1\n{properties}end_header\n");
        for (format, text) in [
            (Format::Ply, ply),
            (Format::Ply, element),
            (Format::GismoXml, format!("<xml><Matrix id='{name}'/></xml>")),
            (Format::GismoXml, format!("<xml><{name}></xml>")),
            (Format::Csv, format!("{name},x,y,z,{name}{}\n", format!("\n1,2,3,4,{name}").repeat(20))),
        ] {
            let told = parse_scan(text.as_bytes(), format, &ReadOptions::default());
            let messages = told.map_or_else(|error| vec![error.to_string()], |scan| scan.notes);
            assert!(!messages.is_empty(), "{text:?}");
            for message in messages {
                assert!(!message.chars().any(char::is_control), "{message:?}");
                assert!(message.chars().count() < 1500, "{message}");
            }
        }
    }
}

#[test]
fn nothing_in_the_file() {
    for format in Format::ALL {
        for bytes in ["", " \r\n\t\n"] {
            assert!(matches!(fail(format, bytes), Kind::Empty));
        }
    }
    assert!(matches!(fail(Format::Xyz, "\u{feff}"), Kind::Empty));
    fails!(Xyz, "# only words\n", Kind::NoPoints);
    fails!(Xyz, "x y z\n", Kind::NoPoints);
    fails!(Csv, "x,y,z\n", Kind::NoPoints);
    fails!(Csv, "# x,y,z\n", Kind::NoPoints);
    fails!(Obj, "g nothing\n", Kind::NoPoints);
    fails!(Off, "# nothing", Kind::NoPoints);
    fails!(Off, "OFF 0 0 0", Kind::NoPoints);
    fails!(Ply, "ply\nformat ascii 1.0\nend_header\n", Kind::NoPoints);
    let no_data = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n-9999 -9999 -9999 -9999";
    fails!(EsriGrid, no_data, Kind::NoPoints);
    let empty = "<xml><Matrix rows='2' cols='0' id='0'/><Matrix rows='3' cols='0' id='1'/></xml>";
    fails!(GismoXml, empty, Kind::NoPoints);
}

#[test]
fn not_text() {
    let is_text = |format: &Format| {
        use Format::{E57, GeoTiff, Glb, Las, Stl, ThreeMf};
        !matches!(format, Stl | Glb | ThreeMf | GeoTiff | Las | E57)
    };
    for format in Format::ALL.into_iter().filter(is_text) {
        for utf16 in [&b"\xff\xfe1\0 \x002\0"[..], b"1\0 \x002\0 \x003\0", b"\x001\0 \x002\0 \x003"] {
            assert!(matches!(fail(format, utf16), Kind::Utf16), "{format:?}");
        }
        assert!(matches!(fail(format, b"\x89PNG\x1a\x00\x00\xff 1 2 3\n"), Kind::NotText { line: 1 }));
    }
    fails!(Xyz, b"1 2 3\n1 2 \x00\x01\n", Kind::NotText { line: 2 });
    fails!(Csv, b"x,y\n1,2\n1,\x002\n", Kind::NotText { line: 3 });
    fails!(Obj, b"v 1 2 3\n\xff\xd8 1\n", Kind::NotText { line: 2 });
    fails!(Off, b"OFF\n1 0 0\n1 2 \xff\n", Kind::NotText { line: 3 });
    fails!(Ply, [PLY_ASCII.as_bytes(), b"1 2 3\n1 2 \xff\n"].concat(), Kind::NotText { line: 11 });
    fails!(GismoXml, b"<xml>\n\xff</xml>", Kind::NotText { line: 2 });
}

#[test]
fn not_a_number() {
    fails!(Xyz, "1 2 3\n1 two 3\n", Kind::NotANumberInTable { line: 2, column: 2, text } if text == "two");
    fails!(Xyz, "1;2;3\n1.5;2,0;3\n", Kind::AmbiguousComma { line: 2, text } if text == "2,0");
    fails!(Obj, "v 0 0 0x\n", Kind::NotANumber { location: Location::Line(1), .. });
    fails!(Off, "OFF 1 0\n0 x 0\n", Kind::NotANumber { location: Location::Line(2), .. });
    fails!(Ply, format!("{PLY_ASCII}0 0 0\n0 a 0\n"), Kind::NotANumber { location: Location::Line(11), .. });
    let grid = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n3 x";
    fails!(EsriGrid, grid, Kind::NotANumber { location: Location::Line(7), .. });
    let matrix = "<xml><Matrix rows='2' cols='1' id='0'>0 zero</Matrix></xml>";
    fails!(GismoXml, matrix, Kind::NotANumber { location: Location::MatrixValue { id: 0, index: 1 }, .. });
    // Quotations from a file are short.
    fails!(Xyz, format!("1 2 3\n1 2 {}\n", "é".repeat(999)), Kind::NotANumberInTable { text, .. } if text.len() < 100);
}

#[test]
fn not_finite() {
    let one_vertex = PLY_ASCII.replace("vertex 2", "vertex 1").replace("face 1", "face 0");
    for value in ["nan", "inf", "-inf", "1e999"] {
        fails!(Xyz, format!("{value} 2 3\n1 2 {value}\n"), Kind::NoValues { rows: 2, line: 1 });
        fails!(Csv, format!("x,y,u\n1,2,{value}\n"), Kind::NoValues { rows: 1, line: 2 });
        fails!(Obj, format!("v 1 {value} 3\n"), Kind::NoneFinite { points: 1 });
        fails!(Off, format!("OFF 1 0\n1 {value} 3\n"), Kind::NoneFinite { points: 1 });
        fails!(Ply, format!("{one_vertex}{value} 0 0\n"), Kind::NoneFinite { points: 1 });
        let [parameters, points] = [format!("0 {value}"), "0 0 0".to_owned()];
        let matrices = format!(
            "<xml><Matrix rows='2' cols='1' id='0'>{parameters}</Matrix><Matrix rows='3' cols='1' id='1'>{points}</Matrix></xml>"
        );
        fails!(GismoXml, matrices, Kind::NoneFinite { points: 1 });
    }
}

#[test]
fn lines_of_wrong_length() {
    fails!(Xyz, "1\n", Kind::RowLength { line: 1, expected: 2, found: 1 });
    fails!(Xyz, "1 2 3\n1\n", Kind::RowLength { line: 2, expected: 3, found: 1 });
    fails!(Xyz, "1 2 3\n1 2\n", Kind::RowLength { line: 2, expected: 3, found: 2 });
    fails!(Xyz, "1 2\n1 2\n1 2\n1 2 3 4\n", Kind::RowLength { line: 4, expected: 2, found: 4 });
    fails!(Csv, "x,y,z\n1,2\n", Kind::RowLength { line: 2, expected: 3, found: 2 });
    fails!(Csv, "x,y,z\n1,2,3,4\n", Kind::RowLength { line: 2, expected: 3, found: 4 });
    fails!(Obj, "v 1 2\n", Kind::RowLength { line: 1, expected: 3, found: 2 });
    fails!(Off, "OFF 1 0\n1\n", Kind::RowLength { line: 2, expected: 3, found: 1 });
    fails!(Off, "OFF 1 1\n1 2 3\n3 0 0\n", Kind::RowLength { line: 3, expected: 4, found: 3 });
    fails!(Ply, format!("{PLY_ASCII}1 2\n"), Kind::RowLength { line: 10, expected: 3, found: 2 });
    fails!(Ply, format!("{PLY_ASCII}1 2 3 4\n"), Kind::RowLength { line: 10, expected: 3, found: 4 });
    let short_face = format!("{PLY_ASCII}1 2 3\n4 5 6\n3 0 1\n");
    fails!(Ply, short_face, Kind::RowLength { line: 12, expected: 4, found: 3 });
}

#[test]
fn headers() {
    for text in [
        "plyx\n",
        "ply\nformat binary 1.0\n",
        "ply\nelement vertex\n",
        "ply\nelement vertex -1\n",
        "ply\nproperty float x\n",
        "ply\nelement vertex 1\nproperty quad x\n",
        "ply\nelement vertex 1\nproperty list uchar x\n",
        "ply\nelement vertex 1\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex 1\n",
        "ply\nformat ascii 1.0\nvertices 1\n",
    ] {
        fails!(Ply, text, Kind::Header { line, .. } if *line == text.lines().count());
    }
    for text in ["FOO 1 2 3", "OFF BINARY\n", "4OFF 1 0 0", "OFF\n", "OFF\n1\n", "OFF -1 0 0\n"] {
        fails!(Off, text, Kind::Header { line, .. } if *line == text.lines().count());
    }
    for line in ["ncols 2.5", "ncols 0", "ncols", "ncols 2 2", "cellsize -1", "width 4"] {
        fails!(EsriGrid, format!("nrows 2\n{line}\n1 2"), Kind::Header { line: 2, text, .. } if text == line);
    }
    for key in ["ncols", "nrows", "xllcorner", "yllcorner", "cellsize"] {
        let all = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3 4";
        let without: Vec<_> = all.lines().filter(|line| !line.starts_with(key)).collect();
        fails!(EsriGrid, without.join("\n"), Kind::MissingKey { key: missing } if missing.contains(key));
    }
    let narrow = "ncols 1\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2";
    fails!(EsriGrid, narrow, Kind::GridTooSmall { n_u: 1, n_v: 2 });
    let no_z = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty list uchar int z\nproperty int y\nend_header\n";
    fails!(Ply, no_z, Kind::MissingProperty { property: "z", found } if found == &["x", "z", "y"]);
}

#[test]
fn files_cut_off_or_too_long() {
    fails!(Ply, format!("{PLY_ASCII}1 2 3\n"), Kind::Truncated { element, expected: 2, found: 1 } if element == "vertex");
    fails!(Ply, format!("{PLY_ASCII}1 2 3\n1 2 4\n"), Kind::Truncated { element, expected: 1, found: 0 } if element == "face");
    fails!(Ply, ply_binary("2", "0", &[0; 23]), Kind::Truncated { element, expected: 2, found: 1 } if element == "vertex");
    let face_short_of_a_byte = [&[0; 12][..], &[3], &[0; 11]].concat();
    fails!(Ply, ply_binary("1", "7", &face_short_of_a_byte),
        Kind::Truncated { element, expected: 7, found: 0 } if element == "face");
    fails!(Off, "OFF 2 0\n1 2 3\n", Kind::Truncated { element, expected: 2, found: 1 } if element == "vertex");
    fails!(Off, "OFF 1 2\n1 2 3\n3 0 0 0\n", Kind::Truncated { element, expected: 2, found: 1 } if element == "face");
    fails!(Xyz, "3\n1 2 3\n1 2 4\n", Kind::Truncated { element, expected: 3, found: 2 } if element == "point");
    let grid = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3";
    fails!(EsriGrid, grid, Kind::Truncated { element, expected: 4, found: 3 } if element == "cell");
    fails!(EsriGrid, format!("{grid} 4 5"), Kind::Surplus { expected: 4, found: 5 });
}

/// Counts far beyond the file's size neither allocate nor run on.
#[test]
fn counts_beyond_the_file() {
    const HUGE: &str = "9999999999999999999";
    fails!(Ply, ply_binary(HUGE, "0", &[0; 24]), Kind::Truncated { found: 2, .. });
    fails!(Ply, ply_binary("1", HUGE, &[0; 14]), Kind::Truncated { found: 2, .. });
    fails!(Ply, PLY_ASCII.replace("vertex 2", &format!("vertex {HUGE}")), Kind::Truncated { found: 0, .. });
    let no_properties = format!("ply\nformat binary_big_endian 1.0\nelement empty {HUGE}\nend_header\n");
    fails!(Ply, no_properties, Kind::NoPoints);
    fails!(Off, format!("OFF {HUGE} 1\n1 2 3\n"), Kind::Truncated { found: 1, .. });
    fails!(Off, format!("OFF 1 {HUGE}\n1 2 3\n"), Kind::Truncated { found: 0, .. });
    fails!(Off, format!("OFF 1 1\n1 2 3\n{HUGE} 0 0\n"), Kind::RowLength { line: 3, found: 3, .. });
    fails!(Xyz, format!("{HUGE}\n1 2 3\n"), Kind::Truncated { found: 1, .. });
    let grid = format!("ncols {HUGE}\nnrows {HUGE}\nxllcorner 0\nyllcorner 0\ncellsize 1\n1");
    fails!(EsriGrid, grid, Kind::Truncated { found: 1, .. });
    let matrix = format!("<xml><Matrix rows='{HUGE}' cols='{HUGE}' id='0'>0</Matrix></xml>");
    fails!(GismoXml, matrix, Kind::MatrixSize { id: 0, found: 1, .. });
    let long_list = ply_binary("1", "1", &[&[0; 12][..], &[127], &[0; 16]].concat());
    fails!(Ply, long_list, Kind::Truncated { expected: 1, found: 0, .. });
}

#[test]
fn faces() {
    fails!(Obj, "v 0 0 0\nf 1 1 0\n", Kind::IndexOutOfRange { location: Location::Line(2), index: 0, count: 1 });
    fails!(Obj, "v 0 0 0\nf 1 1 -2\n", Kind::IndexOutOfRange { location: Location::Line(2), index: -2, count: 1 });
    fails!(
        Obj,
        "f 1 3 2\nv 0 0 0\nv 0 0 1\n",
        Kind::IndexOutOfRange { location: Location::Line(1), index: 3, count: 2 }
    );
    let huge = "v 0 0 0\nf 1 1 9223372036854775807\n";
    fails!(Obj, huge, Kind::IndexOutOfRange { index: i64::MAX, count: 1, .. });
    fails!(Obj, "v 0 0 0\nf 1 1 -9223372036854775808\n", Kind::IndexOutOfRange { index: i64::MIN, count: 1, .. });
    fails!(Obj, "v 0 0 0\nf 1 1 a/1\n", Kind::NotAnIndex { location: Location::Line(2), text } if text == "a/1");
    fails!(Off, "OFF 1 1\n0 0 0\n3 0 0 1\n", Kind::IndexOutOfRange { location: Location::Line(3), index: 1, count: 1 });
    fails!(Off, "OFF 1 1\n0 0 0\n3 0 0 0.5\n", Kind::NotAnIndex { location: Location::Line(3), .. });
    fails!(Off, "OFF 1 1\n0 0 0\n-3 0 0 0\n", Kind::NotAnIndex { location: Location::Line(3), .. });
    let ply = format!("{PLY_ASCII}0 0 0\n0 0 1\n");
    fails!(Ply, format!("{ply}3 0 1 2\n"), Kind::IndexOutOfRange { location: Location::Line(12), index: 2, count: 2 });
    fails!(Ply, format!("{ply}3 0 1 -1\n"), Kind::IndexOutOfRange { index: -1, .. });
    fails!(Ply, format!("{ply}3 0 1 nan\n"), Kind::NotAnIndex { .. });
    fails!(Ply, format!("{ply}3 0 1 0.5\n"), Kind::NotAnIndex { location: Location::Line(12), .. });
    fails!(Ply, format!("{ply}-3 0 1 0\n"), Kind::ListLength { location: Location::Line(12), .. });
    let negative_length = [&[0; 12][..], &[0xff]].concat();
    fails!(Ply, ply_binary("1", "1", &negative_length),
        Kind::ListLength { location: Location::Record { element, index: 0 }, .. } if element == "face");
}

#[test]
fn columns_and_grids() {
    fails!(Csv, "time,accel\n1,2\n",
        Kind::ColumnsNotFound { missing, found } if missing == &["x", "y"] && found == &["time", "accel"]);
    fails!(Csv, "x,z\n1,2\n", Kind::ColumnsNotFound { missing, .. } if missing == &["y"]);
    fails!(Csv, "x,y,X\n1,2,3\n", Kind::DuplicateColumn { name } if name == "x");
    fails!(Csv, "x,y,u,u\n1,2,3,4\n", Kind::DuplicateColumn { name } if name == "u");
}

#[test]
fn xml() {
    fails!(GismoXml, "<xml><Matrix></xml>", Kind::Xml { reason } if reason.contains("1:"));
    fails!(GismoXml, "<xml><Geometry type='THBSpline2' id='0'/></xml>",
        Kind::HoldsModel { geometry } if geometry == "THBSpline2");
    fails!(GismoXml, "<xml><p/></xml>", Kind::MatrixIds { ids } if ids.is_empty());
    fails!(GismoXml, "<xml><Matrix rows='2' cols='1' id='0'>0 0</Matrix><Matrix id='7'/><Matrix/></xml>",
        Kind::MatrixIds { ids } if ids == &["0", "7", "none"]);
    fails!(GismoXml, "<xml><Matrix id='0'/><Matrix id='0'/><Matrix id='1'/></xml>", Kind::MatrixIds { .. });
    fails!(GismoXml, "<xml><Matrix rows='2' cols='m' id='0'/><Matrix id='1'/></xml>",
        Kind::MatrixAttribute { id: 0, attribute: "cols", value, .. } if value == "m");
    fails!(
        GismoXml,
        "<xml><Matrix cols='1' id='0'/><Matrix id='1'/></xml>",
        Kind::MatrixAttribute { id: 0, attribute: "rows", .. }
    );
    fails!(
        GismoXml,
        "<xml><Matrix rows='2' cols='1' id='0' format='B64Float64'>AAAA</Matrix><Matrix id='1'/></xml>",
        Kind::MatrixAttribute { id: 0, attribute: "format", .. }
    );
    fails!(
        GismoXml,
        "<xml><Matrix rows='2' cols='2' id='0'>1 2 3</Matrix></xml>",
        Kind::MatrixSize { id: 0, rows: 2, cols: 2, found: 3 }
    );
    fails!(
        GismoXml,
        "<xml><Matrix rows='2' cols='1' id='0'>1 2</Matrix><Matrix rows='3' cols='2' id='1'>1 2 3 4 5 6</Matrix></xml>",
        Kind::MatrixShapes { parameters: (2, 1), points: (3, 2) }
    );
    let deep = format!("<xml>{}", "<a>".repeat(200_000));
    fails!(GismoXml, deep, Kind::Xml { .. });
}

/// Every message says in words what is wrong, with the numbers.
#[test]
fn messages_carry_the_numbers() {
    let message = fail(Format::Ply, ply_binary("4", "0", &[0; 30])).to_string();
    assert_eq!(message, "the file is cut off: its header announces 4 records of vertex, 2 are there");
    let message = fail(Format::Csv, "t,a\n1,2\n").to_string();
    assert_eq!(message, "no column named x, y; the columns are: t, a");
    let message = fail(Format::Obj, "v 0 0 0\nf 1 2 1\n").to_string();
    assert_eq!(message, "line 2: vertex index 2, as written, is out of range; the mesh has 1 vertices");
}
