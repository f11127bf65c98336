//! Opaque or transmissive spheres, each a separate body, in a [`TreeView`].

use std::cell::RefCell;

use glam::Vec3;

use super::owners::{SphereOwners, cross_chord};
use super::shape::CutShape;
use super::{
    Intersection, Intersections, MaterialId, ShadingNormals, Shape, Side, SphereEntries,
    SphereEntry, TransmittanceProduct,
};
use spherule_tree::accel::traverse::{TreeCrossing, TreeHit};
use spherule_tree::accel::view::TreeView;
use spherule_tree::accel::{Coherence, TreeHits};
use spherule_tree::math::{
    LANES, Lanes, Lanes3, Supported, first_lanes, lane_kernel, lanes_in, larger,
};
use spherule_tree::ray::{Ray, RayPacket};

/// Step off the surface as a fraction of the radius: larger than the rounding of a point that was projected onto its
/// sphere, and too small to be visible.
const OFFSET_OF_RADIUS: f32 = 1e-4;
/// Step off the surface in units of the rounding of the largest coordinate involved.
const OFFSET_OF_ROUNDING: f32 = 8.0 * f32::EPSILON;

/// The spheres of a tree as a shape.
#[derive(Debug, Clone, Copy)]
pub struct SphereSurface<'a> {
    tree: TreeView<'a>,
    normals: ShadingNormals,
    owners: SphereOwners<'a>,
    simd: Supported,
}

impl<'a> SphereSurface<'a> {
    /// The spheres of `tree`.
    pub fn new(tree: TreeView<'a>) -> Self {
        Self {
            tree,
            normals: ShadingNormals::Sphere,
            owners: SphereOwners::PARTICLES,
            simd: Supported::or_best(tree.simd()),
        }
    }

    /// Sets the shading normals.
    #[must_use]
    pub fn with_normals(self, normals: ShadingNormals) -> Self {
        Self { normals, ..self }
    }

    /// Sets what the spheres belong to.
    #[must_use]
    pub fn of(self, owners: SphereOwners<'a>) -> Self {
        Self { owners, ..self }
    }
}

/// Step off a surface of spheres of `radius` at `point`, above the rounding of the point, for rays from `origin`.
#[inline]
pub(super) fn step_off(radius: f32, point: Vec3, origin: Vec3) -> f32 {
    let largest = point.abs().max_element().max(origin.abs().max_element());
    (OFFSET_OF_RADIUS * radius).max(OFFSET_OF_ROUNDING * largest)
}

/// The intersection of a ray with the sphere of `hit` in `tree`.
#[inline]
pub(super) fn sphere_hit(
    tree: &TreeView,
    ray: &Ray,
    hit: TreeHit,
    normals: &ShadingNormals,
) -> Intersection {
    let (center, radius) = tree.sphere(hit.slot);
    let normal = outward(ray.at(hit.t) - center, radius, ray.direction);
    let point = center + normal * radius;
    let intersection = Intersection {
        t: hit.t,
        point,
        normal,
        shading: normal,
        lift: 0.0,
        radius,
        particle: tree.particle(hit.slot),
        anchor: point,
        offset: step_off(radius, point, ray.origin),
    };
    normals.shade(tree, ray, intersection, radius)
}

impl Shape for SphereSurface<'_> {
    #[inline]
    fn crossing(&self, ray: &Ray, _side: Side) -> Option<Intersection> {
        let found = self.tree.nearest(ray)?;
        let hit = sphere_hit(&self.tree, ray, found, &self.normals);
        Some(Intersection { particle: self.owners.particle_of(hit.particle), ..hit })
    }

    fn material(&self) -> MaterialId {
        self.owners.material
    }

    fn intersect(
        &self,
        rays: &mut RayPacket,
        coherence: Coherence,
        _inside: u32,
        hits: &mut Intersections,
    ) {
        // Find the nearest spheres
        let mut found = TreeHits { t: [0.0; LANES], slot: [TreeHits::NO_SLOT; LANES] };
        self.tree.nearest_lanes(rays, coherence, &mut found);
        let hit_lanes = found.mask() & first_lanes(rays.len());
        if hit_lanes == 0 {
            return;
        }
        // Compute points and normals of all lanes
        let mut centers = [[0.0; LANES]; 3];
        let mut radii = [1.0; LANES];
        self.tree.gather_spheres(&found, hit_lanes, &mut centers, &mut radii);
        intersections(self.simd, rays, &found.t, &centers, &radii, hit_lanes, hits);
        // End the rays at their hits
        for lane in lanes_in(hit_lanes) {
            let sphere = self.tree.particle(found.slot[lane]);
            (self.owners).end_ray(rays, lane, (found.t[lane], sphere), hits);
        }
        hits.mask |= hit_lanes;
        // Replace the shading normals, hit by hit
        if self.normals != ShadingNormals::Sphere {
            for lane in lanes_in(hit_lanes) {
                let ray = rays.ray(lane);
                let hit = self.normals.shade(&self.tree, &ray, hits.get(lane), radii[lane]);
                hits.set(lane, &hit, self.owners.material);
            }
        }
    }

    fn occluded(&self, rays: &RayPacket, coherence: Coherence, lanes: u32) -> u32 {
        if lanes == first_lanes(rays.len()) {
            return self.tree.occluded_lanes(rays, coherence);
        }
        let mut rest = *rays;
        rest.keep_only(lanes);
        self.tree.occluded_lanes(&rest, coherence)
    }

    fn sphere_entries(&self) -> Option<&dyn SphereEntries> {
        // Copies of spheres would be entered several times
        (!self.tree.has_copies()).then_some(self)
    }

    fn transmittance(
        &self,
        rays: &RayPacket,
        lanes: u32,
        fresnel_transmittance: &dyn Fn(f32, u32) -> f32,
        transmittance: &mut Lanes,
    ) {
        let mut product = [TransmittanceProduct::default(); LANES];
        // Multiply the transmittance of all crossings, each counted once
        if self.tree.has_copies() {
            for lane in lanes_in(lanes) {
                self.each_crossing_once(&rays.ray(lane), |crossing| {
                    let radius = self.tree.sphere(crossing.slot).1;
                    let particle = self.owners.particle_of(self.tree.particle(crossing.slot));
                    product[lane]
                        .multiply(fresnel_transmittance(crossing.half_chord / radius, particle))
                });
            }
        } else {
            self.tree.visit_chords(rays, lanes, |lane, chord| {
                let radius = self.tree.sphere(chord.slot).1;
                let particle = self.owners.particle_of(self.tree.particle(chord.slot));
                let part = fresnel_transmittance(chord.half() / radius, particle);
                cross_chord(&mut product[lane], part, chord.ends, rays, lane)
            });
        }
        // Read the products
        for lane in lanes_in(lanes) {
            transmittance[lane] = product[lane].value();
        }
    }
}

impl SphereEntries for SphereSurface<'_> {
    fn visit_entries(
        &self,
        rays: &RayPacket,
        lanes: u32,
        visit: &mut dyn FnMut(usize, SphereEntry) -> Option<f32>,
    ) {
        self.tree.visit_entries(rays, lanes, |lane, TreeHit { t, slot }| {
            let particle = self.owners.particle_of(self.tree.particle(slot));
            visit(lane, SphereEntry { t, particle, slot })
        });
    }

    fn intersection(&self, ray: &Ray, entry: &SphereEntry) -> Intersection {
        let hit = TreeHit { t: entry.t, slot: entry.slot };
        let intersection = sphere_hit(&self.tree, ray, hit, &self.normals);
        Intersection { particle: entry.particle, ..intersection }
    }
}

impl CutShape for SphereSurface<'_> {
    fn visit_chords(
        &self,
        rays: &RayPacket,
        lanes: u32,
        visit: &mut dyn FnMut(usize, u32, f32, [f32; 2]),
    ) {
        self.tree.visit_chords(rays, lanes, |lane, chord| {
            let particle = self.owners.particle_of(self.tree.particle(chord.slot));
            visit(lane, particle, self.tree.sphere(chord.slot).1, chord.ends);
            true
        });
    }
}

/// Intersections of rays and spheres for the lanes in `hit_lanes`, with the operations of [`sphere_hit`] in the same
/// order.
#[inline(always)]
fn intersections_body(
    rays: &RayPacket,
    t: &Lanes,
    centers: &Lanes3,
    radii: &Lanes,
    hit_lanes: u32,
    hits: &mut Intersections,
) {
    for l in 0..LANES {
        let is_hit = hit_lanes >> l & 1 == 1;
        let o = [rays.origin[0][l], rays.origin[1][l], rays.origin[2][l]];
        let d = [rays.direction[0][l], rays.direction[1][l], rays.direction[2][l]];
        let c = [centers[0][l], centers[1][l], centers[2][l]];
        // Compute the outward normal; it points against the ray if the sphere is too small to have one
        let v = [o[0] + d[0] * t[l] - c[0], o[1] + d[1] * t[l] - c[1], o[2] + d[2] * t[l] - c[2]];
        let inverse = 1.0 / (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
        let has_direction = inverse > 0.0 && inverse < f32::INFINITY && radii[l] > 0.0;
        let mut n = [0.0; 3];
        let mut p = [0.0; 3];
        for axis in 0..3 {
            n[axis] = if has_direction { v[axis] * inverse } else { -d[axis] };
            p[axis] = c[axis] + n[axis] * radii[l];
        }
        // Compute an offset above the rounding of the point
        let of_point = larger(larger(p[0].abs(), p[1].abs()), p[2].abs());
        let of_origin = larger(larger(o[0].abs(), o[1].abs()), o[2].abs());
        let largest = larger(of_point, of_origin);
        let offset = larger(OFFSET_OF_RADIUS * radii[l], OFFSET_OF_ROUNDING * largest);
        // Store the hit
        for axis in 0..3 {
            let select = |new: f32, old: f32| if is_hit { new } else { old };
            hits.point[axis][l] = select(p[axis], hits.point[axis][l]);
            hits.anchor[axis][l] = select(p[axis], hits.anchor[axis][l]);
            hits.normal[axis][l] = select(n[axis], hits.normal[axis][l]);
            hits.shading_normal[axis][l] = select(n[axis], hits.shading_normal[axis][l]);
        }
        hits.t[l] = if is_hit { t[l] } else { hits.t[l] };
        hits.offset[l] = if is_hit { offset } else { hits.offset[l] };
        hits.lift[l] = if is_hit { 0.0 } else { hits.lift[l] };
        hits.radius[l] = if is_hit { radii[l] } else { hits.radius[l] };
        hits.opacity[l] = if is_hit { 1.0 } else { hits.opacity[l] };
    }
}

lane_kernel! {
    pub(super) fn intersections(
        rays: &RayPacket,
        t: &Lanes,
        centers: &Lanes3,
        radii: &Lanes,
        hit_lanes: u32,
        hits: &mut Intersections,
    ) = intersections_body;
}

impl SphereSurface<'_> {
    /// Visits each crossing once in a tree with duplicates, for which all crossings must be collected first.
    fn each_crossing_once(&self, ray: &Ray, mut visit: impl FnMut(TreeCrossing) -> bool) {
        thread_local! {
            /// The shadow rays of a thread are traced one after another, so they share one buffer.
            static FOUND: RefCell<Vec<TreeCrossing>> = const { RefCell::new(Vec::new()) };
        }
        FOUND.with_borrow_mut(|found| {
            self.tree.crossings(ray, found);
            let _is_dark = !found.iter().all(|crossing| visit(*crossing));
        });
    }
}

/// Unit vector along `from_center`; points against the ray for a sphere too small to have a direction.
fn outward(from_center: Vec3, radius: f32, direction: Vec3) -> Vec3 {
    if radius > 0.0 { from_center.try_normalize().unwrap_or(-direction) } else { -direction }
}
