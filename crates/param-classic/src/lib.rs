//! param-classic
