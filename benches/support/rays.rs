//! The three ways to spend rays on a scene, the same for every program.
//!
//! A program traces rays one by one; everything about images, tiles and threads is here, so that a
//! rate says something about the structure alone.

use glam::Vec3;
use rayon::prelude::*;
use spherule::accel::view::TreeView;
use spherule::accel::{Coherence, TreeHits};
use spherule::ray::{PACKET_SIZE, Ray, RayPacket};

use super::scene::{Scene, TILE_SIDE};

/// Secondary rays start this part of a radius above the surface.
const LIFT: f32 = 1e-3;
/// The point light, above the box.
const LIGHT: Vec3 = Vec3::new(0.0, 0.0, 10.0);
/// Pixels or points that a thread takes at a time.
const CHUNK: usize = TILE_SIDE * TILE_SIDE;

/// A program that can be asked for rays.
pub(crate) trait Tracer: Sync {
    /// The nearest sphere that the ray meets: distance and the tracer's own number for it.
    fn nearest(&self, ray: &Ray) -> Option<(f32, u32)>;
    /// Whether any sphere lies within the ray's ends.
    fn any_hit(&self, ray: &Ray) -> bool;
    /// Centre of the sphere with that number.
    fn center(&self, sphere: u32) -> Vec3;
}

impl Tracer for TreeView<'_> {
    fn nearest(&self, ray: &Ray) -> Option<(f32, u32)> {
        TreeView::nearest(self, ray).map(|hit| (hit.t, hit.slot))
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        TreeView::any_hit(self, ray)
    }

    fn center(&self, sphere: u32) -> Vec3 {
        self.sphere(sphere).0
    }
}

/// What a primary ray leaves behind: distance, infinite for a miss, and the sphere.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HitRecord {
    t: f32,
    sphere: u32,
}

impl HitRecord {
    const MISS: Self = Self { t: f32::INFINITY, sphere: u32::MAX };

    /// Along the primary ray; infinite for a miss.
    pub(crate) fn distance(&self) -> f32 {
        self.t
    }
}

/// A point that a primary ray found.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfacePoint {
    /// Lifted off the surface.
    position: Vec3,
    normal: Vec3,
    /// Direction of the ray that came here.
    incoming: Vec3,
    /// The square of pixels that it was seen through.
    square: usize,
}

impl SurfacePoint {
    /// The ray to the light; None where the surface faces away from it.
    fn to_light(self) -> Option<Ray> {
        let to_light = LIGHT - self.position;
        let distance = to_light.length();
        (self.normal.dot(to_light) > 0.0)
            .then(|| Ray { t_max: distance, ..Ray::new(self.position, to_light / distance) })
    }

    /// The ray mirrored here.
    fn mirrored(self) -> Ray {
        let direction = self.incoming.reflect(self.normal).normalize();
        Ray::new(self.position, direction)
    }
}

/// One ray through every pixel, the hits recorded in `records`. Returns how many hit.
pub(crate) fn trace_primary<T: Tracer>(
    tracer: &T,
    scene: &Scene,
    records: &mut Vec<HitRecord>,
) -> usize {
    records.resize(scene.pixels.len(), HitRecord::MISS);
    scene
        .pixels
        .par_chunks(CHUNK)
        .zip(records.par_chunks_mut(CHUNK))
        .map(|(pixels, records)| {
            let mut hits = 0;
            for (pixel, record) in pixels.iter().zip(records) {
                *record = match tracer.nearest(&scene.camera.ray(*pixel)) {
                    Some((t, sphere)) => {
                        hits += 1;
                        HitRecord { t, sphere }
                    }
                    None => HitRecord::MISS,
                };
            }
            hits
        })
        .sum()
}

/// The points that the primary rays found, in tile order.
pub(crate) fn surface_points<T: Tracer>(
    tracer: &T,
    scene: &Scene,
    records: &[HitRecord],
) -> Vec<SurfacePoint> {
    let pairs = scene.pixels.par_iter().zip(records);
    pairs
        .enumerate()
        .filter(|(_, (_, record))| record.t < f32::INFINITY)
        .map(|(place, (pixel, record))| {
            let ray = scene.camera.ray(*pixel);
            let center = tracer.center(record.sphere);
            let normal = (ray.at(record.t) - center).normalize();
            SurfacePoint {
                position: center + normal * (scene.radius * (1.0 + LIFT)),
                normal,
                incoming: ray.direction,
                square: place / PACKET_SIZE,
            }
        })
        .collect()
}

/// A shadow ray from every point that faces the light. Returns how many points are lit.
pub(crate) fn trace_shadow<T: Tracer>(tracer: &T, points: &[SurfacePoint]) -> usize {
    let is_lit = |point: &&SurfacePoint| {
        let ray = point.to_light();
        ray.is_some_and(|ray| !tracer.any_hit(&ray))
    };
    count_in_chunks(points, is_lit)
}

/// The same as [`trace_primary`], the rays of a square of pixels as one packet.
pub(crate) fn trace_primary_packets(
    tree: &TreeView,
    scene: &Scene,
    records: &mut Vec<HitRecord>,
) -> usize {
    records.resize(scene.pixels.len(), HitRecord::MISS);
    let squares = scene.pixels.par_chunks(PACKET_SIZE);
    squares
        .zip(records.par_chunks_mut(PACKET_SIZE))
        .with_min_len(CHUNK / PACKET_SIZE)
        .map(|(pixels, records)| {
            let mut packet = RayPacket::default();
            for pixel in pixels {
                packet.push(&scene.camera.ray(*pixel));
            }
            let mut hits = 0;
            for (record, hit) in records.iter_mut().zip(tree.nearest_packet(&packet)) {
                hits += usize::from(hit.is_some());
                *record =
                    hit.map_or(HitRecord::MISS, |hit| HitRecord { t: hit.t, sphere: hit.slot });
            }
            hits
        })
        .sum()
}

/// The same as [`trace_shadow`], the rays from a square of pixels as one packet.
pub(crate) fn trace_shadow_packets(tree: &TreeView, points: &[SurfacePoint]) -> usize {
    points
        .par_chunks(CHUNK)
        .map(|chunk| {
            let squares = chunk.chunk_by(|a, b| a.square == b.square);
            squares.map(|square| lit_of_square(tree, square)).sum::<usize>()
        })
        .sum()
}

fn lit_of_square(tree: &TreeView, points: &[SurfacePoint]) -> usize {
    let mut packet = RayPacket::default();
    let mut rays = 0;
    for ray in points.iter().filter_map(|point| point.to_light()) {
        packet.push(&ray);
        rays += 1;
    }
    rays - tree.any_hit_packet(&packet).count_ones() as usize
}

/// A ray mirrored at every point. Returns how many hit.
pub(crate) fn trace_reflection<T: Tracer>(tracer: &T, points: &[SurfacePoint]) -> usize {
    let hits = |point: &&SurfacePoint| tracer.nearest(&point.mirrored()).is_some();
    count_in_chunks(points, hits)
}

/// The same as [`trace_reflection`], as packets of rays that lie any way. A packet is filled across
/// squares: a square has seldom 16 points.
pub(crate) fn trace_reflection_packets(tree: &TreeView, points: &[SurfacePoint]) -> usize {
    let count = |points: &[SurfacePoint]| {
        let mut packet = RayPacket::default();
        for point in points {
            packet.push(&point.mirrored());
        }
        let mut hits = TreeHits::default();
        tree.nearest_lanes(&packet, Coherence::Incoherent, &mut hits);
        hits.mask().count_ones() as usize
    };
    let chunks = points.par_chunks(CHUNK);
    chunks.map(|chunk| chunk.chunks(PACKET_SIZE).map(count).sum::<usize>()).sum()
}

fn count_in_chunks(
    points: &[SurfacePoint],
    counts: impl Fn(&&SurfacePoint) -> bool + Sync,
) -> usize {
    points.par_chunks(CHUNK).map(|chunk| chunk.iter().filter(&counts).count()).sum()
}
