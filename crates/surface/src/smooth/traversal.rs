//! Traversal of a brick tree by packets of rays, to the first crossing of each ray with the surface.
//!
//! Rays are independent of each other, and go through three stages as on a GPU (Aila and Laine 2009): from cell to
//! cell of the tree, from voxel to voxel of a brick, and along the field within a voxel. The next stage is always the
//! one that most rays wait for, and runs for all of them at once. Nodes and bricks are looked up ray by ray, and all
//! arithmetic is on 16 lanes. The result of a ray does not depend on the others.

use super::steps::{
    Boxes, GridRays, Progress, cross_voxels, enter_boxes, enter_tree, find_exits, in_lane,
    leave_cells, step_voxels,
};
use super::tree::{BrickTree, LEVEL_BITS, MAX_LEVELS, bit_of};
use crate::Side;
use spherule_tree::math::{LANES, Lanes, Lanes3, Supported, lane_kernel, lane3, lanes_in};
use spherule_tree::ray::RayPacket;

/// Marks the absence of a brick.
const NO_BRICK: u32 = u32::MAX;

/// The first positions of the rays of a packet on the other side of the surface.
#[derive(Default)]
#[repr(C, align(64))]
pub(super) struct Crossings {
    /// Lanes with a crossing.
    pub(super) mask: u32,
    /// Distance along the ray.
    pub(super) t: Lanes,
    /// The position in voxels from the corner of the brick.
    position: Lanes3,
    brick: [u32; LANES],
}

impl Crossings {
    /// The brick of the crossing in `lane`, and the position in it in voxels. None for a ray that entered a uniform
    /// cell of the other side, which happens only because of rounding.
    #[inline(always)]
    pub(super) fn brick(&self, lane: usize) -> Option<(u32, glam::Vec3)> {
        let brick = self.brick[lane];
        (brick != NO_BRICK).then(|| (brick, lane3(&self.position, lane)))
    }
}

/// State of the traversal of a packet.
struct Traversal<'a> {
    simd: Supported,
    tree: &'a BrickTree,
    rays: &'a GridRays,
    progress: &'a mut Progress,
    brick: &'a mut [u32; LANES],
    level: [u32; LANES],
    /// The current node of each level.
    nodes: [[u32; MAX_LEVELS as usize]; LANES],
    /// Lanes of rays that start inside.
    inside: u32,
    waiting: Waiting,
    /// Lanes of rays that have crossed the surface, at `progress.t`.
    crossed: u32,
}

/// Lanes that wait for each stage.
#[derive(Default)]
struct Waiting {
    /// Rays in a new cell, which is to be looked up.
    in_new_cell: u32,
    /// Rays that move to the next cell.
    leaving: u32,
    /// Rays in a voxel of a brick that is to be checked.
    in_voxel: u32,
    /// Rays in a voxel that the surface may pass through.
    at_surface: u32,
}

impl BrickTree {
    /// Finds the first positions of the rays of `lanes` on the other side of the surface; rays of `inside` start
    /// inside.
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
        // Clip the rays to the box of the tree
        let mut grid = GridRays::default();
        let mut progress = Progress::default();
        let entered = lanes & enter_tree(simd, self, rays, &mut grid, &mut progress);
        if entered == 0 {
            return;
        }
        // Traverse the tree
        crossings.mask =
            traverse(simd, simd, self, &grid, entered, inside, &mut progress, &mut crossings.brick);
        // Compute the positions of the crossings in their bricks
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
    // Start at the root
    let top = tree.levels - 1;
    let mut nodes = [[0; MAX_LEVELS as usize]; LANES];
    for nodes in &mut nodes {
        nodes[top as usize] = tree.root;
    }
    // Descend and step until no ray is left
    let mut traversal = Traversal {
        simd,
        tree,
        rays,
        progress,
        brick,
        level: [top; LANES],
        nodes,
        inside,
        waiting: Waiting { in_new_cell: entered, ..Waiting::default() },
        crossed: 0,
    };
    traversal.run();
    traversal.crossed
}

lane_kernel! {
    /// Traverses the tree with the rays of `entered` lanes. Returns the lanes of rays that cross the surface.
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
    /// Runs the stage that most rays wait for, until no ray is left.
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

    /// First stage: moves all rays outside bricks to the next cell.
    #[inline(always)]
    fn next_brick(&mut self) {
        let leaving = self.waiting.leaving;
        if leaving != 0 {
            // Move the rays that leave their cells
            let mut changed = [0; LANES];
            let continuing =
                leave_cells(self.simd, self.rays, self.progress, &mut changed, leaving);
            self.waiting.leaving = 0;
            // Ascend to the node that contains both cells; there is none if the ray leaves the root
            for lane in lanes_in(continuing & leaving) {
                let up = changed[lane].cast_unsigned().max(1).ilog2() / LEVEL_BITS;
                if up < self.tree.levels {
                    self.level[lane] = self.level[lane].max(up);
                    self.waiting.in_new_cell |= 1 << lane;
                }
            }
        }
        // Descend to the new cells, and find their exits
        let in_brick = self.descend();
        find_exits(self.simd, self.rays, self.progress);
        if in_brick != 0 {
            self.enter_bricks(in_brick);
        }
    }

    /// Descends to the largest uniform cell, or to a brick. Returns the lanes of rays in bricks.
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
                // A uniform cell: the ray leaves it, or has crossed the surface
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
                // Descend to the child
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

    /// Moves rays to the first voxel of the box of marked voxels in their bricks; rays that miss the box leave the
    /// brick.
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

    /// Second stage: checks the voxels of all rays in bricks, and steps on from voxels without a surface.
    #[inline(always)]
    fn next_marked_voxel(&mut self) {
        // Look up the voxel of each ray
        let mut marked = 0;
        for lane in lanes_in(self.waiting.in_voxel) {
            let brick = &self.tree.bricks[self.brick[lane] as usize];
            let voxels = brick.voxels(Side::of_lane(self.inside, lane));
            let [x, y, z] = in_lane(&self.progress.voxel, lane).map(|v| v & 7);
            #[expect(clippy::cast_sign_loss, reason = "from 0 to 7")]
            let is_marked = voxels[z as usize] >> (8 * y + x) & 1 == 1;
            marked |= u32::from(is_marked) << lane;
        }
        // Stop at marked voxels, and step on from all others
        self.waiting.at_surface |= marked;
        self.waiting.in_voxel &= !marked;
        self.step(self.waiting.in_voxel);
    }

    /// Moves the rays of `lanes` to the next voxel, or out of the brick.
    #[inline(always)]
    fn step(&mut self, lanes: u32) {
        if lanes != 0 {
            let staying = step_voxels(self.simd, self.rays, self.progress, lanes);
            self.waiting.in_voxel = self.waiting.in_voxel & !lanes | staying;
            self.waiting.leaving |= lanes & !staying;
        }
    }

    /// Third stage: solves for the crossings in the voxels of rays; rays without a crossing step on.
    #[inline(always)]
    fn solve(&mut self) {
        let lanes = self.waiting.at_surface;
        // Gather the corners of the voxels
        let mut corners = [[0; LANES]; 8];
        for lane in lanes_in(lanes) {
            let brick = &self.tree.bricks[self.brick[lane] as usize];
            let [x, y, z] = in_lane(&self.progress.voxel, lane);
            let values = brick.corners(x, y, z);
            for (corner, value) in corners.iter_mut().zip(values) {
                corner[lane] = value;
            }
        }
        // Solve for the crossings
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
