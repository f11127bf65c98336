//! The native half of the Python package `spherule`: renders arrays, reads and writes frames, and runs jobs. The
//! package `spherule/` checks arguments and has the documentation for users.
#![deny(unsafe_code)]

use pyo3::prelude::*;

mod arrays;
mod errors;
mod frames;
mod image;
mod job;
mod settings;
mod threads;

#[pymodule]
mod _spherule {
    #[pymodule_export]
    use super::frames::{FrameList, write_spf};
    #[pymodule_export]
    use super::image::{NativeImage, render};
    #[pymodule_export]
    use super::job::{job_dir, run_job, write_manifest};

    #[pymodule_init]
    fn init(module: &super::Bound<'_, super::PyModule>) -> super::PyResult<()> {
        use super::PyModuleMethods as _;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
