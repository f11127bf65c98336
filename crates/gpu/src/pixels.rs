//! What a picture returns: its pixels, and what it has cost.

use bytemuck::{Pod, Zeroable};

use crate::arrays::Downloaded;
use crate::picture::FIRST_GROUP;

/// The pixels of a picture, row by row.
#[derive(Debug, Clone, Copy)]
pub struct Pixels<'a> {
    /// Red, green, blue and coverage, each the sum over the samples.
    pub sums: &'a [[f32; 4]],
    /// The denoised means, linear RGB and coverage, if the picture is denoised; else empty.
    pub clean: &'a [[f32; 4]],
    /// The nearest sample.
    pub nearest: &'a [NearestSample],
    /// The first surface of each sample, pixel by pixel, if the picture has them; else empty.
    pub objects: &'a [SampleObject],
    /// Light by parts, if the picture has it, else empty: plane by plane, see [`LightLayer`], then the light groups.
    pub layers: &'a [[f32; 4]],
}

/// The pixels of a picture in memory of the host, which its renderer uses again once this is dropped.
#[derive(Debug)]
pub struct HostPixels {
    content: Downloaded,
    /// Bytes of each slice of [`Pixels`].
    lengths: [usize; 5],
}

impl HostPixels {
    /// `lengths` are those of the slices of [`Pixels`], one behind the other in `content`, bytes.
    pub(crate) fn new(content: Downloaded, lengths: [u64; 5]) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "they are in memory")]
        let lengths = lengths.map(|length| length as usize);
        Self { content, lengths }
    }

    /// The pixels.
    pub fn pixels(&self) -> Pixels<'_> {
        let mut rest = self.content.bytes();
        let [sums, clean, nearest, objects, layers] = self.lengths.map(|length| {
            let (slice, others) = rest.split_at(length);
            rest = others;
            slice
        });
        Pixels {
            sums: bytemuck::cast_slice(sums),
            clean: bytemuck::cast_slice(clean),
            nearest: bytemuck::cast_slice(nearest),
            objects: bytemuck::cast_slice(objects),
            layers: bytemuck::cast_slice(layers),
        }
    }
}

/// A plane of [`Pixels::layers`]: sums over the samples, linear RGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightLayer {
    /// Diffuse reflection by the first surface.
    Diffuse,
    /// Glossy reflection by the first surface.
    Specular,
    /// Lights that the camera sees.
    Emission,
    /// What the camera sees behind everything.
    Background,
    /// Light after one interaction at most.
    Direct,
    /// Luminance of direct light: if nothing is in the way, and what arrives.
    Arrival,
    /// The part of its light that a shadow catcher lacks.
    Loss,
    /// Reflection by transmissive spheres.
    Reflection,
    /// Refraction by transmissive spheres.
    Refraction,
    /// A light group, by its number.
    Group(u32),
}

impl LightLayer {
    /// Its number among the planes.
    pub(crate) const fn number(self) -> u32 {
        match self {
            Self::Diffuse => 0,
            Self::Specular => 1,
            Self::Emission => 2,
            Self::Background => 3,
            Self::Direct => 4,
            Self::Arrival => 5,
            Self::Loss => 6,
            Self::Reflection => 8,
            Self::Refraction => 9,
            Self::Group(group) => FIRST_GROUP + group,
        }
    }
}

/// The first surface of a sample, in one word.
#[repr(transparent)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct SampleObject(u32);

impl SampleObject {
    /// The index of its sphere, or None on the ground, with its coverage; None without a surface.
    pub fn surface(self) -> Option<(Option<u32>, f32)> {
        // Indices are below 2^31; the ground is its negative coverage
        match self.0 {
            NearestSample::NONE => None,
            index if index >> 31 == 0 => Some((Some(index), 1.0)),
            bits => Some((None, -f32::from_bits(bits))),
        }
    }
}

/// The nearest intersection of a pixel.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct NearestSample {
    /// Distance along the view axis.
    pub depth: f32,
    /// Index of the sphere, or [`NearestSample::NONE`].
    pub index: u32,
    /// Unit normal on the side of the camera.
    pub normal: [f32; 3],
    /// The point.
    pub position: [f32; 3],
}

impl NearestSample {
    /// The index of a pixel that shows neither a sphere nor the ground; its other values mean nothing.
    pub const NONE: u32 = u32::MAX;
    /// The index of a pixel that shows the ground.
    pub const GROUND: u32 = u32::MAX - 1;
}

/// What a picture has cost.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Cost {
    /// Seconds on the device to build the tree; 0 if it has no clock.
    pub build_seconds: f64,
    /// Seconds on the device to trace the picture; 0 if it has no clock.
    pub trace_seconds: f64,
    /// Seconds on the device to denoise it; 0 if it has no clock.
    pub denoise_seconds: f64,
    /// Rays from the camera.
    pub primary_rays: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Reflected rays, also by rough surfaces.
    pub reflected_rays: u64,
    /// Rays that transmissive spheres refract.
    pub refracted_rays: u64,
    /// Light that the clamp of indirect light took away, in the steps of `LostLight`.
    pub lost_steps: u64,
    /// Memory of the device, bytes.
    pub bytes: u64,
    /// That of the tree and its build.
    pub tree_bytes: u64,
}
