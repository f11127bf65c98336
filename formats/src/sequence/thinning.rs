//! Every n-th particle of a frame, for pictures of frames that do not fit into memory as a whole.

use std::path::Path;

use crate::names::ID;
use crate::native::{Access, NativeFile};
use crate::{Attribute, AttributeData, FrameError, RawParticles};
use spherule_frame::values::id_of;

/// Reads those particles of the native frame at `path` whose index is a multiple of `every`. The others are not in
/// memory.
pub(super) fn native(path: &Path, every: u32) -> Result<RawParticles, FrameError> {
    let file = NativeFile::open(path, Access::Map)?;
    let frame = file.frame_unchecked();
    let read = frame.verify_nodes().and_then(|()| frame.every(every as usize));
    let mut particles = read.map_err(|error| error.in_file(path))?;
    file.check()?;
    let count = particles.positions.len();
    add_indices(&mut particles, (0..count).filter_map(|i| u32::try_from(i * every as usize).ok()));
    Ok(particles)
}

/// Keeps those of `particles` whose index is a multiple of `every`.
pub(super) fn keep(particles: &mut RawParticles, every: u32) {
    let count = u32::try_from(particles.positions.len()).unwrap_or(u32::MAX);
    let kept: Vec<u32> = (0..count).step_by(every as usize).collect();
    particles.select(&kept);
    add_indices(particles, kept.into_iter());
}

/// Adds the indices that particles without ids had.
fn add_indices(particles: &mut RawParticles, indices: impl Iterator<Item = u32>) {
    let indices: Vec<u32> = indices.collect();
    // There may be more particles than such indices
    if id_of(&particles.attributes).is_none() && indices.len() == particles.positions.len() {
        let data = AttributeData::U32(indices);
        particles.attributes.push(Attribute { name: ID[0].to_owned(), components: 1, data });
    }
}
