//! A surface that changes while the shutter is open, as one surface for each slice of the exposure.

use glam::Vec3;

use super::shape::crossing_of_packet;
use super::{Intersection, Intersections, MaterialId, Shape, Side};
use spherule_tree::accel::Coherence;
use spherule_tree::math::{first_lanes, lanes_in};
use spherule_tree::ray::{Ray, RayPacket};

/// Surfaces at the middles of equal slices of the exposure. A ray sees the surface of the slice that its time is in.
#[derive(Debug, Clone)]
pub struct SlicedSurface<S> {
    slices: Vec<S>,
    /// Whether the particle of an intersection has to be searched in its slice. It then has the number of the slice
    /// in place of the particle.
    is_searched: bool,
}

impl<S: Shape> SlicedSurface<S> {
    /// One surface for each slice, in the order of time. `is_searched`: the surfaces have a [`Shape::particle_at`] and
    /// a [`Shape::blend`] of their own.
    ///
    /// # Panics
    /// If there are no slices.
    pub fn new(slices: Vec<S>, is_searched: bool) -> Self {
        assert!(!slices.is_empty(), "an exposure has at least one slice");
        Self { slices, is_searched }
    }

    fn middle(&self) -> &S {
        &self.slices[self.slice_at(0.0)]
    }

    /// The surface to search for the particle of `hit`, and the intersection with it.
    fn searched(&self, hit: &Intersection) -> Option<(&S, Intersection)> {
        let slice = self.slices.get(hit.particle as usize)?;
        self.is_searched.then_some((slice, Intersection { particle: 0, ..*hit }))
    }

    fn slice_at(&self, time: f32) -> usize {
        slice_at(time, self.slices.len())
    }

    /// Calls `each` for each slice with the rays of `lanes` in it.
    fn for_slices(&self, rays: &RayPacket, lanes: u32, mut each: impl FnMut(usize, u32)) {
        let mut left = lanes;
        while let Some(first) = lanes_in(left).next() {
            let slice = self.slice_at(rays.time[first]);
            let is_same = |lane: &usize| self.slice_at(rays.time[*lane]) == slice;
            let same = lanes_in(left).filter(is_same).fold(0, |lanes, lane| lanes | 1 << lane);
            each(slice, same);
            left &= !same;
        }
    }
}

/// The times at the middles of `count` slices, from -1/2 to 1/2.
pub fn slice_times(count: u32) -> impl Iterator<Item = f32> {
    (0..count).map(move |slice| (slice as f32 + 0.5) / count as f32 - 0.5)
}

/// The slice at `time`, of `count` slices.
#[inline]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "conversions of numbers beyond the range saturate"
)]
pub fn slice_at(time: f32, count: usize) -> usize {
    let slice = ((time + 0.5) * count as f32) as usize;
    slice.min(count.saturating_sub(1))
}

/// `rays` with all rays but those of `lanes` disabled.
pub(super) fn only(rays: &RayPacket, lanes: u32) -> RayPacket {
    let mut rest = *rays;
    rest.keep_only(lanes);
    rest
}

impl<S: Shape> Shape for SlicedSurface<S> {
    /// The intersection in the middle of the exposure.
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        crossing_of_packet(self, ray, side)
    }

    fn material(&self) -> MaterialId {
        self.middle().material()
    }

    fn is_connected(&self) -> bool {
        self.middle().is_connected()
    }

    fn side_of(&self, point: glam::Vec3) -> Side {
        self.middle().side_of(point)
    }

    fn intersect(
        &self,
        rays: &mut RayPacket,
        coherence: Coherence,
        inside: u32,
        hits: &mut Intersections,
    ) {
        let ends = rays.t_max;
        let all = first_lanes(rays.len());
        let mut found = *rays;
        self.for_slices(rays, all, |slice, lanes| {
            let mut own = only(rays, lanes);
            self.slices[slice].intersect(&mut own, coherence, inside & lanes, hits);
            for lane in lanes_in(lanes) {
                found.t_max[lane] = own.t_max[lane];
                if self.is_searched && own.t_max[lane] < ends[lane] {
                    hits.particle[lane] = spherule_tree::order::index_u32(slice);
                }
            }
        });
        rays.t_max = found.t_max;
    }

    fn occluded(&self, rays: &RayPacket, coherence: Coherence, lanes: u32) -> u32 {
        let mut occluded = 0;
        self.for_slices(rays, lanes, |slice, lanes| {
            occluded |= self.slices[slice].occluded(rays, coherence, lanes);
        });
        occluded
    }

    fn particle_at(&self, hit: &Intersection) -> u32 {
        match self.searched(hit) {
            Some((slice, hit)) => slice.particle_at(&hit),
            None => hit.particle,
        }
    }

    fn blend_at(&self, point: Vec3, time: f32, each: &mut dyn FnMut(u32, f32)) {
        if let Some(slice) = self.slices.get(slice_at(time, self.slices.len())) {
            slice.blend_at(point, time, each);
        }
    }

    fn blend(&self, hit: &Intersection, each: &mut dyn FnMut(u32, f32)) {
        match self.searched(hit) {
            Some((slice, hit)) => slice.blend(&hit, each),
            None => each(hit.particle, 1.0),
        }
    }
}
