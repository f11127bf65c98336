//! Particles of several kinds, and comparisons of the pictures of a device with those of the CPU.

#![allow(dead_code, reason = "each program uses its own part")]

use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use spherule_gpu::{Cost, GpuError, SceneError, SceneRenderer, ray_counts};
use spherule_surface::spheres::SphereSurface;
use spherule_tracer::render::{
    Channels, Colors, DataWindow, Film, FilmPlane, ParticleShading, RayCounts, RenderSettings,
    render,
};
use spherule_tracer::scene::{
    Background, Camera, CameraView, ColorMap, Light, Projection, Scene, default_lights,
};
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

/// A picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Case {
    pub(crate) data: Data,
    pub(crate) radii: Radii,
    pub(crate) particles: usize,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) samples: u32,
    pub(crate) max_depth: u32,
    /// Parallel rays.
    pub(crate) is_parallel: bool,
    /// Colours by an attribute.
    pub(crate) is_mapped: bool,
    /// Two lights, one of them without shadows, and a gradient as background.
    pub(crate) is_studio: bool,
    /// Position of the film in the image, if it is a part of it.
    pub(crate) window: Option<[i32; 2]>,
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
            max_depth: 3,
            is_parallel: false,
            is_mapped: false,
            is_studio: false,
            window: None,
        }
    }

    /// A picture of the thesis, with three reflections.
    pub(crate) const fn thesis(particles: usize) -> Self {
        Self { particles, width: 1920, height: 1080, samples: 1, max_depth: 4, ..Self::small() }
    }

    /// The settings of the picture.
    pub(crate) fn settings(&self) -> RenderSettings {
        let names = ["RGBA", "Z", "N", "P", "V", "id"];
        RenderSettings {
            samples: self.samples,
            max_depth: self.max_depth,
            channels: Channels::from_names(names).expect("known names"),
            window: self.window.map(|[left, top]| DataWindow {
                image: [self.width, self.height],
                left,
                top,
            }),
            ..RenderSettings::new(self.width, self.height)
        }
    }
}

/// Particles with a value each.
pub(crate) struct Particles {
    pub(crate) centers: Vec<Vec3>,
    pub(crate) common: f32,
    pub(crate) radii: Option<Vec<f32>>,
    pub(crate) values: Vec<f32>,
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
            values: if case.is_mapped {
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

/// A scene: the camera of the thesis, turned by `angle` radians.
pub(crate) fn scene(case: &Case, angle: f64) -> Scene {
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
    let mut scene = Scene::new(camera.expect("a valid view"));
    if case.is_studio {
        let bounds =
            spherule_tracer::scene::Bounds { min: LOW.as_dvec3(), max: (LOW + SIZE).as_dvec3() };
        scene.lights = default_lights(&bounds, DVec3::Z, &view);
        scene.background = Background::default_for(Vec3::Z);
    } else {
        let position = DVec3::new(0.0, 0.0, 10.0);
        scene.lights.push(Light::point(position, DVec3::ZERO, Vec3::ONE));
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
    /// The largest difference of a colour.
    pub(crate) color: f32,
    /// Whether as many rays were traced.
    pub(crate) rays: bool,
}

fn shading<'a>(particles: &'a Particles, map: &'a ColorMap) -> ParticleShading<'a> {
    let color = Vec3::new(0.6, 0.7, 0.9);
    let colors = if particles.values.is_empty() {
        Colors::Constant(color)
    } else {
        Colors::Mapped { values: &particles.values, map }
    };
    ParticleShading { colors, ..ParticleShading::constant(color) }
}

fn color_map() -> ColorMap {
    ColorMap::new("viridis", 0.0, 1.0).expect("a known map")
}

/// Copies the particles of `case` to the device.
pub(crate) fn prepare(renderer: &mut SceneRenderer, case: &Case) -> Result<(), GpuError> {
    let particles = Particles::new(case);
    renderer.prepare(&particles.spheres(), &shading(&particles, &color_map()))
}

/// The film of the device.
pub(crate) fn film(renderer: &mut SceneRenderer, case: &Case) -> (Film, Cost) {
    let (particles, map) = (Particles::new(case), color_map());
    film_of(renderer, case, &particles, &shading(&particles, &map), 0.0)
}

pub(crate) fn film_of(
    renderer: &mut SceneRenderer,
    case: &Case,
    particles: &Particles,
    shading: &ParticleShading<'_>,
    angle: f64,
) -> (Film, Cost) {
    renderer.prepare(&particles.spheres(), shading).expect("the frame fits");
    let mut film = Film::default();
    let never = AtomicBool::new(false);
    let cost = renderer
        .render_into(&mut film, &scene(case, angle), shading, &case.settings(), &never)
        .expect("nothing stops the picture");
    (film, cost)
}

/// A picture that is stopped from the start.
pub(crate) fn stopped(renderer: &mut SceneRenderer, case: &Case) -> Result<Cost, SceneError> {
    let (particles, map) = (Particles::new(case), color_map());
    let shading = shading(&particles, &map);
    renderer.prepare(&particles.spheres(), &shading)?;
    let raised = AtomicBool::new(true);
    let mut film = Film::default();
    renderer.render_into(&mut film, &scene(case, 0.0), &shading, &case.settings(), &raised)
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
    let surface = SphereSurface::new(builder.tree().view());
    let never = AtomicBool::new(false);
    render(&[&surface], &scene(case, 0.0), shading, &case.settings(), &never)
        .expect("nothing stops the picture")
}

/// Renders `case` on both, and compares all planes.
pub(crate) fn compare(renderer: &mut SceneRenderer, case: &Case, level: SimdLevel) -> Difference {
    let (particles, map) = (Particles::new(case), color_map());
    let shading = shading(&particles, &map);
    let (found, cost) = film_of(renderer, case, &particles, &shading, 0.0);
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
    Difference {
        ids: differing(FilmPlane::Id, 1),
        depths: differing(FilmPlane::Depth, 1),
        normals: differing(FilmPlane::Normal, 3),
        positions: differing(FilmPlane::Position, 3),
        coverages: colors().filter(|(a, b)| a[3] != b[3]).count(),
        color: largest,
        rays: ray_counts(&cost) == rays,
    }
}
