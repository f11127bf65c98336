//! Compares every converted frame with its source, particle by particle, for different memory limits.

use std::collections::HashMap;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec3, Vec3};

use super::*;
use crate::native::layout::RadiusIndex;
use crate::native::tests::clustered;
use crate::native::{Access, Bound, Encoding, FrameIndex, NativeFile, StoredType};
use crate::{Attribute, AttributeData, FrameError, Positions, RawParticles};

/// Limits for parts of `part_len` particles and `chunks` chunks of 256 records in memory.
fn tight(part_len: usize, chunks: usize) -> Limits {
    Limits {
        is_whole: false,
        part_len,
        run_len: 1024,
        batch_len: 300,
        window: 4,
        window_bytes: 0,
        chunk_len: 256,
        chunks,
        parts: 64,
        sample_len: 4096,
    }
}

/// Limits that order all particles at once.
fn whole() -> Limits {
    Limits { is_whole: true, ..tight(0, 0) }
}

fn raw(positions: Vec<Vec3>) -> RawParticles {
    let numbers = 0..u64::try_from(positions.len()).expect("few");
    let velocity = positions.iter().flat_map(|p| (*p * 0.5).to_array());
    RawParticles {
        attributes: vec![
            Attribute {
                name: "velocity".into(),
                components: 3,
                data: AttributeData::F32(velocity.collect()),
            },
            Attribute {
                name: "place".into(),
                components: 1,
                data: AttributeData::U64(numbers.map(|n| n << 33).collect()),
            },
        ],
        positions: Positions::F32(positions),
        time: Some(0.5),
        step: Some(9),
        ..RawParticles::default()
    }
}

fn settings() -> ConvertSettings {
    ConvertSettings {
        encoding: Some(Encoding::Q10),
        bound: Bound::Length(1e-3),
        radius: RadiusRule::All(0.01),
        keep_ids: true,
        ..ConvertSettings::default()
    }
}

fn request<'a>(
    source: &'a dyn ParticleSource,
    path: &'a Path,
    settings: &'a ConvertSettings,
) -> ConvertRequest<'a> {
    ConvertRequest { source, path, settings, progress: &() }
}

/// Converts within `limits`.
fn convert_to(
    path: &Path,
    source: &dyn ParticleSource,
    settings: &ConvertSettings,
    limits: Limits,
) -> Result<ConvertReport, ConvertError> {
    let columns = StoredColumns::choose(source, settings, path)?;
    convert_within(request(source, path, settings), columns, limits)
}

/// Converts `raw` within `limits` and compares.
#[track_caller]
fn converted(raw: &RawParticles, settings: &ConvertSettings, limits: Limits) -> ConvertReport {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    let source = RawSource::new(Path::new("raw"), raw).expect("whole");
    let report = convert_to(&path, &source, settings, limits).expect("converted");
    compare(&path, raw, settings, &report.index);
    assert_eq!(fs::read_dir(dir.path()).expect("readable").count(), 1);
    report
}

/// Every finite particle of `raw` is in the frame exactly once, within the error that the frame states, with
/// its own values.
#[track_caller]
fn compare(path: &Path, raw: &RawParticles, settings: &ConvertSettings, index: &FrameIndex) {
    // Open the frame
    let file = NativeFile::open(path, Access::Map).expect("whole");
    assert_eq!(file.index(), index);
    let frame = file.frame().expect("unchanged");
    frame.verify().expect("undamaged");
    let leaves = frame.leaves().expect("in place");
    let id = frame.attribute("id").expect("kept");
    let kept = |i: usize| crate::is_near(&(raw.positions.get(i) - settings.origin).as_vec3());
    // Mark the particles that the conversion drops
    let mut visited: Vec<bool> = (0..raw.positions.len()).map(|i| !kept(i)).collect();
    let dropped = visited.iter().filter(|s| **s).count();
    let mut largest = 0.0_f64;
    let mut last_at = HashMap::new();
    // Compare each stored particle with its source
    for slot in 0..usize::try_from(index.count).expect("few") {
        let place = id.low_bits(slot).expect("an id") as usize;
        assert!(!std::mem::replace(&mut visited[place], true), "{place} twice");
        // Among coincident particles, the first in the source is the first here.
        let point = (raw.positions.get(place) - settings.origin).as_vec3() + Vec3::ZERO;
        let before = last_at.insert(point.to_array().map(f32::to_bits), place);
        assert!(before < Some(place), "{before:?} after {place}");
        let found = leaves.center(slot).as_dvec3() + settings.origin;
        largest = largest.max(found.distance(raw.positions.get(place)));
        // Compare the attributes
        for attribute in &raw.attributes {
            let Some(view) = frame.attribute(&attribute.name) else {
                continue;
            };
            let error = file
                .index()
                .attributes
                .iter()
                .filter(|a| a.name == attribute.name)
                .map(|a| a.max_error)
                .fold(0.0, f64::max);
            for component in 0..attribute.components {
                let given = attribute.data.get_f64(place * attribute.components + component);
                let difference = (view.get(slot, component) - given).abs();
                assert!(difference <= error, "{} {given}", attribute.name);
            }
        }
        // Check the box of the leaf
        let node = &leaves.nodes[slot / 128];
        let own = leaves.radii.load(slot / 16).map(|r| r.0[slot % 16]);
        if own.is_none() {
            let center = leaves.center(slot);
            let point = crate::blocks::Aabb { min: center, max: center };
            assert!(node.child_holds(slot / 16 % 8, &point));
        }
    }
    // Check the counts and the stated errors
    assert!(visited.into_iter().all(|s| s));
    assert_eq!(index.dropped, dropped as u64);
    assert!(largest <= index.max_error, "{largest} {}", index.max_error);
    let radius = match index.radius {
        RadiusIndex::Common(radius) => radius,
        _ => 0.01,
    };
    let bound = settings.bound.length(Some(radius));
    assert!(index.max_error <= bound * (1.0 + 1e-9));
    assert_eq!((index.time, index.step), (raw.time, raw.step));
}

#[test]
fn frames_do_not_depend_on_the_memory_limit() {
    for count in [0, 1, 15, 1023, 1024, 1025, 5000, 30_000] {
        let raw = raw(clustered(count));
        let one = converted(&raw, &settings(), whole());
        assert_eq!((one.parts, one.spilled_bytes), (1, 0));
        let parts = converted(&raw, &settings(), tight(4096, 10_000));
        assert_eq!(parts.spilled_bytes, 0);
        assert!(count < 5000 || parts.parts >= count as usize / 4096);
        let spilled = converted(&raw, &settings(), tight(4096, 0));
        assert!(count < 30_000 || spilled.spilled_bytes > 0);
    }
}

#[test]
fn spilling_does_not_change_the_bytes() {
    let raw = raw(clustered(40_000));
    let source = RawSource::new(Path::new("raw"), &raw).expect("whole");
    let bytes = |threads: usize, chunks: usize, batch_len: usize| {
        let dir = tempfile::tempdir().expect("a temporary directory");
        let path = dir.path().join("a.spf");
        let limits = Limits { batch_len, ..tight(4096, chunks) };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let convert = || convert_to(&path, &source, &settings(), limits).expect("converted");
        pool.expect("threads").install(convert);
        fs::read(path).expect("readable")
    };
    let expected = bytes(1, 10_000, 300);
    for (threads, chunks, batch_len) in [(4, 10_000, 300), (4, 0, 300), (2, 60, 77)] {
        assert!(bytes(threads, chunks, batch_len) == expected);
    }
}

#[test]
fn oversized_parts_are_divided_again() {
    // A sample this small misses the quantiles by far, and two parts are far too few.
    let limits = Limits { sample_len: 40, parts: 2, ..tight(2048, 0) };
    let report = converted(&raw(clustered(60_000)), &settings(), limits);
    assert!(report.parts >= 60_000 / 2048, "{}", report.parts);
}

#[test]
fn coincident_particles_are_split_by_index() {
    let mut all = vec![Vec3::splat(0.3); 20_000];
    all.extend(clustered(500));
    for limits in [whole(), tight(2048, 0)] {
        converted(&raw(all.clone()), &settings(), limits);
        converted(&raw(vec![Vec3::ONE; 9000]), &settings(), limits);
    }
}

// 30,000 particles are converted and compared in every encoding, for three limits of memory and three sets.
/// Few positions for many particles, so that blocks and parts share each position; zeros of both signs.
#[test]
fn coincident_particles_keep_the_order_of_the_source() {
    for places in [40, 700, 9000] {
        let shared = clustered(places);
        let place = |i: u32| {
            let place = shared[(i.wrapping_mul(2_654_435_761) % places) as usize];
            let zero = if i.is_multiple_of(3) { -0.0 } else { 0.0 };
            place.with_x(if place.x < 0.4 { zero } else { place.x })
        };
        let all: Vec<Vec3> = (0..30_000).map(place).collect();
        for limits in [whole(), tight(4096, 10_000), tight(2048, 0)] {
            for encoding in Encoding::ALL {
                let settings = ConvertSettings { encoding: Some(encoding), ..settings() };
                converted(&raw(all.clone()), &settings, limits);
            }
        }
    }
}

#[test]
fn non_finite_particles_are_dropped() {
    let mut all = clustered(20_000);
    for (i, position) in all.iter_mut().enumerate() {
        match i % 1000 {
            7 => position.x = f32::NAN,
            8 => position.z = f32::NEG_INFINITY,
            9 => position.y = -1.01 * crate::FARTHEST,
            10 => position.x = crate::FARTHEST,
            // Whole ranges of the source.
            _ if (6000..6900).contains(&i) => position.y = f32::INFINITY,
            _ => {}
        }
    }
    for limits in [whole(), tight(4096, 0)] {
        let report = converted(&raw(all.clone()), &settings(), limits);
        // One particle of the range is just near enough.
        assert_eq!(report.index.dropped, 899 + 3 * 19);
    }
    let none = vec![Vec3::NAN; 5000];
    for limits in [whole(), tight(4096, 0)] {
        let report = converted(&raw(none.clone()), &settings(), limits);
        assert_eq!((report.index.count, report.index.dropped), (0, 5000));
    }
}

#[test]
fn far_particles_in_double_precision_keep_their_distance() {
    let mut raw = raw(Vec::new());
    let far = DVec3::new(1e7, -3e6, 5.0);
    let all = clustered(10_000).into_iter();
    raw.positions = Positions::F64(all.map(|p| p.as_dvec3() / 64.0 + far).collect());
    raw.attributes.clear();
    let settings = ConvertSettings { origin: far, ..settings() };
    for limits in [whole(), tight(4096, 0)] {
        let report = converted(&raw, &settings, limits);
        assert!(report.index.max_error > 0.0);
    }
}

#[test]
fn attributes_are_stored_as_chosen() {
    let raw = raw(clustered(9000));
    let with = |velocity: AttributeChoice, rest: AttributeChoice| ConvertSettings {
        attributes: vec![("velocity".to_owned(), velocity)],
        other_attributes: rest,
        ..settings()
    };
    for limits in [whole(), tight(4096, 0)] {
        let half = with(AttributeChoice::Half, AttributeChoice::LeaveOut);
        let index = converted(&raw, &half, limits).index;
        let names: Vec<&str> = index.attributes.iter().map(|a| a.name.as_str()).collect();
        assert_eq!(names, ["velocity", "id"]);
        assert_eq!(index.attributes[0].stored, StoredType::Half.code());
        assert!(index.attributes[0].max_error > 0.0);
        let ranged = with(AttributeChoice::Ranged, AttributeChoice::AsIs);
        let index = converted(&raw, &ranged, limits).index;
        let [low, high] = index.attributes[0].ranges[2];
        assert!(low < high && index.attributes[0].max_error <= (2e4 / 255.0));
        assert_eq!(index.attributes[1].max_error, 0.0);
    }
    let unknown = ConvertSettings {
        attributes: vec![("speed".to_owned(), AttributeChoice::Half)],
        ..settings()
    };
    refused(&raw, &unknown, "velocity, place");
}

/// The conversion fails with a message that contains `text`, and leaves no file.
#[track_caller]
fn refused(raw: &RawParticles, settings: &ConvertSettings, text: &str) {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    let source = RawSource::new(Path::new("raw"), raw).expect("whole");
    for limits in [whole(), tight(2048, 0)] {
        let error = convert_to(&path, &source, settings, limits).expect_err("refused");
        assert!(error.to_string().contains(text), "{error}");
        assert_eq!(fs::read_dir(dir.path()).expect("readable").count(), 0);
    }
}

fn with_radii(count: u32, radius: impl Fn(u32) -> f32) -> RawParticles {
    let mut raw = raw(clustered(count));
    raw.attributes.push(Attribute {
        name: "Radius".into(),
        components: 1,
        data: AttributeData::F32((0..count).map(radius).collect()),
    });
    raw
}

#[test]
fn radii_stay_with_their_particles() {
    let own = with_radii(9000, |i| 0.01 + (i % 97) as f32 * 1e-3);
    let from_source = ConvertSettings {
        radius: RadiusRule::Source { otherwise: None },
        bound: Bound::OfRadius(0.1),
        ..settings()
    };
    for limits in [whole(), tight(4096, 0)] {
        let dir = tempfile::tempdir().expect("a temporary directory");
        let path = dir.path().join("a.spf");
        let source = RawSource::new(Path::new("raw"), &own).expect("whole");
        let report = convert_to(&path, &source, &from_source, limits).expect("converted");
        let file = NativeFile::open(&path, Access::Map).expect("whole");
        let frame = file.frame().expect("unchanged");
        let (leaves, id) = (frame.leaves().expect("in place"), frame.attribute("id"));
        let RadiusIndex::PerParticle(radii) = report.index.radius else {
            panic!("radii of their own")
        };
        assert!(frame.attribute("radius").is_none());
        for slot in 0..9000 {
            let place = id.and_then(|id| id.low_bits(slot)).expect("an id") as usize;
            let stored = leaves.radii.load(slot / 16).expect("radii").0[slot % 16];
            let given = own.attributes[2].data.get_f64(place);
            assert!((f64::from(stored) - given).abs() <= f64::from(radii.max_error) + 1e-7);
        }
        let alike = with_radii(3000, |_| 0.25);
        let report = converted(&alike, &from_source, limits);
        assert_eq!(report.index.radius, RadiusIndex::Common(0.25));
        let report = converted(&own, &settings(), limits);
        assert_eq!(report.index.radius, RadiusIndex::Common(0.01));
    }
    let bad = with_radii(3000, |i| if i == 2900 { -1.0 } else { 1.0 });
    refused(&bad, &from_source, "one radius for all particles");
}

#[test]
fn eight_bit_floats_have_no_infinity() {
    let mut raw = raw(clustered(3000));
    let AttributeData::F32(velocity) = &mut raw.attributes[0].data else { panic!("made so") };
    velocity[4000] = f32::NAN;
    let settings = ConvertSettings { other_attributes: AttributeChoice::Ranged, ..settings() };
    refused(&raw, &settings, "velocity has values that are not finite");
}

#[test]
fn generated_boxes_are_those_of_the_generator() {
    let generated = crate::generate::BoxSettings::thesis(20_000, 5);
    let mut expected = crate::generate::fill_box(&generated);
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    let source = BoxSource::new(generated, Some(0.125));
    let exact = ConvertSettings::default();
    let report = convert_to(&path, &source, &exact, tight(4096, 0)).expect("converted");
    assert_eq!(report.index.radius, RadiusIndex::Common(0.125));
    let file = NativeFile::open(&path, Access::Map).expect("whole");
    let raw = file.frame().expect("unchanged").to_raw().expect("whole");
    let Positions::F32(mut found) = raw.positions else { panic!("relative to zero") };
    let bits = |p: &Vec3| p.to_array().map(f32::to_bits);
    expected.sort_unstable_by_key(bits);
    found.sort_unstable_by_key(bits);
    assert!(found == expected);
}

#[test]
fn frames_are_converted_again() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let (first, second) = (dir.path().join("a.spf"), dir.path().join("b.spf"));
    let own = with_radii(9000, |i| 0.01 + (i % 97) as f32 * 1e-3);
    let exact = ConvertSettings {
        keep_ids: true,
        attributes: vec![("velocity".to_owned(), AttributeChoice::Half)],
        ..ConvertSettings::default()
    };
    let source = RawSource::new(Path::new("raw"), &own).expect("whole");
    convert_to(&first, &source, &exact, tight(4096, 0)).expect("converted");
    let file = NativeFile::open(&first, Access::Map).expect("whole");
    let raw = file.frame().expect("unchanged").to_raw().expect("whole");
    let again = NativeSource::new(&file).expect("in place");
    let coded = ConvertSettings {
        encoding: Some(Encoding::Q16),
        bound: Bound::OfRadius(0.1),
        ..ConvertSettings::default()
    };
    let report = convert_to(&second, &again, &coded, tight(2048, 0)).expect("converted");
    assert!(matches!(report.index.radius, RadiusIndex::PerParticle(_)));
    let from_memory = RawSource::new(Path::new("raw"), &raw).expect("whole");
    let third = dir.path().join("c.spf");
    convert_to(&third, &from_memory, &coded, tight(2048, 0)).expect("converted");
    assert!(fs::read(&second).expect("readable") == fs::read(&third).expect("readable"));
}

/// Cancels the conversion after this many calls.
struct Ends(AtomicU64);

impl Progress for Ends {
    fn advanced(&self, _phase: Phase, _done: u64, _total: u64) -> ControlFlow<()> {
        let left = self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |n| n.checked_sub(1));
        match left {
            Ok(_) => ControlFlow::Continue(()),
            Err(_) => ControlFlow::Break(()),
        }
    }
}

#[test]
fn interrupted_conversion_leaves_no_files() {
    let raw = raw(clustered(12_000));
    let source = RawSource::new(Path::new("raw"), &raw).expect("whole");
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    fs::write(&path, b"old").expect("writable");
    let settings = settings();
    let run = |calls: u64, limits: Limits| {
        let columns = StoredColumns::choose(&source, &settings, &path).expect("fit");
        let ends = Ends(AtomicU64::new(calls));
        let request = ConvertRequest { progress: &ends, ..request(&source, &path, &settings) };
        convert_within(request, columns, limits)
    };
    for limits in [whole(), tight(4096, 0)] {
        let mut calls = 0;
        while let Err(error) = run(calls, limits) {
            assert!(matches!(error, ConvertError::Interrupted), "{error}");
            assert_eq!(fs::read(&path).expect("readable"), b"old");
            assert_eq!(fs::read_dir(dir.path()).expect("readable").count(), 1);
            calls += 7;
        }
        assert!(calls > 40, "{calls}");
        fs::write(&path, b"old").expect("writable");
    }
}

#[test]
fn full_spill_disk_is_an_error() {
    let raw = raw(clustered(30_000));
    let source = RawSource::new(Path::new("raw"), &raw).expect("whole");
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    let settings = ConvertSettings { scratch_dir: Some(dir.path().join("none")), ..settings() };
    let error = convert_to(&path, &source, &settings, tight(4096, 0)).expect_err("no directory");
    assert!(matches!(error, ConvertError::Frame(FrameError::Io { .. })));
    assert!(error.to_string().contains("none"), "{error}");
    assert_eq!(fs::read_dir(dir.path()).expect("readable").count(), 0);
    // If nothing is spilled, no scratch file is created.
    convert_to(&path, &source, &settings, tight(4096, 10_000)).expect("converted");
}

/// A source that returns different particles when it is read again.
struct Changing(RawParticles, AtomicU64);

impl ParticleSource for Changing {
    fn count(&self) -> u64 {
        self.0.positions.len() as u64
    }

    fn attributes(&self) -> &[SourceAttribute] {
        &[]
    }

    fn read_positions(&self, first: u64, to: &mut [DVec3]) -> Result<(), FrameError> {
        let read = self.1.fetch_add(to.len() as u64, Ordering::Relaxed);
        for (place, to) in (first..).zip(to) {
            *to = self.0.positions.get(usize::try_from(place).expect("few"));
            if read >= self.count() && place == 700 {
                *to = DVec3::NAN;
            }
        }
        Ok(())
    }

    fn read_values(
        &self,
        _attribute: usize,
        _first: u64,
        _to: &mut [u8],
    ) -> Result<(), FrameError> {
        Ok(())
    }
}

#[test]
fn changed_source_is_detected() {
    for limits in [whole(), tight(2048, 0)] {
        let source = Changing(raw(clustered(5000)), AtomicU64::new(0));
        let dir = tempfile::tempdir().expect("a temporary directory");
        let path = dir.path().join("a.spf");
        let error = convert_to(&path, &source, &settings(), limits).expect_err("changed");
        assert!(error.to_string().contains("changed"), "{error}");
        assert_eq!(fs::read_dir(dir.path()).expect("readable").count(), 0);
    }
}

#[test]
fn budgets_add_up_to_the_memory_limit() {
    let gib = 1_u64 << 30;
    for (count, memory, width) in [
        (1_000_000_000, 12 * gib, 0),
        (1_000_000_000, gib, 28),
        (4_000_000, 64 << 20, 0),
        (u64::from(u32::MAX), 64 << 20, 400),
    ] {
        let settings = ConvertSettings { memory, ..ConvertSettings::default() };
        let limits = Limits::of(&settings, count, width, 8);
        assert!(!limits.is_whole);
        let parts = limits.part_len * (58 + 2 * width);
        let chunks = limits.chunks * limits.chunk_len * (12 + width);
        let all = parts + chunks + limits.window_bytes;
        assert!(all as u64 <= memory, "{limits:?}");
        assert!(limits.chunks > limits.parts.min(64), "{limits:?}");
    }
    let small = Limits::of(&ConvertSettings::default(), 10_000_000, 12, 12);
    assert!(small.is_whole);
    // The showcase keeps all particles in memory.
    let settings = ConvertSettings { memory: 12 * gib, ..ConvertSettings::default() };
    let limits = Limits::of(&settings, 1_000_000_000, 0, 8);
    assert!(limits.chunks * limits.chunk_len > 1_000_000_000);
}
