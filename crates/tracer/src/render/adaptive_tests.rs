//! Tiles that take more samples than others: in pictures of fireflies, those near the ball are noisy, and those far away are
//! not.

use std::sync::atomic::AtomicBool;

use glam::Vec3;

use super::clamp_tests::{METAL, fireflies};
use super::path_tests::settings;
use super::{brute::Balls, *};

/// A picture of several tiles; those at its right and its lower edge are smaller.
fn large(samples: u32, noise: Option<NoiseLimit>) -> RenderSettings {
    let mut channels =
        Channels::from_names(["RGBA", "Z", "id", "lights", "crypto_material"]).unwrap();
    channels.layers.set_light_groups(1);
    RenderSettings {
        width: 90,
        height: 70,
        noise,
        channels,
        has_features: true,
        ..settings(90, samples, 4)
    }
}

fn picture(settings: &RenderSettings) -> (Film, RayCounts) {
    let (ball, source) = (Balls::one(Vec3::new(0.0, 0.0, 0.4), 0.4), Vec3::splat(0.8));
    let (scene, never) = (fireflies(METAL), AtomicBool::new(false));
    render(&[&ball], &scene, &ParticleShading::constant(source), settings, &never).unwrap()
}

/// The left and upper edges of all tiles.
fn tiles() -> impl Iterator<Item = [u32; 2]> {
    (0..70).step_by(16).flat_map(|top| (0..90).step_by(16).map(move |left| [left, top]))
}

/// The bits of all planes of the pixels in the tile at `left` and `top`.
fn tile_of(film: &Film, [left, top]: [u32; 2]) -> Vec<u32> {
    let (right, bottom) = ((left + 16).min(film.width), (top + 16).min(film.height));
    let rows = (top..bottom).flat_map(|y| (left..right).map(move |x| y * film.width + x));
    let mut bits = Vec::new();
    for pixel in rows.map(|pixel| pixel as usize) {
        bits.extend(film.color[pixel].map(f32::to_bits));
        bits.extend(film.odd.as_ref().unwrap()[pixel].map(f32::to_bits));
        for plane in FilmPlane::all() {
            let words = film.plane::<u32>(plane).unwrap_or_default();
            let size = words.len() / film.color.len();
            bits.extend(&words[pixel * size..(pixel + 1) * size]);
        }
    }
    bits
}

#[test]
fn only_noisy_tiles_have_more_samples() {
    let limit = NoiseLimit { noise: 0.03, max_samples: 100 };
    let (film, counts) = picture(&large(4, Some(limit)));
    let (plain, _) = picture(&large(4, None));
    let same = tiles().filter(|at| tile_of(&film, *at) == tile_of(&plain, *at)).count();
    assert!(same > 3 && same < 20, "{same}");
    assert!(counts.samples > 8 * 90 * 70 && counts.samples < 100 * 90 * 70, "{}", counts.samples);
    // No camera ray is in vain
    assert_eq!(counts.primary, counts.samples);
    // Data of the nearest sample are those of the first pass
    for plane in [FilmPlane::Depth, FilmPlane::Id] {
        assert_eq!(film.plane::<u32>(plane), plain.plane::<u32>(plane));
    }
    // Layers of light add up to the colour, and objects to the coverage
    let classes = ["diffuse", "specular", "reflection", "refraction", "emission", "background"];
    let plane_of = |name: &str| FilmPlane::all().find(|plane| plane.name() == name).unwrap();
    let lights = classes.map(|name| film.plane::<[f32; 3]>(plane_of(name)).unwrap());
    let matte = film.plane::<[f32; 12]>(FilmPlane::CryptoMaterial).unwrap();
    for (pixel, color) in film.color.iter().enumerate() {
        for axis in 0..3 {
            let sum: f32 = lights.iter().map(|light| light[pixel][axis]).sum();
            assert!((sum - color[axis]).abs() < 1e-3 * (1.0 + sum), "{sum} {color:?}");
        }
        let covered: f32 = matte[pixel].iter().skip(1).step_by(2).sum();
        assert!((covered - color[3]).abs() < 1e-4, "{covered} {color:?}");
    }
}

#[test]
fn noise_is_below_the_limit() {
    let limit = 0.06;
    // The noise is an estimate, which rare bright samples escape
    let clamped = |settings| RenderSettings { clamp: Some(1.0), ..settings };
    let limits = NoiseLimit { noise: limit, max_samples: 4096 };
    let (film, counts) = picture(&clamped(large(4, Some(limits))));
    assert_eq!(counts.noisy_pixels, 0);
    let (truth, _) = picture(&RenderSettings { seed: 7, ..clamped(large(256, None)) });
    let error = |a: &[f32; 4], b: &[f32; 4]| {
        let brightness = ((b[0] + b[1] + b[2]) / 3.0).max(0.01);
        let difference = (0..3).map(|axis| (a[axis] - b[axis]).abs()).sum::<f32>() / 3.0;
        f64::from(difference * difference / brightness)
    };
    let errors = film.color.iter().zip(&truth.color).map(|(a, b)| error(a, b));
    let mean = (errors.sum::<f64>() / film.color.len() as f64).sqrt();
    assert!(mean < f64::from(limit) && mean > 0.2 * f64::from(limit), "{mean}");
}

#[test]
fn the_number_of_samples_is_bounded() {
    let limit = NoiseLimit { noise: 1e-6, max_samples: 13 };
    let (film, counts) = picture(&large(5, Some(limit)));
    assert!(counts.samples <= 12 * 90 * 70 && counts.samples > 6 * 90 * 70);
    assert!(counts.noisy_pixels > 0 && counts.noisy_pixels <= 90 * 70);
    let (plain, _) = picture(&large(6, None));
    assert_ne!(film.color, plain.color);
    // A maximum below twice the least number
    let limit = NoiseLimit { noise: 1e-6, max_samples: 10 };
    let (_, counts) = picture(&large(5, Some(limit)));
    let noisy = counts.noisy_pixels;
    assert!(noisy > 0 && counts.samples >= 10 * noisy, "{} {noisy}", counts.samples);
    // A limit that nothing reaches, and fewer samples at most than at least
    for max_samples in [64, 2] {
        let limit = NoiseLimit { noise: 10.0, max_samples };
        let (film, counts) = picture(&large(5, Some(limit)));
        assert_eq!(film.color, picture(&large(6, None)).0.color);
        assert_eq!((counts.samples, counts.noisy_pixels), (6 * 90 * 70, 0));
    }
}

#[test]
fn lost_light_is_that_of_all_passes() {
    let clamped = |settings: RenderSettings| {
        let (film, counts) = picture(&RenderSettings { clamp: Some(0.5), ..settings });
        counts.lost.part(&film.color, settings.samples)
    };
    let (plain, more) = (clamped(large(6, None)), clamped(large(32, None)));
    // One pass, with an even number of samples
    let one = clamped(large(5, Some(NoiseLimit { noise: 10.0, max_samples: 64 })));
    assert!(plain > 1e-3 && (one / plain - 1.0).abs() < 1e-3, "{one} {plain}");
    // Several
    let several = clamped(large(5, Some(NoiseLimit { noise: 0.02, max_samples: 32 })));
    assert!((several / more - 1.0).abs() < 0.2, "{several} {more}");
}

#[test]
fn limits_out_of_range_are_errors() {
    for noise in [0.0, -1.0, f32::NAN, 11.0] {
        let settings = large(4, Some(NoiseLimit { noise, max_samples: 64 }));
        assert!(matches!(settings.validate(), Err(RenderError::Noise(_))), "{noise}");
    }
    let settings = large(4, Some(NoiseLimit { noise: 0.1, max_samples: 5000 }));
    let max = MAX_SAMPLES;
    let expected = RenderError::OutOfRange { name: "max_samples", value: 5000, max };
    assert_eq!(settings.validate(), Err(expected));
}
