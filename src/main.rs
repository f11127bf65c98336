//! The `spherule` command. The library contains all of its code.

use std::process::ExitCode;

fn main() -> ExitCode {
    spherule::cli::main()
}
