//! Denoises pictures, whatever has rendered them.

use std::time::Instant;

use super::renderer::TracedFrame;
use super::setup::Setup;
use crate::denoise::{DenoiseError, DenoiseInput, denoise};
use crate::render::{Film, FilmPlane};

impl TracedFrame {
    /// Denoises the picture if the setup says so.
    pub(super) fn denoise(&mut self, setup: &Setup) -> Result<(), DenoiseError> {
        self.report.seconds.denoise += denoise_film(setup, &mut self.film)?;
        Ok(())
    }
}

/// Denoises `film` if the setup says so. Returns the time, seconds.
fn denoise_film(setup: &Setup, film: &mut Film) -> Result<f64, DenoiseError> {
    // Without settings, or without features to compare, there is nothing to do
    let (Some(settings), Some(odd)) = (&setup.picture.denoise, &film.odd) else {
        return Ok(0.0);
    };
    let features = (
        film.plane(FilmPlane::Albedo),
        film.plane(FilmPlane::Normal),
        film.plane(FilmPlane::Depth),
    );
    let (Some(albedo), Some(normal), Some(depth)) = features else {
        return Ok(0.0);
    };
    let start = Instant::now();
    let input = DenoiseInput {
        width: film.width,
        height: film.height,
        views: setup.picture.eyes(),
        samples: setup.picture.render.least_samples(),
        is_transparent: setup.picture.render.transparent_background,
        color: &film.color,
        odd,
        albedo,
        normal,
        depth,
    };
    // Replace the colours, and with a transparent background the coverage
    let clean = denoise(&input, settings)?;
    let noisy = std::mem::replace(&mut film.color, clean);
    clear_shadows(film, &noisy);
    Ok(start.elapsed().as_secs_f64())
}

/// Gives the shadows on a shadow catcher what the coverage has gained, which is the shadows of objects whose own coverage
/// has no noise. `noisy` are the colours before denoising.
fn clear_shadows(film: &mut Film, noisy: &[[f32; 4]]) {
    let color = std::mem::take(&mut film.color);
    if let Some(arriving) = film.plane_mut::<[f32; 3]>(FilmPlane::ShadowCatcher) {
        let coverage = noisy.iter().zip(&color).map(|(before, after)| before[3] - after[3]);
        for (arriving, change) in arriving.iter_mut().zip(coverage) {
            *arriving = arriving.map(|part| (part + change).max(0.0));
        }
    }
    film.color = color;
}
