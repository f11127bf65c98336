//! Decides what stages do at the same time, and how many images are worth encoding at once.
//!
//! The preview is encoded by one thread, and so is everything around it: files are synced, the ledger is written. On
//! many cores, small images with few samples take longer there than they take to trace. The decision follows from the
//! settings and the number of threads, and never from the clock, so that predictions of memory hold.

use super::rays::expected_rays;
use super::setup::Setup;
use crate::render::RendererKind;

/// Maximum number of images that are encoded at the same time: beyond it, storage is the limit.
const MAX_ENCODERS: u32 = 8;

/// Seconds of one thread per pixel of an image and its preview.
const PIXEL_SECONDS: f64 = 1.5e-7;
/// Seconds per image, whatever its size, mostly for files to reach the disk.
const IMAGE_SECONDS: f64 = 4e-3;
/// Seconds of one thread per ray in a frame of few particles.
const RAY_SECONDS: f64 = 2.5e-7;
/// The same of a GPU, and its seconds per pixel until the host has read the picture.
const DEVICE_RAY_SECONDS: f64 = 7e-10;
const DEVICE_PIXEL_SECONDS: f64 = 1e-8;

impl Setup {
    /// Whether an image is finished by the stage that encodes it: the processor is free while a GPU renders the next one.
    pub(super) const fn finishes_when_encoding(&self) -> bool {
        matches!(self.picture.renderer, RendererKind::Gpu)
    }

    /// Whether the next frame is read while one is built: to build on a GPU is to copy the frame there, which takes about as
    /// long as to read it.
    pub(super) const fn reads_while_building(&self) -> bool {
        matches!(self.picture.renderer, RendererKind::Gpu)
    }

    /// Number of images to encode at the same time, so that encoding keeps up with tracing.
    pub(super) fn useful_encoders(&self) -> u32 {
        let render = &self.picture.render;
        let pixels = f64::from(render.width) * f64::from(render.height);
        let rays = expected_rays(render, &self.picture.scene);
        let threads = rayon::current_num_threads();
        let tracing = match self.picture.renderer {
            RendererKind::Cpu => rays * RAY_SECONDS / threads as f64,
            RendererKind::Gpu => rays * DEVICE_RAY_SECONDS + pixels * DEVICE_PIXEL_SECONDS,
        };
        encoders_for(pixels, tracing, threads)
    }
}

/// The number of encoders for images of so many `pixels`, which take `tracing` seconds each, on so many `threads`.
fn encoders_for(pixels: f64, tracing: f64, threads: usize) -> u32 {
    let encoding = IMAGE_SECONDS + pixels * PIXEL_SECONDS;
    let most = u32::try_from(threads).unwrap_or(u32::MAX).min(MAX_ENCODERS);
    // The smallest number that keeps up, found without a division by zero
    let keeps_up = |count: &u32| encoding <= f64::from(*count) * tracing;
    (1..most).find(keeps_up).unwrap_or(most).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_images_with_few_samples_have_several_encoders_on_many_cores() {
        let pixels = 640.0 * 360.0;
        // A ray, and one for its light
        let draft = 1.4 * pixels * RAY_SECONDS;
        assert_eq!(encoders_for(pixels, draft, 1), 1);
        assert!(encoders_for(pixels, draft / 16.0, 16) > 4);
        // Many samples and reflections
        assert_eq!(encoders_for(pixels, 100.0 * pixels * RAY_SECONDS / 16.0, 16), 1);
        assert_eq!(encoders_for(pixels, 0.0, 64), MAX_ENCODERS);
        assert_eq!(encoders_for(0.0, 0.0, 1), 1);
    }
}
