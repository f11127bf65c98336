//! What the denoiser takes for a picture of 1920x1080: CPU seconds of one thread, and the noise before and after.
//!
//! ```text
//! cargo bench --bench denoise
//! ```
//!
//! The time hardly depends on the picture. This one is a floor under a grid of balls, with uniform noise.

#![expect(clippy::print_stdout, reason = "the table is what it is for")]
#![expect(clippy::cast_precision_loss, reason = "coordinates and noise need no more digits")]

use std::env;

use glam::Vec3;
use spherule::denoise::{DenoiseInput, DenoiseSettings, denoise};
use spherule::math::SimdLevel;

#[path = "support/cpu_time.rs"]
mod cpu_time;

use cpu_time::CpuTime;

/// Turns of each; the best counts.
const TURNS: usize = 7;
/// Name to filter by on the command line.
const NAME: &str = "denoise";
/// Amplitude of the noise of a half.
const AMPLITUDE: f32 = 0.3;
/// Pixels between the centres of balls.
const SPACING: usize = 60;

/// A picture with noise, its features, and what it is without noise.
struct Picture {
    width: usize,
    height: usize,
    color: Vec<[f32; 4]>,
    odd: Vec<[f32; 4]>,
    albedo: Vec<Vec3>,
    normal: Vec<Vec3>,
    depth: Vec<f32>,
    expected: Vec<Vec3>,
}

fn main() {
    let mut names = env::args().skip(1).filter(|a| !a.starts_with('-'));
    let has = |flag: &str| env::args().any(|argument| argument == flag);
    if has("--list") || names.any(|name| !NAME.contains(&name[..])) {
        return;
    }
    let is_quick = has("--test") || !has("--bench");
    let (turns, [width, height]) = if is_quick { (1, [96, 54]) } else { (TURNS, [1920, 1080]) };
    let picture = Picture::new(width, height);
    let simd = SimdLevel::best().name();
    println!("{width}x{height}, CPU seconds of one thread, best of {turns} turns, {simd}");
    println!("{:<8} {:>8} {:>8} {:>8}", "", "CPU s", "before", "after");
    let before = picture.error(picture.color.iter().map(|c| Vec3::new(c[0], c[1], c[2])));
    for (name, settings) in [("opaque", DenoiseSettings::OPAQUE), ("water", DenoiseSettings::WATER)]
    {
        let times = (0..turns).map(|_| picture.denoised(&settings));
        let (seconds, filtered) =
            times.min_by(|(a, _), (b, _)| a.total_cmp(b)).expect("at least one turn");
        let after = picture.error(filtered.into_iter());
        println!("{name:<8} {seconds:>8.3} {before:>8.4} {after:>8.4}");
    }
}

impl Picture {
    fn new(width: usize, height: usize) -> Self {
        let mut picture = Self {
            width,
            height,
            color: Vec::new(),
            odd: Vec::new(),
            albedo: Vec::new(),
            normal: Vec::new(),
            depth: Vec::new(),
            expected: Vec::new(),
        };
        let mut random = Random(1);
        for i in 0..width * height {
            picture.push([i % width, i / width], &mut random);
        }
        picture
    }

    /// Adds a pixel: of a ball, or of the floor.
    fn push(&mut self, position: [usize; 2], random: &mut Random) {
        let half = SPACING as f32 / 2.0;
        let [x, y] = position.map(|x| (x % SPACING) as f32 / half - 1.0);
        let is_ball = x * x + y * y < 0.8;
        let normal = if is_ball { Vec3::new(x, y, (1.0 - x * x - y * y).sqrt()) } else { Vec3::Z };
        let albedo = if is_ball { Vec3::new(0.2, 0.6, 0.5) } else { Vec3::splat(0.5) };
        let light = 0.3 + 0.7 * normal.dot(Vec3::new(0.48, 0.6, 0.64)).max(0.0);
        let expected = albedo * light;
        let [even, odd] = [0, 1].map(|_| expected + albedo * (AMPLITUDE * random.next()));
        self.color.push(even.midpoint(odd).extend(1.0).to_array());
        self.odd.push(odd.extend(1.0).to_array());
        self.albedo.push(albedo);
        self.normal.push(normal);
        self.depth.push(if is_ball { 9.0 - normal.z } else { 10.0 });
        self.expected.push(expected);
    }

    /// The CPU seconds of one thread, and the filtered picture.
    fn denoised(&self, settings: &DenoiseSettings) -> (f64, Vec<Vec3>) {
        let input = DenoiseInput {
            width: u32::try_from(self.width).expect("a small picture"),
            height: u32::try_from(self.height).expect("a small picture"),
            samples: 2,
            views: [1, 1],
            is_transparent: false,
            color: &self.color,
            odd: &self.odd,
            albedo: &self.albedo,
            normal: &self.normal,
            depth: &self.depth,
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        pool.expect("a thread").install(|| {
            let start = CpuTime::now();
            let filtered = denoise(&input, settings).expect("valid input");
            let colors = filtered.iter().map(|rgba| Vec3::from_slice(rgba)).collect();
            (start.seconds(), colors)
        })
    }

    /// Root of the mean squared error of a component.
    fn error(&self, pixels: impl Iterator<Item = Vec3>) -> f32 {
        let squares = pixels.zip(&self.expected).map(|(p, q)| p.distance_squared(*q));
        (squares.sum::<f32>() / (3 * self.expected.len()) as f32).sqrt()
    }
}

/// Pseudo-random numbers of -1 to 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        let multiplied = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = multiplied.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1_u32 << 23) as f32 - 1.0
    }
}
