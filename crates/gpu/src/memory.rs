//! Memory for the pixels and rays of pictures.

use spherule_tracer::render::device::{mirrors_see_through, needs_light_parts};
use spherule_tracer::render::{IntegratorKind, RenderSettings};
use spherule_tracer::scene::Scene;

use crate::batch::{Batch, DATA_BYTES, FILM_BYTES, MOST_RAYS, PixelNeed};
use crate::denoise;
use crate::lighting::RayKinds;
use crate::picture::{FIRST_GROUP, most_kept};

/// Memory of the first surfaces of the samples of a pixel, bytes.
pub(crate) const fn object_bytes(has_objects: bool, samples: u32) -> u64 {
    if has_objects { 4 * samples as u64 } else { 0 }
}

/// Memory of the layers of light of a pixel, bytes. With a limit of indirect light, each has a second place.
pub(crate) const fn layer_bytes(layers: u32, has_clamp: bool) -> u64 {
    16 * layers as u64 * (1 + has_clamp as u64)
}

/// Number of light groups of a picture with these settings, if it has light by parts.
pub(crate) fn light_groups_of(settings: &RenderSettings) -> Option<u32> {
    let channels = &settings.channels;
    needs_light_parts(channels).then(|| channels.layers.light_groups.into())
}

/// What the rays of a picture of `scene` with these settings are, and the memory of a pixel for the first surfaces and for
/// the layers of light.
fn needs_of(scene: &Scene, settings: &RenderSettings) -> (RayKinds, [u64; 2]) {
    let light_groups = light_groups_of(settings);
    let has_paths = settings.integrator == IntegratorKind::Path;
    let rays = RayKinds {
        has_paths,
        has_mirrors: has_paths && mirrors_see_through(scene, settings),
        has_layers: light_groups.is_some(),
        kept: (scene.particle_material().transmission > 0.0)
            .then(|| most_kept(settings.min_weight, settings.max_depth)),
        lights: u32::try_from(scene.lights.len()).unwrap_or(u32::MAX),
    };
    let objects = object_bytes(settings.channels.mattes().next().is_some(), settings.samples);
    let layers = light_groups.map_or(0, |groups| FIRST_GROUP + groups);
    (rays, [objects, layer_bytes(layers, settings.clamp.is_some())])
}

/// The need of a picture with these settings.
fn pixel_need(rays: RayKinds, settings: &RenderSettings) -> PixelNeed {
    PixelNeed {
        samples: settings.samples,
        is_denoised: settings.has_features,
        has_clamp: rays.has_paths && settings.clamp.is_some(),
    }
}

/// The largest array for the pixels and rays of a picture whose samples are traced one by one, bytes.
pub fn largest_array(scene: &Scene, settings: &RenderSettings) -> u64 {
    let (rays, [objects, layers]) = needs_of(scene, settings);
    let pixels = u64::from(settings.width) * u64::from(settings.height);
    let denoiser = if settings.has_features { denoise::LARGEST_PER_PIXEL } else { 0 };
    let single = Batch::with(rays, pixel_need(rays, settings), 1).largest_bytes(rays);
    let arrays = [single, rays.kept_bytes(), objects, layers, denoiser];
    arrays.into_iter().max().unwrap_or_default() * pixels
}

/// Memory of a device, whose arrays have at most `max_array` bytes, for the film and the queues of each pixel, bytes.
pub fn bytes_per_pixel(scene: &Scene, settings: &RenderSettings, max_array: u64) -> u64 {
    let (rays, [objects, layers]) = needs_of(scene, settings);
    let pixels = u64::from(settings.width) * u64::from(settings.height);
    let batch = Batch::new(rays, pixel_need(rays, settings), pixels, [MOST_RAYS, max_array]);
    let denoiser = if settings.has_features { denoise::BYTES_PER_PIXEL } else { 0 };
    4 + batch.bytes(rays) + denoiser + objects + layers + rays.kept_bytes()
}

/// Memory of the host for each pixel that was traced and is not stored yet, bytes.
pub fn host_bytes_per_pixel(scene: &Scene, settings: &RenderSettings) -> u64 {
    let (_, [objects, _]) = needs_of(scene, settings);
    let layers = light_groups_of(settings).map_or(0, |groups| FIRST_GROUP + groups);
    let films = 1 + u64::from(settings.has_features);
    films * FILM_BYTES + DATA_BYTES + objects + layer_bytes(layers, false)
}
