//! Arithmetic of shading for the 16 lanes of a packet: camera rays, background, sums of colours.
//!
//! Every function here, in `materials` and in `lights` is compiled for each instruction set by `lane_kernel!`; see `math`
//! for what that asks of the bodies. A lane whose numbers are infinite or not numbers never touches another lane:
//! results are selected, not multiplied by zero.

mod arithmetic;
mod background;
mod camera;

pub(super) use arithmetic::{add, product, scale};
pub(super) use background::{BackgroundLanes, add_background};
pub(super) use camera::{CameraLanes, camera_rays, depths};
