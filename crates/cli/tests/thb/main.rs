//! The binary `thb`, run as users run it.

mod bad_scans;
mod batch;
mod closed;
mod curves;
mod full_disk;
mod inputs;
mod invariance;
mod kept;
mod lab;
mod layouts;
mod methods;
mod models;
mod normals;
mod options_in_files;
mod pages;
mod pieces;
mod results;
mod resumed;
mod reweighting;
mod scans;
mod solids;
mod unasked;
mod usage;
