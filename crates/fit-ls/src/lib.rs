//! fit-ls
