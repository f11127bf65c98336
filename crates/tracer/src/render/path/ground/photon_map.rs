//! Photons on meshes and opaque particles: a k-d tree of photons, whose density at a point is estimated from the
//! nearest ones (Jensen,
//! *Realistic Image Synthesis Using Photon Mapping*, 2001).
//!
//! The distance of the farthest of these photons sets the width of the kernel, and its own flux is left out, so that
//! the mean of the estimate is the density where that is constant. Photons on surfaces of another direction are left
//! out.

use glam::Vec3;

use crate::render::near_photons::{NEIGHBOURS, NearPhoton, Neighbour};

/// Photons in a leaf of the tree.
const LEAF: usize = 8;

/// Photons that are stored at most. If more arrive, every second one is dropped, as often as needed.
const MAX_PHOTONS: usize = 1 << 21;

/// Greatest distance of a photon from the point that it lights, as a fraction of the diagonal of the particles.
const MAX_DISTANCE: f32 = 0.04;

/// Least cosine between the normals of a photon and of the point that it lights.
const MIN_NORMAL_COSINE: f32 = 0.7;

/// Greatest height of a photon over the tangent plane of the point that it lights, as a fraction of its distance.
const MAX_SLOPE: f32 = 0.5;

/// Greatest distance of a photon from the point that it lights on a sphere, in radii: a little less than the chord
/// between points whose normals have the cosine [`MIN_NORMAL_COSINE`], sqrt(2 - 2 * 0.7). The area of the sphere within
/// a distance is that of a disc, so that the kernel needs no correction.
const MAX_CHORD: f32 = 0.77;

/// A photon that has arrived at a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::render) struct Photon {
    pub(in crate::render) point: Vec3,
    /// Unit geometric normal, on the side of the photon.
    pub(in crate::render) normal: Vec3,
    /// Unit vector from where the photon came.
    pub(in crate::render) to_light: Vec3,
    /// Linear RGB.
    pub(in crate::render) flux: Vec3,
    /// Light group of its light.
    pub(in crate::render) group: u8,
}

/// Memory for the photons of `emitted`, with space to grow.
pub(super) fn bytes(emitted: u32) -> u64 {
    let stored = u64::from(emitted).min(MAX_PHOTONS as u64);
    2 * stored * (size_of::<Photon>() + 1) as u64
}

/// Collects photons up to a limit.
#[derive(Debug)]
pub(super) struct Collector {
    photons: Vec<Photon>,
    limit: usize,
    /// One in this many photons is kept.
    stride: u64,
    /// Photons so far.
    count: u64,
}

impl Collector {
    pub(super) fn new() -> Self {
        Self::with_limit(MAX_PHOTONS)
    }

    fn with_limit(limit: usize) -> Self {
        Self { photons: Vec::new(), limit, stride: 1, count: 0 }
    }

    pub(super) fn add(&mut self, photon: &Photon) {
        let is_kept = self.count.is_multiple_of(self.stride);
        self.count += 1;
        if !is_kept {
            return;
        }
        self.photons.push(*photon);
        if self.photons.len() == self.limit {
            // Keep those with even numbers
            for i in 0..self.limit.div_ceil(2) {
                self.photons[i] = self.photons[2 * i];
            }
            self.photons.truncate(self.limit.div_ceil(2));
            self.stride *= 2;
        }
    }

    /// The map of the photons. `diagonal`: that of the particles.
    pub(super) fn into_map(mut self, diagonal: f32) -> PhotonMap {
        for photon in &mut self.photons {
            photon.flux *= self.stride as f32;
        }
        PhotonMap::new(self.photons, MAX_DISTANCE * diagonal)
    }
}

/// A k-d tree of photons. The photon in the middle of a range divides it; ranges of up to [`LEAF`] are not divided.
#[derive(Debug, Clone)]
pub(in crate::render) struct PhotonMap {
    photons: Vec<Photon>,
    /// The axis in which each photon divides its range.
    axes: Vec<u8>,
    max_distance: f32,
}

impl PhotonMap {
    fn new(mut photons: Vec<Photon>, max_distance: f32) -> Self {
        let mut axes = vec![0; photons.len()];
        arrange(&mut photons, &mut axes);
        Self { photons, axes, max_distance }
    }

    /// Calls `each` with each photon that lights a `point` with the geometric `normal` on the lit side, on a sphere of
    /// `radius` or, if it is infinite, on another surface. `found` is memory for the search.
    pub(in crate::render) fn each_near(
        &self,
        point: Vec3,
        normal: Vec3,
        radius: f32,
        found: &mut Vec<Neighbour>,
        mut each: impl FnMut(NearPhoton),
    ) {
        found.clear();
        let reach = self.max_distance.min(MAX_CHORD * radius);
        let mut search = Search {
            photons: &self.photons,
            axes: &self.axes,
            point,
            normal,
            max2: reach * reach,
            found,
        };
        search.visit(0, self.photons.len());
        let max2 = search.max2;
        // The farthest photon only sets the width of the kernel
        let is_full = found.len() == NEIGHBOURS;
        let inner = found.get(usize::from(is_full)..).unwrap_or_default();
        // The mean of the kernel is a half
        let scale = 2.0 / (std::f32::consts::PI * max2);
        if !(scale > 0.0 && scale < f32::INFINITY) {
            return;
        }
        for (distance2, index) in inner {
            let photon = &self.photons[*index as usize];
            let weight = scale * (1.0 - distance2 / max2);
            each(NearPhoton {
                to_light: photon.to_light,
                irradiance: weight * photon.flux,
                group: usize::from(photon.group),
            });
        }
    }
}

/// Arranges photons so that the one in the middle of each range divides it.
fn arrange(photons: &mut [Photon], axes: &mut [u8]) {
    if photons.len() <= LEAF {
        return;
    }
    // Divide the longest edge of their box
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let grow = |(min, max): (Vec3, Vec3), p: &Photon| (min.min(p.point), max.max(p.point));
    let (min, max) = photons.iter().fold(start, grow);
    let axis = (max - min).max_position();
    let middle = photons.len() / 2;
    photons.select_nth_unstable_by(middle, |a, b| a.point[axis].total_cmp(&b.point[axis]));
    axes[middle] = u8::try_from(axis).unwrap_or_default();
    let (below, above) = photons.split_at_mut(middle);
    let (axes_below, axes_above) = axes.split_at_mut(middle);
    rayon::join(|| arrange(below, axes_below), || arrange(&mut above[1..], &mut axes_above[1..]));
}

/// A search for the photons nearest to a point.
struct Search<'a> {
    photons: &'a [Photon],
    axes: &'a [u8],
    point: Vec3,
    normal: Vec3,
    /// Square of the distance from which on photons are too far.
    max2: f32,
    /// The nearest photons; a heap with the farthest first once there are enough.
    found: &'a mut Vec<Neighbour>,
}

impl Search<'_> {
    /// Visits the photons in the range from `first` to `end`.
    fn visit(&mut self, first: usize, end: usize) {
        if end - first <= LEAF {
            for index in first..end {
                self.test(index);
            }
            return;
        }
        // The photon in the middle of a range has the same place in it as when the range was arranged
        let middle = first + (end - first) / 2;
        let axis = usize::from(self.axes[middle]);
        let across = self.point[axis] - self.photons[middle].point[axis];
        let (near, far) = if across < 0.0 {
            ((first, middle), (middle + 1, end))
        } else {
            ((middle + 1, end), (first, middle))
        };
        self.visit(near.0, near.1);
        self.test(middle);
        if across * across < self.max2 {
            self.visit(far.0, far.1);
        }
    }

    fn test(&mut self, index: usize) {
        let photon = &self.photons[index];
        let offset = photon.point - self.point;
        // Leave out photons that are far away or on another side of an edge
        let distance2 = offset.length_squared();
        // NaN is not near
        let is_near = distance2 < self.max2;
        if !is_near || photon.normal.dot(self.normal) < MIN_NORMAL_COSINE {
            return;
        }
        // Leave out those above the surface, and those from behind it
        let height = offset.dot(self.normal);
        if height * height > MAX_SLOPE * MAX_SLOPE * distance2
            || photon.to_light.dot(self.normal) <= 0.0
        {
            return;
        }
        #[expect(clippy::cast_possible_truncation, reason = "the number of photons is limited")]
        let neighbour = (distance2, index as u32);
        // Keep the nearest in a heap with the farthest at its root
        if self.found.len() < NEIGHBOURS {
            self.found.push(neighbour);
            if self.found.len() < NEIGHBOURS {
                return;
            }
            for at in (0..NEIGHBOURS / 2).rev() {
                sink(self.found, at);
            }
        } else {
            self.found[0] = neighbour;
            sink(self.found, 0);
        }
        // Only nearer ones count from now on
        self.max2 = self.found[0].0;
    }
}

/// Moves the neighbour at index `at` down in a heap until none below it is farther.
fn sink(heap: &mut [Neighbour], mut at: usize) {
    loop {
        let below = 2 * at + 1;
        let Some(children) = heap.get(below..(below + 2).min(heap.len())) else {
            return;
        };
        let farther = match children {
            [left, right] if right.0 > left.0 => below + 1,
            [] => return,
            _ => below,
        };
        if heap[farther].0 <= heap[at].0 {
            return;
        }
        heap.swap(at, farther);
        at = farther;
    }
}

#[cfg(test)]
#[path = "photon_map_tests.rs"]
mod tests;
