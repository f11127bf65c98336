//! Removes the noise of pictures on the device: see `shaders/denoise.wgsl`, and [`spherule_tracer::denoise`] for the
//! filter.

use std::fmt::Write as _;

use bytemuck::{Pod, Zeroable};
use spherule_tracer::denoise::device::{CONSTANTS, shares};
use wgpu::BindingResource;

use crate::arrays::{Array, Uniform, Uniforms};
use crate::commands::{Commands, Kernel};
use crate::picture::{Denoising, Picture};
use crate::tree_kernels::GROUPS;
use crate::{Device, GpuError};

/// Pixels along a side of a tile.
const TILE: u32 = 16;
/// Invocations of the workgroups of the other kernels.
const GROUP: u64 = 64;

/// The features of a pixel: albedo and depth, and the normal.
const GUIDE_BYTES: u64 = 32;
/// Both halves of a pixel.
const HALVES_BYTES: u64 = 32;
const CLEAN_BYTES: u64 = 16;
/// Brightness and noise.
const NUMBER_BYTES: u64 = 4;
const SLOPE_BYTES: u64 = 8;

/// Memory of the device for a pixel of a picture that is denoised, bytes.
pub(crate) const BYTES_PER_PIXEL: u64 =
    GUIDE_BYTES + HALVES_BYTES + CLEAN_BYTES + 2 * NUMBER_BYTES + SLOPE_BYTES;
/// That of the largest array.
pub(crate) const LARGEST_PER_PIXEL: u64 = HALVES_BYTES;

/// The uniform of the kernels.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Settings {
    size: [u32; 2],
    search: u32,
    is_transparent: u32,
    /// Parts of the even and the odd samples.
    shares: [f32; 2],
    /// One over the number of samples, and over that of the odd ones.
    per_sample: [f32; 2],
    color_scale: f32,
    is_bounded: u32,
    zeros: [u32; 2],
}

#[derive(Debug)]
struct Kernels {
    find_brightness: Kernel,
    halve: Kernel,
    estimate_noise: Kernel,
    filter_pixels: Kernel,
}

impl Kernels {
    fn new(device: &Device) -> Self {
        let mut constants = String::new();
        for (name, value) in CONSTANTS {
            // Writing to a string does not fail
            let _ = writeln!(constants, "const {name}: f32 = {value:e}f;");
        }
        let source = [&constants, GROUPS, include_str!("shaders/denoise.wgsl")].concat();
        let module = device.module(&source);
        let kernel = |entry, bindings: &[u32]| Kernel::new(device, &module, entry, bindings);
        Self {
            find_brightness: kernel("find_brightness", &[0, 1, 2, 3]),
            halve: kernel("halve", &[0, 1, 2, 3, 4]),
            estimate_noise: kernel("estimate_noise", &[0, 2, 4, 5, 6]),
            filter_pixels: kernel("filter_pixels", &[0, 1, 2, 4, 5, 6, 7]),
        }
    }
}

/// Denoises one picture after another, in memory that is kept.
#[derive(Debug, Default)]
pub(crate) struct Denoiser {
    kernels: Option<Kernels>,
    uniforms: Uniforms,
    guides: Array,
    brightness: Array,
    halves: Array,
    noise: Array,
    slopes: Array,
    clean: Array,
}

impl Denoiser {
    /// For each pixel, what the filter compares: written by `shaders/features.wgsl`.
    pub(crate) const fn guides(&self) -> &Array {
        &self.guides
    }

    /// The denoised picture.
    pub(crate) const fn clean(&self) -> &Array {
        &self.clean
    }

    /// Memory of the device, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        let Self { guides, brightness, halves, noise, slopes, clean, .. } = self;
        [guides, brightness, halves, noise, slopes, clean].iter().map(|array| array.bytes()).sum()
    }

    /// Makes room for a picture.
    ///
    /// # Errors
    /// If memory is full.
    pub(crate) fn reserve(
        &mut self,
        device: &Device,
        picture: &Picture<'_>,
    ) -> Result<(), GpuError> {
        let pixels = picture.film.pixels();
        let padded = u64::from(picture.film.width + 2) * u64::from(picture.film.height + 2);
        for (array, bytes) in [
            (&mut self.guides, GUIDE_BYTES * pixels),
            (&mut self.brightness, NUMBER_BYTES * pixels),
            (&mut self.halves, HALVES_BYTES * pixels),
            (&mut self.noise, NUMBER_BYTES * padded),
            (&mut self.slopes, SLOPE_BYTES * pixels),
            (&mut self.clean, CLEAN_BYTES * pixels),
        ] {
            array.reserve(device, "pixels to denoise", bytes)?;
        }
        Ok(())
    }

    /// Adds the dispatches that denoise a picture whose sums are in `film`, with the features in [`Self::guides`].
    ///
    /// # Errors
    /// If memory is full.
    pub(crate) fn add(
        &mut self,
        device: &Device,
        commands: &mut Commands<'_>,
        picture: &Picture<'_>,
        denoising: &Denoising,
        film: &Array,
    ) -> Result<(), GpuError> {
        self.uniforms.clear();
        let uniform = self.uniforms.push(&settings_of(picture, denoising));
        self.uniforms.upload(device)?;
        self.kernels.get_or_insert_with(|| Kernels::new(device));
        let Some(kernels) = &self.kernels else { return Ok(()) };
        let array_of = |binding| self.array(binding, uniform, film);
        let size = picture.film;
        let padded = u64::from(size.width + 2) * u64::from(size.height + 2);
        commands.add(&kernels.find_brightness, &array_of, size.pixels(), GROUP);
        commands.add(&kernels.halve, &array_of, size.pixels(), GROUP);
        commands.add(&kernels.estimate_noise, &array_of, padded, GROUP);
        let tiles = [size.width, size.height].map(|length| length.div_ceil(TILE));
        commands.add_groups(&kernels.filter_pixels, &array_of, tiles);
        Ok(())
    }

    fn array<'a>(&'a self, binding: u32, uniform: Uniform, film: &'a Array) -> BindingResource<'a> {
        let array = match binding {
            0 => return self.uniforms.binding(uniform),
            1 => film,
            2 => &self.guides,
            3 => &self.brightness,
            4 => &self.halves,
            5 => &self.noise,
            6 => &self.slopes,
            _ => &self.clean,
        };
        array.binding()
    }
}

fn settings_of(picture: &Picture<'_>, denoising: &Denoising) -> Settings {
    let samples = picture.samples.count;
    Settings {
        size: [picture.film.width, picture.film.height],
        search: denoising.settings.search,
        is_transparent: picture.is_transparent.into(),
        shares: shares(samples),
        per_sample: [samples, (samples / 2).max(1)].map(|count| 1.0 / count as f32),
        color_scale: denoising.settings.color_scale(),
        is_bounded: denoising.is_bounded.into(),
        zeros: [0; 2],
    }
}
