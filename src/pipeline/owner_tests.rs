//! Pixels with the channels of a particle show that particle: for each surface, each source and all that has ids.

use std::fmt::Write as _;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};
use spherule_formats::{
    Attribute, AttributeData, ParticleFrame, Positions, RawParticles, SequenceInput, native,
    sequence::Sequence,
};
use tempfile::TempDir;

use super::setup::ColorRule;
use super::{CpuRenderer, FrameRenderer, ImageTask, Setup, load_frame};
use crate::manifest::Manifest;
use crate::render::cryptomatte::{ObjectName, object_of};
use crate::render::{Film, FilmPlane, NO_ID};
use crate::resolve::SceneInputs;
use crate::scene::ColorMap;
use crate::survey::Survey;

const COUNT: u32 = 240;
const RADIUS: f32 = 0.06;

/// Particles in a cube, most of them isolated, and a block of others that are near each other.
struct Particles {
    centers: Vec<Vec3>,
}

impl Particles {
    fn new() -> Self {
        let mut state = 7_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let center = |i: u32| match i % 3 {
            0 => Vec3::new(random(), random(), random()),
            _ => 0.08 * Vec3::from([i % 5, i / 5 % 5, i / 25].map(|c| c as f32)),
        };
        Self { centers: (0..COUNT).map(center).collect() }
    }

    fn id(index: u32) -> u32 {
        9000 - 7 * index
    }

    fn index(id: u32) -> u32 {
        let index = (9000 - id) / 7;
        assert!(index < COUNT && Self::id(index) == id, "no particle has the id {id}");
        index
    }

    fn velocity(index: u32) -> Vec3 {
        let turn = 0.7 * index as f32;
        0.05 * Vec3::new(turn.cos(), turn.sin(), 0.2)
    }

    fn mass(index: u32) -> f32 {
        0.5 + index as f32
    }

    fn part(index: u32) -> u32 {
        index % 2
    }

    /// Writes frame 1 with `offset`, and frame 2 without it and in another order.
    fn write(&self, name: &str) -> (TempDir, Sequence) {
        let directory = tempfile::tempdir().expect("a directory");
        for (frame, offset) in [(1, Vec3::new(0.0, 0.0, -0.1)), (2, Vec3::ZERO)] {
            let order: Vec<u32> = (0..COUNT).map(|i| (i * (2 * frame + 5)) % COUNT).collect();
            let path = directory.path().join(format!("f_{frame}.{name}"));
            match name {
                "csv" => fs::write(&path, self.csv(&order, offset)).expect("a file"),
                _ => {
                    let frame = ParticleFrame::from_raw(self.raw(&order, offset), DVec3::ZERO);
                    native::write(&path, &frame, None).expect("a file");
                }
            }
        }
        let sequence = Sequence::open(&SequenceInput::from_path(directory.path()));
        (directory, sequence.expect("two frames"))
    }

    fn csv(&self, order: &[u32], offset: Vec3) -> String {
        let mut text = "x,y,z,id,vx,vy,vz,mass,part\n".to_owned();
        for &i in order {
            let (p, v) = (self.centers[i as usize] + offset, Self::velocity(i));
            let (id, mass, part) = (Self::id(i), Self::mass(i), Self::part(i));
            writeln!(text, "{},{},{},{id},{},{},{},{mass},{part}", p.x, p.y, p.z, v.x, v.y, v.z)
                .expect("memory takes all");
        }
        text
    }

    fn raw(&self, order: &[u32], offset: Vec3) -> RawParticles {
        let attribute =
            |name: &str, components, data| Attribute { name: name.to_owned(), components, data };
        let velocities = order.iter().flat_map(|i| Self::velocity(*i).to_array());
        let masses = order.iter().map(|i| Self::mass(*i));
        let integers =
            |of: fn(u32) -> u32| AttributeData::U32(order.iter().map(|i| of(*i)).collect());
        let centers = order.iter().map(|i| self.centers[*i as usize] + offset);
        RawParticles {
            positions: Positions::F32(centers.collect()),
            attributes: vec![
                attribute("id", 1, integers(Self::id)),
                attribute("velocity", 3, AttributeData::F32(velocities.collect())),
                attribute("mass", 1, AttributeData::F32(masses.collect())),
                attribute("part", 1, integers(Self::part)),
            ],
            ..RawParticles::default()
        }
    }
}

const COMMON: &str = r#"
input.path = "in"
input.radius = 0.06
output.channels = ["RGBA", "P", "V", "id", "attribute:mass", "albedo", "crypto_particle"]
output.frame_time = 1.0
image.width = 96
image.height = 72
image.samples = 1
render.max_depth = 1
render.denoise = false
render.ground = "none"
material.color = { attribute = "mass", range = [0, 240] }
"#;

/// Renders frame 2 with `settings` in addition to the common ones.
fn rendered(sequence: &Sequence, settings: &str) -> (Setup, Film) {
    let manifest =
        Manifest::parse(&format!("{COMMON}{settings}"), Path::new("job.toml")).expect("valid");
    let inquiry = crate::resolve::Inquiry::of(&manifest);
    let survey = Survey::of(sequence, inquiry.question(None)).expect("readable");
    let setup =
        crate::resolve::setup(&manifest, &survey, SceneInputs::default()).expect("possible");
    let task = ImageTask {
        frame: 2,
        index: 1,
        image: PathBuf::new(),
        preview: None,
        meshes: Vec::new(),
        next_meshes: None,
        refused: None,
    };
    let loaded = load_frame(&setup, sequence, &task).expect("readable");
    let mut renderer = CpuRenderer::default();
    let built = renderer.prepare(&setup, loaded).expect("a tree");
    let image = renderer.image(&setup, &built, &AtomicBool::new(false));
    (setup, image.expect("an image").0)
}

/// Checks all pixels with an id: their distance in radii from the centre of the particle is in `distances`, and all
/// other channels have its values. Returns the number of different particles.
#[track_caller]
fn check(particles: &Particles, film: &Film, distances: &Range<f32>, name: &str) -> usize {
    let ids = film.plane::<u32>(FilmPlane::Id).expect("requested");
    let points = film.plane::<Vec3>(FilmPlane::Position).expect("requested");
    let velocities = film.plane::<Vec3>(FilmPlane::Velocity).expect("requested");
    let masses = film.plane::<f32>(FilmPlane::Attributes).expect("requested");
    let levels = film.channels.components(FilmPlane::CryptoParticle);
    let objects = film.plane::<u32>(FilmPlane::CryptoParticle).expect("requested");
    let mut seen = Vec::new();
    for (pixel, id) in ids.iter().enumerate().filter(|(_, id)| **id != NO_ID) {
        let index = Particles::index(*id);
        let distance = points[pixel].distance(particles.centers[index as usize]) / RADIUS;
        assert!(
            distances.contains(&distance),
            "{name}: pixel {pixel}: particle {index} is {distance} radii away"
        );
        assert_eq!(velocities[pixel], Particles::velocity(index), "{name}: V");
        assert_eq!(masses[pixel], Particles::mass(index), "{name}: mass");
        let object = object_of(ObjectName::of_particle(*id).as_bytes());
        assert_eq!(objects[pixel * levels], object, "{name}: Cryptomatte");
        seen.push(index);
    }
    seen.sort_unstable();
    seen.dedup();
    seen.len()
}

/// What draws the particles, and how far its points are from their centres, in radii.
const SURFACES: [(&str, &str, Range<f32>); 11] = [
    ("spheres", "", 0.99..1.01),
    (
        "cut spheres",
        "clip = [{ type = \"plane\", normal = \"z\", point = [0, 0, 0.3], mode = \"cut\" }]",
        0.0..1.01,
    ),
    ("parts", "material.part = [{ parts = [1], color = [1, 0, 0] }]", 0.99..1.01),
    ("union", "render.surface = \"union\"", 0.99..1.01),
    ("smooth", "render.surface = \"smooth\"", 0.0..2.5),
    ("smooth, soft spray", "render.surface = \"smooth\"\nsurface.spray = true", 0.0..2.5),
    (
        "smooth, spheres of spray",
        "render.surface = \"smooth\"\nsurface.spray = true\nsurface.spray_style = \"spheres\"",
        0.0..2.5,
    ),
    // Drops are up to 4.5 radii away, and foam is moved by up to 2 to the surface; their own radii come on top
    (
        "smooth, soft whitewater",
        "render.surface = \"smooth\"\nsurface.whitewater = true\nsurface.whitewater_speed = 0.05",
        0.0..7.0,
    ),
    (
        "smooth, spheres of whitewater",
        "render.surface = \"smooth\"\nsurface.whitewater = true\nsurface.whitewater_speed = 0.05\n\
         surface.whitewater_size = 2\nsurface.spray_style = \"spheres\"",
        0.0..7.0,
    ),
    ("union, soft spray", "render.surface = \"union\"\nsurface.spray = true", 0.0..2.0),
    (
        "union, spheres of spray",
        "render.surface = \"union\"\nsurface.spray = true\nsurface.spray_style = \"spheres\"",
        0.49..1.01,
    ),
];

// Renders 66 images: eleven surfaces from two sources, as a whole, selected and moving.
#[test]
fn each_pixel_has_the_values_of_the_particle_that_it_shows() {
    let particles = Particles::new();
    for source in ["csv", "spf"] {
        let (_directory, sequence) = particles.write(source);
        for (surface, settings, distances) in &SURFACES {
            for (variant, more, moved) in [
                ("all", "", 0.0),
                ("selected", "select.where = \"mass < 200\"", 0.0),
                // Particles move by half of 0.05, to both sides
                ("moving", "camera.shutter = 1.0", 0.025 / RADIUS),
            ] {
                let name = format!("{source}, {surface}, {variant}");
                let (_, film) = rendered(&sequence, &format!("{settings}\n{more}\n"));
                let distances = distances.start - moved..distances.end + moved;
                let seen = check(&particles, &film, &distances, &name);
                // A smooth body shows few of its particles
                assert!(seen > 2, "{name}: {seen} particles");
            }
        }
    }
}

/// The colour of the particle that each pixel of a rod is near.
#[test]
fn rods_have_the_colours_of_their_particles() {
    let particles = Particles::new();
    for source in ["csv", "spf"] {
        let (_directory, sequence) = particles.write(source);
        for (name, settings, reach) in [
            (
                "arrows",
                "arrows = [{ attribute = \"velocity\", scale = 2, radius = 0.01, color = \"auto\" }]",
                0.14,
            ),
            ("trails", "trails = { frames = 1, radius = 0.03, color = \"auto\" }", 0.14),
            ("bonds", "bonds = { find = 0.25, radius = 0.03 }", 0.16),
        ] {
            let (setup, film) = rendered(&sequence, settings);
            let ColorRule::Attribute { map, .. } = &setup.picture.particles.first().color else {
                panic!("{name}: no map");
            };
            let count = check_rods(&particles, &film, map, reach, &format!("{source}, {name}"));
            assert!(count > 20, "{source}, {name}: {count} pixels");
        }
    }
}

/// Checks that each pixel of a surface without an id has the colour of a particle at most `reach` away. Returns their
/// number.
#[track_caller]
fn check_rods(particles: &Particles, film: &Film, map: &ColorMap, reach: f32, name: &str) -> usize {
    let ids = film.plane::<u32>(FilmPlane::Id).expect("requested");
    let points = film.plane::<Vec3>(FilmPlane::Position).expect("requested");
    let albedo = film.plane::<Vec3>(FilmPlane::Albedo).expect("requested");
    let mut count = 0;
    for (pixel, id) in ids.iter().enumerate() {
        if *id != NO_ID || film.color[pixel][3] == 0.0 || albedo[pixel] == Vec3::ZERO {
            continue;
        }
        count += 1;
        let is_owner = |index: &u32| {
            let color = map.color(Particles::mass(*index));
            let distance = points[pixel].distance(particles.centers[*index as usize]);
            distance < reach && color.abs_diff_eq(albedo[pixel], 1e-4)
        };
        assert!((0..COUNT).any(|i| is_owner(&i)), "{name}: pixel {pixel}");
    }
    count
}
