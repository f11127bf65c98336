//! Attributes at intersections: base colours, and for camera rays coverage and the data channels of pixels.

use std::cell::LazyCell;

use glam::Vec3;

use super::{
    aov::{DataSample, NO_ID},
    context::{OtherCamera, RenderContext},
    cryptomatte::{self, ObjectName},
    film::FilmTile,
    layers::MatteKind,
    planes::FilmPlane,
    sample_layers::SampleLayers,
    scratch::{PacketScratch, Pixel},
    shading::depths,
    stream::SegmentPacket,
};
use crate::scene::Owner;
use crate::scene::ground::GroundSample;
use spherule_surface::{Intersections, MaterialId, Shape};
use spherule_tree::math::{Lanes, lane3, lanes_in, set_lane3, splat, splat3};
use spherule_tree::ray::RayPacket;

/// Width of a diffusely reflected ray as a fraction of its length. Such rays sample a hemisphere, so each may stand for
/// a part of it.
const BOUNCED_SPREAD: f32 = 0.1;

impl RenderContext<'_> {
    /// Looks up the base colours at the intersections of a packet; colours of particles only if `has_color`.
    pub(super) fn base_colors(
        &self,
        segments: &SegmentPacket,
        has_color: bool,
        packet: &mut PacketScratch,
    ) {
        let PacketScratch { hits, base, blend, .. } = packet;
        // Look up the colours of particles
        let particles = hits.lanes_of(MaterialId::PARTICLES);
        if let Some(color) = self.color {
            *base = splat3(color);
        } else if has_color {
            for lane in lanes_in(particles) {
                set_lane3(base, lane, self.particle_color(hits, lane, blend));
            }
        }
        // Look up the colours of all other surfaces
        let ground = hits.lanes_of(MaterialId::GROUND);
        let sand = self
            .scene
            .ground
            .as_ref()
            .map_or(0, |pattern| pattern.sand_colors(self.simd, &hits.point, ground, base));
        // Transmissive bodies have none, unless the integrator shows it
        let clear = match &self.shapes.nested {
            Some(nested) if !has_color => nested.lanes_of(hits),
            _ => 0,
        };
        for lane in lanes_in(hits.mask & !(particles | sand | clear)) {
            let ray = (&segments.rays, segments.bounces[lane]);
            let color = self.fixed_color(ray, hits, lane, blend);
            set_lane3(base, lane, color);
        }
    }

    /// Base colour of the particle in `lane`, or of a point between particles.
    fn particle_color(
        &self,
        hits: &Intersections,
        lane: usize,
        blend: &mut Vec<(u32, f32)>,
    ) -> Vec3 {
        if let Some(color) = self.color {
            return color;
        }
        let Some(particles) = self.shapes.connected_particles() else {
            return self.source.color(hits.particle[lane]);
        };
        self.blended_color(particles, hits, lane, blend)
    }

    /// The colours of the particles of a connected `body` around the point in `lane`, blended.
    fn blended_color(
        &self,
        body: &dyn Shape,
        hits: &Intersections,
        lane: usize,
        blend: &mut Vec<(u32, f32)>,
    ) -> Vec3 {
        blend.clear();
        let hit = hits.get(lane);
        body.blend(&hit, &mut |particle, weight| blend.push((particle, weight)));
        self.source.blended_color(blend)
    }

    /// Base colour of a surface that is not of the particles without a part, as a ray sees it after a number of diffuse
    /// reflections.
    fn fixed_color(
        &self,
        ray: (&RayPacket, u32),
        hits: &Intersections,
        lane: usize,
        blend: &mut Vec<(u32, f32)>,
    ) -> Vec3 {
        let (id, part) = (hits.material[lane], hits.particle[lane]);
        // The ground is filtered over the width of the ray
        if let (MaterialId::GROUND, Some(ground)) = (id, &self.scene.ground) {
            let (rays, bounces) = ray;
            let point = lane3(&hits.point, lane);
            return ground.color(&GroundSample {
                point,
                direction: lane3(&rays.direction, lane),
                width: match bounces {
                    0 => self.cameras.now.pixel_width(point) * self.sample_width,
                    _ => BOUNCED_SPREAD * hits.t[lane],
                },
            });
        }
        // All others have the colour of their part, that of their material, or that of the particle
        let color = self.shapes.part_colors[id.index()].get(part as usize).copied();
        color.or(self.scene.material(id).color).unwrap_or_else(|| {
            match self.shapes.bodies[id.index()] {
                Some(body) => self.blended_color(body, hits, lane, blend),
                None => self.source.color(part),
            }
        })
    }

    /// Fraction of each sample that surfaces cover beside `otherwise`. A ground that fades out still covers all of it,
    /// unless the background is transparent. Holdouts cover nothing.
    pub(super) fn coverage(&self, hits: &Intersections, otherwise: &Lanes) -> Lanes {
        std::array::from_fn(|lane| match hits.mask >> lane & 1 {
            0 => otherwise[lane],
            // Mist in front of what is hidden covers it
            _ if otherwise[lane] == 1.0 => 1.0,
            _ if self.is_holdout(hits.material[lane]) => 0.0,
            _ if self.settings.transparent_background => {
                otherwise[lane] + (1.0 - otherwise[lane]) * hits.opacity[lane]
            }
            _ => 1.0,
        })
    }

    fn is_holdout(&self, material: MaterialId) -> bool {
        self.scene.material(material).is_holdout
    }

    /// Stores the data of the nearest sample of each pixel, the first in a tie. The rays belong to the samples from
    /// index `first` on.
    pub(super) fn gather_data(
        &self,
        rays: &RayPacket,
        first: usize,
        packet: &mut PacketScratch,
        pixels: &mut [Pixel],
    ) {
        if !self.settings.planes().needs_nearest() || packet.hits.mask == 0 {
            return;
        }
        // Compute the depths of all samples
        let mut z = splat(f32::INFINITY);
        depths(self.simd, &self.cameras.now, rays, &packet.hits, &mut z);
        let samples = self.settings.samples as usize;
        let mut lane = 0;
        while lane < rays.len() {
            // Find the lanes of the next pixel, and the nearest of its samples
            let pixel = (first + lane) / samples;
            let end = rays.len().min((pixel + 1) * samples - first);
            let nearest = (lane..end).fold(lane, |best, l| if z[l] < z[best] { l } else { best });
            let data = || self.data(rays, z[nearest], nearest, packet);
            pixels[pixel].data.keep_nearest(z[nearest], data);
            lane = end;
        }
    }

    /// Stores the attributes of the nearest sample of `pixels`.
    pub(super) fn store_attributes(&self, pixels: &[Pixel], tile: &mut FilmTile<'_>) {
        if !self.settings.channels.has(FilmPlane::Attributes) {
            return;
        }
        for pixel in pixels {
            let values = tile.components_mut(FilmPlane::Attributes, pixel.column, pixel.row);
            match pixel.data.particle {
                Some(particle) => self.source.attributes(particle, values),
                None => values.fill(0.0),
            }
        }
    }

    /// Stores the objects of the samples of packet `number`.
    pub(super) fn gather_objects(
        &self,
        hits: &Intersections,
        number: usize,
        layers: &mut SampleLayers,
    ) {
        let mattes = layers.channels.mattes();
        if mattes.clone().next().is_none() {
            return;
        }
        for lane in lanes_in(hits.mask) {
            // On a liquid surface, this is a search
            let particle = LazyCell::new(|| self.particle_at(hits, lane));
            for kind in mattes.clone() {
                let object = self.object(kind, hits.material[lane], || *particle);
                layers.set_object(kind, number, lane, object);
            }
        }
    }

    /// The object of `kind` at an intersection with a surface of `material`, which belongs to `particle` if that has
    /// particles.
    pub(super) fn object(
        &self,
        kind: MatteKind,
        material: MaterialId,
        particle: impl Fn() -> u32,
    ) -> u32 {
        let owner = self.scene.material(material).owner;
        // Particles are told apart by id, part or material; all other surfaces of a material are one object
        let name = match (owner.is_of_particles(), kind) {
            (true, MatteKind::Particle) => ObjectName::of_particle(self.source.id(particle())),
            (true, MatteKind::Part) => match self.source.part(particle()) {
                Some((attribute, value)) => ObjectName::of_part(attribute, value),
                None => ObjectName::of_owner(Owner::Particles),
            },
            _ => ObjectName::of_owner(owner),
        };
        cryptomatte::object_of(name.as_bytes())
    }

    /// The particle of the intersection in `lane`.
    fn particle_at(&self, hits: &Intersections, lane: usize) -> u32 {
        let id = hits.material[lane];
        let body = match id {
            MaterialId::PARTICLES => self.shapes.particles,
            _ => self.shapes.bodies[id.index()],
        };
        body.map_or(hits.particle[lane], |body| body.particle_at(&hits.get(lane)))
    }

    /// Motion on the film of a point with this `velocity`, from this frame to the next and to the previous one, pixels;
    /// zero if it is or gets behind the camera, and without a channel.
    pub(super) fn motions(&self, point: Vec3, velocity: Vec3) -> [[f32; 2]; 2] {
        let channels = &self.settings.channels;
        let of = |plane, frame| {
            if channels.has(plane) { self.motion(frame, point, velocity) } else { [0.0; 2] }
        };
        [
            of(FilmPlane::Motion, &self.cameras.next),
            of(FilmPlane::MotionBack, &self.cameras.previous),
        ]
    }

    fn motion(&self, frame: &Option<OtherCamera>, point: Vec3, velocity: Vec3) -> [f32; 2] {
        let Some((camera, time)) = frame else {
            return [0.0; 2];
        };
        let (from, to) =
            (self.cameras.now.pixel_of(point), camera.pixel_of(point + *time * velocity));
        match (from, to) {
            (Some(from), Some(to)) => [to[0] - from[0], from[1] - to[1]],
            _ => [0.0; 2],
        }
    }

    /// The data channels at the intersection of the camera ray in `lane`.
    fn data(
        &self,
        rays: &RayPacket,
        z: f32,
        lane: usize,
        packet: &mut PacketScratch,
    ) -> DataSample {
        let PacketScratch { hits, blend, .. } = packet;
        let channels = self.settings.planes();
        let is_particle = self.scene.material(hits.material[lane]).owner.is_of_particles();
        // Look up the particle only if a channel needs it
        let needs_particle = is_particle && channels.needs_nearest_particle();
        let particle = needs_particle.then(|| self.particle_at(hits, lane));
        // Look up only what the channels need
        let normal = lane3(&hits.normal, lane);
        let direction = lane3(&rays.direction, lane);
        let albedo = |blend: &mut Vec<(u32, f32)>| match hits.material[lane] {
            MaterialId::PARTICLES => self.particle_color(hits, lane, blend),
            _ => self.fixed_color((rays, 0), hits, lane, blend),
        };
        let point = lane3(&hits.point, lane);
        let velocity = particle.map_or(Vec3::ZERO, |particle| self.source.velocity(particle));
        let [motion, motion_back] = self.motions(point, velocity);
        DataSample {
            z,
            normal: if direction.dot(normal) < 0.0 { normal } else { -normal },
            position: (self.scene.origin + point.as_dvec3()).as_vec3(),
            velocity,
            albedo: if channels.has(FilmPlane::Albedo) { albedo(blend) } else { Vec3::ZERO },
            id: particle.map_or(NO_ID, |particle| self.source.id(particle)),
            particle,
            motion,
            motion_back,
        }
    }
}
