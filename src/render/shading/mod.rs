//! Arithmetic of shading for the 16 lanes of a packet: eq. 4.1 to 4.3 of the thesis, lights, background and floor.
//!
//! Every function here is compiled for each instruction set by `lane_kernel!`; see `math` for what that asks of the
//! bodies. A lane whose numbers are infinite or not numbers never touches another lane: results are selected, not
//! multiplied by zero.

mod arithmetic;
mod background;
mod camera;
mod interface;
mod light;
mod material;

pub(super) use arithmetic::{add, product, scale};
pub(super) use background::{BackgroundLanes, add_background};
pub(super) use camera::{CameraLanes, camera_rays, depths};
pub(super) use interface::{attenuate, interface_points, leaving, passed_straight, refracted_rays};
pub(super) use light::{LightLanes, LightSamples, sample_light};
pub(super) use material::{ShadingPoints, WhittedLanes, shading_points};
