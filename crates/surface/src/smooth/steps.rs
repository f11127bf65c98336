//! The arithmetic of the traversal of a brick tree by a packet: plain loops over lanes, compiled for each instruction
//! set.
#![expect(clippy::needless_range_loop, reason = "loops over lanes, each of many arrays")]

use super::brick::{VOXEL_BITS, VOXELS, VOXELS_I32};
use super::root::{Segments, first_roots};
use super::tree::BrickTree;
use spherule_tree::math::{Integers, LANES, Lanes, Lanes3, lane_kernel, larger, smaller, splat};
use spherule_tree::ray::RayPacket;

/// Minimum absolute component of a direction, so that inverses are finite.
const MIN_DIRECTION: f32 = 1e-9;

/// Rays in voxels from the corner of the root; distances are still those of the original rays.
#[derive(Default)]
#[repr(C, align(64))]
pub(super) struct GridRays {
    pub(super) origin: Lanes3,
    pub(super) direction: Lanes3,
    pub(super) inverse: Lanes3,
    /// 1 along axes with a positive direction, else 0: the side at which the ray leaves a cell.
    pub(super) ahead: Lanes3,
}

/// Current position of each ray of a packet.
#[derive(Default)]
#[repr(C, align(64))]
pub(super) struct Progress {
    pub(super) t: Lanes,
    /// Distance at which the ray leaves the tree or ends.
    pub(super) t_out: Lanes,

    /// The current cell: the coordinates of a brick in it.
    pub(super) cell: [Integers; 3],
    /// The edge of the cell, in bricks.
    pub(super) size: Integers,
    /// Distance at which the ray leaves the cell.
    pub(super) t_exit: Lanes,
    /// The axes along which it leaves the cell, one bit each.
    pub(super) exit_axes: Integers,
    /// Origin of the ray in voxels from the corner of the cell.
    pub(super) local: Lanes3,

    /// Distance at which the ray leaves the marked voxels of a brick.
    pub(super) t_marked: Lanes,
    pub(super) voxel: [Integers; 3],
    /// Distance at which the ray crosses the next plane of voxels, along each axis.
    pub(super) next: Lanes3,
}

/// Bounding boxes of marked voxels.
#[derive(Default)]
#[repr(C, align(64))]
pub(super) struct Boxes {
    pub(super) low: Lanes3,
    pub(super) high: Lanes3,
}

/// Converts rays to voxels, clips them to the box of the tree, and finds the cells where they enter it. Returns the
/// lanes of rays that enter the tree.
#[inline(always)]
fn enter_tree_body(
    tree: &BrickTree,
    rays: &RayPacket,
    grid: &mut GridRays,
    progress: &mut Progress,
) -> u32 {
    let (low, high) = (tree.low.to_array(), tree.high.to_array());
    let corner = tree.origin.to_array();
    let mut entered = 0;
    for l in 0..LANES {
        let (mut t_in, mut t_out) = (rays.t_min[l], rays.t_max[l]);
        let mut sum = 0.0;
        for a in 0..3 {
            // Convert the ray to voxels
            let origin = (rays.origin[a][l] - corner[a]) * tree.inverse;
            let direction = rays.direction[a][l] * tree.inverse;
            let is_flat = direction.abs() < MIN_DIRECTION;
            let least = if direction.is_sign_negative() { -MIN_DIRECTION } else { MIN_DIRECTION };
            let nonzero = if is_flat { least } else { direction };
            let inverse = 1.0 / nonzero;
            grid.origin[a][l] = origin;
            grid.direction[a][l] = direction;
            grid.inverse[a][l] = inverse;
            grid.ahead[a][l] = if nonzero >= 0.0 { 1.0 } else { 0.0 };
            // Clip the ray to the box
            let near = (low[a] - origin) * inverse;
            let far = (high[a] - origin) * inverse;
            t_in = larger(smaller(near, far), t_in);
            t_out = smaller(larger(near, far), t_out);
            sum += origin.abs() + direction.abs();
        }
        entered |= u32::from((sum < f32::INFINITY) & (t_in < t_out)) << l;
        progress.t[l] = t_in;
        progress.t_out[l] = t_out;
        for a in 0..3 {
            // Find the brick where the ray enters
            let last = larger(high[a] - 1.0, low[a]);
            let position = grid.origin[a][l] + grid.direction[a][l] * t_in;
            let position = smaller(larger(position, low[a]), last);
            progress.cell[a][l] = integer_part(position / VOXELS as f32);
        }
    }
    entered
}

lane_kernel! {
    pub(super) fn enter_tree(
        tree: &BrickTree,
        rays: &RayPacket,
        grid: &mut GridRays,
        progress: &mut Progress,
    ) -> u32 = enter_tree_body;
}

/// Moves the rays of `lanes` to the next cells, and writes the coordinate bits that change to `changed`. Returns the
/// lanes of rays that do not end before.
#[inline(always)]
fn leave_cells_body(
    grid: &GridRays,
    progress: &mut Progress,
    changed: &mut Integers,
    lanes: u32,
) -> u32 {
    let mut continuing = 0;
    for l in 0..LANES {
        // Advance the ray to the exit of its cell
        let is_leaving = lanes >> l & 1 == 1;
        continuing |= u32::from(progress.t_exit[l] < progress.t_out[l]) << l;
        let t = larger(progress.t_exit[l], progress.t[l]);
        progress.t[l] = if is_leaving { t } else { progress.t[l] };
        let size = progress.size[l];
        let last = size as f32 - 0.5;
        let mut bits = 0;
        for a in 0..3 {
            // Along all axes except the exit axes, the ray stays within the extent of the cell, whatever the rounding
            // of `t`
            let cell = progress.cell[a][l];
            let first = cell & !(size - 1);
            let position = (progress.local[a][l] + grid.direction[a][l] * t) / VOXELS as f32;
            let beside = first + integer_part(smaller(larger(position, 0.0), last));
            // Along an exit axis, it moves to the adjacent brick
            let beyond = if grid.ahead[a][l] > 0.0 { first + size } else { first - 1 };
            let is_exit = progress.exit_axes[l] >> a & 1 == 1;
            let next = if is_exit { beyond } else { beside };
            bits |= cell ^ next;
            progress.cell[a][l] = if is_leaving { next } else { cell };
        }
        changed[l] = bits;
    }
    continuing
}

lane_kernel! {
    pub(super) fn leave_cells(
        grid: &GridRays,
        progress: &mut Progress,
        changed: &mut Integers,
        lanes: u32,
    ) -> u32 = leave_cells_body;
}

/// Finds the distances at which rays leave their cells.
#[inline(always)]
fn find_exits_body(grid: &GridRays, progress: &mut Progress) {
    for l in 0..LANES {
        let size = progress.size[l];
        let edge = (size << VOXEL_BITS) as f32;
        let mut next = [0.0; 3];
        for a in 0..3 {
            // Intersect the ray with the far plane of the cell
            let first = progress.cell[a][l] & !(size - 1);
            let corner = first as f32 * VOXELS as f32;
            let far = corner + edge * grid.ahead[a][l];
            next[a] = (far - grid.origin[a][l]) * grid.inverse[a][l];
            progress.local[a][l] = grid.origin[a][l] - corner;
        }
        // Find the nearest plane, and all axes with this distance
        let nearest = least(&next);
        progress.t_exit[l] = nearest;
        let bit = |a: usize| i32::from(next[a] <= nearest) << a;
        progress.exit_axes[l] = bit(0) | bit(1) | bit(2);
    }
}

lane_kernel! {
    pub(super) fn find_exits(grid: &GridRays, progress: &mut Progress) = find_exits_body;
}

/// Moves rays of `lanes` to the first voxel of a box in their bricks. Returns the lanes of the rays that hit the box.
#[inline(always)]
fn enter_boxes_body(grid: &GridRays, boxes: &Boxes, progress: &mut Progress, lanes: u32) -> u32 {
    let mut entered = 0;
    for l in 0..LANES {
        let mut t = progress.t[l];
        // Clip the ray to the box, whose planes are voxel planes, so that the last step ends there
        let mut t_marked = smaller(progress.t_exit[l], progress.t_out[l]);
        for a in 0..3 {
            let near = (boxes.low[a][l] - progress.local[a][l]) * grid.inverse[a][l];
            let far = (boxes.high[a][l] - progress.local[a][l]) * grid.inverse[a][l];
            t = larger(smaller(near, far), t);
            t_marked = smaller(larger(near, far), t_marked);
        }
        // Update the rays that hit the box
        let is_in = (lanes >> l & 1 == 1) & (t <= t_marked);
        entered |= u32::from(is_in) << l;
        progress.t[l] = if is_in { t } else { progress.t[l] };
        progress.t_marked[l] = if is_in { t_marked } else { progress.t_marked[l] };
        for a in 0..3 {
            // Find the first voxel, and the next plane of voxels
            let local = progress.local[a][l];
            let start = local + grid.direction[a][l] * t;
            let start = smaller(larger(start, boxes.low[a][l]), boxes.high[a][l] - 1.0);
            let voxel = integer_part(start);
            let next = (voxel as f32 + grid.ahead[a][l] - local) * grid.inverse[a][l];
            progress.voxel[a][l] = if is_in { voxel } else { progress.voxel[a][l] };
            progress.next[a][l] = if is_in { next } else { progress.next[a][l] };
        }
    }
    entered
}

lane_kernel! {
    pub(super) fn enter_boxes(
        grid: &GridRays,
        boxes: &Boxes,
        progress: &mut Progress,
        lanes: u32,
    ) -> u32 = enter_boxes_body;
}

/// Moves the rays of `lanes` to the next voxel (Amanatides and Woo 1987); a ray that passes through an edge steps
/// along two axes at once. Returns the lanes of rays that are still inside the box of marked voxels.
#[inline(always)]
fn step_voxels_body(grid: &GridRays, progress: &mut Progress, lanes: u32) -> u32 {
    let mut staying = 0;
    for l in 0..LANES {
        let next = [progress.next[0][l], progress.next[1][l], progress.next[2][l]];
        let nearest = least(&next);
        let is_stepping = lanes >> l & 1 == 1;
        let t = larger(nearest, progress.t[l]);
        progress.t[l] = if is_stepping { t } else { progress.t[l] };
        let mut bits = 0;
        for a in 0..3 {
            // Step along the axis if its plane is the nearest
            let is_stepped = is_stepping & (next[a] <= nearest);
            let length = grid.inverse[a][l].abs();
            let direction = if grid.ahead[a][l] > 0.0 { 1 } else { -1 };
            let voxel = progress.voxel[a][l] + if is_stepped { direction } else { 0 };
            progress.next[a][l] = if is_stepped { next[a] + length } else { next[a] };
            progress.voxel[a][l] = voxel;
            bits |= voxel;
        }
        // Keep rays that stay in the brick and in the box
        let is_in_brick = bits & !(VOXELS_I32 - 1) == 0;
        staying |= u32::from(is_stepping & is_in_brick & (nearest < progress.t_marked[l])) << l;
    }
    staying
}

lane_kernel! {
    pub(super) fn step_voxels(grid: &GridRays, progress: &mut Progress, lanes: u32) -> u32 = step_voxels_body;
}

/// Moves rays of `lanes` to their crossing with the surface in their voxels. Returns the lanes of rays that cross it.
#[inline(always)]
fn cross_voxels_body(
    grid: &GridRays,
    corners: &[Integers; 8],
    threshold: f32,
    progress: &mut Progress,
    lanes: u32,
    inside: u32,
) -> u32 {
    // Compute the segment of each ray in its voxel
    let mut segments = Segments::default();
    let mut end = splat(0.0);
    for l in 0..LANES {
        let next = [progress.next[0][l], progress.next[1][l], progress.next[2][l]];
        let nearest = least(&next);
        end[l] = larger(smaller(nearest, progress.t_marked[l]), progress.t[l]);
        segments.sign[l] = if inside >> l & 1 == 1 { -1.0 } else { 1.0 };
        for a in 0..3 {
            let (local, direction) = (progress.local[a][l], grid.direction[a][l]);
            let voxel = progress.voxel[a][l] as f32;
            let from = local + direction * progress.t[l] - voxel;
            let to = local + direction * end[l] - voxel;
            segments.from[a][l] = from;
            segments.along[a][l] = to - from;
        }
    }
    // Solve for the first crossings, and move the rays there
    let (crossed, part) = first_roots(corners, &segments, threshold, lanes);
    for l in 0..LANES {
        let t = progress.t[l] + part[l] * (end[l] - progress.t[l]);
        progress.t[l] = if crossed >> l & 1 == 1 { t } else { progress.t[l] };
    }
    crossed
}

lane_kernel! {
    pub(super) fn cross_voxels(
        grid: &GridRays,
        corners: &[Integers; 8],
        threshold: f32,
        progress: &mut Progress,
        lanes: u32,
        inside: u32,
    ) -> u32 = cross_voxels_body;
}

/// The least of three values.
#[inline(always)]
fn least([x, y, z]: &[f32; 3]) -> f32 {
    smaller(smaller(*x, *y), *z)
}

/// The integer part of a number from 0 to 2^22. (The saturating `as` would be compiled lane by lane.)
#[inline(always)]
fn integer_part(x: f32) -> i32 {
    const UNIT: f32 = 8_388_608.0;
    let biased = x + UNIT;
    let rounded = biased - UNIT;
    let nearest = biased.to_bits().cast_signed() - UNIT.to_bits().cast_signed();
    nearest - i32::from(rounded > x)
}

#[inline(always)]
pub(super) fn in_lane(v: &[Integers; 3], lane: usize) -> [i32; 3] {
    [v[0][lane], v[1][lane], v[2][lane]]
}
