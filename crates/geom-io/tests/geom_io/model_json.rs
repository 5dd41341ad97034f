//! The JSON format: nothing is lost, nothing damaged is taken for a model, nothing panics.

use crate::model_common::{curve, random_map, random_space, ring, sheet};
use geom_io::model::gismo::{parse_gismo, write_gismo};
use geom_io::model::json::{parse_json, write_json};
use geom_io::model::{Geometry, LengthUnit, Model, ModelErrorKind, WriteOptions, read_model, write_model};
use proptest::prelude::*;
use thb_core::{CellSpace, Kind, SplineMap};

fn written(model: &Model) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_json(&mut bytes, model).unwrap();
    bytes
}

/// Equal in every bit and in every number of a node, cell or function.
fn same_map<const D: usize>(a: &SplineMap<D>, b: &SplineMap<D>) -> bool {
    let bits = |map: &SplineMap<D>| map.coefficients().iter().map(|c| c.to_bits()).collect::<Vec<_>>();
    let (s, t) = (a.space(), b.space());
    s.kind() == t.kind()
        && s.mesh() == t.mesh()
        && (0..D).all(|d| s.knots(0, d).unwrap() == t.knots(0, d).unwrap())
        && (0..s.n_cells()).all(|cell| s.cell(cell).functions == t.cell(cell).functions)
        && a.dim() == b.dim()
        && bits(a) == bits(b)
}

fn kinds() -> impl Strategy<Value = Kind> {
    prop_oneof![Just(Kind::Thb), Just(Kind::Hb)]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn surfaces_come_back_to_the_last_bit(kind in kinds(), degree in [1_usize..=4, 1_usize..=4],
            elements in [1_usize..=5, 1_usize..=5], choices in prop::collection::vec(any::<u16>(), 0..6),
            dim in 1_usize..=4, seed: u64) {
        let map = random_map(random_space(kind, degree, elements, &choices), dim, seed);
        let mut model = Model::surface(map, LengthUnit::Inch);
        model.metadata.insert("deviation".to_owned(), serde_json::json!({"max": 0.1 + 0.2, "points": 17}));
        let bytes = written(&model);
        let back = parse_json(&bytes).unwrap();
        let (Geometry::Surface(a), Geometry::Surface(b)) = (&model.geometry, &back.geometry) else {
            return Err(TestCaseError::fail("no surface"));
        };
        prop_assert!(same_map(a, b));
        prop_assert_eq!(back.unit, LengthUnit::Inch);
        prop_assert_eq!(&back.metadata, &model.metadata);
        prop_assert_eq!(written(&back), bytes);
    }

    #[test]
    fn curves_come_back_to_the_last_bit(kind in kinds(), degree in 1_usize..=8, elements in 1_usize..=9,
            choices in prop::collection::vec(any::<u16>(), 0..6), seed: u64) {
        let map = random_map(random_space(kind, [degree], [elements], &choices), 3, seed);
        let model = Model::curve(map, LengthUnit::Metre);
        let back = parse_json(&written(&model)).unwrap();
        let (Geometry::Curve(a), Geometry::Curve(b)) = (&model.geometry, &back.geometry) else {
            return Err(TestCaseError::fail("no curve"));
        };
        prop_assert!(same_map(a, b));
    }

    #[test]
    fn damaged_files_are_models_or_errors(places in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
                                          end in any::<prop::sample::Index>()) {
        let intact = written(&Model::surface(sheet(Kind::Thb, [2, 2], [3, 2], 2), LengthUnit::Millimetre));
        let mut bytes = intact.clone();
        for (place, byte) in &places {
            // Digits, mostly: they keep the syntax and change the numbers.
            let place = place.index(bytes.len());
            bytes[place] = if byte % 4 == 0 { *byte } else { b'0' + byte % 10 };
        }
        if let Ok(model) = parse_json(&bytes) {
            prop_assert!(parse_json(&written(&model)).is_ok());
        }
        let cut = end.index(intact.len() - 2);
        let is_cut_off = matches!(parse_json(&intact[..cut]), Err(ModelErrorKind::Json { .. }));
        prop_assert!(is_cut_off);
    }
}

/// The file of a small surface with one piece of text replaced.
fn changed(from: &str, to: &str) -> Result<Model, ModelErrorKind> {
    let text =
        String::from_utf8(written(&Model::surface(sheet(Kind::Thb, [2, 2], [3, 2], 2), LengthUnit::Metre))).unwrap();
    assert!(text.contains(from), "{from} is not in the file");
    parse_json(text.replacen(from, to, 1).as_bytes())
}

#[test]
fn foreign_and_later_files_are_told_from_damaged_ones() {
    assert!(changed("metre", "metre").is_ok());
    assert!(matches!(parse_json(b"{}"), Err(ModelErrorKind::ForeignFormat { .. })));
    assert!(matches!(parse_json(b"[1, 2]"), Err(ModelErrorKind::ForeignFormat { .. })));
    assert!(matches!(parse_json(b"3"), Err(ModelErrorKind::Json { .. })));
    assert!(matches!(parse_json(b""), Err(ModelErrorKind::Json { .. })));
    assert!(
        matches!(changed("thb-spline-model", "mesh"), Err(ModelErrorKind::ForeignFormat { found, .. }) if found == "mesh")
    );
    assert!(matches!(changed("\"version\": 1", "\"version\": 3"), Err(ModelErrorKind::Version { found: 3, .. })));
    assert!(matches!(changed("\"dimension\": 2", "\"dimension\": 3"), Err(ModelErrorKind::Count { found: 3, .. })));
    assert!(matches!(changed("\"dimension\": 2", "\"dimension\": 1"), Err(ModelErrorKind::Count { found: 2, .. })));
    assert!(matches!(changed("\"thb\"", "\"nurbs\""), Err(ModelErrorKind::Json { .. })));
    assert!(matches!(changed("[2,2]", "[2,3]"), Err(ModelErrorKind::Spline(_))));
    assert!(matches!(changed("[2,2]", "[2]"), Err(ModelErrorKind::Count { .. })));
}

#[test]
fn periodic_maps_come_back_to_the_last_bit() {
    for torus in [false, true] {
        let map = ring(Kind::Thb, [3, 2], [8, 6], torus, 3);
        let bytes = written(&Model::surface(map.clone(), LengthUnit::Inch));
        assert!(String::from_utf8_lossy(&bytes).contains("\"version\": 2"));
        let Geometry::Surface(back) = parse_json(&bytes).unwrap().geometry else { panic!("no surface") };
        assert_eq!(back.space().periodic(), [true, torus]);
        assert!(same_map(&map, &back));
    }
    let few = changed("\"splits\"", "\"periodic\": [true, true], \"splits\"");
    assert!(matches!(few, Err(ModelErrorKind::Spline(_))), "{few:?}");
    let short = changed("\"splits\"", "\"periodic\": [true], \"splits\"");
    assert!(matches!(short, Err(ModelErrorKind::Count { what: "flags of periodic directions", .. })), "{short:?}");
}

/// What is read can be written in every format, so knots are refused of which round-off leaves nothing a period on.
#[test]
fn periodic_spans_that_vanish_are_refused() {
    for (first, is_sound) in [(6.251e-310, false), (1e-17, false), (1e-15, true)] {
        let text = format!(
            "{{\"format\": \"thb-spline-model\", \"version\": 2, \"dimension\": 1, \"kind\": \"thb\", \"unit\": \"millimetre\", \
             \"degrees\": [2], \"knots\": [[0.0, {first:e}, 0.25, 0.5, 1.0]], \"periodic\": [true], \"splits\": [], \
             \"coefficients\": [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]}}"
        );
        match parse_json(text.as_bytes()) {
            Ok(model) => {
                let mut xml = Vec::new();
                write_gismo(&mut xml, &model).unwrap();
                assert!(is_sound && parse_gismo(&xml).is_ok(), "{first:e}");
            }
            Err(error) => assert!(!is_sound && matches!(error, ModelErrorKind::Spline(_)), "{first:e}: {error}"),
        }
    }
}

#[test]
fn splits_must_name_leaf_cells() {
    assert!(matches!(
        changed("\"cells\":[[0,0]", "\"cells\":[[0,0],[0,0]"),
        Err(ModelErrorKind::Split { index: 1, .. })
    ));
    assert!(matches!(changed("\"cells\":[[0,0]", "\"cells\":[[9,0]"), Err(ModelErrorKind::Split { index: 0, .. })));
    assert!(matches!(changed("\"level\":0", "\"level\":1"), Err(ModelErrorKind::Split { index: 0, level: 1, .. })));
    // One split fewer is a mesh too, but not that of the coefficients.
    assert!(matches!(changed("\"cells\":[[0,0],", "\"cells\":["), Err(ModelErrorKind::Spline(_))));
}

#[test]
fn sizes_are_checked_before_memory_is_taken() {
    let huge = u64::MAX.to_string();
    assert!(matches!(changed("\"level\":0", &format!("\"level\":{huge}")), Err(ModelErrorKind::TooLarge { .. })));
    assert!(matches!(changed("[2,2]", &format!("[{huge},2]")), Err(ModelErrorKind::Spline(_))));
    // 40 000 elements a direction make 1.6 billion cells out of a file of half a megabyte.
    let inner: Vec<String> = (0..=40_000).map(|i| format!("{i}")).collect();
    let knots = format!("[0,{},40000]", inner.join(","));
    let file = |splits: &str, coefficients: &str| {
        format!(
            "{{\"format\":\"thb-spline-model\",\"version\":1,\"dimension\":2,\"kind\":\"thb\",\"unit\":\"inch\",\
             \"degrees\":[1,1],\"knots\":[{knots},[0,0,1,1]],\"splits\":[{splits}],\"coefficients\":[{coefficients}]}}"
        )
    };
    assert!(matches!(parse_json(file("", "[0.0]").as_bytes()), Err(ModelErrorKind::Count { .. })));
    let coefficients = vec!["[0.5]"; 80_002].join(",");
    assert!(parse_json(file("", &coefficients).as_bytes()).is_ok());
    let deep = file("{\"level\":13,\"cells\":[]}", &coefficients);
    assert!(matches!(parse_json(deep.as_bytes()), Err(ModelErrorKind::TooLarge { .. })));
}

#[test]
fn rows_have_one_length() {
    let text = String::from_utf8(written(&Model::curve(curve(2), LengthUnit::Metre))).unwrap();
    let last = text.rfind("],\n[").unwrap();
    let ragged = format!("{},1.0{}", &text[..last], &text[last..]);
    assert!(matches!(
        parse_json(ragged.as_bytes()),
        Err(ModelErrorKind::RaggedCoefficients { found: 4, expected: 3, .. })
    ));
    let infinite = text.replacen("\"coefficients\": [\n[", "\"coefficients\": [\n[1e999,", 1);
    assert!(matches!(parse_json(infinite.as_bytes()), Err(ModelErrorKind::Json { .. })));
}

#[test]
fn the_extension_chooses_the_format_and_errors_name_the_file() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("model_json");
    std::fs::create_dir_all(&folder).unwrap();
    let model = Model::curve(curve(2), LengthUnit::Inch);
    let write = |name: &str| write_model(&folder.join(name), &model, &WriteOptions::default());
    let starts = |name: &str| std::fs::read(folder.join(name)).unwrap()[0];
    for (name, first) in [("a.json", b'{'), ("a.XML", b'<'), ("a.step", b'I'), ("a.stp", b'I')] {
        write(name).unwrap();
        assert_eq!(starts(name), first);
    }
    assert_eq!(read_model(&folder.join("a.json")).unwrap().unit, LengthUnit::Inch);
    assert_eq!(read_model(&folder.join("a.XML")).unwrap().unit, LengthUnit::Inch);
    let unknown = [write("a.iges").unwrap_err(), read_model(&folder.join("a.step")).unwrap_err()];
    for error in unknown {
        assert!(matches!(error.kind, ModelErrorKind::UnknownExtension { .. }));
    }
    let missing = read_model(&folder.join("missing.json")).unwrap_err();
    assert!(matches!(missing.kind, ModelErrorKind::Read(_)) && missing.to_string().contains("missing.json"));
    let no_folder = write("none/a.json").unwrap_err();
    assert!(matches!(no_folder.kind, ModelErrorKind::Write(_)));
    assert_eq!(no_folder.to_string().matches("a.json").count(), 1);
}
