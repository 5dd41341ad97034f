//! STEP: the structure of the files, read back with a small parser of ISO 10303-21.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::model_common::{cap, curve, dome, ring, sheet, spots};
use geom_io::StepSchema;
use geom_io::model::step::{StepFile, StepOptions};
use geom_io::model::{LengthUnit, Model, ModelErrorKind, SolidFile};
use ndarray::Array2;
use thb_core::{
    CellSpace, HierarchicalSpace, Kind, KnotVector, MultiPatchSpace, PatchSide, PatchTopology, SplineMap, TensorSpace,
};

/// The entities of a file: name and parameters, in the order of the file.
struct Parsed {
    text: String,
    entities: BTreeMap<u64, (String, Vec<Value>)>,
}

#[derive(Clone, Debug, PartialEq)]
enum Value {
    Reference(u64),
    Number(f64),
    List(Vec<Value>),
    Other(String),
}

impl Value {
    fn reference(&self) -> u64 {
        let Self::Reference(id) = self else { panic!("{self:?} is no reference") };
        *id
    }

    fn number(&self) -> f64 {
        let Self::Number(number) = self else { panic!("{self:?} is no number") };
        *number
    }

    fn list(&self) -> &[Value] {
        let Self::List(list) = self else { panic!("{self:?} is no list") };
        list
    }

    fn references(&self) -> Vec<u64> {
        match self {
            Self::Reference(id) => vec![*id],
            Self::List(list) => list.iter().flat_map(Self::references).collect(),
            _ => vec![],
        }
    }
}

/// The values up to the closing parenthesis, which is taken.
fn parse_list(rest: &mut &str) -> Vec<Value> {
    let mut values = Vec::new();
    loop {
        *rest = rest.trim_start();
        if let Some(after) = rest.strip_prefix([')', ',']) {
            let closed = rest.starts_with(')');
            *rest = after;
            if closed {
                return values;
            }
        } else if let Some(after) = rest.strip_prefix('(') {
            *rest = after;
            values.push(Value::List(parse_list(rest)));
        } else if let Some(after) = rest.strip_prefix('\'') {
            let end = after.find('\'').unwrap();
            values.push(Value::Other(after[..end].to_owned()));
            *rest = &after[end + 1..];
        } else {
            let end = rest.find([',', ')', '(']).unwrap();
            let (word, after) = rest.split_at(end);
            *rest = after;
            values.push(match word.strip_prefix('#') {
                Some(id) => Value::Reference(id.parse().unwrap()),
                None => word.parse().map_or(Value::Other(word.to_owned()), Value::Number),
            });
        }
    }
}

impl Parsed {
    fn new(file: &StepFile) -> Self {
        let mut bytes = Vec::new();
        file.write(&mut bytes).unwrap();
        Self::read(bytes)
    }

    fn read(bytes: Vec<u8>) -> Self {
        let text = String::from_utf8(bytes).unwrap();
        assert!(text.is_ascii() && text.starts_with("ISO-10303-21;") && text.ends_with("END-ISO-10303-21;\n"));
        let data = text.split("DATA;\n").nth(1).unwrap().split("ENDSEC;").next().unwrap();
        let mut entities = BTreeMap::new();
        for record in data.split_terminator(";\n") {
            let (id, body) = record.strip_prefix('#').unwrap().split_once('=').unwrap();
            let (name, mut rest) = body.split_once('(').unwrap();
            let parameters = parse_list(&mut rest);
            let old = entities.insert(id.parse().unwrap(), (name.to_owned(), parameters));
            assert!(old.is_none(), "#{id} occurs twice");
        }
        Self { text, entities }
    }

    fn of(&self, id: u64, name: &str) -> &[Value] {
        let (found, parameters) = &self.entities[&id];
        assert_eq!(found, name);
        parameters
    }

    fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a [Value]> {
        self.entities.values().filter(move |(found, _)| found == name).map(|(_, parameters)| parameters.as_slice())
    }

    fn count(&self, name: &str) -> usize {
        self.all(name).count()
    }

    fn point(&self, id: u64) -> [f64; 3] {
        let numbers: Vec<f64> = self.of(id, "CARTESIAN_POINT")[1].list().iter().map(Value::number).collect();
        numbers.try_into().unwrap()
    }

    /// Every reference resolves, to an entity before it, and every entity but the last is referred to or a root.
    fn check_references(&self) {
        let mut used = BTreeSet::new();
        for (id, (name, parameters)) in &self.entities {
            for target in Value::List(parameters.clone()).references() {
                assert!(target < *id && self.entities.contains_key(&target), "#{id} {name} refers to #{target}");
                used.insert(target);
            }
        }
        let roots: Vec<&str> =
            self.entities.iter().filter(|(id, _)| !used.contains(id)).map(|(_, (name, _))| name.as_str()).collect();
        let expected =
            ["APPLICATION_PROTOCOL_DEFINITION", "PRODUCT_RELATED_PRODUCT_CATEGORY", "SHAPE_DEFINITION_REPRESENTATION"];
        assert_eq!(roots, expected);
    }

    /// Numbers of control points and knots fit together. Returns the number of control points of all surfaces.
    fn check_splines(&self) -> usize {
        let knots = |multiplicities: &Value, values: &Value, degree: &Value| {
            let (count, values) = (multiplicities.list(), values.list());
            let end = degree.number() + 1.0;
            assert_eq!(count.len(), values.len());
            assert!(values.is_sorted_by(|a, b| a.number() < b.number()));
            assert!(count[0].number() == end && count[count.len() - 1].number() == end);
            assert!(count[1..count.len() - 1].iter().all(|m| m.number() < end));
            (count.iter().map(Value::number).sum::<f64>() - end) as usize
        };
        for p in self.all("B_SPLINE_CURVE_WITH_KNOTS") {
            assert_eq!(knots(&p[6], &p[7], &p[1]), p[2].list().len());
        }
        let mut total = 0;
        for p in self.all("B_SPLINE_SURFACE_WITH_KNOTS") {
            let (n_u, n_v) = (knots(&p[8], &p[10], &p[1]), knots(&p[9], &p[11], &p[2]));
            assert_eq!(p[3].list().len(), n_u);
            assert!(p[3].list().iter().all(|row| row.list().len() == n_v));
            total += n_u * n_v;
        }
        total
    }

    /// Loops are closed, inner edges are used once in each direction, the others form one closed boundary. Returns the
    /// numbers of inner and of boundary edges.
    fn check_topology(&self) -> (usize, usize) {
        let (inner, outer, boundaries) = self.topology();
        assert_eq!(boundaries, 1, "the boundary is not in one piece");
        (inner, outer)
    }

    /// The same with any number of closed boundaries, which is returned too.
    fn topology(&self) -> (usize, usize, usize) {
        let mut uses: BTreeMap<u64, Vec<bool>> = BTreeMap::new();
        for face in self.all("ADVANCED_FACE") {
            let [bound, holes @ ..] = &face[1].references()[..] else { panic!("a face has no bound") };
            let bound = *bound;
            for hole in holes {
                let rim = self.of(self.of(*hole, "FACE_BOUND")[1].reference(), "EDGE_LOOP")[1].references();
                let [oriented] = rim[..] else { panic!("a rim has one edge") };
                let oriented = self.of(oriented, "ORIENTED_EDGE");
                uses.entry(oriented[3].reference()).or_default().push(oriented[4] == Value::Other(".T.".to_owned()));
            }
            let boundary = self.of(bound, "FACE_OUTER_BOUND")[1].reference();
            let mut ends = Vec::new();
            for oriented in self.of(boundary, "EDGE_LOOP")[1].references() {
                let oriented = self.of(oriented, "ORIENTED_EDGE");
                let (edge, forward) = (oriented[3].reference(), oriented[4] == Value::Other(".T.".to_owned()));
                uses.entry(edge).or_default().push(forward);
                let edge = self.of(edge, "EDGE_CURVE");
                let (start, end) = (edge[1].reference(), edge[2].reference());
                ends.push(if forward { (start, end) } else { (end, start) });
            }
            for i in 0..ends.len() {
                assert_eq!(ends[i].1, ends[(i + 1) % ends.len()].0, "a loop is open");
            }
        }
        assert_eq!(uses.len(), self.count("EDGE_CURVE"), "an edge is used by no face");
        let (inner, outer): (Vec<_>, Vec<_>) = uses.into_iter().partition(|(_, directions)| directions.len() > 1);
        for (edge, directions) in &inner {
            assert!(directions.len() == 2 && directions[0] != directions[1], "#{edge} is used as {directions:?}");
        }
        // Walk round the boundaries: each vertex starts one edge of them.
        let mut next: BTreeMap<u64, u64> = outer
            .iter()
            .map(|(edge, directions)| {
                let edge = self.of(*edge, "EDGE_CURVE");
                let (start, end) = (edge[1].reference(), edge[2].reference());
                if directions[0] { (start, end) } else { (end, start) }
            })
            .collect();
        assert_eq!(next.len(), outer.len());
        let mut boundaries = 0;
        while let Some((first, mut at)) = next.pop_first() {
            while at != first {
                at = next.remove(&at).expect("a boundary ends");
            }
            boundaries += 1;
        }
        // The ends of each edge's curve are its vertices.
        for edge in self.all("EDGE_CURVE") {
            let curve = self.of(edge[3].reference(), "B_SPLINE_CURVE_WITH_KNOTS")[2].references();
            for (vertex, point) in [(1, curve[0]), (2, curve[curve.len() - 1])] {
                let vertex = self.point(self.of(edge[vertex].reference(), "VERTEX_POINT")[1].reference());
                let point = self.point(point);
                assert!((0..3).all(|k| (vertex[k] - point[k]).abs() < 1e-12 * 200.0), "{vertex:?} is not {point:?}");
            }
        }
        (inner.len(), outer.len(), boundaries)
    }
}

fn shell(map: SplineMap<2>, options: &StepOptions) -> (StepFile, Parsed) {
    let file = StepFile::new(&Model::surface(map, LengthUnit::Millimetre), options).unwrap();
    let parsed = Parsed::new(&file);
    parsed.check_references();
    assert_eq!(parsed.check_splines(), file.n_control_points());
    assert_eq!(parsed.count("ADVANCED_FACE"), file.n_faces());
    let shells = parsed.count("OPEN_SHELL") + parsed.count("CLOSED_SHELL");
    assert_eq!((shells, parsed.count("SHELL_BASED_SURFACE_MODEL")), (1, 1));
    (file, parsed)
}

fn limited(max_control_points: usize) -> StepOptions {
    StepOptions { max_control_points, ..StepOptions::default() }
}

#[test]
fn a_small_surface_is_one_face() {
    let map = sheet(Kind::Thb, [2, 3], [4, 3], 3);
    let corner = map.eval([1.0, 1.0]).unwrap();
    let tensor = map.tensor_product().unwrap().space().n_functions();
    let (file, parsed) = shell(map, &StepOptions::default());
    assert_eq!((file.n_faces(), file.n_control_points()), (1, tensor));
    assert_eq!(parsed.check_topology(), (0, 4));
    // The last point of the last row is the corner u = v = 1.
    let surface = parsed.all("B_SPLINE_SURFACE_WITH_KNOTS").next().unwrap();
    let last = parsed.point(*surface[3].references().last().unwrap());
    assert!((0..3).all(|k| (last[k] - corner[k]).abs() < 1e-12));
}

#[test]
fn patches_share_their_edges() {
    let mut sides = 0;
    for (map, limit) in [
        (sheet(Kind::Thb, [2, 2], [6, 4], 5), 800),
        (sheet(Kind::Hb, [3, 2], [5, 4], 4), 400),
        (spots([2, 2], [8, 6], 6), 900),
    ] {
        let tensor = map.tensor_product().unwrap().space().n_functions();
        let (file, parsed) = shell(map, &limited(limit));
        let (inner, _) = parsed.check_topology();
        assert!(file.n_faces() > 3 && inner >= file.n_faces() - 1);
        assert!(file.n_control_points() < tensor, "{} of {tensor}", file.n_control_points());
        let largest = parsed.all("B_SPLINE_SURFACE_WITH_KNOTS").map(|p| p[3].references().len()).max().unwrap();
        assert!(largest <= limit, "{largest} control points in a face");
        // More edges than four a face: sides end inside a neighbour's side.
        sides += parsed.all("EDGE_LOOP").map(|p| p[1].list().len()).sum::<usize>() - 4 * file.n_faces();
    }
    assert!(sides > 0, "no side is cut at a T-junction");
}

#[test]
fn the_partition_covers_the_domain_once() {
    let (_, parsed) = shell(spots([3, 2], [6, 5], 6), &limited(300));
    let ends = |values: &Value| (values.list()[0].number(), values.list()[values.list().len() - 1].number());
    let boxes: Vec<_> = parsed.all("B_SPLINE_SURFACE_WITH_KNOTS").map(|p| (ends(&p[10]), ends(&p[11]))).collect();
    let area: f64 = boxes.iter().map(|(u, v)| (u.1 - u.0) * (v.1 - v.0)).sum();
    assert_eq!(area, 1.0);
    for (i, (u, v)) in boxes.iter().enumerate() {
        for (s, t) in &boxes[..i] {
            assert!(u.1.min(s.1) <= u.0.max(s.0) || v.1.min(t.1) <= v.0.max(t.0), "two patches overlap");
        }
    }
}

#[test]
fn cutting_stops_at_single_cells() {
    let map = sheet(Kind::Thb, [2, 2], [2, 2], 1);
    let (file, parsed) = shell(map, &limited(0));
    assert_eq!((file.n_faces(), file.n_control_points()), (4, 36));
    assert_eq!(parsed.check_topology(), (4, 8));
}

/// A round hole, counter-clockwise.
fn round_hole(centre: [f64; 2], radius: f64, spans: usize) -> Array2<f64> {
    Array2::from_shape_fn((spans, 2), |(i, d)| {
        let (sine, cosine) = (std::f64::consts::TAU * i as f64 / spans as f64).sin_cos();
        centre[d] + radius * [cosine, sine][d]
    })
}

#[test]
fn holes_are_cut_out_of_one_face_each() {
    let map = sheet(Kind::Thb, [3, 2], [6, 4], 4);
    let mut holes = vec![round_hole([0.3, 0.5], 0.15, 12), round_hole([0.8, 0.25], 0.05, 5)];
    holes[1].invert_axis(ndarray::Axis(0));
    for (limit, flip) in [(usize::MAX, false), (usize::MAX, true), (250, false)] {
        let options = StepOptions { holes: holes.clone(), flip, ..limited(limit) };
        let (file, parsed) = shell(map.clone(), &options);
        let (_, _, boundaries) = parsed.topology();
        assert_eq!((file.n_faces() == 1, boundaries, parsed.count("FACE_BOUND")), (limit > 250, 3, 2));
        for (control, bound) in holes.iter().zip(parsed.all("FACE_BOUND")) {
            let [oriented] = parsed.of(bound[1].reference(), "EDGE_LOOP")[1].references()[..] else {
                panic!("one edge")
            };
            let oriented = parsed.of(oriented, "ORIENTED_EDGE");
            assert_eq!(oriented[4], Value::Other(if flip { ".F." } else { ".T." }.to_owned()));
            let curve =
                parsed.of(parsed.of(oriented[3].reference(), "EDGE_CURVE")[3].reference(), "B_SPLINE_CURVE_WITH_KNOTS");
            let points: Vec<[f64; 3]> = curve[2].references().into_iter().map(|id| parsed.point(id)).collect();
            // Seen from above the sheet is its parameter domain, so rims run clockwise there.
            let wedge = |p: &[[f64; 3]]| p[0][0] * p[1][1] - p[0][1] * p[1][0];
            assert!(points.windows(2).map(wedge).sum::<f64>() < 0.0);
            // The curve has the parameter of the rim, which runs the other way where it was turned round.
            let knots = curve[7].list().iter().zip(curve[6].list());
            let knots: Vec<f64> = knots.flat_map(|(k, m)| vec![k.number(); m.number() as usize]).collect();
            let space = TensorSpace::new([KnotVector::new(3, knots).unwrap()]).unwrap();
            let rows = Array2::from_shape_fn((points.len(), 3), |(i, k)| points[i][k]);
            let curve = SplineMap::new(Arc::new(space), rows).unwrap();
            let n = control.nrows();
            let turned = control.select(ndarray::Axis(0), &(0..n).rev().collect::<Vec<_>>());
            let clockwise = if n == 12 { &turned } else { control };
            let periodic = KnotVector::uniform_periodic(3, n).unwrap();
            let plane = HierarchicalSpace::new(Kind::Thb, [periodic]).unwrap();
            let rim = SplineMap::new(Arc::new(plane), clockwise.clone()).unwrap();
            for k in 0..=300 {
                let t = f64::from(k) / 300.0;
                let (uv, point) = (rim.eval([t]).unwrap(), curve.eval([t]).unwrap());
                let expected = map.eval([uv[0], uv[1]]).unwrap();
                let off = (0..3).map(|d| (point[d] - expected[d]).powi(2)).sum::<f64>().sqrt();
                assert!(off < 2e-7 * 120.0, "{off:e} at {t}");
            }
        }
    }
    let outside = StepOptions { holes: vec![round_hole([0.9, 0.5], 0.2, 8)], ..StepOptions::default() };
    let told = StepFile::new(&Model::surface(map, LengthUnit::Millimetre), &outside).err();
    assert!(matches!(told, Some(ModelErrorKind::HoleOutside { hole: 0, direction: 0, .. })), "{told:?}");
}

#[test]
fn flipping_turns_faces_and_loops() {
    let map = sheet(Kind::Thb, [2, 2], [5, 4], 4);
    let options = |flip| StepOptions { flip, ..limited(300) };
    let (_, plain) = shell(map.clone(), &options(false));
    let (_, flipped) = shell(map, &options(true));
    for (parsed, sense) in [(&plain, ".T."), (&flipped, ".F.")] {
        assert!(parsed.all("ADVANCED_FACE").all(|face| face[3] == Value::Other(sense.to_owned())));
    }
    assert_eq!(plain.check_topology(), flipped.check_topology());
    // Each loop is the other's, backwards.
    let loops = |parsed: &Parsed| -> Vec<Vec<(u64, bool)>> {
        let oriented = |id| {
            let p = parsed.of(id, "ORIENTED_EDGE");
            (p[3].reference(), p[4] == Value::Other(".T.".to_owned()))
        };
        parsed.all("EDGE_LOOP").map(|p| p[1].references().into_iter().map(oriented).collect()).collect()
    };
    for (a, b) in loops(&plain).into_iter().zip(loops(&flipped)) {
        assert_eq!(a, b.into_iter().rev().map(|(edge, forward)| (edge, !forward)).collect::<Vec<_>>());
    }
}

#[test]
fn a_collapsed_side_has_no_edge() {
    for limit in [usize::MAX, 150] {
        let (file, parsed) = shell(dome(5), &limited(limit));
        parsed.check_topology();
        // The tip is one vertex, whatever number of faces meet there.
        let at_tip = |p: &&[Value]| {
            let point = parsed.point(p[1].reference());
            point[0].abs() < 1e-9 && point[1].abs() < 1e-9
        };
        assert_eq!(parsed.all("VERTEX_POINT").filter(at_tip).count(), 1);
        assert!(parsed.all("EDGE_LOOP").any(|p| p[1].list().len() == 3), "{} faces", file.n_faces());
    }
}

#[test]
fn periodic_surfaces_close() {
    for (torus, kind) in [(false, Kind::Thb), (true, Kind::Thb), (true, Kind::Hb)] {
        let map = ring(kind, [3, 2], [8, 6], torus, 4);
        for limit in [usize::MAX, 400] {
            let (file, parsed) = shell(map.clone(), &limited(limit));
            let (inner, outer, boundaries) = parsed.topology();
            let vertices = parsed.count("VERTEX_POINT");
            assert_eq!(boundaries, if torus { 0 } else { 2 });
            assert_eq!(parsed.count("CLOSED_SHELL"), usize::from(torus));
            // Euler's number of a torus and of a tube is 0: the faces fit together all round.
            assert_eq!(vertices + file.n_faces(), inner + outer);
            if limit == usize::MAX {
                assert_eq!((file.n_faces(), vertices), (1, if torus { 1 } else { 2 }));
                let surface = parsed.all("B_SPLINE_SURFACE_WITH_KNOTS").next().unwrap();
                let flag = |closed| Value::Other(if closed { ".T." } else { ".F." }.to_owned());
                assert_eq!((&surface[5], &surface[6]), (&flag(true), &flag(torus)));
            } else {
                assert!(file.n_faces() > 4, "{} faces", file.n_faces());
            }
        }
    }
}

#[test]
fn a_cap_closes_round_its_tip() {
    for limit in [usize::MAX, 150] {
        let (file, parsed) = shell(cap(4), &limited(limit));
        let (inner, outer) = parsed.check_topology();
        // A disk: Euler's number 1.
        assert_eq!(parsed.count("VERTEX_POINT") + file.n_faces(), inner + outer + 1);
    }
}

#[test]
fn a_closed_curve_ends_where_it_begins() {
    let knots = KnotVector::uniform_periodic(3, 7).unwrap();
    let space = HierarchicalSpace::new(Kind::Thb, [knots]).unwrap();
    let coefficients = Array2::from_shape_fn((7, 3), |(i, k)| ((i * 5 + k * i) % 7) as f64);
    let map = SplineMap::new(Arc::new(space), coefficients).unwrap();
    let parsed = Parsed::new(&StepFile::new(&Model::curve(map, LengthUnit::Metre), &StepOptions::default()).unwrap());
    parsed.check_splines();
    let curve = parsed.all("B_SPLINE_CURVE_WITH_KNOTS").next().unwrap();
    let points = curve[2].references();
    let (first, last) = (parsed.point(points[0]), parsed.point(points[points.len() - 1]));
    assert!(first.iter().zip(last).all(|(a, b)| (a - b).abs() < 1e-14), "{first:?} {last:?}");
    assert_eq!(curve[4], Value::Other(".T.".to_owned()));
}

#[test]
fn equal_input_gives_equal_files() {
    let text = || shell(sheet(Kind::Thb, [2, 2], [6, 4], 4), &limited(500)).1.text;
    assert_eq!(text(), text());
}

#[test]
fn header_and_units() {
    let map = sheet(Kind::Thb, [1, 1], [2, 2], 1);
    let options = StepOptions {
        file_name: "it's.step".to_owned(),
        product: "Flügel".to_owned(),
        originating_system: "thb 1.2".to_owned(),
        time_stamp: "2025-03-01T12:00:00".to_owned(),
        ..StepOptions::default()
    };
    let text = |unit| Parsed::new(&StepFile::new(&Model::surface(map.clone(), unit), &options).unwrap()).text;
    let (millimetre, metre, inch) = (text(LengthUnit::Millimetre), text(LengthUnit::Metre), text(LengthUnit::Inch));
    assert!(millimetre.contains("FILE_NAME('it''s.step','2025-03-01T12:00:00'"));
    assert!(millimetre.contains("PRODUCT('Fl\\X2\\00FC\\X0\\gel'"));
    assert!(millimetre.contains("FILE_SCHEMA(('AUTOMOTIVE_DESIGN") && millimetre.contains("'automotive_design',2000"));
    assert!(millimetre.contains(",'thb 1.2','');"));
    let newer = StepOptions { schema: StepSchema::Ap242, ..StepOptions::default() };
    let newer = Parsed::new(&StepFile::new(&Model::surface(map.clone(), LengthUnit::Inch), &newer).unwrap()).text;
    assert!(newer.contains("FILE_SCHEMA(('AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }'))"));
    assert!(newer.contains("'ap242_managed_model_based_3d_engineering',2014") && newer.contains("PRODUCT('model'"));
    assert!(millimetre.contains("SI_UNIT(.MILLI.,.METRE.)") && !millimetre.contains("CONVERSION_BASED_UNIT"));
    assert!(metre.contains("SI_UNIT($,.METRE.)"));
    assert!(inch.contains("CONVERSION_BASED_UNIT('INCH'") && inch.contains("LENGTH_MEASURE(25.4)"));
}

#[test]
fn a_curve_is_a_curve_set() {
    let map = curve(3);
    let n = map.tensor_product().unwrap().space().n_functions();
    let file = StepFile::new(&Model::curve(map, LengthUnit::Metre), &StepOptions::default()).unwrap();
    assert_eq!((file.n_faces(), file.n_control_points()), (0, n));
    let parsed = Parsed::new(&file);
    parsed.check_references();
    parsed.check_splines();
    assert_eq!((parsed.count("GEOMETRIC_CURVE_SET"), parsed.count("CARTESIAN_POINT")), (1, n));
}

#[test]
fn what_step_cannot_hold_is_refused() {
    let knots = |inner: &[f64]| {
        let ends = |t| [t; 3];
        KnotVector::new(2, [&ends(0.0), inner, &ends(1.0)].concat()).unwrap()
    };
    let refused = |inner: &[f64], dim: usize, value: fn(usize) -> f64| {
        let space = HierarchicalSpace::new(Kind::Thb, [knots(inner), knots(&[])]).unwrap();
        let coefficients = Array2::from_shape_fn((space.n_functions(), dim), |(i, k)| value(i * 7 + k * k));
        let map = SplineMap::new(Arc::new(space), coefficients).unwrap();
        StepFile::new(&Model::surface(map, LengthUnit::Metre), &StepOptions::default()).err()
    };
    let varied = |i: usize| i as f64;
    assert!(refused(&[0.5, 0.5], 3, varied).is_none());
    assert!(refused(&[0.5], 2, varied).is_none());
    assert!(matches!(refused(&[0.5; 3], 3, varied), Some(ModelErrorKind::Discontinuous { given: 3, limit: 2, .. })));
    assert!(matches!(refused(&[0.5], 1, varied), Some(ModelErrorKind::PointDimension { given: 1 })));
    assert!(matches!(refused(&[0.5], 4, varied), Some(ModelErrorKind::PointDimension { given: 4 })));
    assert!(matches!(refused(&[0.5], 3, |_| 1.0), Some(ModelErrorKind::Degenerate { .. })));
}

/// The faces of a cube, or some of them, glued along its edges; every second one is numbered from another corner.
fn glued(faces: &[[u32; 4]]) -> PatchTopology {
    let mut arcs: Vec<[u32; 2]> = Vec::new();
    let mut patches = Vec::new();
    for (number, face) in faces.iter().enumerate() {
        let mut corners = *face;
        corners.rotate_left(number % 4);
        patches.push(std::array::from_fn(|side| {
            let ends = [corners[side], corners[(side + 1) % 4]];
            let known = arcs.iter().position(|arc| *arc == ends || *arc == [ends[1], ends[0]]);
            let arc = known.unwrap_or_else(|| {
                arcs.push(ends);
                arcs.len() - 1
            });
            PatchSide { arc: arc as u32, reversed: arcs[arc] != ends }
        }));
    }
    PatchTopology::new(8, arcs, patches).unwrap()
}

/// Corners of the faces of a cube, numbered by the bits of x, y, z, seen from outside.
const CUBE: [[u32; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];

/// A lumpy map of glued faces: some points per function.
fn lumpy(topology: PatchTopology) -> SplineMap<2, MultiPatchSpace> {
    let space = MultiPatchSpace::uniform(Arc::new(topology), 3, 2).unwrap();
    let coefficients = Array2::from_shape_fn((space.n_functions(), 3), |(i, k)| ((7 * i + 3 * k) as f64).sin());
    SplineMap::new(Arc::new(space), coefficients).unwrap()
}

fn solid(map: &SplineMap<2, MultiPatchSpace>, options: &StepOptions) -> Parsed {
    let file = SolidFile::new(map, LengthUnit::Millimetre, options).unwrap();
    let mut bytes = Vec::new();
    file.write(&mut bytes).unwrap();
    let parsed = Parsed::read(bytes);
    parsed.check_references();
    assert_eq!(parsed.check_splines(), file.n_control_points());
    parsed
}

#[test]
fn a_closed_surface_of_patches_is_a_solid() {
    let map = lumpy(glued(&CUBE));
    for flip in [false, true] {
        let parsed = solid(&map, &StepOptions { flip, ..StepOptions::default() });
        assert_eq!((parsed.count("MANIFOLD_SOLID_BREP"), parsed.count("CLOSED_SHELL")), (1, 1));
        assert_eq!(parsed.count("ADVANCED_BREP_SHAPE_REPRESENTATION"), 1);
        let counts = ["ADVANCED_FACE", "EDGE_CURVE", "VERTEX_POINT"].map(|name| parsed.count(name));
        assert_eq!(counts, [6, 12, 8]);
        assert_eq!(parsed.topology(), (12, 0, 0));
        let along = Value::Other(if flip { ".F." } else { ".T." }.to_owned());
        assert!(parsed.all("ADVANCED_FACE").all(|face| face[3] == along));
    }
}

/// Control points of each edge's curve stand to the last bit in the surfaces of both its faces.
#[test]
fn edges_of_a_solid_are_sides_of_its_faces() {
    let parsed = solid(&lumpy(glued(&CUBE)), &StepOptions::default());
    let place = |id: u64| parsed.point(id).map(f64::to_bits);
    let curves: Vec<Vec<[u64; 3]>> = parsed
        .all("EDGE_CURVE")
        .map(|edge| parsed.of(edge[3].reference(), "B_SPLINE_CURVE_WITH_KNOTS")[2].references())
        .map(|points| points.into_iter().map(place).collect())
        .collect();
    let mut found = vec![0; curves.len()];
    for surface in parsed.all("B_SPLINE_SURFACE_WITH_KNOTS") {
        let net: Vec<Vec<[u64; 3]>> =
            surface[3].list().iter().map(|row| row.references().into_iter().map(place).collect()).collect();
        let last = |row: &[[u64; 3]]| row[row.len() - 1];
        let sides = [
            net[0].clone(),
            net[net.len() - 1].clone(),
            net.iter().map(|row| row[0]).collect(),
            net.iter().map(|row| last(row)).collect::<Vec<_>>(),
        ];
        for (curve, found) in curves.iter().zip(&mut found) {
            let backward: Vec<[u64; 3]> = curve.iter().rev().copied().collect();
            *found += sides.iter().filter(|side| *side == curve || **side == backward).count();
        }
    }
    assert_eq!(found, vec![2; 12]);
}

#[test]
fn an_open_surface_of_patches_is_a_shell() {
    let parsed = solid(&lumpy(glued(&CUBE[..5])), &StepOptions::default());
    assert_eq!((parsed.count("SHELL_BASED_SURFACE_MODEL"), parsed.count("OPEN_SHELL")), (1, 1));
    assert_eq!(parsed.topology(), (8, 4, 1));
}

#[test]
fn a_surface_without_an_outside_is_refused() {
    let mut faces = CUBE;
    faces[3].reverse();
    let refused = SolidFile::new(&lumpy(glued(&faces)), LengthUnit::Millimetre, &StepOptions::default());
    assert!(matches!(refused.err(), Some(ModelErrorKind::Misoriented { .. })));
}
