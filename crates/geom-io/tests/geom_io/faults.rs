//! Writing where it goes wrong: full disks, writes of a few bytes, an error at any call. The error comes back, and no file is half there.

use std::io::{self, ErrorKind, Write};

use geom_io::model::dxf::DxfFile;
use geom_io::model::gismo::write_gismo;
use geom_io::model::json::write_json;
use geom_io::model::step::{StepFile, StepOptions};
use geom_io::model::svg::draw_svg;
use geom_io::{LengthUnit, MeshStyle, MeshWithScalars, Model, SvgOptions, WriteError, write_atomically, write_mesh};
use ndarray::Array2;
use thb_core::Kind;

use crate::model_common::{curve, sheet};

/// Passes on what is written, a few bytes a call, until a call fails.
struct Faulty<'a> {
    out: &'a mut dyn Write,
    /// Most bytes that a call takes.
    most: usize,
    /// Calls until one fails, and what it says.
    left: usize,
    kind: ErrorKind,
    calls: usize,
}

impl<'a> Faulty<'a> {
    fn new(out: &'a mut dyn Write, most: usize, left: usize, kind: ErrorKind) -> Self {
        Self { out, most, left, kind, calls: 0 }
    }
}

impl Write for Faulty<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.calls += 1;
        self.left = self.left.checked_sub(1).ok_or(self.kind)?;
        self.out.write(&bytes[..bytes.len().min(self.most)])
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

type Content = Box<dyn Fn(&mut dyn Write) -> io::Result<()>>;

/// What is written in each format of models.
fn contents() -> Vec<(&'static str, Content)> {
    let mut contents: Vec<(&'static str, Content)> = Vec::new();
    for model in [
        Model::surface(sheet(Kind::Thb, [3, 2], [4, 3], 2), LengthUnit::Millimetre),
        Model::curve(curve(3), LengthUnit::Inch),
    ] {
        let (json, gismo) = (model.clone(), model.clone());
        contents.push(("json", Box::new(move |out| write_json(out, &json))));
        contents.push(("xml", Box::new(move |out| write_gismo(out, &gismo))));
        let step = StepFile::new(&model, &StepOptions::default()).unwrap();
        contents.push(("step", Box::new(move |out| step.write(out))));
    }
    let model = Model::curve(curve(3), LengthUnit::Millimetre);
    let (dxf, svg) = (DxfFile::new(&model).unwrap(), draw_svg(&model, &SvgOptions::default()).unwrap());
    contents.push(("dxf", Box::new(move |out| dxf.write(out))));
    contents.push(("svg", Box::new(move |out| out.write_all(svg.as_bytes()))));
    contents
}

#[test]
fn short_and_interrupted_writes_lose_nothing() {
    for (format, content) in contents() {
        let mut whole = Vec::new();
        content(&mut whole).unwrap();
        for most in [1, 7, 512] {
            let mut written = Vec::new();
            content(&mut Faulty::new(&mut written, most, usize::MAX, ErrorKind::Other)).unwrap();
            assert!(written == whole, "{format}, {most} bytes at a time");
        }
        // Calls that a signal interrupts are made again.
        let mut written = Vec::new();
        let mut turn = 0;
        struct Interrupted<'a>(&'a mut dyn Write, &'a mut u32);
        impl Write for Interrupted<'_> {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                *self.1 += 1;
                if *self.1 % 2 == 1 { Err(ErrorKind::Interrupted.into()) } else { self.0.write(bytes) }
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        content(&mut Interrupted(&mut written, &mut turn)).unwrap();
        assert!(written == whole, "{format}");
    }
}

#[test]
fn an_error_at_any_call_comes_back_and_leaves_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    for (format, content) in contents() {
        let mut counted = io::sink();
        let mut all = Faulty::new(&mut counted, usize::MAX, usize::MAX, ErrorKind::Other);
        content(&mut all).unwrap();
        let calls = all.calls;
        let path = folder.path().join(format!("model.{format}"));
        for is_there in [false, true] {
            if is_there {
                std::fs::write(&path, "old").unwrap();
            }
            // The first and the last calls, and some between.
            let step = (calls / 40).max(1);
            for (k, kind) in (0..calls)
                .filter(|k| *k < 5 || k.is_multiple_of(step) || k + 5 > calls)
                .flat_map(|k| [ErrorKind::StorageFull, ErrorKind::WriteZero, ErrorKind::Other].map(|kind| (k, kind)))
            {
                let error = write_atomically(&path, |out| content(&mut Faulty::new(out, usize::MAX, k, kind)));
                let WriteError::Io { path: named, reason } = error.unwrap_err() else {
                    panic!("{format}: another error")
                };
                assert!(named == path && reason.kind() == kind, "{format}, call {k} of {calls}: {reason}");
                let left: Vec<_> =
                    std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
                assert_eq!(left, if is_there { vec![path.clone()] } else { Vec::new() }, "{format}, call {k}");
            }
        }
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        std::fs::remove_file(&path).unwrap();
    }
}

/// `/dev/full` is a disk without room.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_told_by_every_mesh_format() {
    let vertices = Array2::from_shape_fn((4, 3), |(i, k)| [(i % 2) as f64, (i / 2) as f64, 0.5][k]);
    let mesh = MeshWithScalars { vertices: vertices.view(), triangles: &[[0, 1, 2], [1, 3, 2]], scalars: None };
    let folder = tempfile::tempdir().unwrap();
    for extension in ["obj", "ply", "vtk"] {
        let path = folder.path().join(format!("full.{extension}"));
        std::os::unix::fs::symlink("/dev/full", &path).unwrap();
        let error = write_mesh(&path, &mesh, &MeshStyle::default()).unwrap_err();
        let WriteError::Io { path: named, reason } = error else { panic!("{extension}: another error") };
        assert!(named == path && reason.kind() == ErrorKind::StorageFull, "{extension}: {reason}");
    }
}
