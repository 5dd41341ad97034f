//! Tests of what the crate offers, in one program: each of its own would be linked anew.

mod corrupt;
mod curve_files;
mod errors;
mod faults;
mod formats;
mod geotiff;
mod mesh_dialects;
mod model_common;
mod model_gismo;
mod model_json;
mod model_peers;
mod model_step;
mod packages;
mod round_trip;
mod scan_files;
mod scanners;
mod tables;
