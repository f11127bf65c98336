//! Every kind of surface through the whole pipeline except encoding.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};
use spherule_formats::native::{Bound, Encoding, StoreSettings, store};
use spherule_formats::{ParticleFrame, SequenceInput, sequence::Sequence};

use super::*;
use crate::manifest::{Manifest, RadiusSetting};
use crate::pipeline::{CpuRenderer, FrameRenderer, ImageTask, LoadedParticles, load_frame};
use crate::render::{Channels, IntegratorKind};
use crate::surface::{NormalKind, SurfaceSettings};

/// A wavy block with drops above it.
fn particles() -> Vec<Vec3> {
    let wave = |i: u16| 0.05 * (f32::from(i) * 2.7).sin();
    let place = |i: u16| {
        let [x, y, z] = [i % 12, i / 12 % 12, i / 144].map(|c| 0.2 * f32::from(c));
        Vec3::new(x + wave(i), y - wave(i), z + wave(i))
    };
    let mut centers: Vec<Vec3> = (0..1200).map(place).collect();
    for drop in 0..8 {
        let x = 0.3 * f32::from(drop % 4_u16);
        centers.insert(usize::from(100 * drop), Vec3::new(x, 0.5, 2.5 + 2.0 * x));
    }
    centers
}

/// The setup and the frame of a file of [`particles`].
fn opened(file: &Path) -> (Setup, Sequence) {
    let mut manifest = Manifest::new("in");
    manifest.input.radius = RadiusSetting::Length(0.12);
    // The lone particles, too
    manifest.camera.fit = Some(crate::manifest::FitSetting::All);
    // Highlights show the normals of clear spheres
    manifest.render.integrator = Some(IntegratorKind::Whitted);
    let sequence = Sequence::open(&SequenceInput::from_path(file)).expect("a frame");
    let inquiry = crate::resolve::Inquiry::of(&manifest);
    let question = inquiry.question(None);
    let survey = crate::survey::Survey::of(&sequence, question).expect("readable");
    let mut setup =
        crate::resolve::setup(&manifest, &survey, crate::resolve::SceneInputs::default())
            .expect("pictures");
    setup.picture.render.width = 48;
    setup.picture.render.height = 27;
    setup.picture.render.samples = 1;
    setup.picture.render.max_depth = 4;
    setup.picture.render.channels = Channels::ALL;
    setup.picture.scene.particle_material_mut().transmission = 1.0;
    setup.picture.scene.particle_material_mut().reflection = 1.0;
    (setup, sequence)
}

struct Drawn {
    film: Film,
    report: FrameReport,
    in_place: bool,
}

fn drawn(setup: &Setup, sequence: &Sequence, tracer: &mut CpuRenderer) -> Drawn {
    let task = ImageTask {
        frame: 0,
        index: 0,
        image: PathBuf::new(),
        preview: None,
        meshes: Vec::new(),
        next_meshes: None,
        refused: None,
    };
    let loaded = load_frame(setup, sequence, &task).expect("readable");
    let in_place = matches!(loaded.particles, LoadedParticles::Stored(_));
    let built = tracer.prepare(setup, loaded).expect("a tree");
    let report = built.report.clone();
    let (film, _) = tracer.image(setup, &built, &AtomicBool::new(false)).expect("an image");
    Drawn { film, report, in_place }
}

/// Every surface.
fn surfaces() -> Vec<SurfaceSettings> {
    let mut all = Vec::new();
    for kind in [SurfaceKind::Spheres, SurfaceKind::Union] {
        for (normals, spray) in [
            (NormalKind::Auto, false),
            (NormalKind::Pca, false),
            (NormalKind::Field, false),
            (NormalKind::Auto, true),
        ] {
            all.push(SurfaceSettings { kind, normals, spray, ..SurfaceSettings::DEFAULT });
        }
    }
    all
}

#[test]
fn every_structure_draws_every_surface_alike() {
    let directory = tempfile::tempdir().expect("a directory");
    let file = directory.path().join("f_1.npy");
    spherule_formats::write::npy::write(&file, &particles()).expect("a file");
    let (setup, sequence) = opened(&file);
    let mut tracer = CpuRenderer::default();
    let mut films = Vec::new();
    for surface in surfaces() {
        let alike = Structure::ALL.map(|structure| {
            let mut setup = setup.clone();
            setup.picture.surface = surface;
            setup.run.accelerator = Some(structure);
            let drawn = drawn(&setup, &sequence, &mut tracer);
            assert_eq!(drawn.report.particles, 1208);
            assert_eq!(drawn.report.bytes.surface > 0, surface.spray);
            drawn.film
        });
        assert!(alike.iter().all(|film| *film == alike[0]), "{surface:?}");
        films.push(alike[0].clone());
    }
    for (i, film) in films.iter().enumerate() {
        assert!(!films[..i].contains(film), "{:?} changes nothing", surfaces()[i]);
    }
}

#[test]
fn soft_drops_belong_to_particles() {
    let centers = [Vec3::ZERO, Vec3::X, Vec3::Y, 5.0 * Vec3::X];
    let ids = [7, 3, 9, 3];
    let count = SOFT_DROPS as usize;
    let (drops, radii) = soft_drops(&centers, &Radius::Common(0.5), 1, &ids);
    assert_eq!([drops.len(), radii.len()], [3 * count; 2]);
    // Particles with the same id have the same drops
    for i in 0..count {
        assert!((drops[i] - drops[2 * count + i] + 4.0 * Vec3::X).length() < 1e-5);
        assert_eq!(radii[i], radii[2 * count + i]);
        assert!(drops[i].distance(Vec3::X) < 1.0);
    }
    let own = Radius::PerParticle(vec![1.0, 2.0, 1.0, 4.0]);
    let (_, radii) = soft_drops(&centers, &own, 1, &ids);
    assert_eq!(radii[2 * count], 2.0 * radii[0]);
    // They are drawn, and differ from spheres
    let directory = tempfile::tempdir().expect("a directory");
    let file = directory.path().join("f_1.npy");
    spherule_formats::write::npy::write(&file, &particles()).expect("a file");
    let (mut setup, sequence) = opened(&file);
    setup.picture.surface.kind = SurfaceKind::Union;
    setup.picture.surface.spray = true;
    setup.picture.render.integrator = IntegratorKind::Path;
    let images = [false, true].map(|is_soft| {
        setup.picture.scene.set_spray_soft(is_soft);
        Structure::ALL.map(|structure| {
            setup.run.accelerator = Some(structure);
            drawn(&setup, &sequence, &mut CpuRenderer::default()).film
        })
    });
    for structures in &images {
        assert!(structures.iter().all(|film| *film == structures[0]));
    }
    assert!(images[0][0] != images[1][0]);
}

#[test]
fn compact_frames_in_place_have_every_surface() {
    let directory = tempfile::tempdir().expect("a directory");
    let file = directory.path().join("f_1.spf");
    let frame = ParticleFrame {
        positions: particles(),
        origin: DVec3::ZERO,
        radius: None,
        attributes: Vec::new(),
        time: None,
        cell: None,
        bonds: Vec::new(),
        shapes: None,
        dropped: 0,
        file_index: None,
    };
    let settings =
        StoreSettings { encoding: Some(Encoding::Q16), bound: Bound::None, rounding: 0.0 };
    store(&file, &frame, None, &settings).expect("a frame");
    let (setup, sequence) = opened(&file);
    for surface in surfaces() {
        // Decoding gives the same particles.
        let [placed, decoded] = [Structure::Lbvh, Structure::Bvh].map(|structure| {
            let mut setup = setup.clone();
            setup.picture.surface = surface;
            setup.run.accelerator = Some(structure);
            drawn(&setup, &sequence, &mut CpuRenderer::default())
        });
        assert_eq!(placed.in_place, !surface.spray);
        assert!(!decoded.in_place);
        assert!(placed.film == decoded.film, "{surface:?}");
    }
}
