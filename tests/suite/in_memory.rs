//! Particles in memory give the pictures of files with the same particles, and their positions are not copied.

use std::borrow::Cow;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use spherule::job::{JobManifest, RenderJob};
use spherule::manifest::{Manifest, Override};
use spherule::pipeline::make_image;
use spherule::prelude::*;
use spherule_formats::{ParticleFrame, Positions, RawParticles};

const FILE: &str = "examples/dam-break/ParticleData_Fluid_5.bgeo";

fn manifest(path: &Path) -> Manifest {
    let mut all = vec![Override::new("input.path", path.to_str().expect("text"), "test")];
    let settings = [
        "input.up=y",
        "image.width=32",
        "image.height=18",
        "image.samples=1",
        "output.channels=[\"Z\", \"id\", \"V\"]",
        "material.color={ attribute = \"velocity\" }",
        "overlay=[{ type = \"colorbar\" }]",
    ];
    all.extend(settings.map(Override::parse));
    let all = all.into_iter().collect::<Result<Vec<_>, _>>();
    Manifest::parse_with("", Path::new("test"), all.expect("valid keys")).expect("valid")
}

#[test]
fn the_bytes_are_those_of_a_file() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(FILE);
    let requested = JobManifest::new(manifest(&path), dir.path());
    let sequence = requested.open_sequence().expect("a frame");
    let number = sequence.frames()[0].number;
    let settings = StillSettings {
        frame: number,
        name: "ParticleData_Fluid_5.bgeo".to_owned(),
        ..StillSettings::new(requested.manifest.clone())
    };
    // By way of the file
    let job = RenderJob::new(requested, &sequence, None).expect("a job");
    let (_, setup) = job.survey(&sequence).expect("a survey");
    let mut task = job.tasks(&sequence, &[number]).remove(0);
    task.image = dir.path().join("file.exr");
    task.preview = None;
    make_image(&setup, &sequence, &task, drop).expect("a picture");
    let expected = std::fs::read(&task.image).expect("a file");
    // In memory
    let raw = sequence.load_raw(0).expect("particles");
    let Positions::F32(positions) = &raw.positions else {
        panic!("the file is in single precision");
    };
    let particles = Particles {
        positions: PositionSlice::F32(positions),
        attributes: raw.attributes,
        time: raw.time,
        ..Particles::default()
    };
    let image = render(&settings, particles, &AtomicBool::new(false)).expect("a picture");
    assert!(image.to_exr().expect("bytes") == expected, "bytes differ");
    let channels = image.film().channels;
    assert!(channels.has(FilmPlane::Velocity) && !channels.has(FilmPlane::Attributes));
}

#[test]
fn a_raised_flag_stops() {
    let at = [Vec3::ZERO, Vec3::X];
    let settings = StillSettings::parse("input.radius = 0.4").expect("valid");
    let stopped = render(&settings, particles(PositionSlice::F32(&at)), &AtomicBool::new(true));
    assert!(stopped.expect_err("stopped").is_interrupted());
}

#[test]
fn positions_are_copied_only_if_they_change() {
    let raw = |positions: &[Vec3]| RawParticles {
        positions: Positions::F32(positions.to_vec()),
        attributes: vec![scalar("a", (0..3_u8).map(f32::from).collect())],
        time: Some(2.0),
        ..RawParticles::default()
    };
    let near = [Vec3::X, Vec3::Y, Vec3::Z];
    let with_nan = [Vec3::X, Vec3::NAN, Vec3::Z];
    for (positions, origin, is_copied) in [
        (&near, DVec3::ZERO, false),
        (&near, DVec3::splat(1e6), true),
        (&with_nan, DVec3::ZERO, true),
    ] {
        let expected = ParticleFrame::from_raw(raw(positions), origin);
        let borrowed = RawParticles {
            attributes: raw(positions).attributes,
            time: Some(2.0),
            ..particles(PositionSlice::F32(positions))
        };
        let frame = ParticleFrame::borrowed(borrowed, origin);
        assert_eq!(matches!(frame.positions, Cow::Owned(_)), is_copied);
        assert_eq!(frame.with_positions(Cow::into_owned), expected);
    }
}
