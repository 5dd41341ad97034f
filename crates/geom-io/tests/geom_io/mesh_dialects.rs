//! Meshes as programs write them that do not keep to the letter of a format: each family holds a bent sheet of several sizes.

use geom_io::{Format, ReadErrorKind, ReadOptions, Scan, parse_scan};

use crate::scan_files::gzip;

const SIZES: [[usize; 2]; 4] = [[2, 2], [3, 5], [13, 9], [40, 31]];

/// A sheet of points in rows, in numbers that single precision and six digits hold.
pub(crate) struct Sheet {
    pub(crate) points: Vec<[f64; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
    size: [usize; 2],
}

impl Sheet {
    pub(crate) fn new(size: [usize; 2]) -> Self {
        let [columns, rows] = size;
        let height = |i: usize, j: usize| ((i * i + 3 * i * j) % 17) as f64 / 8.0;
        let points = (0..columns * rows).map(|k| (k % columns, k / columns));
        let points = points.map(|(i, j)| [5.0 * i as f64, 5.0 * j as f64 - 2.5, height(i, j)]).collect();
        let corner = |i: usize, j: usize| (j * columns + i) as u32;
        let triangles =
            (0..(columns - 1) * (rows - 1)).map(|k| (k % (columns - 1), k / (columns - 1))).flat_map(|(i, j)| {
                let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                [[a, b, c], [a, c, d]]
            });
        Self { points, triangles: triangles.collect(), size }
    }

    fn all() -> impl Iterator<Item = Self> {
        SIZES.into_iter().map(Self::new)
    }

    fn vertex_lines(&self, word: &str) -> String {
        self.points.iter().map(|[x, y, z]| format!("{word}{x} {y} {z}\n")).collect()
    }

    pub(crate) fn obj(&self) -> String {
        let faces: String =
            self.triangles.iter().map(|t| t.map(|k| k + 1)).map(|[a, b, c]| format!("f {a} {b} {c}\n")).collect();
        self.vertex_lines("v ") + &faces
    }

    fn ply(&self, types: [&str; 3], body: &str) -> String {
        let [float, length, index] = types;
        format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty {float} x\nproperty {float} y\nproperty {float} z\nelement face {}\n\
             property list {length} {index} vertex_indices\nend_header\n{body}",
            self.points.len(),
            self.triangles.len()
        )
    }

    fn face_lines(&self) -> String {
        self.triangles.iter().map(|[a, b, c]| format!("3 {a} {b} {c}\n")).collect()
    }

    fn soup(&self) -> Vec<[f64; 3]> {
        self.triangles.iter().flatten().map(|&corner| self.points[corner as usize]).collect()
    }

    fn stl(&self, title: &[u8], count: u32) -> Vec<u8> {
        let mut bytes = title.to_vec();
        bytes.resize(80, 0);
        bytes.extend(count.to_le_bytes());
        for triangle in self.soup().chunks(3) {
            bytes.extend([0; 12]);
            bytes.extend(triangle.iter().flatten().flat_map(|&c| (c as f32).to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    #[track_caller]
    fn is_in(&self, scan: &Scan) {
        self.is_cloud(scan);
        assert_eq!(scan.triangles.as_deref(), Some(&self.triangles[..]));
    }

    #[track_caller]
    fn is_cloud(&self, scan: &Scan) {
        assert_eq!(rows(scan), self.points);
    }

    #[track_caller]
    fn is_soup(&self, scan: &Scan) {
        assert_eq!(rows(scan), self.soup());
        assert_eq!(scan.triangles.as_ref().map(Vec::len), Some(self.triangles.len()));
    }
}

pub(crate) fn rows(scan: &Scan) -> Vec<[f64; 3]> {
    scan.cloud.points.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect()
}

#[track_caller]
fn read(format: Format, bytes: impl AsRef<[u8]>) -> Scan {
    fail_or_read(format, bytes).unwrap()
}

fn fail_or_read(format: Format, bytes: impl AsRef<[u8]>) -> Result<Scan, ReadErrorKind> {
    parse_scan(bytes.as_ref(), format, &ReadOptions::default())
}

#[test]
fn obj_lines_go_on_behind_a_backslash() {
    for sheet in Sheet::all() {
        let text = sheet.obj();
        for continued in [
            text.replace(' ', " \\\n"),
            text.replacen(' ', " \\\r\n  ", 7),
            text.replace("f ", "f\\\n"),
            format!("# folder C:\\scans\\\n{text}vn 0 0 1 \\\n\nvp 0 0\\"),
        ] {
            sheet.is_in(&read(Format::Obj, continued));
        }
    }
}

#[test]
fn obj_weights_divide() {
    for sheet in Sheet::all() {
        for w in [2.0, 0.5, -4.0] {
            let line = |[x, y, z]: &[f64; 3]| format!("v {} {} {} {w} # c\n", w * x, w * y, w * z);
            let scan = read(Format::Obj, sheet.points.iter().map(line).collect::<String>());
            sheet.is_cloud(&scan);
            assert_eq!(
                scan.notes,
                [format!("{} vertices have a weight w; x, y and z were divided by it", sheet.points.len())]
            );
        }
        for more in ["1.0", "0.5 0.5 0.5", "2 0.5 0.5 0.5"] {
            let line = |[x, y, z]: &[f64; 3]| format!("v {x} {y} {z} {more}\n");
            sheet.is_cloud(&read(Format::Obj, sheet.points.iter().map(line).collect::<String>()));
        }
        // A point at infinity is none.
        let infinite = read(Format::Obj, sheet.obj() + "v 1 2 3 0\n");
        sheet.is_in(&infinite);
        assert_eq!(infinite.notes.len(), 2);
    }
}

#[test]
fn obj_polylines_are_told() {
    let sheet = Sheet::new([3, 3]);
    let scan = read(Format::Obj, sheet.obj() + "vn 0 0 1\nl 1 2 3\nl 4//1 5//1\np 1\n");
    sheet.is_in(&scan);
    assert_eq!(scan.notes, ["2 polylines were ignored; their points were read"]);
}

#[test]
fn binary_stl_is_as_long_as_it_is() {
    for sheet in Sheet::all() {
        let count = sheet.triangles.len() as u32;
        for title in [&b"scanner stream"[..], b"solid part exported"] {
            for announced in [count, 0, u32::MAX, count / 2, 1] {
                let scan = read(Format::Stl, sheet.stl(title, announced));
                sheet.is_soup(&scan);
                assert_eq!(scan.notes.len(), usize::from(announced != count), "{:?}", scan.notes);
            }
            for (announced, rest) in [(count, &b"\r\n"[..]), (count, &[0xff; 50]), (0, b"!"), (u32::MAX, b"end")] {
                let scan = read(Format::Stl, [&sheet.stl(title, announced), rest].concat());
                sheet.is_soup(&scan);
                assert!(scan.notes.last().unwrap().contains("after the last triangle"), "{:?}", scan.notes);
            }
            // The count is too small, and other bytes stand at the end: fewer than a triangle has, text, zeros.
            for rest in
                [&b"end"[..], b"exported by a program, with four views of the part and its colours, in 2026", &[0; 120]]
            {
                let scan = read(Format::Stl, [&sheet.stl(title, 1), rest].concat());
                sheet.is_soup(&scan);
                assert_eq!(scan.notes.len(), 1 + usize::from(count > 1), "{:?}", scan.notes);
            }
            let cut = fail_or_read(Format::Stl, sheet.stl(title, count + 1));
            assert!(matches!(cut, Err(ReadErrorKind::Truncated { .. })), "{cut:?}");
        }
    }
}

#[test]
fn stl_text_in_two_words_and_with_colours() {
    for sheet in Sheet::all() {
        let soup = sheet.soup();
        let facet = |corners: &[[f64; 3]]| {
            let corners: String = corners.iter().map(|[x, y, z]| format!("   vertex {x} {y} {z}\n")).collect();
            format!(" facet normal 0 0 1\n  outer loop\n{corners}  endloop\n endfacet\n")
        };
        let text = format!("solid sheet\n{}endsolid sheet\n", soup.chunks(3).map(facet).collect::<String>());
        for text in [
            text.replace("end", "end "),
            text.replace(" facet", " color 0.8 0.8 0.8\n facet"),
            text.to_uppercase(),
            format!("{text}{}", "solid empty\nendsolid\n"),
            text.replace('\n', "\r\n"),
        ] {
            sheet.is_soup(&read(Format::Stl, text));
        }
        let mut latin = text.clone().into_bytes();
        latin[6] = 0xe9;
        sheet.is_soup(&read(Format::Stl, latin));
    }
}

#[test]
fn ply_types_by_all_their_names() {
    for sheet in Sheet::all() {
        let body = sheet.vertex_lines("") + &sheet.face_lines();
        for types in [
            ["float", "uchar", "int"],
            ["double", "uint8_t", "int64"],
            ["float64", "uint8", "uint64_t"],
            ["Float32", "UCHAR", "long"],
            ["float32_t", "ulong", "uint32_t"],
        ] {
            sheet.is_in(&read(Format::Ply, sheet.ply(types, &body)));
        }
        let upper = sheet.ply(["float", "uchar", "int"], &body).replace(" x\n", " X\n").replace(" y\n", " Y\n");
        let upper = upper
            .replace(" z\n", " Z\n")
            .replace("vertex_indices", "Vertex_Indices")
            .replace("element vertex", "element Vertex");
        sheet.is_in(&read(Format::Ply, upper));
        // Binary: a number of 64 bits before and behind each vertex.
        for big_endian in [false, true] {
            let order = if big_endian { "big" } else { "little" };
            let mut bytes = format!(
                "ply\nformat binary_{order}_endian 1.0\nelement vertex {}\nproperty int64 id\nproperty double x\nproperty double y\n\
                 property double z\nproperty ulong time\nend_header\n",
                sheet.points.len()
            )
            .into_bytes();
            let number = |bytes: [u8; 8]| if big_endian { bytes.into_iter().rev().collect() } else { bytes.to_vec() };
            for (k, point) in sheet.points.iter().enumerate() {
                bytes.extend(number((-(k as i64)).to_le_bytes()));
                point.iter().for_each(|c| bytes.extend(number(c.to_le_bytes())));
                bytes.extend(number(u64::MAX.to_le_bytes()));
            }
            sheet.is_cloud(&read(Format::Ply, bytes));
        }
    }
}

#[test]
fn ply_with_one_value_a_line() {
    for sheet in Sheet::all() {
        let vertices = sheet.vertex_lines("").replace(' ', "\n");
        let types = ["float", "uchar", "int"];
        sheet.is_in(&read(Format::Ply, sheet.ply(types, &(vertices.clone() + &sheet.face_lines()))));
        sheet.is_in(&read(Format::Ply, sheet.ply(types, &(vertices.clone() + &sheet.face_lines().replace(' ', "\n")))));
        let cut = fail_or_read(Format::Ply, sheet.ply(types, &vertices[..vertices.len() - 4]));
        assert!(matches!(cut, Err(ReadErrorKind::Truncated { .. })), "{cut:?}");
        let mixed = vertices.replacen('\n', " ", 5).replacen(' ', "\n", 4);
        let mixed = fail_or_read(Format::Ply, sheet.ply(types, &mixed));
        assert!(matches!(mixed, Err(ReadErrorKind::RowLength { line: 14, expected: 1, found: 2 })), "{mixed:?}");
    }
}

#[test]
fn ply_strips_of_triangles() {
    for sheet in Sheet::all() {
        let [columns, rows] = sheet.size;
        // One strip from row to row, ended by −1.
        let strip = |j: usize| -> String {
            (0..columns).map(|i| format!("{} {} ", j * columns + i, (j + 1) * columns + i)).collect::<String>()
        };
        let strips: Vec<String> = (0..rows - 1).map(strip).collect();
        let joined = strips.join("-1 ");
        let body = format!("{}{} {joined}\n", sheet.vertex_lines(""), joined.split_whitespace().count());
        let text = sheet.ply(["float", "int", "int"], &body).replace("element face", "element tristrips");
        let count = sheet.triangles.len();
        let scan = read(Format::Ply, text.replace(&format!("tristrips {count}"), "tristrips 1"));
        sheet.is_cloud(&scan);
        let triangles = scan.triangles.unwrap();
        assert_eq!(triangles.len(), count);
        // All look down: the turn from one corner to the next is that of the first one.
        for [a, b, c] in triangles.iter().map(|t| t.map(|k| sheet.points[k as usize])) {
            assert!((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) < 0.0);
        }
    }
    // A corner twice joins two strips and makes no triangle.
    let joined = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement tristrips 1\n\
                  property list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n7 0 1 2 2 2 1 3\n";
    assert_eq!(read(Format::Ply, joined).triangles, Some(vec![[0, 1, 2], [2, 1, 3]]));
}

#[test]
fn off_without_its_word() {
    for sheet in Sheet::all() {
        let body = format!(
            "{} {} 0\n{}{}",
            sheet.points.len(),
            sheet.triangles.len(),
            sheet.vertex_lines(""),
            sheet.face_lines()
        );
        let bare = read(Format::Off, &body);
        sheet.is_in(&bare);
        assert!(bare.notes[0].contains("OFF"), "{:?}", bare.notes);
        for word in ["OFF ", "OFF\n", "off\n", "NOFF # with normals\n"] {
            let scan = read(Format::Off, format!("{word}{body}"));
            sheet.is_in(&scan);
            assert!(scan.notes.is_empty());
        }
    }
}

/// Pixels of depth cameras that saw nothing: in every format points left out, with their triangles, and told.
#[test]
fn points_that_are_not_a_number_are_left_out() {
    for sheet in Sheet::all() {
        let count = sheet.points.len();
        for (seed, spelled) in [(1, "nan"), (2, "-nan"), (3, "inf"), (5, "-Infinity"), (7, "NaN")] {
            let is_blind = |k: usize| k != 1 && (k * k + seed).is_multiple_of(7);
            let kept: Vec<u32> = (0..count as u32).filter(|&k| !is_blind(k as usize)).collect();
            let blind = count - kept.len();
            let line = |(k, [x, y, z]): (usize, &[f64; 3])| {
                if is_blind(k) { format!("{x} {spelled} {z}\n") } else { format!("{x} {y} {z}\n") }
            };
            let vertices: String = sheet.points.iter().enumerate().map(line).collect();
            let obj: String = vertices.lines().map(|line| format!("v {line}\n")).collect();
            let faces = sheet.face_lines();
            let obj_faces = sheet.obj()[sheet.vertex_lines("v ").len()..].to_owned();
            let off = format!("OFF\n{count} {} 0\n{vertices}{faces}", sheet.triangles.len());
            let pcd =
                format!("FIELDS x y z\nWIDTH {}\nHEIGHT {}\nDATA ascii\n{vertices}", sheet.size[0], sheet.size[1]);
            let is_whole = |t: &&[u32; 3]| t.iter().all(|&k| !is_blind(k as usize));
            let whole = sheet.triangles.iter().filter(is_whole).count();
            for (format, text) in [
                (Format::Ply, sheet.ply(["float", "int", "int"], &(vertices.clone() + &faces))),
                (Format::Obj, obj + &obj_faces),
                (Format::Off, off),
                (Format::Pcd, pcd),
            ] {
                let scan = read(format, text);
                assert_eq!(scan.rows, kept, "{format:?}");
                assert!(rows(&scan).iter().zip(&kept).all(|(point, &k)| *point == sheet.points[k as usize]));
                assert!(scan.triangles.is_none_or(|triangles| triangles.len() == whole));
                if blind > 0 {
                    assert!(scan.notes[0].starts_with(&format!("{blind} points are not a number")), "{:?}", scan.notes);
                }
            }
        }
    }
    let blind = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\nnan 0 0\n0 inf 0\n";
    assert!(matches!(fail_or_read(Format::Ply, blind), Err(ReadErrorKind::NoneFinite { points: 2 })));
}

/// What no step could compute with is refused by the reader, so by all commands alike.
#[test]
fn coordinates_that_overflow_are_refused() {
    for value in [1.1e100, -1e300, f64::MAX] {
        for (format, text) in [
            (Format::Xyz, format!("0 0 0\n1 {value:e} 0\n")),
            (Format::Csv, format!("x,y,z\n0,0,0\n1,{value:e},0\n")),
            (Format::Obj, format!("v 0 0 0\nv 1 {value:e} 0\n")),
            (Format::EsriGrid, format!("ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n0 {value:e}\n0 0\n")),
        ] {
            let error = fail_or_read(format, text).unwrap_err();
            assert!(matches!(error, ReadErrorKind::CoordinateRange { row: 1, .. }), "{format:?} {error:?}");
        }
    }
    assert!(fail_or_read(Format::Xyz, "0 0 0\n1e100 -1e100 0\n").is_ok());
}

#[test]
fn compressed_meshes() {
    let sheet = Sheet::new([13, 9]);
    sheet.is_in(&read(Format::Obj, gzip(sheet.obj())));
    sheet.is_soup(&read(Format::Stl, gzip(sheet.stl(b"solid", 0))));
}

#[test]
fn words_for_no_value_are_no_numbers_in_any_format() {
    for sheet in Sheet::all() {
        let count = sheet.points.len();
        for word in ["nan", "-NaN", "inf", "1.#QNAN", "-1.#IND", "1.#INF00", "-nan(ind)", "null"] {
            let is_blind = |at: usize| at % 7 == 1;
            let height = |at: usize| if is_blind(at) { word.to_owned() } else { sheet.points[at][2].to_string() };
            let vertex = |at: usize| format!("{} {} {}\n", sheet.points[at][0], sheet.points[at][1], height(at));
            let vertices = |prefix: &str| (0..count).map(|at| format!("{prefix}{}", vertex(at))).collect::<String>();
            let obj: String = vertices("v ") + &sheet.obj()[sheet.vertex_lines("v ").len()..];
            let off = format!("OFF\n{count} {} 0\n{}{}", sheet.triangles.len(), vertices(""), sheet.face_lines());
            let ply = sheet.ply(["double", "uchar", "int"], &(vertices("") + &sheet.face_lines()));
            let pcd = format!(
                "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {count}\nHEIGHT 1\nPOINTS {count}\nDATA ascii\n{}",
                vertices("")
            );
            let kept: Vec<[f64; 3]> = (0..count).filter(|&at| !is_blind(at)).map(|at| sheet.points[at]).collect();
            let whole = |t: &&[u32; 3]| !t.iter().any(|&corner| is_blind(corner as usize));
            let triangles = sheet.triangles.iter().filter(whole).count();
            for (format, text) in [(Format::Obj, obj), (Format::Off, off), (Format::Ply, ply), (Format::Pcd, pcd)] {
                let scan = parse_scan(text.as_bytes(), format, &ReadOptions::default()).unwrap();
                let points: Vec<[f64; 3]> = scan.cloud.points.outer_iter().map(|p| [p[0], p[1], p[2]]).collect();
                assert_eq!(points, kept, "{format:?} {word}");
                assert_eq!(scan.rows.iter().filter(|&&row| is_blind(row as usize)).count(), 0);
                if format != Format::Pcd {
                    assert_eq!(scan.triangles.map(|t| t.len()), Some(triangles), "{format:?} {word}");
                }
                let told =
                    scan.notes.iter().filter(|note| note.contains(&format!("{} points are", count - kept.len())));
                assert_eq!(told.count(), 1, "{format:?} {:?}", scan.notes);
            }
            let facet = |t: &[u32; 3]| {
                let corners: String = t.iter().map(|&corner| format!("vertex {}", vertex(corner as usize))).collect();
                format!("facet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\n")
            };
            let stl = format!("solid s\n{}endsolid s\n", sheet.triangles.iter().map(facet).collect::<String>());
            let scan = parse_scan(stl.as_bytes(), Format::Stl, &ReadOptions::default()).unwrap();
            assert_eq!(scan.triangles.map_or(0, |t| t.len()), triangles, "{word}");
        }
    }
}

#[test]
fn normals_of_off_files() {
    for sheet in Sheet::all() {
        for (keyword, more) in [("NOFF", ""), ("CNOFF", " 255 0 0 255"), ("STCNOFF", " 255 0 0 255 0.5 0.5")] {
            let vertices: String =
                sheet.points.iter().map(|[x, y, z]| format!("{x} {y} {z} 0 {} 0.5{more}\n", x - y)).collect();
            let text = format!(
                "{keyword}\n{} {} 0\n{vertices}{}",
                sheet.points.len(),
                sheet.triangles.len(),
                sheet.face_lines()
            );
            let scan = parse_scan(text.as_bytes(), Format::Off, &ReadOptions::default()).unwrap();
            let expected: Vec<[f64; 3]> = sheet.points.iter().map(|[x, y, _]| [0.0, x - y, 0.5]).collect();
            assert_eq!(scan.normals, Some(expected), "{keyword}");
            let plain = text.replacen(keyword, "COFF", 1);
            assert_eq!(parse_scan(plain.as_bytes(), Format::Off, &ReadOptions::default()).unwrap().normals, None);
        }
    }
}
