//! Particle files for a test: the dam break of the examples, and boxes of any size.

use std::fs;
use std::path::Path;

use glam::Vec3;
use spherule_formats::generate::{BoxSettings, fill_box};
use spherule_formats::write;

/// The example's frames in the order of time.
const DAM_BREAK: [u32; 9] = [1, 3, 5, 7, 9, 11, 13, 15, 17];

/// Puts frames of the dam break into `dir`, called `f_1.bgeo` and so on; after the last the first
/// comes again.
pub(crate) fn dam_break(dir: &Path, frames: impl IntoIterator<Item = usize>) {
    fs::create_dir_all(dir).expect("a directory");
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/dam-break");
    for frame in frames {
        let number = DAM_BREAK[(frame - 1) % DAM_BREAK.len()];
        let from = examples.join(format!("ParticleData_Fluid_{number}.bgeo"));
        fs::copy(from, dir.join(format!("f_{frame}.bgeo"))).expect("an example");
    }
}

/// Writes `count` particles of the thesis's box, seeded, moved by `offset`.
pub(crate) fn npy(path: &Path, count: usize, seed: u64, offset: Vec3) {
    fs::create_dir_all(path.parent().expect("a file in a directory")).expect("a directory");
    let mut centers = fill_box(&BoxSettings::thesis(count, seed));
    for center in &mut centers {
        *center += offset;
    }
    write::npy::write(path, &centers).expect("a file");
}
