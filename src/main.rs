//! The `spherule` command: a thin shell around the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    spherule::cli::main()
}
