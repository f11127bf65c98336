//! The light of photons on meshes, opaque particles and shadow catchers. It has passed transmissive particles; what
//! arrives straight from the lights is sampled.

use glam::Vec3;

use super::ground::PhotonMap;
use super::{PathIntegrator, Surface};
use crate::render::near_photons::NearPhoton;
use crate::render::scratch::PacketScratch;
use crate::scene::Owner;
use spherule_surface::{Intersections, MaterialId};
use spherule_tree::math::{LANES, Lanes3, lane3, lanes_in, set_lane3, splat};

/// Least cosine between the light of a photon and the geometric normal. The flux of photons at grazing angles is spread
/// over the geometric surface, and the BSDF expects the shading normal.
const MIN_COSINE: f32 = 0.1;

impl PathIntegrator<'_> {
    /// The lanes of surfaces that photons light.
    pub(super) fn photon_lanes(&self, hits: &Intersections) -> u32 {
        let of_catcher = match self.caustics.catcher {
            Some(_) => hits.lanes_of(MaterialId::GROUND),
            None => 0,
        };
        let of_surfaces = match self.caustics.surfaces {
            Some(_) => lanes_in(hits.mask)
                .filter(|lane| self.takes_photons(hits.material[*lane]))
                .fold(0, |l, lane| l | 1 << lane),
            None => 0,
        };
        of_catcher | of_surfaces
    }

    /// Whether photons are stored at surfaces of `material` one by one.
    pub(super) fn takes_photons(&self, material: MaterialId) -> bool {
        match self.context.scene.material(material).owner {
            Owner::Thing(_) => true,
            // Photons see the particles in the middle of the exposure, and would light other points of those that move
            Owner::Style(_) | Owner::Part(_) => {
                let is_clear = self.context.shapes.is_transmissive(material);
                !is_clear && self.context.cameras.exposure.is_none()
            }
            Owner::Particles | Owner::Spray | Owner::Ground => false,
        }
    }

    /// Adds the light of photons that `lanes` of a surface reflect.
    pub(super) fn add_caustics(
        &self,
        lanes: u32,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
    ) {
        // Add the maps on a shadow catcher
        let ground = lanes & packet.hits.lanes_of(MaterialId::GROUND);
        let mut directions = [splat(0.0); 3];
        if let Some(catcher) = self.caustics.catcher.as_ref().filter(|_| ground != 0) {
            for lane in lanes_in(ground) {
                let weight = lane3(&packet.weight, lane) * lane3(&packet.surface.albedo, lane);
                let point = lane3(&packet.hits.point, lane);
                add_to(&mut packet.radiance, lane, weight * catcher.white(point));
                for (group, white) in catcher.white_of_groups(point) {
                    packet.groups.add_lane(group, lane, weight * white);
                }
                set_lane3(&mut directions, lane, lane3(&packet.surface.normal, lane));
            }
        }
        // Add the photons near other surfaces
        if let Some(map) = self.caustics.surfaces.as_ref().filter(|_| lanes & !ground != 0) {
            let surface = Surface { lanes: lanes & !ground, ..*surface };
            self.add_photons(map, &surface, packet, &mut directions);
        }
        // Divide the light between the layers by the directions it comes from
        if packet.split.is_active {
            self.divide(&Surface { lanes, ..*surface }, &directions, packet);
            packet.split.take_reflected(&packet.radiance);
        }
    }

    /// Adds the light of the photons near the points of a `surface`. Stores the mean direction of their light.
    fn add_photons(
        &self,
        map: &PhotonMap,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
        directions: &mut Lanes3,
    ) {
        // Find the photons
        let PacketScratch { hits, surface: points, near, found, .. } = &mut *packet;
        for photons in near.iter_mut() {
            photons.clear();
        }
        for lane in lanes_in(surface.lanes) {
            let (point, normal) = (lane3(&hits.point, lane), lane3(&points.geometric, lane));
            let radius = hits.radius[lane];
            map.each_near(point, normal, radius, found, |photon| {
                near[lane].push(photon);
            });
        }
        // Reflect one photon of each lane after the other
        let mut sums = [Vec3::ZERO; LANES];
        let most = packet.near.iter().map(Vec::len).max().unwrap_or(0);
        for number in 0..most {
            let mut lanes = 0;
            for lane in lanes_in(surface.lanes) {
                if let Some(photon) = packet.near[lane].get(number) {
                    lanes |= 1 << lane;
                    set_lane3(&mut packet.light.rays.direction, lane, photon.to_light);
                }
            }
            self.eval(&Surface { lanes, ..*surface }, packet);
            for lane in lanes_in(lanes) {
                let NearPhoton { to_light, irradiance, group } = packet.near[lane][number];
                let cosine = to_light.dot(lane3(&packet.surface.geometric, lane));
                let value = lane3(&packet.bsdf.value, lane) / cosine.max(MIN_COSINE);
                let light = lane3(&packet.weight, lane) * value * irradiance;
                add_to(&mut packet.radiance, lane, light);
                if packet.split.is_active {
                    packet.split.remove_photon_light(lane, light);
                }
                packet.groups.add_lane(group, lane, light);
                sums[lane] += irradiance.max_element() * to_light;
            }
        }
        // The mean direction weights photons by their irradiance
        for lane in lanes_in(surface.lanes) {
            let normal = lane3(&packet.surface.normal, lane);
            set_lane3(directions, lane, sums[lane].normalize_or(normal));
        }
    }
}

fn add_to(radiance: &mut Lanes3, lane: usize, light: Vec3) {
    let sum = lane3(radiance, lane) + light;
    set_lane3(radiance, lane, sum);
}
