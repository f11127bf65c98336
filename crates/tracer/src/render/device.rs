//! Pictures whose rays another device has traced: fills the planes of a film from what it found in each pixel.
//!
//! A device returns the particle of a pixel by its index. Ids, velocities, colours and attributes are looked up here,
//! so that they never leave the host, and by the same functions as for pictures that are traced here. What path tracing
//! computes before the first ray is here as well, in plain numbers.

use glam::Vec3;
use rayon::prelude::*;

pub use super::bsdf::rough_table;
pub use super::interface::rough_glass_table;
pub use super::lights::{Extent, extent_of};
pub use super::path::ambient::reach as ambient_reach;
pub use super::path::catcher::{light_on, mirrors_see_through, reflected_by_white};
pub use super::path::ground::needs_photons;

use super::{
    aov::{DataSample, NO_ID},
    channels::Channels,
    context::RenderContext,
    cryptomatte::rank,
    film::{Film, FilmTile, bounded},
    planes::FilmPlane,
    sample_layers::{lit_part, store},
    settings::{RenderError, RenderSettings},
    source::ShadeSource,
};
use crate::scene::Scene;
use spherule_surface::MaterialId;

/// Rows that a thread fills at a time.
const ROWS: u32 = 16;

/// What a device found in a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DevicePixel {
    /// Linear RGB and coverage, each the mean of the samples.
    pub color: [f32; 4],
    /// The same after denoising, if the device has denoised the picture.
    pub clean: Option<[f32; 4]>,
    /// The nearest intersection, if any sample has one.
    pub nearest: Option<DeviceHit>,
}

/// An intersection with a particle or the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceHit {
    /// Distance along the view axis.
    pub depth: f32,
    /// Index of the particle; None on the ground.
    pub particle: Option<u32>,
    /// Unit normal on the side of the camera.
    pub normal: Vec3,
    /// The point, relative to the origin of the scene.
    pub point: Vec3,
}

/// The object that the first surface of a sample belongs to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceObject {
    /// Index of the particle; None on the ground.
    pub particle: Option<u32>,
    /// How much of the sample it covers, 0 to 1.
    pub coverage: f32,
}

/// The light of a pixel by parts, each the mean of the samples, linear RGB.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceLight {
    /// Of the diffuse reflection by the first surface.
    pub diffuse: Vec3,
    /// Of the glossy reflection by the first surface.
    pub specular: Vec3,
    /// Of the reflection by transmissive particles.
    pub reflection: Vec3,
    /// Of the refraction by transmissive particles.
    pub refraction: Vec3,
    /// Of lights that the camera sees.
    pub emission: Vec3,
    /// Of what the camera sees behind everything.
    pub background: Vec3,
    /// After one interaction at most.
    pub direct: Vec3,
    /// Luminance of direct light: if nothing is in the way, and what arrives.
    pub luminance: [f32; 2],
    /// The part of its light that a shadow catcher lacks.
    pub loss: Vec3,
}

/// What a device found in the pixels of a picture, by their number, row by row from the top.
pub trait DevicePixels: Sync {
    /// The means and the nearest intersection.
    fn pixel(&self, number: usize) -> DevicePixel;

    /// The objects of the samples, without those that show neither a particle nor the ground. For Cryptomatte.
    fn objects(&self, number: usize) -> impl Iterator<Item = DeviceObject>;

    /// The light by parts. Only if [`needs_light_parts`].
    fn light(&self, number: usize) -> DeviceLight;

    /// The mean light of a light group; group 0 has the light without a group. Only if [`needs_light_parts`].
    fn light_of_group(&self, number: usize, group: u32) -> Vec3;
}

/// Whether planes of `channels` have parts of the light.
pub fn needs_light_parts(channels: &Channels) -> bool {
    let others = [FilmPlane::LightGroups, FilmPlane::Shadow, FilmPlane::ShadowCatcher];
    channels.needs_light_classes() || others.iter().any(|plane| channels.has(*plane))
}

/// Makes `film` a picture of `scene` with these settings and `pixels`.
///
/// # Errors
/// If a setting is out of range.
pub fn store_pixels(
    film: &mut Film,
    scene: &Scene,
    source: &dyn ShadeSource,
    settings: &RenderSettings,
    pixels: &impl DevicePixels,
) -> Result<(), RenderError> {
    settings.validate()?;
    let RenderSettings { width, height, channels, .. } = *settings;
    // The features that a denoiser needs have stayed on the device
    let settings = &RenderSettings { has_features: false, ..*settings };
    film.fit(width, height, channels, settings.has_features);
    let context = RenderContext::new(Vec::new(), scene, source, settings);
    film.bands_mut(ROWS).into_par_iter().for_each(|mut band| {
        let mut objects = PixelObjects::default();
        for mut tile in band.tiles(width) {
            for row in 0..tile.rows {
                let first = (tile.top + row) as usize * width as usize;
                for column in 0..tile.width {
                    let number = first + column as usize;
                    let pixel = pixels.pixel(number);
                    context.store_pixel(&mut tile, [column, row], &pixel);
                    if needs_light_parts(&context.settings.channels) {
                        context.store_light(&mut tile, [column, row], &pixel, (pixels, number));
                    }
                    if context.settings.channels.mattes().next().is_some() {
                        objects.add_up(pixels.objects(number));
                        context.store_objects(&mut tile, [column, row], &mut objects);
                    }
                }
            }
        }
    });
    Ok(())
}

/// The objects of a pixel.
#[derive(Default)]
struct PixelObjects {
    /// Each one once, with the coverage of all its samples.
    all: Vec<DeviceObject>,
    /// Objects of one kind with their coverage.
    covered: Vec<(u32, f32)>,
}

impl PixelObjects {
    fn add_up(&mut self, samples: impl Iterator<Item = DeviceObject>) {
        self.all.clear();
        for sample in samples {
            match self.all.iter_mut().find(|sum| sum.particle == sample.particle) {
                Some(sum) => sum.coverage += sample.coverage,
                None => self.all.push(sample),
            }
        }
    }
}

impl RenderContext<'_> {
    /// Ranks the objects of each kind by the part of a pixel that they cover.
    fn store_objects(
        &self,
        tile: &mut FilmTile<'_>,
        [column, row]: [u32; 2],
        PixelObjects { all, covered }: &mut PixelObjects,
    ) {
        let share = 1.0 / self.settings.samples as f32;
        for kind in self.settings.channels.mattes() {
            let object = |of: &DeviceObject| match of.particle {
                Some(particle) => {
                    let material = self.source.style(particle).unwrap_or(MaterialId::PARTICLES);
                    self.object(kind, material, || particle)
                }
                None => self.object(kind, MaterialId::GROUND, || 0),
            };
            covered.clear();
            covered.extend(all.iter().map(|of| (object(of), of.coverage)));
            rank(covered, share, tile.components_mut(kind.plane(), column, row));
        }
    }

    /// Stores the light of a pixel by parts.
    fn store_light(
        &self,
        tile: &mut FilmTile<'_>,
        [column, row]: [u32; 2],
        pixel: &DevicePixel,
        (pixels, number): (&impl DevicePixels, usize),
    ) {
        // As on the CPU, what the bounds of the colour change is light of the background
        let means = bounded(pixel.color, self.catches_shadows());
        let color = Vec3::from_slice(&means);
        let limited = color - Vec3::from_slice(&pixel.color);
        let light = pixels.light(number);
        let direct = light.direct + limited;
        // What coverage gains by denoising is shadow
        let arriving = (Vec3::ONE - light.loss).max(Vec3::ZERO);
        let change = pixel.clean.map_or(0.0, |clean| means[3] - clean[3]);
        for (plane, value) in [
            (FilmPlane::Diffuse, light.diffuse),
            (FilmPlane::Specular, light.specular),
            (FilmPlane::Reflection, light.reflection),
            (FilmPlane::Refraction, light.refraction),
            (FilmPlane::Emission, light.emission),
            (FilmPlane::Background, light.background + limited),
            (FilmPlane::Direct, direct),
            (FilmPlane::Indirect, color - direct),
            (FilmPlane::ShadowCatcher, (arriving + change).max(Vec3::ZERO)),
        ] {
            store(tile.components_mut(plane, column, row), value);
        }
        tile.components_mut(FilmPlane::Shadow, column, row).fill(lit_part(light.luminance));
        let groups = tile.components_mut(FilmPlane::LightGroups, column, row);
        for (group, components) in (0..).zip(groups.chunks_mut(3)) {
            let of_background = usize::try_from(group) == Ok(self.background_group());
            let limited = if of_background { limited } else { Vec3::ZERO };
            store(components, pixels.light_of_group(number, group) + limited);
        }
    }

    fn store_pixel(&self, tile: &mut FilmTile<'_>, [column, row]: [u32; 2], pixel: &DevicePixel) {
        // A shadow catcher takes light away, sample by sample
        let color = bounded(pixel.color, self.catches_shadows());
        tile.set_color(column, row, pixel.clean.unwrap_or(color));
        store(tile.components_mut(FilmPlane::Noisy, column, row), Vec3::from_slice(&color));
        let data = pixel.nearest.map_or(DataSample::MISS, |hit| self.data_of(&hit));
        tile.set_data(column, row, &data);
        if self.settings.channels.has(FilmPlane::Attributes) {
            let values = tile.components_mut(FilmPlane::Attributes, column, row);
            match data.particle {
                Some(particle) => self.source.attributes(particle, values),
                None => values.fill(0.0),
            }
        }
    }

    /// The data channels at an intersection.
    fn data_of(&self, hit: &DeviceHit) -> DataSample {
        let channels = self.settings.planes();
        let needs_particle = channels.needs_nearest_particle();
        let particle = hit.particle.filter(|_| needs_particle);
        let velocity = particle.map_or(Vec3::ZERO, |particle| self.source.velocity(particle));
        let [motion, motion_back] = self.motions(hit.point, velocity);
        let albedo = || match (hit.particle, &self.scene.ground) {
            (Some(particle), _) => self.source.color(particle),
            (None, Some(ground)) => ground.color_at(hit.point),
            (None, None) => Vec3::ZERO,
        };
        DataSample {
            z: hit.depth,
            normal: hit.normal,
            position: (self.scene.origin + hit.point.as_dvec3()).as_vec3(),
            velocity,
            albedo: if channels.has(FilmPlane::Albedo) { albedo() } else { Vec3::ZERO },
            id: particle.map_or(NO_ID, |particle| self.source.id(particle)),
            particle,
            motion,
            motion_back,
        }
    }
}
