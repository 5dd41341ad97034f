//! What is written is read back to the last bit.

use std::fmt::Write as _;
use std::io;
use std::path::Path;

use geom_io::{
    Format, MeshFormat, MeshStyle, MeshWithScalars, ReadOptions, Scalars, Scan, WriteError, parse_scan, read_scan,
    write_atomically, write_mesh,
};
use ndarray::{Array1, Array2, Axis, arr1, arr2};
use proptest::prelude::*;

fn read(format: Format, text: impl AsRef<[u8]>) -> Scan {
    parse_scan(text.as_ref(), format, &ReadOptions::default()).unwrap()
}

fn same_bits(a: &Array2<f64>, b: &Array2<f64>) -> bool {
    a.dim() == b.dim() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// Any number that a coordinate may be.
fn number() -> impl Strategy<Value = f64> {
    use prop::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    let any = POSITIVE | NEGATIVE | NORMAL | SUBNORMAL | ZERO;
    prop_oneof![any.prop_map(|value| if value.abs() > 1e100 { value * 1e-209 } else { value }), -1e3..1e3]
}

fn matrix(columns: usize) -> impl Strategy<Value = Array2<f64>> {
    prop::collection::vec(number(), columns..40 * columns).prop_map(move |mut values| {
        values.truncate(values.len() / columns * columns);
        Array2::from_shape_vec((values.len() / columns, columns), values).unwrap()
    })
}

/// Rows as lines.
fn table(rows: &Array2<f64>, separator: &str, line_end: &str, exponents: bool) -> String {
    let spell = |value: &f64| if exponents { format!("{value:e}") } else { format!("{value:?}") };
    rows.rows().into_iter().map(|row| row.iter().map(spell).collect::<Vec<_>>().join(separator) + line_end).collect()
}

fn separator() -> impl Strategy<Value = &'static str> {
    prop::sample::select(&[" ", "\t", "  ", ",", ", ", ";", " ; "][..])
}

fn line_end() -> impl Strategy<Value = &'static str> {
    prop::sample::select(&["\n", "\r\n", "\r", " \n\n"][..])
}

/// Triangles on `vertices` vertices.
fn triangles(vertices: usize, seed: &[u32]) -> Vec<[u32; 3]> {
    let index = |k: u32| k % vertices as u32;
    seed.chunks_exact(3).map(|c| [index(c[0]), index(c[1]), index(c[2])]).collect()
}

proptest! {
    #[test]
    fn text(
        points in prop_oneof![matrix(2), matrix(3)],
        separator in separator(), line_end in line_end(), exponents in any::<bool>(),
    ) {
        let scan = read(Format::Xyz, table(&points, separator, line_end, exponents));
        prop_assert!(same_bits(&scan.cloud.points, &points));
        prop_assert!(scan.notes.is_empty());
    }

    #[test]
    fn csv(rows in matrix(5), separator in separator(), line_end in line_end(), exponents in any::<bool>()) {
        let header = ["v", "y", "z", "u", "x"].join(separator);
        let scan = read(Format::Csv, header + line_end + &table(&rows, separator, line_end, exponents));
        prop_assert!(same_bits(&scan.cloud.points, &rows.select(Axis(1), &[4, 1, 2])));
        prop_assert!(same_bits(&scan.cloud.parameters.unwrap(), &rows.select(Axis(1), &[3, 0])));
    }

    /// A grid is put in order, whatever the order of its rows.
    #[test]
    fn csv_grid(n_u in 1_usize..6, n_v in 1_usize..6, base in 0_usize..2, order in any::<u64>()) {
        let mut rows: Vec<_> = (0..n_u * n_v).collect();
        rows.sort_by_key(|&k| (k as u64 + 1).wrapping_mul(order | 1).rotate_left(17));
        let mut text = "x,y,i,j\n".to_owned();
        for k in rows {
            writeln!(text, "{k},-{k},{},{}", k / n_v + base, k % n_v + base).unwrap();
        }
        let scan = read(Format::Csv, text);
        let expected: Vec<_> = (0..n_u * n_v).map(|k| k as f64).collect();
        prop_assert_eq!(scan.cloud.points.column(0).to_vec(), expected);
        let grid = scan.cloud.grid.unwrap();
        prop_assert_eq!((grid.n_u, grid.n_v), (n_u, n_v));
    }

    #[test]
    fn esri_grid(
        n_u in 2_usize..7, n_v in 2_usize..7, heights in prop::collection::vec(number(), 36), step in 0.1..10.0,
    ) {
        let heights: Vec<_> = heights.into_iter().map(|h| if h == -9999.0 { 0.0 } else { h }).collect();
        let northern_first = Array2::from_shape_fn((n_v, n_u), |(row, i)| heights[i * n_v + (n_v - 1 - row)]);
        let header = format!("ncols {n_u}\nnrows {n_v}\nxllcenter 7\nyllcenter -3\ncellsize {step:?}\n");
        let scan = read(Format::EsriGrid, header + &table(&northern_first, " ", "\n", false));
        let expected = Array2::from_shape_fn((n_u * n_v, 3), |(k, axis)| match axis {
            0 => 7.0 + (k / n_v) as f64 * step,
            1 => -3.0 + (k % n_v) as f64 * step,
            _ => heights[k],
        });
        prop_assert!(same_bits(&scan.cloud.points, &expected));
        let parameters = scan.cloud.parameters.unwrap();
        let last = parameters.nrows() - 1;
        prop_assert_eq!(parameters.row(0).to_vec(), [0.0, 0.0]);
        prop_assert_eq!(parameters.row(last).to_vec(), [1.0, 1.0]);
    }

    #[test]
    fn gismo(rows in matrix(5), transposed in any::<bool>()) {
        let parameters = rows.select(Axis(1), &[0, 1]);
        let points = rows.select(Axis(1), &[2, 3, 4]);
        let matrix = |id: usize, values: &Array2<f64>| {
            let layout = if transposed { values.clone() } else { values.t().as_standard_layout().into_owned() };
            let (rows, cols) = layout.dim();
            format!("<Matrix rows=\"{rows}\" cols=\"{cols}\" id=\"{id}\">{}</Matrix>", table(&layout, " ", "\n", true))
        };
        // Two or three points make square matrices, which read in G+Smo's layout.
        prop_assume!(!transposed || rows.nrows() > 3);
        let scan = read(Format::GismoXml, format!("<xml>{}{}</xml>", matrix(1, &points), matrix(0, &parameters)));
        prop_assert!(same_bits(&scan.cloud.points, &points));
        prop_assert!(same_bits(&scan.cloud.parameters.unwrap(), &parameters));
    }

    #[test]
    fn off(points in matrix(3), seed in prop::collection::vec(any::<u32>(), 3..60)) {
        let triangles = triangles(points.nrows(), &seed);
        let mut text = format!("OFF\n{} {} 0\n{}", points.nrows(), triangles.len(), table(&points, " ", "\n", false));
        triangles.iter().for_each(|[a, b, c]| writeln!(text, "3 {a} {b} {c}").unwrap());
        let scan = read(Format::Off, text);
        prop_assert!(same_bits(&scan.cloud.points, &points));
        prop_assert_eq!(scan.triangles, Some(triangles));
    }

    #[test]
    fn ply_ascii(points in matrix(3), seed in prop::collection::vec(any::<u32>(), 3..60)) {
        let triangles = triangles(points.nrows(), &seed);
        let mut text = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
             element face {}\nproperty list uchar int vertex_indices\nend_header\n{}",
            points.nrows(), triangles.len(), table(&points, " ", "\n", true)
        );
        triangles.iter().for_each(|[a, b, c]| writeln!(text, "3 {a} {b} {c}").unwrap());
        let scan = read(Format::Ply, text);
        prop_assert!(same_bits(&scan.cloud.points, &points));
        prop_assert_eq!(scan.triangles, Some(triangles));
    }
}

proptest! {
    // Each case writes two files and waits until they are on disk.
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn written_meshes(rows in matrix(4), seed in prop::collection::vec(any::<u32>(), 3..60)) {
        let vertices = rows.select(Axis(1), &[0, 1, 2]);
        let triangles = triangles(vertices.nrows(), &seed);
        let scalars = Some(Scalars { name: "deviation", values: rows.column(3) });
        let mesh = MeshWithScalars { vertices: vertices.view(), triangles: &triangles, scalars };
        let folder = tempfile::tempdir().unwrap();
        for name in ["mesh.PLY", "mesh.obj"] {
            let path = folder.path().join(name);
            write_mesh(&path, &mesh, &MeshStyle::default()).unwrap();
            let scan = read_scan(&path, &ReadOptions::default()).unwrap();
            prop_assert!(same_bits(&scan.cloud.points, &vertices));
            prop_assert_eq!(scan.triangles.as_ref(), Some(&triangles));
            prop_assert!(scan.notes.is_empty());
        }
    }
}

/// Two triangles with deviations −1, 0, 1 and 0.
fn square() -> (Array2<f64>, Vec<[u32; 3]>, Array1<f64>) {
    let vertices = arr2(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.5]]);
    (vertices, vec![[0, 1, 2], [0, 2, 3]], arr1(&[-1.0, 0.0, 1.0, 0.0]))
}

fn written(name: &str, scalar_name: &str) -> Vec<u8> {
    let (vertices, triangles, values) = square();
    let scalars = Some(Scalars { name: scalar_name, values: values.view() });
    let mesh = MeshWithScalars { vertices: vertices.view(), triangles: &triangles, scalars };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    write_mesh(&path, &mesh, &MeshStyle::default()).unwrap();
    std::fs::read(path).unwrap()
}

/// Position just after `marker`.
fn after(bytes: &[u8], marker: &str) -> usize {
    let place = bytes.windows(marker.len()).position(|window| window == marker.as_bytes());
    place.unwrap_or_else(|| panic!("no {marker:?}")) + marker.len()
}

#[test]
fn ply_carries_deviation_and_colours() {
    let bytes = written("a.ply", "deviation in mm");
    after(&bytes, "property float deviation_in_mm\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n");
    let start = after(&bytes, "end_header\n");
    // Three doubles, a float and three bytes a vertex.
    let records: Vec<_> = bytes[start..][..4 * 31].chunks(31).map(|record| (&record[24..28], &record[28..])).collect();
    assert_eq!(records[0], (&(-1.0_f32).to_le_bytes()[..], &[59, 76, 192][..]));
    assert_eq!(records[1], (&0.0_f32.to_le_bytes()[..], &[221, 221, 221][..]));
    assert_eq!(records[2], (&1.0_f32.to_le_bytes()[..], &[180, 4, 38][..]));
}

#[test]
fn vtk_layout() {
    let bytes = written("a.vtk", "deviation");
    let (vertices, _, values) = square();
    assert!(
        bytes.starts_with(b"# vtk DataFile Version 3.0\ntriangle mesh\nBINARY\nDATASET POLYDATA\nPOINTS 4 double\n")
    );
    let doubles = |start: usize, count: usize| -> Vec<f64> {
        bytes[start..][..8 * count].chunks(8).map(|c| f64::from_be_bytes(c.try_into().unwrap())).collect()
    };
    assert_eq!(doubles(after(&bytes, "double\n"), 12), vertices.iter().copied().collect::<Vec<_>>());
    let start = after(&bytes, "\nPOLYGONS 2 8\n");
    let cells: Vec<_> = bytes[start..][..32].chunks(4).map(|c| u32::from_be_bytes(c.try_into().unwrap())).collect();
    assert_eq!(cells, [3, 0, 1, 2, 3, 0, 2, 3]);
    let start = after(&bytes, "\nPOINT_DATA 4\nSCALARS deviation double 1\nLOOKUP_TABLE default\n");
    assert_eq!(doubles(start, 4), values.to_vec());
    assert_eq!(bytes.len(), start + 4 * 8 + 1);
}

#[test]
fn inconsistent_meshes_are_not_written() {
    let (vertices, triangles, values) = square();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let write = |mesh: &MeshWithScalars<'_>| write_mesh(&path, mesh, &MeshStyle::default()).unwrap_err();
    let good = MeshWithScalars { vertices: vertices.view(), triangles: &triangles, scalars: None };

    let planar = arr2(&[[0.0, 0.0]]);
    let error = write(&MeshWithScalars { vertices: planar.view(), ..good.clone() });
    assert!(matches!(error, WriteError::NotSpatial { columns: 2 }));
    let error = write(&MeshWithScalars { triangles: &[[0, 1, 2], [0, 4, 1]], ..good.clone() });
    assert!(matches!(error, WriteError::IndexOutOfRange { triangle: 1, index: 4, count: 4 }));
    let mut broken = vertices.clone();
    broken[[2, 1]] = f64::NAN;
    let error = write(&MeshWithScalars { vertices: broken.view(), ..good.clone() });
    assert!(matches!(error, WriteError::NonFinite { vertex: 2, .. }));
    let with = |values| Some(Scalars { name: "deviation", values });
    let error = write(&MeshWithScalars { scalars: with(values.view().split_at(Axis(0), 3).0), ..good.clone() });
    assert!(matches!(error, WriteError::ScalarCount { values: 3, vertices: 4, .. }));
    let infinite = arr1(&[0.0, 1.0, 2.0, f64::INFINITY]);
    let error = write(&MeshWithScalars { scalars: with(infinite.view()), ..good.clone() });
    assert!(matches!(error, WriteError::NonFinite { vertex: 3, quantity, .. } if quantity == "deviation"));
    let corner = arr2(&[[0.0, 0.0, 0.0]]);
    let error = write(&MeshWithScalars { vertices: corner.broadcast((1 << 31, 3)).unwrap(), ..good.clone() });
    assert!(matches!(error, WriteError::TooLarge { count: 0x8000_0000, limit: 0x7fff_ffff }));
    let error = write_mesh(Path::new("a.stl"), &good, &MeshStyle::default()).unwrap_err();
    assert!(matches!(error, WriteError::UnknownExtension { supported, .. } if supported == ".obj, .ply, .vtk"));
    assert_eq!(MeshFormat::from_path(Path::new("A.VTK")).unwrap(), MeshFormat::Vtk);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_failed_write_leaves_the_old_file_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("result.txt");
    write_atomically(&path, |out| out.write_all(b"old")).unwrap();
    let error = write_atomically(&path, |out| {
        out.write_all(b"half of the new")?;
        Err(io::Error::other("the disk is full"))
    });
    assert!(matches!(&error, Err(WriteError::Io { path: named, .. }) if *named == path), "{error:?}");
    assert!(error.unwrap_err().to_string().ends_with("cannot be written: the disk is full"));
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);

    write_atomically(&path, |out| out.write_all(b"new")).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"new");
    assert!(write_atomically(folder.path(), |_| Ok(())).is_err());
    assert!(write_atomically(&folder.path().join("no/such/folder"), |_| Ok(())).is_err());
}

#[cfg(unix)]
#[test]
fn links_sockets_and_permissions() {
    use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
    let folder = tempfile::tempdir().unwrap();
    let (plain, atomic, link) = (folder.path().join("plain"), folder.path().join("atomic"), folder.path().join("link"));
    std::fs::write(&plain, "").unwrap();
    symlink(&atomic, &link).unwrap();
    write_atomically(&atomic, |_| Ok(())).unwrap();
    let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&atomic), mode(&plain));

    write_atomically(&link, |out| out.write_all(b"through")).unwrap();
    assert!(link.is_symlink());
    assert_eq!(std::fs::read(&atomic).unwrap(), b"through");

    // Neither a file nor a folder: not to be replaced by one.
    let socket = folder.path().join("socket");
    let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
    assert!(write_atomically(&socket, |_| Ok(())).is_err());
    assert!(std::fs::metadata(&socket).unwrap().file_type().is_socket());
}
