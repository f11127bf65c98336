//! Arithmetic of shading for the 16 lanes of a packet: camera rays, background, colours.
//!
//! Every function here, in `materials` and in `lights` is compiled for each instruction set by `lane_kernel!`; see
//! `math` for its requirements. A lane with infinite or NaN values never affects another lane: results are selected,
//! not multiplied by zero.

mod arithmetic;
mod backdrop;
mod background;
mod camera;
mod frame;

pub(super) use arithmetic::{add, product, scale};
pub(super) use backdrop::add_backdrop;
pub(super) use background::{BackgroundLanes, add_background};
pub(super) use camera::{
    CameraLanes, camera_rays, depths, lens_rays, moving_camera_rays, stereo_rays,
};
pub(super) use frame::{disc, in_cone, tangents, to_world};
