//! Rays in, planes out: samples every pixel of a [`Scene`] over a list of [`Shape`]s and fills a [`Film`].
//! No I/O; encoding is `output`'s business.
//!
//! The image is cut into tiles of 16x16 pixels that rayon hands out. Every tile is computed from
//! its pixels' coordinates alone and sums its samples in a fixed order, so the film is the same to
//! the bit whatever the number of threads.

use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;
use thiserror::Error;

use crate::{
    scene::{Material, MaterialError, Scene},
    surface::{Plane, Shape},
};

mod aov;
mod attributes;
#[cfg(test)]
pub(crate) mod brute;
mod film;
mod film_rows;
mod integrator;
mod lights;
mod materials;
mod roulette;
mod sampler;
mod shading;
mod source;
mod stop;
mod stream;
mod tile;
mod visibility;
mod whitted;

#[cfg(test)]
mod body_tests;
#[cfg(test)]
mod branch_tests;
#[cfg(test)]
mod image_tests;
#[cfg(test)]
mod poison_tests;
#[cfg(test)]
pub(crate) mod solid;
#[cfg(test)]
mod whitted_tests;

pub use aov::{DataSample, NO_ID};
pub use film::{Channels, Film, UnknownChannel};
pub use film_rows::FilmRows;
pub use sampler::{FilmSampler, MultiJitter, PathSeed};
pub(crate) use source::mean;
pub use source::{Colors, ParticleShading, ShadeSource};
pub use stop::{Deadline, Stop};

use integrator::WhittedIntegrator;

/// Most samples per pixel: more than any picture needs, and few enough to count in f32.
pub const MAX_SAMPLES: u32 = 4096;

/// Deepest recursion: a level takes some stack.
pub const MAX_DEPTH: u32 = 64;

/// Deepest recursion that follows both branches at transmissive spheres always: the rays double at each level.
pub const MAX_LITERAL_DEPTH: u32 = 8;

/// Path weight below which one of two branches is drawn, unless something else is asked for.
pub const DEFAULT_MIN_WEIGHT: f32 = 1.0 / 1024.0;

/// Path weights that can be asked for beside 0. A sample has at most `1 / min_weight` paths.
pub const MIN_WEIGHTS: std::ops::RangeInclusive<f32> = 1e-5..=1.0;

/// Longest side of an image in pixels.
pub const MAX_SIDE: u32 = 65_536;

/// How to render.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderSettings {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Samples per pixel; 1 looks through the pixel's centre exactly.
    pub samples: u32,
    /// 1 shades what the camera sees with direct light only; each level more follows reflections
    /// and refractions once more. Where it ends, a ray sees the background.
    pub max_depth: u32,
    /// Where a ray meets a transmissive sphere, both the reflected and the refracted branch are followed while
    /// each has a path weight (the product of the weights of its branches) of at least this; below, one of the
    /// two is drawn, with the weight of both. 0 follows both always: equation 4.1 to the letter, to
    /// [`MAX_LITERAL_DEPTH`]. Surfaces of one body have a rule of their own.
    pub min_weight: f32,
    /// Leaves the background out of the colour of pixels and fades the ground out in `A`; by
    /// default the background is in `RGB` where `A` is 0.
    pub transparent_background: bool,
    /// Planes to fill.
    pub channels: Channels,
}

impl RenderSettings {
    /// Depth 3 as in the thesis, one sample per pixel, colour only.
    pub const fn new(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            samples: 1,
            max_depth: 3,
            min_weight: DEFAULT_MIN_WEIGHT,
            transparent_background: false,
            channels: Channels::COLOR,
        }
    }

    fn validate(&self) -> Result<(), RenderError> {
        for (name, value, max) in [
            ("width", self.width, MAX_SIDE),
            ("height", self.height, MAX_SIDE),
            ("samples", self.samples, MAX_SAMPLES),
            ("max_depth", self.max_depth, MAX_DEPTH),
        ] {
            if !(1..=max).contains(&value) {
                return Err(RenderError::OutOfRange { name, value, max });
            }
        }
        if self.min_weight != 0.0 && !MIN_WEIGHTS.contains(&self.min_weight) {
            return Err(RenderError::MinWeight(self.min_weight));
        }
        Ok(())
    }

    /// Checks that the rays of spheres of `material` do not double at each level for too many levels.
    fn validate_branches(&self, material: &Material) -> Result<(), RenderError> {
        let max_depth = self.max_depth;
        if self.min_weight == 0.0 && material.branches() && max_depth > MAX_LITERAL_DEPTH {
            return Err(RenderError::TooManyBranches { max_depth });
        }
        Ok(())
    }
}

/// The renderers that there are. Images depend on which one made them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RendererKind {
    /// Rays on the processor's threads.
    #[default]
    Cpu,
}

impl RendererKind {
    /// Its name in the settings of a job.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
        }
    }
}

/// Rays traced, by what they were for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RayCounts {
    /// From the camera.
    pub primary: u64,
    /// To a light.
    pub shadow: u64,
    /// Mirrored.
    pub reflection: u64,
    /// Into or out of a transmissive body.
    pub refraction: u64,
}

impl RayCounts {
    /// All together.
    pub const fn total(&self) -> u64 {
        self.primary + self.shadow + self.reflection + self.refraction
    }
}

impl std::ops::Add for RayCounts {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            primary: self.primary + other.primary,
            shadow: self.shadow + other.shadow,
            reflection: self.reflection + other.reflection,
            refraction: self.refraction + other.refraction,
        }
    }
}

/// Why there is no image.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum RenderError {
    /// The caller asked to stop.
    #[error("rendering was interrupted")]
    Interrupted,
    /// A setting makes no image.
    #[error("{name} = {value} is out of range, it must lie in 1 to {max}")]
    OutOfRange {
        /// The setting.
        name: &'static str,
        /// What it was.
        value: u32,
        /// The largest that works.
        max: u32,
    },
    /// The path weight from which on one branch is drawn is out of range.
    #[error("min_weight = {0} is out of range, it must be 0 or lie in {low:e} to {high}", low = MIN_WEIGHTS.start(), high = MIN_WEIGHTS.end())]
    MinWeight(f32),
    /// Both branches are to be followed for too many levels.
    #[error(
        "min_weight = 0 follows both branches at transmissive spheres, which doubles the rays at each level; \
         max_depth = {max_depth} is too deep for that, it must be at most {MAX_LITERAL_DEPTH}"
    )]
    TooManyBranches {
        /// The depth.
        max_depth: u32,
    },
    /// A constant of the material is out of range.
    #[error(transparent)]
    Material(#[from] MaterialError),
}

/// Bytes that each thread takes while it renders, beside the film, at most. `is_body` says that the particles make one
/// connected body.
pub fn scratch_bytes(settings: &RenderSettings, material: &Material, is_body: bool) -> u64 {
    integrator::scratch_bytes(settings, material.transmission > 0.0, is_body)
}

/// Renders one image on the current rayon pool.
///
/// The camera should have been made for `settings.width / settings.height`. No light is made: with
/// `reflection` and `transmission` at most 1, which is checked, what a ray gathers from the
/// background never exceeds the background's brightest colour.
///
/// # Errors
/// If `stop` is raised (looked at for each packet of samples), or a setting is out of range.
pub fn render(
    shapes: &[&dyn Shape],
    scene: &Scene,
    source: &dyn ShadeSource,
    settings: &RenderSettings,
    stop: &dyn Stop,
) -> Result<(Film, RayCounts), RenderError> {
    let mut film = Film::default();
    let counts = render_into(&mut film, shapes, scene, source, settings, stop)?;
    Ok((film, counts))
}

/// As [`render`], into `film`, whatever is in it: in the memory of its planes if it is of the same size and
/// channels.
///
/// # Errors
/// As [`render`]; what is in the film then is no image.
pub fn render_into(
    film: &mut Film,
    shapes: &[&dyn Shape],
    scene: &Scene,
    source: &dyn ShadeSource,
    settings: &RenderSettings,
    stop: &dyn Stop,
) -> Result<RayCounts, RenderError> {
    settings.validate()?;
    scene.material.validate()?;
    if !shapes.iter().any(|shape| shape.is_connected()) {
        settings.validate_branches(&scene.material)?;
    }
    film.fit(settings.width, settings.height, settings.channels);
    let plane = scene.ground.as_ref().map(Plane::new);
    let floor = plane.iter().map(|plane| plane as &dyn Shape);
    let shapes = floor.chain(shapes.iter().copied()).collect();
    let integrator = WhittedIntegrator::new(shapes, scene, source, settings);
    let scratch = Mutex::new(Vec::new());
    let render_tile = |tile: &mut film::FilmTile<'_>| {
        // As many as there are threads; they live until the image is done.
        let mut own = lock(&scratch).pop().unwrap_or_default();
        let counts = integrator.render_tile(tile, stop, &mut own);
        lock(&scratch).push(own);
        counts.ok_or(RenderError::Interrupted)
    };
    // Bands run at once and their tiles do too, so that a slow corner of the image keeps all threads busy.
    film.bands_mut(tile::SIDE)
        .into_par_iter()
        .map(|mut band| {
            let tiles = band.tiles(tile::SIDE).into_par_iter();
            tiles
                .map(|mut tile| render_tile(&mut tile))
                .try_reduce(RayCounts::default, |a, b| Ok(a + b))
        })
        .try_reduce(RayCounts::default, |a, b| Ok(a + b))
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}
