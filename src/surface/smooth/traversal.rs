//! Packets of rays through a brick tree: where each ray first crosses the surface.
//!
//! Each ray goes its own way, in three stages as on a graphics processor (Aila and Laine 2009): from cell to cell of the
//! tree, from voxel to voxel of a brick, and along the field within a voxel. The stage that most rays wait for is next,
//! for all of them at once. Nodes and bricks are looked up ray by ray, all arithmetic is on 16 lanes. What is found for
//! a ray does not depend on the others.

use super::steps::{
    Boxes, GridRays, Progress, cross_voxels, enter_boxes, enter_tree, find_exits, in_lane,
    leave_cells, step_voxels,
};
use super::tree::{BrickTree, LEVEL_BITS, MAX_LEVELS, bit_of};
use crate::math::{LANES, Lanes, Lanes3, Supported, lane_kernel, lane3, lanes_in};
use crate::ray::RayPacket;
use crate::surface::Side;

/// Stands for no brick.
const NO_BRICK: u32 = u32::MAX;

/// Where rays of a packet first come to the other side.
#[derive(Default)]
#[repr(C, align(64))]
pub(super) struct Crossings {
    /// Lanes that do.
    pub(super) mask: u32,
    /// Distance along the ray.
    pub(super) t: Lanes,
    /// The position in voxels from the corner of the brick.
    position: Lanes3,
    brick: [u32; LANES],
}

impl Crossings {
    /// The brick of the crossing in `lane` and the position in it, in voxels. None where a uniform cell begins against
    /// expectation.
    #[inline(always)]
    pub(super) fn brick(&self, lane: usize) -> Option<(u32, glam::Vec3)> {
        let brick = self.brick[lane];
        (brick != NO_BRICK).then(|| (brick, lane3(&self.position, lane)))
    }
}

/// The state of a packet.
struct Traversal<'a> {
    simd: Supported,
    tree: &'a BrickTree,
    rays: &'a GridRays,
    progress: &'a mut Progress,
    brick: &'a mut [u32; LANES],
    level: [u32; LANES],
    /// The node of each level.
    nodes: [[u32; MAX_LEVELS as usize]; LANES],
    /// Lanes of rays that start inside.
    inside: u32,
    waiting: Waiting,
    /// Lanes of rays that crossed the surface, at `progress.t`.
    crossed: u32,
}

/// Lanes that wait for each stage.
#[derive(Default)]
struct Waiting {
    /// For the cell that they are in to be looked at.
    in_new_cell: u32,
    /// For the next cell.
    leaving: u32,
    in_voxel: u32,
    /// They are in a voxel that the surface may pass.
    at_surface: u32,
}

impl BrickTree {
    /// The first positions where the rays of `lanes` come to the other side; those of `inside` start inside.
    #[inline]
    pub(super) fn first_crossings(
        &self,
        simd: Supported,
        rays: &RayPacket,
        lanes: u32,
        inside: u32,
        crossings: &mut Crossings,
    ) {
        crossings.mask = 0;
        if self.is_empty() {
            return;
        }
        let mut grid = GridRays::default();
        let mut progress = Progress::default();
        let entered = lanes & enter_tree(simd, self, rays, &mut grid, &mut progress);
        if entered == 0 {
            return;
        }
        crossings.mask = traverse(
            simd,
            simd,
            self,
            &grid,
            entered,
            inside,
            &mut progress,
            &mut crossings.brick,
        );
        crossings.t = progress.t;
        for a in 0..3 {
            for l in 0..LANES {
                crossings.position[a][l] =
                    progress.local[a][l] + grid.direction[a][l] * progress.t[l];
            }
        }
    }
}

#[inline(always)]
fn traverse_body(
    simd: Supported,
    tree: &BrickTree,
    rays: &GridRays,
    entered: u32,
    inside: u32,
    progress: &mut Progress,
    brick: &mut [u32; LANES],
) -> u32 {
    let top = tree.levels - 1;
    let mut nodes = [[0; MAX_LEVELS as usize]; LANES];
    for nodes in &mut nodes {
        nodes[top as usize] = tree.root;
    }
    let mut traversal = Traversal {
        simd,
        tree,
        rays,
        progress,
        brick,
        level: [top; LANES],
        nodes,
        inside,
        waiting: Waiting {
            in_new_cell: entered,
            ..Waiting::default()
        },
        crossed: 0,
    };
    traversal.run();
    traversal.crossed
}

lane_kernel! {
    /// Follows the rays of `entered` lanes. Returns the lanes of those that cross the surface.
    fn traverse(
        simd: Supported,
        tree: &BrickTree,
        rays: &GridRays,
        entered: u32,
        inside: u32,
        progress: &mut Progress,
        brick: &mut [u32; LANES],
    ) -> u32 = traverse_body;
}

impl Traversal<'_> {
    /// Does the stage that most rays wait for, until none is left.
    #[inline(always)]
    fn run(&mut self) {
        loop {
            let waiting = &self.waiting;
            let cells = (waiting.in_new_cell | waiting.leaving).count_ones();
            let voxels = waiting.in_voxel.count_ones();
            let surfaces = waiting.at_surface.count_ones();
            if surfaces >= cells.max(voxels) {
                if surfaces == 0 {
                    return;
                }
                self.solve();
            } else if voxels >= cells {
                self.next_marked_voxel();
            } else {
                self.next_brick();
            }
        }
    }

    /// From cell to cell: one step of all rays that are not in a brick.
    #[inline(always)]
    fn next_brick(&mut self) {
        let leaving = self.waiting.leaving;
        if leaving != 0 {
            let mut changed = [0; LANES];
            let onward = leave_cells(self.simd, self.rays, self.progress, &mut changed, leaving);
            self.waiting.leaving = 0;
            // Up to the node that holds both cells; there is none where the ray leaves the root
            for lane in lanes_in(onward & leaving) {
                let up = changed[lane].cast_unsigned().max(1).ilog2() / LEVEL_BITS;
                if up < self.tree.levels {
                    self.level[lane] = self.level[lane].max(up);
                    self.waiting.in_new_cell |= 1 << lane;
                }
            }
        }
        let in_brick = self.descend();
        find_exits(self.simd, self.rays, self.progress);
        if in_brick != 0 {
            self.enter_bricks(in_brick);
        }
    }

    /// Goes down to the largest uniform cell, or a brick. Returns the lanes of rays in bricks.
    #[inline(always)]
    fn descend(&mut self) -> u32 {
        let mut in_brick = 0;
        for lane in lanes_in(self.waiting.in_new_cell) {
            let cell = in_lane(&self.progress.cell, lane);
            let nodes = &mut self.nodes[lane];
            let mut level = self.level[lane];
            loop {
                let node = &self.tree.nodes[nodes[level as usize] as usize];
                let bit = bit_of(cell, level);
                if node.children >> bit & 1 == 0 {
                    let is_inside = node.inside >> bit & 1 == 1;
                    if is_inside == (self.inside >> lane & 1 == 1) {
                        self.waiting.leaving |= 1 << lane;
                    } else {
                        self.crossed |= 1 << lane;
                        self.brick[lane] = NO_BRICK;
                    }
                    break;
                }
                let child = node.child(bit);
                if level == 0 {
                    in_brick |= 1 << lane;
                    self.brick[lane] = child;
                    break;
                }
                level -= 1;
                nodes[level as usize] = child;
            }
            self.level[lane] = level;
            self.progress.size[lane] = 1 << (LEVEL_BITS * level);
        }
        self.waiting.in_new_cell = 0;
        in_brick
    }

    /// Puts rays into the first voxel of the box of marked voxels in their bricks; rays that miss it leave.
    #[inline(always)]
    fn enter_bricks(&mut self, in_brick: u32) {
        let mut boxes = Boxes::default();
        for lane in lanes_in(in_brick) {
            let brick = &self.tree.bricks[self.brick[lane] as usize];
            let [low, high] = brick.marked(Side::of_lane(self.inside, lane));
            for a in 0..3 {
                boxes.low[a][lane] = f32::from(low[a]);
                boxes.high[a][lane] = f32::from(high[a]);
            }
        }
        let entered = enter_boxes(self.simd, self.rays, &boxes, self.progress, in_brick);
        self.waiting.in_voxel |= entered;
        self.waiting.leaving |= in_brick & !entered;
    }

    /// Looks at the voxels that rays are in, and goes on from those that the surface does not pass.
    #[inline(always)]
    fn next_marked_voxel(&mut self) {
        let mut marked = 0;
        for lane in lanes_in(self.waiting.in_voxel) {
            let brick = &self.tree.bricks[self.brick[lane] as usize];
            let voxels = brick.voxels(Side::of_lane(self.inside, lane));
            let [x, y, z] = in_lane(&self.progress.voxel, lane).map(|v| v & 7);
            #[expect(clippy::cast_sign_loss, reason = "from 0 to 7")]
            let is_marked = voxels[z as usize] >> (8 * y + x) & 1 == 1;
            marked |= u32::from(is_marked) << lane;
        }
        self.waiting.at_surface |= marked;
        self.waiting.in_voxel &= !marked;
        self.step(self.waiting.in_voxel);
    }

    /// Moves the rays of `lanes` into the next voxel, or out of the brick.
    #[inline(always)]
    fn step(&mut self, lanes: u32) {
        if lanes != 0 {
            let stay = step_voxels(self.simd, self.rays, self.progress, lanes);
            self.waiting.in_voxel = self.waiting.in_voxel & !lanes | stay;
            self.waiting.leaving |= lanes & !stay;
        }
    }

    /// Solves for the crossings in the voxels that rays are in; rays without one go on.
    #[inline(always)]
    fn solve(&mut self) {
        let lanes = self.waiting.at_surface;
        let mut corners = [[0; LANES]; 8];
        for lane in lanes_in(lanes) {
            let brick = &self.tree.bricks[self.brick[lane] as usize];
            let [x, y, z] = in_lane(&self.progress.voxel, lane);
            let values = brick.corners(x, y, z);
            for (corner, value) in corners.iter_mut().zip(values) {
                corner[lane] = value;
            }
        }
        let crossed = cross_voxels(
            self.simd,
            self.rays,
            &corners,
            self.tree.threshold,
            self.progress,
            lanes,
            self.inside,
        );
        self.crossed |= crossed;
        self.waiting.at_surface = 0;
        self.step(lanes & !crossed);
    }
}
