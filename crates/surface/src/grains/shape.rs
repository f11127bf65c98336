//! Grains as a shape.

use glam::{DVec3, Vec3};

use super::GrainShape;
use super::ellipsoid::{
    Ellipsoids, FoundEllipsoids, OFFSET_OF_ROUNDING, OFFSET_OF_SIZE, intersections,
};
use super::rays::LocalRays;
use super::solid::Solids;
use super::tree::GrainTree;
use super::walk::{Hits, Query, search};
use crate::shape::crossing_of_packet;
use crate::{Intersection, Intersections, MaterialId, Shape, Side, TransmittanceProduct};
use spherule_tree::accel::Coherence;
use spherule_tree::math::{Lanes, Supported, first_lanes, lanes_in, narrow};
use spherule_tree::ray::{Ray, RayPacket};

/// Step off the surface of a mesh, as a part of its smallest and its largest radius.
const OFFSET_OF_MESH: [f64; 2] = [1e-5, 1e-6];

/// The grains of a tree as a shape: each is a body of its own.
#[derive(Debug, Clone, Copy)]
pub struct GrainSurface<'a> {
    tree: &'a GrainTree,
    material: MaterialId,
    /// Index in the frame of the first grain.
    first: u32,
    has_opacity: bool,
    /// The largest coordinate of the box of the tree.
    extent: f32,
    simd: Supported,
}

impl<'a> GrainSurface<'a> {
    /// Grains that are the particles of the frame, in its order.
    pub fn new(tree: &'a GrainTree) -> Self {
        let corners = tree.bounds().unwrap_or([Vec3::ZERO; 2]);
        let extent = corners[0].abs().max(corners[1].abs()).max_element();
        let simd = Supported::default();
        let material = MaterialId::PARTICLES;
        Self { tree, material, first: 0, has_opacity: false, extent, simd }
    }

    /// Sets the material, and the index in the frame of the first grain in the arrays that the tree was made of.
    #[must_use]
    pub fn of(self, material: MaterialId, first: u32) -> Self {
        Self { material, first, ..self }
    }

    /// Sets whether rays may pass grains by the opacity of these.
    #[must_use]
    pub fn with_opacity(self, has_opacity: bool) -> Self {
        Self { has_opacity, ..self }
    }

    /// Sets the instruction set that rays are traced with.
    #[cfg(test)]
    pub(super) fn with_simd(self, simd: Supported) -> Self {
        Self { simd, ..self }
    }

    /// Searches the tree.
    fn search(&self, rays: &LocalRays, coherence: Coherence, query: Query, hits: &mut Hits) {
        let (nodes, grains, motions) = self.tree.parts();
        if matches!(self.tree.shape(), GrainShape::Ellipsoid) {
            let test = Ellipsoids { grains, motions };
            search(self.simd, nodes, grains, rays, coherence, &test, query, hits);
        } else {
            let test = Solids(self.tree);
            search(self.simd, nodes, grains, rays, coherence, &test, query, hits);
        }
    }

    /// Stores points and normals of ellipsoids for the rays of `lanes`.
    fn add_ellipsoids(&self, rays: &LocalRays, found: &Hits, lanes: u32, hits: &mut Intersections) {
        let mut ellipsoids = FoundEllipsoids::NONE;
        for lane in lanes_in(lanes) {
            let (grain, motion) = self.tree.grain(found.slot[lane] as usize);
            ellipsoids.set(lane, grain, motion);
        }
        let is_moving = self.tree.is_moving();
        let space = (self.tree.space().center.to_array(), self.extent);
        intersections(self.simd, rays, &found.t, &ellipsoids, is_moving, space, lanes, hits);
    }

    /// The intersection of the ray in `lane` with a grain of another shape.
    fn solid_intersection(
        &self,
        rays: &LocalRays,
        lane: usize,
        slot: usize,
    ) -> Option<Intersection> {
        let hit = Solids(self.tree).first(rays, lane, slot)?;
        let pose = self.tree.pose(slot, rays.time[lane]);
        let direction = rays.double_direction(lane);
        let from_center = rays.double_origin(lane) + hit.t * direction - pose.center;
        let normal = pose.normal(hit.gradient).unwrap_or(-direction);
        let shading = pose.normal(hit.shading).unwrap_or(normal);
        // The ray must see both normals from the same side
        let is_consistent = shading.dot(direction) * normal.dot(direction) > 0.0;
        let of_size = if let GrainShape::Mesh(mesh) = self.tree.shape() {
            let [x, y, z] = pose.semi_axes().map(DVec3::length);
            let size = DVec3::new(x, y, z) * mesh.radius();
            let [of_smallest, of_largest] = OFFSET_OF_MESH;
            narrow((of_smallest * size.min_element()).max(of_largest * size.max_element()))
        } else {
            OFFSET_OF_SIZE * narrow(normal.dot(from_center))
        };
        let point = (self.tree.space().center.as_dvec3() + pose.center + from_center).as_vec3();
        Some(Intersection {
            t: narrow(hit.t),
            point,
            normal: normal.as_vec3(),
            shading: if is_consistent { shading } else { normal }.as_vec3(),
            lift: 0.0,
            radius: f32::INFINITY,
            particle: 0,
            offset: of_size.max(OFFSET_OF_ROUNDING * self.extent),
            anchor: point,
        })
    }
}

impl Shape for GrainSurface<'_> {
    /// The intersection in the middle of the exposure.
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        crossing_of_packet(self, ray, side)
    }

    fn has_opacity(&self) -> bool {
        self.has_opacity
    }

    fn material(&self) -> MaterialId {
        self.material
    }

    fn intersect(
        &self,
        rays: &mut RayPacket,
        coherence: Coherence,
        _inside: u32,
        hits: &mut Intersections,
    ) {
        // Find the nearest grains
        let local = LocalRays::new(rays, first_lanes(rays.len()), self.tree.space());
        let mut found = Hits::none(&local);
        self.search(&local, coherence, Query::Nearest, &mut found);
        let hit_lanes = found.mask();
        if hit_lanes == 0 {
            return;
        }
        // Compute points and normals
        if matches!(self.tree.shape(), GrainShape::Ellipsoid) {
            self.add_ellipsoids(&local, &found, hit_lanes, hits);
        } else {
            for lane in lanes_in(hit_lanes) {
                let slot = found.slot[lane] as usize;
                if let Some(hit) = self.solid_intersection(&local, lane, slot) {
                    hits.set(lane, &hit, self.material);
                }
            }
        }
        // End the rays there
        for lane in lanes_in(hit_lanes) {
            let t = local.distance(f64::from(found.t[lane]), rays, lane);
            let (grain, _) = self.tree.grain(found.slot[lane] as usize);
            hits.t[lane] = t;
            hits.particle[lane] = self.first + grain.index;
            hits.material[lane] = self.material;
            rays.t_max[lane] = t;
        }
        hits.mask |= hit_lanes;
    }

    fn occluded(&self, rays: &RayPacket, coherence: Coherence, lanes: u32) -> u32 {
        let local = LocalRays::new(rays, lanes & first_lanes(rays.len()), self.tree.space());
        let mut found = Hits::none(&local);
        self.search(&local, coherence, Query::Any, &mut found);
        found.mask()
    }

    fn transmittance(
        &self,
        rays: &RayPacket,
        lanes: u32,
        fresnel_transmittance: &dyn Fn(f32, u32) -> f32,
        transmittance: &mut Lanes,
    ) {
        for lane in lanes_in(lanes) {
            // Step from crossing to crossing, at the time of the ray, until no light is left
            let mut product = TransmittanceProduct::default();
            let mut rest = RayPacket::default();
            rest.push(&rays.ray(lane));
            rest.time[0] = rays.time[lane];
            loop {
                let (mut ray, mut hits) = (rest, Intersections::default());
                self.intersect(&mut ray, Coherence::Incoherent, 0, &mut hits);
                if hits.mask == 0 {
                    break;
                }
                let hit = hits.get(0);
                let cosine = hit.normal.dot(rest.ray(0).direction).abs();
                if !product.multiply(fresnel_transmittance(cosine, hit.particle)) {
                    break;
                }
                rest.t_min[0] = hit.t + hit.offset;
            }
            transmittance[lane] = product.value();
        }
    }
}
