//! Triangle meshes.

use std::path::Path;

use spherule_formats::MemoryBudget;
use spherule_formats::mesh::parse_mesh;

use super::check_error;

/// What a mesh may take: less than the process, so that a count that becomes an allocation is a finding.
const BUDGET: MemoryBudget = MemoryBudget::new(256 << 20, "raise the limit");

/// Meshes of every format. The content decides; text without a signature is read as OBJ.
pub fn mesh(bytes: &[u8]) -> usize {
    match parse_mesh(bytes, Path::new("a.obj"), BUDGET) {
        Ok(mesh) => {
            let held = mesh.vertices.len() * 24 + mesh.triangles.len() * 12;
            assert!(held as u64 <= BUDGET.bytes(), "{held} bytes");
            assert!(!mesh.triangles.is_empty());
            let mut indices = mesh.triangles.as_flattened().iter();
            assert!(indices.all(|index| (*index as usize) < mesh.vertices.len()));
            1
        }
        Err(error) => {
            // Places in arrays that are compressed count from their start.
            check_error(&error, u64::MAX);
            0
        }
    }
}
