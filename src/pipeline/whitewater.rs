//! Whitewater of a frame: finds its drops, puts foam on the surface, and builds their tree.

use glam::Vec3;
use rayon::prelude::*;
use spherule_formats::order::index_u32;

use super::bodies::common_radius;
use super::decoded::DecodedFrame;
use super::setup::Setup;
use crate::accel::moving::MovingTree;
use crate::accel::{BuildReport, BuildSettings, SphereRadius, Spheres, TreeBuilder};
use crate::ray::Ray;
use crate::surface::whitewater::{Drop, DropClass, Flow, Whitewater, WhitewaterSettings};
use crate::surface::{Shape, Side};

/// Maximum distance by which foam is moved to the surface, in particle radii. Foam that is farther away stays in its
/// place.
const MAX_SHIFT: f32 = 2.0;

/// The drops of a frame.
#[derive(Debug, Default)]
pub(super) struct FrameDrops {
    drops: Vec<Drop>,
    /// Their centres in the middle of the exposure.
    centers: Vec<Vec3>,
    /// By how far they move during the exposure; empty without motion blur.
    displacements: Vec<Vec3>,
    /// The radius of the particles.
    radius: f32,
}

impl FrameDrops {
    /// Finds the drops of `frame`, and moves its particles that are nothing but spray behind the others. Also returns
    /// the number of particles in front of them.
    pub(super) fn find(
        setup: &Setup,
        frame: &mut DecodedFrame<'_>,
        notes: &mut Vec<String>,
    ) -> (Self, usize) {
        // An empty frame has no velocities
        let count = frame.centers.len();
        let velocities = frame.shading.velocities.as_deref().and_then(|all| all.get(..count));
        let surface = &setup.picture.surface;
        let (Some(velocities), Some(speed)) = (velocities, surface.whitewater_speed) else {
            return (Self::default(), count);
        };
        let radius = common_radius(&frame.radius);
        let ids = frame.shading.ids.as_deref().and_then(|all| all.get(..count));
        let flow = Flow { centers: &frame.centers, velocities, ids, radius };
        let (amount, size) = (surface.whitewater_amount, surface.whitewater_size);
        let Whitewater { atomized, mut drops, left_out } =
            Whitewater::of(flow, WhitewaterSettings { speed, amount, size });
        if left_out > 0 {
            notes.push(format!(
                "{left_out} drops of whitewater are left out, because there are more than {}; a smaller \
                 surface.whitewater_amount or a larger surface.whitewater_speed gives fewer",
                drops.len()
            ));
        }
        // Give the drops the new places of their particles
        let body = frame.move_to_end(&atomized, setup.picture.needs_ids());
        drops.par_iter_mut().for_each(|drop| {
            drop.particle = match atomized.binary_search(&drop.particle) {
                Ok(rank) => index_u32(body + rank),
                Err(before) => drop.particle - index_u32(before),
            };
        });
        // Motion blur and channels need velocities, too
        if !(setup.has_motion() || setup.picture.render.channels.needs_velocities()) {
            frame.shading.velocities = None;
        }
        (Self { drops, radius, ..Self::default() }, body)
    }

    /// Puts the drops to their particles, which are in the middle of the exposure and move by `displacements`, if they
    /// do.
    pub(super) fn place(&mut self, particles: &[Vec3], displacements: &[Vec3]) {
        let place = |drop: &Drop| particles[drop.particle as usize] + drop.offset;
        self.drops.par_iter().map(place).collect_into_vec(&mut self.centers);
        if !displacements.is_empty() {
            let displacement = |drop: &Drop| displacements[drop.particle as usize];
            self.displacements = self.drops.par_iter().map(displacement).collect();
        }
    }

    /// Moves foam to `surface`, the surface of the water in the middle of the exposure.
    pub(super) fn float(&mut self, surface: &dyn Shape) {
        let reach = MAX_SHIFT * self.radius;
        let drops = self.drops.par_iter().with_min_len(1 << 8);
        drops.zip(&mut self.centers).for_each(|(drop, center)| {
            let DropClass::Foam { up } = drop.class else {
                return;
            };
            // Foam in the water rises, foam above it sinks
            let side = surface.side_of(*center);
            let direction = if side == Side::Inside { up } else { -up };
            if direction == Vec3::ZERO {
                return;
            }
            let ray = Ray { t_max: reach, ..Ray::new(*center, direction) };
            if let Some(hit) = surface.crossing(&ray, side) {
                *center = hit.point;
            }
        });
    }

    /// Builds the tree of the drops in `trees`, and with motion blur the one that moves. Returns the particle of each
    /// drop, too.
    pub(super) fn build(
        self,
        trees: &mut TreeBuilder,
        moving: &mut MovingTree,
    ) -> (BuildReport, Vec<u32>) {
        let radii: Vec<f32> = self.drops.iter().map(|drop| drop.radius).collect();
        let spheres = Spheres { centers: &self.centers, radius: SphereRadius::Each(&radii) };
        let built = trees.build(&spheres, &BuildSettings::default());
        if !self.displacements.is_empty() {
            moving.build(&trees.tree().view(), &self.displacements);
        }
        (built, self.drops.iter().map(|drop| drop.particle).collect())
    }
}
