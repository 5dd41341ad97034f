//! thb-core
