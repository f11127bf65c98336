//! The background, for rays without an intersection.

use glam::Vec3;

use crate::scene::Background;
use crate::scene::background::{STUDIO_BOTTOM, STUDIO_TOP};
use spherule_tree::math::functions::asin;
use spherule_tree::math::{LANES, Lanes3, lane_kernel, splat};

/// A background in a form for packets: a gradient from `bottom` to `top` along `up`.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct BackgroundLanes {
    bottom: Vec3,
    top: Vec3,
    up: Vec3,
    is_constant: bool,
}

impl From<&Background> for BackgroundLanes {
    fn from(background: &Background) -> Self {
        match *background {
            Background::Constant(color) => {
                Self { bottom: color, top: color, up: Vec3::Z, is_constant: true }
            }
            Background::Gradient { bottom, top, up } => {
                Self { bottom, top, up, is_constant: false }
            }
            Background::Studio { up } => {
                Self { bottom: STUDIO_BOTTOM, top: STUDIO_TOP, up, is_constant: false }
            }
        }
    }
}

/// Adds the radiance of the background along `direction` times `weight` to `radiance`, only for `lanes`.
#[inline(always)]
fn add_background_body(
    background: &BackgroundLanes,
    direction: &Lanes3,
    weight: &Lanes3,
    lanes: u32,
    radiance: &mut Lanes3,
) {
    // Compute the position in the gradient from the elevation of the ray
    let up = background.up;
    let mut part = splat(0.0);
    if !background.is_constant {
        for l in 0..LANES {
            let d = [direction[0][l], direction[1][l], direction[2][l]];
            let height = d[0] * up.x + d[1] * up.y + d[2] * up.z;
            let height = if height < -1.0 { -1.0 } else { height };
            let height = if height > 1.0 { 1.0 } else { height };
            part[l] = 0.5 + asin(height) * std::f32::consts::FRAC_1_PI;
        }
    }
    // Mix the colours of the gradient and add them
    for axis in 0..3 {
        let (bottom, top) = (background.bottom[axis], background.top[axis]);
        for l in 0..LANES {
            let color = bottom * (1.0 - part[l]) + top * part[l];
            let color = if background.is_constant { bottom } else { color };
            let sum = radiance[axis][l] + weight[axis][l] * color;
            radiance[axis][l] = if lanes >> l & 1 == 1 { sum } else { radiance[axis][l] };
        }
    }
}

lane_kernel! {
    pub(in crate::render) fn add_background(
        background: &BackgroundLanes,
        direction: &Lanes3,
        weight: &Lanes3,
        lanes: u32,
        radiance: &mut Lanes3,
    ) = add_background_body;
}
