//! Turns a [`Manifest`] and a [`Survey`] of the particles into a [`Setup`]: every "auto" gets its value.

use glam::{DVec3, Vec3};
use spherule_formats::native::Access;

use crate::accel::{BvhSettings, SbvhSettings};
use crate::manifest::{
    ColorSetting, DEFAULT_MAP, GroundPattern, LightKind, Manifest, MapName, RadiusSetting,
};
use crate::metrics::memory::available;
use crate::output::{ExrOptions, PreviewOptions};
use crate::pipeline::{
    ColorRule, FrameSize, MemoryModel, Picture, RadiusRule, RunSettings, Setup, attribute_list,
};
use crate::render::{Channels, RenderSettings};
use crate::scene::{
    Background, Bounds, CameraError, Checker, ColorMap, Ground, Light, PathError, Scene,
    default_lights, material,
};
use crate::surface::SurfaceKind;
use crate::survey::{ColorQuestion, Question, RadiusQuestion, Survey};

mod camera;
mod surface;

pub use camera::check_views;

/// Minimum radius as a fraction of the diagonal of the bounds; smaller ones would be invisible in f32.
const LEAST_RADIUS: f64 = 1e-6;

/// Default edge of a square on the ground as a fraction of the diagonal of the bounds: some squares can be counted
/// through the particles, and none is only a few pixels wide.
const TILE: f64 = 1.0 / 8.0;

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
    #[error("{key}: no attribute `{name}` in any frame looked at; there are {has}")]
    MissingAttribute {
        /// The manifest's key.
        key: &'static str,
        /// Name of the attribute.
        name: String,
        /// The existing attributes.
        has: String,
    },
    /// There is no radius in the frames, and no estimate from the spacing of particles.
    #[error(
        "input.radius: the frames bring none, and particles that are few, in one place or far apart \
         do not tell it"
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

/// What the survey has to determine.
pub fn question(manifest: &Manifest) -> Question<'_> {
    Question {
        color: match &manifest.material.color {
            ColorSetting::Auto | ColorSetting::AutoWith { .. } => ColorQuestion::Speed,
            ColorSetting::Rgb(_) => ColorQuestion::None,
            ColorSetting::Attribute { attribute, .. } => ColorQuestion::Attribute(attribute),
        },
        radius: match &manifest.input.radius {
            RadiusSetting::Auto if manifest.surface.kind != SurfaceKind::Spheres => {
                RadiusQuestion::AutoOfBody
            }
            RadiusSetting::Auto => RadiusQuestion::Auto,
            RadiusSetting::Length(_) => RadiusQuestion::None,
            RadiusSetting::Attribute { attribute, scale } => {
                RadiusQuestion::Attribute(attribute, *scale)
            }
        },
    }
}

/// Determines everything about the images of a job.
///
/// # Errors
/// See [`ResolveError`]; the messages name the manifest's keys.
pub fn setup(manifest: &Manifest, survey: &Survey) -> Result<Setup, ResolveError> {
    // Determine surface, radius and colours
    let surface = surface::settings(manifest)?;
    let radius = radius_rule(manifest, survey)?;
    check_radius(&radius)?;
    let color = color_rule(manifest, survey)?;
    let up = up(manifest, survey);
    // Spheres reach beyond their centres.
    let reach = DVec3::splat(f64::from(reach(&radius, survey)));
    let bounds = Bounds {
        min: survey.min - reach,
        max: survey.max + reach,
    };
    // Place the camera
    let image = &manifest.image;
    let aspect = f64::from(image.width) / f64::from(image.height);
    let path = camera::path(manifest, &bounds, up, aspect)?;
    let camera = camera::at_start(&path, aspect, survey.origin)?;
    // Set up lights and ground
    let lights = if manifest.lights.is_empty() {
        default_lights(&bounds, up, &path.start())
    } else {
        lights(manifest, survey.origin)
    };
    let mut ground = ground(manifest, &bounds, up, survey.origin);
    if surface.kind != SurfaceKind::Spheres
        && manifest.render.ground_height.is_none()
        && let Some(ground) = &mut ground
    {
        // Raise it to the lowest centres: between a body that only touched the ground and the ground itself would be
        // a thin layer of air, which reflects all light at grazing angles.
        ground.raise(narrow(reach.x));
    }
    let scene = Scene {
        origin: survey.origin,
        camera,
        lights,
        ambient_light: crate::scene::DEFAULT_AMBIENT_LIGHT,
        material: surface::material(manifest, &bounds),
        background: background(manifest, up.as_vec3()),
        ground,
    };
    // Collect the settings of the images
    let output = &manifest.output;
    let channels = Channels::from_names(output.channels.iter().map(|c| c.name())).map_err(|e| {
        ResolveError::Unsupported {
            key: "output.channels",
            what: e.to_string(),
        }
    })?;
    let mut render = RenderSettings::new(image.width, image.height);
    render.samples = image.samples;
    render.max_depth = manifest.render.max_depth;
    render.min_weight = manifest.render.min_weight;
    render.channels = channels;
    render.transparent_background = output.transparent;
    let picture = Picture {
        origin: survey.origin,
        least_radius: narrow(bounds.diagonal() * LEAST_RADIUS).max(f32::MIN_POSITIVE),
        radius,
        color,
        path,
        aspect,
        scene,
        renderer: crate::render::RendererKind::default(),
        render,
        surface,
        exr: ExrOptions {
            compression: output.compression,
            frames_per_second: output.fps.map(fps),
            world_to_camera: None,
            comments: Some(COMMENTS.to_owned()),
            custom: None,
        },
        preview: PreviewOptions {
            exposure: output.preview_exposure,
            backdrop: None,
        },
    };
    // Collect the settings of the run
    let run = RunSettings {
        memory_limit: manifest.render.memory_limit.map(|limit| limit.0),
        accelerator: manifest.render.accelerator,
        bvh: BvhSettings {
            preset: manifest.render.bvh_preset,
            leaves: manifest.render.bvh_leaves,
        },
        sbvh: SbvhSettings {
            alpha: manifest.render.sbvh_alpha,
            budget: manifest.render.sbvh_budget,
        },
        access: match manifest.input.mmap {
            true => Access::Map,
            false => Access::Read,
        },
        verify: manifest.input.verify,
        weight: survey.weight,
    };
    let setup = Setup { picture, run };
    check_image_size(&setup)?;
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
            RadiusRule::Attribute {
                name: attribute.clone(),
                scale: narrow(*scale),
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
        RadiusRule::Attribute { .. } => survey.reach,
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
        has: attribute_list(survey.attributes.iter().map(String::as_str)),
    })
}

/// The source of the colours of particles; "auto" depends on the attributes that exist.
fn color_rule(manifest: &Manifest, survey: &Survey) -> Result<ColorRule, ResolveError> {
    // Maps an attribute. The default range is that of the survey
    let mapped = |name: &str, map: Option<MapName>, range: Option<[f64; 2]>, required: bool| {
        let found = survey
            .color
            .as_ref()
            .map_or([0.0, 1.0], |c| [c.low, c.high]);
        let [low, high] = range.unwrap_or(found);
        let map = map.unwrap_or(DEFAULT_MAP).name();
        let map = ColorMap::new(map, narrow(low), narrow(high)).map_err(|e| {
            ResolveError::Unsupported {
                key: "material.color.map",
                what: e.to_string(),
            }
        })?;
        Ok(ColorRule::Attribute {
            name: name.to_owned(),
            map,
            required,
        })
    };
    match &manifest.material.color {
        ColorSetting::Rgb(rgb) => Ok(ColorRule::Constant(*rgb)),
        ColorSetting::Auto => match (&survey.color, &survey.rgb) {
            (Some(color), _) => mapped(&color.attribute, None, None, false),
            (None, Some(rgb)) => Ok(ColorRule::Rgb {
                name: rgb.attribute.clone(),
                required: false,
            }),
            (None, None) => Ok(ColorRule::Constant(material::DEFAULT_COLOR)),
        },
        ColorSetting::AutoWith { map, range } => match &survey.color {
            Some(color) => mapped(&color.attribute, *map, *range, false),
            None => {
                require_attribute(survey, "material.color", "velocity")?;
                Ok(ColorRule::Constant(material::DEFAULT_COLOR))
            }
        },
        ColorSetting::Attribute {
            attribute,
            map,
            range,
        } => {
            require_attribute(survey, "material.color.attribute", attribute)?;
            // A map or a range means that vectors are mapped by their length.
            if map.is_none() && range.is_none() && survey.rgb.is_some() {
                return Ok(ColorRule::Rgb {
                    name: attribute.clone(),
                    required: true,
                });
            }
            mapped(attribute, *map, *range, true)
        }
    }
}

fn lights(manifest: &Manifest, origin: DVec3) -> Vec<Light> {
    manifest
        .lights
        .iter()
        .filter_map(|light| {
            let radiance = light.color * light.intensity;
            match &light.kind {
                LightKind::Point { position, falloff } => {
                    Some(Light::point_with(*position, origin, radiance, *falloff))
                }
                LightKind::Directional { direction } => {
                    Light::directional(direction.as_vec3(), radiance)
                }
            }
        })
        .collect()
}

fn background(manifest: &Manifest, up: Vec3) -> Background {
    let asked = manifest.render.background;
    asked.map_or_else(|| Background::default_for(up), |b| b.with_up(up))
}

fn ground(manifest: &Manifest, bounds: &Bounds, up: DVec3, origin: DVec3) -> Option<Ground> {
    let render = &manifest.render;
    if !render.ground {
        return None;
    }
    let mut ground = Ground::under(bounds, up.as_vec3(), origin);
    if let Some(height) = render.ground_height {
        let relative = narrow(height - origin.dot(up.normalize_or(DVec3::Z)));
        ground.center += (relative - ground.height) * ground.up;
        ground.height = relative;
    }
    ground.color = render.ground_color;
    ground.checker = match render.ground_pattern {
        GroundPattern::Plain => None,
        GroundPattern::Checker => Some(Checker {
            tile: match render.ground_tile {
                Some(tile) => narrow(tile),
                None => surface::round(bounds.diagonal() * TILE),
            },
        }),
    };
    Some(ground)
}

/// A rate as a fraction: 24 as 24/1, 29.97 as 29970/1000.
#[expect(
    clippy::cast_possible_truncation,
    reason = "clamped to what the attribute holds"
)]
fn fps(rate: f64) -> (i32, u32) {
    let whole = rate.round();
    if (rate - whole).abs() < 1e-9 {
        ((whole.min(1e9)) as i32, 1)
    } else {
        (((rate * 1000.0).round().min(2e9)) as i32, 1000)
    }
}
