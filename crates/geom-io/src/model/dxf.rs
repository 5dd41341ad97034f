//! DXF (release 2000, text): a curve as one SPLINE entity, which drawing programs and cutters read.
//!
//! Exact: the curve's own knots and control points; a periodic curve is opened at its seam and flagged closed. The file has
//! all tables that the release asks for, and nothing in them.

use std::io::{self, Write};

use ndarray::Array1;
use thb_core::{SplineMap, TensorSpace};

use super::{Geometry, LengthUnit, Model, ModelErrorKind};

/// A curve in the form that goes to a DXF file.
pub struct DxfFile {
    map: SplineMap<1, TensorSpace<1>>,
    closed: bool,
    unit: LengthUnit,
}

/// Flags of a SPLINE entity (group 70).
const CLOSED: u32 = 1;
const PLANAR: u32 = 8;

impl DxfFile {
    /// Brings a model into B-spline form.
    ///
    /// # Errors
    /// [`ModelErrorKind::CurvesOnly`] for a surface, [`ModelErrorKind::PointDimension`].
    pub fn new(model: &Model) -> Result<Self, ModelErrorKind> {
        let Geometry::Curve(map) = &model.geometry else {
            return Err(ModelErrorKind::CurvesOnly { format: "DXF" });
        };
        if !(2..=3).contains(&map.dim()) {
            return Err(ModelErrorKind::PointDimension { given: map.dim() });
        }
        let (lower, upper) = map.space().domain();
        let meets = map.eval(lower)? == map.eval(upper)?;
        let closed = map.space().periodic()[0] || meets;
        Ok(Self { map: map.tensor_product()?, closed, unit: model.unit })
    }

    /// Writes the file.
    ///
    /// # Errors
    /// What `out` says.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let units = match self.unit {
            LengthUnit::Inch => 1,
            LengthUnit::Foot => 2,
            LengthUnit::Millimetre => 4,
            LengthUnit::Centimetre => 5,
            LengthUnit::Metre => 6,
            LengthUnit::Micrometre => 13,
        };
        let head = HEAD.replace("$UNITS", &units.to_string());
        groups(out, &head)?;
        self.entity(out)?;
        groups(out, TAIL)
    }

    fn entity(&self, out: &mut dyn Write) -> io::Result<()> {
        let knots = self.map.space().knots(0);
        let points = self.map.coefficients();
        let planar = self.map.dim() == 2;
        let flags = u32::from(self.closed) * CLOSED + u32::from(planar) * PLANAR;
        groups(out, "0 SPLINE|5 100|330 1F|100 AcDbEntity|8 0|100 AcDbSpline")?;
        if planar {
            groups(out, "210 0.0|220 0.0|230 1.0")?;
        }
        let counts =
            [(70, flags as usize), (71, knots.degree()), (72, knots.knots().len()), (73, points.nrows()), (74, 0)];
        for (code, value) in counts {
            writeln!(out, "{code}\n{value}")?;
        }
        for knot in knots.knots() {
            writeln!(out, "40\n{knot:?}")?;
        }
        for point in points.outer_iter() {
            let z = Array1::from_iter(point.iter().copied().chain([0.0]));
            writeln!(out, "10\n{:?}\n20\n{:?}\n30\n{:?}", z[0], z[1], z[2])?;
        }
        Ok(())
    }
}

/// Groups written as `code value`, with a bar between them.
fn groups(out: &mut dyn Write, text: &str) -> io::Result<()> {
    for group in text.split('|').map(|group| group.trim_matches('\n')).filter(|group| !group.is_empty()) {
        let (code, value) = group.split_once(' ').unwrap_or((group, ""));
        writeln!(out, "{code}\n{value}")?;
    }
    Ok(())
}

/// Sections before the entity; handles are hexadecimal, those above 100 are the entity's and after it.
const HEAD: &str = "0 SECTION|2 HEADER|9 $ACADVER|1 AC1015|9 $HANDSEED|5 200|9 $INSUNITS|70 $UNITS|0 ENDSEC|
0 SECTION|2 CLASSES|0 ENDSEC|
0 SECTION|2 TABLES|
0 TABLE|2 VPORT|5 8|330 0|100 AcDbSymbolTable|70 0|0 ENDTAB|
0 TABLE|2 LTYPE|5 5|330 0|100 AcDbSymbolTable|70 3|
0 LTYPE|5 14|330 5|100 AcDbSymbolTableRecord|100 AcDbLinetypeTableRecord|2 ByBlock|70 0|3 |72 65|73 0|40 0.0|
0 LTYPE|5 15|330 5|100 AcDbSymbolTableRecord|100 AcDbLinetypeTableRecord|2 ByLayer|70 0|3 |72 65|73 0|40 0.0|
0 LTYPE|5 16|330 5|100 AcDbSymbolTableRecord|100 AcDbLinetypeTableRecord|2 Continuous|70 0|3 Solid line|72 65|73 0|40 0.0|
0 ENDTAB|
0 TABLE|2 LAYER|5 2|330 0|100 AcDbSymbolTable|70 1|
0 LAYER|5 10|330 2|100 AcDbSymbolTableRecord|100 AcDbLayerTableRecord|2 0|70 0|62 7|6 Continuous|390 F|
0 ENDTAB|
0 TABLE|2 STYLE|5 3|330 0|100 AcDbSymbolTable|70 1|
0 STYLE|5 11|330 3|100 AcDbSymbolTableRecord|100 AcDbTextStyleTableRecord|2 Standard|70 0|40 0.0|41 1.0|50 0.0|71 0|42 2.5|3 txt|4 |
0 ENDTAB|
0 TABLE|2 VIEW|5 6|330 0|100 AcDbSymbolTable|70 0|0 ENDTAB|
0 TABLE|2 UCS|5 7|330 0|100 AcDbSymbolTable|70 0|0 ENDTAB|
0 TABLE|2 APPID|5 9|330 0|100 AcDbSymbolTable|70 1|
0 APPID|5 12|330 9|100 AcDbSymbolTableRecord|100 AcDbRegAppTableRecord|2 ACAD|70 0|
0 ENDTAB|
0 TABLE|2 DIMSTYLE|5 A|330 0|100 AcDbSymbolTable|70 1|100 AcDbDimStyleTable|
0 DIMSTYLE|105 27|330 A|100 AcDbSymbolTableRecord|100 AcDbDimStyleTableRecord|2 Standard|70 0|
0 ENDTAB|
0 TABLE|2 BLOCK_RECORD|5 1|330 0|100 AcDbSymbolTable|70 2|
0 BLOCK_RECORD|5 1F|330 1|100 AcDbSymbolTableRecord|100 AcDbBlockTableRecord|2 *Model_Space|340 22|
0 BLOCK_RECORD|5 1B|330 1|100 AcDbSymbolTableRecord|100 AcDbBlockTableRecord|2 *Paper_Space|340 1E|
0 ENDTAB|
0 ENDSEC|
0 SECTION|2 BLOCKS|
0 BLOCK|5 20|330 1F|100 AcDbEntity|8 0|100 AcDbBlockBegin|2 *Model_Space|70 0|10 0.0|20 0.0|30 0.0|3 *Model_Space|1 |
0 ENDBLK|5 21|330 1F|100 AcDbEntity|8 0|100 AcDbBlockEnd|
0 BLOCK|5 1C|330 1B|100 AcDbEntity|67 1|8 0|100 AcDbBlockBegin|2 *Paper_Space|70 0|10 0.0|20 0.0|30 0.0|3 *Paper_Space|1 |
0 ENDBLK|5 1D|330 1B|100 AcDbEntity|67 1|8 0|100 AcDbBlockEnd|
0 ENDSEC|
0 SECTION|2 ENTITIES|";

const TAIL: &str = "0 ENDSEC|
0 SECTION|2 OBJECTS|
0 DICTIONARY|5 C|330 0|100 AcDbDictionary|281 1|3 ACAD_GROUP|350 D|3 ACAD_LAYOUT|350 1A|3 ACAD_PLOTSTYLENAME|350 E|
0 DICTIONARY|5 D|330 C|100 AcDbDictionary|281 1|
0 ACDBDICTIONARYWDFLT|5 E|330 C|100 AcDbDictionary|281 1|3 Normal|350 F|100 AcDbDictionaryWithDefault|340 F|
0 ACDBPLACEHOLDER|5 F|330 E|
0 DICTIONARY|5 1A|330 C|100 AcDbDictionary|281 1|3 Layout1|350 1E|3 Model|350 22|
0 LAYOUT|5 1E|330 1A|100 AcDbPlotSettings|1 |4 A3|6 |40 7.5|41 20.0|42 7.5|43 20.0|44 420.0|45 297.0|46 0.0|47 0.0|48 0.0|49 0.0|140 0.0|141 0.0|142 1.0|143 1.0|70 688|72 0|73 0|74 5|7 |75 16|147 1.0|148 0.0|149 0.0|100 AcDbLayout|1 Layout1|70 1|71 1|10 0.0|20 0.0|11 420.0|21 297.0|12 0.0|22 0.0|32 0.0|14 0.0|24 0.0|34 0.0|15 0.0|25 0.0|35 0.0|146 0.0|13 0.0|23 0.0|33 0.0|16 1.0|26 0.0|36 0.0|17 0.0|27 1.0|37 0.0|76 0|330 1B|
0 LAYOUT|5 22|330 1A|100 AcDbPlotSettings|1 |4 A3|6 |40 7.5|41 20.0|42 7.5|43 20.0|44 420.0|45 297.0|46 0.0|47 0.0|48 0.0|49 0.0|140 0.0|141 0.0|142 1.0|143 1.0|70 1024|72 0|73 0|74 5|7 |75 16|147 1.0|148 0.0|149 0.0|100 AcDbLayout|1 Model|70 1|71 0|10 0.0|20 0.0|11 420.0|21 297.0|12 0.0|22 0.0|32 0.0|14 0.0|24 0.0|34 0.0|15 0.0|25 0.0|35 0.0|146 0.0|13 0.0|23 0.0|33 0.0|16 1.0|26 0.0|36 0.0|17 0.0|27 1.0|37 0.0|76 0|330 1F|
0 ENDSEC|
0 EOF";
