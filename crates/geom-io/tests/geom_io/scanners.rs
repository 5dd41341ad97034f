//! Formats of scanners and of printers, compressed text, and the options of reading.

use std::path::Path;

use geom_io::{Format, LengthUnit, ReadErrorKind as Kind, ReadOptions, Scan, parse_scan, read_scan};
use ndarray::{Array2, arr2, aview2};
use point_cloud::GridShape;

use crate::scan_files::variable_chunks;
use crate::scan_files::{
    PCD_POINTS, POINTS, STL_TEXT, e57, equal_points, gzip, las, las_with_record, pcd_binary, pcd_compressed, pcd_text,
    stl,
};

fn read(format: Format, bytes: impl AsRef<[u8]>) -> Scan {
    parse_scan(bytes.as_ref(), format, &ReadOptions::default()).unwrap()
}

fn read_with(format: Format, bytes: impl AsRef<[u8]>, options: ReadOptions) -> Result<Scan, Kind> {
    parse_scan(bytes.as_ref(), format, &options)
}

fn columns(names: &[&str]) -> ReadOptions {
    ReadOptions { columns: names.iter().map(|&name| name.to_owned()).collect(), ..ReadOptions::default() }
}

fn classes(classes: &[u8]) -> ReadOptions {
    ReadOptions { classes: classes.to_vec(), ..ReadOptions::default() }
}

fn height_field() -> ReadOptions {
    ReadOptions { height_field: true, ..ReadOptions::default() }
}

#[test]
fn las_and_laz_in_old_and_new_point_formats() {
    for point_format in [0, 1, 3, 6, 7] {
        for compressed in [false, true] {
            let bytes = las(point_format, compressed);
            let scan = read(Format::Las, &bytes);
            assert_eq!(scan.cloud.points, aview2(&POINTS), "{point_format} {compressed}");
            assert!(scan.notes[0].starts_with("1 points are marked as withheld"), "{:?}", scan.notes);
            assert!(scan.notes[1].contains("2 (2 points), 5 (1 points), 6 (1 points)"), "{:?}", scan.notes);

            let picked = read_with(Format::Las, &bytes, classes(&[6, 2])).unwrap();
            assert_eq!(picked.cloud.points, aview2(&[POINTS[0], POINTS[2], POINTS[3]]));
            assert_eq!((scan.rows, picked.rows), (vec![0, 1, 2, 3], vec![0, 2, 3]));
            let none = read_with(Format::Las, &bytes, classes(&[9])).unwrap_err();
            assert!(matches!(&none, Kind::NoPointsOfClass { wanted, found } if wanted == &[9] && found.len() == 3));
        }
    }
}

#[test]
fn laz_in_chunks_of_any_length() {
    for count in [1, 999, 70_000] {
        let bytes = variable_chunks(count);
        assert_eq!(read(Format::Las, &bytes).cloud.points.nrows(), count);
    }
}

#[test]
fn laz_counts_by_what_it_expands_to() {
    let bytes = equal_points(60_000);
    let error = read_with(Format::Las, &bytes, ReadOptions::default()).unwrap_err();
    assert!(matches!(error, Kind::Expansion { .. }) && error.to_string().contains("allow more"), "{error}");
    let more = ReadOptions { max_expand: Some(100_000), ..ReadOptions::default() };
    assert_eq!(read_with(Format::Las, &bytes, more).unwrap().cloud.points.nrows(), 60_000);
    assert_eq!(read(Format::Las, equal_points(1000)).cloud.points.nrows(), 1000);
}

/// The unit of lengths in well-known text is the last one, and in GeoTIFF the key 3076.
#[test]
fn las_with_a_unit() {
    let geographic = "GEOGCS[\"a\",UNIT[\"degree\",0.0174532925]]";
    for (text, unit) in [
        (format!("PROJCS[\"a\",{geographic},UNIT[\"metre\",1]]"), Some(LengthUnit::Metre)),
        (format!("PROJCS[\"a\",{geographic},UNIT[\"US survey foot\",0.3048006]]"), Some(LengthUnit::Foot)),
        (geographic.to_owned(), None),
        ("no text of the kind".to_owned(), None),
    ] {
        assert_eq!(read(Format::Las, las_with_record(2112, text.into_bytes())).unit, unit);
    }
    for (key, value, unit) in [
        (3076, 9001, Some(LengthUnit::Metre)),
        (3076, 9002, Some(LengthUnit::Foot)),
        (3076, 9102, None),
        (4099, 9001, None),
    ] {
        let keys: Vec<u8> = [1, 1, 0, 1, key, 0, 1, value].into_iter().flat_map(u16::to_le_bytes).collect();
        assert_eq!(read(Format::Las, las_with_record(34735, keys)).unit, unit, "{key} {value}");
    }
    assert_eq!(read(Format::Las, las(0, false)).unit, None);
}

#[test]
fn las_that_announces_more_than_it_holds() {
    let mut bytes = las(0, false);
    bytes[107..111].copy_from_slice(&u32::MAX.to_le_bytes());
    let error = read_with(Format::Las, &bytes, ReadOptions::default()).unwrap_err();
    assert!(error.to_string().contains("before the 4294967295 points"), "{error}");
    let mut bytes = las(0, true);
    let points = u32::from_le_bytes(*bytes[96..].first_chunk().unwrap()) as usize;
    let table = i64::from_le_bytes(*bytes[points..].first_chunk().unwrap()) as usize;
    bytes[table + 4..table + 8].copy_from_slice(&u32::MAX.to_le_bytes());
    let error = read_with(Format::Las, &bytes, ReadOptions::default()).unwrap_err();
    assert!(error.to_string().contains("4294967295 chunks"), "{error}");
}

#[test]
fn e57_scans_are_put_together_in_the_frame_of_the_file() {
    let scan = read(Format::E57, e57());
    assert_eq!(scan.cloud.points, aview2(&POINTS));
    let notes = ["the points of 2 scans were put together", "2 points have no valid position and were left out"];
    assert_eq!(scan.notes, notes);
    assert_eq!(scan.rows, [0, 1, 3, 4]);
    assert_eq!(scan.unit, Some(LengthUnit::Metre));
}

#[test]
fn stl_triangles_stay_separate() {
    for bytes in [STL_TEXT.as_bytes().to_vec(), stl(b"made by hand"), stl(b"solid, though binary")] {
        let scan = read(Format::Stl, &bytes);
        let corners = [0, 1, 2, 1, 3, 2].map(|k| POINTS[k]);
        assert_eq!(scan.cloud.points, aview2(&corners));
        assert_eq!(scan.triangles.as_deref(), Some(&[[0, 1, 2], [3, 4, 5]][..]));
    }
    let longer = [stl(b"title"), b"!!".to_vec()].concat();
    assert_eq!(read(Format::Stl, longer).notes, ["2 bytes after the last triangle were ignored"]);
}

#[test]
fn stl_that_is_broken() {
    let whole = stl(b"title");
    let cut = parse_scan(&whole[..whole.len() - 1], Format::Stl, &ReadOptions::default()).unwrap_err();
    assert!(matches!(&cut, Kind::Truncated { expected: 2, found: 1, .. }), "{cut:?}");
    let until = |word: &str| &STL_TEXT[..STL_TEXT.rfind(word).unwrap()];
    let open = |text: &str| parse_scan(text.as_bytes(), Format::Stl, &ReadOptions::default()).unwrap_err();
    assert!(matches!(open(until("endfacet")), Kind::Unclosed { element: "facet", line: 9 }));
    assert!(matches!(open(until("endsolid")), Kind::Unclosed { element: "solid", line: 1 }));
    assert!(matches!(open("solid\nv 1 2 3\n"), Kind::Header { line: 2, .. }));
    assert!(matches!(open("v 1 2 3\n"), Kind::Malformed { format: "STL", .. }));
    let mut nan = whole;
    nan[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
    let left = read(Format::Stl, nan);
    assert_eq!((left.rows, left.triangles), (vec![1, 2, 3, 4, 5], Some(vec![[2, 3, 4]])));
    assert_eq!(left.notes, ["1 points are not a number (nothing was seen there) and were left out, with 1 triangles"]);
}

#[test]
fn pcd_in_all_encodings() {
    for bytes in [pcd_text(), pcd_binary(), pcd_compressed()] {
        let scan = read(Format::Pcd, &bytes);
        assert_eq!(scan.cloud.points, aview2(&PCD_POINTS));
        assert_eq!(scan.cloud.grid, Some(GridShape { n_u: 2, n_v: 2 }));
        for end in 0..bytes.len() - 1 {
            let read = parse_scan(&bytes[..end], Format::Pcd, &ReadOptions::default());
            assert!(read.is_err(), "cut at {end} of {}: {read:?}", bytes.len());
        }
    }
}

#[test]
fn pcd_pixels_that_saw_nothing_and_wrong_headers() {
    let header = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nDATA ascii\n";
    let scan = read(Format::Pcd, format!("{header}nan nan nan\n1 2 3\n"));
    assert_eq!((scan.cloud.points, scan.rows, scan.notes.len()), (arr2(&[[1.0, 2.0, 3.0]]), vec![1], 1));
    let fail = |text: String| parse_scan(text.as_bytes(), Format::Pcd, &ReadOptions::default()).unwrap_err();
    assert!(matches!(fail(format!("{header}1 2 3\n")), Kind::Truncated { expected: 2, found: 1, .. }));
    assert_eq!(read(Format::Pcd, format!("{header}1 2 3\n1 2 inf\n")).rows, [0]);
    assert!(matches!(fail(format!("{header}nan 2 3\n1 2 inf\n")), Kind::NoneFinite { points: 2 }));
    assert!(matches!(fail(header.replace("x y z", "x y w")), Kind::ColumnsNotFound { .. }));
    for (from, to) in
        [("TYPE F", "TYPE C"), ("SIZE 4", "SIZE 3"), ("ascii", "zip"), ("COUNT 1", "COUNT"), ("WIDTH", "W")]
    {
        assert!(matches!(fail(header.replace(from, to)), Kind::Header { .. }), "{to}");
    }
    let huge = header.replace("WIDTH 2", "WIDTH 9999999999999999999").replace("ascii", "binary");
    assert!(matches!(fail(huge), Kind::Truncated { found: 0, .. }));
    let wide = header.replace("COUNT 1 1 1", "COUNT 1 18446744073709551615 18446744073709551615");
    assert!(matches!(fail(wide.clone() + "1 2 3\n"), Kind::RowLength { expected: usize::MAX, .. }));
    assert!(matches!(fail(wide.replace("ascii", "binary")), Kind::Truncated { found: 0, .. }));
}

#[test]
fn gzip_of_any_format() {
    let text = "0 0 1.5\n1 0 -2\n0 1 0.25\n1 1 8\n";
    assert_eq!(read(Format::Xyz, gzip(text)).cloud.points, aview2(&POINTS));
    assert_eq!(read(Format::Las, gzip(las(0, false))).cloud.points, aview2(&POINTS));
    // Members one behind the other are one file.
    let members = [gzip(&text[..8]), gzip(&text[8..])].concat();
    assert_eq!(read(Format::Xyz, members).cloud.points, aview2(&POINTS));
    let whole = gzip(text);
    for end in 3..whole.len() {
        let error = parse_scan(&whole[..end], Format::Xyz, &ReadOptions::default()).unwrap_err();
        assert!(matches!(error, Kind::Malformed { format: "gzip", .. }), "cut at {end}: {error:?}");
    }
    assert!(matches!(read_with(Format::Xyz, gzip(""), ReadOptions::default()), Err(Kind::Empty)));
}

#[test]
fn the_format_of_a_path() {
    for (path, format) in [("a.csv.gz", Format::Csv), ("a.b.PLY.GZ", Format::Ply), ("a.laz", Format::Las)] {
        assert_eq!(Format::from_path(Path::new(path)).unwrap(), format, "{path}");
    }
    for path in ["a.gz", "a.tab", "a.tab.gz", "gz"] {
        assert!(matches!(Format::from_path(Path::new(path)), Err(Kind::UnknownExtension { .. })), "{path}");
    }
    let error = read_scan(Path::new("-"), &ReadOptions::default()).unwrap_err();
    assert!(matches!(error.kind, Kind::FormatNeeded));
}

#[test]
fn columns_by_name_and_by_number() {
    let expected: Array2<f64> = arr2(&[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    let named = "id,z,x_km,Y_KM\n7,3,1,2\n8,6,4,5\n";
    let plain = "7 3 1 2\n8 6 4 5 red\n";
    for (format, text, names) in [
        (Format::Csv, named, &["x_km", "y_km", "z"][..]),
        (Format::Csv, named, &["3", "4", "2"]),
        (Format::Csv, "7,3,1,2\n8,6,4,5\n", &["3", "4", "2"]),
        (Format::Xyz, named, &["x_km", "y_km", "z"]),
        (Format::Xyz, plain, &["3", "4", "2"]),
        (Format::EsriGrid, plain, &["3", "4", "2"]),
        (Format::Xyz, &format!("a title 1 2 3\n{plain}"), &["3", "4", "2"]),
        (Format::Xyz, "// a scan\nx y z # names\n1 2 3 // the first\n# none\n4 5 6\n", &["x", "y", "z"]),
    ] {
        assert_eq!(read_with(format, text, columns(names)).unwrap().cloud.points, expected, "{format:?} {text}");
    }
    // Names come before numbers.
    let swapped = read_with(Format::Csv, "2,a,1\n5,6,7\n", columns(&["1", "2"])).unwrap();
    assert_eq!(swapped.cloud.points, arr2(&[[7.0, 5.0]]));

    let fail = |format, text, names: &[&str]| read_with(format, text, columns(names)).unwrap_err();
    assert!(matches!(fail(Format::Xyz, plain, &["1", "9"]), Kind::RowLength { line: 1, expected: 9, found: 4 }));
    assert!(matches!(fail(Format::Xyz, plain, &["1", "99999999999999999"]), Kind::RowLength { .. }));
    for column in ["x", "0", "-1", ""] {
        assert!(matches!(fail(Format::Xyz, plain, &["1", column]), Kind::ColumnNumber { column: c } if c == column));
    }
    assert!(matches!(fail(Format::Csv, named, &["1", "5"]), Kind::ColumnsNotFound { missing, .. } if missing == ["5"]));
    assert!(fail(Format::Csv, "t,a\n1,2\n", &[]).to_string().contains("no column named x, y; the columns are: t, a"));
}

#[test]
fn options_that_a_format_does_not_have() {
    for (format, bytes, options) in [
        (Format::Stl, STL_TEXT.as_bytes().to_vec(), columns(&["1", "2", "3"])),
        (Format::Xyz, b"1 2 3\n".to_vec(), classes(&[2])),
        (Format::Las, las(0, false), columns(&["x", "y"])),
    ] {
        let error = read_with(format, bytes, options).unwrap_err();
        assert!(matches!(error, Kind::OptionOfOtherFormat { .. }), "{error:?}");
    }
}

#[test]
fn height_fields() {
    let scan = read_with(Format::Xyz, "10 5 1\n30 -5 2\n15 0 3\n", height_field()).unwrap();
    assert_eq!(scan.cloud.points, arr2(&[[10.0, 5.0, 1.0], [30.0, -5.0, 2.0], [15.0, 0.0, 3.0]]));
    assert_eq!(scan.cloud.parameters, Some(arr2(&[[0.0, 1.0], [1.0, 0.0], [0.25, 0.5]])));
    let own = read_with(Format::Csv, "x,y,z,u,v\n1,2,3,0.5,0.25\n", height_field()).unwrap();
    assert_eq!((own.cloud.parameters, own.notes.len()), (Some(arr2(&[[0.5, 0.25]])), 1));
    let wide = read_with(Format::Xyz, "-1e100 0 0\n1e100 1 0\n", height_field()).unwrap();
    assert_eq!(wide.cloud.parameters, Some(arr2(&[[0.0, 0.0], [1.0, 1.0]])));
    let flat = read_with(Format::Xyz, "1 2 3\n4 2 3\n", height_field());
    assert!(matches!(flat, Err(Kind::FlatHeightField { axis: "y", value: 2.0 })));
    assert!(matches!(read_with(Format::Xyz, "1 2\n", height_field()), Err(Kind::HeightFieldColumns { columns: 2 })));
}
