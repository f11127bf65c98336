//! Light on the ground around transmissive particles, computed once for each image. Paths that find light only through
//! refracting surfaces are noise in a picture, so they end at the ground, where two maps have their light:
//!
//! - caustics: photons of lights that pass through particles (`emitter.rs`, `photons.rs`, `density.rs`)
//! - the light of the environment, and light that media scatter, which vary slowly (`sky.rs`)
//!
//! A third map shows where the ground is wet (`wet.rs`).
//!
//! What arrives straight from light sources is sampled at each point of the ground as on other surfaces.
//!
//! A shadow catcher has the caustics only. The photons of meshes and opaque particles are stored one by one
//! (`photon_map.rs`), and `caustics.rs` adds their light.

use std::collections::BTreeSet;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use glam::Vec3;

use super::{Occlusion, PathIntegrator, Surface};
use crate::render::lights::PhotonSource;
use crate::render::{
    layers::LightClass,
    ray_counts::RayCounts,
    scratch::PacketScratch,
    settings::{IntegratorKind, RenderSettings},
    shading::add,
    stop::Stop,
};
use crate::scene::{Ground, Material, Owner, Scene};
use spherule_surface::Shape;
use spherule_tree::math::{lane3, lanes_in, set_lane3, splat, splat3};

mod density;
mod emitter;
mod photon_map;
mod photons;
mod sky;
mod sky_noise;
mod wet;

/// Width of the border of the maps over which they fade to the light without particles, as a fraction of their edge.
const BORDER: f32 = 0.1;

pub(super) use photon_map::PhotonMap;

use emitter::Emitter;
use photon_map::Collector;
use photons::{GroundCells, Targets, trace_photons};
use wet::{WetMap, WetScene};

/// See the module. All maps contain the radiance of a white ground.
#[derive(Debug, Clone)]
pub(super) struct GroundLight {
    caustics: CausticMap,
    sky: Map,
    wet: Option<WetMap>,
    /// Light of the environment, and of mist, without particles.
    open: Vec3,
    /// The light of the sky by light group; empty if the film has no layers for groups.
    groups: Vec<GroupSky>,
}

/// The light of a light group from the environment.
#[derive(Debug, Clone)]
struct GroupSky {
    sky: Map,
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
}

impl Square {
    fn of(ground: &Ground) -> Self {
        Self {
            center: ground.center,
            axes: ground.axes(),
            normal: ground.up,
            edge: ground.map_edge(),
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

    /// The position of `point` with the weight of the maps there: 1 inside, falling to 0 at the edge; `None` outside.
    fn place(&self, point: Vec3) -> Option<([f32; 2], f32)> {
        let [x, y] = self.position(point);
        let inside = x.min(1.0 - x).min(y).min(1.0 - y);
        let weight = (inside / BORDER).clamp(0.0, 1.0);
        (weight > 0.0).then_some(([x, y], weight))
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

    /// The mean of the texels at its border.
    fn mean_of_border(&self) -> Vec3 {
        let side = self.side;
        let is_border = |i: usize| [i % side, i / side].iter().any(|at| *at == 0 || at + 1 == side);
        let texels = (0..self.texels.len()).filter(|i| is_border(*i));
        let (sum, count) = texels
            .fold((Vec3::ZERO, 0.0_f32), |(sum, count), i| (sum + self.texels[i], count + 1.0));
        sum / count.max(1.0)
    }
}

/// The four texels around a position from 0 to 1 in a map of `side` by `side` texels, two or more, with weights that
/// add up to 1.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the map")]
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

/// Light of photons on the ground.
#[derive(Debug, Clone)]
pub(super) struct CausticMap {
    square: Square,
    map: Arc<Map>,
    /// The same light by light group.
    groups: Vec<(usize, Arc<Map>)>,
}

impl CausticMap {
    /// Radiance of a white ground at `point`.
    pub(super) fn white(&self, point: Vec3) -> Vec3 {
        self.weighted(&self.map, point)
    }

    /// The same of each light group.
    pub(super) fn white_of_groups(&self, point: Vec3) -> impl Iterator<Item = (usize, Vec3)> {
        let groups = self.groups.iter();
        groups.map(move |(group, map)| (*group, self.weighted(map, point)))
    }

    fn weighted(&self, map: &Map, point: Vec3) -> Vec3 {
        let place = self.square.place(point);
        place.map_or(Vec3::ZERO, |(position, weight)| weight * map.at(position))
    }
}

/// Light of photons beside that on a visible ground.
#[derive(Debug, Clone, Default)]
pub(super) struct Caustics {
    /// On a shadow catcher.
    pub(super) catcher: Option<CausticMap>,
    /// On meshes and opaque particles.
    pub(super) surfaces: Option<PhotonMap>,
}

/// Whether particles focus light in pictures with these settings.
fn has_photons(scene: &Scene, settings: &RenderSettings) -> bool {
    settings.integrator == IntegratorKind::Path
        && settings.photons > 0
        && scene.materials.iter().any(is_clear)
}

/// Whether a picture has light that photons, or maps of the light on the ground, bring.
pub fn needs_photons(scene: &Scene, settings: &RenderSettings) -> bool {
    bytes(scene, settings) != GroundLightBytes::default()
}

/// Whether particles with this material are transmissive.
fn is_clear(material: &Material) -> bool {
    matches!(material.owner, Owner::Particles | Owner::Style(_)) && material.transmission > 0.0
}

fn is_catcher(ground: &Ground) -> bool {
    ground.shadow_catcher.is_some()
}

/// Upper bounds of the memory for the light of photons and of the sky.
pub(in crate::render) fn bytes(scene: &Scene, settings: &RenderSettings) -> GroundLightBytes {
    if !has_photons(scene, settings) {
        return GroundLightBytes::default();
    }
    // Caustics have one map, and one for each light group of several
    let emits = !scene.lights.is_empty();
    // Layers of light groups have maps of their own
    let groups = u64::from(settings.channels.layers.light_groups);
    let of_lights: BTreeSet<u8> = scene.lights.iter().map(|light| light.group).collect();
    let maps = match of_lights.len() as u64 {
        0 | 1 => 1,
        several => 1 + several.min(groups),
    };
    let (caustics, kept) = (maps * density::BYTES, maps * density::MAP_BYTES);
    let dark = caustics - maps * density::CELL_BYTES;
    // Other maps of a visible ground are made after those
    let (of_ground, dark, kept) = match &scene.ground {
        // The cells of the photons are freed when the other maps are made
        Some(ground) if !is_catcher(ground) => {
            let others = kept + (1 + groups) * sky::bytes(settings) + wet::BYTES;
            let kept_others = (1 + groups) * sky::MAP_BYTES + wet::BYTES;
            (caustics.max(others), dark.max(others), kept + kept_others)
        }
        Some(_) if emits => (caustics, dark, kept),
        _ => (0, 0, 0),
    };
    // Photons at surfaces are stored one by one
    let has_opaque = scene.materials.iter().any(|material| match material.owner {
        Owner::Thing(_) => !material.is_pane(),
        Owner::Style(_) | Owner::Part(_) => !is_clear(material),
        Owner::Particles | Owner::Spray | Owner::Ground => false,
    });
    let has_surfaces = emits && has_opaque;
    let of_surfaces = if has_surfaces { photon_map::bytes(settings.photons) } else { 0 };
    match of_ground + of_surfaces {
        0 => GroundLightBytes::default(),
        stored => GroundLightBytes {
            computing: stored + photons::bytes(has_surfaces),
            without_photons: dark + of_surfaces + photons::bytes(has_surfaces),
            kept: kept + of_surfaces,
        },
    }
}

/// Memory for the light of photons and of the sky, bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GroundLightBytes {
    /// While it is computed, before the first tile.
    pub computing: u64,
    /// The same if no photon reaches the ground.
    pub without_photons: u64,
    /// While the image is traced.
    pub kept: u64,
}

impl<'a> PathIntegrator<'a> {
    /// The integrator with the light of photons, and maps of the light on the ground, if the scene needs them; and the
    /// rays that were traced for them. `None` if `stop` is raised.
    pub(in crate::render) fn with_photons(mut self, stop: &dyn Stop) -> Option<(Self, RayCounts)> {
        let (scene, settings) = (self.context.scene, self.context.settings);
        if !has_photons(scene, settings) {
            return Some((self, RayCounts::default()));
        }
        // Find out what needs light from photons
        let sources = self.photon_sources();
        let ground = scene.ground.as_ref();
        let visible = ground.filter(|ground| !is_catcher(ground));
        let catcher = ground.filter(|g| is_catcher(g) && !sources.is_empty());
        let has_surfaces = !sources.is_empty() && self.has_opaque_surfaces();
        // Trace the photons
        let square = visible.or(catcher).map(Square::of);
        let groups: BTreeSet<usize> = match settings.channels.layers.light_groups {
            0 => BTreeSet::new(),
            _ => sources.iter().map(|(group, _)| *group).collect(),
        };
        let mut cells = square.map(|_| GroundCells::new(&groups));
        let mut collector = has_surfaces.then(Collector::new);
        let mut counts = RayCounts::default();
        if square.is_some() || has_surfaces {
            let emitters = Emitter::of(&sources, scene.particles, settings);
            let mut targets = Targets {
                ground: square.as_ref().zip(cells.as_mut()),
                surfaces: collector.as_mut(),
            };
            counts = trace_photons(&self, &emitters, &mut targets, stop)?;
        }
        // Make maps of them
        let [min, max] = scene.particles;
        let surfaces = collector.map(|photons| photons.into_map((max - min).length()));
        let caustics = square.zip(cells).map(|(square, cells)| cells.into_map(square));
        let [of_catcher, of_ground] =
            if catcher.is_some() { [caustics, None] } else { [None, caustics] };
        self.caustics = Arc::new(Caustics { surfaces, catcher: of_catcher });
        // Add the light of the environment on a visible ground
        if let (Some(ground), Some(caustics)) = (visible, of_ground) {
            let (light, of_sky) = self.ground_light(ground, caustics, stop)?;
            counts = counts + of_sky;
            self.ground_light = Some(Arc::new(light));
        }
        Some((self, counts))
    }

    /// The light of photons, of the sky and of wetness on a visible `ground`, and the rays that were traced for the sky.
    /// `None` if `stop` is raised.
    fn ground_light(
        &self,
        ground: &Ground,
        caustics: CausticMap,
        stop: &dyn Stop,
    ) -> Option<(GroundLight, RayCounts)> {
        let (sky, of_sky) = sky::sky(self, &caustics.square, stop)?;
        let of_surroundings =
            self.environment.map(|e| e.irradiance(ground.up) * FRAC_1_PI).unwrap_or_default();
        // With mist, the light far from the particles is that at the border of the map
        let open_of = |sky: &Map, without_mist: Vec3| match &self.context.mist {
            Some(_) => sky.mean_of_border(),
            None => without_mist,
        };
        let open = open_of(&sky.all, of_surroundings);
        let wet = match self.wet_scene(&caustics.square) {
            Some(wet) => Some(wet.map(stop)?),
            None => None,
        };
        let of_environment = self.context.environment_group();
        let group = |(number, sky)| {
            let own = if number == of_environment { of_surroundings } else { Vec3::ZERO };
            GroupSky { open: open_of(&sky, own), sky }
        };
        let groups = sky.groups.into_iter().enumerate().map(group).collect();
        Some((GroundLight { caustics, sky: sky.all, wet, open, groups }, of_sky))
    }

    /// What wets the ground, if something does.
    fn wet_scene<'s>(&'s self, square: &'s Square) -> Option<WetScene<'s>> {
        let scene = self.context.scene;
        let shapes = &self.context.shapes;
        let bodies: Vec<&dyn Shape> = match &shapes.nested {
            Some(nested) => nested.all().iter().map(|body| body.shape).collect(),
            None => vec![shapes.connected_particles()?],
        };
        Some(WetScene {
            bodies,
            wet: scene.wet_ground.as_ref()?,
            square,
            particles: scene.particles,
            ior: scene.particle_material().ior,
        })
    }

    /// The lights that emit photons, each with its light group.
    fn photon_sources(&self) -> Vec<(usize, PhotonSource)> {
        let lights = self.context.lights.iter().enumerate();
        lights
            .filter_map(|(index, light)| {
                Some((self.context.light_group(index), light.photon_source()?))
            })
            .collect()
    }

    fn has_opaque_surfaces(&self) -> bool {
        let mut shapes = self.context.shapes.solid.iter();
        shapes.any(|shape| self.takes_photons(shape.material()))
    }

    /// Adds the light that the ground reflects, where the paths of `surface` end.
    pub(super) fn shade_ground(
        &self,
        light: &GroundLight,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
    ) {
        // Darken the ground where it is wet
        self.prepare_surface(surface, packet);
        let gloss = match &light.wet {
            Some(wet) => wet.darken(surface, packet),
            None => splat(0.0),
        };
        // Add the light of the maps
        let mut reflected = splat3(Vec3::ZERO);
        for lane in lanes_in(surface.lanes) {
            let point = lane3(&packet.hits.point, lane);
            let weight = lane3(&packet.weight, lane) * lane3(&packet.surface.albedo, lane);
            set_lane3(&mut reflected, lane, weight * light.white(point));
            if packet.split.is_active {
                packet.split.remove_photon_light(lane, weight * light.caustics.white(point));
            }
            light.each_group(point, |group, white| {
                packet.groups.add_lane(group, lane, weight * white);
            });
        }
        let (simd, radiance) = (self.context.simd, &mut packet.radiance);
        add(simd, &reflected, &Vec3::ONE, surface.lanes, radiance);
        // Add what wet ground mirrors, and light that arrives straight from its source
        packet.take_light(LightClass::Diffuse);
        if let Some(wet) = &light.wet {
            self.add_gloss(wet, &gloss, surface, packet);
        }
        self.add_straight_light(surface, packet);
    }

    /// Adds the light of the light sources. Particles are in the way of those whose photons are in the map.
    fn add_straight_light(&self, surface: &Surface<'_>, packet: &mut PacketScratch) {
        let context = &self.context;
        for (index, light) in context.lights.iter().enumerate() {
            self.reflect_light(index, false, surface, packet);
            let occlusion = Occlusion::beside_photons(&**light);
            self.add_direct(occlusion, context.light_group(index), surface, packet);
        }
    }
}

impl GroundLight {
    /// Radiance of a white ground at `point`.
    fn white(&self, point: Vec3) -> Vec3 {
        let Some((position, weight)) = self.caustics.square.place(point) else {
            return self.open;
        };
        let caustics = self.caustics.map.at(position);
        self.open.lerp(self.sky.at(position), weight) + weight * caustics
    }

    /// Calls `each` with parts of the same radiance and their light groups.
    fn each_group(&self, point: Vec3, mut each: impl FnMut(usize, Vec3)) {
        if self.groups.is_empty() {
            return;
        }
        let place = self.caustics.square.place(point);
        for (number, group) in self.groups.iter().enumerate() {
            let sky = place.map_or(group.open, |(position, weight)| {
                group.open.lerp(group.sky.at(position), weight)
            });
            each(number, sky);
        }
        for (group, white) in self.caustics.white_of_groups(point) {
            each(group, white);
        }
    }
}
