//! What is kept from picture to picture changes none, and the last picture is that of the job.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use spherule_formats::{ParticleFrame, Positions, RawParticles, native};
use spherule_jobs::{Interrupt, ResumeMode};

use super::level::Level;
use super::stage::Stage;
use super::wish::Setting;
use crate::job::{JobManifest, RenderJob, RenderRun};
use crate::manifest::{ManifestSource, Override};

const FRAME: i64 = 7;

/// A small job of the example.
fn requested() -> JobManifest {
    let input = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/dam-break");
    let path = Override::new("input.path", input.to_str().expect("UTF-8"), "INPUT");
    let small = ["image.width=64", "image.height=36", "image.samples=4"].map(Override::parse);
    let all = std::iter::once(path).chain(small).map(|own| own.expect("an override"));
    let source = ManifestSource::new("", Path::new("command line"), all.collect());
    let (manifest, _) = source.parse().expect("valid");
    JobManifest { source: Some(source), ..JobManifest::new(manifest, "") }
}

fn stage() -> Stage {
    let requested = requested();
    let sequence = requested.open_sequence().expect("frames");
    Stage::new(requested, sequence)
}

/// The last picture with these settings.
fn last(stage: &mut Stage, settings: &[Setting]) -> Vec<u8> {
    let render = stage.prepare(settings).expect("valid").setup.picture.render;
    let size = [render.width, render.height];
    let level = Level { size, samples: render.samples, is_last: true };
    let made = stage.picture(FRAME, &level, &AtomicBool::new(false)).expect("a picture");
    assert_eq!(made.encoded.mime, "image/png");
    made.encoded.bytes
}

fn set(key: &str, value: Value) -> Setting {
    Setting { key: key.to_owned(), value }
}

#[test]
fn pictures_with_what_is_kept_are_those_without() {
    let mut kept = stage();
    let mut pictures = vec![last(&mut kept, &[])];
    for settings in [
        vec![set("camera.azimuth", json!(70.0))],
        vec![
            set("camera.mode", json!("fixed")),
            set("camera.eye", json!([4, 3, 5])),
            set("camera.look_at", json!([0.5, 0.5, 0.1])),
        ],
        vec![set("camera.fit", json!("this"))],
        vec![set("camera.f_stop", json!(0.002))],
        vec![set("image.width", json!(80))],
        vec![set("environment.type", json!("sky")), set("environment.visible", json!(true))],
        vec![set("environment.rotation", json!(90.0))],
        vec![set("light", json!([{ "type": "sun", "direction": [1, -2, 1] }]))],
        vec![set("material.roughness", json!(0.1)), set("material.type", json!("plastic"))],
        vec![set("material.color", json!({ "attribute": "velocity", "range": [0.0, 2.0] }))],
        vec![set("material.color", json!({ "attribute": "velocity", "map": "magma" }))],
        vec![set("material.color", json!({ "attribute": "density" }))],
        vec![set("material.color", json!([0.8, 0.1, 0.1]))],
        vec![set("overlay", json!([{ "type": "text", "text": "{density.min}" }]))],
        vec![set("overlay", json!([{ "type": "colorbar" }])), set("image.layout", json!("beside"))],
        vec![set("render.ground", json!("checker")), set("render.depth_cue", json!(0.8))],
        vec![set("render.surface", json!("union"))],
        vec![set("select.where", json!("speed > 2"))],
        vec![set("clip", json!([{ "type": "plane", "normal": "x", "offset": 0.5 }]))],
        vec![set("input.radius", json!(0.05))],
        vec![set("look", json!("whitted"))],
        vec![set("output.transparent", json!(true))],
    ] {
        let one = last(&mut kept, &settings);
        assert!(one == last(&mut stage(), &settings), "{settings:?}");
        assert!(!pictures.contains(&one), "{settings:?}: no other picture");
        pictures.push(one);
    }
    // And back again
    assert!(last(&mut kept, &[]) == pictures[0]);
}

#[test]
fn the_last_picture_is_that_of_the_job() {
    let settings = [set("camera.azimuth", json!(200.0)), set("render.outline", json!(1.0))];
    let mut kept = stage();
    let seen = last(&mut kept, &settings);
    // Render the manifest that would be saved
    let dir = tempfile::tempdir().expect("a directory");
    let text = kept.prepare(&settings).expect("valid").source.to_toml().expect("valid");
    let output = dir.path().join("f.####.exr");
    let output = Override::new("output.path", output.to_str().expect("UTF-8"), "--output");
    let source = ManifestSource::new(text, Path::new("job.toml"), vec![output.expect("a key")]);
    let (manifest, _) = source.parse().expect("valid");
    let mut saved = JobManifest { source: Some(source), ..JobManifest::new(manifest, "") };
    let mut sequence = saved.open_sequence().expect("frames");
    saved.complete(&mut sequence, None).expect("possible");
    saved.manifest.input.frames = Some(FRAME.to_string().parse().expect("a range"));
    let job = RenderJob::new(saved, &sequence, None).expect("a job");
    let mut run = RenderRun::open(job, sequence, ResumeMode::Resume).expect("a job");
    run.render_pending(&Interrupt::new(), &|_| {}).expect("rendered");
    let preview = std::fs::read(dir.path().join("f.0007.png")).expect("a preview");
    assert!(preview == seen, "the preview of the job is another picture");
}

#[test]
fn drafts_are_small_and_refused_settings_name_their_key() {
    let mut stage = stage();
    stage.prepare(&[]).expect("valid");
    let level = Level { size: [32, 18], samples: 1, is_last: false };
    let made = stage.picture(FRAME, &level, &AtomicBool::new(false)).expect("a picture");
    assert_eq!((made.encoded.mime, made.under.size), ("image/jpeg", [32, 18]));
    let found = (0..32).find_map(|x| made.under.at([(f64::from(x) + 0.5) / 32.0, 0.6]));
    assert!(found.is_some(), "no particle in the middle row");
    for (key, value) in [
        ("image.samples", json!(0)),
        ("render.nothing", json!(1)),
        ("camera.fov", json!(null)),
        ("material.color", json!({ "attribute": "nothing" })),
        ("input.parts", json!(["nothing"])),
    ] {
        let error = stage.prepare(&[set(key, value)]).err().unwrap_or_else(|| panic!("{key}"));
        let fault = error.fault();
        assert!(fault.message.contains(key.rsplit('.').next().expect("a part")), "{fault:?}");
    }
    // A limit of noise does not change the number of samples, and a single one is not denoised
    stage
        .prepare(&[set("render.noise", json!(0.1)), set("image.samples", json!(1))])
        .expect("valid");
    let last = Level { is_last: true, ..level };
    stage.picture(FRAME, &last, &AtomicBool::new(false)).expect("a picture");
    // A raised stop, and a frame that is not there
    stage.prepare(&[]).expect("valid");
    let stopped = stage.picture(FRAME, &level, &AtomicBool::new(true)).err();
    assert!(stopped.is_some_and(|error| error.is_interrupted()));
    let missing = stage.picture(4711, &level, &AtomicBool::new(false)).err();
    assert_eq!(missing.expect("an error").to_string(), "frame 4711: is not in the sequence");
    let last = Level { size: [64, 36], samples: 4, is_last: true };
    assert!(stage.picture(FRAME, &last, &AtomicBool::new(false)).is_ok());
}

#[test]
fn pages_learn_where_overlays_are() {
    let mut stage = stage();
    let overlays = json!([
        { "type": "text", "text": "a", "corner": "bottom-right", "offset": [0.5, 0.25] },
        { "type": "axes", "corner": "top-left" },
    ]);
    let settings = [set("overlay", overlays), set("legend", json!(false))];
    let render = stage.prepare(&settings).expect("valid").setup.picture.render;
    let size = [render.width, render.height];
    let level = Level { size, samples: render.samples, is_last: true };
    let made = stage.picture(FRAME, &level, &AtomicBool::new(false)).expect("a picture");
    let layout = made.encoded.layout;
    assert_eq!(layout["size"], json!([64, 36]));
    assert_eq!(layout["picture"], json!({ "at": [0, 0], "size": [64, 36] }));
    let numbers = |entry: usize, key: &str| -> Vec<i64> {
        serde_json::from_value(layout["overlays"][entry][key].clone()).expect("numbers")
    };
    let (at, own) = (numbers(0, "at"), numbers(0, "size"));
    assert_eq!([64 - at[0] - own[0], 36 - at[1] - own[1]], [18, 9]);
    assert_eq!((numbers(1, "at"), &layout["overlays"][1]["entry"]), (vec![1, 1], &json!(1)));
}

#[test]
fn frames_beyond_the_memory_limit_are_thinned() {
    // A native frame whose particles are selected, so that they are copied
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("a_7.spf");
    let side = 80_u16;
    let at = |i: u16| f32::from(i) / f32::from(side);
    let points = (0..side).flat_map(|x| {
        (0..side).flat_map(move |y| (0..side).map(move |z| Vec3::new(at(x), at(y), at(z))))
    });
    let positions = Positions::F32(points.collect());
    let raw = RawParticles { positions, ..RawParticles::default() };
    native::write(&path, &ParticleFrame::from_raw(raw, DVec3::ZERO), Some(0)).expect("written");
    let input = Override::new("input.path", path.to_str().expect("UTF-8"), "INPUT");
    let small = ["image.width=64", "image.height=36", "image.samples=1"].map(Override::parse);
    let all = std::iter::once(input).chain(small).map(|own| own.expect("an override"));
    let source = ManifestSource::new("", Path::new("command line"), all.collect());
    let (manifest, _) = source.parse().expect("valid");
    let requested = JobManifest { source: Some(source), ..JobManifest::new(manifest, "") };
    let mut stage = Stage::new(requested.clone(), requested.open_sequence().expect("frames"));
    let level = Level { size: [64, 36], samples: 1, is_last: true };
    let mut picture = |settings: &[Setting]| {
        stage.prepare(settings)?;
        let made = stage.picture(FRAME, &level, &AtomicBool::new(false));
        let saved = stage.write_picture(FRAME, &dir.path().join("saved.png"));
        made.map(|made| (made, saved))
    };
    let limit = |limit: &str| {
        vec![set("select.where", json!("x >= 0")), set("render.memory_limit", json!(limit))]
    };
    let (whole, saved) = picture(&limit("4GiB")).expect("a picture");
    assert_eq!((whole.every, whole.particles), (1, 512_000));
    assert!(saved.is_ok());
    // In the first, the survey can read the file, of 6 MB; in the second, not even that
    for small in ["16MiB", "10MiB"] {
        let (thinned, saved) = picture(&limit(small)).expect("a draft");
        assert!(thinned.every > 1, "{small}");
        assert_eq!(thinned.particles, 512_000_u64.div_ceil(thinned.every.into()), "{small}");
        assert!(thinned.notes.iter().any(|note| note.starts_with("a draft with 1 of ")));
        // A draft is not saved as a picture
        let refused = saved.expect_err("refused").to_string();
        assert!(refused.contains("render.memory_limit"), "{refused}");
    }
    assert_eq!(picture(&limit("4GiB")).expect("a picture").0.every, 1);
    // Nothing fits
    let error = picture(&limit("1MiB")).err().expect("refused").to_string();
    assert!(error.contains("render.memory_limit"), "{error}");
}
