//! The `spherule` command.

fn main() {}
