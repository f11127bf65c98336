//! Eq. 4.1 for the rays of a packet: `I = ambient + sum of lights + reflection*r*S + transmission*(1-r)*T`, with
//! Blinn and Phong's reflection of lights (4.2, program 3.1) and `r` by Schlick (4.3). Both weights 1 give 4.1 to the
//! letter.
//!
//! The surface of one connected body is lit from outside alone; from inside it only reflects and refracts.

use glam::Vec3;

use super::{
    RayCounts,
    integrator::{Depth, Interior, NextRays, PacketScratch, WhittedIntegrator},
    materials::{Material, WhittedMaterial, attenuate, leaving},
    roulette::{REFLECTED, REFRACTED},
    shading::{add, add_background, product, scale},
    stream::{RayStream, ScatteredRays, SegmentPacket},
};
use crate::math::{lane3, lanes_in, splat};
use crate::surface::MaterialId;

impl WhittedIntegrator<'_> {
    /// Adds to the radiance of a packet what its segments see, and appends what they reflect and refract to `next`.
    pub(super) fn shade(
        &self,
        segments: &SegmentPacket,
        depth: Depth,
        packet: &mut PacketScratch,
        next: &mut NextRays,
        counts: &mut RayCounts,
    ) {
        packet.throughput = segments.throughput;
        self.attenuate_on_the_way(segments, packet);
        if depth.sees_background {
            self.add_seen_background(segments, packet);
        }
        if packet.hits.mask == 0 {
            return;
        }
        self.base_colors(packet);
        for (number, material) in (0..).zip(&self.materials) {
            let id = MaterialId(number);
            let lanes = packet.hits.lanes_of(id);
            if lanes == 0 {
                continue;
            }
            let (rays, inside) = (&segments.rays, segments.inside);
            material.shading_points(self.simd, rays, &packet.hits, inside, &mut packet.points);
            let lit = material.lit_lanes(lanes, inside);
            self.add_direct(segments, &**material, lit, depth, packet, counts);
            if id == MaterialId::PARTICLES {
                self.scatter(segments, material.constants(), lanes, depth, packet, next);
            }
        }
    }

    /// Takes from the throughput what the medium takes between the start of the rays and their intersections.
    fn attenuate_on_the_way(&self, segments: &SegmentPacket, packet: &mut PacketScratch) {
        let extinction = self.particle_constants().extinction;
        if extinction == Vec3::ZERO {
            return;
        }
        let hits = &packet.hits;
        let lanes = match self.interior {
            Interior::Opaque => 0,
            // Behind a ray that leaves a sphere lies the way through it.
            Interior::Spheres => {
                hits.lanes_of(MaterialId::PARTICLES) & leaving(self.simd, &segments.rays, hits)
            }
            // A way inside that has no end is a crack in the surface, and its length unknown.
            Interior::Body => segments.inside & hits.mask,
        };
        if lanes != 0 {
            attenuate(
                self.simd,
                &extinction,
                &hits.t,
                lanes,
                &mut packet.throughput,
            );
        }
    }

    /// Adds the background, where nothing is met and through what is only partly there.
    fn add_seen_background(&self, segments: &SegmentPacket, packet: &mut PacketScratch) {
        let hits = &packet.hits;
        let lanes = segments.lanes() & (!hits.mask | hits.lanes_of(MaterialId::GROUND));
        if lanes == 0 {
            return;
        }
        let seen = std::array::from_fn(|lane| match hits.mask >> lane & 1 {
            0 => 1.0,
            _ => 1.0 - hits.opacity[lane],
        });
        scale(self.simd, &packet.throughput, &seen, &mut packet.weight);
        let direction = &segments.rays.direction;
        let (weight, radiance) = (&packet.weight, &mut packet.radiance);
        add_background(
            self.simd,
            &self.background,
            direction,
            weight,
            lanes,
            radiance,
        );
    }

    /// Adds ambient light and that of lights at the shading points of `lanes`.
    fn add_direct(
        &self,
        segments: &SegmentPacket,
        material: &dyn Material,
        lanes: u32,
        depth: Depth,
        packet: &mut PacketScratch,
        counts: &mut RayCounts,
    ) {
        if lanes == 0 {
            return;
        }
        let simd = self.simd;
        scale(
            simd,
            &packet.throughput,
            &packet.hits.opacity,
            &mut packet.weight,
        );
        let mut colored = [splat(0.0); 3];
        product(simd, &packet.base, &packet.weight, &mut colored);
        add(
            simd,
            &colored,
            &material.constants().ambient,
            lanes,
            &mut packet.radiance,
        );
        if !material.constants().scatters() {
            return;
        }
        for light in &self.lights {
            let PacketScratch {
                points,
                light: samples,
                base,
                weight,
                radiance,
                crossings,
                ..
            } = packet;
            let rays = &segments.rays;
            light.sample_li(simd, &points.start, samples);
            material.reflect(simd, rays, points, base, weight, lanes, samples);
            if samples.lanes == 0 {
                continue;
            }
            let mut visible = samples.lanes;
            if light.casts_shadow() {
                samples.rays.set_len(rays.len());
                counts.shadow += u64::from(visible.count_ones());
                visible = self.visible(samples, depth.coherence, segments.inside, crossings);
            }
            add(simd, &samples.radiance, &Vec3::ONE, visible, radiance);
        }
    }

    /// Appends the rays that leave the shading points of `lanes` to `next`. Where the recursion ends, they see the
    /// background.
    fn scatter(
        &self,
        segments: &SegmentPacket,
        material: &WhittedMaterial,
        lanes: u32,
        depth: Depth,
        packet: &mut PacketScratch,
        next: &mut NextRays,
    ) {
        let PacketScratch {
            points,
            throughput,
            radiance,
            ..
        } = packet;
        let ends = depth.number >= self.settings.max_depth;
        let (inside, passed) = match self.interior {
            Interior::Opaque | Interior::Spheres => (0, 0),
            Interior::Body => (segments.inside, !segments.inside),
        };
        if self.interior != Interior::Opaque && !ends {
            for lane in lanes_in(lanes) {
                let weights = [points.reflected.weight[lane], points.refracted.weight[lane]];
                let arriving = lane3(throughput, lane).max_element();
                let (path, sample) = (segments.path[lane], segments.sample[lane]);
                let sample = sample % self.settings.samples;
                let weights = self
                    .split
                    .weights(weights, arriving, depth.number, path, sample);
                [points.reflected.weight[lane], points.refracted.weight[lane]] = weights;
            }
        }
        let mut send = |rays: &mut ScatteredRays, stream: &mut RayStream, inside, branch| {
            let has_weight = |l: usize| u32::from(rays.weight[l] > 0.0) << l;
            let lanes = lanes_in(lanes).fold(0, |lanes, lane| lanes | has_weight(lane));
            scale(self.simd, throughput, &rays.weight, &mut rays.throughput);
            if ends {
                let (direction, weight) = (&rays.direction, &rays.throughput);
                add_background(
                    self.simd,
                    &self.background,
                    direction,
                    weight,
                    lanes,
                    radiance,
                );
            } else {
                stream.push(lanes, rays, segments, inside, branch);
            }
        };
        if material.reflection > 0.0 {
            send(
                &mut points.reflected,
                &mut next.reflected,
                inside,
                REFLECTED,
            );
        }
        if material.transmission > 0.0 {
            send(
                &mut points.refracted,
                &mut next.refracted,
                passed,
                REFRACTED,
            );
        }
    }
}
