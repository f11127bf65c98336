//! Light on the ground around transmissive particles, computed once for each image. Paths that find light only through
//! refracting surfaces are noise in a picture, so they end at the ground, where two maps have their light:
//!
//! - caustics: photons of the sun that pass through particles (`photons.rs`, `density.rs`)
//! - the light of the environment, which varies slowly (`sky.rs`)
//!
//! What arrives straight from light sources is sampled at each point of the ground as on other surfaces.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use glam::Vec3;

use super::{Occlusion, PathIntegrator, Surface};
use crate::math::{lane3, lanes_in, set_lane3, splat3};
use crate::render::{
    layers::LightClass,
    ray_counts::RayCounts,
    scratch::PacketScratch,
    settings::{IntegratorKind, RenderSettings},
    shading::add,
    stop::Stop,
};
use crate::scene::{Ground, Scene};

mod density;
mod photons;
mod sky;

/// Width of the border of the maps over which they fade to the light without particles, as a fraction of their edge.
const BORDER: f32 = 0.1;

/// See the module. All maps contain the radiance of a white ground.
#[derive(Debug, Clone)]
pub(super) struct FloorLight {
    square: Square,
    caustics: Arc<Map>,
    sky: Map,
    /// Light of the environment without particles.
    open: Vec3,
    /// The same light by light group; empty if the film has no layers for groups.
    groups: Vec<GroupMaps>,
}

/// The light of a light group in the maps.
#[derive(Debug, Clone, Default)]
struct GroupMaps {
    caustics: Option<Arc<Map>>,
    sky: Option<Map>,
    open: Vec3,
}

/// The part of the ground with maps: a square that contains the particles of all frames, with its centre under theirs.
/// Positions on it are from 0 to 1.
#[derive(Debug, Clone, Copy)]
struct Square {
    center: Vec3,
    axes: [Vec3; 2],
    normal: Vec3,
    edge: f32,
    /// Corners of the box of the particles.
    particles: [Vec3; 2],
}

impl Square {
    fn of(ground: &Ground) -> Self {
        Self {
            center: ground.center,
            axes: ground.axes(),
            normal: ground.up,
            edge: ground.fade_start,
            particles: ground.particles,
        }
    }

    fn position(&self, point: Vec3) -> [f32; 2] {
        let offset = (point - self.center) / self.edge;
        self.axes.map(|axis| 0.5 + offset.dot(axis))
    }

    fn point(&self, [x, y]: [f32; 2]) -> Vec3 {
        let [across, along] = self.axes;
        self.center + self.edge * ((x - 0.5) * across + (y - 0.5) * along)
    }

    /// Weight of the maps at a position: 1 inside, 0 at the edge and outside.
    fn weight([x, y]: [f32; 2]) -> f32 {
        let inside = x.min(1.0 - x).min(y).min(1.0 - y);
        (inside / BORDER).clamp(0.0, 1.0)
    }
}

/// Values at the centres of `side` by `side` texels, row by row.
#[derive(Debug, Clone)]
struct Map {
    side: usize,
    texels: Vec<Vec3>,
}

impl Map {
    /// The value at a position from 0 to 1, interpolated.
    fn at(&self, position: [f32; 2]) -> Vec3 {
        let corners = corners(self.side, position);
        let terms = corners.map(|(texel, weight)| weight * self.texels[texel]);
        terms.into_iter().sum()
    }
}

/// The four texels around a position from 0 to 1 in a map of `side` by `side` texels, two or more, with weights that add
/// up to 1.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the map"
)]
fn corners(side: usize, position: [f32; 2]) -> [(usize, f32); 4] {
    let last = (side - 1) as f32;
    let [(x, right), (y, below)] = position.map(|p| {
        let texel = (p * side as f32 - 0.5).clamp(0.0, last);
        let first = texel.floor().min(last - 1.0);
        (first as usize, texel - first)
    });
    let texel = y * side + x;
    [
        (texel, (1.0 - right) * (1.0 - below)),
        (texel + 1, right * (1.0 - below)),
        (texel + side, (1.0 - right) * below),
        (texel + side + 1, right * below),
    ]
}

/// Whether the ground of a scene gets maps.
fn has_maps(scene: &Scene, settings: &RenderSettings) -> bool {
    let ground = scene.ground.as_ref();
    settings.integrator == IntegratorKind::Path
        && settings.photons > 0
        && scene.material.transmission > 0.0
        && ground.is_some_and(|ground| ground.shadow_catcher.is_none())
}

/// Upper bound of the memory for the maps of a scene while they are computed, in bytes.
pub(in crate::render) fn bytes(scene: &Scene, settings: &RenderSettings) -> u64 {
    match has_maps(scene, settings) {
        true => {
            let groups = u64::from(settings.channels.layers.light_groups);
            let own_maps = match photons::groups(scene).len() as u64 {
                0 | 1 => 0,
                several => several.min(groups),
            };
            (1 + own_maps) * density::BYTES + photons::BYTES + (1 + groups) * sky::BYTES
        }
        false => 0,
    }
}

impl<'a> PathIntegrator<'a> {
    /// The integrator with maps of the light on the ground, if the scene needs them, and the rays that were traced for
    /// them. `None` if `stop` is raised.
    pub(in crate::render) fn with_floor_light(
        mut self,
        stop: &dyn Stop,
    ) -> Option<(Self, RayCounts)> {
        let Some(ground) = self
            .context
            .scene
            .ground
            .as_ref()
            .filter(|_| has_maps(self.context.scene, self.context.settings))
        else {
            return Some((self, RayCounts::default()));
        };
        let square = Square::of(ground);
        let (caustics, of_photons) = photons::caustics(&self, &square, stop)?;
        let (sky, of_sky) = sky::sky(&self, &square, stop)?;
        let open = self
            .environment
            .map(|e| e.irradiance(ground.up) * FRAC_1_PI);
        let open = open.unwrap_or_default();
        // Put the light of each group together
        let maps = |sky| GroupMaps {
            sky: Some(sky),
            ..GroupMaps::default()
        };
        let mut groups: Vec<GroupMaps> = sky.groups.into_iter().map(maps).collect();
        for (group, map) in caustics.groups {
            if let Some(maps) = groups.get_mut(group) {
                maps.caustics = Some(map);
            }
        }
        if let Some(maps) = groups.get_mut(self.context.environment_group()) {
            maps.open = open;
        }
        self.floor = Some(FloorLight {
            square,
            caustics: caustics.all,
            sky: sky.all,
            open,
            groups,
        });
        Some((self, of_photons + of_sky))
    }

    /// Adds the light that the ground reflects, where the paths of `surface` end.
    pub(super) fn shade_floor(
        &self,
        floor: &FloorLight,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
    ) {
        self.prepare_surface(surface, packet);
        // Add the light of the maps
        let mut reflected = splat3(Vec3::ZERO);
        for lane in lanes_in(surface.lanes) {
            let point = lane3(&packet.hits.point, lane);
            let weight = lane3(&packet.weight, lane) * lane3(&packet.surface.albedo, lane);
            set_lane3(&mut reflected, lane, weight * floor.white(point));
        }
        let (simd, radiance) = (self.context.simd, &mut packet.radiance);
        add(simd, &reflected, &Vec3::ONE, surface.lanes, radiance);
        packet.take_light(LightClass::Diffuse);
        for group in 0..floor.groups.len() {
            for lane in lanes_in(surface.lanes) {
                let point = lane3(&packet.hits.point, lane);
                let weight = lane3(&packet.weight, lane) * lane3(&packet.surface.albedo, lane);
                let light = weight * floor.white_of_group(group, point);
                packet.groups.add_lane(group, lane, light);
            }
        }
        self.add_straight_light(surface, packet);
    }

    /// Adds the light of the light sources. Particles are in the way of those whose photons are in the map.
    fn add_straight_light(&self, surface: &Surface<'_>, packet: &mut PacketScratch) {
        let context = &self.context;
        for (index, light) in context.lights.iter().enumerate() {
            self.reflect_light(index, false, surface, packet);
            let occlusion = match light.beam() {
                Some(_) => Occlusion::Opaque,
                None => Occlusion::of(&**light),
            };
            let group = context.light_group(index);
            self.add_direct(occlusion, group, surface, packet);
        }
    }
}

impl FloorLight {
    /// Radiance of a white ground at `point`.
    fn white(&self, point: Vec3) -> Vec3 {
        let position = self.square.position(point);
        let weight = Square::weight(position);
        if weight <= 0.0 {
            return self.open;
        }
        let caustics = self.caustics.at(position);
        self.open.lerp(self.sky.at(position), weight) + weight * caustics
    }

    /// The part of that radiance that is of a light group.
    fn white_of_group(&self, group: usize, point: Vec3) -> Vec3 {
        let position = self.square.position(point);
        let weight = Square::weight(position);
        let maps = &self.groups[group];
        if weight <= 0.0 {
            return maps.open;
        }
        let at = |map: Option<&Map>| map.map_or(Vec3::ZERO, |map| map.at(position));
        let caustics = at(maps.caustics.as_deref());
        maps.open.lerp(at(maps.sky.as_ref()), weight) + weight * caustics
    }
}
