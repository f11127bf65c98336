//! Scenes of the tracer on a device: what the device lacks, and films of its pictures.

use std::fmt;
use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;
use spherule_tracer::render::device::{DeviceHit, DevicePixel, are_from_nearest, store_pixels};
use spherule_tracer::render::{
    Colors, Drawing, Film, FilmSampler, IntegratorKind, Opacities, ParticleShading, RayCounts,
    RenderSettings, Stop,
};
use spherule_tracer::scene::{self, Falloff, Fresnel, LightKind, Projection, Scene, background};
use spherule_tree::accel;

use crate::picture::{
    Background, Camera, FilmSize, Light, LightPlace, MAX_LIGHTS, Material, Picture, Samples,
};
use crate::tree::{KeyLength, Order, Radii, Spheres};
use crate::whitted::{self, Cost, NearestSample, Pixels, Renderer};
use crate::{Device, GpuError};

/// What the device lacks of the renderer for CPUs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Missing {
    /// Path tracing.
    PathTracing,
    /// Light through particles.
    Transmission,
    /// A ground.
    Ground,
    /// Motion blur.
    MotionBlur,
    /// Depth of field.
    Lens,
    /// Images for two eyes.
    Stereo,
    /// Panoramas.
    Panorama,
    /// Opacities below 1.
    Opacity,
    /// Styles with their own materials.
    Styles,
    /// Lights with an extent.
    LightExtent,
    /// More lights than fit.
    Lights,
    /// Layers of light, groups of lights and Cryptomatte.
    Layers,
    /// Outlines and the fading with distance.
    Drawing,
    /// Denoising.
    Denoising,
    /// Particles that only hide what is behind them.
    Holdout,
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::PathTracing => "path tracing",
            Self::Transmission => "transparent particles",
            Self::Ground => "a ground",
            Self::MotionBlur => "motion blur",
            Self::Lens => "depth of field",
            Self::Stereo => "stereo images",
            Self::Panorama => "panoramas",
            Self::Opacity => "opacities",
            Self::Styles => "styles",
            Self::LightExtent => "lights with an extent",
            Self::Lights => "more than eight lights",
            Self::Layers => "layers of light and Cryptomatte",
            Self::Drawing => "outlines and the fading with distance",
            Self::Denoising => "denoising",
            Self::Holdout => "holdouts",
        })
    }
}

/// The first thing that a picture of `scene` with these settings needs and the device lacks.
pub fn missing(scene: &Scene, settings: &RenderSettings) -> Option<Missing> {
    let material = scene.particle_material();
    let camera = &scene.camera;
    let has_extent = |light: &scene::Light| light.kind.has_extent();
    [
        (settings.integrator == IntegratorKind::Path, Missing::PathTracing),
        (material.transmission > 0.0, Missing::Transmission),
        (scene.ground.is_some(), Missing::Ground),
        (scene.exposure.is_some(), Missing::MotionBlur),
        (camera.lens().is_some(), Missing::Lens),
        (camera.stereo().is_some(), Missing::Stereo),
        (camera.projection().is_panorama(), Missing::Panorama),
        (scene.lights.iter().any(has_extent), Missing::LightExtent),
        (scene.lights.len() > MAX_LIGHTS, Missing::Lights),
        (!are_from_nearest(&settings.channels), Missing::Layers),
        (settings.drawing != Drawing::NONE, Missing::Drawing),
        (settings.has_features, Missing::Denoising),
        (material.is_holdout, Missing::Holdout),
    ]
    .into_iter()
    .find_map(|(is_needed, missing)| is_needed.then_some(missing))
}

/// The first thing that the particles need and the device lacks.
pub fn missing_of_particles(shading: &ParticleShading<'_>) -> Option<Missing> {
    if !shading.styles.is_empty() {
        return Some(Missing::Styles);
    }
    (!matches!(shading.opacities, Opacities::Constant(1.0))).then_some(Missing::Opacity)
}

/// Points of the samples of a film, which are the same for all its pictures.
#[derive(Debug, Default)]
struct SampleTable {
    /// What it is for.
    film: Option<(FilmSize, RenderSettings)>,
    points: Vec<[f32; 2]>,
    sets: Vec<u32>,
}

impl SampleTable {
    fn fit(&mut self, film: FilmSize, settings: &RenderSettings) {
        let is_fit = self.film.is_some_and(|(size, of)| {
            size == film && (of.samples, of.filter) == (settings.samples, settings.filter)
        });
        if is_fit {
            return;
        }
        let sampler = FilmSampler::with_filter(settings.samples, settings.filter);
        self.points = sampler.all_points().collect();
        // Numbers of pixels beyond the left or top border wrap around, as on the CPU
        let [left, top] = film.corner;
        let pixel = |x: u32, y: u32| {
            let at = [left.wrapping_add_unsigned(x), top.wrapping_add_unsigned(y)];
            sampler.set_of(at[0].cast_unsigned(), at[1].cast_unsigned())
        };
        let rows = 0..film.height;
        self.sets = rows
            .flat_map(|y| (0..film.width).map(move |x| (x, y)))
            .map(|(x, y)| pixel(x, y))
            .collect();
        self.film = Some((film, *settings));
    }
}

/// Renders frames of spheres on a device.
#[derive(Debug)]
pub struct SceneRenderer {
    device: Arc<Device>,
    renderer: Renderer,
    samples: SampleTable,
}

impl SceneRenderer {
    /// A renderer on `device`.
    pub fn new(device: Arc<Device>) -> Self {
        let renderer = Renderer::new(&device);
        Self { device, renderer, samples: SampleTable::default() }
    }

    /// The device.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Copies `spheres` with their colours to the device, and starts to build their tree.
    ///
    /// # Errors
    /// If they do not fit, or if the device fails.
    pub fn prepare(
        &mut self,
        spheres: &accel::Spheres<'_>,
        shading: &ParticleShading<'_>,
    ) -> Result<(), GpuError> {
        let centers: &[[f32; 3]] = bytemuck::cast_slice(spheres.centers);
        let radii = match spheres.radius {
            accel::SphereRadius::Common(radius) => Radii::Common(radius),
            accel::SphereRadius::Each(radii) => Radii::PerSphere(radii),
        };
        let spheres = Spheres { centers, radii, order: Order::Any(key_length(spheres.centers)) };
        match shading.colors {
            Colors::Constant(color) => {
                let colors = whitted::Colors::Constant(color.to_array());
                self.renderer.prepare(&self.device, &spheres, colors)
            }
            Colors::PerParticle(colors) => {
                let colors = whitted::Colors::PerSphere(bytemuck::cast_slice(colors));
                self.renderer.prepare(&self.device, &spheres, colors)
            }
            Colors::Mapped { values, map } => {
                let colors: Vec<Vec3> = values.par_iter().map(|value| map.color(*value)).collect();
                let colors = whitted::Colors::PerSphere(bytemuck::cast_slice(&colors));
                self.renderer.prepare(&self.device, &spheres, colors)
            }
        }
    }

    /// Renders the spheres that were prepared last, into `film`. Nothing may be [`missing`].
    ///
    /// # Errors
    /// If `stop` is raised, if a setting is out of range, or if the device fails.
    pub fn render_into(
        &mut self,
        film: &mut Film,
        scene: &Scene,
        shading: &ParticleShading<'_>,
        settings: &RenderSettings,
        stop: &dyn Stop,
    ) -> Result<Cost, SceneError> {
        self.trace(scene, settings, stop)?;
        let store = |pixels: &Pixels<'_>| {
            let share = 1.0 / settings.samples as f32;
            let pixel = |number: usize| DevicePixel {
                color: pixels.sums[number].map(|sum| sum * share),
                nearest: hit_of(&pixels.nearest[number]),
            };
            store_pixels(film, scene, shading, settings, &pixel)
        };
        self.renderer.read(&self.device, store)??;
        Ok(self.renderer.cost(&self.device)?)
    }

    /// Builds the tree of the spheres that were prepared last once more, renders them, and leaves the picture on the
    /// device: to measure both.
    ///
    /// # Errors
    /// Same as [`Self::render_into`].
    pub fn measure(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        stop: &dyn Stop,
    ) -> Result<Cost, SceneError> {
        self.renderer.rebuild(&self.device)?;
        self.trace(scene, settings, stop)?;
        Ok(self.renderer.cost(&self.device)?)
    }

    fn trace(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        stop: &dyn Stop,
    ) -> Result<(), SceneError> {
        settings.validate()?;
        let size = film_size(settings);
        self.samples.fit(size, settings);
        let lights: Vec<_> = scene.lights.iter().map(light_of).collect();
        let picture = Picture {
            camera: camera_of(scene, settings),
            film: size,
            samples: Samples {
                count: settings.samples,
                points: &self.samples.points,
                sets: &self.samples.sets,
            },
            max_depth: settings.max_depth,
            background: background_of(&scene.background),
            is_transparent: settings.transparent_background,
            material: material_of(scene),
            lights: &lights,
        };
        Ok(self.renderer.trace(&self.device, &picture, &|| stop.is_raised())?)
    }
}

/// The rays that a picture has cost.
pub const fn ray_counts(cost: &Cost) -> RayCounts {
    RayCounts {
        primary: cost.primary_rays,
        shadow: cost.shadow_rays,
        reflection: cost.reflected_rays,
        refraction: 0,
    }
}

fn hit_of(sample: &NearestSample) -> Option<DeviceHit> {
    (sample.index != NearestSample::NONE).then(|| DeviceHit {
        depth: sample.depth,
        particle: sample.index,
        normal: Vec3::from_array(sample.normal),
        point: Vec3::from_array(sample.position),
    })
}

fn film_size(settings: &RenderSettings) -> FilmSize {
    let RenderSettings { width, height, .. } = *settings;
    let window = settings.data_window();
    FilmSize { width, height, corner: [window.left, window.top] }
}

fn camera_of(scene: &Scene, settings: &RenderSettings) -> Camera {
    let camera = &scene.camera;
    Camera {
        eye: camera.eye().to_array(),
        axes: camera.axes().map(|axis| axis.to_array()),
        half_extent: camera.half_extent().to_array(),
        size: settings.eye_size(camera.eyes()).map(|pixels| pixels as f32),
        is_parallel: matches!(camera.projection(), Projection::Orthographic { .. }),
    }
}

fn background_of(background: &scene::Background) -> Background {
    let gradient = |bottom: Vec3, top: Vec3, up: Vec3| Background::Gradient {
        bottom: bottom.to_array(),
        top: top.to_array(),
        up: up.to_array(),
    };
    match *background {
        scene::Background::Constant(color) => Background::Constant(color.to_array()),
        scene::Background::Gradient { bottom, top, up } => gradient(bottom, top, up),
        scene::Background::Studio { up } => {
            gradient(background::STUDIO_BOTTOM, background::STUDIO_TOP, up)
        }
    }
}

fn material_of(scene: &Scene) -> Material {
    let material = scene.particle_material();
    Material {
        ambient: (material.ambient * scene.ambient_light).to_array(),
        diffuse: material.diffuse,
        specular: material.specular,
        shininess: material.shininess,
        reflection: material.reflection,
        ior: material.ior,
        is_exact_fresnel: material.fresnel == Fresnel::Exact,
    }
}

fn light_of(light: &scene::Light) -> Light {
    let place = match light.kind {
        LightKind::Point { position, falloff } => LightPlace::Point {
            position: position.to_array(),
            has_falloff: falloff == Falloff::InverseSquare,
        },
        LightKind::Directional { to_light } | LightKind::Sun { to_light, .. } => {
            LightPlace::Distant(to_light.to_array())
        }
        LightKind::Sphere { center, .. }
        | LightKind::Rectangle { center, .. }
        | LightKind::Disc { center, .. } => {
            LightPlace::Point { position: center.to_array(), has_falloff: true }
        }
    };
    Light { place, radiance: light.radiance.to_array(), casts_shadow: light.casts_shadow }
}

/// Spheres that are looked at to choose the length of keys.
const SAMPLED_CENTERS: usize = 4096;
/// Least part of the box of all spheres, along each axis, that all but the outermost hundredth on both sides fill, for short
/// keys.
const MIN_FILLED: f32 = 0.5;

/// Whether short keys tell the spheres at `centers` apart: if most of them fill the box of all.
fn key_length(centers: &[Vec3]) -> KeyLength {
    // The box of all
    let (low, high) = centers
        .par_chunks(1 << 16)
        .map(|part| part.iter().fold((Vec3::MAX, Vec3::MIN), |(a, b), c| (a.min(*c), b.max(*c))))
        .reduce(|| (Vec3::MAX, Vec3::MIN), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    // That of most
    let step = centers.len().div_ceil(SAMPLED_CENTERS).max(1);
    let mut filled = 1.0_f32;
    for axis in 0..3 {
        let mut sampled: Vec<f32> = centers.iter().step_by(step).map(|c| c[axis]).collect();
        sampled.sort_unstable_by(f32::total_cmp);
        let outer = sampled.len() / 100;
        let most = match (sampled.get(outer), sampled.get(sampled.len().wrapping_sub(outer + 1))) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        };
        // A flat box has one layer of cells, whatever the keys
        if high[axis] > low[axis] {
            filled = filled.min(most / (high[axis] - low[axis]));
        }
    }
    if filled >= MIN_FILLED { KeyLength::Short } else { KeyLength::Long }
}

/// Reasons why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// A setting is out of range.
    #[error(transparent)]
    Render(#[from] spherule_tracer::render::RenderError),
    /// The device failed, or rendering was stopped.
    #[error(transparent)]
    Device(#[from] GpuError),
}
