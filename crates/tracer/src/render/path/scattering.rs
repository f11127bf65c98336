//! Light that media scatter towards the camera: at the ends of free paths (`media.rs`).
//!
//! Each light is sampled there. Its shadow ray goes straight through surfaces and is attenuated by the media on its way,
//! as for surfaces inside bodies. The path goes on in a direction of the phase function. Inside bodies, it alone finds the
//! environment. In mist, a direction is sampled from the environment as well, and both are weighted by the balance
//! heuristic, as on opaque surfaces. A scattering event is a bounce. Photons that media scatter are left out
//! (`ground/photons.rs`), so no light is counted twice.

use super::{Occlusion, PathIntegrator, Surface, light_dimension};
use crate::render::{
    body_set::BodySet,
    bsdf::reflect_samples,
    dimensions::{BSDF, ENVIRONMENT, SCATTERED},
    layers::LightClass,
    lights::sample_environment,
    phase::{henyey_greenstein, sample_henyey_greenstein},
    sampler::get_2d_lanes,
    scene_shapes::Interior,
    scratch::PacketScratch,
    stream::{Continuation, RayStreams, SegmentPacket},
};
use glam::Vec3;
use spherule_tree::math::{lane3, lanes_in, lanes_where, set_lane3, splat};

/// Greatest probability with which a long path continues. It is above that of opaque surfaces: media scatter light many
/// times before it leaves, and few paths would have all its weight. Tuned on balls of milk.
const MAX_CONTINUATION: f32 = 0.99;

impl PathIntegrator<'_> {
    /// Adds the light that media scatter at the ends of the rays of `lanes`, and continues their paths.
    pub(super) fn scatter_in_media(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        lanes: u32,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    ) {
        let max = self.context.settings.traced_bounces();
        let lanes = lanes & lanes_where(|l| segments.bounces[l] <= max);
        if lanes == 0 {
            return;
        }
        for lane in lanes_in(lanes) {
            let end = segments.rays.ray(lane).at(segments.rays.t_max[lane]);
            set_lane3(&mut packet.surface.start, lane, end);
        }
        let event = self.surface(segments, depth, lanes);
        packet.weight = packet.throughput;
        self.add_scattered_environment(&event, packet);
        self.add_scattered_lights(&event, packet);
        packet.take_light(LightClass::Refraction);
        self.scatter_paths(&event, packet, next);
    }

    /// Adds the light from a direction that is sampled from the environment, in mist.
    fn add_scattered_environment(&self, event: &Surface<'_>, packet: &mut PacketScratch) {
        let lanes = event.lanes & packet.media.in_mist;
        let Some(environment) = self.environment.filter(|_| lanes != 0) else {
            return;
        };
        let (simd, path) = (self.context.simd, &event.segments.path);
        let mut u = [splat(0.0); 2];
        get_2d_lanes(simd, path, ENVIRONMENT, &event.sample, &mut u);
        let start = &packet.surface.start;
        sample_environment(simd, environment.table(), start, &u, &mut packet.light);
        eval_phase(event, packet);
        let (values, weight) = (&packet.bsdf, &packet.weight);
        reflect_samples(simd, values, weight, true, lanes, &mut packet.light);
        if packet.light.lanes != 0 {
            let group = self.context.environment_group();
            self.add_visible(Occlusion::Opaque, group, event, packet);
        }
    }

    /// Adds the light of each light source.
    fn add_scattered_lights(&self, event: &Surface<'_>, packet: &mut PacketScratch) {
        let (context, simd) = (&self.context, self.context.simd);
        for (index, light) in context.lights.iter().enumerate() {
            // Sample the light
            let mut u = [splat(0.0); 2];
            if light.has_extent() {
                let path = &event.segments.path;
                get_2d_lanes(simd, path, light_dimension(index), &event.sample, &mut u);
            }
            light.sample_li(simd, &packet.surface.start, &u, &mut packet.light);
            // Scatter it towards the origin of the ray; without transmissive bodies, rays of the phase function find it, too
            eval_phase(event, packet);
            let (values, weight) = (&packet.bsdf, &packet.weight);
            let competes = light.has_extent() && self.rays_hit_lights();
            reflect_samples(simd, values, weight, competes, event.lanes, &mut packet.light);
            self.scale_entered(event, packet);
            // Trace the shadow rays
            if packet.light.lanes != 0 {
                let group = context.light_group(index);
                self.add_visible(Occlusion::of(&**light), group, event, packet);
            }
        }
    }

    /// Divides light samples by the square of the index of refraction; see [`Self::scale_inside`].
    fn scale_entered(&self, event: &Surface<'_>, packet: &mut PacketScratch) {
        let context = &self.context;
        for lane in lanes_in(packet.light.lanes & !packet.media.in_mist) {
            let ior = match context.shapes.interior {
                // Rays do not store that they are in a separate sphere
                Interior::Spheres => context.scene.particle_material().ior,
                _ => context.ior_at(event.segments, lane),
            };
            let leaving = lane3(&packet.light.radiance, lane) / (ior * ior);
            set_lane3(&mut packet.light.radiance, lane, leaving);
        }
    }

    /// Continues the paths in directions that are sampled from the phase function.
    fn scatter_paths(
        &self,
        event: &Surface<'_>,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    ) {
        let (segments, simd) = (event.segments, self.context.simd);
        let mut u = [splat(0.0); 2];
        get_2d_lanes(simd, &segments.path, BSDF, &event.sample, &mut u);
        let PacketScratch { media, leaving, surface: points, throughput, .. } = packet;
        let rays = &mut leaving.reflected;
        rays.origin = points.start;
        rays.throughput = *throughput;
        // The environment is not sampled inside bodies, so its light has the full weight
        rays.pdf = splat(f32::INFINITY);
        for lane in lanes_in(event.lanes) {
            let direction = lane3(&segments.rays.direction, lane);
            let u = [u[0][lane], u[1][lane]];
            let scattered = sample_henyey_greenstein(media.anisotropy[lane], direction, u);
            set_lane3(&mut rays.direction, lane, scattered);
            if media.in_mist >> lane & 1 == 1 {
                rays.pdf[lane] =
                    henyey_greenstein(media.anisotropy[lane], direction.dot(scattered));
            }
        }
        let lanes = self.roulette(event, event.lanes, MAX_CONTINUATION, &mut rays.throughput);
        let how =
            Continuation { inside: segments.inside, crossed: BodySet::EMPTY, branch: SCATTERED };
        next.reflected.push(lanes, rays, segments, how);
        // Infinite densities mark specular rays
        rays.pdf = splat(f32::INFINITY);
    }
}

/// Evaluates the phase functions for the directions of the light samples.
fn eval_phase(event: &Surface<'_>, packet: &mut PacketScratch) {
    for lane in lanes_in(event.lanes) {
        let direction = lane3(&event.segments.rays.direction, lane);
        let cosine = direction.dot(lane3(&packet.light.rays.direction, lane));
        let value = henyey_greenstein(packet.media.anisotropy[lane], cosine);
        set_lane3(&mut packet.bsdf.value, lane, Vec3::splat(value));
        packet.bsdf.pdf[lane] = value;
    }
}
