//! The targets, by name.

mod beside;
mod files;
mod messages;
mod models;
mod options;
mod readers;
mod step;
mod tiny_fits;

use geom_io::Format;

use crate::bounds;
use crate::repair::{Open, open_archive, open_e57, open_glb, open_las};

pub use self::tiny_fits::{CHOICES, Counts, choices_of};

/// Something that takes any bytes.
pub struct Target {
    /// Name of its program and of the folder of its corpus.
    pub name: &'static str,
    run: fn(&[u8]),
    pub(crate) open: Option<Open>,
}

impl Target {
    /// Runs an input.
    ///
    /// # Panics
    /// If anything is wrong with how it ends, or it costs more than it may.
    pub fn check(&self, bytes: &[u8]) {
        bounds::name_running(self.name);
        (self.run)(bytes);
    }
}

macro_rules! targets {
    ($($name:ident = $text:literal, $run:expr, $open:expr;)*) => {
        $(
            #[doc = concat!("The target `", $text, "`.")]
            pub static $name: Target = Target { name: $text, run: $run, open: $open };
        )*

        /// All targets.
        pub static ALL: &[&Target] = &[$(&$name),*];
    };
}

targets! {
    TABLE = "table", readers::table, None;
    PLY = "ply", |bytes| readers::read(bytes, Format::Ply), None;
    OBJ = "obj", |bytes| readers::read(bytes, Format::Obj), None;
    OFF = "off", |bytes| readers::read(bytes, Format::Off), None;
    STL = "stl", |bytes| readers::read(bytes, Format::Stl), None;
    PCD = "pcd", |bytes| readers::read(bytes, Format::Pcd), None;
    LAS = "las", readers::las, Some(open_las);
    LAZ = "laz", readers::las, Some(open_las);
    E57 = "e57", |bytes| readers::read(bytes, Format::E57), Some(open_e57);
    ESRI_GRID = "esri_grid", |bytes| readers::read(bytes, Format::EsriGrid), None;
    SURFER_GRID = "surfer_grid", |bytes| readers::read(bytes, Format::SurferGrid), None;
    GEO_TIFF = "geo_tiff", |bytes| readers::read(bytes, Format::GeoTiff), None;
    PTX = "ptx", |bytes| readers::read(bytes, Format::Ptx), None;
    GLB = "glb", |bytes| readers::read(bytes, Format::Glb), Some(open_glb);
    THREE_MF = "three_mf", |bytes| readers::read(bytes, Format::ThreeMf), Some(open_archive);
    GISMO_XML = "gismo_xml", |bytes| readers::read(bytes, Format::GismoXml), None;
    CONTAINERS = "containers", readers::contained, Some(open_archive);
    BESIDE = "beside", beside::run, None;
    MODELS = "models", models::run, None;
    STEP = "step", step::run, None;
    OPTIONS = "options", options::run, None;
    TINY_FITS = "tiny_fits", tiny_fits::run, None;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_target_has_a_program_and_a_corpus() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        let manifest = std::fs::read_to_string(root.join("Cargo.toml")).unwrap();
        for Target { name, .. } in ALL {
            assert!(manifest.contains(&format!("path = \"fuzz_targets/{name}.rs\"")), "{name}");
            assert!(root.join("fuzz_targets").join(format!("{name}.rs")).is_file(), "{name}");
            assert!(root.join("corpus").join(name).is_dir(), "{name}");
        }
    }
}
