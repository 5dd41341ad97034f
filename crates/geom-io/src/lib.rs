//! geom-io
