//! Lattices, which are stored in their own order, are in the picture as a whole, with all of their heights.

use std::ops::Range;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use spherule_formats::{PositionSlice, RawParticles};

use super::{SceneInputs, setup};
use crate::manifest::Manifest;
use crate::survey::Survey;

/// The six orders of the axes, from the one that varies slowest.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

const STEP: f32 = 0.02;

/// A lattice of `counts` particles along x, y and z, stored in an order of the axes.
fn lattice(counts: [u16; 3], order: [usize; 3]) -> Vec<Vec3> {
    let along = |axis: usize| -> Range<u16> { 0..counts[axis] };
    let mut all = Vec::new();
    for slow in along(order[0]) {
        for middle in along(order[1]) {
            for fast in along(order[2]) {
                let mut place = Vec3::ZERO;
                for (axis, number) in order.into_iter().zip([slow, middle, fast]) {
                    place[axis] = STEP * f32::from(number);
                }
                all.push(place);
            }
        }
    }
    all
}

#[track_caller]
fn is_shown(counts: [u16; 3], order: [usize; 3]) {
    let name = format!("{counts:?} {order:?}");
    let manifest = "input.path = \"in\"\ninput.radius = 0.01\ninput.up = \"z\"\n\
                    material.color = { attribute = \"height\" }";
    let manifest = Manifest::parse(manifest, Path::new("job.toml")).expect("valid");
    let particles = lattice(counts, order);
    let raw = RawParticles { positions: PositionSlice::F32(&particles), ..RawParticles::default() };
    let inquiry = crate::resolve::Inquiry::of(&manifest);
    let survey = Survey::of_particles("lattice", &raw, inquiry.question(None)).expect("readable");
    let top = counts.map(|count| STEP * f32::from(count - 1));
    let [width, depth, height] = top.map(f64::from);
    // No particle is an outlier
    let outline = survey.outline.as_ref().expect("particles");
    assert_eq!(outline.outliers, 0, "{name}");
    assert_eq!(survey.min, DVec3::ZERO, "{name}");
    assert_eq!(survey.max, DVec3::new(width, depth, height), "{name}");
    // Colours begin at the lowest layer and end at the highest
    let color = survey.color.as_ref().expect("requested");
    assert!(color.low.abs() <= 0.01 * height, "{name}: {}", color.low);
    assert!((color.high / height - 1.0).abs() <= 0.01, "{name}: {}", color.high);
    // All corners are in the picture
    let setup = setup(&manifest, &survey, SceneInputs::default()).expect("possible");
    let camera = setup.camera_at(0).expect("a camera");
    for corner in 0..8 {
        let corner =
            Vec3::from([0, 1, 2].map(|axis| (corner >> axis & 1) as f32)) * Vec3::from(top);
        let local = (corner.as_dvec3() - survey.origin).as_vec3();
        let film = camera.film_of(local).expect("in front of the camera");
        let is_inside = film.cmpgt(Vec2::ZERO).all() && film.cmplt(Vec2::ONE).all();
        assert!(is_inside, "{name}: {corner} at {film}");
    }
}

// A sample meets a lattice of each size in another way, and takes most of the time; not all sizes need all orders.
#[test]
fn lattices_of_all_orders_are_shown_as_a_whole() {
    for order in ORDERS {
        is_shown([40, 30, 10], order);
    }
    let layers = [11, 12, 14, 15, 16, 18, 20, 22, 24, 25, 28, 30, 32, 35, 36, 40];
    let sizes = layers.map(|layers| [40, 30, layers]).into_iter().chain([
        [40, 25, 24],
        [44, 30, 18],
        [50, 40, 20],
        [100, 100, 20],
    ]);
    for (size, order) in sizes.zip(ORDERS.into_iter().cycle()) {
        is_shown(size, order);
    }
}
