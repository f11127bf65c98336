//! What makes pictures clear where light does not: the widths of outlines, and how particles fade with their distance.

use crate::scene::{Bounds, Scene};

/// How outlines and distance are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Drawing {
    /// Width of outlines, pixels; 0 is none.
    pub outline: f32,
    /// How much the farthest particles fade into the background, 0 to 1.
    pub depth_cue: f32,
}

impl Drawing {
    /// Neither outlines nor fading.
    pub const NONE: Self = Self { outline: 0.0, depth_cue: 0.0 };
}

/// By how much particles fade with their distance.
#[derive(Debug, Clone, Copy)]
pub(super) struct DepthCue {
    near: f32,
    /// The fading per distance, up to `most`.
    slope: f32,
    most: f32,
}

impl DepthCue {
    /// The fading over the box of the particles of `scene`; None if nothing fades.
    pub(super) fn new(scene: &Scene, drawing: &Drawing) -> Option<Self> {
        let [min, max] = scene.particles;
        let bounds = Bounds { min: min.as_dvec3(), max: max.as_dvec3() };
        let depths =
            bounds.corners().map(|corner| scene.camera.depth_of(corner.as_vec3()).max(0.0));
        let near = depths.into_iter().fold(f32::INFINITY, f32::min);
        let far = depths.into_iter().fold(0.0, f32::max);
        let slope = drawing.depth_cue / (far - near);
        (drawing.depth_cue > 0.0 && slope.is_finite()).then_some(Self {
            near,
            slope,
            most: drawing.depth_cue,
        })
    }

    /// The part of a surface at this depth that is left.
    pub(super) fn left(&self, depth: f32) -> f32 {
        1.0 - (self.slope * (depth - self.near)).clamp(0.0, self.most)
    }
}
