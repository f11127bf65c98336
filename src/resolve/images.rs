//! Settings of images and their files, and those of the run.

use crate::math::narrow;
use spherule_formats::native::Access;

use super::{Extent, ResolveError, channels};
use crate::accel::{BvhSettings, SbvhSettings};
use crate::manifest::{IndirectSetting, Manifest};
use crate::output::view::DisplayView;
use crate::output::{ExrOptions, PlaneNames, PreviewBackground, PreviewOptions};
use crate::pipeline::{AttributeChannel, RunSettings};
use crate::render::{Drawing, IndirectLight, PixelFilter, RenderSettings};
use crate::scene::Projection;
use crate::survey::Survey;

/// Metadata that explain the channels of an image.
const COMMENTS: &str = "linear RGB premultiplied by A; A is coverage by particles and ground; \
Z is the distance along the view axis (infinite where nothing is hit); N is the world-space \
normal; id.I is the particle's id, 4294967295 where there is none; Z, N and id come from the \
nearest of a pixel's samples";

/// Size, samples and depth of the images, without their channels.
///
/// # Errors
/// Nothing of the image is left.
pub(super) fn render_settings(
    manifest: &Manifest,
    extent: &Extent,
) -> Result<RenderSettings, ResolveError> {
    let (image, render) = (&manifest.image, &manifest.render);
    // Manifests that were not read from a file are not checked
    let whole = manifest.picture();
    let [width, height] = whole.data_size().ok_or_else(|| ResolveError::Unsupported {
        key: "image.crop",
        what: "the part of the image is empty or too large".to_owned(),
    })?;
    // Collect the rest, as the manifest gives it
    Ok(RenderSettings {
        window: whole.part().map(|_| whole.data_window()),
        samples: image.samples,
        noise: manifest.noise_limit(),
        seed: render.seed,
        filter: PixelFilter {
            kind: image.filter,
            width: image.filter_width.unwrap_or_else(|| image.filter.default_width()),
        },
        integrator: manifest.integrator(),
        bounces: render.bounces,
        clamp: render.clamp,
        indirect: match render.indirect {
            IndirectSetting::Traced => IndirectLight::Traced,
            IndirectSetting::Ambient => IndirectLight::Ambient { radius: narrow(extent.reach) },
        },
        photons: render.caustics.photons,
        max_depth: render.max_depth,
        min_weight: render.min_weight,
        transparent_background: manifest.output.transparent,
        drawing: Drawing { outline: render.outline, depth_cue: render.depth_cue },
        ..RenderSettings::new(width, height)
    })
}

/// Options of the EXR.
pub(super) fn exr_options(
    manifest: &Manifest,
    attributes: &[AttributeChannel],
    render: &RenderSettings,
    projection: Projection,
) -> ExrOptions {
    let output = &manifest.output;
    ExrOptions {
        // The names of channels follow from attributes and lights
        names: PlaneNames {
            attributes: channels::attribute_planes(attributes),
            light_groups: manifest.light_groups().into_iter().map(str::to_owned).collect(),
        },
        compression: output.compression,
        data_compression: output.data_compression,
        window: render.window,
        frames_per_second: output.fps.map(fps),
        dpi: manifest.image.dpi,
        is_panorama: projection.is_panorama() && !manifest.camera.stereo,
        world_to_camera: None,
        world_to_ndc: None,
        screen_window_width: None,
        field_of_view: None,
        far_depth: output.far_depth,
        comments: Some(comments(output.far_depth, projection)),
        custom: None,
        texts: Vec::new(),
    }
}

/// The text that explains the channels.
fn comments(far_depth: Option<f32>, projection: Projection) -> String {
    let mut text = COMMENTS.to_owned();
    if projection.is_panorama() {
        text = text.replace("along the view axis", "from the eye");
    }
    if let Some(far) = far_depth {
        text = text.replace("infinite where", &format!("{far:e} where"));
    }
    text
}

/// Options of the PNG.
pub(super) fn preview_options(manifest: &Manifest, render: &RenderSettings) -> PreviewOptions {
    let output = &manifest.output;
    PreviewOptions {
        view: DisplayView { exposure: output.preview_exposure, transform: output.view_transform },
        background: if output.transparent {
            PreviewBackground::Transparent
        } else {
            PreviewBackground::Included
        },
        first_pixel: render.window.map_or([0, 0], |window| [window.left, window.top]),
        dpi: manifest.image.dpi,
        page: None,
    }
}

/// Settings that images do not depend on.
pub(super) fn run_settings(manifest: &Manifest, survey: &Survey) -> RunSettings {
    let render = &manifest.render;
    RunSettings {
        memory_limit: render.memory_limit.map(|limit| limit.0),
        accelerator: render.accelerator,
        bvh: BvhSettings { preset: render.bvh_preset, leaves: render.bvh_leaves },
        sbvh: SbvhSettings { alpha: render.sbvh_alpha, budget: render.sbvh_budget },
        access: if manifest.input.mmap { Access::Map } else { Access::Read },
        verify: manifest.input.verify,
        weight: survey.weight,
        surfaces: survey.surfaces.clone(),
        why_cpu: None,
    }
}

/// A rate as a fraction: 24 as 24/1, 29.97 as 29970/1000.
#[expect(clippy::cast_possible_truncation, reason = "clamped to what the attribute holds")]
fn fps(rate: f64) -> (i32, u32) {
    let whole = rate.round();
    if (rate - whole).abs() < 1e-9 {
        ((whole.min(1e9)) as i32, 1)
    } else {
        (((rate * 1000.0).round().min(2e9)) as i32, 1000)
    }
}
