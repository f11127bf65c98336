//! Tests of the model alone; `tests/suite/memory` compares it with measurements.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use spherule_files::Bytes;
use spherule_formats::{MemoryBudget, Sequence};

use super::super::bonds::MAX_BONDS_EACH;
use super::*;
use crate::pipeline::{
    ArrowStyle, BondRule, BondStyle, MeshSettings, MeshThing, Overlap, PictureMesh, RodLook,
    TrailStyle,
};
use crate::surface::mesh::{MeshNormals, MeshTree, TriangleMesh, VisibleFaces};
use crate::surface::rods::Anchor;
use crate::surface::smooth::GridSize;
use crate::surface::{MaterialId, SurfaceKind};
use crate::survey::FrameWeight;

/// A frame of plain single-precision positions.
fn plain(particles: u64) -> FrameSize {
    FrameSize {
        particles,
        content: 12 * particles,
        raw: 12 * particles,
        positions: 12 * particles,
        files: 1,
        is_shared: false,
        meshes: 0,
        surface: None,
    }
}

fn setup() -> Setup {
    let mut manifest = crate::manifest::Manifest::new("in");
    manifest.input.radius = crate::manifest::RadiusSetting::Length(0.1);
    // Without tables of an environment
    manifest.render.integrator = Some(crate::render::IntegratorKind::Whitted);
    let directory = tempfile::tempdir().expect("a directory");
    let file = directory.path().join("f_1.npy");
    spherule_formats::write::npy::write(&file, &[glam::Vec3::ZERO]).expect("a file");
    let input = spherule_formats::SequenceInput::from_path(&file);
    let sequence = Sequence::open(&input).expect("a frame");
    let inquiry = crate::resolve::Inquiry::of(&manifest);
    let question = inquiry.question(None);
    let survey = crate::survey::Survey::of(&sequence, question).expect("readable");
    crate::resolve::setup(&manifest, &survey, crate::resolve::SceneInputs::default())
        .expect("pictures")
}

#[test]
fn more_of_anything_needs_more() {
    let setup = setup();
    let model = MemoryModel::new(&setup);
    let total = |frames: &[FrameSize]| model.peak(frames, 1).total();
    assert!(total(&[plain(4_000_000)]) < total(&[plain(8_000_000)]));
    assert!(total(&[plain(8_000_000)]) < total(&[plain(8_000_000); 2]));
    // Memory is constant over a sequence.
    assert_eq!(total(&[plain(8_000_000); 3]), total(&[plain(8_000_000); 30]));
    let mut larger = setup.clone();
    larger.picture.render.width *= 2;
    let more = MemoryModel::new(&larger).alone(&plain(1000)).images;
    assert_eq!(more, 2 * model.alone(&plain(1000)).images);
}

#[test]
fn a_smooth_surface_has_a_grid_and_no_tree() {
    let mut smooth = setup();
    smooth.picture.surface.kind = SurfaceKind::Smooth;
    let need = |setup: &Setup, particles| MemoryModel::new(setup).alone(&plain(particles));
    let (some, more) = (need(&smooth, 1_000_000), need(&smooth, 8_000_000));
    assert!(some.tree < 1 << 20, "{some}");
    // Most of the particles lie inside.
    assert!(more.surface > 4 * some.surface && more.surface < 8 * some.surface);
    let mut finer = smooth.clone();
    finer.picture.surface.voxel = 0.5;
    assert!(need(&finer, 1_000_000).surface > 2 * some.surface);
    finer.picture.surface.voxel = 0.25;
    // Too little to affect the peak.
    let few = GridSize::of_splash(1, &finer.picture.surface).bytes(true).building;
    assert!((1 << 10..1 << 16).contains(&few), "{few}");
    assert_eq!(need(&smooth, 0).surface, 0);
    let mut medium = setup();
    medium.picture.surface.kind = SurfaceKind::Union;
    assert_eq!(need(&medium, 1_000_000), need(&setup(), 1_000_000));
}

#[test]
fn meshes_of_a_frame_are_counted() {
    let setup = setup();
    let model = MemoryModel::new(&setup);
    let with = |meshes| FrameSize { meshes, ..plain(1000) };
    let one = model.alone(&with(10_000_000));
    assert!(one.reading >= 160_000_000, "{one}");
    let two = model.peak(&[with(10_000_000); 2], 1);
    assert_eq!(two.surface, 50_000_000);
    assert!(two.reading >= 160_000_000, "{two}");
    assert_eq!(FrameSize::estimate(1200, false, None).meshes, 0);
}

#[test]
fn limits_leave_out_what_does_not_fit_alone() {
    let setup = setup();
    let model = MemoryModel::new(&setup);
    let frames = [plain(1000), plain(20_000_000), plain(1000)];
    let small = model.peak(&[frames[0], frames[2]], 1).total();
    let schedule = model.schedule(&frames, Some(Bytes(small)), None);
    let left_out: Vec<usize> = schedule.too_large.iter().map(|(place, _)| *place).collect();
    assert_eq!(left_out, [1]);
    assert_eq!(schedule.overlap, Overlap::Stages);
    assert_eq!(schedule.need.total(), small);

    let alone = model.alone(&frames[1]).total();
    let schedule = model.schedule(&frames, Some(Bytes(alone)), None);
    assert!(schedule.too_large.is_empty());
    let schedule = model.schedule(&[frames[1]; 2], Some(Bytes(alone)), None);
    assert_eq!(schedule.overlap, Overlap::None);
    assert_eq!(schedule.need.total(), alone);
    // With less free memory, no frame is rejected here; they only do not overlap.
    let schedule = model.schedule(&frames, None, Some(alone / 2));
    assert!(schedule.too_large.is_empty() && schedule.overlap == Overlap::None);
}

#[test]
fn frames_are_judged_by_the_length_of_their_files() {
    let known = FrameWeight {
        particles: 100,
        stored: 1000,
        content: 2000,
        raw: 1600,
        positions: 1200,
        files: 1,
        ..FrameWeight::default()
    };
    let size = FrameSize::estimate(500, false, Some(&known));
    assert_eq!((size.particles, size.content, size.raw), (50, 1000, 800));
    assert_eq!(FrameSize::estimate(1200, false, None).particles, 100);
    let huge = FrameSize::estimate(u64::MAX, false, Some(&known));
    assert_eq!(huge.raw, u64::MAX);
}

#[test]
fn light_groups_have_planes() {
    let mut setup = setup();
    let images = |setup: &Setup| MemoryModel::new(setup).alone(&plain(1000)).images;
    let none = images(&setup);
    setup.picture.render.channels.layers.light_groups = 4;
    let pixels = u64::from(setup.picture.render.width) * u64::from(setup.picture.render.height);
    assert!(images(&setup) >= none + 4 * 12 * pixels);
}

const LOOK: RodLook = RodLook { radius: 0.1, color: None, material: MaterialId::GROUND };

#[test]
fn arrows_trails_and_bonds_are_counted() {
    let mut setup = setup();
    let alone = |setup: &Setup| MemoryModel::new(setup).alone(&plain(1_000_000));
    let none = alone(&setup);
    setup.picture.things.arrows.push(ArrowStyle {
        attribute: "velocity".to_owned(),
        scale: 1.0,
        every: 1,
        anchor: Anchor::Tail,
        style: None,
        look: LOOK,
    });
    // Two rods for each particle
    let each = |rods: u64, bytes: u64| rods * 1_000_000 * bytes;
    let all = alone(&setup);
    assert!(all.total() >= none.total() + each(2, 60), "{none}\n{all}");
    setup.picture.things.arrows[0].every = 100;
    let few = alone(&setup);
    assert!(few.total() < none.total() + each(2, 100) / 10, "{none}\n{few}");
    // A rod for each frame, and another frame beside the one that is read
    setup.picture.things.arrows.clear();
    setup.picture.things.trails = vec![TrailStyle { frames: 5, every: 1, style: None, look: LOOK }];
    let trails = alone(&setup);
    assert!(trails.total() >= none.total() + each(5, 60), "{none}\n{trails}");
    setup.picture.things.trails.clear();
    setup.picture.particles.styles[0].bonds =
        Some(BondStyle { rule: BondRule::Distance(1.0), look: LOOK });
    let bonds = alone(&setup);
    assert!(bonds.total() >= none.total() + each(MAX_BONDS_EACH, 60), "{none}\n{bonds}");
}

#[test]
fn shared_meshes_are_built_before_the_first_frame() {
    let mut setup = setup();
    let corner = |i: u16| Vec3::new(f32::from(i), f32::from(i % 7), f32::from(i % 3));
    let vertices: Vec<Vec3> = (0..60_000).map(corner).collect();
    let triangles = (0..150_000).map(|i| [0, 1, 2].map(|corner| i % 50_000 + corner));
    let mesh = TriangleMesh::new(vertices, triangles.collect(), MeshNormals::Flat).expect("valid");
    let count = mesh.len() as u64;
    let tree = Arc::new(MeshTree::new(mesh));
    let mesh = PictureMesh {
        settings: MeshSettings {
            scale: 1.0,
            translate: DVec3::ZERO,
            origin: DVec3::ZERO,
            normals: MeshNormals::Flat,
            faces: VisibleFaces::Both,
            particle_extent: 1.0,
            budget: MemoryBudget::UNLIMITED,
        },
        tree: Some(Arc::clone(&tree)),
    };
    let thing = MeshThing { mesh, material: MaterialId::GROUND };
    setup.picture.render.width = 8;
    setup.picture.render.height = 8;
    setup.picture.things.meshes = vec![thing.clone(), thing];
    // The second one is built next to the first
    let building = MemoryModel::new(&setup).alone(&plain(10));
    assert_eq!(building.surface, tree.bytes() as u64 + tree.building_bytes());
    assert!(tree.building_bytes() >= count * 300);
}
