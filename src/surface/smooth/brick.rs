//! A cube of voxels with the field at their corners, quantised.

use glam::{Vec3, Vec3A, Vec4};

use crate::surface::Side;

/// Voxels along an edge.
pub(super) const VOXELS: usize = 8;
/// The same to count with coordinates.
pub(super) const VOXELS_I32: i32 = 8;
/// Bits of a coordinate in voxels that tell the voxel in its brick.
pub(super) const VOXEL_BITS: u32 = 3;
/// Samples along an edge: the corners of the voxels, and one more on either side for gradients.
pub(super) const SAMPLES: usize = VOXELS + 3;
/// The largest value that is told from larger ones; the field in a body is about 1.
const MOST: f32 = 1.5;
/// Codes for a value of 1.
pub(super) const CODES: f32 = 65_535.0 / MOST;

/// Places of a sample's neighbours along y and z.
const ROW: usize = SAMPLES;
const LAYER: usize = SAMPLES * SAMPLES;

/// See the module. Neighbouring bricks have the same samples where they meet.
#[derive(Debug, Clone)]
pub(super) struct Brick {
    /// A bit for each voxel of a layer (8 y + x), for each z: some corner is inside.
    any_inside: [u64; VOXELS],
    /// Some corner is outside.
    any_outside: [u64; VOXELS],
    /// Boxes around the voxels of each, first and beyond the last along each axis.
    inside_box: [[u8; 4]; 2],
    outside_box: [[u8; 4]; 2],
    /// By z, y and x from one voxel before the brick on.
    samples: [u16; SAMPLES * LAYER],
}

/// What the samples of a brick are.
#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "bricks are moved into their place at once"
)]
pub(super) enum Made {
    /// The surface passes.
    Brick(Brick),
    /// No voxel has a corner inside.
    Outside,
    /// No voxel has a corner outside.
    Inside,
}

/// Inside the surface at `threshold`, which is in codes. The same for a number and its code.
#[inline(always)]
pub(super) fn is_inside(code: u16, threshold: f32) -> bool {
    f32::from(code) >= threshold
}

impl Brick {
    /// Of the field's values in rows of 16 of which `SAMPLES` count.
    #[inline(always)]
    pub(super) fn make(field: &[[[f32; 16]; SAMPLES]; SAMPLES], threshold: f32) -> Made {
        let mut brick = Self {
            any_inside: [0; VOXELS],
            any_outside: [0; VOXELS],
            inside_box: [[0; 4]; 2],
            outside_box: [[0; 4]; 2],
            samples: [0; SAMPLES * LAYER],
        };
        // A bit for each sample of a row, the one before the brick first.
        let mut inside = [[0_u32; SAMPLES]; SAMPLES];
        for z in 0..SAMPLES {
            for y in 0..SAMPLES {
                let codes = codes(&field[z][y]);
                let place = z * LAYER + y * ROW;
                brick.samples[place..place + SAMPLES].copy_from_slice(&codes[..SAMPLES]);
                for (x, code) in codes.iter().enumerate() {
                    inside[z][y] |= u32::from(is_inside(*code, threshold)) << x;
                }
            }
        }
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
                // Both ends of each voxel of the row.
                let (any, all) = (any >> 1 | any >> 2, all >> 1 & all >> 2);
                brick.any_inside[z] |= u64::from(any & 0xff) << (8 * y);
                brick.any_outside[z] |= u64::from(!all & 0xff) << (8 * y);
            }
            any_inside |= brick.any_inside[z];
            any_outside |= brick.any_outside[z];
        }
        match (any_inside, any_outside) {
            (0, _) => Made::Outside,
            (_, 0) => Made::Inside,
            _ => {
                brick.inside_box = box_around(&brick.any_inside);
                brick.outside_box = box_around(&brick.any_outside);
                Made::Brick(brick)
            }
        }
    }

    /// For each layer of voxels, those that a ray on `side` may cross the surface in.
    #[inline(always)]
    pub(super) fn voxels(&self, side: Side) -> &[u64; VOXELS] {
        match side {
            Side::Outside => &self.any_inside,
            Side::Inside => &self.any_outside,
        }
    }

    /// The box around those: the first, and the one beyond the last, along each axis.
    #[inline(always)]
    pub(super) fn marked(&self, side: Side) -> &[[u8; 4]; 2] {
        match side {
            Side::Outside => &self.inside_box,
            Side::Inside => &self.outside_box,
        }
    }

    /// The field at the corners of a voxel, in codes: x fastest, then y, then z. Voxels beyond the brick by
    /// one have their corners, too.
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

    /// The field at a place in voxels from the brick's corner, trilinear, in codes.
    #[inline(always)]
    pub(super) fn value(&self, place: Vec3) -> f32 {
        let voxel = voxel_of(place);
        let [x, y, z] = voxel;
        trilinear(
            &self.corners(x, y, z).map(|code| code as f32),
            place - Vec3::from(corner(voxel)),
        )
    }

    /// The gradient at a place in voxels from the brick's corner: central differences at the corners,
    /// trilinear between; in codes a voxel.
    ///
    /// That is a sum over 4x4x4 samples without the edges of that cube, with weights that are products of one for
    /// each axis.
    #[inline(always)]
    pub(super) fn gradient(&self, place: Vec3) -> Vec3 {
        let voxel = voxel_of(place);
        let part = place - Vec3::from(corner(voxel));
        let [mix_x, mix_y, mix_z] = part.to_array().map(|part| [0.0, 1.0 - part, part, 0.0]);
        let [slope_x, slope_y, slope_z] = part.to_array().map(|part| {
            let (a, b) = (0.5 * (1.0 - part), 0.5 * part);
            [-a, -b, a, b]
        });
        #[expect(clippy::cast_sign_loss, reason = "voxels from 0 on")]
        let first = voxel[2] as usize * LAYER + voxel[1] as usize * ROW + voxel[0] as usize;
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
        let mix = Vec4::from_array(mix_x);
        Vec3::new(
            along_x.dot(Vec4::from_array(slope_x)),
            along_y.dot(mix),
            along_z.dot(mix),
        )
    }

    /// Four samples of a row.
    #[inline(always)]
    fn row(&self, first: usize) -> Vec4 {
        let row = &self.samples[first..first + 4];
        Vec4::new(
            f32::from(row[0]),
            f32::from(row[1]),
            f32::from(row[2]),
            f32::from(row[3]),
        )
    }
}

/// The box around the voxels whose bits are set; there are some.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "numbers from 0 to 8")]
fn box_around(layers: &[u64; VOXELS]) -> [[u8; 4]; 2] {
    let all = layers.iter().fold(0, |all, layer| all | layer);
    let rows = (0..8).fold(0_u32, |rows, y| {
        rows | u32::from(all >> (8 * y) & 0xff != 0) << y
    });
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

/// The voxel of a brick that holds a place.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    reason = "saturates, then is clamped"
)]
pub(super) fn voxel_of(place: Vec3) -> [i32; 3] {
    [place.x, place.y, place.z].map(|x| (x as i32).clamp(0, VOXELS_I32 - 1))
}

#[inline(always)]
pub(super) fn corner(voxel: [i32; 3]) -> Vec3A {
    Vec3A::new(voxel[0] as f32, voxel[1] as f32, voxel[2] as f32)
}

/// Between the corners of a voxel, `part` of the way along each axis.
#[inline(always)]
pub(super) fn trilinear(c: &[f32; 8], part: Vec3) -> f32 {
    let mix = |a: f32, b: f32, part: f32| a + (b - a) * part;
    let along_x = [
        mix(c[0], c[1], part.x),
        mix(c[2], c[3], part.x),
        mix(c[4], c[5], part.x),
        mix(c[6], c[7], part.x),
    ];
    let along_y = [
        mix(along_x[0], along_x[1], part.y),
        mix(along_x[2], along_x[3], part.y),
    ];
    mix(along_y[0], along_y[1], part.z)
}
