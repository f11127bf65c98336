//! Memory of images: their planes, tracing, encoding.

use super::MemoryModel;
use crate::output::{encoder_bytes, picture_bytes};
use crate::overlay;
use crate::render::{Film, scratch_bytes};
use crate::surface::SurfaceKind;

impl MemoryModel<'_> {
    /// Memory of the planes of an image.
    pub(super) fn film(&self) -> u64 {
        let render = &self.setup.picture.render;
        Film::bytes_for(render.width, render.height, render.channels, render.has_features)
    }

    /// Memory of a thread during tracing.
    pub(super) fn tracing_scratch(&self) -> u64 {
        let is_body = self.setup.picture.surface.kind != SurfaceKind::Spheres;
        scratch_bytes(
            &self.setup.picture.render,
            self.setup.picture.scene.particle_material(),
            is_body,
            self.setup.slices(),
        )
    }

    /// Memory for encoding an image, without its planes: the bands that are being compressed or wait to be written;
    /// or, before that, the preview.
    pub(super) fn encoding(&self) -> u64 {
        let picture = &self.setup.picture;
        let render = &picture.render;
        // Features are not in the file
        let channels = Film::bytes_for(render.width, render.height, render.channels, false);
        let bands = encoder_bytes(channels, render.width, render.height, &picture.files.exr);
        let preview = picture_bytes(render.width, render.height, &picture.files.preview);
        let overlays = overlay::bytes(&picture.files.overlays, render.width, render.height);
        (preview + overlays).max(bands)
    }
}
