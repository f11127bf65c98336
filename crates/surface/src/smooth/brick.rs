//! A cube of voxels with quantised samples of the field at their corners.

use glam::{Vec3, Vec3A, Vec4};

use crate::Side;

/// Voxels along an edge.
pub(super) const VOXELS: usize = 8;
/// [`VOXELS`] for arithmetic with coordinates.
pub(super) const VOXELS_I32: i32 = 8;
/// Bits of a coordinate in voxels that give the position in the brick.
pub(super) const VOXEL_BITS: u32 = 3;
/// Samples along an edge: the corners of the voxels, and one more on either side for gradients.
pub(super) const SAMPLES: usize = VOXELS + 3;
/// The largest value that can be stored; the field inside a body is about 1.
const MAX_VALUE: f32 = 1.5;
/// Codes per unit of the field.
pub(super) const CODES: f32 = 65_535.0 / MAX_VALUE;

/// Distance in the sample array between neighbours along y.
const ROW: usize = SAMPLES;
/// Distance in the sample array between neighbours along z.
const LAYER: usize = SAMPLES * SAMPLES;

/// A brick, see the module. Neighbouring bricks have equal samples at their common border.
#[derive(Debug, Clone)]
pub(super) struct Brick {
    /// For each z, one bit per voxel (8 y + x): set if any corner is inside.
    any_inside: [u64; VOXELS],
    /// The same: set if any corner is outside.
    any_outside: [u64; VOXELS],
    /// Bounding box of the voxels of `any_inside`: the first one, and one past the last one, along each axis.
    inside_box: [[u8; 4]; 2],
    /// Bounding box of the voxels of `any_outside`.
    outside_box: [[u8; 4]; 2],
    /// The samples by z, y and x, from one voxel before the brick on.
    samples: [u16; SAMPLES * LAYER],
}

/// The brick made from samples, unless it is uniform.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "bricks are moved into their place at once")]
pub(super) enum BrickKind {
    /// The surface passes through the brick.
    Brick(Brick),
    /// All corners are outside.
    Outside,
    /// All corners are inside.
    Inside,
}

/// Whether a code is inside the surface at `threshold`, which is in codes. A value and its code give the same result.
#[inline(always)]
pub(super) fn is_inside(code: u16, threshold: f32) -> bool {
    f32::from(code) >= threshold
}

impl Brick {
    /// Makes a brick from values of the field, in rows of 16 with `SAMPLES` valid values.
    #[inline(always)]
    pub(super) fn make(field: &[[[f32; 16]; SAMPLES]; SAMPLES], threshold: f32) -> BrickKind {
        let mut brick = Self {
            any_inside: [0; VOXELS],
            any_outside: [0; VOXELS],
            inside_box: [[0; 4]; 2],
            outside_box: [[0; 4]; 2],
            samples: [0; SAMPLES * LAYER],
        };
        // Quantise the samples, and set a bit for each one inside; the first bit of a row is the sample before the
        // brick
        let mut inside = [[0_u32; SAMPLES]; SAMPLES];
        for z in 0..SAMPLES {
            for y in 0..SAMPLES {
                let codes = codes(&field[z][y]);
                let position = z * LAYER + y * ROW;
                brick.samples[position..position + SAMPLES].copy_from_slice(&codes[..SAMPLES]);
                for (x, code) in codes.iter().enumerate() {
                    inside[z][y] |= u32::from(is_inside(*code, threshold)) << x;
                }
            }
        }
        // Mark the voxels with a corner inside, and those with a corner outside
        let (mut any_inside, mut any_outside) = (0, 0);
        for z in 0..VOXELS {
            for y in 0..VOXELS {
                let rows = [
                    inside[z + 1][y + 1],
                    inside[z + 1][y + 2],
                    inside[z + 2][y + 1],
                    inside[z + 2][y + 2],
                ];
                let any = rows.iter().fold(0, |any, row| any | row);
                let all = rows.iter().fold(!0, |all, row| all & row);
                // Combine both ends of each voxel of the row.
                let (any, all) = (any >> 1 | any >> 2, all >> 1 & all >> 2);
                brick.any_inside[z] |= u64::from(any & 0xff) << (8 * y);
                brick.any_outside[z] |= u64::from(!all & 0xff) << (8 * y);
            }
            any_inside |= brick.any_inside[z];
            any_outside |= brick.any_outside[z];
        }
        // Find the bounding boxes of the marked voxels
        match (any_inside, any_outside) {
            (0, _) => BrickKind::Outside,
            (_, 0) => BrickKind::Inside,
            _ => {
                brick.inside_box = box_around(&brick.any_inside);
                brick.outside_box = box_around(&brick.any_outside);
                BrickKind::Brick(brick)
            }
        }
    }

    /// For each layer of voxels, those in which a ray on `side` may cross the surface.
    #[inline(always)]
    pub(super) fn voxels(&self, side: Side) -> &[u64; VOXELS] {
        match side {
            Side::Outside => &self.any_inside,
            Side::Inside => &self.any_outside,
        }
    }

    /// Bounding box of these voxels: the first one, and one past the last one, along each axis.
    #[inline(always)]
    pub(super) fn marked(&self, side: Side) -> &[[u8; 4]; 2] {
        match side {
            Side::Outside => &self.inside_box,
            Side::Inside => &self.outside_box,
        }
    }

    /// The field at the corners of a voxel, in codes: x fastest, then y, then z. Also valid for voxels that are one
    /// outside the brick.
    #[inline(always)]
    pub(super) fn corners(&self, x: i32, y: i32, z: i32) -> [i32; 8] {
        #[expect(clippy::cast_sign_loss, reason = "voxels from -1 on")]
        let part = |c: i32| (c + 1) as usize;
        let at = &self.samples[part(z) * LAYER + part(y) * ROW + part(x)..];
        let at = &at[..LAYER + ROW + 2];
        let code = |i: usize| i32::from(at[i]);
        [
            code(0),
            code(1),
            code(ROW),
            code(ROW + 1),
            code(LAYER),
            code(LAYER + 1),
            code(LAYER + ROW),
            code(LAYER + ROW + 1),
        ]
    }

    /// The field at a position in voxels from the corner of the brick, by trilinear interpolation, in codes.
    #[inline(always)]
    pub(super) fn value(&self, position: Vec3) -> f32 {
        let voxel = voxel_of(position);
        let [x, y, z] = voxel;
        trilinear(
            &self.corners(x, y, z).map(|code| code as f32),
            position - Vec3::from(corner(voxel)),
        )
    }

    /// The gradient at a position in voxels from the corner of the brick, in codes per voxel: trilinear interpolation
    /// of central differences at the corners.
    ///
    /// The result is a weighted sum over 4x4x4 samples without the edges of that cube; a weight is a product of one
    /// factor per axis.
    #[inline(always)]
    pub(super) fn gradient(&self, position: Vec3) -> Vec3 {
        let voxel = voxel_of(position);
        let part = position - Vec3::from(corner(voxel));
        // Compute the weights along each axis, for interpolation and for differences
        let [mix_x, mix_y, mix_z] = part.to_array().map(|part| [0.0, 1.0 - part, part, 0.0]);
        let [slope_x, slope_y, slope_z] = part.to_array().map(|part| {
            let (a, b) = (0.5 * (1.0 - part), 0.5 * part);
            [-a, -b, a, b]
        });
        #[expect(clippy::cast_sign_loss, reason = "voxels from 0 on")]
        let first = voxel[2] as usize * LAYER + voxel[1] as usize * ROW + voxel[0] as usize;
        // Sum rows of four samples over y and z
        let (mut along_x, mut along_y, mut along_z) = (Vec4::ZERO, Vec4::ZERO, Vec4::ZERO);
        for z in 0..4 {
            let is_middle_z = z == 1 || z == 2;
            for y in 0..4 {
                let is_middle_y = y == 1 || y == 2;
                if !is_middle_y && !is_middle_z {
                    continue;
                }
                let row = self.row(first + z * LAYER + y * ROW);
                if is_middle_y && is_middle_z {
                    along_x += mix_z[z] * mix_y[y] * row;
                }
                if is_middle_z {
                    along_y += mix_z[z] * slope_y[y] * row;
                }
                if is_middle_y {
                    along_z += slope_z[z] * mix_y[y] * row;
                }
            }
        }
        // Sum along x
        let mix = Vec4::from_array(mix_x);
        Vec3::new(along_x.dot(Vec4::from_array(slope_x)), along_y.dot(mix), along_z.dot(mix))
    }

    /// Four consecutive samples of a row.
    #[inline(always)]
    fn row(&self, first: usize) -> Vec4 {
        let row = &self.samples[first..first + 4];
        Vec4::new(f32::from(row[0]), f32::from(row[1]), f32::from(row[2]), f32::from(row[3]))
    }
}

/// Bounding box of the voxels with a set bit; there is at least one.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "numbers from 0 to 8")]
fn box_around(layers: &[u64; VOXELS]) -> [[u8; 4]; 2] {
    let all = layers.iter().fold(0, |all, layer| all | layer);
    let rows = (0..8).fold(0_u32, |rows, y| rows | u32::from(all >> (8 * y) & 0xff != 0) << y);
    let columns = (0..8).fold(0, |columns, y| columns | all >> (8 * y) & 0xff) as u32;
    let deep = (0..8).fold(0_u32, |deep, z| deep | u32::from(layers[z] != 0) << z);
    let first = |bits: u32| bits.trailing_zeros() as u8;
    let beyond = |bits: u32| (u32::BITS - bits.leading_zeros()) as u8;
    [
        [first(columns), first(rows), first(deep), 0],
        [beyond(columns), beyond(rows), beyond(deep), 0],
    ]
}

#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped; rounded by the half"
)]
fn codes(row: &[f32; 16]) -> [u16; 16] {
    row.map(|value| ((value * CODES).clamp(0.0, 65_535.0) + 0.5) as i32 as u16)
}

/// The voxel of a brick that contains a position.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "saturates, then is clamped")]
pub(super) fn voxel_of(position: Vec3) -> [i32; 3] {
    [position.x, position.y, position.z].map(|x| (x as i32).clamp(0, VOXELS_I32 - 1))
}

#[inline(always)]
pub(super) fn corner(voxel: [i32; 3]) -> Vec3A {
    Vec3A::new(voxel[0] as f32, voxel[1] as f32, voxel[2] as f32)
}

/// Trilinear interpolation of values at the corners of a voxel; `part` is the position in the voxel, from 0 to 1.
#[inline(always)]
pub(super) fn trilinear(c: &[f32; 8], part: Vec3) -> f32 {
    let mix = |a: f32, b: f32, part: f32| a + (b - a) * part;
    let along_x = [
        mix(c[0], c[1], part.x),
        mix(c[2], c[3], part.x),
        mix(c[4], c[5], part.x),
        mix(c[6], c[7], part.x),
    ];
    let along_y = [mix(along_x[0], along_x[1], part.y), mix(along_x[2], along_x[3], part.y)];
    mix(along_y[0], along_y[1], part.z)
}
