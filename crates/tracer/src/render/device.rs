//! Pictures whose rays another device has traced: fills the planes of a film from what it found in each pixel.
//!
//! A device returns the particle of a pixel by its index. Ids, velocities, colours and attributes are looked up here,
//! so that they never leave the host, and by the same functions as for pictures that are traced here. What path tracing
//! computes before the first ray is here as well, in plain numbers.

use glam::Vec3;
use rayon::prelude::*;

pub use super::bsdf::rough_table;
pub use super::lights::{Extent, extent_of};
pub use super::path::ambient::reach as ambient_reach;
pub use super::path::catcher::{light_on, mirrors_see_through, reflected_by_white};

use super::{
    aov::{DataSample, NO_ID},
    channels::Channels,
    context::RenderContext,
    film::{Film, FilmTile, bounded},
    planes::FilmPlane,
    settings::{RenderError, RenderSettings},
    source::ShadeSource,
};
use crate::scene::Scene;

/// Rows that a thread fills at a time.
const ROWS: u32 = 16;

/// What a device found in a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DevicePixel {
    /// Linear RGB and coverage, each the mean of the samples.
    pub color: [f32; 4],
    /// The same of every second sample. For denoising.
    pub odd: [f32; 4],
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

/// Whether all planes of `channels` come from the nearest sample of each pixel, so that [`store_pixels`] fills them.
pub fn are_from_nearest(channels: &Channels) -> bool {
    FilmPlane::all().filter(|plane| channels.has(*plane)).all(|plane| plane.is_from_nearest())
}

/// Makes `film` a picture of `scene` with these settings, whose pixels `pixel` returns row by row from the top, by their
/// number.
///
/// # Errors
/// If a setting is out of range.
pub fn store_pixels(
    film: &mut Film,
    scene: &Scene,
    source: &dyn ShadeSource,
    settings: &RenderSettings,
    pixel: &(dyn Fn(usize) -> DevicePixel + Sync),
) -> Result<(), RenderError> {
    settings.validate()?;
    let RenderSettings { width, height, channels, has_features, .. } = *settings;
    film.fit(width, height, channels, has_features);
    let context = RenderContext::new(Vec::new(), scene, source, settings);
    film.bands_mut(ROWS).into_par_iter().for_each(|mut band| {
        for mut tile in band.tiles(width) {
            for row in 0..tile.rows {
                let first = (tile.top + row) as usize * width as usize;
                for column in 0..tile.width {
                    let found = pixel(first + column as usize);
                    context.store_pixel(&mut tile, [column, row], &found);
                }
            }
        }
    });
    Ok(())
}

impl RenderContext<'_> {
    fn store_pixel(&self, tile: &mut FilmTile<'_>, [column, row]: [u32; 2], pixel: &DevicePixel) {
        // A shadow catcher takes light away, sample by sample
        let is_bounded = self.catches_shadows();
        tile.set_color(column, row, bounded(pixel.color, is_bounded));
        tile.set_odd(column, row, bounded(pixel.odd, is_bounded));
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
