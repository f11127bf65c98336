//! Scenes of the tracer on a device: what the device lacks, and films of its pictures.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;

use glam::{Vec3, Vec4};
use rayon::prelude::*;
use spherule_tracer::denoise::{DenoiseError, DenoiseSettings};
use spherule_tracer::render::device::{
    DeviceHit, DeviceLight, DeviceObject, DevicePixel, DevicePixels, Extent, extent_of,
    mirrors_see_through, needs_light_parts, needs_photons, store_pixels,
};
use spherule_tracer::render::{
    Drawing, Film, FilmSampler, IntegratorKind, LostLight, ParticleShading, RayCounts, RenderError,
    RenderSettings, ShadeSource, Stop,
};
use spherule_tracer::scene::ground::Pattern;
use spherule_tracer::scene::{
    self, Falloff, Fresnel, LightKind, Owner, Projection, Scene, background,
};
use spherule_tree::accel;
use spherule_tree::blocks::StoredLeaves;
use wgpu::SubmissionIndex;

use crate::lighting::{Model, WhittedGround};
use crate::memory::light_groups_of;
use crate::picture::{
    Background, Camera, Denoising, FilmSize, Light, LightPlace, MAX_LIGHTS, Material, Picture,
    Samples,
};
use crate::pixels::{Cost, HostPixels, LightLayer, NearestSample, Pixels};
use crate::readback::PendingPixels;
use crate::renderer::{Colors, Renderer};
use crate::scene_lighting::{SceneLighting, ground_of};
use crate::spheres::{Centers, KeyLength, Order, Radii, Spheres};
use crate::stored::{centers_of, grids_of};
use crate::tree_need::TreeNeed;
use crate::{Device, GpuError};

/// What the device lacks of the renderer for CPUs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Missing {
    /// Media inside particles that scatter light.
    Scattering,
    /// Mist above the ground.
    Mist,
    /// Light that transmissive particles focus on other surfaces.
    Photons,
    /// Styles beside transmissive particles.
    StylesInGlass,
    /// A ground with sand or a picture, or one below transmissive spheres in Whitted's model.
    Ground,
    /// Two eyes.
    Stereo,
    /// Equirectangular pictures.
    Panorama,
    /// Lights with an extent in Whitted's model.
    LightExtent,
    /// More lights than [`MAX_LIGHTS`].
    Lights,
    /// Channels with parts of the light, in Whitted's model.
    Layers,
    /// Outlines and the fading with distance.
    Drawing,
    /// Particles that hide what is behind them.
    Holdout,
    /// A limit of noise.
    Noise,
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Scattering => "media that scatter light",
            Self::Mist => "mist",
            Self::Photons => "caustics of transmissive particles",
            Self::StylesInGlass => "styles beside transmissive particles",
            Self::Ground => {
                "a ground of sand or with a picture, or one below glass in Whitted's model"
            }
            Self::Stereo => "stereo pairs",
            Self::Panorama => "equirectangular pictures",
            Self::LightExtent => "lights with an extent in Whitted's model",
            Self::Lights => "more than eight lights",
            Self::Layers => "layers of light in Whitted's model",
            Self::Drawing => "outlines and the fading with distance",
            Self::Holdout => "holdouts",
            Self::Noise => "a limit of noise",
        })
    }
}

/// The first thing that a picture of `scene` with these settings needs and the device lacks.
pub fn missing(scene: &Scene, settings: &RenderSettings) -> Option<Missing> {
    let material = scene.particle_material();
    let camera = &scene.camera;
    let is_whitted = settings.integrator == IntegratorKind::Whitted;
    let has_extent = |light: &scene::Light| light.kind.has_extent();
    let is_clear = material.transmission > 0.0;
    let is_glossy = mirrors_see_through(scene, settings);
    let is_style = |of: &scene::Material| matches!(of.owner, Owner::Style(_) | Owner::Part(_));
    let has_styles = scene.materials.iter().any(is_style);
    let is_plain = |ground: &scene::Ground| {
        !(is_whitted && is_clear)
            && matches!(ground.pattern, Pattern::Plain | Pattern::Checker { .. })
    };
    [
        (scene.materials.iter().any(scene::Material::scatters), Missing::Scattering),
        (scene.mist.is_some(), Missing::Mist),
        (needs_photons(scene, settings), Missing::Photons),
        (is_clear && (has_styles || is_glossy), Missing::StylesInGlass),
        (scene.ground.as_ref().is_some_and(|ground| !is_plain(ground)), Missing::Ground),
        (camera.stereo().is_some(), Missing::Stereo),
        (camera.projection().is_panorama(), Missing::Panorama),
        (scene.lights.iter().any(has_extent) && is_whitted, Missing::LightExtent),
        (scene.lights.len() > MAX_LIGHTS, Missing::Lights),
        (needs_light_parts(&settings.channels) && is_whitted, Missing::Layers),
        (settings.drawing != Drawing::NONE, Missing::Drawing),
        (material.is_holdout, Missing::Holdout),
        (settings.noise.is_some(), Missing::Noise),
    ]
    .into_iter()
    .find_map(|(is_needed, missing)| is_needed.then_some(missing))
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
            let key = |of: &RenderSettings| (of.samples, of.filter, of.seed);
            size == film && key(&of) == key(settings)
        });
        if is_fit {
            return;
        }
        let sampler = FilmSampler::with_filter(settings.samples, settings.filter, settings.seed);
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
    lighting: SceneLighting,
    /// The picture that was started last.
    last: Option<SubmissionIndex>,
}

impl SceneRenderer {
    /// A renderer on `device`.
    pub fn new(device: Arc<Device>) -> Self {
        let renderer = Renderer::new(&device);
        Self {
            device,
            renderer,
            samples: SampleTable::default(),
            lighting: SceneLighting::default(),
            last: None,
        }
    }

    /// The device.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Copies `spheres` with the colours of `source` to the device, and starts to build their tree. `displacements`: by how
    /// far each of them moves while the shutter is open, for scenes with an exposure. `is_clear`: they are transmissive.
    ///
    /// # Errors
    /// If they do not fit, or if the device fails.
    pub fn prepare(
        &mut self,
        spheres: &accel::Spheres<'_>,
        displacements: Option<&[Vec3]>,
        source: &dyn ShadeSource,
        is_clear: bool,
    ) -> Result<(), GpuError> {
        let radii = match spheres.radius {
            accel::SphereRadius::Common(radius) => Radii::Common(radius),
            accel::SphereRadius::Each(radii) => Radii::PerSphere(radii),
        };
        let order = Order::Any(key_length(spheres.centers));
        let centers = Centers::Points(bytemuck::cast_slice(spheres.centers));
        // Light passes each copy of a sphere
        let keeps_copies = source.is_translucent() || is_clear;
        let displacements = displacements.map(bytemuck::cast_slice);
        let all =
            Spheres { centers, radii, order, displacements, keeps_copies, keeps_codes: false };
        self.start(&all, spheres.centers.len(), source)
    }

    /// Same as [`Self::prepare`], of the leaves of a native frame, whose particles are in the order of a tree. `radius` is
    /// that of all particles, if it is the same. Positions are copied as they are stored, and decoded on the device.
    ///
    /// # Errors
    /// Same as [`Self::prepare`].
    pub fn prepare_stored(
        &mut self,
        leaves: &StoredLeaves<'_>,
        radius: Option<f32>,
        source: &dyn ShadeSource,
        is_clear: bool,
    ) -> Result<(), GpuError> {
        let grids = grids_of(leaves);
        let load = |block| leaves.radii.load(block).map(|radii| radii.0);
        let each: Vec<f32>;
        let radii = match radius {
            Some(radius) => Radii::Common(radius),
            None => {
                let blocks = (0..leaves.block_count()).into_par_iter();
                each = blocks.filter_map(load).flatten_iter().collect();
                Radii::PerSphere(&each)
            }
        };
        // Frames that are too large for the arrays of the device stay coded
        let centers = centers_of(leaves, &grids);
        let need = TreeNeed {
            count: leaves.count,
            is_common: radius.is_some(),
            has_motion: false,
            encoding: centers.encoding(),
        };
        let keeps_codes = need.keeps_codes(self.device.adapter().max_array);
        let spheres = Spheres {
            centers,
            radii,
            order: Order::AlongCurve,
            displacements: None,
            keeps_codes,
            keeps_copies: source.is_translucent() || is_clear,
        };
        let count = usize::try_from(leaves.count).unwrap_or(usize::MAX);
        self.start(&spheres, count, source)
    }

    fn start(
        &mut self,
        spheres: &Spheres<'_>,
        count: usize,
        source: &dyn ShadeSource,
    ) -> Result<(), GpuError> {
        let indices = (0..u32::try_from(count).unwrap_or(u32::MAX)).into_par_iter();
        let each: Vec<Vec3>;
        let with_opacity: Vec<Vec4>;
        let colors = if source.is_translucent() {
            let color = |index| source.color(index).extend(source.opacity(index));
            with_opacity = indices.map(color).collect();
            Colors::WithOpacity(bytemuck::cast_slice(&with_opacity))
        } else if let Some(color) = source.constant_color() {
            Colors::Constant(color.to_array())
        } else {
            each = indices.map(|index| source.color(index)).collect();
            Colors::PerSphere(bytemuck::cast_slice(&each))
        };
        self.renderer.prepare(&self.device, spheres, colors)
    }

    /// Renders the spheres that were prepared last, into `film`, and denoises the picture if `denoise` is there. Nothing
    /// may be [`missing`].
    ///
    /// # Errors
    /// If `stop` is raised, if a setting is out of range, or if the device fails.
    ///
    /// # Panics
    /// If the scene has an exposure and the spheres have no displacements, or the other way round.
    pub fn render_into(
        &mut self,
        film: &mut Film,
        scene: &Scene,
        source: &dyn ShadeSource,
        settings: &RenderSettings,
        denoise: Option<DenoiseSettings>,
        stop: &dyn Stop,
    ) -> Result<Cost, SceneError> {
        let (image, cost) = self.render(scene, source, settings, denoise, stop)?;
        image.store(film, scene, source, settings)?;
        Ok(cost)
    }

    /// The same, without a film: the host can store the image while the device renders the next one.
    ///
    /// # Errors
    /// Same as [`Self::render_into`].
    ///
    /// # Panics
    /// Same as [`Self::render_into`].
    pub fn render(
        &mut self,
        scene: &Scene,
        source: &dyn ShadeSource,
        settings: &RenderSettings,
        denoise: Option<DenoiseSettings>,
        stop: &dyn Stop,
    ) -> Result<(HostImage, Cost), SceneError> {
        Ok(self.begin(scene, source, settings, denoise, stop)?.wait()?)
    }

    /// Starts the same, after the picture before the last one has ended. The next frame can be prepared meanwhile.
    ///
    /// # Errors
    /// Same as [`Self::render_into`].
    ///
    /// # Panics
    /// Same as [`Self::render_into`].
    pub fn begin(
        &mut self,
        scene: &Scene,
        source: &dyn ShadeSource,
        settings: &RenderSettings,
        denoise: Option<DenoiseSettings>,
        stop: &dyn Stop,
    ) -> Result<PendingImage, SceneError> {
        self.trace(scene, source, settings, denoise, stop)?;
        let pixels = self.renderer.start_read(&self.device)?;
        if let Some(before) = self.last.replace(pixels.submission().clone()) {
            self.device.wait_for(&before)?;
        }
        Ok(PendingImage { device: Arc::clone(&self.device), pixels, samples: settings.samples })
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
        denoise: Option<DenoiseSettings>,
        stop: &dyn Stop,
    ) -> Result<Cost, SceneError> {
        self.renderer.rebuild(&self.device)?;
        let source = ParticleShading::constant(Vec3::ONE);
        self.trace(scene, &source, settings, denoise, stop)?;
        Ok(self.renderer.cost(&self.device)?)
    }

    fn trace(
        &mut self,
        scene: &Scene,
        source: &dyn ShadeSource,
        settings: &RenderSettings,
        denoise: Option<DenoiseSettings>,
        stop: &dyn Stop,
    ) -> Result<(), SceneError> {
        settings.validate()?;
        if let Some(denoise) = denoise {
            denoise.validate(settings.samples)?;
        }
        let size = film_size(settings);
        self.samples.fit(size, settings);
        let lights: Vec<_> = scene.lights.iter().map(light_of).collect();
        let exposure = scene.exposure.as_ref().map(|exposure| exposure.cameras);
        let picture = Picture {
            camera: camera_of(&scene.camera, settings),
            exposure: exposure.map(|cameras| cameras.each_ref().map(|c| camera_of(c, settings))),
            film: size,
            samples: Samples {
                count: settings.samples,
                points: &self.samples.points,
                sets: &self.samples.sets,
                seed: settings.seed,
            },
            max_depth: settings.max_depth,
            background: background_of(&scene.background),
            is_transparent: settings.transparent_background,
            denoising: denoise.map(|settings| Denoising {
                settings,
                is_bounded: scene.ground.as_ref().is_some_and(|of| of.shadow_catcher.is_some()),
            }),
            has_objects: settings.channels.mattes().next().is_some(),
            light_groups: light_groups_of(settings),
            model: match settings.integrator {
                IntegratorKind::Whitted => Model::Whitted(whitted_ground(scene)),
                IntegratorKind::Path => Model::Paths(self.lighting.of(scene, source, settings)),
            },
            material: material_of(scene),
            split_weight: settings.min_weight,
            lights: &lights,
        };
        stop.pixels_begin();
        let shown = Cell::new(0);
        let show = |done: u64| {
            let more = done - shown.replace(done);
            stop.pixels_done(u32::try_from(more).unwrap_or(u32::MAX));
        };
        self.renderer.trace(&self.device, &picture, &|done| {
            show(done);
            stop.is_raised()
        })?;
        // The last parts follow soon
        show(size.pixels());
        Ok(())
    }
}

impl Drop for SceneRenderer {
    /// The device may still use the memory.
    fn drop(&mut self) {
        if let Some(last) = &self.last {
            // Who waits for the picture hears of its failure
            let _ = self.device.wait_for(last);
        }
    }
}

/// An image that a device renders, or has rendered.
#[derive(Debug)]
pub struct PendingImage {
    device: Arc<Device>,
    pixels: PendingPixels,
    samples: u32,
}

impl PendingImage {
    /// Waits for the image. Returns it, and what it and its frame have cost.
    ///
    /// # Errors
    /// If the device fails.
    pub fn wait(self) -> Result<(HostImage, Cost), GpuError> {
        let (pixels, cost) = self.pixels.wait(&self.device)?;
        Ok((HostImage { pixels, samples: self.samples }, cost))
    }
}

/// An image that a device has rendered, in memory of the host.
#[derive(Debug)]
pub struct HostImage {
    pixels: HostPixels,
    samples: u32,
}

impl HostImage {
    /// Stores the image in `film`. The rest are the arguments that it was rendered with.
    ///
    /// # Errors
    /// If a setting is out of range.
    pub fn store(
        &self,
        film: &mut Film,
        scene: &Scene,
        source: &dyn ShadeSource,
        settings: &RenderSettings,
    ) -> Result<(), RenderError> {
        let pixels = SummedPixels { pixels: self.pixels.pixels(), samples: self.samples };
        store_pixels(film, scene, source, settings, &pixels)
    }
}

/// Pixels with their number of samples.
struct SummedPixels<'a> {
    pixels: Pixels<'a>,
    samples: u32,
}

impl DevicePixels for SummedPixels<'_> {
    fn pixel(&self, number: usize) -> DevicePixel {
        let Pixels { sums, clean, nearest, .. } = self.pixels;
        let share = 1.0 / self.samples as f32;
        DevicePixel {
            color: sums[number].map(|sum| sum * share),
            clean: clean.get(number).copied(),
            nearest: hit_of(&nearest[number]),
        }
    }

    fn objects(&self, number: usize) -> impl Iterator<Item = DeviceObject> {
        let samples = self.samples as usize;
        let objects = &self.pixels.objects[samples * number..][..samples];
        let surfaces = objects.iter().filter_map(|object| object.surface());
        surfaces.map(|(particle, coverage)| DeviceObject { particle, coverage })
    }

    fn light(&self, number: usize) -> DeviceLight {
        let of = |layer| self.layer(layer, number);
        let [whole, arriving, _] = of(LightLayer::Arrival).to_array();
        DeviceLight {
            diffuse: of(LightLayer::Diffuse),
            specular: of(LightLayer::Specular),
            reflection: of(LightLayer::Reflection),
            refraction: of(LightLayer::Refraction),
            emission: of(LightLayer::Emission),
            background: of(LightLayer::Background),
            direct: of(LightLayer::Direct),
            luminance: [whole, arriving],
            loss: of(LightLayer::Loss),
        }
    }

    fn light_of_group(&self, number: usize, group: u32) -> Vec3 {
        self.layer(LightLayer::Group(group), number)
    }
}

impl SummedPixels<'_> {
    /// The mean of the samples of a pixel in a layer of light.
    fn layer(&self, layer: LightLayer, number: usize) -> Vec3 {
        let Pixels { sums, layers, .. } = self.pixels;
        let [r, g, b, _] = layers[layer.number() as usize * sums.len() + number];
        Vec3::new(r, g, b) / self.samples as f32
    }
}

/// The rays that a picture has cost.
pub const fn ray_counts(cost: &Cost) -> RayCounts {
    RayCounts {
        primary: cost.primary_rays,
        shadow: cost.shadow_rays,
        reflection: cost.reflected_rays,
        refraction: cost.refracted_rays,
        lost: LostLight::from_steps(cost.lost_steps),
        samples: 0,
        noisy_pixels: 0,
    }
}

fn hit_of(sample: &NearestSample) -> Option<DeviceHit> {
    (sample.index != NearestSample::NONE).then(|| DeviceHit {
        depth: sample.depth,
        particle: (sample.index != NearestSample::GROUND).then_some(sample.index),
        normal: Vec3::from_array(sample.normal),
        point: Vec3::from_array(sample.position),
    })
}

fn film_size(settings: &RenderSettings) -> FilmSize {
    let RenderSettings { width, height, .. } = *settings;
    let window = settings.data_window();
    FilmSize { width, height, corner: [window.left, window.top] }
}

fn camera_of(camera: &scene::Camera, settings: &RenderSettings) -> Camera {
    Camera {
        eye: camera.eye().to_array(),
        axes: camera.axes().map(|axis| axis.to_array()),
        half_extent: camera.half_extent().to_array(),
        size: settings.eye_size(camera.eyes()).map(|pixels| pixels as f32),
        is_parallel: matches!(camera.projection(), Projection::Orthographic { .. }),
        lens: camera.lens().map(|lens| [lens.radius, lens.focus]),
    }
}

fn background_of(background: &scene::Background) -> Background {
    let gradient = |[bottom, top, up]: [Vec3; 3], has_backdrop| Background::Gradient {
        bottom: bottom.to_array(),
        top: top.to_array(),
        up: up.to_array(),
        has_backdrop,
    };
    match *background {
        scene::Background::Constant(color) => Background::Constant(color.to_array()),
        scene::Background::Gradient { bottom, top, up } => gradient([bottom, top, up], false),
        scene::Background::Studio { up } => {
            gradient([background::STUDIO_BOTTOM, background::STUDIO_TOP, up], true)
        }
    }
}

/// The ground of `scene` in Whitted's model.
fn whitted_ground(scene: &Scene) -> Option<WhittedGround> {
    let material = scene.material(scene::MaterialId::GROUND);
    scene.ground.as_ref().map(|ground| WhittedGround {
        plane: ground_of(ground, None),
        ambient: (material.ambient * scene.ambient_light).to_array(),
        diffuse: material.diffuse,
    })
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
        transmission: material.transmission,
        extinction: material.extinction.to_array(),
        color_length: material.color_length,
    }
}

fn light_of(light: &scene::Light) -> Light {
    let extent = extent_of(light);
    let half = extent.map_or([0.0; 2], |extent| extent.half);
    let panel = |center: Vec3, is_ellipse| LightPlace::Panel {
        center: center.to_array(),
        axes: extent.map_or([[0.0; 3]; 3], |Extent { axes, .. }| axes.map(|axis| axis.to_array())),
        half,
        is_ellipse,
    };
    let place = match light.kind {
        LightKind::Point { position, falloff } => LightPlace::Point {
            position: position.to_array(),
            has_falloff: falloff == Falloff::InverseSquare,
        },
        LightKind::Directional { to_light } => LightPlace::Distant(to_light.to_array()),
        LightKind::Sun { to_light, .. } => {
            LightPlace::Sun { direction: to_light.to_array(), cap: half[0] }
        }
        LightKind::Sphere { center, radius } => {
            LightPlace::Sphere { center: center.to_array(), radius }
        }
        LightKind::Rectangle { center, .. } => panel(center, false),
        LightKind::Disc { center, .. } => panel(center, true),
    };
    Light {
        place,
        radiance: extent.map_or(light.radiance, |extent| extent.radiance).to_array(),
        casts_shadow: extent.is_some() || light.casts_shadow,
        is_visible: light.is_visible,
        group: light.group.into(),
    }
}

/// Spheres that are looked at to choose the length of keys.
const SAMPLED_CENTERS: usize = 4096;
/// Part of the places of these that may share a cell of short keys with others. Even spheres share a few cells; a third
/// of a volume of fluid, a few more.
const MAX_SHARED: f32 = 0.05;

/// The keys that tell the spheres at `centers` apart. A cell with two of the sampled places has many spheres, unless they
/// are in one place, where keys do not help.
fn key_length(centers: &[Vec3]) -> KeyLength {
    // The box of all
    let (low, high) = centers
        .par_chunks(1 << 16)
        .map(|part| part.iter().fold((Vec3::MAX, Vec3::MIN), |(a, b), c| (a.min(*c), b.max(*c))))
        .reduce(|| (Vec3::MAX, Vec3::MIN), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    // Count the cells of the samples, with 8 and with 16 bits for each axis
    let step = centers.len().div_ceil(SAMPLED_CENTERS).max(1);
    let sampled = || centers.iter().step_by(step);
    let places: BTreeSet<_> = sampled().map(|c| c.to_array().map(f32::to_bits)).collect();
    let shared = |last: f32| {
        let scale = last / (high - low).max_element().max(f32::MIN_POSITIVE);
        let cell = |center: &Vec3| ((*center - low) * scale).as_uvec3().to_array();
        let cells: BTreeSet<_> = sampled().map(cell).collect();
        places.len() - cells.len().min(places.len())
    };
    let is_short = shared(255.0) as f32 <= MAX_SHARED * places.len() as f32;
    match (is_short, shared(65_535.0)) {
        (true, _) => KeyLength::Short,
        (false, 0) => KeyLength::Long,
        (false, _) => KeyLength::Longest,
    }
}

/// Reasons why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// A setting is out of range.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The picture cannot be denoised.
    #[error(transparent)]
    Denoise(#[from] DenoiseError),
    /// The device failed, or rendering was stopped.
    #[error(transparent)]
    Device(#[from] GpuError),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_as_long_as_the_particles_need() {
        // SplitMix64
        let unit = |number: u64| {
            let mut z = number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 40) as f32 / 16_777_216.0
        };
        let even = |i: u64| Vec3::new(unit(4 * i), unit(4 * i + 1), unit(4 * i + 2));
        let points: Vec<Vec3> = (0..50_000).map(even).collect();
        assert_eq!(key_length(&points), KeyLength::Short);
        // A fluid that has fallen, all in one place, none
        let flat: Vec<Vec3> = points.iter().map(|p| *p * Vec3::new(1.0, 0.4, 0.1)).collect();
        assert_eq!(key_length(&flat), KeyLength::Short);
        assert_eq!(key_length(&[Vec3::ONE; 100]), KeyLength::Short);
        assert_eq!(key_length(&[]), KeyLength::Short);
        // One particle far away, and clusters over four decades
        let with_outlier = |at: f32| [&points[..], &[Vec3::splat(at)]].concat();
        assert_eq!(key_length(&with_outlier(30.0)), KeyLength::Long);
        assert_eq!(key_length(&with_outlier(3000.0)), KeyLength::Longest);
        let cluster = |i: u64| even(i) * 10.0_f32.powf(-4.0 * unit(4 * i + 3)) + unit(4 * (i % 9));
        let clusters: Vec<Vec3> = (0..50_000).map(cluster).collect();
        assert_eq!(key_length(&clusters), KeyLength::Longest);
    }
}
