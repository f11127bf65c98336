//! Denoised images: less noise, the same other channels, and the same bytes on any number of threads.

use crate::harness::{Workshop, dam_break, images};
use crate::picture::Picture;

const STUDIO: [&str; 2] = ["--look", "studio"];

/// Renders frame 11 of the dam break.
fn picture(workshop: &Workshop, name: &str, options: &[&str]) -> Picture {
    let arguments = ["still", "in", "-o", name, "--width", "160", "--height", "90"];
    workshop.run(&[&arguments[..], &STUDIO, options].concat()).expect(0);
    Picture::open(&workshop.join(name))
}

/// Root of the mean squared difference of the green channels.
fn error(a: &Picture, b: &Picture) -> f32 {
    let squares =
        a.floats("G").iter().zip(b.floats("G")).map(|(a, b)| (a.min(1.0) - b.min(1.0)).powi(2));
    (squares.sum::<f32>() / a.floats("G").len() as f32).sqrt()
}

// The reference has 256 samples a pixel: its noise has to be small beside that of four.
#[test]
fn noise_is_removed_from_colours_only() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 6..=6);
    let reference = ["--samples", "256", "--set", "render.denoise=false"];
    let reference = picture(&workshop, "reference.exr", &reference);
    let channels = ["--channels", "RGBA,Z,id", "--samples", "4"];
    let of = |name, denoise| {
        let options = [&channels[..], &["--set", denoise]].concat();
        picture(&workshop, name, &options)
    };
    let (noisy, denoised) =
        (of("noisy.exr", "render.denoise=false"), of("denoised.exr", "render.denoise=auto"));
    let [before, after] = [&noisy, &denoised].map(|found| error(found, &reference));
    assert!(after < 0.8 * before, "{after} instead of {before}");
    // Features are no channels, and other channels stay
    let names = |picture: &Picture| picture.planes.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&denoised), ["A", "B", "G", "R", "Z", "id.I"]);
    for name in ["A", "Z", "id.I"] {
        assert!(noisy.planes[name] == denoised.planes[name], "{name}");
    }
}

#[test]
fn colours_do_not_depend_on_the_channels_beside_them() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 6..=6);
    let of = |name: &str, channels| {
        picture(&workshop, name, &["--channels", channels, "--samples", "4"])
    };
    let all = of("all.exr", "RGBA,Z,N,P,albedo,id");
    for (name, channels) in [("color.exr", "RGBA"), ("some.exr", "RGBA,Z,N,id")] {
        let some = of(name, channels);
        for plane in ["R", "G", "B", "A"] {
            assert!(some.planes[plane] == all.planes[plane], "{channels}: {plane}");
        }
    }
}

#[test]
fn denoised_jobs_do_not_depend_on_threads() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 6..=7);
    let render = |out: &str, threads: &str| {
        let pattern = format!("{out}/f.####.exr");
        let arguments = ["render", "in", "-o", &pattern, "--threads", threads];
        let size = ["--width", "64", "--height", "36", "--samples", "4"];
        workshop.run(&[&arguments[..], &size, &STUDIO].concat()).expect(0);
        images(&workshop.join(out))
    };
    assert!(render("one", "1") == render("many", "3"));
}

#[test]
fn one_sample_has_no_noise_to_measure() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 6..=6);
    let arguments = ["still", "in", "-o", "a.png", "--samples", "1", "--denoise"];
    workshop.run(&arguments).expect(2).prints("--denoise: needs at least 2 samples per pixel");
}
