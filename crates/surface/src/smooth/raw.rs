//! Samples the field of the particles over one brick, before smoothing.

use std::ops::Range;

use glam::Vec3;

use super::blocks::cells_around;
use super::brick::{VOXELS, VOXELS_I32};
use super::layout::Layout;
use crate::field::bins::Bins;
use crate::field::kernel::weight;
use crate::field::{FieldParticles, rounded};
use spherule_tree::accel::simd::ArrayTask;

/// Kernel sum from which particles are smoothed, in units of the kernel's central value. A sheet of one layer has
/// 2.2, a flat surface 2.7, bulk 3.1.
const ISOLATED_SUM: f32 = 1.8;
/// Kernel sum from which particles are smoothed fully.
const CROWDED_SUM: f32 = 2.6;
/// Upper limit of the field.
const MAX_VALUE: f32 = 1.9999;
/// Codes per unit of the field.
const CODES: f32 = 32_768.0;

/// Values at the first corner of each voxel of a brick, by z, y and x: 0 to 2 in 16 bits.
pub(super) type Codes = [u16; VOXELS * VOXELS * VOXELS];

/// The value of a code.
#[inline(always)]
pub(super) fn decode(code: u16) -> f32 {
    f32::from(code) * (1.0 / CODES)
}

/// The field of a brick in two parts; a part that is zero everywhere is not stored.
#[derive(Debug, Default)]
pub(super) struct RawBrick {
    /// Field of crowded particles, which will be smoothed.
    pub(super) smooth: Option<Box<Codes>>,
    /// Field of isolated particles.
    pub(super) sharp: Option<Box<Codes>>,
}

type Sums = [[[f32; VOXELS]; VOXELS]; VOXELS];

/// Sums the particles around a brick.
pub(super) struct Gather<'a> {
    pub(super) field: &'a FieldParticles,
    pub(super) layout: &'a Layout,
    pub(super) brick: [i32; 3],
}

impl ArrayTask for Gather<'_> {
    type Output = RawBrick;

    #[inline(always)]
    fn run(self) -> RawBrick {
        // Visit all particles whose support reaches the brick, in the order of their bins
        let bins = self.field.bins();
        let splat = Splat::new(self.layout, self.brick);
        let mut smooth = [[[0.0; VOXELS]; VOXELS]; VOXELS];
        let mut sharp = smooth;
        let (mut any_smooth, mut any_sharp) = (false, false);
        let [xs, ys, zs] = cells_around(self.layout, self.brick, self.layout.support);
        for z in zs {
            for y in ys.clone() {
                for place in particles(bins, z, y, xs.clone()) {
                    // Distribute the particle over the smooth and the sharp part
                    let volume = self.field.volumes()[place];
                    let part = smoothed_part(volume, self.layout);
                    let center = bins.points()[place];
                    if part > 0.0 {
                        any_smooth |= splat.add(&mut smooth, center, volume * part);
                    }
                    if part < 1.0 {
                        any_sharp |= splat.add(&mut sharp, center, volume * (1.0 - part));
                    }
                }
            }
        }
        // Parts without particles need no memory
        RawBrick {
            smooth: any_smooth.then(|| encode(&smooth)),
            sharp: any_sharp.then(|| encode(&sharp)),
        }
    }
}

#[inline(always)]
fn particles(bins: &Bins, z: i32, y: i32, xs: Range<i32>) -> Range<usize> {
    bins.particles_in(bins.run(z, y, xs))
}

/// The fraction of a particle with `volume` that is smoothed.
#[inline(always)]
fn smoothed_part(volume: f32, layout: &Layout) -> f32 {
    if layout.blur == 0 {
        return 0.0;
    }
    let x = ((1.0 / volume - ISOLATED_SUM) / (CROWDED_SUM - ISOLATED_SUM)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped; rounded by the half"
)]
fn encode(sums: &Sums) -> Box<Codes> {
    let mut codes = Box::new([0; VOXELS * VOXELS * VOXELS]);
    for (code, sum) in codes.iter_mut().zip(sums.as_flattened().as_flattened()) {
        *code = (sum.min(MAX_VALUE) * CODES + 0.5) as i32 as u16;
    }
    codes
}

/// The positions of the samples of a brick.
struct Splat {
    x: [f32; VOXELS],
    y: [f32; VOXELS],
    z: [f32; VOXELS],
    limit: f32,
    inverse: f32,
}

impl Splat {
    #[inline(always)]
    fn new(layout: &Layout, brick: [i32; 3]) -> Self {
        let axis = |brick: i32| {
            let mut places = [0.0; VOXELS];
            for (place, voxel) in places.iter_mut().zip(VOXELS_I32 * brick..) {
                *place = voxel as f32 * layout.voxel;
            }
            places
        };
        Self {
            x: axis(brick[0]),
            y: axis(brick[1]),
            z: axis(brick[2]),
            limit: layout.support * layout.support,
            inverse: 1.0 / layout.support,
        }
    }

    /// Adds a particle of `volume` to all samples within its support, and returns whether there are any. The sums are
    /// exact, so their order does not matter.
    #[inline(always)]
    fn add(&self, sums: &mut Sums, center: Vec3, volume: f32) -> bool {
        // Compute the squared distances per axis
        let squares = |places: &[f32; VOXELS], center: f32| {
            let mut squares = [0.0; VOXELS];
            for (square, place) in squares.iter_mut().zip(places) {
                *square = (place - center) * (place - center);
            }
            squares
        };
        let along_x = squares(&self.x, center.x);
        let along_y = squares(&self.y, center.y);
        let along_z = squares(&self.z, center.z);
        // Skip layers and rows that are out of reach
        let mut least_x = f32::INFINITY;
        for square in along_x {
            least_x = least_x.min(square);
        }
        // Add to each sample that the support reaches
        let limit = self.limit - least_x;
        let mut any = false;
        for (layer, dz2) in sums.iter_mut().zip(along_z) {
            if dz2 >= limit {
                continue;
            }
            for (row, dy2) in layer.iter_mut().zip(along_y) {
                let across = dy2 + dz2;
                if across >= limit {
                    continue;
                }
                any = true;
                for (sum, dx2) in row.iter_mut().zip(along_x) {
                    let term = volume * weight((dx2 + across).sqrt() * self.inverse);
                    *sum += rounded(term);
                }
            }
        }
        any
    }
}
