//! Clumps of a smooth surface that fly fast while the shutter is open.
//!
//! A surface in slices shows what moves fast as a row of copies. Drops and clumps that are apart from the rest move
//! continuously instead: they keep the shape that they have in the middle of the exposure, and each ray sees them where
//! they are at its own time. A tree of moving bounding spheres finds the clumps near a ray. The ray is then traced
//! against the surface of all clumps, as if the clump had not moved.

use glam::Vec3;

use super::shape::crossing_of_packet;
use super::slices::{SlicedSurface, only};
use super::smooth::{SmoothError, SmoothGrid, SmoothReport, SmoothSurface};
use super::{Intersection, Intersections, MaterialId, Shape, Side, SurfaceSettings};
use spherule_tree::accel::moving::MovingTree;
use spherule_tree::accel::{BuildSettings, Coherence, SphereRadius, Spheres, TreeBuilder};
use spherule_tree::math::{LANES, first_lanes, lanes_in};
use spherule_tree::order::index_u32;
use spherule_tree::ray::{Ray, RayPacket};

mod find;

pub use find::{ExposedParticles, FastClumps};

/// Marks the particle of an intersection with a clump; the other bits are its number among those of clumps.
const OF_CLUMP: u32 = 1 << 31;

/// Maximum number of crossings with other clumps before that with the clump that a ray is traced against.
const MAX_OTHERS: usize = 16;

/// The clumps of a frame.
#[derive(Debug, Default)]
pub struct MovingClumps {
    /// Their surface in the middle of the exposure.
    grid: SmoothGrid,
    /// A sphere around the surface of each clump.
    bounds: MovingTree,
    /// By how far each clump moves while the shutter is open.
    motions: Vec<Vec3>,
    /// The clump of each particle of the grid.
    clump_of: Vec<u32>,
    /// The particle in the frame of each particle of the grid.
    particles: Vec<u32>,
    /// Particles in the frame that are not in clumps, in ascending order.
    rest: Vec<u32>,
}

impl MovingClumps {
    /// Builds the surface of the `clumps` among `particles`. The build may use `memory_left` bytes.
    ///
    /// # Errors
    /// [`SmoothError`] if it does not fit.
    pub fn build(
        clumps: FastClumps,
        particles: &ExposedParticles<'_>,
        settings: &SurfaceSettings,
        memory_left: Option<u64>,
    ) -> Result<(Self, SmoothReport), SmoothError> {
        // Build the surface
        let centers: Vec<Vec3> =
            clumps.particles.iter().map(|index| particles.centers[*index as usize]).collect();
        let mut grid = SmoothGrid::default();
        let mut report = grid.build(&centers, particles.radius, settings, true, memory_left)?;
        // Build the tree of its bounds
        let spheres = clumps.clumps.iter().map(|clump| around(&centers[clump.range.clone()]));
        let (places, radii): (Vec<_>, Vec<_>) =
            spheres.map(|(center, radius)| (center, radius + particles.support)).unzip();
        let mut trees = TreeBuilder::new();
        let settings = BuildSettings { keep_indices: true, ..BuildSettings::default() };
        trees.build(&Spheres { centers: &places, radius: SphereRadius::Each(&radii) }, &settings);
        let motions: Vec<Vec3> = clumps.clumps.iter().map(|clump| clump.motion).collect();
        let mut bounds = MovingTree::default();
        bounds.build(&trees.tree().view(), &motions);
        // Remember which particles are where
        let numbers = clumps.clumps.iter().zip(0..);
        let clump_of =
            numbers.flat_map(|(clump, number)| std::iter::repeat_n(number, clump.range.len()));
        let clump_of: Vec<u32> = clump_of.collect();
        let rest = without(particles.centers.len(), &clumps.sorted_particles());
        let made = Self { grid, bounds, motions, clump_of, particles: clumps.particles, rest };
        let added = made.byte_len();
        report.bytes += added;
        report.peak_bytes += added;
        Ok((made, report))
    }

    /// Memory in bytes, without the surface.
    fn byte_len(&self) -> u64 {
        let lists = size_of_val(&self.particles[..]) + size_of_val(&self.rest[..]);
        let clumps = size_of_val(&self.clump_of[..]) + size_of_val(&self.motions[..]);
        self.bounds.byte_len() + (lists + clumps) as u64
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.motions.is_empty()
    }

    /// The indices of the particles that are not in clumps, in ascending order.
    #[must_use]
    pub fn rest(&self) -> &[u32] {
        &self.rest
    }

    /// The particle in the frame that is particle `index` of the rest. Surfaces without particles name one that may not
    /// exist.
    fn of_rest(&self, index: u32) -> u32 {
        self.rest.get(index as usize).copied().unwrap_or(index)
    }

    /// The clump at `point` on its surface or in it, without motion, and the particle of the grid there.
    fn clump_at(&self, point: Vec3) -> Option<(u32, u32)> {
        let particle = self.grid.surface().nearest_particle(point)?;
        Some((self.clump_of[particle as usize], particle))
    }

    /// Calls `visit` with the bounds that the line of the ray in `lane` passes through: the clump, how far it has moved
    /// at the time of the ray, and where the line enters and leaves.
    fn visit(&self, rays: &RayPacket, lane: usize, mut visit: impl FnMut(u32, Vec3, [f32; 2])) {
        let time = rays.time[lane];
        self.bounds.visit_chords(rays, lane, |clump, _, ends| {
            visit(clump, time * self.motions[clump as usize], ends);
            true
        });
    }

    /// The clump that contains the origin of the ray in `lane`.
    fn around_origin(&self, rays: &RayPacket, lane: usize) -> Option<u32> {
        let origin = rays.ray(lane).at(rays.t_min[lane]);
        let mut found = None;
        self.visit(rays, lane, |clump, moved, [near, far]| {
            let point = origin - moved;
            if near <= rays.t_min[lane]
                && far >= rays.t_min[lane]
                && self.grid.surface().side_of(point) == Side::Inside
                && self.clump_at(point).is_some_and(|(at, _)| at == clump)
            {
                found = Some(found.map_or(clump, |least: u32| least.min(clump)));
            }
        });
        found
    }

    /// The first crossing of `ray` with the surface of `clump`, which has `moved`.
    fn crossing_of(&self, clump: u32, moved: Vec3, ray: &Ray, side: Side) -> Option<Intersection> {
        let surface = self.grid.surface();
        let mut rest = Ray { origin: ray.origin - moved, ..*ray };
        let mut from = side;
        for _ in 0..MAX_OTHERS {
            let hit = surface.crossing(&rest, from)?;
            match self.clump_at(hit.point) {
                Some((at, particle)) if at == clump => {
                    return Some(Intersection {
                        point: hit.point + moved,
                        anchor: hit.anchor + moved,
                        particle: OF_CLUMP | particle,
                        ..hit
                    });
                }
                _ => rest.t_min = hit.t + hit.offset,
            }
            from = from.other();
        }
        None
    }

    /// The first crossing of the ray in `lane` with any clump. `inside`: the clump that the ray starts in.
    fn crossing(&self, rays: &RayPacket, lane: usize, inside: Option<u32>) -> Option<Intersection> {
        let mut best: Option<Intersection> = None;
        self.visit(rays, lane, |clump, moved, [near, far]| {
            let side = match inside {
                Some(around) if around != clump => return,
                Some(_) => Side::Inside,
                None => Side::Outside,
            };
            // The surface lies within the bounds
            let ray = rays.ray(lane);
            let end = best.map_or(ray.t_max, |best| best.t);
            let ray = Ray { t_min: ray.t_min.max(near), t_max: end.min(far), ..ray };
            if ray.t_min < ray.t_max {
                best = self.crossing_of(clump, moved, &ray, side).or(best);
            }
        });
        best
    }
}

/// A sphere around `points`: centre and radius.
fn around(points: &[Vec3]) -> (Vec3, f32) {
    let low = points.iter().copied().reduce(Vec3::min).unwrap_or_default();
    let high = points.iter().copied().reduce(Vec3::max).unwrap_or_default();
    let center = 0.5 * (low + high);
    let squared = points.iter().map(|point| point.distance_squared(center)).fold(0.0, f32::max);
    (center, squared.sqrt())
}

/// The numbers below `count` that are not among `left_out`, which ascend.
fn without(count: usize, left_out: &[u32]) -> Vec<u32> {
    let mut left_out = left_out.iter().peekable();
    (0..index_u32(count)).filter(|number| left_out.next_if_eq(&number).is_none()).collect()
}

/// A smooth surface in slices, and clumps that move continuously.
pub struct SurfaceWithClumps<'a> {
    slices: SlicedSurface<SmoothSurface<'a>>,
    clumps: &'a MovingClumps,
}

impl<'a> SurfaceWithClumps<'a> {
    /// The surface of all particles: `slices` of those that are not in `clumps`, and the clumps.
    #[must_use]
    pub fn new(slices: SlicedSurface<SmoothSurface<'a>>, clumps: &'a MovingClumps) -> Self {
        Self { slices, clumps }
    }
}

impl Shape for SurfaceWithClumps<'_> {
    /// The intersection in the middle of the exposure.
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        crossing_of_packet(self, ray, side)
    }

    fn material(&self) -> MaterialId {
        self.slices.material()
    }

    fn is_connected(&self) -> bool {
        self.slices.is_connected()
    }

    fn side_of(&self, point: Vec3) -> Side {
        match self.slices.side_of(point) {
            Side::Inside => Side::Inside,
            Side::Outside => self.clumps.grid.surface().side_of(point),
        }
    }

    fn intersect(
        &self,
        rays: &mut RayPacket,
        coherence: Coherence,
        inside: u32,
        hits: &mut Intersections,
    ) {
        // A ray in a clump meets nothing but its surface; others that start inside meet the rest
        let all = first_lanes(rays.len());
        let mut around = [None; LANES];
        let mut in_clumps = 0;
        for lane in lanes_in(all & inside) {
            around[lane] = self.clumps.around_origin(rays, lane);
            in_clumps |= u32::from(around[lane].is_some()) << lane;
        }
        let mut rest = only(rays, all & !in_clumps);
        self.slices.intersect(&mut rest, coherence, inside & !in_clumps, hits);
        for lane in lanes_in(all & !in_clumps) {
            rays.t_max[lane] = rest.t_max[lane];
        }
        // Find nearer clumps
        for lane in lanes_in(all & (in_clumps | !inside)) {
            if let Some(hit) = self.clumps.crossing(rays, lane, around[lane]) {
                hits.end_ray(rays, lane, &hit, self.material());
            }
        }
    }

    fn occluded(&self, rays: &RayPacket, coherence: Coherence, lanes: u32) -> u32 {
        let occluded = self.slices.occluded(rays, coherence, lanes);
        lanes_in(lanes & !occluded).fold(occluded, |occluded, lane| {
            let hit = self.clumps.crossing(rays, lane, None);
            occluded | u32::from(hit.is_some()) << lane
        })
    }

    fn particle_at(&self, hit: &Intersection) -> u32 {
        match hit.particle & OF_CLUMP {
            0 => self.clumps.of_rest(self.slices.particle_at(hit)),
            _ => self.clumps.particles[(hit.particle & !OF_CLUMP) as usize],
        }
    }

    fn blend_at(&self, point: Vec3, time: f32, each: &mut dyn FnMut(u32, f32)) {
        let mut found = false;
        self.slices.blend_at(point, time, &mut |index, part| {
            found = true;
            each(self.clumps.of_rest(index), part);
        });
        if found {
            return;
        }
        // Look for a clump around the point, with a ray from it
        let mut rays = RayPacket::default();
        rays.push(&Ray { t_max: f32::MIN_POSITIVE, ..Ray::new(point, Vec3::X) });
        rays.time[0] = time;
        if let Some(clump) = self.clumps.around_origin(&rays, 0) {
            let at = point - time * self.clumps.motions[clump as usize];
            self.clumps.grid.surface().blend_at(at, 0.0, &mut |index, part| {
                each(self.clumps.particles[index as usize], part);
            });
        }
    }

    fn blend(&self, hit: &Intersection, each: &mut dyn FnMut(u32, f32)) {
        match hit.particle & OF_CLUMP {
            0 => self.slices.blend(hit, &mut |index, part| {
                each(self.clumps.of_rest(index), part);
            }),
            _ => each(self.particle_at(hit), 1.0),
        }
    }
}

#[cfg(test)]
mod tests;
