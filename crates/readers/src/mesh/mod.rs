//! Reads triangle meshes: tanks and obstacles in a picture, not particles.
//!
//! The content decides which format a file is. STL and OBJ are read here; the other formats share their parsers with
//! the particle readers (`read::ply`, `read::vtk`, `read::vtk_xml`). Like those, nothing here trusts a file: indices
//! are checked, counts are compared with the bytes that are there, and memory is bounded by a [`MemoryBudget`].

pub mod builder;
pub mod cells;
mod obj;
mod stl;
mod surface;

use std::path::Path;

pub use builder::Mesh;

use crate::compression::strip_extension;
use crate::read::{ply, vtk, vtk_xml};
use crate::read_whole;
use crate::reader::{Confidence, HEAD_LEN};
use spherule_frame::{FrameError, MemoryBudget, ParseError};

/// Reads the mesh in the file at `path`, compressed or not: STL, OBJ, PLY, legacy VTK or VTK XML.
///
/// Polygons are split into fans around their first corner. Of volumes (tetrahedra and the like), only the surface is
/// read. A vertex may be NaN or infinite.
///
/// # Errors
/// [`FrameError::Io`] if the file cannot be read or changes meanwhile, [`FrameError::Unsupported`] for a file of
/// another format or without faces, [`FrameError::TooLarge`] if it needs more memory than `budget` allows, and
/// [`FrameError::Malformed`] if it is damaged.
pub fn read_mesh(path: &Path, budget: MemoryBudget) -> Result<Mesh, FrameError> {
    let bytes = read_whole(path, budget.for_content())?;
    let left = budget.less(bytes.capacity() as u64);
    parse_mesh(&bytes, path, left).map_err(|error| error.in_file(path))
}

/// Reads the mesh in `bytes`, the content of a file that is called `path` and was not compressed. `budget` is for the
/// mesh alone.
///
/// # Errors
/// As [`read_mesh`], except for reading the file.
pub fn parse_mesh(bytes: &[u8], path: &Path, budget: MemoryBudget) -> Result<Mesh, ParseError> {
    let head = bytes.get(..HEAD_LEN).unwrap_or(bytes);
    let has_signature = |sniffed: Result<Confidence, ParseError>| -> Result<bool, ParseError> {
        Ok(sniffed? == Confidence::Signature)
    };
    if has_signature(ply::FORMAT.reader().sniff(head))? {
        ply::read_mesh(bytes, budget)
    } else if has_signature(vtk::FORMAT.reader().sniff(head))? {
        vtk::read_mesh(bytes, budget)
    } else if has_signature(vtk_xml::FORMAT.reader().sniff(head))? {
        vtk_xml::read_mesh(bytes, budget)
    } else if stl::is_binary(bytes) {
        stl::read_binary(bytes, budget)
    } else if stl::is_ascii(bytes) {
        stl::read_ascii(bytes, budget)
    } else if bytes.is_empty() {
        Err(ParseError::malformed(0, "the file is empty; perhaps it is still being written"))
    } else if obj::is_obj(bytes) || is_named(path, ".obj") {
        obj::read(bytes, budget)
    } else if bytes.starts_with(b"solid") || is_named(path, ".stl") {
        // Neither text nor of the right length: this gives the error.
        stl::read_binary(bytes, budget)
    } else {
        Err(ParseError::unsupported(
            "not a mesh in a format that spherule reads, which are stl, obj, ply, vtk, vtp and vtu",
        ))
    }
}

/// Whether the file name ends with `extension`, which may be followed by that of a compression.
fn is_named(path: &Path, extension: &str) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    strip_extension(&name).ends_with(extension)
}
