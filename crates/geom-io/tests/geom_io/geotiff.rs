//! Heights in GeoTIFF: kinds of numbers, layouts, places and marks of no data.

use std::io::Cursor;

use geom_io::{Format, LengthUnit, ReadErrorKind, ReadOptions, Scan, parse_scan};
use tiff::encoder::colortype::{ColorType, Gray8, Gray16, Gray32Float, Gray64Float, GrayI16, GrayI32, RGB8};
use tiff::encoder::{Compression, DeflateLevel, TiffEncoder, TiffValue};
use tiff::tags::Tag;

const SIZES: [[u32; 2]; 4] = [[2, 2], [13, 9], [40, 3], [31, 64]];

/// The height of a cell, a whole number from 1 to 100.
fn height(column: u32, row: u32) -> u8 {
    1 + ((3 * column * column + 7 * row + column * row) % 100) as u8
}

/// Where a grid is: what its tags say.
#[derive(Clone, Default)]
struct Tags {
    scale: Option<[f64; 3]>,
    tie: Option<[f64; 6]>,
    transformation: Option<[f64; 16]>,
    keys: Vec<[u16; 3]>,
    no_data: Option<&'static str>,
}

impl Tags {
    fn placed() -> Self {
        Self { scale: Some([0.5, 2.0, 0.0]), tie: Some([0.0, 0.0, 0.0, 1000.0, 5000.0, 0.0]), ..Self::default() }
    }
}

fn written<C: ColorType>(
    [columns, rows]: [u32; 2],
    compression: Compression,
    rows_per_strip: u32,
    tags: &Tags,
    value: impl Fn(u32, u32) -> C::Inner,
) -> Vec<u8>
where
    [C::Inner]: TiffValue,
{
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).unwrap().with_compression(compression);
    let mut image = encoder.new_image::<C>(columns, rows).unwrap();
    image.rows_per_strip(rows_per_strip).unwrap();
    let directory = image.encoder();
    if let Some(scale) = &tags.scale {
        directory.write_tag(Tag::ModelPixelScaleTag, &scale[..]).unwrap();
    }
    if let Some(tie) = &tags.tie {
        directory.write_tag(Tag::ModelTiepointTag, &tie[..]).unwrap();
    }
    if let Some(matrix) = &tags.transformation {
        directory.write_tag(Tag::ModelTransformationTag, &matrix[..]).unwrap();
    }
    if !tags.keys.is_empty() {
        let mut keys = vec![1, 1, 0, tags.keys.len() as u16];
        tags.keys.iter().for_each(|&[key, count, value]| keys.extend([key, 0, count, value]));
        directory.write_tag(Tag::GeoKeyDirectoryTag, &keys[..]).unwrap();
    }
    if let Some(no_data) = tags.no_data {
        directory.write_tag(Tag::GdalNodata, no_data).unwrap();
    }
    let values: Vec<C::Inner> =
        (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j))).map(|(i, j)| value(i, j)).collect();
    image.write_data(&values).unwrap();
    bytes.into_inner()
}

fn read(bytes: &[u8]) -> Scan {
    parse_scan(bytes, Format::GeoTiff, &ReadOptions::default()).unwrap()
}

fn fail(bytes: &[u8]) -> ReadErrorKind {
    parse_scan(bytes, Format::GeoTiff, &ReadOptions::default()).unwrap_err()
}

fn points(scan: &Scan) -> Vec<[f64; 3]> {
    scan.cloud.points.outer_iter().map(|p| [p[0], p[1], p[2]]).collect()
}

/// The points of a grid with the first cell's centre at `first`, in row order of the scan: columns from west, each from the south.
fn expected([columns, rows]: [u32; 2], first: [f64; 2], step: [f64; 2]) -> Vec<[f64; 3]> {
    let cells = (0..columns).flat_map(|i| (0..rows).rev().map(move |j| (i, j)));
    cells
        .map(|(i, j)| [first[0] + step[0] * f64::from(i), first[1] - step[1] * f64::from(j), height(i, j).into()])
        .collect()
}

#[test]
fn every_kind_of_number_and_layout() {
    for size in SIZES {
        let expected = expected(size, [1000.25, 4999.0], [0.5, 2.0]);
        for compression in [Compression::Uncompressed, Compression::Lzw, Compression::Deflate(DeflateLevel::Balanced)] {
            for strip in [1, 4, size[1]] {
                let tags = Tags::placed();
                let written = [
                    written::<Gray8>(size, compression, strip, &tags, height),
                    written::<Gray16>(size, compression, strip, &tags, |i, j| height(i, j).into()),
                    written::<GrayI16>(size, compression, strip, &tags, |i, j| height(i, j).into()),
                    written::<GrayI32>(size, compression, strip, &tags, |i, j| height(i, j).into()),
                    written::<Gray32Float>(size, compression, strip, &tags, |i, j| height(i, j).into()),
                    written::<Gray64Float>(size, compression, strip, &tags, |i, j| height(i, j).into()),
                ];
                for bytes in &written {
                    let scan = read(bytes);
                    assert_eq!(points(&scan), expected, "{size:?} {strip}");
                    let grid = scan.cloud.grid.unwrap();
                    assert_eq!([grid.n_u, grid.n_v], size.map(|n| n as usize));
                    assert_eq!((scan.cell, scan.notes.len()), (Some([0.5, 2.0]), 0), "{:?}", scan.notes);
                    // The first point is the south-western cell, the last but one of the file's lines.
                    assert_eq!(scan.rows[0], size[0] * (size[1] - 1));
                }
            }
        }
    }
}

#[test]
fn places_units_and_no_data() {
    let size = [13, 9];
    let float =
        |tags: &Tags| written::<Gray32Float>(size, Compression::Uncompressed, 9, tags, |i, j| height(i, j).into());
    // Raster type 2: the tie is the centre of a cell, here of the third column and second row.
    let tie = Some([2.0, 1.0, 0.0, 1000.0, 5000.0, 0.0]);
    let point = Tags { tie, keys: vec![[1025, 1, 2], [3076, 1, 9001]], ..Tags::placed() };
    let scan = read(&float(&point));
    assert_eq!(points(&scan), expected(size, [999.0, 5002.0], [0.5, 2.0]));
    assert_eq!(scan.unit, Some(LengthUnit::Metre));
    let foot = Tags { keys: vec![[1024, 1, 1], [1025, 1, 1], [3076, 1, 9002]], ..Tags::placed() };
    assert_eq!(read(&float(&foot)).unit, Some(LengthUnit::Foot));
    let degrees = Tags { keys: vec![[1024, 1, 2]], ..Tags::placed() };
    assert!(read(&float(&degrees)).notes[0].contains("degrees"));
    // Without tags, and by a matrix that runs to the north.
    let bare = read(&float(&Tags::default()));
    assert_eq!(points(&bare), expected(size, [0.5, 8.5], [1.0, 1.0]));
    assert!(bare.notes[0].contains("where its cells are"));
    let mut matrix = [0.0; 16];
    (matrix[0], matrix[3], matrix[5], matrix[7], matrix[15]) = (0.5, 100.0, -2.0, 200.0, 1.0);
    let by_matrix = |matrix| float(&Tags { transformation: Some(matrix), ..Tags::default() });
    assert_eq!(points(&read(&by_matrix(matrix))), expected(size, [100.25, 199.0], [0.5, 2.0]));
    matrix[5] = 2.0;
    let to_north = read(&by_matrix(matrix));
    assert_eq!(points(&to_north)[0], [100.25, 201.0, height(0, 0).into()]);
    assert_eq!(points(&to_north)[1], [100.25, 203.0, height(0, 1).into()]);
    matrix[1] = 0.1;
    assert!(fail(&by_matrix(matrix)).to_string().contains("turned"));
    matrix[0] = -1.0;
    matrix[1] = 0.0;
    assert!(fail(&by_matrix(matrix)).to_string().contains("no place in a grid"));
    matrix[0] = 1e200;
    assert!(matches!(fail(&by_matrix(matrix)), ReadErrorKind::GridRange { axis: "x", .. }));

    for (declared, value) in [
        ("-9999", -9999.0),
        ("-3.4028234663852886e+38", f32::MIN),
        ("-3.4e+38", f32::MIN),
        ("nan", f32::NAN),
        ("0", f32::INFINITY),
        ("-32768", -32768.0),
    ] {
        let tags = Tags { no_data: Some(declared), ..Tags::placed() };
        let is_blind = |i: u32, j: u32| (i + j).is_multiple_of(5);
        let value = |i: u32, j: u32| if is_blind(i, j) { value } else { height(i, j).into() };
        let scan = read(&written::<Gray32Float>(size, Compression::Lzw, 2, &tags, value));
        let seen = (0..13 * 9).filter(|k| !is_blind(k % 13, k / 13)).count();
        assert_eq!((scan.cloud.points.nrows(), scan.cloud.grid), (seen, None), "{declared}");
        assert!(scan.cloud.points.column(2).iter().all(|z| (1.0..=100.0).contains(z)), "{declared}");
        assert_eq!(scan.notes.len(), 1, "{:?}", scan.notes);
    }
}

#[test]
fn what_is_no_grid_of_heights_or_not_there_is_an_error_in_bounds() {
    let mut picture = Cursor::new(Vec::new());
    TiffEncoder::new(&mut picture).unwrap().write_image::<RGB8>(4, 3, &[7; 36]).unwrap();
    let picture = picture.into_inner();
    assert!(fail(&picture).to_string().contains("picture"));
    let thin = written::<Gray8>([1, 5], Compression::Uncompressed, 5, &Tags::placed(), height);
    assert!(matches!(fail(&thin), ReadErrorKind::GridTooSmall { n_u: 1, n_v: 5 }));
    let whole = written::<Gray32Float>([13, 9], Compression::Lzw, 2, &Tags::placed(), |i, j| height(i, j).into());
    for cut in 0..whole.len() {
        assert!(parse_scan(&whole[..cut], Format::GeoTiff, &ReadOptions::default()).is_err(), "{cut}");
    }
    // A header that announces more than the file can hold, byte by byte.
    for at in 0..whole.len() {
        for value in [0, 1, 0x7f, 0xff] {
            let mut bytes = whole.clone();
            bytes[at] = value;
            let _ = parse_scan(&bytes, Format::GeoTiff, &ReadOptions::default());
        }
    }
    // A value that is said to be longer than the file is refused before there is room for it: here of the first tag.
    let directory = u32::from_le_bytes(whole[4..8].try_into().unwrap()) as usize;
    for (kind, count) in [(2_u16, 1_u32 << 27), (4, 1 << 25), (12, 1 << 24)] {
        let mut bytes = whole.clone();
        bytes[directory + 4..directory + 6].copy_from_slice(&kind.to_le_bytes());
        bytes[directory + 6..directory + 10].copy_from_slice(&count.to_le_bytes());
        assert!(fail(&bytes).to_string().contains("bytes, more than the file"), "{kind}");
    }
    // Heights that are all alike expand by far more than those of a scan.
    let flat =
        |n: u32| written::<Gray8>([n, n], Compression::Deflate(DeflateLevel::Best), n, &Tags::placed(), |_, _| 1);
    assert_eq!(read(&flat(1000)).cloud.points.nrows(), 1_000_000);
    let large = flat(2000);
    assert!(matches!(fail(&large), ReadErrorKind::Expansion { compressed, .. } if compressed == large.len()));
    let more = ReadOptions { max_expand: Some(2000), ..ReadOptions::default() };
    assert_eq!(parse_scan(&large, Format::GeoTiff, &more).unwrap().cloud.points.nrows(), 4_000_000);
}
