//! Reads meshes: samples of other libraries, damaged files, and what each format allows.

mod content;
mod damaged;
mod limits;
mod make;
mod samples;
