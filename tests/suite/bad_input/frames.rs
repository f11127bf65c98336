//! Frames with little or nothing in them, or broken.

use std::fs;

use exr::prelude::read_first_rgba_layer_from_file;
use glam::Vec3;
use spherule_formats::write;

use super::not_rendered;
use crate::harness::{Workshop, dam_break, images, npy};

pub(super) const BACKGROUND: [&str; 2] = ["--set", "render.background=[0.25,0.5,0.75]"];

/// The pixels of an image, row by row.
pub(super) fn pixels(workshop: &Workshop, name: &str) -> Vec<[f32; 4]> {
    let image = read_first_rgba_layer_from_file(
        workshop.join(name),
        |size, _| (size.width(), vec![[0.0; 4]; size.area()]),
        // Blocks come in any order.
        |(width, pixels), at, (r, g, b, a): (f32, f32, f32, f32)| {
            pixels[at.y() * *width + at.x()] = [r, g, b, a];
        },
    );
    image.expect("an EXR").layer_data.channel_data.pixels.1
}

pub(super) fn is_background(pixel: &[f32; 4]) -> bool {
    pixel[..3] == [0.25, 0.5, 0.75]
}

#[test]
fn frames_without_particles_show_the_background() {
    let workshop = Workshop::new();
    for frame in 1..=3 {
        npy(&workshop.join(format!("in/f_{frame}.npy")), 0, 1, Vec3::ZERO);
    }
    let ran = workshop.render(&BACKGROUND).expect(0).prints("3 frames, up to 0 particles");
    assert_eq!(ran.rendered(), [1, 2, 3]);
    assert!(!ran.errors().contains("radius"), "{}", ran.errors());
    let pixels = pixels(&workshop, "out/f.0002.exr");
    assert_eq!(pixels.len(), 64 * 36);
    assert!(pixels.iter().all(is_background));
}

#[test]
fn empty_frame_in_a_sequence_is_rendered() {
    let workshop = Workshop::new();
    for (frame, count) in [(1, 2000), (2, 0), (3, 2000)] {
        npy(&workshop.join(format!("in/f_{frame}.npy")), count, frame, Vec3::ZERO);
    }
    workshop.render(&BACKGROUND).expect(0);
    assert_eq!(images(&workshop.join("out")).len(), 6);
    assert!(pixels(&workshop, "out/f.0002.exr").iter().all(is_background));
    assert!(!pixels(&workshop, "out/f.0003.exr").iter().all(is_background));
}

#[test]
fn a_single_particle_is_in_the_middle() {
    let workshop = Workshop::new();
    npy(&workshop.join("in/f_1.npy"), 1, 1, Vec3::ZERO);
    not_rendered(
        &workshop,
        &["--look", "none"],
        &[
            "input.radius: the frames contain no radius, and it cannot be estimated from so few, coincident or \
             distant particles; give a length with --radius",
        ],
    );
    let ran = workshop.render(&BACKGROUND).expect(0);
    ran.prints("radius 1, as particles at one place have no spacing (--radius gives another)");
    fs::remove_dir_all(workshop.join("out")).expect("the images");
    workshop.render(&[&["--radius", "0.1"][..], &BACKGROUND].concat()).expect(0);
    let pixels = pixels(&workshop, "out/f.0001.exr");
    assert!(!is_background(&pixels[18 * 64 + 32]), "the middle");
    assert!(is_background(&pixels[0]), "the corner");
}

#[test]
fn coincident_particles_render_with_a_radius() {
    let workshop = Workshop::new();
    fs::create_dir(workshop.join("in")).expect("a directory");
    write::npy::write(&workshop.join("in/f_1.npy"), &[Vec3::ONE; 500]).expect("a file");
    not_rendered(&workshop, &["--look", "none"], &["input.radius"]);
    workshop.render(&["--radius", "0.5"]).expect(0);
}

#[test]
fn nan_particles_are_dropped_and_counted() {
    let workshop = Workshop::new();
    fs::create_dir(workshop.join("in")).expect("a directory");
    let mut centers: Vec<Vec3> = (0u8..200).map(|i| Vec3::splat(f32::from(i))).collect();
    centers[3].x = f32::NAN;
    centers[5] = Vec3::INFINITY;
    write::npy::write(&workshop.join("in/f_1.npy"), &centers).expect("a file");
    workshop.render(&[]).expect(0).prints("frame 1: 2 particles left out");
    write::npy::write(&workshop.join("in/f_1.npy"), &[Vec3::NAN; 9]).expect("a file");
    workshop.render(&["--force"]).expect(0).prints("frame 1: 9 particles left out");
}

#[test]
fn sequence_of_damaged_files_cannot_start() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    for frame in 1..=2 {
        let file = workshop.join(format!("in/f_{frame}.bgeo"));
        let bytes = fs::read(&file).expect("a frame");
        fs::write(&file, &bytes[..bytes.len() / 2]).expect("a file");
    }
    not_rendered(&workshop, &[], &["error: no frame can be read: in/f_1.bgeo: byte "]);
}

#[test]
fn truncated_file_may_still_be_growing() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    let file = workshop.join("in/f_3.bgeo");
    let bytes = fs::read(&file).expect("a frame");
    for length in [bytes.len() - 1, bytes.len() / 3, 1, 0] {
        fs::write(&file, &bytes[..length]).expect("a file");
        let ran = workshop.render(&[]).expect(1).prints("error: frame 3: in/f_3.bgeo: ");
        assert!(ran.errors().contains("failed: 3"));
        if length > 1 {
            assert!(ran.errors().contains("perhaps it is still being written"), "{length}");
        }
        assert!(!workshop.join("out/f.0003.exr").exists());
    }
}
