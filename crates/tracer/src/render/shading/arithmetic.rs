//! Arithmetic with colours.

use glam::Vec3;

use spherule_tree::math::{LANES, Lanes, Lanes3, lane_kernel};

/// Adds `added` (linear RGB) times `weight` to `radiance`, only for `lanes`.
#[inline(always)]
fn add_body(added: &Lanes3, weight: &Vec3, lanes: u32, radiance: &mut Lanes3) {
    for axis in 0..3 {
        for l in 0..LANES {
            let sum = radiance[axis][l] + weight[axis] * added[axis][l];
            radiance[axis][l] = if lanes >> l & 1 == 1 { sum } else { radiance[axis][l] };
        }
    }
}

lane_kernel! {
    pub(in crate::render) fn add(added: &Lanes3, weight: &Vec3, lanes: u32, radiance: &mut Lanes3) = add_body;
}

/// `a * b` per component.
#[inline(always)]
fn product_body(a: &Lanes3, b: &Lanes3, product: &mut Lanes3) {
    for axis in 0..3 {
        for l in 0..LANES {
            product[axis][l] = a[axis][l] * b[axis][l];
        }
    }
}

lane_kernel! {
    pub(in crate::render) fn product(a: &Lanes3, b: &Lanes3, product: &mut Lanes3) = product_body;
}

/// `a * b`, with the same factor for all components.
#[inline(always)]
fn scale_body(a: &Lanes3, b: &Lanes, scaled: &mut Lanes3) {
    for axis in 0..3 {
        for l in 0..LANES {
            scaled[axis][l] = a[axis][l] * b[l];
        }
    }
}

lane_kernel! {
    pub(in crate::render) fn scale(a: &Lanes3, b: &Lanes, scaled: &mut Lanes3) = scale_body;
}
