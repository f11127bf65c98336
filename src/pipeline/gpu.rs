//! Renders frames on a GPU, with the crate `spherule-gpu`. A program that is built without the feature `gpu` has
//! `no_gpu.rs` in its place.

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use glam::Vec3;
use spherule_files::memory::MemoryUse;
use spherule_formats::native::{self, NativeFile};
use spherule_formats::sequence::Sequence;
use spherule_gpu::{
    AdapterSummary, Arithmetic, Checks, Cost, Device, Encoding, GpuError, MAX_FINISHES, Missing,
    PendingImage, SceneError, SceneRenderer, TreeNeed, bytes_per_pixel, host_bytes_per_pixel,
    largest_array, missing, ray_counts,
};

use super::in_place::particles_in_place;
use super::load::{LoadedFrame, LoadedParticles};
use super::mattes;
use super::motion::expose;
use super::renderer::{
    BuiltFrame, BuiltParticles, FrameRenderer, TraceError, TracedFrame, UnfinishedImage,
};
use super::setup::{OpacityRule, ParticleStyle, RadiusRule, Setup, StyleForm};
use super::shading::particle_shading;
use super::surface::spheres;
use crate::denoise::DenoiseSettings;
use crate::render::{
    Film, IntegratorKind, RayCounts, RenderError, RenderSettings, ShadeSource, Stop,
};
use crate::report::FrameReport;
use crate::report::frame::{BuildSummary, DeviceSummary};
use crate::scene::material::DEFAULT_COLOR;
use crate::scene::{Environment, Finish, Material};
use crate::surface::SurfaceKind;

/// The number of the adapter that the user chose.
static CHOSEN: OnceLock<usize> = OnceLock::new();
/// The device of this process, which renderers share. It takes up to a second to open.
static DEVICE: Mutex<Option<Arc<Device>>> = Mutex::new(None);

/// Chooses an adapter by its number in [`adapters`]. Only the first call counts.
pub fn choose(index: usize) {
    CHOSEN.get_or_init(|| index);
}

/// The number that was chosen.
pub fn chosen() -> Option<usize> {
    CHOSEN.get().copied()
}

/// A line about each adapter of this machine, or why there is none.
pub fn adapters() -> Vec<String> {
    let about = |(index, adapter): (usize, &AdapterSummary)| {
        let kind = if adapter.is_software { ", a program on the CPU" } else { "" };
        let test = match Device::open(index, Checks::Off).map(|device| device.arithmetic()) {
            Ok(Arithmetic::Fused) => "passes the self-test".to_owned(),
            Ok(Arithmetic::Separate) => {
                "passes the self-test, without fused multiply-add".to_owned()
            }
            Err(error) => error.to_string(),
        };
        let AdapterSummary { name, driver, max_array, .. } = adapter;
        format!("{index}: {name}{kind}; {driver}; arrays up to {} MiB; {test}", max_array >> 20)
    };
    let adapters = spherule_gpu::adapters();
    if adapters.is_empty() {
        return vec![format!("no GPU was found: {}", super::vulkan::why_nothing_is_found())];
    }
    adapters.iter().enumerate().map(about).collect()
}

/// The device: the chosen one, or the first one that is not a program on the CPU.
fn device() -> Result<Arc<Device>, TraceError> {
    let mut shared = lock(&DEVICE);
    if let Some(device) = &*shared {
        return Ok(Arc::clone(device));
    }
    let index = match CHOSEN.get() {
        Some(index) => *index,
        None => {
            let adapters = spherule_gpu::adapters();
            let hardware = adapters.iter().position(|adapter| !adapter.is_software);
            hardware.ok_or_else(|| no_device(&adapters))?
        }
    };
    // `failed` would wait for the lock
    let opened = Device::open(index, Checks::Off);
    let device = Arc::new(opened.map_err(|error| TraceError::Device(error.to_string()))?);
    *shared = Some(Arc::clone(&device));
    Ok(device)
}

fn no_device(adapters: &[AdapterSummary]) -> TraceError {
    let what = match adapters {
        [] => format!("no GPU was found: {}", super::vulkan::why_nothing_is_found()),
        [software, ..] => format!(
            "the only device is {}, a program on the CPU; choose it with --gpu 0",
            software.name
        ),
    };
    TraceError::Device(what)
}

fn failed(error: GpuError) -> TraceError {
    match error {
        GpuError::Interrupted => TraceError::Render(RenderError::Interrupted),
        GpuError::Lost { .. } => {
            // The next frame opens it again
            *lock(&DEVICE) = None;
            TraceError::Device(format!("{error}; run the command again to render the frame"))
        }
        GpuError::OutOfMemory => TraceError::Device(format!(
            "{error}; end other programs that use it, choose a smaller image, or render with --device cpu"
        )),
        _ => TraceError::Device(error.to_string()),
    }
}

fn scene_failed(error: SceneError) -> TraceError {
    match error {
        SceneError::Render(error) => TraceError::Render(error),
        SceneError::Denoise(error) => TraceError::Denoise(error),
        SceneError::Device(error) => failed(error),
    }
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The key of the first setting that a GPU lacks, and what is missing.
pub fn lacking(setup: &Setup) -> Option<(&'static str, String)> {
    let picture = &setup.picture;
    let (rules, things) = (&picture.particles, &picture.things);
    let of_scene = missing(&picture.scene, &picture.render);
    [
        of_scene.map(|missing| (key_of(missing), missing.to_string())),
        (picture.surface.kind != SurfaceKind::Spheres)
            .then(|| ("render.surface", "other surfaces than spheres".to_owned())),
        rules.first().bonds.is_some().then(|| ("bonds", "bonds".to_owned())),
        (rules.styles.len() > MAX_FINISHES)
            .then(|| ("style", format!("more than {} styles", MAX_FINISHES - 1))),
        (!rules.others().iter().all(|style| is_plain(setup, style)))
            .then(|| ("style", "styles of anything but spheres".to_owned())),
        (!rules.cut.is_everywhere()).then(|| ("clip", "particles that are cut".to_owned())),
        (!things.meshes.is_empty()).then(|| ("mesh", "meshes".to_owned())),
        (things.cell.is_some()).then(|| ("cell", "the simulation cell".to_owned())),
        (!things.arrows.is_empty()).then(|| ("arrows", "arrows".to_owned())),
        (!things.trails.is_empty()).then(|| ("trails", "trails".to_owned())),
    ]
    .into_iter()
    .flatten()
    .next()
}

/// Whether the particles of a style are spheres that light does not enter, whose material differs from that of others
/// only in how paths leave it.
fn is_plain(setup: &Setup, style: &ParticleStyle) -> bool {
    let picture = &setup.picture;
    let own = picture.scene.material(style.material);
    let usual = picture.scene.particle_material();
    let is_known = match own.finish {
        Finish::Matte | Finish::Plastic { .. } | Finish::Metal { .. } => true,
        Finish::Foam | Finish::Pane => false,
    };
    let constants = |material: &Material| {
        let Material { ambient, diffuse, specular, shininess, reflection, ior, .. } = *material;
        ([ambient, diffuse, specular, shininess, reflection, ior], material.fresnel)
    };
    let is_traced = picture.render.integrator == IntegratorKind::Path;
    matches!(style.form, StyleForm::Spheres)
        && style.bonds.is_none()
        && is_known
        && own.transmission == 0.0
        && (is_traced || constants(own) == constants(usual))
}

/// How positions are stored in frame `index`, and whether its radii are equal, if it is a native frame that is traced in
/// place.
fn stored_as(setup: &Setup, sequence: &Sequence, index: usize) -> Option<(Encoding, bool)> {
    let file = NativeFile::open(sequence.native_file(index)?, setup.run.access).ok()?;
    let radius = particles_in_place(setup, file.index()).ok()?;
    let code = file.index().encoding;
    let found = native::Encoding::ALL.into_iter().find(|encoding| encoding.code() == code)?;
    let encoding = match found {
        native::Encoding::F32 => Encoding::Blocks,
        native::Encoding::Q16 => Encoding::Q16,
        native::Encoding::Q10 => Encoding::Q10,
    };
    Some((encoding, radius.common.is_some()))
}

/// What the memory for `particles` of the largest frame depends on, with arrays of so many bytes. Frames that are traced in
/// place stay coded if they do not fit otherwise, and if all of them can.
fn need_of(setup: &Setup, sequence: &Sequence, particles: u64, max_array: u64) -> TreeNeed {
    let rules = &setup.picture.particles;
    let decoded = TreeNeed {
        count: particles,
        is_common: matches!(rules.first().radius, RadiusRule::Common(_)) && !rules.is_divided(),
        has_motion: setup.has_motion(),
        encoding: Encoding::Points,
    };
    let stored = |index| stored_as(setup, sequence, index);
    let Some(first) = stored(0) else { return decoded };
    let (encoding, is_common) = first;
    let need = TreeNeed { is_common, encoding, ..decoded };
    let are_equal = || (1..sequence.frames().len()).all(|index| stored(index) == Some(first));
    if need.keeps_codes(max_array) && !are_equal() { decoded } else { need }
}

/// Whether a job that may choose its device is rendered on a GPU; `particles` are those of its largest frame.
///
/// # Errors
/// The first reason why it is not; nothing if the program has no renderer for GPUs.
pub fn suits(setup: &Setup, sequence: &Sequence, particles: u64) -> Result<(), Option<String>> {
    if CHOSEN.get().is_none() && !super::vulkan::has_device_file() {
        return Err(Some("there is no GPU (spherule devices says more)".to_owned()));
    }
    // Open a device only if it could be used
    if let Some((key, what)) = lacking(setup) {
        return Err(Some(format!("{key}: {what} cannot be rendered on a GPU yet")));
    }
    let device = device().map_err(|error| Some(error.to_string()))?;
    let AdapterSummary { name, is_software, max_array, .. } = device.adapter();
    if *is_software {
        return Err(Some(format!("{name} is a program on the CPU")));
    }
    let need = need_of(setup, sequence, particles, *max_array);
    let most = need.max_count(*max_array);
    if particles > most {
        return Err(Some(format!("a frame has {particles} particles, and {name} takes {most}")));
    }
    let picture = &setup.picture;
    let of_colors = bytes_of_color(setup) * particles;
    let largest = largest_array(&picture.scene, &picture.render).max(detail_bytes(setup));
    for (what, bytes) in [("picture", largest), ("frame", of_colors)] {
        if bytes > *max_array {
            return Err(Some(format!(
                "a {what} has an array of {} MiB, and {name} takes {} MiB",
                bytes >> 20,
                max_array >> 20,
            )));
        }
    }
    Ok(())
}

fn key_of(missing: Missing) -> &'static str {
    match missing {
        Missing::Scattering => "material.scattering",
        Missing::Mist => "mist.visibility",
        Missing::Photons => "render.caustics",
        Missing::StylesInGlass => "style",
        Missing::Ground => "render.ground",
        Missing::Stereo => "camera.stereo",
        Missing::Panorama => "camera.projection",
        Missing::LightExtent | Missing::Lights => "light",
        Missing::Layers => "output.channels",
        Missing::Drawing => "render.outline",
        Missing::Holdout => "mesh",
        Missing::Noise => "render.noise",
    }
}

/// Memory of the image of the environment at its own resolution, bytes.
fn detail_bytes(setup: &Setup) -> u64 {
    let environment = setup.picture.scene.environment.as_deref();
    environment.and_then(Environment::detail).map_or(0, |(map, _)| map.byte_len())
}

/// Memory of the device for the colour of a particle, bytes.
fn bytes_of_color(setup: &Setup) -> u64 {
    let rules = &setup.picture.particles;
    let is_opaque = |style: &ParticleStyle| style.opacity == OpacityRule::OPAQUE;
    if !rules.styles.iter().all(is_opaque) {
        16
    } else if rules.first().color.is_by_particle() || rules.is_divided() {
        12
    } else {
        0
    }
}

/// Memory of the device for a frame with that many particles, bytes.
pub fn device_bytes(setup: &Setup, sequence: &Sequence, particles: u64) -> u64 {
    let picture = &setup.picture;
    let pixels = u64::from(picture.render.width) * u64::from(picture.render.height);
    let max_array = device().map_or(u64::MAX, |device| device.adapter().max_array);
    let of_pixels = bytes_per_pixel(&picture.scene, &picture.render, max_array) * pixels;
    need_of(setup, sequence, particles, max_array).bytes(max_array)
        + bytes_of_color(setup) * particles
        + of_pixels
        + detail_bytes(setup)
}

/// Memory of the host for each pixel of an image that is not finished, bytes.
pub fn host_bytes(setup: &Setup) -> u64 {
    host_bytes_per_pixel(&setup.picture.scene, &setup.picture.render)
}

/// Renders frame after frame on the device.
#[derive(Debug, Default)]
pub struct GpuRenderer {
    /// The renderer, once there is a frame. Trials render through a shared reference.
    renderer: Mutex<Option<SceneRenderer>>,
    /// Planes for the next image.
    film: Film,
}

impl FrameRenderer for GpuRenderer {
    fn prepare(&mut self, setup: &Setup, frame: LoadedFrame<'_>) -> Result<BuiltFrame, TraceError> {
        let mut report = FrameReport {
            particles: frame.particles.count(),
            particles_read: frame.read,
            dropped: frame.dropped,
            clamped_radii: frame.clamped_radii,
            ..FrameReport::default()
        };
        report.seconds.read = frame.read_time.as_secs_f64();
        let start = Instant::now();
        let particles = upload(self.ready()?, setup, frame.particles)?;
        report.seconds.build = start.elapsed().as_secs_f64();
        report.bytes.attributes = match &particles {
            BuiltParticles::Decoded(shading) => shading.byte_len(),
            BuiltParticles::Stored(stored) => stored.attribute_bytes(),
        };
        Ok(BuiltFrame {
            task: frame.task,
            particles: Arc::new(particles),
            meshes: frame.meshes,
            rods: frame.rods,
            facts: frame.facts,
            time: frame.time,
            focus: frame.focus,
            report,
            notes: Vec::new(),
        })
    }

    fn trace(
        &mut self,
        setup: &Setup,
        frame: &BuiltFrame,
        stop: &dyn Stop,
    ) -> Result<TracedFrame, TraceError> {
        let image = self.draw(setup, frame, setup.picture.denoise, stop)?;
        let memory = MemoryUse::now();
        let mut report = frame.report.clone();
        report.build = BuildSummary {
            structure: "lbvh".to_owned(),
            order: "hilbert".to_owned(),
            simd: "gpu".to_owned(),
            ..BuildSummary::default()
        };
        report.device = Some(self.summary());
        Ok(TracedFrame {
            camera: setup.camera_at(frame.task.frame)?,
            task: frame.task.clone(),
            film: std::mem::take(&mut self.film),
            rest: Some(Box::new(image)),
            texts: mattes::attributes_of(setup, frame),
            facts: frame.facts.clone(),
            time: frame.time,
            report,
            memory,
        })
    }

    fn image(
        &self,
        setup: &Setup,
        frame: &BuiltFrame,
        stop: &dyn Stop,
    ) -> Result<(Film, RayCounts), TraceError> {
        let mut film = Film::default();
        let (cost, _) = self.draw(setup, frame, None, stop)?.store(setup, &mut film)?;
        Ok((film, ray_counts(&cost)))
    }

    fn recycle(&mut self, film: Film) {
        self.film = film;
    }
}

/// Copies a frame to the device, and starts to build its tree. Positions are released.
fn upload(
    renderer: &mut SceneRenderer,
    setup: &Setup,
    particles: LoadedParticles<'_>,
) -> Result<BuiltParticles, TraceError> {
    let is_clear = setup.picture.scene.particle_material().transmission > 0.0;
    match particles {
        LoadedParticles::Decoded(mut frame) => {
            let shutter = setup.picture.view.shutter;
            let displacements = shutter.map(|shutter| expose(setup, shutter, &mut frame));
            let shading = particle_shading(&setup.picture, &frame.shading);
            let displacements = displacements.as_deref();
            let spheres = spheres(&frame);
            renderer.prepare(&spheres, displacements, &shading, is_clear).map_err(failed)?;
            Ok(BuiltParticles::Decoded(frame.shading))
        }
        LoadedParticles::Stored(stored) => {
            let shading = stored.shading(&setup.picture, DEFAULT_COLOR);
            let leaves = stored.leaves()?;
            let radius = stored.radius();
            renderer.prepare_stored(&leaves, radius, &shading, is_clear).map_err(failed)?;
            drop(shading);
            // Reject the frame if its file has changed meanwhile
            stored.check()?;
            Ok(BuiltParticles::Stored(stored))
        }
    }
}

impl GpuRenderer {
    /// The renderer of the shared device. A device that was lost is opened again.
    fn ready(&mut self) -> Result<&mut SceneRenderer, TraceError> {
        let device = device()?;
        let kept = self.renderer.get_mut().unwrap_or_else(PoisonError::into_inner);
        let current = kept.take().filter(|of| std::ptr::eq(of.device(), &*device));
        Ok(kept.insert(current.unwrap_or_else(|| SceneRenderer::new(device))))
    }

    fn draw(
        &self,
        setup: &Setup,
        frame: &BuiltFrame,
        denoise: Option<DenoiseSettings>,
        stop: &dyn Stop,
    ) -> Result<DeviceImage, TraceError> {
        let mut renderer = lock(&self.renderer);
        let Some(renderer) = &mut *renderer else {
            return Err(TraceError::Device("no frame was prepared".to_owned()));
        };
        let scene = setup.scene_at(frame.task.frame, frame.focus)?;
        let settings = settings_of(setup);
        let image = with_source(setup, &frame.particles, |source| {
            (renderer.begin(&scene, source, &settings, denoise, stop)).map_err(scene_failed)
        })?;
        Ok(DeviceImage {
            image,
            started: Instant::now(),
            particles: Arc::clone(&frame.particles),
            frame: frame.task.frame,
            focus: frame.focus,
        })
    }

    /// The device, without what the image costs.
    fn summary(&self) -> DeviceSummary {
        let renderer = lock(&self.renderer);
        let adapter = renderer.as_ref().map(|renderer| renderer.device().adapter());
        DeviceSummary {
            name: adapter.map(|adapter| adapter.name.clone()).unwrap_or_default(),
            driver: adapter.map(|adapter| adapter.driver.clone()).unwrap_or_default(),
            ..DeviceSummary::default()
        }
    }
}

/// The settings of pictures. A trial is a small image of all of the scene, whose pixels cost about the same.
fn settings_of(setup: &Setup) -> RenderSettings {
    RenderSettings { mosaic_of: None, ..setup.picture.render }
}

/// Calls `work` with the colours and attributes of `particles`. Fails if their file has changed meanwhile.
fn with_source<T>(
    setup: &Setup,
    particles: &BuiltParticles,
    work: impl FnOnce(&dyn ShadeSource) -> Result<T, TraceError>,
) -> Result<T, TraceError> {
    match particles {
        BuiltParticles::Decoded(shading) => work(&particle_shading(&setup.picture, shading)),
        BuiltParticles::Stored(stored) => {
            let result = work(&stored.shading(&setup.picture, DEFAULT_COLOR))?;
            stored.check()?;
            Ok(result)
        }
    }
}

/// An image that the device renders, or whose pixels are not in a film yet.
#[derive(Debug)]
struct DeviceImage {
    image: PendingImage,
    /// When the device began with it.
    started: Instant,
    particles: Arc<BuiltParticles>,
    frame: i64,
    focus: Option<Vec3>,
}

impl DeviceImage {
    /// Waits for the image and stores it. Returns what it has cost, and how long it was stored.
    fn store(self, setup: &Setup, film: &mut Film) -> Result<(Cost, Duration), TraceError> {
        let (image, cost) = self.image.wait().map_err(failed)?;
        let start = Instant::now();
        let scene = setup.scene_at(self.frame, self.focus)?;
        with_source(setup, &self.particles, |source| {
            let stored = image.store(film, &scene, source, &settings_of(setup));
            stored.map_err(TraceError::Render)
        })?;
        Ok((cost, start.elapsed()))
    }
}

impl UnfinishedImage for DeviceImage {
    fn finish(self: Box<Self>, setup: &Setup, frame: &mut TracedFrame) -> Result<(), TraceError> {
        let started = self.started;
        let (cost, download) = self.store(setup, &mut frame.film)?;
        let rays = ray_counts(&cost);
        let report = &mut frame.report;
        // A device without a clock tells no time
        let on_device = cost.build_seconds + cost.trace_seconds;
        report.seconds.trace =
            if on_device > 0.0 { on_device } else { started.elapsed().as_secs_f64() };
        report.seconds.denoise = cost.denoise_seconds;
        report.clamped_light = rays.lost.part(&frame.film.color, setup.picture.render.samples);
        report.rays = rays.into();
        if let Some(device) = &mut report.device {
            device.upload = report.seconds.build;
            (device.build, device.trace) = (cost.build_seconds, cost.trace_seconds);
            (device.denoise, device.download) = (cost.denoise_seconds, download.as_secs_f64());
            device.bytes = cost.bytes;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use glam::DVec3;

    use super::*;
    use crate::accel::{SphereRadius, Spheres};
    use crate::render::ParticleShading;
    use crate::scene::{Camera, CameraView, Scene};

    #[test]
    fn a_lost_device_is_opened_again() {
        if spherule_gpu::adapters().is_empty() && std::env::var_os("SPHERULE_GPU").is_none() {
            return;
        }
        choose(0);
        let mut renderer = GpuRenderer::default();
        let spheres = Spheres { centers: &[Vec3::ZERO], radius: SphereRadius::Common(1.0) };
        let view =
            CameraView { eye: DVec3::X * 5.0, look_at: DVec3::ZERO, up: DVec3::Z, fov: 45.0 };
        let scene = Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap());
        let integrator = IntegratorKind::Whitted;
        let settings = RenderSettings { integrator, ..RenderSettings::new(8, 8) };
        let mut render = || {
            let shading = ParticleShading::constant(Vec3::ONE);
            let (mut film, never) = (Film::default(), AtomicBool::new(false));
            let renderer = renderer.ready()?;
            renderer.prepare(&spheres, None, &shading, false).map_err(failed)?;
            let rendered =
                renderer.render_into(&mut film, &scene, &shading, &settings, None, &never);
            rendered.map_err(scene_failed).map(|_| film.color)
        };
        let first = render().unwrap();
        let device = device().unwrap();
        device.destroy();
        let error = render().unwrap_err().to_string();
        assert!(error.contains(&device.adapter().name), "{error}");
        assert!(error.ends_with("run the command again to render the frame"), "{error}");
        assert!(render().unwrap() == first);
    }
}
