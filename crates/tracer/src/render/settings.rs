//! Settings of an image, their valid ranges, and the errors for values out of range.

use std::collections::BTreeSet;

use thiserror::Error;

use super::body_set::MAX_TRANSMISSIVE_BODIES;
use super::channels::Channels;
use super::drawing::Drawing;
use super::sampler::{MAX_FILTER_WIDTH, PixelFilter};
use super::window::DataWindow;
use crate::scene::{Material, MaterialError, Scene};

/// Maximum number of samples per pixel: more than any picture needs, and few enough for counts in f32.
pub const MAX_SAMPLES: u32 = 4096;

/// Largest number of a sequence of random numbers.
pub const MAX_SEED: u32 = 1_000_000_000;

/// Maximum recursion depth.
pub const MAX_DEPTH: u32 = 64;

/// Maximum recursion depth if both branches are always traced at transmissive spheres: the number of rays doubles at
/// each level.
pub const MAX_LITERAL_DEPTH: u32 = 8;

/// Default path weight below which one of two branches is chosen at random.
pub const DEFAULT_MIN_WEIGHT: f32 = 1.0 / 1024.0;

/// Valid path weights apart from 0. A sample has at most `1 / min_weight` paths.
pub const MIN_WEIGHTS: std::ops::RangeInclusive<f32> = 1e-5..=1.0;

/// Maximum number of diffuse reflections of a path.
pub const MAX_BOUNCES: u32 = 1000;

/// Default number of diffuse reflections of a path. Russian roulette ends most paths earlier.
pub const DEFAULT_BOUNCES: u32 = 6;

/// Largest limit of indirect light, a radiance. 1 is that of a white surface under the default light.
pub const MAX_CLAMP: f32 = 1e6;

/// Largest limit of noise.
pub const MAX_NOISE: f32 = 10.0;

/// Default maximum number of samples per pixel with a limit of noise.
pub const DEFAULT_MAX_SAMPLES: u32 = 1024;

/// Maximum number of photons.
pub const MAX_PHOTONS: u32 = 1_000_000_000;

/// Default number of photons.
pub const DEFAULT_PHOTONS: u32 = 500_000;

/// Longest side of an image in pixels.
pub const MAX_SIDE: u32 = 65_536;

/// Least number of samples of a pass with a limit of noise: the noise of fewer is not known.
const MIN_SAMPLES: u32 = 4;

/// With a limit of noise, the light on the ground has the paths of a picture with this many times the least number of
/// samples. Where more samples are taken, they show what noise it has left.
const GROUND_LIGHT: u32 = 4;

/// Methods to compute the radiance along rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum IntegratorKind {
    /// Whitted ray tracing: ambient light, lights without extent, and specular rays.
    #[default]
    Whitted,
    /// Path tracing: light of the environment, and light that diffuse surfaces reflect.
    Path,
}

/// Light that surfaces receive from other surfaces, in path tracing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum IndirectLight {
    /// Paths follow it.
    #[default]
    Traced,
    /// Paths end at the second opaque surface, with an estimate of its light.
    Ambient {
        /// Radius of a particle, scene units.
        radius: f32,
    },
}

/// How much noise a picture may have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseLimit {
    /// Noise of a tile of 16x16 pixels, relative to white.
    pub noise: f32,
    /// Maximum number of samples per pixel.
    pub max_samples: u32,
}

impl NoiseLimit {
    /// The number of samples of the first pass over a tile if `samples` are asked for: an even number.
    pub const fn least_samples(samples: u32) -> u32 {
        if samples < MIN_SAMPLES { MIN_SAMPLES } else { samples.next_multiple_of(2) }
    }

    /// The maximum number of samples of a pixel whose first pass has `least`: an even number.
    pub const fn most_samples(&self, least: u32) -> u32 {
        let most = self.max_samples / 2 * 2;
        if most < least { least } else { most }
    }
}

/// Settings of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderSettings {
    /// Width of the film in pixels.
    pub width: u32,
    /// Height of the film in pixels.
    pub height: u32,
    /// Samples per pixel; a single one is exactly at the centre of the pixel.
    pub samples: u32,
    /// Adaptive sampling: the noise above which tiles take more samples.
    pub noise: Option<NoiseLimit>,
    /// Sequence of the random numbers. Pictures that differ only in it have the same mean and independent noise.
    pub seed: u32,
    /// How the samples are distributed around the centre of the pixel.
    pub filter: PixelFilter,
    /// The light transport.
    pub integrator: IntegratorKind,
    /// Path tracing: maximum number of diffuse reflections before the last one; 0 is direct light only.
    pub bounces: u32,
    /// Path tracing: largest component of the radiance that a path segment adds to a sample after the first bounce.
    pub clamp: Option<f32>,
    /// Path tracing: light from other surfaces.
    pub indirect: IndirectLight,
    /// Path tracing: number of photons for caustics on the ground; 0 follows paths from the ground instead.
    pub photons: u32,
    /// Maximum depth: 1 is direct light only; each further level adds one level of reflections and refractions. Rays
    /// beyond the last level see the background.
    pub max_depth: u32,
    /// At a transmissive sphere, both the reflected and the refracted branch are traced while each has at least this
    /// path weight (the product of the weights along its path). Below it, one of the two is chosen at random, with
    /// the weight of both. 0 always traces both: equation 4.1 taken literally, up to [`MAX_LITERAL_DEPTH`]. Surfaces
    /// of a connected body have a separate rule.
    pub min_weight: f32,
    /// Removes the background from the colour of pixels and fades the ground out in `A`. By default `RGB` contains
    /// the background where `A` is 0.
    pub transparent_background: bool,
    /// Planes to fill.
    pub channels: Channels,
    /// Also fills the planes that [denoising](crate::denoise) needs.
    pub has_features: bool,
    /// Outlines, and how particles fade with their distance.
    pub drawing: Drawing,
    /// The part of the image that the film is; by default the whole image.
    pub window: Option<DataWindow>,
    /// If given, the film is a mosaic: its tiles of 16x16 pixels are tiles of a film with this width and height, evenly
    /// distributed over it. The cost per pixel of a mosaic is an estimate for the whole film.
    pub mosaic_of: Option<[u32; 2]>,
}

impl RenderSettings {
    /// Whitted ray tracing with depth 3 as in the thesis, one sample per pixel, colour only.
    pub const fn new(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            samples: 1,
            noise: None,
            seed: 0,
            filter: PixelFilter::BOX,
            integrator: IntegratorKind::Whitted,
            bounces: DEFAULT_BOUNCES,
            clamp: None,
            indirect: IndirectLight::Traced,
            photons: 0,
            max_depth: 3,
            min_weight: DEFAULT_MIN_WEIGHT,
            transparent_background: false,
            channels: Channels::COLOR,
            drawing: Drawing::NONE,
            has_features: false,
            window: None,
            mosaic_of: None,
        }
    }

    /// Maximum number of diffuse reflections before the last one that paths follow.
    pub const fn traced_bounces(&self) -> u32 {
        match (self.indirect, self.bounces) {
            (IndirectLight::Ambient { .. }, 1..) => 1,
            (_, bounces) => bounces,
        }
    }

    /// Width and height in pixels of the film, or of the film that it is a mosaic of.
    fn full_size(&self) -> [u32; 2] {
        self.mosaic_of.unwrap_or([self.width, self.height])
    }

    /// The position of the film in the image of the camera.
    pub fn data_window(&self) -> DataWindow {
        let [width, height] = self.full_size();
        self.window.unwrap_or(DataWindow::whole(width, height))
    }

    /// Width and height in pixels of the image of one eye, if a picture has `eyes` images beside and below each other.
    pub fn eye_size(&self, eyes: [u32; 2]) -> [u32; 2] {
        let [width, height] = self.data_window().image;
        [(width / eyes[0]).max(1), (height / eyes[1]).max(1)]
    }

    /// The channels of the film, with those that are features for denoising.
    pub(super) const fn planes(&self) -> Channels {
        self.channels.with_features(self.has_features)
    }

    /// Least number of samples of a pixel: [`Self::samples`], or those of the first pass with a limit of noise.
    pub const fn least_samples(&self) -> u32 {
        match self.noise {
            None => self.samples,
            Some(_) => NoiseLimit::least_samples(self.samples),
        }
    }

    /// The settings of the passes that a tile may take, with more and more samples; all are even numbers.
    pub(super) fn passes(&self) -> Vec<Self> {
        let Some(limit) = self.noise else {
            return vec![*self];
        };
        let first = self.least_samples();
        // One pass may take all that is left after the first one
        let left = limit.most_samples(first) - first;
        let more = |samples: &u32| Some((samples + samples / 3).next_multiple_of(2));
        let later = std::iter::successors(Some(MIN_SAMPLES), more)
            .take_while(|samples| *samples < left)
            .chain(Some(left).filter(|left| *left >= MIN_SAMPLES));
        let numbers: BTreeSet<u32> = later.chain([first]).collect();
        numbers.into_iter().map(|samples| Self { samples, noise: None, ..*self }).collect()
    }

    /// The first of [`Self::passes`] with `samples` or more, or the last one.
    pub(super) fn pass_with(passes: &[Self], samples: u32) -> usize {
        let place = passes.partition_point(|pass| pass.samples < samples);
        place.min(passes.len() - 1)
    }

    /// The pass whose light on the ground all passes share, of [`Self::passes`]: most tiles take no more samples.
    pub(super) fn ground_pass(&self, passes: &[Self]) -> usize {
        match self.noise {
            None => 0,
            Some(_) => Self::pass_with(passes, GROUND_LIGHT * self.least_samples()),
        }
    }

    /// Checks that all settings are in their ranges.
    ///
    /// # Errors
    /// The first one that is not.
    pub fn validate(&self) -> Result<(), RenderError> {
        // Check the numbers with a lower limit of 1
        let [full_width, full_height] = self.full_size();
        for (name, value, max) in [
            ("width", self.width, MAX_SIDE),
            ("height", self.height, MAX_SIDE),
            ("width", full_width, MAX_SIDE),
            ("height", full_height, MAX_SIDE),
            ("samples", self.samples, MAX_SAMPLES),
            ("max_samples", self.noise.map_or(1, |limit| limit.max_samples), MAX_SAMPLES),
            ("max_depth", self.max_depth, MAX_DEPTH),
        ] {
            if !(1..=max).contains(&value) {
                return Err(RenderError::OutOfRange { name, value, max });
            }
        }
        // Check that the data window is near the image
        let DataWindow { left, top, image } = self.data_window();
        let is_near = |at: &i32| at.unsigned_abs() <= MAX_SIDE;
        let is_side = |side: &u32| (1..=MAX_SIDE).contains(side);
        if !([left, top].iter().all(is_near) && image.iter().all(is_side)) {
            return Err(RenderError::Window);
        }
        // Check the other numbers
        let width = self.filter.width;
        if !(width > 0.0 && width <= MAX_FILTER_WIDTH) {
            return Err(RenderError::FilterWidth(width));
        }
        if let Some(clamp) = self.clamp.filter(|clamp| !(*clamp > 0.0 && *clamp <= MAX_CLAMP)) {
            return Err(RenderError::Clamp(clamp));
        }
        if let Some(limit) =
            self.noise.filter(|limit| !(limit.noise > 0.0 && limit.noise <= MAX_NOISE))
        {
            return Err(RenderError::Noise(limit.noise));
        }
        if self.bounces > MAX_BOUNCES {
            return Err(RenderError::TooManyBounces(self.bounces));
        }
        if self.min_weight != 0.0 && !MIN_WEIGHTS.contains(&self.min_weight) {
            return Err(RenderError::MinWeight(self.min_weight));
        }
        Ok(())
    }

    /// Checks that each light group of `scene` has a layer, if there are layers for light groups.
    pub(super) fn validate_light_groups(&self, scene: &Scene) -> Result<(), RenderError> {
        let count = self.channels.layers.light_groups;
        let lights = scene.lights.iter().map(|light| light.group);
        let group = lights.fold(scene.environment_group, u8::max);
        if count > 0 && group >= count {
            return Err(RenderError::LightGroup { group, count });
        }
        Ok(())
    }

    /// Checks that the number of rays at spheres of `material` does not double for too many levels.
    pub(super) fn validate_branches(&self, material: &Material) -> Result<(), RenderError> {
        let max_depth = self.max_depth;
        if self.min_weight == 0.0 && material.branches() && max_depth > MAX_LITERAL_DEPTH {
            return Err(RenderError::TooManyBranches { max_depth });
        }
        Ok(())
    }
}

/// Reasons why there is no image.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum RenderError {
    /// The caller asked to stop.
    #[error("rendering was interrupted")]
    Interrupted,
    /// A setting is out of range.
    #[error("{name} = {value} is out of range; it must be from 1 to {max}")]
    OutOfRange {
        /// The setting.
        name: &'static str,
        /// Its value.
        value: u32,
        /// Its maximum.
        max: u32,
    },
    /// A shape has a material that the scene lacks.
    #[error("a shape has material {index}, but the scene has only {count}")]
    UnknownMaterial {
        /// Its index.
        index: usize,
        /// Number of materials.
        count: usize,
    },
    /// The position of the film in the image is out of range.
    #[error(
        "the window of the film is out of range; its sides and coordinates must be at most {MAX_SIDE} pixels"
    )]
    Window,
    /// The width of the filter is out of range.
    #[error(
        "filter_width = {0} is out of range, it must be above 0 and at most {MAX_FILTER_WIDTH}"
    )]
    FilterWidth(f32),
    /// `bounces` is out of range.
    #[error("bounces = {0} is out of range, it must be at most {MAX_BOUNCES}")]
    TooManyBounces(u32),
    /// `clamp` is out of range.
    #[error("clamp = {0} is out of range; it must be above 0 and at most {MAX_CLAMP:e}")]
    Clamp(f32),
    /// The limit of noise is out of range.
    #[error("noise = {0} is out of range; it must be above 0 and at most {MAX_NOISE}")]
    Noise(f32),
    /// A light is in a group without a layer.
    #[error("a light is in light group {group}, but there are only {count} light groups")]
    LightGroup {
        /// The group.
        group: u8,
        /// Number of groups with layers.
        count: u8,
    },
    /// `min_weight` is out of range.
    #[error("min_weight = {0} is out of range; it must be 0, or from {low:e} to {high}", low = MIN_WEIGHTS.start(), high = MIN_WEIGHTS.end())]
    MinWeight(f32),
    /// Both branches would be traced for too many levels.
    #[error(
        "min_weight = 0 follows both branches at transmissive spheres, which doubles the rays at each level; \
         max_depth = {max_depth} is too deep for that, it must be at most {MAX_LITERAL_DEPTH}"
    )]
    TooManyBranches {
        /// The depth.
        max_depth: u32,
    },
    /// Too many bodies let light through.
    #[error(
        "{count} bodies are transmissive, but at most {MAX_TRANSMISSIVE_BODIES} can be in one picture"
    )]
    TooManyBodies {
        /// Number of connected transmissive bodies.
        count: usize,
    },
    /// Separate spheres have no place in sets of bodies.
    #[error("transmissive spheres beside a transmissive body; they must be one body, too")]
    SpheresBesideBodies,
    /// A constant of the material is out of range.
    #[error(transparent)]
    Material(#[from] MaterialError),
}
