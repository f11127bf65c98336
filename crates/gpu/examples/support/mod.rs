//! Particles of several kinds, and comparisons of the pictures of a device with those of the CPU.

#![allow(dead_code, reason = "each program uses its own part")]

use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use spherule_gpu::{Cost, GpuError, SceneError, SceneRenderer, ray_counts};
use spherule_surface::Shape;
use spherule_surface::moving::MovingSpheres;
use spherule_surface::spheres::SphereSurface;
use spherule_tracer::denoise::{DenoiseInput, DenoiseSettings, denoise};
use spherule_tracer::render::{
    Channels, Colors, DataWindow, Film, FilmPlane, IndirectLight, IntegratorKind, Opacities,
    ParticleShading, RayCounts, RenderSettings, Stop, StyleShading, render,
};
use spherule_tracer::scene::environment::{
    self, DetailMap, Environment, EnvironmentAxes, RadianceMap,
};
use spherule_tracer::scene::ground::{Ground, Pattern};
use spherule_tracer::scene::{
    Background, Camera, CameraView, ColorMap, Exposure, Finish, Fresnel, Lens, Light, LightKind,
    Material, MaterialId, Projection, Scene, default_lights,
};
use spherule_tree::accel::moving::MovingTree;
use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};
use spherule_tree::math::{SimdLevel, narrow};

/// Distributions of particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Data {
    /// Even, in the box of the thesis.
    Box,
    /// A column of fluid that has fallen: dense at the bottom, with drops above.
    DamBreak,
    /// Galaxies: distances from the centres of clusters over four decades.
    Clusters,
    /// Even, and one particle at a thousand times the size of the box.
    Outlier,
    /// All in one place.
    Coincident,
}

impl Data {
    pub(crate) const ALL: [Self; 5] =
        [Self::Box, Self::DamBreak, Self::Clusters, Self::Outlier, Self::Coincident];
}

/// Radii of particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Radii {
    /// All equal.
    Common,
    /// Over two decades; in clusters over four, in proportion to the distance from their centre.
    Each,
}

/// Opacities of particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Opacity {
    /// All equal.
    Common(f32),
    /// From 0 to 1, of some exactly that.
    Each,
    /// Those of the second half, which are a style.
    Style(f32),
}

/// Transmissive particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Glass {
    /// Without roughness, clear.
    Smooth,
    /// The same; what it absorbs differs between red, green and blue.
    Absorbing,
    /// The same; the colour of each particle is that of its light after a short way.
    Colored,
    /// Rough.
    Rough,
}

impl Glass {
    fn apply(self, material: &mut Material) {
        material.transmission = 1.0;
        material.reflection = 1.0;
        material.ior = 1.5;
        material.fresnel = Fresnel::Exact;
        match self {
            Self::Smooth => {}
            Self::Absorbing => material.extinction = Vec3::new(2.0, 5.0, 9.0),
            Self::Colored => material.color_length = Some(0.1),
            Self::Rough => material.interface_roughness = 0.3,
        }
    }
}

/// What pictures of path tracing have beside the studio around the particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Paths {
    /// Matte particles.
    Matte,
    /// The default look: matte ones above a shadow catcher.
    Look,
    /// Plastic ones, under a sky that the camera sees.
    Plastic,
    /// Metal ones, above a checkerboard that fades out.
    Metal,
    /// Matte ones above a shadow catcher, with a sun, on a transparent background.
    Catcher,
    /// The same on a backdrop, with a point light.
    Backdrop,
    /// No environment, but a sphere, a rectangle and a disc that shine, which the camera sees.
    Lights,
    /// Light of second surfaces by an estimate.
    Ambient,
    /// A lens.
    Lens,
    /// Metal and plastic ones, which see the environment through a shadow catcher, before it or on a transparent
    /// background.
    Mirrors,
    Coats,
    /// Smooth metal under an image of an odd size, which is seen at its own resolution.
    Detail,
}

impl Paths {
    pub(crate) const ALL: [Self; 12] = [
        Self::Matte,
        Self::Look,
        Self::Plastic,
        Self::Metal,
        Self::Catcher,
        Self::Backdrop,
        Self::Lights,
        Self::Ambient,
        Self::Lens,
        Self::Mirrors,
        Self::Coats,
        Self::Detail,
    ];
}

/// A picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Case {
    pub(crate) data: Data,
    pub(crate) radii: Radii,
    pub(crate) particles: usize,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) samples: u32,
    /// Sequence of the random numbers.
    pub(crate) seed: u32,
    pub(crate) max_depth: u32,
    /// Parallel rays.
    pub(crate) is_parallel: bool,
    /// Colours by an attribute.
    pub(crate) is_mapped: bool,
    /// Two lights, one of them without shadows, and a gradient as background.
    pub(crate) is_studio: bool,
    /// A checkerboard below the particles in Whitted's model, which fades out.
    pub(crate) has_ground: bool,
    /// A lens, in Whitted's model.
    pub(crate) has_lens: bool,
    /// Position of the film in the image, if it is a part of it.
    pub(crate) window: Option<[i32; 2]>,
    /// Path tracing; else Whitted's model.
    pub(crate) paths: Option<Paths>,
    /// Opacities: one, or by an attribute.
    pub(crate) opacity: Option<Opacity>,
    /// Cryptomatte, on a transparent background.
    pub(crate) has_mattes: bool,
    /// Light by parts: by its first interaction, by light group, and shadows.
    pub(crate) has_layers: bool,
    /// Particles and the camera move while the shutter is open.
    pub(crate) has_motion: bool,
    /// Limit of indirect light.
    pub(crate) clamp: Option<f32>,
    /// Whether particles are transmissive.
    pub(crate) glass: Option<Glass>,
}

impl Case {
    /// A small picture of few particles.
    pub(crate) const fn small() -> Self {
        Self {
            data: Data::Box,
            radii: Radii::Common,
            particles: 4000,
            width: 61,
            height: 43,
            samples: 2,
            seed: 0,
            max_depth: 3,
            is_parallel: false,
            is_mapped: false,
            is_studio: false,
            has_ground: false,
            has_lens: false,
            window: None,
            paths: None,
            opacity: None,
            has_mattes: false,
            has_layers: false,
            has_motion: false,
            clamp: None,
            glass: None,
        }
    }

    /// A picture of the thesis, with three reflections.
    pub(crate) const fn thesis(particles: usize) -> Self {
        Self { particles, width: 1920, height: 1080, samples: 1, max_depth: 4, ..Self::small() }
    }

    /// A picture of the default look, with 16 samples.
    pub(crate) const fn look(particles: usize) -> Self {
        Self { samples: 16, paths: Some(Paths::Look), ..Self::thesis(particles) }
    }

    /// How the picture is denoised, if it is.
    pub(crate) fn denoise(&self) -> Option<DenoiseSettings> {
        (self.samples >= 2).then_some(DenoiseSettings::OPAQUE)
    }

    /// The settings of the picture.
    pub(crate) fn settings(&self) -> RenderSettings {
        let mut names = vec!["RGBA", "Z", "N", "P", "V", "id"];
        names.extend(self.has_mattes.then_some("cryptomatte"));
        if self.has_layers {
            names.extend(LAYERS.map(FilmPlane::name));
        }
        let mut channels = Channels::from_names(names).expect("known names");
        channels.layers.set_light_groups(LIGHT_GROUPS);
        let is_ambient = self.paths == Some(Paths::Ambient);
        RenderSettings {
            integrator: match self.paths {
                Some(_) => IntegratorKind::Path,
                None => IntegratorKind::Whitted,
            },
            indirect: if is_ambient {
                IndirectLight::Ambient { radius: 0.05 }
            } else {
                IndirectLight::Traced
            },
            has_features: self.denoise().is_some(),
            transparent_background: self.has_mattes
                || matches!(self.paths, Some(Paths::Catcher | Paths::Coats)),
            samples: self.samples,
            seed: self.seed,
            max_depth: self.max_depth,
            clamp: self.clamp,
            photons: 0,
            channels,
            window: self.window.map(|[left, top]| DataWindow {
                image: [self.width, self.height],
                left,
                top,
            }),
            ..RenderSettings::new(self.width, self.height)
        }
    }
}

/// Planes with parts of the light.
const LAYERS: [FilmPlane; 12] = [
    FilmPlane::Diffuse,
    FilmPlane::Specular,
    FilmPlane::Reflection,
    FilmPlane::Refraction,
    FilmPlane::Emission,
    FilmPlane::Background,
    FilmPlane::Direct,
    FilmPlane::Indirect,
    FilmPlane::LightGroups,
    FilmPlane::Shadow,
    FilmPlane::ShadowCatcher,
    FilmPlane::Noisy,
];

/// Light groups: the environment, and the lights of even and of odd numbers.
const LIGHT_GROUPS: usize = 3;

/// Particles with a value each.
pub(crate) struct Particles {
    pub(crate) centers: Vec<Vec3>,
    pub(crate) common: f32,
    pub(crate) radii: Option<Vec<f32>>,
    pub(crate) values: Vec<f32>,
    /// By how far they move while the shutter is open.
    pub(crate) displacements: Option<Vec<Vec3>>,
}

/// Uniform numbers from 0 to 1 by the number of a draw (SplitMix64).
fn uniform(number: u64) -> f32 {
    let mut z = number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 40) as f32 / 16_777_216.0
}

/// The box of the thesis.
const LOW: Vec3 = Vec3::new(3.0, 5.0, -2.0);
const SIZE: Vec3 = Vec3::new(4.0, 3.0, 4.0);

/// Distance of a particle from the centre of its cluster.
fn cluster_distance(particle: u64) -> f32 {
    10.0_f32.powf(-4.0 * uniform(8 * particle + 5))
}

fn center(data: Data, particle: u64) -> Vec3 {
    let u = |axis: u64| uniform(8 * particle + axis);
    let even = LOW + SIZE * Vec3::new(u(0), u(1), u(2));
    match data {
        Data::Box => even,
        Data::Outlier if particle == 0 => LOW + 1000.0 * SIZE,
        Data::Outlier => even,
        Data::DamBreak => {
            let height = if u(3) < 0.97 { 0.4 * u(2) * (1.3 - u(0)) } else { u(2) };
            LOW + SIZE * Vec3::new(u(0), u(1), height)
        }
        Data::Clusters => {
            #[expect(clippy::cast_possible_truncation, reason = "below 12")]
            let cluster = (u(4) * 12.0) as u64;
            let middle = |axis: u64| uniform((1 << 60) + 4 * cluster + axis);
            let middle = LOW + SIZE * Vec3::new(middle(0), middle(1), middle(2));
            let direction = 2.0 * Vec3::new(u(0), u(1), u(2)) - Vec3::ONE;
            middle + direction * cluster_distance(particle)
        }
        Data::Coincident => LOW + 0.5 * SIZE,
    }
}

impl Particles {
    pub(crate) fn new(case: &Case) -> Self {
        let count = case.particles as u64;
        let spacing = (f64::from(SIZE.element_product()) / count as f64).cbrt();
        let common = narrow(0.5 * spacing);
        let radius = |particle| match case.data {
            Data::Clusters => 0.2 * common * cluster_distance(particle),
            _ => common * 10.0_f32.powf(2.0 * uniform(8 * particle + 6) - 1.0),
        };
        let radii =
            (case.radii == Radii::Each).then(|| (0..count).into_par_iter().map(radius).collect());
        Self {
            centers: (0..count)
                .into_par_iter()
                .map(|particle| center(case.data, particle))
                .collect(),
            common,
            radii,
            displacements: case.has_motion.then(|| {
                let coordinate = |number: u64| 4.0 * common * (uniform(number) - 0.5);
                let displacement = |particle: u64| {
                    Vec3::from_array([1, 2, 3].map(|i| coordinate(8 * particle + i)))
                };
                (0..count).map(displacement).collect()
            }),
            values: if case.is_mapped || case.opacity == Some(Opacity::Each) {
                (0..count).map(|particle| uniform(8 * particle + 7)).collect()
            } else {
                Vec::new()
            },
        }
    }

    pub(crate) fn spheres(&self) -> Spheres<'_> {
        let radius = match &self.radii {
            Some(radii) => SphereRadius::Each(radii),
            None => SphereRadius::Common(self.common),
        };
        Spheres { centers: &self.centers, radius }
    }
}

/// A scene: the camera of the thesis, turned by `angle` radians. If it moves, it turns.
pub(crate) fn scene(case: &Case, angle: f64) -> Scene {
    let mut scene = still_scene(case, angle);
    if let Some(glass) = case.glass {
        glass.apply(&mut scene.materials[MaterialId::PARTICLES.index()]);
    }
    if case.has_motion {
        let at = |part: f64| still_scene(case, angle + part).camera;
        scene.exposure = Some(Exposure { cameras: [at(-0.01), at(0.02)], slices: 1 });
    }
    scene
}

fn still_scene(case: &Case, angle: f64) -> Scene {
    let (sin, cos) = angle.sin_cos();
    let look_at = DVec3::new(5.0 * (cos - sin), 5.0 * (cos + sin), 0.0);
    let view = CameraView { eye: DVec3::ZERO, look_at, up: DVec3::Z, fov: 45.0 };
    let aspect = f64::from(case.width) / f64::from(case.height);
    let camera = if case.is_parallel {
        let projection = Projection::Orthographic { height: 3.5 };
        Camera::projected(&view, projection, aspect, DVec3::ZERO)
    } else {
        Camera::new(&view, aspect, DVec3::ZERO)
    };
    let camera = camera.expect("a valid view");
    if let Some(paths) = case.paths {
        return path_scene(paths, camera);
    }
    let radius = if case.has_lens { 0.05 } else { 0.0 };
    let mut scene = Scene::new(camera.with_lens(Lens { radius, focus: 6.0 }));
    let bounds =
        spherule_tracer::scene::Bounds { min: LOW.as_dvec3(), max: (LOW + SIZE).as_dvec3() };
    if case.is_studio {
        scene.lights = default_lights(&bounds, DVec3::Z, &view);
        scene.background = Background::default_for(Vec3::Z);
    } else {
        let position = DVec3::new(0.0, 0.0, 10.0);
        scene.lights.push(Light::point(position, DVec3::ZERO, Vec3::ONE));
    }
    scene.ground =
        case.has_ground.then(|| checkerboard(Ground::under(&bounds, Vec3::Z, DVec3::ZERO)));
    scene
}

/// `ground` with squares, which fades out near the particles.
fn checkerboard(ground: Ground) -> Ground {
    let pattern = Pattern::Checker { tile: 0.7 };
    Ground { pattern, fade_start: 1.0, fade_end: 3.0, ..ground }
}

/// An image with details that are smaller than the pixels of environments.
fn detailed_map() -> RadianceMap {
    let (width, height) = (1501, 751);
    let pixel = |i: usize| {
        let square = i % width / 3 + i / width / 3;
        Vec3::new(
            if square.is_multiple_of(2) { 1.5 } else { 0.1 },
            0.5,
            (i % width) as f32 / 1501.0,
        )
    };
    RadianceMap::new(width, height, (0..width * height).map(pixel).collect()).expect("a valid size")
}

fn path_scene(paths: Paths, camera: Camera) -> Scene {
    let bounds =
        spherule_tracer::scene::Bounds { min: LOW.as_dvec3(), max: (LOW + SIZE).as_dvec3() };
    let lens = if paths == Paths::Lens { 0.05 } else { 0.0 };
    let mut scene = Scene::new(camera.with_lens(Lens { radius: lens, focus: 6.0 }));
    let axes = EnvironmentAxes::of_view(DVec3::new(0.3, 1.0, -0.2), DVec3::Z, 20.0);
    let environment = match paths {
        Paths::Lights => None,
        Paths::Plastic => Some(Environment::from_fn(axes, |d| {
            0.5 + 0.5 * d + 20.0 * f32::from(d.x > 0.9) * Vec3::ONE
        })),
        Paths::Detail => {
            let detail = DetailMap::of(&detailed_map()).map(std::sync::Arc::new);
            let environment = Environment::from_map(axes, &detailed_map(), Vec3::ONE);
            Some(environment.with_detail(detail, Vec3::new(1.0, 0.9, 1.2)))
        }
        _ => Some(environment::studio(axes, Vec3::ONE)),
    };
    scene.environment = environment.map(std::sync::Arc::new);
    scene.is_environment_visible = matches!(paths, Paths::Plastic | Paths::Mirrors | Paths::Detail);
    scene.background = Background::Studio { up: Vec3::Z };
    let finish = match paths {
        Paths::Plastic | Paths::Coats => Finish::Plastic { roughness: 0.4 },
        Paths::Metal | Paths::Mirrors => Finish::Metal { roughness: 0.3 },
        Paths::Detail => Finish::Metal { roughness: 0.05 },
        _ => Finish::Matte,
    };
    scene.materials[MaterialId::PARTICLES.index()].finish = finish;
    let ground = Ground::under(&bounds, Vec3::Z, DVec3::ZERO);
    let light = |kind, radiance| Light { kind, ..Light::point(DVec3::ZERO, DVec3::ZERO, radiance) };
    let visible = |kind| Light { is_visible: true, ..light(kind, Vec3::splat(4.0)) };
    match paths {
        Paths::Metal => {
            scene.ground = Some(checkerboard(ground));
        }
        Paths::Look | Paths::Catcher | Paths::Backdrop | Paths::Mirrors | Paths::Coats => {
            scene.ground = Some(ground.into_shadow_catcher(0.8))
        }
        Paths::Lights => {
            let sphere = LightKind::Sphere { center: Vec3::new(3.0, 4.0, 1.0), radius: 0.5 };
            let rectangle = LightKind::Rectangle {
                center: Vec3::new(5.0, 5.0, 3.0),
                axes: [Vec3::X, -Vec3::Y, -Vec3::Z],
                half: [1.5, 1.0],
            };
            let normal = Vec3::new(0.0, 1.0, 0.0);
            let disc = LightKind::Disc { center: Vec3::new(5.0, 2.0, -1.0), normal, radius: 0.4 };
            scene.lights.extend([sphere, rectangle, disc].map(visible));
            scene.ground = Some(ground);
        }
        _ => {}
    }
    if matches!(paths, Paths::Catcher | Paths::Mirrors | Paths::Coats) {
        let to_light = Vec3::new(-0.4, -0.3, 0.8).normalize();
        let kind = LightKind::Sun { to_light, half_angle: 0.02 };
        scene.lights.push(light(kind, Vec3::splat(2.0)));
    }
    if paths == Paths::Backdrop {
        let position = DVec3::new(0.0, 0.0, 10.0);
        scene.lights.push(Light::point(position, DVec3::ZERO, Vec3::ONE));
    }
    scene.environment_group = 1;
    for (number, light) in (0..).zip(&mut scene.lights) {
        light.group = 2 + number % 2;
    }
    scene
}

/// What the pixels of two pictures differ in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Difference {
    /// Pixels with another id.
    pub(crate) ids: usize,
    /// Pixels whose depth, normal, position or coverage has other bits.
    pub(crate) depths: usize,
    pub(crate) normals: usize,
    pub(crate) positions: usize,
    pub(crate) coverages: usize,
    /// Pixels with other objects of Cryptomatte.
    pub(crate) mattes: usize,
    /// The largest of the means of the differences of a plane with parts of the light, relative to the mean colour; and
    /// the mean of all these planes.
    pub(crate) layers: [f64; 2],
    /// The largest difference of a colour.
    pub(crate) color: f32,
    /// The mean of the differences of colours, relative to the mean colour; and that of their sums over all pixels.
    pub(crate) mean: f64,
    pub(crate) bias: f64,
    /// Whether as many rays were traced.
    pub(crate) rays: bool,
    /// Rays to other surfaces and to lights, relative to those of the CPU.
    pub(crate) ray_ratio: f64,
    /// The part of the light that a clamp takes away, here and on the CPU.
    pub(crate) lost: [f64; 2],
}

fn shading<'a>(case: &Case, particles: &'a Particles, map: &'a ColorMap) -> ParticleShading<'a> {
    let color = Vec3::new(0.6, 0.7, 0.9);
    let values = &particles.values[..];
    ParticleShading {
        colors: if case.is_mapped {
            Colors::Mapped { values, map }
        } else {
            Colors::Constant(color)
        },
        opacities: match case.opacity {
            Some(Opacity::Common(opacity)) => Opacities::Constant(opacity),
            Some(Opacity::Each) => Opacities::Mapped { values, range: [0.2, 0.9] },
            Some(Opacity::Style(_)) | None => Opacities::Constant(1.0),
        },
        styles: match case.opacity {
            Some(Opacity::Style(opacity)) => vec![StyleShading {
                first: u32::try_from(case.particles / 2).expect("few particles"),
                material: MaterialId::PARTICLES,
                colors: Colors::Constant(Vec3::new(0.9, 0.3, 0.2)),
                opacities: Opacities::Constant(opacity),
            }],
            _ => Vec::new(),
        },
        ..ParticleShading::constant(color)
    }
}

fn color_map() -> ColorMap {
    ColorMap::new("viridis", 0.0, 1.0).expect("a known map")
}

/// Copies the particles of `case` to the device.
pub(crate) fn prepare(renderer: &mut SceneRenderer, case: &Case) -> Result<(), GpuError> {
    let particles = Particles::new(case);
    let displacements = particles.displacements.as_deref();
    let map = color_map();
    let shading = shading(case, &particles, &map);
    renderer.prepare(&particles.spheres(), displacements, &shading, case.glass.is_some())
}

/// The film of the device.
pub(crate) fn film(renderer: &mut SceneRenderer, case: &Case) -> (Film, Cost) {
    let (particles, map) = (Particles::new(case), color_map());
    film_of(renderer, case, &particles, &shading(case, &particles, &map), None)
}

pub(crate) fn film_of(
    renderer: &mut SceneRenderer,
    case: &Case,
    particles: &Particles,
    shading: &ParticleShading<'_>,
    denoise: Option<DenoiseSettings>,
) -> (Film, Cost) {
    let displacements = particles.displacements.as_deref();
    (renderer.prepare(&particles.spheres(), displacements, shading, case.glass.is_some()))
        .expect("the frame fits");
    let mut film = Film::default();
    let never = AtomicBool::new(false);
    let cost = renderer
        .render_into(&mut film, &scene(case, 0.0), shading, &case.settings(), denoise, &never)
        .expect("nothing stops the picture");
    (film, cost)
}

/// A picture that `stop` may stop.
pub(crate) fn stopped(
    renderer: &mut SceneRenderer,
    case: &Case,
    stop: &dyn Stop,
) -> Result<Cost, SceneError> {
    let (particles, map) = (Particles::new(case), color_map());
    let shading = shading(case, &particles, &map);
    let displacements = particles.displacements.as_deref();
    renderer.prepare(&particles.spheres(), displacements, &shading, case.glass.is_some())?;
    let mut film = Film::default();
    renderer.render_into(&mut film, &scene(case, 0.0), &shading, &case.settings(), None, stop)
}

/// Renders and denoises `case` on both: the mean of the differences, relative to the mean colour; and how much denoising
/// changes.
pub(crate) fn compare_denoised(
    renderer: &mut SceneRenderer,
    case: &Case,
    level: SimdLevel,
) -> [f64; 2] {
    let (particles, map) = (Particles::new(case), color_map());
    let shading = shading(case, &particles, &map);
    let (found, _) = film_of(renderer, case, &particles, &shading, case.denoise());
    let (noisy, _) = film_of_cpu(case, &particles, &shading, level);
    let expected = denoised(case, &noisy);
    let values = |pixels: &[[f32; 4]]| pixels.as_flattened().iter().map(|v| f64::from(*v)).sum();
    let total: f64 = values(&expected);
    let difference = |of: &[[f32; 4]]| {
        let pairs = of.as_flattened().iter().zip(expected.as_flattened());
        pairs.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / total
    };
    [difference(&found.color), difference(&noisy.color)]
}

/// The picture of `film`, denoised on the CPU.
fn denoised(case: &Case, film: &Film) -> Vec<[f32; 4]> {
    let input = DenoiseInput {
        width: film.width,
        height: film.height,
        views: [1, 1],
        samples: case.samples,
        is_transparent: case.settings().transparent_background,
        color: &film.color,
        odd: film.odd.as_deref().expect("it has features"),
        albedo: film.plane(FilmPlane::Albedo).expect("it has features"),
        normal: film.plane(FilmPlane::Normal).expect("it has features"),
        depth: film.plane(FilmPlane::Depth).expect("it has features"),
    };
    let settings = case.denoise().expect("it has two samples");
    denoise(&input, &settings).expect("the planes have the size of the film")
}

/// The film of the CPU, traced with the kernels of `level`.
pub(crate) fn film_of_cpu(
    case: &Case,
    particles: &Particles,
    shading: &ParticleShading<'_>,
    level: SimdLevel,
) -> (Film, RayCounts) {
    let mut builder = TreeBuilder::new();
    builder.build(&particles.spheres(), &BuildSettings::default());
    builder.tree_mut().set_simd(level);
    let mut moving = MovingTree::default();
    let surface: Box<dyn Shape> = match &particles.displacements {
        Some(displacements) => {
            moving.build(&builder.tree().view(), displacements);
            Box::new(MovingSpheres::new(&moving))
        }
        None => Box::new(SphereSurface::new(builder.tree().view())),
    };
    let never = AtomicBool::new(false);
    render(&[&*surface], &scene(case, 0.0), shading, &case.settings(), &never)
        .expect("nothing stops the picture")
}

/// Renders `case` on both, and compares all planes.
pub(crate) fn compare(renderer: &mut SceneRenderer, case: &Case, level: SimdLevel) -> Difference {
    let (particles, map) = (Particles::new(case), color_map());
    let shading = shading(case, &particles, &map);
    let (found, cost) = film_of(renderer, case, &particles, &shading, None);
    let (expected, rays) = film_of_cpu(case, &particles, &shading, level);
    let differing = |plane, components: usize| {
        let [a, b] = [&found, &expected].map(|film| film.plane::<u32>(plane).expect("all exist"));
        let pixels = a.chunks(components).zip(b.chunks(components));
        // Zeros of both signs are equal
        let is_equal = |(a, b): (&u32, &u32)| a == b || (a | b) == 1 << 31;
        pixels.filter(|(a, b)| !a.iter().zip(*b).all(is_equal)).count()
    };
    let colors = || found.color.iter().zip(&expected.color);
    let largest = colors()
        .flat_map(|(a, b)| (0..3).map(|axis| (a[axis] - b[axis]).abs()))
        .fold(0.0, f32::max);
    let sum =
        |of: &dyn Fn(&[f32; 4], &[f32; 4]) -> f64| colors().map(|(a, b)| of(a, b)).sum::<f64>();
    let rgb = |c: &[f32; 4]| c[..3].iter().map(|v| f64::from(*v)).sum::<f64>();
    let distance = |a: &[f32; 4], b: &[f32; 4]| {
        (0..4).map(|axis| f64::from((a[axis] - b[axis]).abs())).sum::<f64>()
    };
    let total = sum(&|_, b| rgb(b)).max(1e-9);
    let layers = LAYERS.map(|plane| {
        let values = |film: &Film| film.plane::<f32>(plane).unwrap_or_default().to_vec();
        let (a, b) = (values(&found), values(&expected));
        let pairs = a.iter().zip(&b);
        let differences = pairs.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>();
        let size = b.iter().map(|b| f64::from(*b)).sum::<f64>();
        [differences / total, size / total]
    });
    let secondary = |rays: RayCounts| (rays.shadow + rays.reflection + rays.refraction) as f64;
    Difference {
        mean: sum(&distance) / total,
        bias: (sum(&|a, _| rgb(a)) / total - 1.0).abs(),
        lost: [(&found, ray_counts(&cost)), (&expected, rays)]
            .map(|(film, rays)| rays.lost.part(&film.color, case.samples)),
        ray_ratio: secondary(ray_counts(&cost)) / secondary(rays).max(1.0),
        mattes: if case.has_mattes {
            let levels = 2 * usize::from(case.settings().channels.layers.matte_levels);
            let kinds =
                [FilmPlane::CryptoParticle, FilmPlane::CryptoMaterial, FilmPlane::CryptoPart];
            kinds.into_iter().map(|plane| differing(plane, levels)).sum()
        } else {
            0
        },
        layers: [
            layers.iter().map(|[difference, _]| *difference).fold(0.0, f64::max),
            layers.iter().map(|[_, size]| *size).sum(),
        ],
        ids: differing(FilmPlane::Id, 1),
        depths: differing(FilmPlane::Depth, 1),
        normals: differing(FilmPlane::Normal, 3),
        positions: differing(FilmPlane::Position, 3),
        coverages: colors().filter(|(a, b)| a[3] != b[3]).count(),
        color: largest,
        rays: ray_counts(&cost) == rays,
    }
}
