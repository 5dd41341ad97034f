//! 3D Manufacturing Format (core specification 1.3, and the parts of the production extension): the triangles of all objects,
//! where the build puts them.

use std::collections::HashMap;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::decoder::malformed;
use super::faces::{Faces, vertex_index};
use super::source::{Budget, is_3mf_model, member, member_names, open_archive};
use super::text::{parse_count, parse_number, quote};
use super::{Format, Scan, rows, source};
use crate::error::{Location, ReadErrorKind};
use crate::model::LengthUnit;

const NAME: &str = "3MF";

/// The part that a package opens with, unless it says otherwise.
const ROOT: &str = "3d/3dmodel.model";

/// Limit: components within one another. The specification forbids circles.
const MAX_DEPTH: usize = 32;

/// Bytes of a vertex, of a triangle and of a component in memory.
const VERTEX: usize = 24;
const TRIANGLE: usize = 12;
const COMPONENT: usize = 160;

/// Where an object stands: three columns of a matrix, and the origin.
#[derive(Clone, Copy)]
struct Frame([[f64; 3]; 4]);

/// An object placed in another one, or in the build.
#[derive(Clone, Copy)]
struct Placed {
    /// Index of the part that holds it.
    part: usize,
    id: u64,
    frame: Frame,
}

#[derive(Default)]
struct Object {
    coordinates: Vec<f64>,
    triangles: Vec<[u32; 3]>,
    components: Vec<Placed>,
    is_support: bool,
}

/// The parts of a package, read.
#[derive(Default)]
struct Package {
    /// Names of the parts, without a slash before them and in lower case.
    parts: Vec<String>,
    objects: HashMap<(usize, u64), Object>,
    /// What each part builds, and its unit.
    builds: Vec<(Vec<Placed>, LengthUnit)>,
}

pub(super) fn read(bytes: &[u8], budget: &mut Budget) -> Result<Scan, ReadErrorKind> {
    let mut archive = open_archive(bytes)?;
    let names = member_names(&archive);
    let models: Vec<usize> = (0..names.len()).filter(|&at| is_3mf_model(&names[at])).collect();
    let mut package = Package { parts: models.iter().map(|&at| normal(&names[at])).collect(), ..Package::default() };
    for (part, &at) in models.iter().enumerate() {
        let bytes = member(&mut archive, at, budget)?;
        let text = std::str::from_utf8(source::without_mark(&bytes)?).map_err(|error| malformed(NAME, error))?;
        package.read_part(part, text, budget)?;
    }
    let is_root = |part: &usize| package.parts[*part] == ROOT;
    let builds = |part: &usize| !package.builds[*part].0.is_empty();
    let root = (0..models.len()).find(is_root).or_else(|| (0..models.len()).find(builds)).unwrap_or(0);
    let Some((build, unit)) = package.builds.get(root) else {
        return Err(malformed(NAME, "there is no model in the package"));
    };
    let (mut notes, unit) = (Vec::new(), *unit);
    let mut meshes = Meshes::default();
    if build.is_empty() {
        notes.push("nothing is built; all objects were read as they are".to_owned());
        let mut ids: Vec<(usize, u64)> = package.objects.keys().copied().collect();
        ids.sort_unstable();
        for id in ids {
            meshes.add_mesh(&package.objects[&id], &Frame::default(), budget)?;
        }
    }
    for placed in build {
        meshes.add(&package, placed, &Frame::default(), 0, budget)?;
    }
    let mut scan = Scan::new(Format::ThreeMf, rows(meshes.coordinates, 3));
    scan.triangles = meshes.faces.finish(&mut notes);
    if meshes.supports > 0 {
        notes.push(format!("{} supports of the print were left out", meshes.supports));
    }
    (scan.unit, scan.notes) = (Some(unit), notes);
    Ok(scan)
}

/// The name of a part as it is compared.
fn normal(name: &str) -> String {
    name.trim_start_matches('/').to_ascii_lowercase()
}

impl Default for Frame {
    fn default() -> Self {
        Self([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]])
    }
}

impl Frame {
    fn turn(&self, v: [f64; 3]) -> [f64; 3] {
        let [x, y, z, _] = &self.0;
        std::array::from_fn(|i| x[i] * v[0] + y[i] * v[1] + z[i] * v[2])
    }

    fn place(&self, point: [f64; 3]) -> [f64; 3] {
        let (turned, origin) = (self.turn(point), self.0[3]);
        std::array::from_fn(|i| turned[i] + origin[i])
    }

    /// A frame that stands in this one.
    fn then(&self, inner: &Self) -> Self {
        let [x, y, z, origin] = inner.0;
        Self([self.turn(x), self.turn(y), self.turn(z), self.place(origin)])
    }

    /// Whether left becomes right.
    fn mirrors(&self) -> bool {
        let [a, b, c, _] = &self.0;
        let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        (0..3).map(|k| a[k] * cross[k]).sum::<f64>() < 0.0
    }
}

/// Vertices and triangles so far.
#[derive(Default)]
struct Meshes {
    coordinates: Vec<f64>,
    faces: Faces,
    supports: usize,
}

impl Meshes {
    /// Adds an object and what it is made of, at a depth of components.
    fn add(
        &mut self,
        package: &Package,
        placed: &Placed,
        outer: &Frame,
        depth: usize,
        budget: &mut Budget,
    ) -> Result<(), ReadErrorKind> {
        // A component takes no more room in the file than it does here, however often it is placed.
        budget.spend(COMPONENT)?;
        let Some(object) = package.objects.get(&(placed.part, placed.id)) else {
            return Err(malformed(NAME, format!("there is no object {}", placed.id)));
        };
        if depth > MAX_DEPTH {
            return Err(malformed(NAME, format!("components stand in one another, more than {MAX_DEPTH} deep")));
        }
        if object.is_support {
            self.supports += 1;
            return Ok(());
        }
        let frame = outer.then(&placed.frame);
        self.add_mesh(object, &frame, budget)?;
        object.components.iter().try_for_each(|component| self.add(package, component, &frame, depth + 1, budget))
    }

    fn add_mesh(&mut self, object: &Object, frame: &Frame, budget: &mut Budget) -> Result<(), ReadErrorKind> {
        let (vertices, _) = object.coordinates.as_chunks::<3>();
        budget.spend(VERTEX * vertices.len() + TRIANGLE * object.triangles.len())?;
        let first = self.coordinates.len() / 3;
        let location = || Location::Record { element: "vertex".to_owned(), index: first };
        let first = vertex_index(first as i64, usize::MAX, location)?;
        vertex_index(i64::from(first) + vertices.len() as i64, usize::MAX, location)?;
        for vertex in vertices {
            self.coordinates.extend(frame.place(*vertex));
        }
        let is_mirrored = frame.mirrors();
        for &[a, b, c] in &object.triangles {
            let triangle = if is_mirrored { [b, a, c] } else { [a, b, c] };
            self.faces.push(&triangle.map(|corner| corner + first));
        }
        Ok(())
    }
}

impl Package {
    /// Reads a part: streamed, so that only what is needed is kept.
    fn read_part(&mut self, part: usize, text: &str, budget: &mut Budget) -> Result<(), ReadErrorKind> {
        let mut reader = Reader::from_str(text);
        let mut build = Vec::new();
        let mut unit = LengthUnit::Millimetre;
        let mut open: Option<u64> = None;
        let mut object = Object::default();
        loop {
            let event = reader.read_event().map_err(|error| ReadErrorKind::Xml {
                reason: format!(
                    "{error} at byte {} of {}",
                    reader.error_position(),
                    quote(self.parts[part].as_bytes())
                ),
            })?;
            let place = || Location::Byte(reader.buffer_position());
            match event {
                Event::Start(element) | Event::Empty(element) => match element.local_name().as_ref() {
                    "model" => unit = attribute(&element, "unit").map_or(Ok(unit), |name| length_unit(&name))?,
                    "object" => {
                        self.keep(part, open.take(), std::mem::take(&mut object));
                        open = Some(number(&element, "id", place)?);
                        object.is_support = attribute(&element, "type").is_some_and(|kind| kind == "support");
                        budget.spend(COMPONENT)?;
                    }
                    "vertex" => {
                        for name in ["x", "y", "z"] {
                            object.coordinates.push(number(&element, name, place)?);
                        }
                    }
                    "triangle" => {
                        let count = object.coordinates.len() / 3;
                        let mut triangle = [0; 3];
                        for (corner, name) in triangle.iter_mut().zip(["v1", "v2", "v3"]) {
                            let index: u64 = number(&element, name, place)?;
                            *corner = vertex_index(i64::try_from(index).unwrap_or(i64::MAX), count, place)?;
                        }
                        object.triangles.push(triangle);
                    }
                    "component" => object.components.push(self.placed(part, &element, place)?),
                    "item" => build.push(self.placed(part, &element, place)?),
                    _ => {}
                },
                Event::Eof => break,
                _ => {}
            }
        }
        self.keep(part, open, object);
        self.builds.push((build, unit));
        Ok(())
    }

    fn keep(&mut self, part: usize, id: Option<u64>, object: Object) {
        if let Some(id) = id {
            self.objects.insert((part, id), object);
        }
    }

    /// An object placed by an element `item` or `component`, of this part unless it names another one.
    fn placed(
        &self,
        part: usize,
        element: &BytesStart<'_>,
        place: impl Fn() -> Location,
    ) -> Result<Placed, ReadErrorKind> {
        let id = number(element, "objectid", &place)?;
        let part = match attribute(element, "path") {
            None => part,
            Some(path) => {
                let name = normal(&path);
                let found = self.parts.iter().position(|part| *part == name);
                found.ok_or_else(|| malformed(NAME, format!("there is no part {}", quote(path.as_bytes()))))?
            }
        };
        let Some(text) = attribute(element, "transform") else {
            return Ok(Placed { part, id, frame: Frame::default() });
        };
        let not_a_number = || ReadErrorKind::NotANumber { location: place(), text: quote(text.as_bytes()) };
        let numbers: Option<Vec<f64>> =
            text.split_ascii_whitespace().map(|field| parse_number(field.as_bytes())).collect();
        match numbers.as_deref() {
            Some(&[a, b, c, d, e, f, g, h, i, x, y, z]) => {
                Ok(Placed { part, id, frame: Frame([[a, b, c], [d, e, f], [g, h, i], [x, y, z]]) })
            }
            _ => Err(not_a_number()),
        }
    }
}

/// The value of an attribute, whatever its namespace.
fn attribute(element: &BytesStart<'_>, name: &str) -> Option<String> {
    let mut attributes = element.attributes();
    let mut attributes = attributes.with_checks(false).flatten();
    attributes.find(|attribute| attribute.key.local_name().as_ref() == name).map(|found| found.value.into_owned())
}

/// A number among the attributes.
fn number<T: Number>(
    element: &BytesStart<'_>,
    name: &str,
    place: impl FnOnce() -> Location,
) -> Result<T, ReadErrorKind> {
    let text = attribute(element, name).unwrap_or_default();
    T::parse(&text).ok_or_else(|| ReadErrorKind::NotANumber { location: place(), text: quote(text.as_bytes()) })
}

/// What an attribute may hold.
trait Number: Sized {
    fn parse(text: &str) -> Option<Self>;
}

impl Number for f64 {
    fn parse(text: &str) -> Option<Self> {
        parse_number(text.trim().as_bytes())
    }
}

impl Number for u64 {
    fn parse(text: &str) -> Option<Self> {
        parse_count(text.trim().as_bytes()).map(|count| count as Self)
    }
}

fn length_unit(name: &str) -> Result<LengthUnit, ReadErrorKind> {
    Ok(match name {
        "micron" => LengthUnit::Micrometre,
        "millimeter" => LengthUnit::Millimetre,
        "centimeter" => LengthUnit::Centimetre,
        "inch" => LengthUnit::Inch,
        "foot" => LengthUnit::Foot,
        "meter" => LengthUnit::Metre,
        _ => return Err(malformed(NAME, format!("{} is no unit of the format", quote(name.as_bytes())))),
    })
}
