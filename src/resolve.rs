//! Turns a [`Manifest`] and a [`Survey`] of the particles into a [`Setup`]: every "auto" gets its value.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use spherule_formats::native::Access;

use crate::accel::{BvhSettings, SbvhSettings};
use crate::manifest::{IndirectSetting, Manifest, RadiusSetting, Side, nearest};
use crate::metrics::memory::available;
use crate::output::{ExrOptions, PlaneNames, PreviewBackground, PreviewOptions, PreviewPage};
use crate::overlay::{Page, RgbaPixels};
use crate::pipeline::{
    FrameSize, MemoryModel, Picture, RadiusRule, RunSettings, Setup, attribute_list,
};
use crate::render::{IndirectLight, IntegratorKind, PixelFilter, RenderSettings};
use crate::scene::{
    Background, Bounds, Camera, CameraError, PathError, RadianceMap, Scene, default_lights,
};
use crate::selection::Selection;
use crate::surface::SurfaceKind;
use crate::survey::{Question, RadiusQuestion, SurfaceQuestion, Survey};

mod arrows;
mod bonds;
mod camera;
mod cell;
mod channels;
mod color;
mod denoise;
mod environment;
mod ground;
#[cfg(test)]
mod lattice_tests;
mod lights;
mod meshes;
mod opacity;
mod overlay;
mod parts;
mod rods;
mod select;
mod shutter;
mod surface;

pub use camera::{check_views, with_framed_meshes};
use ground::Floor;
pub use ground::add_ground_image;
pub use meshes::{add_meshes, mesh_settings};
pub use overlay::color_bar_of;

/// Minimum radius as a fraction of the diagonal of the bounds; smaller ones would be invisible in f32.
const MIN_RADIUS: f64 = 1e-6;

/// Reasons why there can be no images.
#[derive(Debug, thiserror::Error)]
pub enum ResolveError {
    /// This version does not support a value.
    #[error("{key}: {what}")]
    Unsupported {
        /// The manifest's key.
        key: &'static str,
        /// The problem and its remedy.
        what: String,
    },
    /// No frame has the requested attribute.
    #[error("{key}: no attribute `{name}` in the sampled frames{hint}; available: {has}")]
    MissingAttribute {
        /// The manifest's key.
        key: &'static str,
        /// Name of the attribute.
        name: String,
        /// A similar name, if there is one.
        hint: String,
        /// The existing attributes.
        has: String,
    },
    /// No frame has a value that a selection needs.
    #[error(
        "select.where: character {column}: no value `{name}` in the sampled frames{hint}; available: {has}"
    )]
    UnknownName {
        /// The name in the condition.
        name: String,
        /// Its place in the condition, in characters from 1.
        column: usize,
        /// A similar name, if there is one.
        hint: String,
        /// The existing values.
        has: String,
    },
    /// No frame has a text that a selection compares a value with.
    #[error("select.where: character {column}: {what}")]
    UnknownText {
        /// Its place in the condition, in characters from 1.
        column: usize,
        /// The text, and those that there are.
        what: String,
    },
    /// There is no radius in the frames, and no estimate from the spacing of particles.
    #[error(
        "input.radius: the frames contain no radius, and it cannot be estimated from so few, coincident or \
         distant particles"
    )]
    NoRadius,
    /// The radius is too small: squares of lengths would underflow.
    #[error(
        "input.radius: {0:e} is too small to trace in single precision, whose squares end at 1e-38; \
         write the particles in a smaller unit of length"
    )]
    TinyRadius(f32),
    /// The image does not fit into memory.
    #[error(
        "image.width, image.height: an image of {width}x{height} needs about {need} MiB, \
         {available} MiB of memory are free; make it smaller or ask for fewer channels"
    )]
    ImageTooLarge {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Memory for its planes and encoding.
        need: u64,
        /// Available memory.
        available: u64,
    },
    /// The camera is invalid.
    #[error("camera: {0}")]
    Camera(#[from] CameraError),
    /// The keys do not define a path.
    #[error("camera.key: {0}")]
    Path(#[from] PathError),
    /// The camera is invalid at some frame.
    #[error("{place}: {source}")]
    View {
        /// Key and frame.
        place: String,
        /// The error.
        source: CameraError,
    },
}

/// What the survey has to determine. `selection` is that of the manifest.
pub fn question<'a>(manifest: &'a Manifest, selection: &'a Selection) -> Question<'a> {
    Question {
        color: color::question(&manifest.material.color),
        radius: match &manifest.input.radius {
            RadiusSetting::Auto if manifest.surface.kind != SurfaceKind::Spheres => {
                RadiusQuestion::AutoOfBody
            }
            RadiusSetting::Auto => RadiusQuestion::Auto,
            RadiusSetting::Length(_) => RadiusQuestion::Given,
            RadiusSetting::Attribute { attribute, scale } => {
                RadiusQuestion::Attribute(attribute, *scale)
            }
            RadiusSetting::Table { attribute, table, scale } => {
                RadiusQuestion::Table(attribute, table, *scale)
            }
        },
        up: manifest.input.up.map(|up| DVec3::from_array(up.vector())),
        selection: Some(selection).filter(|s| !s.is_all() || !s.cuts.is_empty()),
        points: color::is_depth(&manifest.material.color) || overlay::needs_points(manifest),
        fit: camera::fit(manifest),
        framed: None,
        surface: surface_question(manifest),
    }
}

/// What the survey has to determine about the surface, for predictions of memory. Invalid settings are reported by
/// [`setup`].
fn surface_question(manifest: &Manifest) -> Option<SurfaceQuestion> {
    let settings = surface::settings(manifest).ok()?;
    let radius = match manifest.input.radius {
        RadiusSetting::Length(radius) => Some(narrow(radius)),
        _ => None,
    };
    let is_needed = settings.spray || settings.kind == SurfaceKind::Smooth;
    is_needed.then_some(SurfaceQuestion { settings, radius })
}

/// Whether [`setup`] needs the image of `environment.image`.
pub fn needs_environment_image(manifest: &Manifest) -> bool {
    environment::needs_image(manifest)
}

/// Pictures that settings name.
#[derive(Debug, Clone, Copy, Default)]
pub struct SceneImages<'a> {
    /// The image of the environment, if it [is needed](needs_environment_image).
    pub environment: Option<&'a RadianceMap>,
    /// Those of overlays of the type image, in their order.
    pub overlays: &'a [Arc<RgbaPixels>],
}

/// Determines everything about the images of a job. [`add_meshes`] adds meshes.
///
/// # Errors
/// See [`ResolveError`]; the messages name the manifest's keys.
pub fn setup(
    manifest: &Manifest,
    survey: &Survey,
    images: &SceneImages<'_>,
) -> Result<Setup, ResolveError> {
    let mut setup = setup_on(manifest, survey, images, None)?;
    if manifest.has_strips() && !setup.picture.overlays.is_empty() {
        // What the overlays show decides how much room they need
        let page = overlay::page(&setup, manifest, survey)?;
        let mut smaller = manifest.clone();
        let [width, height] = page.picture.map(Side::Pixels);
        (smaller.image.width, smaller.image.height) = (width, height);
        setup = setup_on(&smaller, survey, images, Some(page))?;
    }
    check_image_size(&setup)?;
    Ok(setup)
}

/// The same for a picture that fills its image, or for one on a `page`, whose size the manifest then has.
fn setup_on(
    manifest: &Manifest,
    survey: &Survey,
    images: &SceneImages<'_>,
    page: Option<Page>,
) -> Result<Setup, ResolveError> {
    // Determine surface, radius and colours
    let surface = surface::settings(manifest)?;
    let radius = radius_rule(manifest, survey)?;
    check_radius(&radius)?;
    let up = up(manifest, survey);
    // Spheres reach beyond their centres.
    let reach = DVec3::splat(f64::from(reach(&radius, survey)));
    let bounds = Bounds { min: survey.min - reach, max: survey.max + reach };
    // Place the camera
    let image = &manifest.image;
    let [width, height] = image.size();
    let aspect = f64::from(width) / f64::from(height);
    let framed = camera::framed(manifest, survey, &bounds, reach.x);
    let (path, projection) = camera::path(manifest, &framed, up, aspect)?;
    let stereo = camera::stereo(manifest);
    let camera = camera::at_start(&path, |view| {
        let camera = Camera::projected(view, projection, aspect, survey.origin)?;
        let stereo = stereo.map(|stereo| stereo.stereo(view)).transpose()?;
        Ok(camera.with_stereo(stereo))
    })?;
    let color = color::rule(manifest, survey, Some(&camera))?;
    let lens = camera::lens(manifest, &path, aspect)?;
    let shutter = shutter::shutter(manifest, survey)?;
    // Set up lights and ground
    let environment = environment::environment(manifest, images.environment, &path.start(), up)?;
    let mut lights = match (manifest.lights.is_empty(), manifest.integrator()) {
        (false, _) => lights::lights(manifest, survey.origin, up)?,
        (true, IntegratorKind::Whitted) => default_lights(&bounds, up, &path.start()),
        // The environment is the light
        (true, IntegratorKind::Path) => Vec::new(),
    };
    lights.extend(environment::sun(manifest, &path.start(), up));
    let floor = Floor {
        bounds: &bounds,
        reach: reach.x,
        up,
        origin: survey.origin,
        has_layer: survey.rests_on_floor(up),
        is_of_earlier_version: survey.standing.is_none(),
        lowest: survey.lowest,
    };
    let ground = ground::ground(manifest, &floor)?;
    let wet_ground = ground::wet_ground(manifest, &floor);
    let mut scene = Scene {
        origin: survey.origin,
        camera,
        lights,
        ambient_light: crate::scene::DEFAULT_AMBIENT_LIGHT,
        material: surface::material(manifest, &bounds),
        parts: parts::parts(manifest, survey)?,
        background: background(manifest, up.as_vec3()),
        ground,
        wet_ground,
        meshes: meshes::materials(manifest),
        particles: [bounds.min, bounds.max].map(|corner| (corner - survey.origin).as_vec3()),
        is_spray_soft: manifest.draws_soft_spray(),
        environment,
        is_environment_visible: manifest.environment.visible,
        environment_group: lights::group_index(manifest, manifest.environment.group.as_ref()),
        next_frame: None,
        exposure: None,
    };
    // Collect the settings of the images
    let output = &manifest.output;
    let (channels, attributes) = channels::channels(manifest, survey)?;
    let step = channels::frame_step(&channels, output, survey)?;
    // Manifests that were not read from a file are not checked
    let whole = manifest.picture();
    let [width, height] = whole.data_size().ok_or_else(|| ResolveError::Unsupported {
        key: "image.crop",
        what: "the part of the image is empty or too large".to_owned(),
    })?;
    let window = whole.part().map(|_| whole.data_window());
    let mut render = RenderSettings::new(width, height);
    render.window = window;
    render.samples = image.samples;
    render.filter = PixelFilter {
        kind: image.filter,
        width: image.filter_width.unwrap_or_else(|| image.filter.default_width()),
    };
    render.integrator = manifest.integrator();
    render.bounces = manifest.render.bounces;
    render.indirect = match manifest.render.indirect {
        IndirectSetting::Traced => IndirectLight::Traced,
        IndirectSetting::Ambient => IndirectLight::Ambient { radius: narrow(reach.x) },
    };
    render.photons = manifest.render.caustics.photons;
    render.max_depth = manifest.render.max_depth;
    render.min_weight = manifest.render.min_weight;
    render.channels = channels;
    render.transparent_background = output.transparent;
    let denoise = denoise::settings(manifest, &scene.material)?;
    render.has_features = denoise.is_some();
    // The materials of rods follow those of the meshes
    let cell = cell::add_cell(&mut scene, manifest, survey);
    let arrows = arrows::arrows(&mut scene, manifest, survey, &color, reach.x)?;
    let trails = arrows::trails(&mut scene, manifest, survey, &color, reach.x)?;
    let bonds = bonds::bonds(&mut scene, manifest, survey, &color, reach.x)?;
    let picture = Picture {
        origin: survey.origin,
        least_radius: narrow(bounds.diagonal() * MIN_RADIUS).max(f32::MIN_POSITIVE),
        selection: select::selection(manifest, survey)?,
        cut: select::cut(manifest, survey)?,
        radius,
        color,
        opacity: opacity::opacity(manifest, survey, scene.material.transmission > 0.0)?,
        up,
        path,
        projection,
        stereo,
        unframed: camera::unframed(manifest, survey),
        lens,
        shutter,
        aspect,
        scene,
        meshes: Vec::new(),
        cell,
        arrows,
        trails,
        bonds,
        renderer: crate::render::RendererKind::default(),
        render,
        denoise,
        surface,
        exr: ExrOptions {
            names: PlaneNames {
                attributes: channels::attribute_planes(&attributes),
                light_groups: manifest.light_groups().into_iter().map(str::to_owned).collect(),
            },
            compression: output.compression,
            data_compression: output.data_compression,
            window,
            frames_per_second: output.fps.map(fps),
            dpi: image.dpi,
            is_panorama: projection.is_panorama() && stereo.is_none(),
            world_to_camera: None,
            comments: Some(if projection.is_panorama() {
                COMMENTS.replace("along the view axis", "from the eye")
            } else {
                COMMENTS.to_owned()
            }),
            custom: None,
            texts: Vec::new(),
        },
        attributes,
        step,
        overlays: Vec::new(),
        overlay_values: Vec::new(),
        preview: PreviewOptions {
            exposure: output.preview_exposure,
            background: if output.transparent {
                PreviewBackground::Transparent
            } else {
                PreviewBackground::Included
            },
            first_pixel: window.map_or([0, 0], |window| [window.left, window.top]),
            dpi: image.dpi,
            page: None,
        },
        has_opaque_previews: manifest.has_opaque_previews && output.transparent,
    };
    // Collect the settings of the run
    let run = RunSettings {
        memory_limit: manifest.render.memory_limit.map(|limit| limit.0),
        accelerator: manifest.render.accelerator,
        bvh: BvhSettings { preset: manifest.render.bvh_preset, leaves: manifest.render.bvh_leaves },
        sbvh: SbvhSettings {
            alpha: manifest.render.sbvh_alpha,
            budget: manifest.render.sbvh_budget,
        },
        access: if manifest.input.mmap { Access::Map } else { Access::Read },
        verify: manifest.input.verify,
        weight: survey.weight,
        surfaces: survey.surfaces.clone(),
    };
    let mut setup = Setup { picture, run };
    let [columns, rows] = camera.eyes();
    let render = &setup.picture.render;
    let whole = Page::whole(render.width / columns, render.height / rows);
    overlay::add_overlays(&mut setup, manifest, survey, &page.unwrap_or(whole), images.overlays)?;
    setup.picture.preview.page =
        page.map(|page| PreviewPage { page, paper: overlay::paper(&setup) });
    Ok(setup)
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

/// Metadata that explain the channels of an image.
const COMMENTS: &str = "linear RGB premultiplied by A; A is coverage by particles and ground; \
Z is the distance along the view axis (infinite where nothing is hit); N is the world-space \
normal; id.I is the particle's id, 4294967295 where there is none; Z, N and id come from the \
nearest of a pixel's samples";

#[expect(clippy::cast_possible_truncation, reason = "the renderer works in f32")]
fn narrow(value: f64) -> f32 {
    value as f32
}

fn up(manifest: &Manifest, survey: &Survey) -> DVec3 {
    let axis = manifest.input.up.map(|up| DVec3::from_array(up.vector()));
    axis.unwrap_or(survey.up)
}

fn radius_rule(manifest: &Manifest, survey: &Survey) -> Result<RadiusRule, ResolveError> {
    Ok(match &manifest.input.radius {
        RadiusSetting::Length(radius) => RadiusRule::Common(narrow(*radius)),
        RadiusSetting::Attribute { attribute, scale } => {
            require_attribute(survey, "input.radius", attribute)?;
            RadiusRule::Attribute { name: attribute.clone(), scale: narrow(*scale) }
        }
        RadiusSetting::Table { attribute, table, scale } => {
            require_attribute(survey, "input.radius", attribute)?;
            RadiusRule::Table {
                name: attribute.clone(),
                table: table.clone(),
                scale: scale * survey.unit_of(table),
            }
        }
        RadiusSetting::Auto => match surface::radius(manifest.surface.kind, survey) {
            Some(radius) => RadiusRule::FileOr(radius),
            // All frames contain radii, or there are no particles.
            None if survey.has_radii || survey.most_particles == 0 => RadiusRule::FileOr(0.0),
            None => return Err(ResolveError::NoRadius),
        },
    })
}

/// Minimum radius: its square, and the squares of slightly smaller distances, do not underflow in f32.
const TRACEABLE_RADIUS: f32 = 1e-16;

fn check_radius(rule: &RadiusRule) -> Result<(), ResolveError> {
    match rule {
        RadiusRule::Common(radius) | RadiusRule::FileOr(radius)
            if *radius > 0.0 && *radius < TRACEABLE_RADIUS =>
        {
            Err(ResolveError::TinyRadius(*radius))
        }
        _ => Ok(()),
    }
}

/// Extent of the spheres beyond their centres.
fn reach(rule: &RadiusRule, survey: &Survey) -> f32 {
    match rule {
        RadiusRule::Common(radius) => *radius,
        RadiusRule::FileOr(radius) => radius.max(survey.reach),
        RadiusRule::Attribute { .. } | RadiusRule::Table { .. } => survey.reach,
    }
}

fn require_attribute(survey: &Survey, key: &'static str, name: &str) -> Result<(), ResolveError> {
    let known = |a: &String| a.eq_ignore_ascii_case(name);
    if survey.most_particles == 0 || survey.attributes.iter().any(known) {
        return Ok(());
    }
    Err(ResolveError::MissingAttribute {
        key,
        name: name.to_owned(),
        hint: similar(name, &survey.attributes),
        has: attribute_list(survey.attributes.iter().map(String::as_str)),
    })
}

/// A question about the attribute that was probably meant.
fn similar(name: &str, attributes: &[String]) -> String {
    let known: Vec<&str> = attributes.iter().map(String::as_str).collect();
    nearest(name, &known).map_or_else(String::new, |found| format!(" (did you mean `{found}`?)"))
}

fn background(manifest: &Manifest, up: Vec3) -> Background {
    match (manifest.render.background, manifest.integrator()) {
        (Some(background), _) => background.with_up(up),
        (None, IntegratorKind::Path) => Background::Studio { up },
        (None, IntegratorKind::Whitted) => Background::default_for(up),
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
