//! The table of an environment that is sampled: mean radiance and probability density of the texels of an equal-area
//! octahedral map (`octahedral.rs`). Both are constant in a texel, and the density is proportional to the luminance, so
//! that the samples of a colour have the same weight everywhere.
//!
//! All functions of a lane are free of calls and branches, and of loops over the components of vectors: compilers
//! would vectorise those instead of the loops over lanes.

use spherule_tree::math::narrow;
use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::distribution::{Distribution, boxed};
use super::image::EnvironmentImage;
use super::octahedral::{sphere_to_square, square_to_sphere};
use super::{EnvironmentAxes, EnvironmentSample, LUMINANCE, resample};

/// Least density of a texel, as a fraction of the density of uniform sampling.
const MIN_DENSITY: f64 = 1e-4;

/// See the module.
#[derive(Debug, Clone, PartialEq)]
pub struct EnvironmentTable {
    axes: EnvironmentAxes,
    texels: TableSize,
}

/// Texels of 1.6 degrees for the lights of studios, which are large, or of 0.8 degrees for images, which may contain
/// a sun.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum TableSize {
    Coarse(Texels<128, { 128 * 128 }>),
    Fine(Texels<256, { 256 * 256 }>),
}

/// A table with edges of `SIDE` texels; `COUNT` is the square of that.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Texels<const SIDE: usize, const COUNT: usize> {
    /// Radiance (linear RGB) and probability density (per steradian), row by row.
    records: Box<[[f32; 4]; COUNT]>,
    distribution: Distribution<SIDE, COUNT>,
}

/// The numbers of a table, for renderers on other devices.
#[derive(Debug, Clone, Copy)]
pub struct TableArrays<'a> {
    /// Edge in texels.
    pub side: usize,
    /// Radiance (linear RGB) and probability density (per steradian), row by row.
    pub records: &'a [[f32; 4]],
    /// Cumulative probability at the end of each row.
    pub rows: &'a [f32],
    /// Cumulative probability at the end of each column, row by row, given the row.
    pub cells: &'a [f32],
}

/// Calls a function of the texels, whatever their number.
macro_rules! with_texels {
    ($table:expr, $texels:ident => $value:expr) => {
        match &$table.texels {
            TableSize::Coarse($texels) => $value,
            TableSize::Fine($texels) => $value,
        }
    };
}

impl EnvironmentTable {
    /// The coarse table of an image.
    pub(super) fn coarse(axes: EnvironmentAxes, image: &EnvironmentImage) -> Self {
        let texels = Texels::new(resample::octahedral(image, 128));
        Self { axes, texels: TableSize::Coarse(texels) }
    }

    /// The fine table of an image.
    pub(super) fn fine(axes: EnvironmentAxes, image: &EnvironmentImage) -> Self {
        let texels = Texels::new(resample::octahedral(image, 256));
        Self { axes, texels: TableSize::Fine(texels) }
    }

    /// The same around other axes.
    pub(super) fn with_axes(self, axes: EnvironmentAxes) -> Self {
        Self { axes, ..self }
    }

    /// The texels.
    #[inline(always)]
    pub(crate) const fn texels(&self) -> &TableSize {
        &self.texels
    }

    /// The axes of the map in the world.
    #[inline(always)]
    pub(crate) const fn axes(&self) -> &EnvironmentAxes {
        &self.axes
    }

    /// Memory, bytes.
    pub fn byte_len(&self) -> u64 {
        with_texels!(self, texels => texels.byte_len())
    }

    /// The numbers of the table.
    pub fn arrays(&self) -> TableArrays<'_> {
        with_texels!(self, texels => texels.arrays())
    }

    /// Samples a direction. The components of `u` are in 0..1.
    pub fn sample(&self, u: [f32; 2]) -> EnvironmentSample {
        let ([x, y, z], [r, g, b, pdf]) = with_texels!(self, texels => {
            let (own, index) = texels.sample(u);
            (own, texels.record(index))
        });
        let direction = Vec3::from_array(self.axes.world(x, y, z));
        EnvironmentSample { direction, radiance: Vec3::new(r, g, b), pdf }
    }

    /// The radiance from unit `direction`, linear RGB, and the probability density of [`Self::sample`] there, per
    /// steradian.
    pub fn radiance_and_pdf(&self, direction: Vec3) -> (Vec3, f32) {
        let own = self.axes.own(direction);
        let [r, g, b, pdf] =
            with_texels!(self, texels => texels.record(texels.index_at(own.x, own.y, own.z)));
        (Vec3::new(r, g, b), pdf)
    }

    /// Radiance (linear RGB) and probability density (per steradian) of the texel at an index.
    pub(crate) fn texel(&self, index: u32) -> (Vec3, f32) {
        let [r, g, b, pdf] = with_texels!(self, texels => texels.record(index));
        (Vec3::new(r, g, b), pdf)
    }

    /// Number of texels.
    pub(crate) fn texel_count(&self) -> usize {
        with_texels!(self, texels => texels.records.len())
    }

    /// Number of texels per steradian.
    pub(crate) fn texels_per_steradian(&self) -> f32 {
        narrow(self.texel_count() as f64 / (4.0 * PI))
    }

    /// The integral of the radiance over all directions, linear RGB.
    pub fn flux(&self) -> Vec3 {
        with_texels!(self, texels => texels.flux())
    }

    /// This table times the cosine between its directions and a unit `normal`, 0 behind it: sampling it samples
    /// irradiance.
    #[must_use]
    pub fn times_cosine(&self, normal: Vec3) -> Self {
        let own = self.axes.own(normal);
        let texels = match &self.texels {
            TableSize::Coarse(texels) => TableSize::Coarse(texels.times_cosine(own)),
            TableSize::Fine(texels) => TableSize::Fine(texels.times_cosine(own)),
        };
        Self { axes: self.axes, texels }
    }
}

impl<const SIDE: usize, const COUNT: usize> Texels<SIDE, COUNT> {
    fn new(radiance: Vec<[f32; 3]>) -> Self {
        // Weight the texels by their luminance; all have the same solid angle
        let luminance = |rgb: &[f32; 3]| f64::from(Vec3::from_array(*rgb).dot(LUMINANCE));
        let mut weights: Vec<f64> = radiance.iter().map(luminance).collect();
        let mean = weights.iter().sum::<f64>() / COUNT as f64;
        let least = if mean > 0.0 { MIN_DENSITY * mean } else { 1.0 };
        for weight in &mut weights {
            *weight += least;
        }
        // Store the density of the distribution as it is sampled
        let distribution = Distribution::new(&weights);
        let record = |(index, [r, g, b]): (usize, [f32; 3])| {
            let pdf = distribution.probability(index) * COUNT as f64 / (4.0 * PI);
            [r, g, b, narrow(pdf)]
        };
        let records = boxed(radiance.into_iter().enumerate().map(record).collect());
        Self { records, distribution }
    }

    fn byte_len(&self) -> u64 {
        size_of_val(&*self.records) as u64 + Distribution::<SIDE, COUNT>::byte_len()
    }

    fn arrays(&self) -> TableArrays<'_> {
        let [rows, cells] = self.distribution.ends();
        TableArrays { side: SIDE, records: &*self.records, rows, cells }
    }

    /// Samples a direction in the axes of the map, and the index of its texel.
    #[inline(always)]
    pub(crate) fn sample(&self, u: [f32; 2]) -> ([f32; 3], u32) {
        let cell = self.distribution.sample(u);
        let scale = 2.0 / SIDE as f32;
        (square_to_sphere(cell.x * scale - 1.0, cell.y * scale - 1.0), cell.index)
    }

    /// The index of the texel of a direction in the axes of the map.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    #[expect(clippy::cast_possible_wrap, reason = "sides are short")]
    pub(crate) fn index_at(&self, x: f32, y: f32, z: f32) -> u32 {
        let [u, v] = sphere_to_square(x, y, z);
        let texel = |position: f32| {
            let texel = ((position + 1.0) * (0.5 * SIDE as f32)) as i32;
            let texel = if texel > 0 { texel } else { 0 };
            if texel < SIDE as i32 { texel as u32 } else { SIDE as u32 - 1 }
        };
        texel(v) * SIDE as u32 + texel(u)
    }

    /// Radiance (linear RGB) and probability density (per steradian) of a texel.
    #[inline(always)]
    pub(crate) fn record(&self, index: u32) -> [f32; 4] {
        // The mask changes nothing but shows that the index is in bounds
        self.records[index as usize & (COUNT - 1)]
    }

    fn flux(&self) -> Vec3 {
        let rgb = |[r, g, b, _]: &[f32; 4]| DVec3::new((*r).into(), (*g).into(), (*b).into());
        let sum: DVec3 = self.records.iter().map(rgb).sum();
        (sum * (4.0 * PI / COUNT as f64)).as_vec3()
    }

    /// The texels times the mean cosine between their directions and `normal`, in the axes of the map.
    fn times_cosine(&self, normal: Vec3) -> Self {
        let texel = |(index, [r, g, b, _]): (usize, &[f32; 4])| {
            let points = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)];
            let cosine = |(across, down): (f32, f32)| {
                let at = |cell: usize, part: f32| (cell as f32 + part) * (2.0 / SIDE as f32) - 1.0;
                let [x, y] = [at(index % SIDE, across), at(index / SIDE, down)];
                Vec3::from_array(square_to_sphere(x, y)).dot(normal).max(0.0)
            };
            let mean = 0.25 * points.map(cosine).iter().sum::<f32>();
            [mean * r, mean * g, mean * b]
        };
        Self::new(self.records.iter().enumerate().map(texel).collect())
    }
}
