//! `[trails]`: the ways of particles over earlier frames.

use super::color::ColorSetting;
use super::keys::section;
use super::select::MAX_STEP;

/// Greatest number of earlier frames, each of which is read for every picture.
const MAX_FRAMES: u32 = 1000;

section! {
    /// Trails of the particles over earlier frames of the sequence
    Trails {
        /// Number of earlier frames; 0 is no trails
        ///
        /// Particles are found in earlier frames by their ids, or by their place in the file if their number does not
        /// change. Each picture reads so many earlier frames.
        frames: u32 = 0, from(0), to(MAX_FRAMES), flag("trails", "COUNT", "Look");
        /// Radius at the particles, or auto: half the radius of the particles; it falls to 0 at the oldest end
        radius: Option<f32> = None, or("auto"), unit("a length"), above(0), single();
        /// Draw only trails of particles whose id is a multiple of this
        every: u32 = 1, from(1), to(MAX_STEP);
        /// Colour, linear RGB, { attribute = "velocity", range = [0, 5] }, or auto: that of the particle
        ///
        /// The keys of a map are those of material.color, as for arrows.
        color: ColorSetting = ColorSetting::Auto, from(0);
    }
}
