//! Memory of what rays intersect: trees of spheres, smooth surfaces, spray.

use super::{FrameSize, MemoryModel};
use crate::accel::moving::MovingTree;
use crate::accel::{
    BuildBytes, BuildSettings, Structure, predicted_bytes, predicted_stored_bytes, sorting_bytes,
};
use crate::surface::smooth::GridSize;
use crate::surface::spray::{SOFT_DROP_BYTES, SOFT_DROPS};
use crate::surface::whitewater::{DROP_BYTES, MAX_DROPS, PARTICLE_BYTES};
use crate::surface::{SurfaceBytes, SurfaceKind};

/// One in this many particles is assumed to be spray in a frame of which nothing is known.
const PARTICLES_PER_DROP: u64 = 10;

/// Number of drops of whitewater per particle, assumed for frames that were not surveyed.
const DROPS_PER_PARTICLE: u64 = 8;

impl MemoryModel<'_> {
    /// The tree of a frame.
    pub(super) fn build(&self, frame: &FrameSize) -> BuildBytes {
        if self.in_place {
            return predicted_stored_bytes(frame.particles);
        }
        // A smooth surface needs no tree over particles, and a union in motion has its own trees.
        let particles = match (self.setup.picture.surface.kind, self.setup.has_motion()) {
            (SurfaceKind::Smooth, _) | (SurfaceKind::Union, true) => 0,
            (SurfaceKind::Spheres, _) | (SurfaceKind::Union, false) => frame.particles,
        };
        let build = self.body_tree(particles);
        if !self.setup.picture.surface.spray {
            return build;
        }
        // Spray is searched in a separate tree, in the same memory.
        let first = self.plain_tree(frame.particles);
        BuildBytes { tree: build.tree.max(first.tree), scratch: build.scratch.max(first.scratch) }
    }

    /// The tree of a body.
    fn body_tree(&self, particles: u64) -> BuildBytes {
        let values = self.setup.picture.particles.first().color.is_by_particle();
        let count = usize::try_from(particles).unwrap_or(usize::MAX);
        let settings = self.setup.build_settings(count, values);
        predicted_bytes(&settings, particles, self.own_radii)
    }

    /// The tree that is fastest to build.
    fn plain_tree(&self, particles: u64) -> BuildBytes {
        let settings = BuildSettings::new(Structure::Lbvh);
        predicted_bytes(&settings, particles, self.own_radii)
    }

    /// Memory of the drops of `particles` particles of spray. Soft ones have several drops, with radii of their own,
    /// which are in a list during the build.
    fn spray(&self, particles: u64) -> SurfaceBytes {
        let is_soft = self.setup.picture.scene.is_spray_soft();
        let drops = particles * if is_soft { u64::from(SOFT_DROPS) } else { 1 };
        let (tree, listed) = if is_soft {
            let settings = BuildSettings::new(Structure::Lbvh);
            (predicted_bytes(&settings, drops, true), drops * SOFT_DROP_BYTES)
        } else {
            (self.plain_tree(drops), 0)
        };
        let moving = self.moving_tree(drops);
        SurfaceBytes {
            building: listed + tree.tree + (tree.scratch + sorting_bytes(drops)).max(moving),
            kept: tree.tree + moving,
        }
    }

    /// Number of drops of whitewater in a frame.
    fn drop_count(&self, frame: &FrameSize) -> u64 {
        let assumed = frame.particles.saturating_mul(DROPS_PER_PARTICLE);
        frame.surface.map_or(assumed, |surface| surface.drops).min(MAX_DROPS as u64)
    }

    /// Memory of the list of drops of whitewater, which is there until their tree is built: with their places and, if they
    /// move, displacements.
    fn listed_drops(&self, frame: &FrameSize) -> u64 {
        let displacement = if self.setup.has_motion() { 12 } else { 0 };
        self.drop_count(frame) * (DROP_BYTES + 12 + displacement)
    }

    /// Memory of the whitewater of a frame. Its drops are listed before the surface is built, and its tree is built
    /// afterwards, with a list of their radii.
    fn whitewater(&self, frame: &FrameSize) -> SurfaceBytes {
        let drops = self.drop_count(frame);
        let tree = predicted_bytes(&BuildSettings::new(Structure::Lbvh), drops, true);
        let moving = self.moving_tree(drops);
        let kept = tree.tree + moving + 4 * drops;
        let lists = self.listed_drops(frame) + 4 * drops;
        let building = lists + kept + (tree.scratch + sorting_bytes(drops)).max(moving);
        SurfaceBytes { building: building.max(frame.particles * PARTICLE_BYTES + lists), kept }
    }

    /// Memory of a tree of moving spheres; none without motion blur.
    fn moving_tree(&self, particles: u64) -> u64 {
        if self.setup.has_motion() { MovingTree::predicted_bytes(particles) } else { 0 }
    }

    /// Memory of the surface of a frame: normals need none, spray has a tree, and a smooth surface has its grid. With
    /// motion blur, spheres have a tree that moves, and other surfaces are there several times.
    pub(super) fn surface(&self, frame: &FrameSize) -> SurfaceBytes {
        let spray = self.drops(frame);
        let body = self.body(frame);
        if self.setup.picture.surface.whitewater {
            // The body is built between the list of drops and their tree
            let with_body = self.listed_drops(frame) + body.building;
            return SurfaceBytes {
                building: with_body.max(body.kept + spray.building),
                kept: spray.kept + body.kept,
            };
        }
        // The body is built beside the spray
        SurfaceBytes {
            building: spray.building.max(spray.kept + body.building),
            kept: spray.kept + body.kept,
        }
    }

    /// Memory of the spray or the whitewater of a frame.
    pub(super) fn drops(&self, frame: &FrameSize) -> SurfaceBytes {
        if self.setup.picture.surface.whitewater {
            return self.whitewater(frame);
        }
        if !self.setup.picture.surface.spray {
            return SurfaceBytes::default();
        }
        let assumed = frame.particles / PARTICLES_PER_DROP;
        self.spray(frame.surface.map_or(assumed, |surface| surface.spray))
    }

    /// Whether a frame is known to have drops only, and no smooth surface.
    pub(super) fn is_spray_alone(&self, frame: &FrameSize) -> bool {
        let grid = frame.surface.and_then(|surface| surface.grid);
        self.setup.picture.surface.spray && grid.is_some_and(|grid| grid.bricks == 0)
    }

    /// Memory of the surface of a frame without its spray.
    fn body(&self, frame: &FrameSize) -> SurfaceBytes {
        let slices = u64::from(self.setup.slices());
        match self.setup.picture.surface.kind {
            SurfaceKind::Smooth => {
                let one = self.smooth(frame);
                SurfaceBytes {
                    building: (slices - 1) * one.kept + one.building,
                    kept: slices * one.kept,
                }
            }
            SurfaceKind::Union if self.setup.has_motion() => {
                let one = self.body_tree(frame.particles);
                SurfaceBytes { building: slices * one.tree + one.scratch, kept: slices * one.tree }
            }
            SurfaceKind::Spheres | SurfaceKind::Union => {
                let moving = self.moving_tree(frame.particles);
                SurfaceBytes { building: moving, kept: moving }
            }
        }
    }

    /// Memory of one smooth surface of a frame.
    fn smooth(&self, frame: &FrameSize) -> SurfaceBytes {
        let surface = &self.setup.picture.surface;
        let channels = self.setup.picture.render.channels;
        let is_colored = self.setup.picture.particles.first().color.is_by_particle();
        let keeps = surface.exact || channels.needs_particles() || is_colored;
        match frame.surface.and_then(|surface| surface.grid) {
            Some(grid) => grid.bytes(keeps),
            None => GridSize::of_splash(frame.particles, surface).bytes(keeps),
        }
    }

    pub(super) fn tree(&self, frame: &FrameSize) -> u64 {
        self.build(frame).tree
    }
}
