//! The thesis's scene (box, camera, radius, 1920x1080) through the program: how many pixels meet a
//! particle, and how long their rays are. The figures come from independent tracers on the same
//! particles.

use std::fs;
use std::path::Path;

use spherule_formats::{FrameFile, Positions};

use crate::harness::Workshop;
use crate::picture::Picture;

const WIDTH: usize = 1920;
const HEIGHT: usize = 1080;

/// What a scene of so many particles must come out as.
struct Expected {
    particles: u32,
    /// Pixels that meet a particle at their centre.
    hits: usize,
    /// Sum of their rays' lengths.
    lengths: f64,
}

const SMALL: Expected = Expected { particles: 100_000, hits: 614_870, lengths: 4_319_062.67 };
const MIDDLE: Expected = Expected { particles: 1_000_000, hits: 622_911, lengths: 4_360_322.20 };
const LARGE: Expected = Expected { particles: 10_000_000, hits: 626_647, lengths: 4_378_820.36 };

// The figures are those of 1920x1080 pixels, so the image cannot be smaller.
#[test]
fn the_box_of_a_hundred_thousand() {
    SMALL.check("npy");
}

#[test]
fn the_box_of_a_million() {
    MIDDLE.check("spf");
}

#[test]
#[ignore = "takes minutes unless built with --release"]
fn the_box_of_ten_million() {
    LARGE.check("npy");
}

impl Expected {
    /// Generates, renders and measures in a directory of its own.
    #[track_caller]
    fn check(&self, extension: &str) {
        let workshop = Workshop::new();
        let file = generate(&workshop, self.particles, extension);
        fs::write(workshop.join("box.toml"), self.manifest(&file)).expect("a manifest");
        let arguments = ["render", "box.toml", "--progress", "none"];
        workshop.run(&arguments).expect(0);
        let picture = Picture::open(&workshop.join("out/box.exr"));
        assert_eq!((picture.width, picture.height), (WIDTH, HEIGHT));

        let depths = picture.floats("Z");
        let hits = depths.iter().filter(|z| z.is_finite()).count();
        assert_eq!(hits, self.hits, "pixels with a finite Z");
        let covered = picture.floats("A").iter().filter(|a| **a > 0.0).count();
        assert_eq!(covered, self.hits, "pixels with A above 0");
        let lengths = ray_lengths(depths);
        let off = (lengths - self.lengths).abs() / self.lengths;
        assert!(off <= 2e-6, "{lengths} is off by {off:e} of {}", self.lengths);
    }

    /// The scene of the thesis; nothing but primary rays is needed here.
    fn manifest(&self, input: &str) -> String {
        let radius = 0.5 * (48.0 / f64::from(self.particles)).cbrt();
        format!(
            r#"
            [input]
            path = "{input}"
            radius = {radius:?}
            [camera]
            eye = [0.0, 0.0, 0.0]
            look_at = [5.0, 5.0, 0.0]
            up = [0.0, 0.0, 1.0]
            fov = 45.0
            [image]
            width = {WIDTH}
            height = {HEIGHT}
            samples = 1
            [render]
            max_depth = 1
            [material]
            diffuse = 0.0
            specular = 0.0
            [output]
            path = "out/box.exr"
            channels = ["RGBA", "Z"]
            compression = "none"
            preview = false
            "#
        )
    }
}

/// The sum over all pixels with a depth of the distance that their ray goes, in f64.
fn ray_lengths(depths: &[f32]) -> f64 {
    let (width, height) = (WIDTH as f64, HEIGHT as f64);
    let half_height = 22.5_f64.to_radians().tan();
    let half_width = half_height * width / height;
    let rows = depths.chunks_exact(WIDTH).zip(0..HEIGHT);
    rows.flat_map(|(row, y)| {
        let up = (1.0 - 2.0 * (y as f64 + 0.5) / height) * half_height;
        row.iter().zip(0..WIDTH).map(move |(z, x)| {
            let right = (2.0 * (x as f64 + 0.5) / width - 1.0) * half_width;
            // 1 over the cosine between the pixel's ray and the view axis.
            f64::from(*z) * (1.0 + right * right + up * up).sqrt()
        })
    })
    .filter(|length| length.is_finite())
    .sum()
}

/// `spherule generate box`; the file's name in the workshop.
#[track_caller]
fn generate(workshop: &Workshop, particles: u32, extension: &str) -> String {
    let (count, name) = (particles.to_string(), format!("box.{extension}"));
    let arguments = ["generate", "box", "--particles", &count, "--seed", "1"];
    let output = ["-o", &name];
    workshop.run(&[&arguments[..], &output].concat()).expect(0);
    name
}

/// The particles of a file, bit by bit.
#[track_caller]
fn positions(path: &Path) -> Vec<[u32; 3]> {
    let raw = FrameFile::open(path).and_then(|file| file.read(0));
    match raw.expect("a generated file").positions {
        Positions::F32(v) => v.iter().map(|p| p.to_array().map(f32::to_bits)).collect(),
        Positions::F64(_) => panic!("generated particles are f32"),
    }
}

#[test]
fn every_format_contains_the_same_particles() {
    let workshop = Workshop::new();
    let mut expected = box_by_hand(1000);
    for extension in ["npy", "vtk"] {
        let name = generate(&workshop, 1000, extension);
        let found = positions(&workshop.join(name));
        assert!(found == expected, "{extension}");
    }
    // Native frames are in tree order.
    let name = generate(&workshop, 1000, "spf");
    let mut found = positions(&workshop.join(name));
    found.sort_unstable();
    expected.sort_unstable();
    assert!(found == expected, "spf");
}

/// The generator as its documentation describes it, written apart from the program's.
fn box_by_hand(count: usize) -> Vec<[u32; 3]> {
    let mut state = 1_u64;
    let mut unit = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 * 2_f32.powi(-24)
    };
    let axes = [(3.0_f32, 7.0), (5.0, 8.0), (-2.0, 2.0)];
    let mut particle = || axes.map(|(min, max)| (min + unit() * (max - min)).to_bits());
    (0..count).map(|_| particle()).collect()
}
