//! G+Smo's XML: what is written comes back; files of G+Smo's own making are read; nothing panics.

use crate::model_common::{curve, random_map, random_space, ring};
use geom_io::model::gismo::{parse_gismo, write_gismo};
use geom_io::model::{Geometry, LengthUnit, Model, ModelErrorKind};
use proptest::prelude::*;
use thb_core::{CellSpace, Kind, SplineMap};

fn written(model: &Model) -> String {
    let mut bytes = Vec::new();
    write_gismo(&mut bytes, model).unwrap();
    String::from_utf8(bytes).unwrap()
}

/// Equal up to the order in which cells were split, which the format does not keep.
fn same_map<const D: usize>(a: &SplineMap<D>, b: &SplineMap<D>) -> bool {
    let (s, t) = (a.space(), b.space());
    let corners = |map: &SplineMap<D>| -> Vec<_> {
        (0..map.space().n_cells()).map(|cell| (map.space().cell(cell).lower, map.space().cell(cell).upper)).collect()
    };
    s.kind() == t.kind()
        && corners(a) == corners(b)
        && (0..s.n_cells()).all(|cell| s.cell(cell).functions == t.cell(cell).functions)
        && a.coefficients().iter().zip(b.coefficients()).all(|(x, y)| x.to_bits() == y.to_bits())
}

#[test]
fn periodic_maps_are_written_opened() {
    for (torus, kind) in [(false, Kind::Thb), (true, Kind::Hb)] {
        let map = ring(kind, [3, 2], [8, 6], torus, 3);
        let back = parse_gismo(written(&Model::surface(map.clone(), LengthUnit::Millimetre)).as_bytes()).unwrap();
        let Geometry::Surface(back) = back.geometry else { panic!("no surface") };
        assert_eq!(back.space().periodic(), [false; 2]);
        assert!(back.space().n_functions() > map.space().n_functions());
        for i in 0..400 {
            let u = [f64::from(i % 20) / 19.0, f64::from(i / 20) / 19.0];
            let (a, b) = (back.eval(u).unwrap(), map.eval(u).unwrap());
            assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-12 * 60.0), "{u:?}: {a:?} {b:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn surfaces_come_back_to_the_last_bit(thb: bool, degree in [1_usize..=4, 1_usize..=4],
            elements in [1_usize..=5, 1_usize..=5], choices in prop::collection::vec(any::<u16>(), 0..6), seed: u64) {
        let kind = if thb { Kind::Thb } else { Kind::Hb };
        let map = random_map(random_space(kind, degree, elements, &choices), 3, seed);
        let model = Model::surface(map, LengthUnit::Metre);
        let back = parse_gismo(written(&model).as_bytes()).unwrap();
        prop_assert_eq!(back.unit, LengthUnit::Metre);
        let (Geometry::Surface(a), Geometry::Surface(b)) = (&model.geometry, &back.geometry) else {
            return Err(TestCaseError::fail("no surface"));
        };
        prop_assert!(same_map(a, b));
    }

    #[test]
    fn damaged_files_are_models_or_errors(places in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5)) {
        let map = random_map(random_space(Kind::Thb, [2, 1], [3, 2], &[1, 5]), 2, 1);
        let mut bytes = written(&Model::surface(map, LengthUnit::Millimetre)).into_bytes();
        for (place, byte) in places {
            let place = place.index(bytes.len());
            bytes[place] = if byte % 4 == 0 { byte } else { b'0' + byte % 10 };
        }
        if let Ok(model) = parse_gismo(&bytes) {
            prop_assert!(parse_gismo(written(&model).as_bytes()).is_ok());
        }
    }
}

#[test]
fn curves_come_back() {
    let model = Model::curve(curve(3), LengthUnit::Inch);
    let back = parse_gismo(written(&model).as_bytes()).unwrap();
    let (Geometry::Curve(a), Geometry::Curve(b)) = (&model.geometry, &back.geometry) else { panic!("no curve") };
    assert!(same_map(a, b));
}

/// A bilinear height field on 2 × 1 cells as G+Smo prints it, with the given boxes and number of coefficients.
fn bilinear(boxes: &str, n: usize) -> String {
    let coefficients: Vec<String> = (0..n).map(|i| format!("{i} 0 {}", i * i)).collect();
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<xml>\n <Geometry type=\"THBSpline2\" id=\"0\">\n\
         <Basis type=\"THBSplineBasis2\">\n<Basis type=\"TensorBSplineBasis2\">\n\
         <Basis type=\"BSplineBasis\" index=\"0\"><KnotVector degree=\"1\">0 0 0.5 1 1 </KnotVector></Basis>\n\
         <Basis type=\"BSplineBasis\" index=\"1\"><KnotVector degree=\"1\">0 0 1 1 </KnotVector></Basis>\n\
         </Basis>\n{boxes}</Basis>\n<coefs geoDim=\"3\">{} \n</coefs>\n</Geometry>\n</xml>\n",
        coefficients.join("\n")
    )
}

#[test]
fn boxes_are_in_cells_of_their_level() {
    // Level 1 has 4 × 2 cells; the left half of them is refined, its lower left quarter once more, in two boxes.
    let boxes = "<box level=\"1\">0 0 2 2 \n</box><box level=\"2\">0 0 1 2</box>\n<box level=\"2\">1 0 2 2</box>";
    let model = parse_gismo(bilinear(boxes, 13).as_bytes()).unwrap();
    assert_eq!(model.unit, LengthUnit::Millimetre);
    let Geometry::Surface(map) = model.geometry else { panic!("no surface") };
    assert_eq!(map.space().functions_per_level(), [4, 5, 4]);
    assert_eq!(map.space().n_cells(), 1 + 3 + 4);
    // At the corners of the domain a bilinear spline is its coefficient.
    assert_eq!(map.eval([1.0, 0.0]).unwrap(), [1.0, 0.0, 1.0]);
}

#[test]
fn tensor_products_are_read() {
    let file =
        bilinear("", 6).replace("THBSpline2", "TensorBSpline2").replace("THBSplineBasis2", "TensorBSplineBasis2");
    // In a tensor product the basis of the geometry holds the univariate bases itself.
    let file = file.replacen("<Basis type=\"TensorBSplineBasis2\">\n<Basis", "<Basis", 1).replacen(
        "</Basis>\n</Basis>\n</Basis>",
        "</Basis>\n</Basis>",
        1,
    );
    let Geometry::Surface(map) = parse_gismo(file.as_bytes()).unwrap().geometry else { panic!("no surface") };
    assert_eq!(map.eval([1.0, 1.0]).unwrap(), [5.0, 0.0, 25.0]);
    assert_eq!(map.eval([0.25, 0.0]).unwrap(), [0.5, 0.0, 0.5]);
}

#[test]
fn each_fault_has_its_error() {
    let parse = |text: &str| parse_gismo(text.as_bytes());
    let boxed = |boxes: &str| parse(&bilinear(boxes, 13));
    assert!(parse(&bilinear("", 6)).is_ok());
    assert!(matches!(parse(&bilinear("", 7)), Err(ModelErrorKind::Spline(_))));
    assert!(matches!(parse(&bilinear("", 5)), Err(ModelErrorKind::Count { found: 5, .. })));
    assert!(matches!(parse("<xml><Geometry"), Err(ModelErrorKind::Xml { .. })));
    assert!(matches!(parse("<xml><Matrix/></xml>"), Err(ModelErrorKind::Geometries { found: 0 })));
    assert!(matches!(parse("<xml><Geometry type=\"Mesh\"/></xml>"), Err(ModelErrorKind::GeometryType { .. })));
    assert!(matches!(parse("<xml><Geometry type=\"THBSpline2\"/></xml>"), Err(ModelErrorKind::Element { .. })));
    assert!(matches!(parse(&bilinear("", 6).replace("0.5", "half")), Err(ModelErrorKind::Value { .. })));
    assert!(matches!(parse(&bilinear("", 6).replace("0.5", "nan")), Err(ModelErrorKind::Spline(_))));
    assert!(matches!(parse(&bilinear("", 6).replace("id=\"0\"", "unit=\"ell\"")), Err(ModelErrorKind::Value { .. })));
    assert!(matches!(boxed("<box level=\"1\">0 0 1 2</box>"), Err(ModelErrorKind::BoxAlignment { level: 1, .. })));
    assert!(matches!(boxed("<box level=\"1\">0 0 2</box>"), Err(ModelErrorKind::Count { found: 3, .. })));
    assert!(matches!(boxed("<box level=\"1\">2 0 0 2</box>"), Err(ModelErrorKind::Box { .. })));
    assert!(matches!(boxed("<box level=\"1\">0 0 6 2</box>"), Err(ModelErrorKind::Box { .. })));
    assert!(matches!(boxed("<box level=\"-1\">0 0 1 1</box>"), Err(ModelErrorKind::Value { .. })));
    assert!(matches!(boxed("<box level=\"99\">0 0 1 1</box>"), Err(ModelErrorKind::TooLarge { .. })));
    // A billion cells from one line.
    assert!(matches!(boxed("<box level=\"15\">0 0 65536 32768</box>"), Err(ModelErrorKind::TooLarge { .. })));
}
