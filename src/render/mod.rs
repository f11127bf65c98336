//! Rays in, planes out: samples every pixel of a [`Scene`] over a list of [`Shape`]s and fills a [`Film`].
//! No I/O; encoding is `output`'s business.
//!
//! The image is cut into tiles of 16x16 pixels that rayon hands out. Every tile is computed from
//! its pixels' coordinates alone and sums its samples in a fixed order, so the film is the same to
//! the bit whatever the number of threads.

use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use crate::{
    scene::{Material, Scene},
    surface::{Plane, Shape},
};

mod accumulate;
mod aov;
mod attributes;
#[cfg(test)]
pub(crate) mod brute;
mod context;
mod film;
mod film_rows;
mod generate;
mod integrator;
mod intersect;
mod lights;
mod materials;
mod ray_counts;
mod roulette;
mod sampler;
mod scratch;
mod settings;
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
pub use ray_counts::RayCounts;
pub use sampler::{FilmSampler, MultiJitter, PathSeed};
pub use settings::{
    DEFAULT_MIN_WEIGHT, MAX_DEPTH, MAX_LITERAL_DEPTH, MAX_SAMPLES, MAX_SIDE, MIN_WEIGHTS,
    RenderError, RenderSettings,
};
pub(crate) use source::mean;
pub use source::{Colors, ParticleShading, ShadeSource};
pub use stop::{Deadline, Stop};

use context::{Interior, RenderContext};
use integrator::Integrator;
use whitted::WhittedIntegrator;

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

/// Bytes that each thread takes while it renders, beside the film, at most. `is_body` says that the particles make one
/// connected body.
pub fn scratch_bytes(settings: &RenderSettings, material: &Material, is_body: bool) -> u64 {
    let max_paths = whitted::max_paths(settings, Interior::of(material, is_body));
    scratch::scratch_bytes(settings, max_paths)
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
    let context = RenderContext::new(shapes, scene, source, settings);
    let integrator: &dyn Integrator = &WhittedIntegrator::new(context);
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
