//! Renders a [`Scene`] with a list of [`Shape`]s: samples every pixel and fills the planes of a [`Film`]. There is no
//! I/O; `output` encodes films.
//!
//! The image is divided into tiles of 16x16 pixels, which rayon distributes over threads. A tile depends only on the
//! coordinates of its pixels, and sums its samples in a fixed order, so the film is the same to the bit for any
//! number of threads.

use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use crate::scene::{Ground, Material, Scene};
use spherule_surface::{MaterialId, Shape};

mod absorption;
mod accumulate;
mod adaptive;
mod aov;
mod attributes;
mod bodies;
mod body_set;
#[cfg(test)]
pub(crate) mod brute;
mod bsdf;
mod channels;
mod clamp;
mod context;
pub mod cryptomatte;
mod density_profile;
pub mod device;
mod dimensions;
mod drawing;
mod entries;
mod film;
mod film_join;
mod film_rows;
mod free_path;
mod generate;
mod integrator;
mod interface;
mod intersect;
pub mod layers;
mod light_groups;
mod light_split;
mod lights;
mod media;
mod mist;
mod mist_rays;
mod near_photons;
mod nested;
mod noise;
mod outline;
mod panes;
mod path;
mod phase;
pub mod planes;
mod ray_counts;
mod roulette;
mod sample_layers;
mod sampler;
mod scene_shapes;
mod scratch;
mod settings;
mod shading;
mod source;
mod specular;
mod spray;
mod stop;
mod stream;
mod tile;
mod translucent;
mod underlay;
mod visibility;
mod whitted;
mod window;

#[cfg(test)]
mod adaptive_tests;
#[cfg(test)]
mod body_tests;
#[cfg(test)]
mod branch_tests;
#[cfg(test)]
mod catcher_tests;
#[cfg(test)]
mod caustics_tests;
#[cfg(test)]
mod clamp_tests;
#[cfg(test)]
mod filter_tests;
#[cfg(test)]
mod grains_tests;
#[cfg(test)]
mod ground_light_tests;
#[cfg(test)]
mod image_tests;
#[cfg(test)]
mod lens_tests;
#[cfg(test)]
mod light_groups_tests;
#[cfg(test)]
mod motion_tests;
#[cfg(test)]
mod nested_tests;
#[cfg(test)]
mod opacity_tests;
#[cfg(test)]
mod panes_tests;
#[cfg(test)]
mod path_tests;
#[cfg(test)]
mod poison_tests;
#[cfg(test)]
mod projection_tests;
#[cfg(test)]
mod rods_tests;
#[cfg(test)]
pub(crate) mod solid;
#[cfg(test)]
mod spray_tests;
#[cfg(test)]
mod style_caustics_tests;
#[cfg(test)]
mod style_tests;
#[cfg(test)]
mod whitted_tests;

pub use aov::{DataSample, NO_ID};
pub use body_set::MAX_TRANSMISSIVE_BODIES;
pub use channels::{Channels, NamedChannel, UnknownChannel};
pub use drawing::Drawing;
pub use film::Film;
pub use film_rows::FilmRows;
pub use path::ground::GroundLightBytes;
pub use planes::FilmPlane;
pub use ray_counts::{LostLight, RayCounts};
pub use sampler::{FilmSampler, FilterKind, MAX_FILTER_WIDTH, MultiJitter, PathSeed, PixelFilter};
pub use settings::{
    DEFAULT_BOUNCES, DEFAULT_MAX_SAMPLES, DEFAULT_MIN_WEIGHT, DEFAULT_PHOTONS, IndirectLight,
    IntegratorKind, MAX_BOUNCES, MAX_CLAMP, MAX_DEPTH, MAX_LITERAL_DEPTH, MAX_NOISE, MAX_PHOTONS,
    MAX_SAMPLES, MAX_SEED, MAX_SIDE, MIN_WEIGHTS, NoiseLimit, RenderError, RenderSettings,
};
pub use source::mean;
pub use source::opacity_of;
pub use source::{Colors, Opacities, ParticleShading, ShadeSource, StyleShading};
pub use stop::Stop;
pub use window::DataWindow;

use adaptive::Passes;
use context::RenderContext;
use integrator::Integrator;
use path::PathIntegrator;
use scene_shapes::Interior;
use tile::SIDE;
use whitted::WhittedIntegrator;

/// The available renderers. Images depend on the renderer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RendererKind {
    /// Ray tracing on the threads of the CPU.
    #[default]
    Cpu,
    /// Ray tracing on a GPU.
    Gpu,
}

impl RendererKind {
    /// The name in the settings of a job.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
        }
    }
}

/// Upper bound of the memory that each thread needs during rendering, without the film, in bytes. `is_body`: the
/// particles form one connected body. `slices`: number of slices of the exposure in which surfaces differ.
pub fn scratch_bytes(
    settings: &RenderSettings,
    material: &Material,
    is_body: bool,
    slices: u32,
) -> u64 {
    let max_paths = integrator::max_paths(settings, Interior::of(material, is_body));
    let max_depth = integrator::max_depth(settings);
    let passes = settings.passes();
    let most = passes.last().map_or(settings.samples, |pass| pass.samples);
    // Passes are joined tile by tile
    let pass = match settings.noise {
        None => 0,
        Some(_) => Film::bytes_for(SIDE, SIDE, settings.channels, settings.has_features),
    };
    pass + scratch::scratch_bytes(most, max_depth, max_paths, &settings.channels)
        + stream::bytes_of_slices(slices)
}

/// Upper bounds of the memory for the light of photons and on the ground around transmissive particles.
pub fn ground_light_bytes(scene: &Scene, settings: &RenderSettings) -> GroundLightBytes {
    let passes = settings.passes();
    path::ground::bytes(scene, &passes[settings.ground_pass(&passes)])
}

/// Memory of the sample points of all passes over an image.
pub fn sampler_bytes(settings: &RenderSettings) -> u64 {
    settings.passes().iter().map(|pass| FilmSampler::bytes(pass.samples)).sum()
}

/// Renders one image on the current rayon pool.
///
/// The aspect ratio of the camera should be that of the image, `settings.width / settings.height` without a window. No
/// light is created: `reflection` and `transmission` are at most 1, which is checked, so the background never
/// contributes more to a ray than its brightest colour.
///
/// # Errors
/// If `stop` is raised (checked for each packet of samples), or if a setting is out of range.
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

/// Same as [`render`], into an existing `film`. Its memory is reused if size and channels match; its content is
/// ignored.
///
/// # Errors
/// Same as [`render`]; the content of the film is unspecified then.
pub fn render_into(
    film: &mut Film,
    shapes: &[&dyn Shape],
    scene: &Scene,
    source: &dyn ShadeSource,
    settings: &RenderSettings,
    stop: &dyn Stop,
) -> Result<RayCounts, RenderError> {
    // Check the settings
    settings.validate()?;
    settings.validate_light_groups(scene)?;
    for material in &scene.materials {
        material.validate()?;
    }
    if let Some(mist) = &scene.mist {
        mist.validate()?;
    }
    let count = scene.materials.len();
    let used = shapes.iter().map(|shape| shape.material().index());
    if let Some(index) = used.max().filter(|index| *index >= count) {
        return Err(RenderError::UnknownMaterial { index, count });
    }
    if !shapes.iter().any(|shape| shape.is_connected()) {
        settings.validate_branches(scene.particle_material())?;
    }
    validate_bodies(shapes, scene)?;
    // Prepare film, shapes and integrator
    let RenderSettings { width, height, channels, has_features, .. } = *settings;
    film.fit(width, height, channels, has_features);
    let plane = scene.ground.as_ref().map(Ground::shape);
    let ground = plane.iter().map(|plane| plane as &dyn Shape);
    let shapes: Vec<_> = ground.chain(shapes.iter().copied()).collect();
    let passes = settings.passes();
    let contexts =
        passes.iter().map(|pass| RenderContext::new(shapes.clone(), scene, source, pass));
    let ground_pass = settings.ground_pass(&passes);
    let (integrators, before) = integrators_of(contexts.collect(), ground_pass, settings, stop)?;
    let first = RenderSettings::pass_with(&passes, settings.least_samples());
    let passes = Passes { integrators, first, samples: settings.samples, limit: settings.noise };
    stop.pixels_begin();
    let scratch = Mutex::new(Vec::new());
    let render_tile = |tile: &mut film::FilmTile<'_>| {
        // Reuse scratch memory: there is one per thread, and all are released at the end of the image
        let mut own = lock(&scratch).pop().unwrap_or_default();
        let counts = passes.render_tile(tile, stop, &mut own);
        lock(&scratch).push(own);
        stop.pixels_done(tile.width * tile.rows);
        counts.ok_or(RenderError::Interrupted)
    };
    // Render bands and their tiles in parallel, so that a slow corner of the image keeps all threads busy
    let counts = film
        .bands_mut(SIDE)
        .into_par_iter()
        .map(|mut band| {
            let tiles = band.tiles(SIDE).into_par_iter();
            tiles
                .map(|mut tile| render_tile(&mut tile))
                .try_reduce(RayCounts::default, |a, b| Ok(a + b))
        })
        .try_reduce(RayCounts::default, |a, b| Ok(a + b))?;
    Ok(before + counts)
}

/// Checks that rays can tell apart which transmissive bodies they are inside.
fn validate_bodies(shapes: &[&dyn Shape], scene: &Scene) -> Result<(), RenderError> {
    let is_clear_sphere = |shape: &&dyn Shape| {
        shape.material() == MaterialId::PARTICLES
            && !shape.is_connected()
            && scene.particle_material().transmission > 0.0
    };
    match bodies::count_bodies(scene, shapes) {
        count if count > MAX_TRANSMISSIVE_BODIES => Err(RenderError::TooManyBodies { count }),
        1.. if shapes.iter().any(is_clear_sphere) => Err(RenderError::SpheresBesideBodies),
        _ => Ok(()),
    }
}

/// The integrators of the settings in `contexts`, and the rays that were traced to prepare them. All share the light of
/// photons, which is that of number `ground_pass`.
fn integrators_of<'a>(
    mut contexts: Vec<RenderContext<'a>>,
    ground_pass: usize,
    settings: &RenderSettings,
    stop: &dyn Stop,
) -> Result<(Vec<Box<dyn Integrator + 'a>>, RayCounts), RenderError> {
    if settings.integrator == IntegratorKind::Whitted {
        let of = |context| Box::new(WhittedIntegrator::new(context)) as Box<dyn Integrator + 'a>;
        return Ok((contexts.into_iter().map(of).collect(), RayCounts::default()));
    }
    let own = PathIntegrator::new(contexts.remove(ground_pass));
    let (own, traced) = own.with_photons(stop).ok_or(RenderError::Interrupted)?;
    let of = |context| Box::new(PathIntegrator::with_light_of(context, &own)) as Box<_>;
    let mut integrators: Vec<Box<dyn Integrator + 'a>> = contexts.into_iter().map(of).collect();
    integrators.insert(ground_pass, Box::new(own));
    Ok((integrators, traced))
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}
