//! Tables as scanners, measuring machines, total stations and spreadsheets write them, each kind a family over sizes and seeds.

use geom_io::{Decimal, Format, ReadErrorKind as Kind, ReadOptions, Scan, parse_scan};
use ndarray::{Array2, arr2};
use point_cloud::GridShape;
use proptest::prelude::*;

fn read(format: Format, text: impl AsRef<[u8]>) -> Scan {
    parse_scan(text.as_ref(), format, &ReadOptions::default()).unwrap()
}

fn fail(format: Format, text: impl AsRef<[u8]>) -> Kind {
    parse_scan(text.as_ref(), format, &ReadOptions::default()).unwrap_err()
}

fn with_columns(names: &[&str]) -> ReadOptions {
    ReadOptions { columns: names.iter().map(|&name| name.to_owned()).collect(), ..ReadOptions::default() }
}

/// A bent sheet, row by row, of coordinates with up to four digits behind the point.
fn sheet(n: usize, m: usize) -> Array2<f64> {
    Array2::from_shape_fn((n * m, 3), |(row, k)| {
        let (i, j) = ((row % n) as f64, (row / n) as f64);
        let z = 4.0 * (0.5 * i).sin() + 0.1 * (j - 3.0) * (j - 3.0) + 0.0371 * i;
        let value = [2.5 * i + 100.25, 5.125 * j - 20.0, z][k];
        (value * 1e4).round() / 1e4
    })
}

const SIZES: [(usize, usize); 4] = [(2, 2), (4, 3), (13, 9), (31, 40)];

/// Lines of the points, each made of its row and its coordinates.
fn lines(points: &Array2<f64>, line: impl Fn(usize, [f64; 3]) -> String) -> String {
    points.outer_iter().enumerate().map(|(row, p)| line(row, [p[0], p[1], p[2]]) + "\n").collect()
}

/// Numbers that look random, between 0 and 1.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[track_caller]
fn is_sheet(text: &str, n: usize, m: usize) -> Scan {
    let head: String = text.lines().take(5).collect::<Vec<_>>().join(" | ");
    for format in [Format::Xyz, Format::Csv, Format::EsriGrid] {
        let scan = parse_scan(text.as_bytes(), format, &ReadOptions::default())
            .unwrap_or_else(|error| panic!("{format:?} {head}: {error}"));
        assert_eq!(scan.cloud.points, sheet(n, m), "{format:?} {head}");
    }
    read(Format::Xyz, text)
}

#[test]
fn every_separator_with_points_and_with_decimal_commas() {
    for (n, m) in SIZES {
        let points = sheet(n, m);
        for sign in [" ", "   ", "\t", ";", "; ", "|", " \t ", ",", ", ", " , ", ",\t"] {
            is_sheet(&lines(&points, |_, p| p.map(|c| format!("{c:.4}")).join(sign)), n, m);
            is_sheet(
                &lines(&points, |_, p| p.map(|c| format!("{c:e}").replace('e', "D+0").replace("+0-", "-0")).join(sign)),
                n,
                m,
            );
            is_sheet(&lines(&points, |_, p| p.map(|c| format!("\"{c:+.4}\"")).join(sign)), n, m);
            if !sign.contains(',') {
                let scan =
                    is_sheet(&lines(&points, |_, p| p.map(|c| format!("{c:.4}").replace('.', ",")).join(sign)), n, m);
                assert!(scan.notes[0].contains("--decimal"), "{:?}", scan.notes);
            }
            let quoted = lines(&points, |_, p| p.map(|c| format!("\"{c:.4}\"").replace('.', ",")).join(sign));
            is_sheet(&format!("X{sign}Y{sign}Z\n{quoted}"), n, m);
        }
        // Commas beside blanks in some places only, and line ends of all systems.
        let mixed = lines(&points, |row, [x, y, z]| format!("{x}{} {y} {z}", if row % 2 == 1 { "," } else { "" }));
        is_sheet(&mixed, n, m);
        is_sheet(&mixed.replace('\n', "\r\n"), n, m);
        is_sheet(&mixed.replace('\n', "\r"), n, m);
    }
}

#[test]
fn commas_that_may_be_decimal_or_not_are_an_error_and_an_option_decides() {
    for (n, m) in [(4, 3), (13, 9), (31, 40)] {
        let points = sheet(n, m);
        for sign in [",", ", "] {
            let text = lines(&points, |_, p| p.map(|c| format!("{c:.4}").replace('.', ",")).join(sign));
            let error = fail(Format::Xyz, &text);
            assert!(matches!(error, Kind::AmbiguousComma { line: 1, .. }), "{error}");
            assert!(error.to_string().contains("give the decimal sign"), "{error}");
            let comma = ReadOptions { decimal: Some(Decimal::Comma), ..ReadOptions::default() };
            assert_eq!(parse_scan(text.as_bytes(), Format::Xyz, &comma).unwrap().cloud.points, points);
            let point = ReadOptions { decimal: Some(Decimal::Point), ..ReadOptions::default() };
            let halves = parse_scan(text.as_bytes(), Format::Xyz, &point).unwrap();
            assert_eq!(halves.cloud.points.column(0), points.column(0).mapv(f64::trunc));
            assert!(matches!(fail(Format::Csv, format!("x,y,z\n{text}")), Kind::AmbiguousComma { .. }));
        }
        let thousands = lines(&points, |_, [x, y, z]| format!("1,{x:07.3} {y} {z}"));
        let error = fail(Format::Xyz, &thousands);
        assert!(matches!(&error, Kind::GroupedNumber { line: 1, text } if text.starts_with("1,100")), "{error}");
        let point = ReadOptions { decimal: Some(Decimal::Point), ..ReadOptions::default() };
        let shifted = parse_scan(thousands.as_bytes(), Format::Xyz, &point).unwrap().cloud.points;
        assert_eq!(shifted.column(0), points.column(0).mapv(|x| ((x + 1000.0) * 1e3).round() / 1e3));
        // Within quotes there is no doubt.
        let quoted = lines(&points, |_, [x, y, z]| format!("\"1,{x:07.3}\",\"{y}\",\"{z}\""));
        assert_eq!(read(Format::Csv, quoted).cloud.points.column(0), shifted.column(0));
    }
    assert!(matches!(fail(Format::Xyz, "1,500 2,250 3,125\n4,500 5,250 6,125\n"), Kind::AmbiguousComma { .. }));
    assert_eq!(read(Format::Xyz, "0,500 2,250 3,125\n4,500 5,250 6,125\n").cloud.points[[1, 2]], 6.125);
    // Whole numbers between commas are no halves.
    for text in ["0,0,5,7\n1,0,6,7\n2,0,6,8\n3,0,6,9\n", "12,34,56,100,120,130\n12,34,57,200,120,131\n", "1,2,3\n"] {
        assert_eq!(
            read(Format::Xyz, text).cloud.points[[0, 2]],
            if text.starts_with("12") { 56.0 } else { text.as_bytes()[4] as f64 - 48.0 }
        );
    }
}

#[test]
fn titles_comments_and_counts_above_the_points() {
    for (n, m) in SIZES {
        let points = sheet(n, m);
        let rows = lines(&points, |_, [x, y, z]| format!("{x} {y} {z}"));
        let mut swapped = points.clone();
        swapped.swap([0, 0], [0, 0]);
        for (opening, notes) in [
            ("Report: bracket top face\nMachine: bridge CMM\nUnits: mm\nDate 2021-03-04\n\nX Y Z\n", 1),
            ("TITLE = \"scan\"\nVARIABLES = \"X\" \"Y\" \"Z\"\nZONE I=13, J=9, F=POINT\n", 1),
            ("\"surface scan\"\n\"x\" \"y\" \"z\"\n", 1),
            ("% exported matrix\n% x y z\n", 0),
            ("; probe file\n; X Y Z\n", 0),
            ("! 1 2 3 of it\n", 0),
            ("13 9\n", 1),
            ("RAE 2822\n", 1),
            ("# a scan of the x y plane\n", 0),
            ("X [mm] Y [mm] Z [mm]\n", 0),
        ] {
            let scan = is_sheet(&format!("{opening}{rows}"), n, m);
            assert_eq!(
                scan.notes.iter().filter(|note| note.contains("skipped")).count(),
                notes,
                "{opening} {:?}",
                scan.notes
            );
        }
        let count = n * m;
        is_sheet(&format!("//X Y Z\n{count}\n{rows}"), n, m);
        is_sheet(&format!("{count}\n{rows}"), n, m);
        let swapped = lines(&points, |row, [x, y, z]| format!("{y} {x} {z} {}", row % 7));
        is_sheet(&format!("//Y X Z Intensity\n{swapped}"), n, m);
        let commas = lines(&points, |_, [x, y, z]| format!("{x},{y},{z},0,0,1"));
        assert!(is_sheet(&format!("//X,Y,Z,Nx,Ny,Nz\n{commas}"), n, m).normals.is_some());
        // Names may be separated otherwise than the rows, in a title and in a comment.
        let turned = lines(&points, |_, [x, y, z]| format!("{z} {x} {y}"));
        for names in ["Z, X, Y", "Z,X,Y", "Z; X; Y", "z;x;y", "Z\tX\tY", "'z' 'x' 'y'"] {
            for sign in ["# ", "// ", "% ", "; ", "! ", ""] {
                is_sheet(&format!("{sign}{names}\n{turned}"), n, m);
            }
        }
        // Several clouds, each with its number of points.
        let (a, b) = (n, n * (m - 1));
        let parts: Vec<&str> = rows.lines().collect();
        let two = format!("{a}\n{}\n{b}\n{}\n", parts[..a].join("\n"), parts[a..].join("\n"));
        let scan = is_sheet(&two, n, m);
        assert!(scan.notes.iter().any(|note| note.contains("2 clouds")), "{:?}", scan.notes);
        assert_eq!((scan.line(0), scan.line(n - 1), scan.line(n)), (Some(2), Some(n + 1), Some(n + 3)));
        // Lines that are not looked at.
        let skipped = ReadOptions { skip: 2, ..ReadOptions::default() };
        let scan = parse_scan(format!("1 2 3\n4 5 6\n{rows}").as_bytes(), Format::Xyz, &skipped).unwrap();
        assert_eq!((scan.cloud.points.view(), scan.line(0)), (points.view(), Some(3)));
    }
}

#[test]
fn names_tell_the_columns_and_a_note_says_so() {
    for (n, m) in SIZES {
        let points = sheet(n, m);
        for (sign, header) in [
            (" ", "Point Easting Northing Elevation"),
            (";", "No.;Easting;Northing;Elevation"),
            ("\t", "id\tX [mm]\tY [mm]\tZ [mm]"),
            (",", "id,\"X, mm\",x,y,z"),
            (",", "\"Point\",\"X(mm)\",\"Y(mm)\",\"Z(mm)\""),
            (" ", "# id x_mm y_mm z_mm"),
            (",", "P,N,E,H"),
        ] {
            let text = lines(&points, |row, [x, y, z]| match header {
                "P,N,E,H" => format!("{row},{y},{x},{z}"),
                "id,\"X, mm\",x,y,z" => format!("{row},\"7, {row}\",{x},{y},{z}"),
                _ => [row.to_string(), x.to_string(), y.to_string(), z.to_string()].join(sign),
            });
            let scan = is_sheet(&format!("{header}\n{text}"), n, m);
            assert_eq!(scan.columns[0].role, "x");
            assert!(scan.columns.iter().all(|column| column.name.is_some()), "{:?}", scan.columns);
        }
        let labelled = lines(&points, |row, [x, y, z]| format!("\"P, {row}\",\"{x}\",\"{y}\",\"{z}\""));
        is_sheet(&format!("\"Point\",\"X\",\"Y\",\"Z\"\n{labelled}"), n, m);
        let unnamed = lines(&points, |_, [x, y, z]| format!(";{x};{y};{z}"));
        is_sheet(&unnamed, n, m);
        is_sheet(&format!(";x;y;z\n{unnamed}"), n, m);
        let noted = lines(&points, |row, [x, y, z]| format!("{row},{x},{y},{z},\"dia 5\"\" ok, side\""));
        is_sheet(&format!("id,x,y,z,note\n{noted}"), n, m);
        is_sheet(&lines(&points, |row, [x, y, z]| format!("{x} {y} {z} pt#{row}")), n, m);
        let first = is_sheet(&lines(&points, |row, [x, y, z]| format!("P{row},{x},{y},{z}")), n, m);
        assert!(first.notes.iter().any(|note| note.contains("2, 3, 4")), "{:?}", first.notes);
        // Names in Latin-1, and rows of different lengths.
        let latin =
            [b"x [\xb5m];y;z\n".to_vec(), lines(&points, |_, p| p.map(|c| c.to_string()).join(";")).into_bytes()]
                .concat();
        let scan = read(Format::Csv, latin);
        assert_eq!(scan.cloud.points, points);
        assert!(
            scan.notes.iter().any(|note| note == "line 1 is not in UTF-8; the file was read as Latin-1"),
            "{:?}",
            scan.notes
        );
        is_sheet(&lines(&points, |row, [x, y, z]| format!("{x} {y} {z}{}", [" 0 0 1", ""][row % 2])), n, m);
    }
    let error = fail(Format::Csv, "time,temp,a\u{7}b,pressure\n1,2,3,4\n");
    assert!(matches!(error, Kind::NotText { line: 1 }), "{error}");
    let long = fail(Format::Csv, format!("time,{}\n1,2\n", "n".repeat(10_000)));
    assert!(long.to_string().len() < 300, "{long}");
}

#[test]
fn a_first_column_that_counts() {
    for (n, m) in [(4, 3), (13, 9), (31, 40)] {
        let points = sheet(n, m);
        let ways: [(&str, &dyn Fn(usize) -> String); 10] = [
            ("counts", &|row| (row + 1).to_string()),
            ("counts", &|row| row.to_string()),
            ("counts", &|row| (row + 1001).to_string()),
            ("counts", &|row| (10 * row).to_string()),
            ("counts", &|row| (row + row / 7 + 5).to_string()),
            ("counts", &|row| format!("{row:05}")),
            ("counts", &|row| format!("{row}.0000")),
            ("counts", &|row| (5000 - row).to_string()),
            ("time", &|row| format!("{:.2}", 0.02 * row as f64 + 17.5)),
            ("time", &|row| format!("{:.3}", 1_612_345_678.125 + 0.01 * row as f64 + 0.003 * (row % 3) as f64)),
        ];
        for (what, counter) in ways {
            for sign in [" ", ",", "\t", ";"] {
                for more in [0, 3] {
                    let text = lines(&points, |row, p| {
                        let coordinates = p.map(|c| format!("{c:.4}")).join(sign);
                        let colours = format!("{sign}{}", row % 256).repeat(more);
                        format!("{}{sign}{coordinates}{colours}", counter(row))
                    });
                    let scan = read(Format::Xyz, &text);
                    assert_eq!(scan.cloud.points, points, "{}", &text[..60]);
                    let notes = scan.notes.join("; ");
                    assert!(notes.contains(what) && notes.contains("--columns 1,2,3"), "{notes}");
                    assert_eq!(scan.columns.iter().map(|c| c.number).collect::<Vec<_>>(), [2, 3, 4]);
                    let asked = parse_scan(text.as_bytes(), Format::Xyz, &with_columns(&["1", "3", "4"])).unwrap();
                    assert_eq!(asked.cloud.points.column(2), points.column(2));
                }
            }
        }
    }
}

#[test]
fn times_that_jitter() {
    for seed in 1..20 {
        let mut random = noise(seed);
        let points = sheet(13, 9);
        let (step, jitter) = (10_f64.powi(seed as i32 % 4 - 2), 0.4 * random());
        // A clock of more digits than coordinates have, which misses a few points.
        let mut time = 100.0 * random();
        let mut tick = |row: usize| {
            time += step * (1.0 + jitter * (random() - 0.5)) * if row % 40 == 17 { 9.0 } else { 1.0 };
            time
        };
        let times: Vec<f64> = (0..points.nrows()).map(&mut tick).collect();
        let text = lines(&points, |row, p| format!("{:.6} {}", times[row], p.map(|c| format!("{c:.4}")).join(" ")));
        let scan = read(Format::Xyz, &text);
        assert_eq!(scan.cloud.points, points, "{:?}\n{}", scan.notes, &text[..200]);
        assert!(scan.notes.iter().any(|note| note.contains("as a time does")), "{:?}", scan.notes);
        // Coordinates that were sorted have steps of all sizes.
        let mut sorted: Vec<f64> = (0..30 + 5 * seed).map(|_| 50.0 * random()).collect();
        sorted.sort_by(f64::total_cmp);
        let text: String =
            sorted.iter().map(|x| format!("{x:.6} {:.4} {:.4} {:.4}\n", random(), random(), random())).collect();
        assert_eq!(read(Format::Xyz, &text).columns[0].number, 1, "{}", &text[..200]);
    }
}

#[test]
fn signs_of_typesetters_and_text_in_latin_1() {
    for (n, m) in SIZES {
        let points = sheet(n, m);
        let minus = lines(&points, |_, p| p.map(|c| c.to_string().replace('-', "\u{2212}")).join(" "));
        is_sheet(&minus, n, m);
        for blank in ["\u{a0}", "\u{202f}", "\u{2009}"] {
            is_sheet(&lines(&points, |_, p| p.map(|c| format!("{c}{blank}")).join(&format!(";{blank}"))), n, m);
            // Between digits they part thousands.
            let text = lines(&points, |_, [x, y, z]| format!("7{blank}{x:08.4};{y:.4};{z:.4}").replace('.', ","));
            let scan = read(Format::Csv, format!("X;Y;Z\n{text}"));
            let shifted = points.column(0).mapv(|x| ((x + 7000.0) * 1e4).round() / 1e4);
            assert_eq!(scan.cloud.points.column(0), shifted, "{text}");
        }
        let labelled =
            lines(&points, |row, [x, y, z]| format!("Fl{}che{row} {x} {y} {z}", if row > 2 { "ä" } else { "ae" }));
        let latin: Vec<u8> = labelled.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
        let scan = read(Format::Xyz, &latin);
        assert_eq!(scan.cloud.points, points);
        assert!(
            scan.notes.contains(&"line 4 is not in UTF-8; the file was read as Latin-1".to_owned()),
            "{:?}",
            scan.notes
        );
    }
    let binary: Vec<u8> = (0..200_u8).map(|k| k.wrapping_mul(37)).collect();
    assert!(matches!(fail(Format::Xyz, &binary), Kind::NotText { .. }));
}

#[test]
fn lines_without_numbers_that_stand_apart_are_shown() {
    for line in ["X0.5 Y1.5 Z2.5", "x=1 y=2 z=3", "P-1 ; 2a ; 3b"] {
        let error = fail(Format::Xyz, format!("# a part\n{line}\n{line}\n"));
        assert!(matches!(&error, Kind::NoNumbers { line: 2, text } if text == line), "{error}");
    }
    let grouped = "x;y;z\n1'100.5;2'200.5;3.5\n1'100.5;2'200.5;3.5\n";
    let error = fail(Format::Csv, grouped);
    assert!(matches!(&error, Kind::NoNumbers { line: 2, text } if text == "1'100.5;2'200.5;3.5"), "{error}");
    for (line, column, wrong) in [("(1.5, 2.5, 3.5)", 1, "(1.5"), ("[1.5 2.5 3.5]", 1, "[1.5"), ("a 1 b", 1, "a")] {
        let error = fail(Format::Xyz, format!("{line}\n{line}\n"));
        let told =
            matches!(&error, Kind::NotANumberInTable { line: 1, column: c, text } if *c == column && text == wrong);
        assert!(told, "{error}");
    }
}

#[test]
fn coordinates_are_not_counted() {
    for seed in 1..6 {
        let mut random = noise(seed);
        let count = 9 + (seed as usize * 37) % 150;
        let scale = 10_f64.powi((seed % 7) as i32 - 2);
        let mut raw: Vec<[f64; 3]> =
            (0..count).map(|_| [scale * random(), scale * random(), 0.1 * scale * random()]).collect();
        let grid = |row: usize| [(row % 13) as f64, (row / 13) as f64, (0.3 * (row % 13) as f64).sin()];
        let profile = |row: usize| [(row / 13) as f64, (row % 13) as f64, (0.3 * (row % 13) as f64).sin()];
        let whole: Vec<[f64; 3]> = raw.iter().map(|p| p.map(|c| (100.0 * c / scale).round())).collect();
        let mut families =
            vec![raw.clone(), (0..count).map(grid).collect(), (0..count).map(profile).collect(), whole.clone()];
        for k in [0, 1] {
            raw.sort_by(|a, b| a[k].total_cmp(&b[k]));
            families.push(raw.clone());
            families.push(raw.iter().map(|p| p.map(|c| c + 4.5e5)).collect());
            families.push(raw.iter().map(|p| p.map(|c| c + 1e9)).collect());
            families.push(raw.iter().map(|p| p.map(|c| (1e3 * c / scale).round() / 1e3)).collect());
            families.push(raw.iter().rev().copied().collect());
            let mut sorted = whole.clone();
            sorted.sort_by(|a, b| a[k].total_cmp(&b[k]));
            families.push(sorted);
        }
        let tails: [&dyn Fn(f64, usize) -> String; 6] = [
            &|r, _| format!("{}", (255.0 * r) as u8),
            &|r, _| format!("{r:.6}"),
            &|_, row| format!("{row}"),
            &|r, row| format!("{} {} {}", (255.0 * r) as u8, row % 256, 128),
            &|r, _| format!("{:.6} {:.6} {:.6}", r.sin(), r.cos(), 0.0),
            &|_, _| "0 0 1".to_owned(),
        ];
        let digits: [&dyn Fn(f64) -> String; 4] =
            [&|c| format!("{c:.6}"), &|c| format!("{c}"), &|c| format!("{c:.3}"), &|c| format!("{c:.18e}")];
        for points in &families {
            for tail in tails {
                for number in digits {
                    let line = |(row, p): (usize, &[f64; 3])| {
                        format!("{} {} {} {}\n", number(p[0]), number(p[1]), number(p[2]), tail(random(), row))
                    };
                    let text: String = points.iter().enumerate().map(line).collect();
                    let scan = read(Format::Xyz, &text);
                    assert_eq!(scan.columns[0].number, 1, "{:?}\n{}", scan.notes, &text[..text.len().min(400)]);
                    assert!(!scan.notes.iter().any(|note| note.contains("--columns")), "{:?}", scan.notes);
                }
            }
        }
    }
}

#[test]
fn points_without_a_value_are_left_out_and_counted() {
    let words = [
        "nan",
        "-NaN",
        "inf",
        "1.#IND",
        "-1.#IND",
        "1.#QNAN",
        "1.#INF",
        "null",
        "N/A",
        "#N/A",
        "-nan(ind)",
        "***",
        "NULL",
    ];
    for (n, m) in [(4, 3), (13, 9), (31, 40)] {
        let points = sheet(n, m);
        let is_blind = |row: usize| row % 5 == 2;
        let seen: Vec<usize> = (0..n * m).filter(|&row| !is_blind(row)).collect();
        for word in words.into_iter().chain([""]) {
            for sign in [" ", ",", "\t", ";"] {
                if word.is_empty() && sign == " " {
                    continue;
                }
                let text = lines(&points, |row, [x, y, z]| {
                    let z = if is_blind(row) { word.to_owned() } else { z.to_string() };
                    [x.to_string(), y.to_string(), z].join(sign)
                });
                for header in ["", "x y z\n"] {
                    let text = format!("{}{text}", header.replace(' ', sign));
                    for format in [Format::Xyz, Format::Csv] {
                        let scan = read(format, &text);
                        assert_eq!(scan.cloud.points, points.select(ndarray::Axis(0), &seen), "{word} {sign}");
                        assert!(scan.rows.iter().map(|&row| row as usize).eq(seen.iter().copied()));
                        let count = format!("{} of {} points", n * m - seen.len(), n * m);
                        assert!(scan.notes.iter().any(|note| note.contains(&count)), "{:?}", scan.notes);
                    }
                }
            }
        }
        for declared in ["# nodata = -9999", "NODATA_value -9999.0", "// no data: -9.999e3"] {
            let text = lines(&points, |row, [x, y, z]| format!("{x} {y} {}", if is_blind(row) { -9999.0 } else { z }));
            let scan = read(Format::Xyz, format!("{declared}\n{text}"));
            assert_eq!(scan.cloud.points.nrows(), seen.len(), "{declared}");
        }
    }
    for comment in ["# no data in 3 rows", "# nodata", "# 3 nodata"] {
        assert_eq!(read(Format::Xyz, format!("{comment}\n1 2 3\n3 3 4\n4 5 6\n")).cloud.points.nrows(), 3, "{comment}");
    }
    assert_eq!(read(Format::Xyz, "# nodata = 0\n0 0 3\n1 0 0\n0 1 5\n").rows, [0, 2]);
    let other = read(Format::Csv, "x,y,z,intensity\n1,2,3,7\n4,5,6,\n7,8,9,\n");
    assert_eq!((other.cloud.points.nrows(), other.notes.len()), (3, 1));
    let weighted = ReadOptions { weights: Some("w".to_owned()), ..ReadOptions::default() };
    let scan = parse_scan(b"x,y,w\n1,2,3\n4,5,\n7,8,9\n", Format::Csv, &weighted).unwrap();
    assert_eq!((scan.cloud.points.nrows(), scan.weights), (2, Some(vec![3.0, 9.0])));
}

#[test]
fn i_and_j_are_indices_from_anywhere_by_any_step() {
    for (n, m) in SIZES {
        let points = sheet(n, m);
        for (first_i, step_i, first_j, step_j) in [(0, 1, 0, 1), (1, 1, 1, 1), (100, 2, 240, 5), (-3, 1, -40, 10)] {
            let index = |row: usize| (first_i + step_i * (row / n) as i64, first_j + step_j * (row % n) as i64);
            let text = lines(&points, |row, [x, y, z]| format!("{},{},{x},{y},{z}", index(row).0, index(row).1));
            for names in ["i,j,x,y,z", "I,J,X,Y,Z", "Row,Col,X[mm],Y[mm],Z[mm]"] {
                let scan = is_sheet(&format!("{names}\n{text}"), n, m);
                assert_eq!(scan.cloud.grid, Some(GridShape { n_u: m, n_v: n }), "{names} {first_i} {step_i}");
            }
            let blanks = is_sheet(&format!("Row Col X[mm] Y[mm] Z[mm]\n{}", text.replace(',', " ")), n, m);
            assert_eq!(blanks.cloud.grid, Some(GridShape { n_u: m, n_v: n }));
            // The option names them, too, and takes the guess back.
            let given = ReadOptions { grid: Some(vec!["1".into(), "2".into()]), ..with_columns(&["3", "4", "5"]) };
            let scan = parse_scan(text.as_bytes(), Format::Csv, &given).unwrap();
            assert_eq!(scan.cloud.grid, Some(GridShape { n_u: m, n_v: n }));
            let none = ReadOptions { grid: Some(Vec::new()), ..ReadOptions::default() };
            let scan = parse_scan(format!("i,j,x,y,z\n{text}").as_bytes(), Format::Csv, &none).unwrap();
            assert_eq!(scan.cloud.grid, None);
            // A grid with gaps is read as points, and says so.
            if n * m > 8 {
                let gaps: String = format!("i,j,x,y,z\n{text}")
                    .lines()
                    .enumerate()
                    .filter(|(line, _)| *line != 4 && *line != 8)
                    .map(|(_, text)| format!("{text}\n"))
                    .collect();
                let scan = read(Format::Csv, gaps);
                assert_eq!((scan.cloud.grid, scan.cloud.points.nrows()), (None, n * m - 2));
                assert!(scan.notes[0].contains("no point at 2 of its"), "{:?}", scan.notes);
            }
        }
    }
    let twice = read(Format::Csv, "i,j,x,y\n0,0,0,0\n0,1,0,0\n0,0,1,1\n");
    assert!(twice.cloud.grid.is_none() && twice.notes[0].contains("lines 2 and 4"), "{:?}", twice.notes);
    let huge = read(Format::Csv, "i,j,x,y\n0,0,1,2\n9007199254740991,9007199254740990,3,4\n0,1,5,6\n");
    assert!(huge.cloud.grid.is_none());
    let given = ReadOptions { grid: Some(vec!["a".into(), "b".into()]), ..ReadOptions::default() };
    let error = parse_scan(b"x,y,a,b\n1,2,0,0\n1,3,0,0.5\n", Format::Csv, &given).unwrap_err();
    assert!(matches!(&error, Kind::GridIndex { line: 3, text } if text == "0.5"), "{error}");
}

#[test]
fn i_j_and_k_are_normals() {
    for (n, m) in SIZES {
        let points = sheet(n, m);
        let tilted = |row: usize| {
            let (a, b) = (0.3 * (row as f64).sin(), 0.2 * (0.7 * row as f64).cos());
            [-a, -b, 1.0].map(|c| c / (a * a + b * b + 1.0).sqrt())
        };
        for flat in [false, true] {
            let normal = |row: usize| if flat { [0.0, 0.0, 1.0] } else { tilted(row) };
            let text = lines(&points, |row, p| {
                let numbers: Vec<String> = p.iter().chain(&normal(row)).map(f64::to_string).collect();
                numbers.join(",")
            });
            for names in ["X,Y,Z,I,J,K", "x,y,z,i,j,k", "x,y,z,nx,ny,nz", "X,Y,Z,Normal X,Normal Y,Normal Z"] {
                let scan = is_sheet(&format!("{names}\n{text}"), n, m);
                let normals = scan.normals.unwrap();
                assert!((0..n * m).all(|row| normals[row] == normal(row)), "{names}");
                assert_eq!(scan.cloud.grid, None);
                assert_eq!(scan.columns[3].role, "normal x");
            }
            for options in
                [with_columns(&["X", "Y", "Z"]), ReadOptions { normals: Some(Vec::new()), ..ReadOptions::default() }]
            {
                let scan = parse_scan(format!("X,Y,Z,I,J,K\n{text}").as_bytes(), Format::Csv, &options).unwrap();
                assert_eq!((scan.cloud.points.view(), scan.normals), (points.view(), None));
            }
            let named =
                ReadOptions { normals: Some(["4", "5", "6"].map(str::to_owned).to_vec()), ..ReadOptions::default() };
            let scan = parse_scan(text.as_bytes(), Format::Csv, &named).unwrap();
            assert_eq!(scan.normals.unwrap()[1], normal(1));
        }
        // Without j, i is intensity; of a block with one layer, k is no normal.
        let intensity =
            is_sheet(&format!("x,y,z,i\n{}", lines(&points, |row, [x, y, z]| format!("{x},{y},{z},{row}"))), n, m);
        assert_eq!((intensity.cloud.grid, intensity.normals), (None, None));
        let block = lines(&points, |row, [x, y, z]| format!("{},{},7,{x},{y},{z}", row / n, row % n));
        assert_eq!(is_sheet(&format!("i,j,k,x,y,z\n{block}"), n, m).cloud.grid, Some(GridShape { n_u: m, n_v: n }));
    }
    let two = ReadOptions { normals: Some(vec!["1".into(), "2".into()]), ..ReadOptions::default() };
    let error = parse_scan(b"1 2 3\n", Format::Xyz, &two).unwrap_err();
    assert_eq!(error.to_string(), "the option `normals` takes 3 columns, not 2");
}

#[test]
fn labels_of_the_boundary_in_words() {
    for [yes, no] in [["1", "0"], ["true", "false"], ["TRUE", "FALSE"], ["yes", "no"], ["y", "n"]] {
        let scan = read(Format::Csv, format!("x,y,z,boundary\n0,0,0,{yes}\n1,2,3,{no}\n"));
        assert_eq!(scan.on_boundary, Some(vec![true, false]));
        // Where no point is marked the column says nothing.
        let scan = read(Format::Csv, format!("x,y,z,boundary\n0,0,0,{no}\n1,2,3,{no}\n"));
        assert_eq!((scan.on_boundary, scan.notes.len()), (None, 1));
    }
    assert!(matches!(
        fail(Format::Csv, "x,y,boundary\n0,0,perhaps\n"),
        Kind::NotANumberInTable { line: 2, column: 3, .. }
    ));
}

#[test]
fn lines_of_words_between_points_are_counted_and_other_words_are_an_error() {
    let scan = read(Format::Xyz, "x y z\n1 2 3\n4 5 6\nx y z\n7 8 9\nTotal points: 3\nEnd: 3\nNumber of points: 3\n");
    assert_eq!(scan.cloud.points, arr2(&[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]));
    assert_eq!(scan.notes, ["4 lines between the points are none and were skipped, the first is line 4"]);
    let error = fail(Format::Xyz, "1 2 3\n4 5 6\n7 eight 9\n");
    let message = error.to_string();
    assert!(message.starts_with("line 3, column 2: \"eight\" is not a number"), "{message}");
}

/// Grids of heights and PTX, whatever they are called.
#[test]
fn grids_and_ptx_are_known_by_what_they_hold() {
    let heights = "1,5 2,5 3\n4 null 6,25\n";
    let header = "ncols 3\nnrows 2\nxllcenter 100,5\nyllcenter 200\ncellsize 1,0\nNODATA_value null\n";
    for format in [Format::EsriGrid, Format::Xyz, Format::SurferGrid].into_iter().take(2) {
        let scan = read(format, format!("{header}{heights}"));
        assert_eq!((scan.format, scan.cloud.points.nrows()), (Format::EsriGrid, 5));
        assert_eq!(scan.cloud.points.row(0).to_vec(), [100.5, 200.0, 4.0]);
    }
    // Comments above the header, and the header of GRASS, which names the sides.
    for header in [
        format!("# made by hand\n// of nothing\n{header}"),
        "north: 201,5\nsouth: 199,5\neast: 103\nwest: 100\nrows: 2\ncols: 3\nnull: null\ntype: float\n".to_owned(),
    ] {
        let scan = read(Format::EsriGrid, format!("{header}{heights}"));
        assert_eq!((scan.format, scan.cloud.points.nrows(), scan.cell), (Format::EsriGrid, 5, Some([1.0, 1.0])));
        assert_eq!(scan.cloud.points.row(0).to_vec(), [100.5, 200.0, 4.0]);
    }
    let turned = "north: 1\nsouth: 2\neast: 103\nwest: 100\nrows: 2\ncols: 3\n1 2 3 4 5 6\n";
    assert!(fail(Format::EsriGrid, turned).to_string().contains("north above south"));
    for (header, axis) in [("xllcorner 1.7e308\nyllcorner 0", "x"), ("xllcorner 0\nyllcorner 1e101", "y")] {
        for step in ["1e308", "1"] {
            let error = fail(Format::EsriGrid, format!("ncols 2\nnrows 2\n{header}\ncellsize {step}\n1 2 3 4\n"));
            assert!(matches!(error, Kind::GridRange { axis: a, .. } if a == axis || step != "1"), "{error}");
        }
    }
    for (declared, value) in [
        ("-3.4028234663852886e+38", "-3.4028235e+38"),
        ("-3.4e+38", "-3.3999999521443642e+38"),
        ("-9999", "-9999.000"),
        ("-9999", "nan"),
        ("1e30", "-1.#IND"),
    ] {
        let text = format!(
            "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\nnodata_value {declared}\n{value} 2\n3 4\n"
        );
        let scan = read(Format::EsriGrid, text);
        assert_eq!((scan.cloud.points.nrows(), scan.notes.len()), (3, 1), "{declared} {value}");
    }
    let surfer = "DSAA\n3 2\n0 10\n20 30\n1 6\n1 2 3\n4 5 1.70141e+38\n";
    for format in [Format::SurferGrid, Format::Xyz, Format::EsriGrid] {
        let scan = read(format, surfer);
        let expected =
            arr2(&[[0.0, 20.0, 1.0], [0.0, 30.0, 4.0], [5.0, 20.0, 2.0], [5.0, 30.0, 5.0], [10.0, 20.0, 3.0]]);
        assert_eq!((scan.format, scan.cloud.points), (Format::SurferGrid, expected));
        assert_eq!((scan.cell, scan.rows), (Some([5.0, 10.0]), vec![0, 3, 1, 4, 2]));
    }
    assert!(fail(Format::SurferGrid, b"DSBB\x02\0\x02\0").to_string().contains("DSAA"));
    assert!(matches!(
        fail(Format::SurferGrid, "DSAA\n3 2\n0 10\n20 30\n1 6\n1 2 3\n"),
        Kind::Truncated { expected: 6, found: 3, .. }
    ));

    let pose = "1 2 3\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 3 1\n";
    let rows = "1 0 0 0.5\n2 0 1 0.5\n0 0 0 0.5\n4 1 1 0.5\n";
    for (format, text) in [
        (Format::Ptx, format!("2\n2\n{pose}{rows}")),
        (Format::Xyz, format!("2\n2\n{pose}{rows}")),
        (Format::Ptx, format!("2\n2\n{pose}{rows}").replace('.', ",")),
    ] {
        let scan = read(format, text);
        let expected = arr2(&[[10.0, 21.0, 3.0], [10.0, 22.0, 4.0], [9.0, 24.0, 4.0]]);
        assert_eq!((scan.format, &scan.cloud.points, &scan.rows[..]), (Format::Ptx, &expected, &[0, 1, 3][..]));
        assert_eq!((scan.line(2), scan.notes.len()), (Some(14), 1));
    }
    let two = format!("1\n1\n{pose}1 0 0 1\n2\n2\n{pose}{}", rows.replace("0 0 0 ", "5 0 0 "));
    let scan = read(Format::Ptx, two);
    assert_eq!((scan.cloud.points.nrows(), scan.cloud.grid), (5, None));
    let whole = read(Format::Ptx, format!("2\n2\n{pose}{}", rows.replace("0 0 0 ", "5 0 0 ")));
    assert_eq!(whole.cloud.grid, Some(GridShape { n_u: 2, n_v: 2 }));
    assert!(matches!(
        fail(Format::Ptx, format!("2\n2\n{pose}1 0 0 1\n")),
        Kind::Truncated { expected: 4, found: 1, .. }
    ));
    assert!(matches!(
        fail(Format::Ptx, format!("4000000000\n4000000000\n{pose}1 0 0 1\n")),
        Kind::Truncated { found: 1, .. }
    ));
}

/// Few letters, of which most texts look like a table of some kind.
fn text() -> impl Strategy<Value = String> {
    let piece = prop::sample::select(vec![
        "0",
        "1",
        "2.5",
        "-3",
        "4,5",
        "1e3",
        "7D2",
        "nan",
        "1.#IND",
        "",
        "x",
        "y",
        "z",
        "i",
        "j",
        "k",
        "u",
        "v",
        "id",
        "\"",
        "\"\"",
        "#",
        "//",
        "%",
        ";",
        ",",
        ", ",
        "\t",
        " ",
        "  ",
        "|",
        "\n",
        "\r\n",
        "\r",
        "X [mm]",
        "DSAA",
        "ncols 2",
        "nodata -9999",
        "\u{e9}",
    ]);
    prop::collection::vec(piece, 0..120).prop_map(|pieces| pieces.concat())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    #[test]
    fn whatever_stands_in_a_table_is_read_or_refused(
        text in text(),
        columns in prop::option::of(prop::sample::select(vec!["x,y", "1,2,3", "z", "9", "id,1"])),
        normals in prop::option::of(prop::sample::select(vec!["i,j,k", "1,2,3", ""])),
        grid in prop::option::of(prop::sample::select(vec!["i,j", "1,2", ""])),
        decimal in prop::sample::select(vec![None, Some(Decimal::Point), Some(Decimal::Comma)]),
        skip in 0_usize..4,
    ) {
        let named = |names: &str| names.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect::<Vec<_>>();
        let options = ReadOptions {
            columns: columns.map(named).unwrap_or_default(),
            normals: normals.map(named),
            grid: grid.map(named),
            decimal,
            skip,
            ..ReadOptions::default()
        };
        for format in [Format::Xyz, Format::Csv, Format::EsriGrid, Format::SurferGrid, Format::Ptx] {
            match parse_scan(text.as_bytes(), format, &options) {
                Ok(scan) => {
                    let count = scan.cloud.points.nrows();
                    prop_assert!(count > 0 && scan.rows.len() == count && scan.cloud.points.iter().all(|c| c.is_finite()));
                    prop_assert!(scan.normals.as_ref().is_none_or(|normals| normals.len() == count));
                    prop_assert!(scan.cloud.grid.is_none_or(|grid| grid.n_u * grid.n_v == count));
                    prop_assert!(scan.cloud.parameters.is_none_or(|uv| uv.nrows() == count && uv.iter().all(|c| c.is_finite())));
                }
                Err(error) => prop_assert!(error.to_string().len() < 1000, "{error}"),
            }
        }
    }
}
