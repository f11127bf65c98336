//! Turns a [`Manifest`] and a [`Survey`] of the particles into a [`Setup`]: every "auto" gets its value.

use crate::math::narrow;
use std::sync::{Arc, OnceLock};

use glam::DVec3;
use spherule_files::memory::available;

use crate::manifest::{Manifest, Side, StyledManifest};
use crate::output::PreviewPage;
use crate::overlay::{Page, RgbaPixels};
use crate::pipeline::{
    FileSettings, FrameSize, GrainMeshes, MemoryModel, ParticleRules, Picture, PictureMesh,
    RadiusRule, Setup, Things, gpu,
};
use crate::render::{RenderSettings, RendererKind};
use crate::scene::{Bounds, Texture};
use crate::selection::Division;
use crate::survey::Survey;

mod arrows;
mod bonds;
mod camera;
mod cell;
mod channels;
mod color;
mod denoise;
mod environment;
mod error;
mod ground;
mod images;
#[cfg(test)]
mod lattice_tests;
mod lights;
mod meshes;
mod mist;
mod opacity;
mod overlay;
mod question;
mod radius;
mod rods;
mod scene;
mod select;
mod shutter;
mod styles;
mod surface;
mod whitewater;

pub use camera::check_views;
pub use environment::{EnvironmentMap, KeptEnvironment};
pub use error::ResolveError;
use error::require_attribute;
pub use meshes::mesh_settings;
pub use overlay::color_bar_of;
pub use question::Inquiry;

/// Minimum radius as a fraction of the diagonal of the bounds; smaller ones would be invisible in f32.
const MIN_RADIUS: f64 = 1e-6;

/// Pictures and meshes that settings name.
#[derive(Debug, Clone, Default)]
pub struct SceneInputs<'a> {
    /// The image of the environment, if that is one.
    pub environment: Option<&'a EnvironmentMap>,
    /// Where the environment is kept that was made with these settings, whatever the view.
    pub kept: Option<&'a OnceLock<KeptEnvironment>>,
    /// Those of overlays of the type image, in their order.
    pub overlays: &'a [Arc<RgbaPixels>],
    /// The picture on the ground.
    pub ground: Option<&'a Arc<Texture>>,
    /// The meshes, one for each of the manifest.
    pub meshes: Vec<PictureMesh>,
    /// Those of grains.
    pub grain_meshes: GrainMeshes,
}

/// Determines everything about the images of a job.
///
/// # Errors
/// See [`ResolveError`]; the messages name the manifest's keys.
pub fn setup(
    manifest: &Manifest,
    survey: &Survey,
    inputs: SceneInputs<'_>,
) -> Result<Setup, ResolveError> {
    manifest.check_rules()?;
    // The environment is made once, also if the picture gets smaller
    let own = OnceLock::new();
    let inputs = SceneInputs { kept: inputs.kept.or(Some(&own)), ..inputs };
    let survey = camera::with_framed_meshes(survey, manifest, &inputs.meshes);
    let styled = manifest.styled();
    let manifest = &styled.manifest;
    let mut setup = setup_on(manifest, &styled, &survey, &inputs, None)?;
    let placed = overlay::placed(manifest, &survey, &mut setup);
    let manifest = placed.as_ref();
    if manifest.has_strips() && !setup.picture.files.overlays.is_empty() {
        // What the overlays show decides how much room they need
        let page = overlay::page(&setup, manifest, &survey)?;
        let mut smaller = manifest.clone();
        let [width, height] = page.picture.map(Side::Pixels);
        (smaller.image.width, smaller.image.height) = (width, height);
        setup = setup_on(&smaller, &styled, &survey, &inputs, Some(page))?;
    }
    check_image_size(&setup)?;
    check_device(&setup)?;
    if let Some(texture) = inputs.ground {
        ground::add_image(&mut setup, manifest, texture);
    }
    Ok(setup)
}

/// Where the particles are.
struct Extent {
    /// The up direction, unit vector.
    up: DVec3,
    /// Bounds of the spheres.
    bounds: Bounds,
    /// Extent of the spheres beyond their centres.
    reach: f64,
}

impl Extent {
    fn of(manifest: &Manifest, survey: &Survey, radius: &RadiusRule) -> Self {
        let reach = f64::from(radius::reach(radius, survey));
        let bounds = Bounds { min: survey.min - reach, max: survey.max + reach };
        Self { up: up(manifest, survey), bounds, reach }
    }
}

/// The up direction, unit vector.
fn up(manifest: &Manifest, survey: &Survey) -> DVec3 {
    let axis = manifest.input.up.map(|up| DVec3::from_array(up.vector()));
    axis.unwrap_or(survey.up)
}

/// The setup without ground image and meshes, for a picture that fills its image, or for one on a `page`, whose size the
/// manifest then has.
fn setup_on(
    manifest: &Manifest,
    styled: &StyledManifest,
    survey: &Survey,
    inputs: &SceneInputs<'_>,
    page: Option<Page>,
) -> Result<Setup, ResolveError> {
    // Place the camera around the spheres
    let radius = radius::rule(&manifest.input.radius, manifest.surface.kind, survey)?;
    let extent = Extent::of(manifest, survey, &radius);
    let placed = camera::placed(manifest, survey, &extent)?;
    let range = survey.color.as_ref();
    let color = color::rule(&manifest.material.color, range, survey, Some(&placed.camera))?;
    // Set up what it sees; things are numbered in the order in which their materials are added
    let mut scene = scene::scene(manifest, survey, inputs, &placed, &extent)?;
    let meshes = meshes::things(&mut scene, manifest, &inputs.meshes);
    let cell = cell::add_cell(&mut scene, manifest, survey);
    let place = (survey, &color, extent.reach);
    let mut arrows = arrows::arrows(&mut scene, &manifest.arrows, place)?;
    let mut trails = arrows::trails(&mut scene, &manifest.trails, place)?;
    let bonds = bonds::bonds(&mut scene, manifest, survey, &color, extent.reach)?;
    let first = styles::first(manifest, survey, (radius, color, bonds))?;
    let looks = styles::Looks {
        manifest: &styled.usual,
        first: &first,
        first_shares: styled.first_shares,
        survey,
        camera: &placed.camera,
        meshes: &inputs.grain_meshes,
        reach: extent.reach,
        bounds: extent.bounds,
        priority: u8::from(!styled.has_first),
    };
    let others = looks.styles(&mut scene, &styled.styles, (&mut arrows, &mut trails))?;
    // Collect the settings of the images
    let (channels, attributes) = channels::channels(manifest, survey)?;
    let denoise = denoise::settings(manifest, scene.particle_material());
    let render = RenderSettings {
        channels,
        has_features: denoise.is_some(),
        ..images::render_settings(manifest, &extent)?
    };
    // Put it all together, without overlays
    let picture = Picture {
        origin: survey.origin,
        particles: ParticleRules {
            selection: select::selection(manifest, survey)?,
            cut: select::cut(manifest, survey)?,
            least_radius: narrow(extent.bounds.diagonal() * MIN_RADIUS).max(f32::MIN_POSITIVE),
            division: Division { up: Some(extent.up), ..styled.division.clone() },
            styles: std::iter::once(first).chain(others).collect(),
        },
        files: FileSettings {
            exr: images::exr_options(manifest, &attributes, &render, placed.view.projection),
            attributes,
            overlays: Vec::new(),
            overlay_entries: Vec::new(),
            overlay_values: Vec::new(),
            preview: images::preview_options(manifest, &render),
            has_opaque_previews: manifest.has_opaque_previews && manifest.output.transparent,
        },
        view: placed.view,
        scene,
        things: Things { meshes, cell, arrows, trails },
        surface: whitewater::with_speed(manifest, survey, extent.up)?,
        renderer: manifest.render.device.renderer(),
        step: channels::frame_step(&render.channels, &manifest.output, survey)?,
        render,
        denoise,
    };
    let mut setup = Setup { picture, run: images::run_settings(manifest, survey) };
    meshes::lower_ground(&mut setup, manifest, survey);
    add_overlays(&mut setup, manifest, survey, inputs, page)?;
    Ok(setup)
}

/// Adds the overlays of a picture that fills its image, or is on a `page`.
fn add_overlays(
    setup: &mut Setup,
    manifest: &Manifest,
    survey: &Survey,
    inputs: &SceneInputs<'_>,
    page: Option<Page>,
) -> Result<(), ResolveError> {
    let [columns, rows] = setup.picture.scene.camera.eyes();
    let render = &setup.picture.render;
    let whole = Page::whole(render.width / columns, render.height / rows);
    overlay::add_overlays(setup, manifest, survey, &page.unwrap_or(whole), inputs.overlays)?;
    setup.picture.files.preview.page =
        page.map(|page| PreviewPage { page, paper: overlay::paper(setup) });
    Ok(())
}

/// Rejects settings that the renderer lacks.
fn check_device(setup: &Setup) -> Result<(), ResolveError> {
    match setup.picture.renderer {
        RendererKind::Cpu => Ok(()),
        RendererKind::Gpu => match gpu::lacking(setup) {
            None => Ok(()),
            Some(("render.device", what)) => {
                Err(ResolveError::Unsupported { key: "render.device", what })
            }
            Some((key, what)) => Err(ResolveError::Unsupported {
                key,
                what: format!("{what} cannot be rendered on a GPU yet; use device = \"cpu\""),
            }),
        },
    }
}

/// Rejects images that cannot fit into memory, whatever the particles.
fn check_image_size(setup: &Setup) -> Result<(), ResolveError> {
    let need = MemoryModel::new(setup).alone(&FrameSize::default()).total();
    match available() {
        Some(available) if need > available => Err(ResolveError::ImageTooLarge {
            width: setup.picture.render.width,
            height: setup.picture.render.height,
            need: need >> 20,
            available: available >> 20,
        }),
        _ => Ok(()),
    }
}
