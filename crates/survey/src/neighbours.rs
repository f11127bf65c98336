//! Neighbours of some particles among all, found by all distances. Coordinates are stored one after another, so that the
//! compiler computes several distances at once.

use glam::Vec3;
use rayon::prelude::*;

/// Number of distances that are computed at once.
const LANES: usize = 8;

/// Number of particles that a thread takes at once.
const RUN: usize = 64 * 1024;

/// The coordinates of particles.
pub(super) struct Coordinates {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
}

/// A run of these.
type Run<'a> = ((&'a [f32], &'a [f32]), &'a [f32]);

impl FromIterator<Vec3> for Coordinates {
    fn from_iter<I: IntoIterator<Item = Vec3>>(positions: I) -> Self {
        let ((x, y), z) = positions.into_iter().map(|p| ((p.x, p.y), p.z)).unzip();
        Self { x, y, z }
    }
}

impl Coordinates {
    /// Number of particles.
    pub(super) fn len(&self) -> usize {
        self.x.len()
    }

    /// The position of a particle.
    pub(super) fn get(&self, index: usize) -> Vec3 {
        Vec3::new(self.x[index], self.y[index], self.z[index])
    }

    fn runs(&self) -> impl IndexedParallelIterator<Item = Run<'_>> {
        self.x.par_chunks(RUN).zip(self.y.par_chunks(RUN)).zip(self.z.par_chunks(RUN))
    }

    /// The squared distance from a point to the nearest particle in another place; infinite if there is none.
    pub(super) fn nearest_square(&self, from: Vec3) -> f32 {
        let nearest = |run| {
            let mut least = [f32::INFINITY; LANES];
            each_square(run, from, |lane, square| {
                let square = if square > 0.0 { square } else { f32::INFINITY };
                least[lane] = if square < least[lane] { square } else { least[lane] };
            });
            least.into_iter().fold(f32::INFINITY, f32::min)
        };
        self.runs().map(nearest).reduce(|| f32::INFINITY, f32::min)
    }

    /// Number of particles whose squared distance from a point is at most `square`.
    pub(super) fn count_within(&self, from: Vec3, square: f32) -> u32 {
        let count = |run| {
            let mut counts = [0; LANES];
            each_square(run, from, |lane, own| counts[lane] += u32::from(own <= square));
            counts.into_iter().sum::<u32>()
        };
        self.runs().map(count).sum()
    }
}

/// Calls `visit` for the squared distance of `from` to each particle of a run, with the lane that computes it.
#[inline(always)]
fn each_square(((x, y), z): Run<'_>, from: Vec3, mut visit: impl FnMut(usize, f32)) {
    let square = |x: f32, y: f32, z: f32| from.distance_squared(Vec3::new(x, y, z));
    let ((xs, x), (ys, y), (zs, z)) = (x.as_chunks(), y.as_chunks(), z.as_chunks());
    let groups: [&[[f32; LANES]]; 3] = [xs, ys, zs];
    for ((x, y), z) in groups[0].iter().zip(groups[1]).zip(groups[2]) {
        for lane in 0..LANES {
            visit(lane, square(x[lane], y[lane], z[lane]));
        }
    }
    for (lane, ((x, y), z)) in x.iter().zip(y).zip(z).enumerate() {
        visit(lane, square(*x, *y, *z));
    }
}
