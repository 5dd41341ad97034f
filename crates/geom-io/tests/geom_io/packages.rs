//! Scans in archives, and meshes in packages: zip, 3MF, GLB. Also what is refused of them.

use std::io::{Cursor, Write};
use std::path::Path;

use geom_io::{Format, LengthUnit, ReadErrorKind, ReadOptions, Scan, parse_scan, read_scan};
use serde_json::{Value, json};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::mesh_dialects::{Sheet, rows};
use crate::scan_files::gzip;

fn zip(members: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in members {
        if name.ends_with('/') {
            writer.add_directory(*name, SimpleFileOptions::default()).unwrap();
        } else {
            writer.start_file(*name, SimpleFileOptions::default()).unwrap();
            writer.write_all(bytes).unwrap();
        }
    }
    writer.finish().unwrap().into_inner()
}

fn read_named(name: &str, bytes: &[u8]) -> Result<Scan, ReadErrorKind> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read_scan(&path, &ReadOptions::default()).map_err(|error| error.kind)
}

#[test]
fn an_archive_with_one_scan() {
    let sheet = Sheet::new([6, 4]);
    let (obj, read_me) = (sheet.obj(), &b"about the scan"[..]);
    let packed = gzip(&obj);
    for members in [
        &[("part.obj", obj.as_bytes())][..],
        &[
            ("scans/", b""),
            ("scans/part.OBJ", obj.as_bytes()),
            ("__MACOSX/scans/._part.obj", b"x"),
            ("scans/.DS_Store", b"x"),
        ],
        &[("read me.txt", read_me), ("part.obj", obj.as_bytes()), ("part.mtl", b"newmtl a"), ("licence.txt", read_me)],
        &[("part.obj.gz", &packed)],
    ] {
        let bytes = zip(members);
        for name in ["scan.zip", "SCAN.ZIP", "scan.xyz", "scan.obj"] {
            let scan = read_named(name, &bytes).unwrap();
            assert_eq!((scan.format, rows(&scan)), (Format::Obj, sheet.points.clone()), "{name}");
            assert_eq!(scan.triangles.as_deref(), Some(&sheet.triangles[..]));
            assert!(scan.notes.iter().any(|note| note.contains("zip archive")), "{:?}", scan.notes);
        }
        assert_eq!(read_named("scan.zip.gz", &gzip(&bytes)).unwrap().format, Format::Obj);
    }
    // A name without a known extension, where the archive's own name or nothing tells the format.
    let unnamed = zip(&[("part", obj.as_bytes())]);
    assert_eq!(read_named("scan.obj", &unnamed).unwrap().triangles.unwrap(), sheet.triangles);
    assert!(matches!(read_named("scan.zip", &unnamed), Err(ReadErrorKind::UnknownExtension { .. })));
    assert!(parse_scan(&unnamed, Format::Obj, &ReadOptions::default()).is_ok());
}

#[test]
fn an_archive_without_one_scan() {
    let two = zip(&[("a.ply", b"ply"), ("b.ply", b"ply"), ("c.txt", b"1 2 3")]);
    let error = read_named("scan.zip", &two).unwrap_err();
    assert!(
        matches!(&error, ReadErrorKind::Archive { scans: 3, files } if files[..2] == ["a.ply", "b.ply"]),
        "{error:?}"
    );
    assert!(error.to_string().contains("\"a.ply\", \"b.ply\""), "{error}");
    let none = read_named("scan.zip", &zip(&[("a.doc", b"x"), ("b.doc", b"x")])).unwrap_err();
    assert!(matches!(none, ReadErrorKind::Archive { scans: 0, .. }));
    assert!(matches!(read_named("scan.zip", &zip(&[("empty/", b"")])), Err(ReadErrorKind::Archive { scans: 0, .. })));
    let whole = zip(&[("part.obj", Sheet::new([6, 4]).obj().as_bytes())]);
    for end in 4..whole.len() {
        assert!(read_named("scan.zip", &whole[..end]).is_err(), "cut at {end}");
    }
    // A file of equal bytes expands a thousand times.
    let bomb = zip(&[("part.xyz", &vec![b'0'; 4 << 20])]);
    assert!(matches!(read_named("scan.zip", &bomb), Err(ReadErrorKind::Expansion { .. })));
}

/// The parts of a 3MF package of one model.
fn three_mf(model: &str) -> Vec<u8> {
    zip(&[
        ("[Content_Types].xml", b"<Types/>"),
        ("_rels/.rels", b"<Relationships/>"),
        ("3D/3dmodel.model", model.as_bytes()),
    ])
}

fn mesh_element(sheet: &Sheet) -> String {
    let vertices: String =
        sheet.points.iter().map(|[x, y, z]| format!("<vertex x=\"{x}\" y=\"{y}\" z=\"{z}\"/>")).collect();
    let triangles: String = sheet
        .triangles
        .iter()
        .map(|[a, b, c]| format!("<triangle v1=\"{a}\" v2=\"{b}\" v3=\"{c}\" pid=\"7\"/>"))
        .collect();
    format!("<mesh><vertices>{vertices}</vertices><triangles>\n{triangles}</triangles></mesh>")
}

const XMLNS: &str = "xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\"";

fn read_3mf(model: &str) -> Result<Scan, ReadErrorKind> {
    parse_scan(&three_mf(model), Format::ThreeMf, &ReadOptions::default())
}

#[test]
fn three_mf_meshes_stand_where_the_build_puts_them() {
    let sheet = Sheet::new([5, 4]);
    let mesh = mesh_element(&sheet);
    for (unit, expected) in [
        ("", LengthUnit::Millimetre),
        ("unit=\"micron\"", LengthUnit::Micrometre),
        ("unit=\"centimeter\"", LengthUnit::Centimetre),
        ("unit=\"inch\"", LengthUnit::Inch),
        ("unit=\"foot\"", LengthUnit::Foot),
        ("unit=\"meter\"", LengthUnit::Metre),
    ] {
        let model = format!(
            "\u{feff}<?xml version=\"1.0\"?><model {unit} {XMLNS}><resources><object id=\"2\">{mesh}</object></resources>\
             <build><item objectid=\"2\"/></build></model>"
        );
        let scan = read_3mf(&model).unwrap();
        assert_eq!(
            (scan.unit, rows(&scan), scan.triangles.unwrap()),
            (Some(expected), sheet.points.clone(), sheet.triangles.clone())
        );
    }
    // Twice, by way of a component that is shifted in an item that is turned about; a support; an object that is not built.
    let model = format!(
        "<model {XMLNS}><resources><object id=\"2\">{mesh}</object><object id=\"9\">{mesh}</object>\
         <object id=\"4\" type=\"support\">{mesh}</object>\
         <object id=\"3\"><components><component objectid=\"2\"/><component objectid=\"2\" transform=\"1 0 0 0 1 0 0 0 1 100 0 0\"/>\
         </components></object></resources><build><item objectid=\"3\" transform=\"0 1 0 -1 0 0 0 0 1 0 0 5\"/>\
         <item objectid=\"4\"/></build></model>"
    );
    let scan = read_3mf(&model).unwrap();
    let place = |shift: f64| move |[x, y, z]: &[f64; 3]| [-*y, *x + shift, *z + 5.0];
    let expected: Vec<_> = sheet.points.iter().map(place(0.0)).chain(sheet.points.iter().map(place(100.0))).collect();
    assert_eq!(rows(&scan), expected);
    assert_eq!(scan.triangles.as_ref().unwrap().len(), 2 * sheet.triangles.len());
    assert_eq!(
        scan.triangles.unwrap()[sheet.triangles.len()],
        sheet.triangles[0].map(|k| k + sheet.points.len() as u32)
    );
    assert_eq!(scan.notes, ["1 supports of the print were left out"]);
    // A mirror turns triangles, so that they look outward as before.
    let mirrored = format!(
        "<model {XMLNS}><resources><object id=\"2\">{mesh}</object></resources><build>\
         <item objectid=\"2\" transform=\"-1 0 0 0 1 0 0 0 1 0 0 0\"/></build></model>"
    );
    let [a, b, c] = sheet.triangles[0];
    assert_eq!(read_3mf(&mirrored).unwrap().triangles.unwrap()[0], [b, a, c]);
}

#[test]
fn three_mf_with_objects_in_other_parts() {
    let sheet = Sheet::new([3, 3]);
    let root = format!(
        "<model {XMLNS} xmlns:p=\"production\"><resources><object id=\"1\"><components>\
         <component p:path=\"/3D/Objects/a_1.model\" objectid=\"1\"/></components></object></resources>\
         <build><item objectid=\"1\"/></build></model>"
    );
    let part = format!(
        "<model {XMLNS} unit=\"millimeter\"><resources><object id=\"1\">{}</object></resources></model>",
        mesh_element(&sheet)
    );
    let bytes = zip(&[("3D/Objects/a_1.model", part.as_bytes()), ("3D/3dmodel.model", root.as_bytes())]);
    for name in ["a.3mf", "a.zip"] {
        let scan = read_named(name, &bytes).unwrap();
        assert_eq!((scan.format, rows(&scan)), (Format::ThreeMf, sheet.points.clone()));
    }
    let alone = zip(&[("3D/3dmodel.model", root.as_bytes())]);
    assert!(matches!(read_named("a.3mf", &alone), Err(ReadErrorKind::Malformed { format: "3MF", .. })));
    assert!(read_named("a.3mf", b"PK\x03\x04").is_err());
    assert!(read_named("a.3mf", b"no archive").is_err());
    assert!(read_named("a.3mf", &zip(&[("part.obj", sheet.obj().as_bytes())])).is_ok());
}

#[test]
fn three_mf_that_is_broken() {
    let model = |objects: &str, build: &str| {
        format!("<model {XMLNS}><resources>{objects}</resources><build>{build}</build></model>")
    };
    let item = "<item objectid=\"1\"/>";
    let corner = "<object id=\"1\"><mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/></vertices></mesh></object>";
    assert!(matches!(
        read_3mf(&model(&corner.replace("z=\"0\"", "z=\"o\""), item)),
        Err(ReadErrorKind::NotANumber { .. })
    ));
    assert!(matches!(read_3mf(&model(&corner.replace(" z=\"0\"", ""), item)), Err(ReadErrorKind::NotANumber { .. })));
    let far = corner.replace("</vertices>", "</vertices><triangles><triangle v1=\"0\" v2=\"0\" v3=\"1\"/></triangles>");
    assert!(matches!(read_3mf(&model(&far, item)), Err(ReadErrorKind::IndexOutOfRange { index: 1, count: 1, .. })));
    assert!(matches!(read_3mf(&model(corner, "<item objectid=\"5\"/>")), Err(ReadErrorKind::Malformed { .. })));
    assert!(matches!(read_3mf(&model("", "")), Err(ReadErrorKind::NoPoints)));
    assert_eq!(read_3mf(&model(corner, "")).unwrap().notes, ["nothing is built; all objects were read as they are"]);
    assert!(matches!(read_3mf("<model"), Err(ReadErrorKind::Xml { .. })));
    let whole = model(corner, item).into_bytes();
    for at in 0..whole.len() {
        let _ = parse_scan(&three_mf(&String::from_utf8_lossy(&whole[..at])), Format::ThreeMf, &ReadOptions::default());
        for byte in [b'<', b'"', b'9', b'-', 0] {
            let mut changed = whole.clone();
            changed[at] = byte;
            let _ = parse_scan(&three_mf(&String::from_utf8_lossy(&changed)), Format::ThreeMf, &ReadOptions::default());
        }
    }
    // In circles, and 10 to the 9th.
    let circle = "<object id=\"1\"><components><component objectid=\"1\"/></components></object>";
    assert!(matches!(read_3mf(&model(circle, item)), Err(ReadErrorKind::Malformed { .. })));
    let mut tower = corner.to_owned();
    for level in 2..12 {
        let ten = format!("<component objectid=\"{}\"/>", level - 1).repeat(10);
        tower += &format!("<object id=\"{level}\"><components>{ten}</components></object>");
    }
    let built = read_3mf(&model(&tower, "<item objectid=\"11\"/>"));
    assert!(matches!(built, Err(ReadErrorKind::Expansion { .. })), "{built:?}");
}

/// A GLB file of a description and its buffer.
fn glb(mut description: Value, buffer: &[u8]) -> Vec<u8> {
    description["asset"] = json!({"version": "2.0"});
    description["buffers"] = json!([{"byteLength": buffer.len()}]);
    let mut text = description.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut buffer = buffer.to_vec();
    buffer.resize(buffer.len().next_multiple_of(4), 0);
    let length = (12 + 8 + text.len() + 8 + buffer.len()) as u32;
    let mut bytes = [&b"glTF"[..], &2_u32.to_le_bytes(), &length.to_le_bytes()].concat();
    for (kind, part) in [(b"JSON", text), (b"BIN\0", buffer)] {
        bytes.extend((part.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(part);
    }
    bytes
}

/// A sheet as a mesh, and nodes that place it.
fn sheet_glb(sheet: &Sheet, nodes: Value, roots: &[usize]) -> Vec<u8> {
    let mut buffer: Vec<u8> = sheet.points.iter().flatten().flat_map(|&c| (c as f32).to_le_bytes()).collect();
    let indices = buffer.len();
    buffer.extend(sheet.triangles.iter().flatten().flat_map(|&k| (k as u16).to_le_bytes()));
    let bound = |k: usize, pick: fn(f64, f64) -> f64| sheet.points.iter().map(|p| p[k]).reduce(pick).unwrap();
    let corner = |pick: fn(f64, f64) -> f64| [0, 1, 2].map(|k| bound(k, pick));
    let description = json!({
        "scene": 0,
        "scenes": [{"nodes": roots}],
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": sheet.points.len(), "type": "VEC3", "min": corner(f64::min), "max": corner(f64::max)},
            {"bufferView": 1, "componentType": 5123, "count": 3 * sheet.triangles.len(), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": indices},
            {"buffer": 0, "byteOffset": indices, "byteLength": buffer.len() - indices},
        ],
    });
    glb(description, &buffer)
}

#[test]
fn glb_meshes_stand_where_the_nodes_put_them() {
    let read = |bytes: &[u8]| parse_scan(bytes, Format::Glb, &ReadOptions::default());
    for size in [[2, 2], [13, 9]] {
        let sheet = Sheet::new(size);
        let scan = read(&sheet_glb(&sheet, json!([{"mesh": 0}]), &[0])).unwrap();
        assert_eq!(
            (rows(&scan), scan.triangles.unwrap(), scan.unit),
            (sheet.points.clone(), sheet.triangles.clone(), None)
        );
        // Shifted within turned about.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let nodes = json!([{"children": [1], "rotation": [0.0, 0.0, half, half]}, {"mesh": 0, "translation": [100.0, 0.0, 0.0]}, {"mesh": 0}]);
        let scan = read(&sheet_glb(&sheet, nodes, &[0])).unwrap();
        let placed = rows(&scan);
        let off = placed.iter().zip(&sheet.points).map(|(p, [x, y, z])| {
            [p[0] + y, p[1] - x - 100.0, p[2] - z].into_iter().fold(0.0, |m: f64, d| m.max(d.abs()))
        });
        assert!(off.fold(0.0, f64::max) < 1e-4);
        // A mirror turns triangles.
        let scan = read(&sheet_glb(&sheet, json!([{"mesh": 0, "scale": [-1.0, 1.0, 1.0]}]), &[0])).unwrap();
        let [a, b, c] = sheet.triangles[0];
        assert_eq!(scan.triangles.unwrap()[0], [b, a, c]);
    }
}

#[test]
fn glb_that_is_broken() {
    let read = |bytes: &[u8]| parse_scan(bytes, Format::Glb, &ReadOptions::default());
    let sheet = Sheet::new([4, 4]);
    let whole = sheet_glb(&sheet, json!([{"mesh": 0}]), &[0]);
    for end in 0..whole.len() {
        assert!(read(&whole[..end]).is_err(), "cut at {end}");
        for byte in [0, 0x7f, 0xff] {
            let mut changed = whole.clone();
            changed[end] = byte;
            let _ = read(&changed);
        }
    }
    let circle = sheet_glb(&sheet, json!([{"mesh": 0, "children": [1]}, {"children": [0]}]), &[0]);
    assert!(matches!(read(&circle), Err(ReadErrorKind::Malformed { .. })));
    let elsewhere = json!({"scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 9, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 108}]});
    assert!(matches!(read(&glb(elsewhere, &[0; 36])), Err(ReadErrorKind::Malformed { .. })));
    // Millions of points that are not in the file.
    let sparse = json!({"scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"componentType": 5126, "count": 900_000_000, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1],
            "sparse": {"count": 1, "indices": {"bufferView": 0, "componentType": 5121}, "values": {"bufferView": 0}}}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 36}]});
    assert!(matches!(read(&glb(sparse, &[0; 36])), Err(ReadErrorKind::Expansion { .. })));
    let objects = json!({"nodes": vec![json!({}); 100_000]});
    assert!(matches!(read(&glb(objects, &[0; 4])), Err(ReadErrorKind::Malformed { .. })));
}

#[test]
fn formats_of_packages_by_name() {
    for (name, format) in [("a.3MF", Format::ThreeMf), ("a.glb", Format::Glb)] {
        assert_eq!(Format::from_path(Path::new(name)).unwrap(), format);
    }
}
