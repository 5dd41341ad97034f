//! What a STEP file needs besides geometry: header, product, units.

use std::io;

use super::part21::{Id, Part21, list, real, string};
use super::{StepOptions, StepSchema};
use crate::model::LengthUnit;

impl StepSchema {
    /// Its name in the header, with its object identifier.
    fn identifier(self) -> &'static str {
        match self {
            Self::Ap214 => "AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }",
            Self::Ap242 => "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }",
        }
    }

    /// What it is for, its name and its year.
    fn application(self) -> (&'static str, &'static str, u16) {
        match self {
            Self::Ap214 => ("core data for automotive mechanical design processes", "automotive_design", 2000),
            Self::Ap242 => ("managed model based 3d engineering", "ap242_managed_model_based_3d_engineering", 2014),
        }
    }
}

/// The name of a part of which none is known.
const NAMELESS: &str = "model";

pub(super) fn begin(file: &mut Part21<'_>, options: &StepOptions) -> io::Result<()> {
    let software = concat!("geom-io ", env!("CARGO_PKG_VERSION"));
    file.line("ISO-10303-21;\nHEADER;")?;
    file.line("FILE_DESCRIPTION(('exact B-spline form of a hierarchical spline model'),'2;1');")?;
    file.line(&format!(
        "FILE_NAME({},{},({}),({}),{},{},'');",
        string(&options.file_name),
        string(&options.time_stamp),
        string(&options.author),
        string(&options.organization),
        string(software),
        string(if options.originating_system.is_empty() { software } else { &options.originating_system }),
    ))?;
    file.line(&format!("FILE_SCHEMA(({}));\nENDSEC;\nDATA;", string(options.schema.identifier())))
}

pub(super) fn end(file: &mut Part21<'_>) -> io::Result<()> {
    file.line("ENDSEC;\nEND-ISO-10303-21;")
}

/// The part, up to the definition of its shape.
pub(super) fn product(file: &mut Part21<'_>, options: &StepOptions) -> io::Result<Id> {
    let name = string(if options.product.is_empty() { NAMELESS } else { &options.product });
    let (purpose, schema, year) = options.schema.application();
    let application = file.entity(format_args!("APPLICATION_CONTEXT('{purpose}')"))?;
    file.entity(format_args!(
        "APPLICATION_PROTOCOL_DEFINITION('international standard','{schema}',{year},{application})"
    ))?;
    let context = file.entity(format_args!("PRODUCT_CONTEXT('',{application},'mechanical')"))?;
    let product = file.entity(format_args!("PRODUCT({name},{name},'',({context}))"))?;
    file.entity(format_args!("PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,({product}))"))?;
    let formation = file.entity(format_args!("PRODUCT_DEFINITION_FORMATION('','',{product})"))?;
    let design = file.entity(format_args!("PRODUCT_DEFINITION_CONTEXT('part definition',{application},'design')"))?;
    let definition = file.entity(format_args!("PRODUCT_DEFINITION('design','',{formation},{design})"))?;
    file.entity(format_args!("PRODUCT_DEFINITION_SHAPE('','',{definition})"))
}

/// The context of the geometry: dimension, units, and the distance below which points are the same.
pub(super) fn context(file: &mut Part21<'_>, unit: LengthUnit, uncertainty: f64) -> io::Result<Id> {
    let length = match unit {
        LengthUnit::Metre => si_metre(file, "$")?,
        LengthUnit::Centimetre => si_metre(file, ".CENTI.")?,
        LengthUnit::Millimetre => si_metre(file, ".MILLI.")?,
        LengthUnit::Micrometre => si_metre(file, ".MICRO.")?,
        LengthUnit::Inch => converted(file, "INCH", unit)?,
        LengthUnit::Foot => converted(file, "FOOT", unit)?,
    };
    let angle = file.entity(format_args!("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))"))?;
    let solid = file.entity(format_args!("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())"))?;
    let uncertainty = file.entity(format_args!(
        "UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE({}),{length},'distance_accuracy_value','confusion accuracy')",
        real(uncertainty)
    ))?;
    file.entity(format_args!(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT({})\
         GLOBAL_UNIT_ASSIGNED_CONTEXT({})REPRESENTATION_CONTEXT('','3D'))",
        list([uncertainty]),
        list([length, angle, solid])
    ))
}

/// The metre with a prefix.
fn si_metre(file: &mut Part21<'_>, prefix: &str) -> io::Result<Id> {
    file.entity(format_args!("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({prefix},.METRE.))"))
}

/// A unit that is a multiple of the millimetre.
fn converted(file: &mut Part21<'_>, name: &str, unit: LengthUnit) -> io::Result<Id> {
    let millimetre = si_metre(file, ".MILLI.")?;
    let size = real(unit.millimetres());
    let dimensions = file.entity(format_args!("DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.)"))?;
    let factor = file.entity(format_args!("LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE({size}),{millimetre})"))?;
    file.entity(format_args!("(CONVERSION_BASED_UNIT('{name}',{factor})LENGTH_UNIT()NAMED_UNIT({dimensions}))"))
}
