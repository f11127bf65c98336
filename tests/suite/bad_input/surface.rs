//! Particles and settings that make no body: an image and a warning, or a refusal, never a hang.

use std::fs;

use glam::Vec3;
use spherule_formats::{Attribute, AttributeData, write};

use super::frames::{BACKGROUND, is_background, pixels};
use super::not_rendered;
use crate::harness::{Ran, Workshop, dam_break, npy};

const SMOOTH: [&str; 2] = ["--surface", "smooth"];

fn smooth(workshop: &Workshop, options: &[&str]) -> Ran {
    workshop.render(&[&SMOOTH[..], &BACKGROUND, options].concat())
}

/// Whether nothing but the background is in the image of a frame.
fn is_empty(workshop: &Workshop, frame: u32) -> bool {
    let pixels = pixels(workshop, &format!("out/f.{frame:04}.exr"));
    assert_eq!(pixels.len(), 64 * 36);
    pixels.iter().all(is_background)
}

// 100,000 particles in one place, as a program might hang at so many.
#[test]
fn no_particles_one_and_many_in_one_place() {
    let workshop = Workshop::new();
    npy(&workshop.join("in/f_1.npy"), 0, 1, Vec3::ZERO);
    smooth(&workshop, &[]).expect(0);
    assert!(is_empty(&workshop, 1));

    write::npy::write(&workshop.join("in/f_1.npy"), &[Vec3::ONE]).expect("a file");
    fs::remove_dir_all(workshop.join("out")).expect("the images");
    not_rendered(&workshop, &SMOOTH, &["input.radius: the frames contain no radius"]);
    smooth(&workshop, &["--radius", "0.1"]).expect(0);
    assert!(!is_empty(&workshop, 1));

    let many = vec![Vec3::ONE; 100_000];
    write::npy::write(&workshop.join("in/f_1.npy"), &many).expect("a file");
    fs::remove_dir_all(workshop.join("out")).expect("the images");
    not_rendered(&workshop, &SMOOTH, &["input.radius: the frames contain no radius"]);
    smooth(&workshop, &["--radius", "0.1"]).expect(0);
    assert!(!is_empty(&workshop, 1));
}

#[test]
fn unreachable_threshold_gives_an_empty_image() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1]);
    smooth(&workshop, &["--set", "surface.threshold=4"])
        .expect(0)
        .prints("the smooth surface is empty: with radius")
        .prints("surface.threshold = 4");
    assert!(is_empty(&workshop, 1));
}

// Renders a smooth surface and a union: both treat such radii in their own way.
#[test]
fn radii_that_vary_a_thousandfold() {
    let workshop = Workshop::new();
    fs::create_dir(workshop.join("in")).expect("a directory");
    let centers: Vec<Vec3> = (0..1000_u16)
        .map(|i| Vec3::new(f32::from(i % 10), f32::from(i / 10 % 10), f32::from(i / 100)))
        .collect();
    let radii = (0..1000_u16).map(|i| 10_f32.powf(f32::from(i % 100) / 33.0 - 3.0));
    let radius = Attribute {
        name: "radius".into(),
        components: 1,
        data: AttributeData::F32(radii.collect()),
    };
    write::vtk::write(&workshop.join("in/f_1.vtk"), &centers, &[radius]).expect("a file");
    smooth(&workshop, &[])
        .expect(0)
        .prints("radii differ; a smooth surface has one for all, here their median")
        .prints("(input.radius sets another)");
    let options = [&["--surface", "union", "--force"][..], &BACKGROUND].concat();
    let ran = workshop.render(&options).expect(0);
    assert!(!ran.errors().contains("radii differ"), "{}", ran.errors());
    assert!(!is_empty(&workshop, 1));
}

#[test]
fn unknown_surfaces() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1]);
    not_rendered(&workshop, &["--surface", "smoth"], &["smoth", "smooth"]);
    let voxel = [&SMOOTH[..], &["--set", "surface.voxel=0"]].concat();
    let expected = "--set surface.voxel=0: expected a number of particle radii from 0.25 to 4";
    not_rendered(&workshop, &voxel, &[expected]);
}
