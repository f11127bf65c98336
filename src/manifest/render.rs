//! `[image]` and `[render]`: the size of images, and the settings of tracing.

use glam::Vec3;

use super::key::{Affects, section};
use super::value::{Named, named};
use crate::accel::{BvhLeaves, BvhPreset, SbvhSettings, Structure};
use crate::metrics::Bytes;
use crate::render::{DEFAULT_MIN_WEIGHT, MAX_DEPTH, MAX_SAMPLES, MAX_SIDE, MIN_WEIGHTS};
use crate::scene::{Background, ground};

section! {
    /// Size and sampling of the image
    Image {
        /// Image width in pixels
        width: u32 = 1920, from(1), to(MAX_SIDE), unit("pixels"), flag("width", "WIDTH", "Image");
        /// Image height in pixels
        height: u32 = 1080, from(1), to(MAX_SIDE), unit("pixels"), flag("height", "HEIGHT", "Image");
        /// Samples per pixel
        samples: u32 = 16, from(1), to(MAX_SAMPLES), flag("samples", "SAMPLES", "Image");
    }
}

named! {
    /// Pattern of the ground.
    GroundPattern {
        /// No pattern.
        Plain = "plain",
        /// Squares, every other one darker.
        Checker = "checker",
    }
}

section! {
    /// Settings of the renderer
    Render {
        /// Acceleration structure: auto, lbvh, kdtree, bvh or sbvh
        ///
        /// lbvh is the fastest to build, kdtree the fastest to trace. The image is the same. auto chooses one of these
        /// two by the number of rays per particle.
        accelerator: Option<Structure> = None, or("auto"), affects(Affects::Nothing),
            flag("accelerator", "NAME", "Job");
        /// Build quality of bvh: fast | medium | high
        bvh_preset: BvhPreset = BvhPreset::default(), affects(Affects::Nothing);
        /// Primitives of bvh: blocks, or particles (200 bytes per particle while building)
        bvh_leaves: BvhLeaves = BvhLeaves::default(), affects(Affects::Nothing);
        /// sbvh tries spatial splits where boxes overlap by more than this fraction of the scene's surface area
        sbvh_alpha: f32 = SbvhSettings::DEFAULT.alpha, affects(Affects::Nothing),
            from(*SbvhSettings::ALPHAS.start()), to(*SbvhSettings::ALPHAS.end());
        /// Maximum number of references per particle that the spatial splits of sbvh add; 0 turns them off
        sbvh_budget: f32 = SbvhSettings::DEFAULT.budget, affects(Affects::Nothing),
            zero("no spatial splits"), from(*SbvhSettings::BUDGETS.start()), to(*SbvhSettings::BUDGETS.end());
        /// Maximum depth of reflections and refractions; 1 is direct light only
        max_depth: u32 = 3, from(1), to(MAX_DEPTH), flag("max-depth", "MAX_DEPTH", "Look");
        /// Transmissive spheres: path weight below which only one of the two branches is followed; 0 always follows
        /// both
        min_weight: f32 = DEFAULT_MIN_WEIGHT, affects(Affects::BranchingSpheres), or_zero(),
            from(*MIN_WEIGHTS.start()), to(*MIN_WEIGHTS.end());
        /// Background: auto, linear RGB, or { bottom = [...], top = [...] }
        background: Option<Background> = None, or("auto");
        /// A ground plane under the particles, which receives shadows
        ground: bool = false, flag("ground", "", "Look");
        /// Height of the ground along input.up, or auto
        ground_height: Option<f64> = None, or("auto"), unit("a height");
        /// Colour of the ground, linear RGB
        ground_color: Vec3 = ground::DEFAULT_COLOR;
        /// Pattern of the ground: plain | checker (every other square is darker)
        ground_pattern: GroundPattern = GroundPattern::Plain;
        /// Edge length of the squares of the pattern, or auto
        ground_tile: Option<f64> = None, or("auto"), unit("a length"), above(0), single();
        /// Maximum memory to use: 4GiB, 512MiB; frames that need more fail
        memory_limit: Option<Bytes> = None, example("\"4GiB\""), unset("the free memory"), affects(Affects::Nothing),
            flag("memory-limit", "SIZE", "Job");
    }
}

impl Named for Structure {
    fn names() -> Vec<(Self, &'static str)> {
        Self::ALL
            .map(|structure| (structure, structure.name()))
            .to_vec()
    }
}

impl Named for BvhPreset {
    fn names() -> Vec<(Self, &'static str)> {
        Self::ALL.map(|preset| (preset, preset.name())).to_vec()
    }
}

impl Named for BvhLeaves {
    fn names() -> Vec<(Self, &'static str)> {
        Self::ALL.map(|leaves| (leaves, leaves.name())).to_vec()
    }
}
