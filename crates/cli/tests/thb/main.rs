//! The binary `thb`, run as users run it.

mod batch;
mod inputs;
mod lab;
mod layouts;
mod models;
mod results;
mod scans;
mod usage;
