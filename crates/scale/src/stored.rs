//! A cell with particles in a native frame, which is mapped and traced in place.

use std::path::Path;
use std::time::Instant;

use spherule_formats::native::layout::RadiusIndex;
use spherule_formats::native::{Access, NativeFile};
use spherule_tree::accel::stored::{StoredSettings, StoredTree};

use super::measure::{Builds, Measured, trace};
use super::peaks::Peaks;
use super::{CellError, CellRequest};

/// Maps the native frame at `path`, builds the levels above its nodes, and traces images.
///
/// # Errors
/// Describes why it cannot be opened or traced, or that it was changed in the meantime.
pub(super) fn trace_in_place(request: &CellRequest, path: &Path) -> Result<Measured, CellError> {
    let peaks = Peaks::default();
    let start = Instant::now();
    let file = NativeFile::open(path, Access::Map)?;
    let frame = file.frame()?;
    let leaves = frame.leaves().map_err(|e| e.in_file(path))?;
    let load_seconds = start.elapsed().as_secs_f64();
    let settings = StoredSettings {
        structure: request.structure,
        radius: match frame.index().radius {
            RadiusIndex::Common(radius) => Some(radius),
            RadiusIndex::None | RadiusIndex::PerParticle(_) => None,
        },
        // All particles have the same colour, so indices are not needed.
        keep_indices: false,
    };
    let mut tree = StoredTree::new();
    let builds = peaks.during(|| {
        Builds::repeat(request.budget, || {
            let built = tree.build(&leaves, settings);
            built.map_err(|fault| CellError::Stored { path: path.to_owned(), fault })
        })
    })?;
    let images = trace(tree.view(&leaves), request, &peaks)?;
    // Pages lost in the meantime would be read as zeros.
    file.check()?;
    Ok(Measured { particles: leaves.count, load_seconds, builds, images, peaks })
}
