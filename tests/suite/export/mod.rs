//! Exported jobs for clusters and render farms: the content of the scripts. `.ci/slurm` and `.ci/openjd` run them on
//! engines.

use std::fs;

use glam::Vec3;

use crate::harness::{Workshop, npy};

mod openjd;
mod refused;
mod slurm;

/// Frames with gaps, some before zero.
const FRAMES: [i64; 13] = [-5, -4, -3, -1, 0, 1, 2, 10, 12, 14, 16, 1001, 1002];

/// A directory with a name that scripts must quote, in a workshop: particles, and a manifest for small images.
fn job(workshop: &Workshop, dir: &str, frames: &[i64]) {
    for frame in frames {
        let file = workshop.join(format!("{dir}/in/f.{frame}.npy"));
        npy(&file, 200, frame.unsigned_abs(), Vec3::ZERO);
    }
    let manifest = "[input]\npath = \"in/f.#.npy\"\n[image]\nwidth = 32\nheight = 18\nsamples = 1\n\
                    [output]\npath = \"out/f.####.exr\"\n";
    fs::write(workshop.join(format!("{dir}/job.toml")), manifest).expect("a file");
}
