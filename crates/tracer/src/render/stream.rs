//! Streams of path segments, in packets of 16.

use super::body_set::BodySet;
use super::dimensions::{BOUNCED, SCATTERED};
use super::light_split::FirstInteraction;
use super::sampler::PathSeed;
use spherule_surface::slices::slice_at;
use spherule_tree::math::{LANES, Lanes, Lanes3, first_lanes, lanes_in, splat};
use spherule_tree::ray::RayPacket;

/// Number of packets by which a stream grows.
const GROWTH: usize = 32;

/// Path segments that are traced together.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct SegmentPacket {
    pub(super) rays: RayPacket,
    /// Probability density with which the direction of each ray was sampled, per steradian; infinite for camera rays
    /// and specular rays.
    pub(super) pdf: Lanes,
    /// The diffuse part of the reflection that each ray comes from, 0 to 1; only less than 1 where something tells it
    /// apart.
    pub(super) diffuse: Lanes3,
    /// Number of diffuse reflections and scattering events of the path before each ray.
    pub(super) bounces: [u32; LANES],
    /// Path throughput from the sample to the origin of each ray, linear RGB.
    pub(super) throughput: Lanes3,
    /// The sample that each ray belongs to, within its batch.
    pub(super) sample: [u32; LANES],
    /// Seed of the random numbers of each path; only set for stochastic integrators.
    pub(super) path: [PathSeed; LANES],
    /// Lanes of rays that start inside a connected body.
    pub(super) inside: u32,
    /// The bodies in which each ray starts, if there may be several.
    pub(super) bodies: [BodySet; LANES],
    /// The first interaction of each path.
    pub(super) first: [FirstInteraction; LANES],
}

impl Default for SegmentPacket {
    fn default() -> Self {
        Self {
            rays: RayPacket::default(),
            pdf: splat(f32::INFINITY),
            diffuse: [splat(1.0); 3],
            bounces: [0; LANES],
            throughput: [splat(1.0); 3],
            sample: [0; LANES],
            path: [PathSeed::default(); LANES],
            inside: 0,
            bodies: [BodySet::EMPTY; LANES],
            first: [FirstInteraction::default(); LANES],
        }
    }
}

impl SegmentPacket {
    /// Bit mask of the lanes with a ray.
    #[inline(always)]
    pub(super) fn lanes(&self) -> u32 {
        first_lanes(self.rays.len())
    }
}

/// How the rays of a packet continue their paths.
#[derive(Debug, Clone, Copy)]
pub(super) struct Continuation {
    /// Lanes whose rays start inside a connected body.
    pub(super) inside: u32,
    /// The body whose surface the rays cross, if there may be several.
    pub(super) crossed: BodySet,
    /// Which continuation of the paths it is; [`BOUNCED`] and [`SCATTERED`] count as a bounce.
    pub(super) branch: u32,
}

/// Rays that leave the surfaces of a packet, one per lane.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct ScatteredRays {
    pub(super) origin: Lanes3,
    pub(super) direction: Lanes3,
    /// Weight of each ray in eq. 4.1: the fraction of its radiance that continues along the incoming ray.
    pub(super) weight: Lanes,
    /// The weight times the throughput of the packet.
    pub(super) throughput: Lanes3,
    /// Probability density of each direction, per steradian; infinite for specular rays.
    pub(super) pdf: Lanes,
    /// The diffuse part of the reflection.
    pub(super) diffuse: Lanes3,
}

impl Default for ScatteredRays {
    fn default() -> Self {
        Self {
            origin: [splat(0.0); 3],
            direction: [splat(0.0); 3],
            weight: splat(0.0),
            throughput: [splat(0.0); 3],
            pdf: splat(f32::INFINITY),
            diffuse: [splat(1.0); 3],
        }
    }
}

/// Path segments of one depth. Those in the same slice of the exposure are stored together without gaps, because
/// surfaces differ between slices. Memory is kept when the stream is cleared.
#[derive(Debug)]
pub(super) struct RayStream {
    /// A run for each slice.
    runs: Vec<SegmentRun>,
}

impl Default for RayStream {
    fn default() -> Self {
        Self { runs: vec![SegmentRun::default()] }
    }
}

impl RayStream {
    /// Removes all segments.
    pub(super) fn clear(&mut self) {
        for run in &mut self.runs {
            run.len = 0;
        }
    }

    /// Number of segments in the stream.
    pub(super) fn len(&self) -> usize {
        self.runs.iter().map(|run| run.len).sum()
    }

    /// All packets; the last of a slice may have fewer rays than lanes.
    #[cfg(test)]
    pub(super) fn packets(&self) -> Vec<&SegmentPacket> {
        let runs = self.runs.iter();
        runs.flat_map(|run| &run.packets[..run.len.div_ceil(LANES)]).collect()
    }

    fn packets_mut(&mut self) -> impl Iterator<Item = &mut SegmentPacket> {
        let runs = self.runs.iter_mut();
        runs.flat_map(|run| run.packets[..run.len.div_ceil(LANES)].iter_mut())
    }

    /// Appends the rays in `lanes`, in order, which leave the intersections of `parents`.
    pub(super) fn push(
        &mut self,
        lanes: u32,
        rays: &ScatteredRays,
        parents: &SegmentPacket,
        how: Continuation,
    ) {
        let growth = GROWTH.div_ceil(self.runs.len());
        if let [run] = &mut self.runs[..] {
            return run.push(lanes, rays, parents, how, growth);
        }
        let count = self.runs.len();
        for lane in lanes_in(lanes) {
            let slice = slice_at(parents.rays.time[lane], count);
            self.runs[slice].push(1 << lane, rays, parents, how, growth);
        }
    }
}

/// Path segments stored without gaps.
#[derive(Debug, Default)]
struct SegmentRun {
    packets: Vec<SegmentPacket>,
    len: usize,
}

impl SegmentRun {
    /// [`RayStream::push`]; memory grows by `growth` packets.
    fn push(
        &mut self,
        lanes: u32,
        rays: &ScatteredRays,
        parents: &SegmentPacket,
        how: Continuation,
        growth: usize,
    ) {
        let Continuation { inside, crossed, branch } = how;
        let is_bounce = matches!(branch, BOUNCED | SCATTERED);
        // Grow if there is no space for another whole packet
        let needed = (self.len + LANES).div_ceil(LANES) + 1;
        if self.packets.len() < needed {
            // Grow by a constant and not by doubling, because streams are most of the memory of a thread.
            let capacity = needed.next_multiple_of(growth);
            self.packets.reserve_exact(capacity - self.packets.len());
            self.packets.resize_with(capacity, SegmentPacket::default);
        }
        for lane in lanes_in(lanes) {
            // Copy each ray to the next free lane
            let (packet, to) = (self.len / LANES, self.len % LANES);
            let segment = &mut self.packets[packet];
            if to == 0 {
                segment.rays.reset();
                segment.inside = 0;
            }
            for axis in 0..3 {
                segment.rays.origin[axis][to] = rays.origin[axis][lane];
                segment.rays.direction[axis][to] = rays.direction[axis][lane];
                segment.throughput[axis][to] = rays.throughput[axis][lane];
                segment.diffuse[axis][to] = rays.diffuse[axis][lane];
            }
            segment.rays.time[to] = parents.rays.time[lane];
            segment.pdf[to] = rays.pdf[lane];
            segment.bounces[to] = parents.bounces[lane] + u32::from(is_bounce);
            segment.sample[to] = parents.sample[lane];
            segment.path[to] = parents.path[lane].child(branch);
            segment.first[to] = parents.first[lane].continued(branch);
            segment.inside |= (inside >> lane & 1) << to;
            segment.bodies[to] = parents.bodies[lane].across(crossed);
            segment.rays.set_len(to + 1);
            self.len += 1;
        }
    }
}

/// Memory of the unused ends of the runs of two depths, if there are several slices.
pub(super) fn bytes_of_slices(count: u32) -> u64 {
    let count = u64::from(count.saturating_sub(1));
    let streams = 4 * (GROWTH as u64 + 2 * count);
    count.min(1) * streams * size_of::<SegmentPacket>() as u64
}

/// The rays of one depth, separated into reflected and refracted ones.
#[derive(Debug, Default)]
pub(super) struct RayStreams {
    pub(super) reflected: RayStream,
    pub(super) refracted: RayStream,
}

impl RayStreams {
    /// Divides the segments by `count` slices of the exposure from now on. Removes all segments.
    pub(super) fn set_slices(&mut self, count: u32) {
        for stream in [&mut self.reflected, &mut self.refracted] {
            stream.runs.resize_with(count as usize, SegmentRun::default);
        }
        self.clear();
    }

    /// Removes all segments.
    pub(super) fn clear(&mut self) {
        self.reflected.clear();
        self.refracted.clear();
    }

    /// Whether there are no segments.
    pub(super) fn is_empty(&self) -> bool {
        self.reflected.len() + self.refracted.len() == 0
    }

    /// All packets, reflected rays first.
    pub(super) fn packets_mut(&mut self) -> impl Iterator<Item = &mut SegmentPacket> {
        let refracted = self.refracted.packets_mut();
        self.reflected.packets_mut().chain(refracted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_are_packed_in_order_and_memory_is_reused() {
        let mut stream = RayStream::default();
        for round in 0..2 {
            stream.clear();
            let mut expected = Vec::new();
            for first in [0_u32, 100, 200, 300] {
                let mut rays = ScatteredRays::default();
                let mut next = first;
                let sample: [u32; LANES] = [0_u32; LANES].map(|_| {
                    next += 1;
                    next - 1
                });
                rays.origin[0] = sample.map(|s| s as f32);
                let parents = SegmentPacket {
                    sample,
                    path: sample.map(|s| PathSeed::of_pixel(s, 0)),
                    ..SegmentPacket::default()
                };
                let lanes = (0b1010_1100_0000_0111 << (first / 100 % 2)) & 0xffff;
                let odd = 0b1010_1010_1010_1010;
                let how = Continuation { inside: odd, crossed: BodySet::EMPTY, branch: 1 };
                stream.push(lanes, &rays, &parents, how);
                expected.extend(lanes_in(lanes).map(|lane| sample[lane]));
            }
            assert_eq!(stream.len(), expected.len(), "{round}");
            let packets = stream.packets();
            let found: Vec<u32> =
                packets.iter().flat_map(|p| p.sample[..p.rays.len()].to_vec()).collect();
            assert_eq!(found, expected);
            let origins = packets.iter().flat_map(|p| p.rays.rays().map(|r| r.origin.x));
            assert!(origins.eq(expected.iter().map(|s| *s as f32)));
            for packet in packets {
                for lane in 0..packet.rays.len() {
                    let sample = packet.sample[lane];
                    assert_eq!(packet.path[lane], PathSeed::of_pixel(sample, 0).child(1));
                    assert_eq!(packet.inside >> lane & 1, sample % 2);
                }
            }
        }
    }
}
