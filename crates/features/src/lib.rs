//! Nothing but dependencies: the features of shared dependencies, equal for every selection of crates.
//!
//! Cargo enables what the selected crates ask for. The tests and the Python module ask for more than the command, so that
//! `cargo build` after `cargo test --workspace` would compile every crate again. `Cargo.toml` of this crate lists the
//! union for those dependencies that differ. The command depends on it, and the tests of all other crates do.
