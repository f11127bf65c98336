//! What the tests of the text readers share: sample files, and damage to do to them.

use glam::DVec3;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use spherule_frame::{Attribute, AttributeData, ParseError, Positions, RawParticles};

use super::Step;

/// A file below `tests/data`, taken out of gzip.
pub(super) fn sample(name: &str) -> Vec<u8> {
    let path = format!("{}/../../tests/data/{name}", env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    if !name.ends_with(".gz") {
        return bytes;
    }
    let mut plain = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::MultiGzDecoder::new(&bytes[..]), &mut plain)
        .expect("the sample is whole");
    plain
}

pub(super) fn f64_positions(particles: &RawParticles) -> &[DVec3] {
    match &particles.positions {
        Positions::F64(v) => v,
        Positions::F32(_) => panic!("text has f64 positions"),
    }
}

pub(super) fn attribute<'a>(particles: &'a RawParticles, name: &str) -> &'a Attribute {
    let found = particles.attributes.iter().find(|a| a.name == name);
    found.unwrap_or_else(|| {
        let names: Vec<_> = particles.attributes.iter().map(|a| &a.name).collect();
        panic!("no {name} among {names:?}")
    })
}

pub(super) fn whole<'a>(particles: &'a RawParticles, name: &str) -> &'a [i64] {
    match &attribute(particles, name).data {
        AttributeData::I64(v) => v,
        other => panic!("{name} is {:?}", other.scalar_type()),
    }
}

pub(super) fn real<'a>(particles: &'a RawParticles, name: &str) -> &'a [f64] {
    match &attribute(particles, name).data {
        AttributeData::F64(v) => v,
        other => panic!("{name} is {:?}", other.scalar_type()),
    }
}

/// All sample frames hold the particles of `raw.xyz`; text was rounded to 6 digits or more.
#[track_caller]
pub(super) fn assert_agrees_with_raw(particles: &RawParticles) {
    let raw = sample("single_frames/raw.xyz");
    let (expected, _) = raw.as_chunks::<12>();
    let found = f64_positions(particles);
    assert_eq!(found.len(), expected.len());
    for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
        for axis in 0..3 {
            let (component, _) = expected.as_chunks::<4>();
            let expected = f64::from(f32::from_le_bytes(component[axis]));
            let allowed = expected.abs() * 5.1e-6 + 1e-12;
            assert!(
                (found[axis] - expected).abs() <= allowed,
                "{index} {axis}: {} {expected}",
                found[axis]
            );
        }
    }
    for attribute in &particles.attributes {
        assert_eq!(attribute.count(), found.len(), "{}", attribute.name);
    }
}

/// The same cases in every run.
pub(super) fn config() -> ProptestConfig {
    ProptestConfig {
        rng_seed: RngSeed::Fixed(20_031),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

type Steps = fn(&[u8]) -> Result<Vec<Step>, ParseError>;
type Read = fn(&[u8], &Step) -> Result<RawParticles, ParseError>;

/// Reads every step of `bytes`; what comes of it is no matter, but arrays fit and faults are inside
/// the file.
#[track_caller]
pub(super) fn read_all(bytes: &[u8], steps: Steps, read: Read) {
    let inside = |error: ParseError| {
        if let ParseError::Malformed { at, what } = error {
            assert!(at <= bytes.len() as u64, "{at} {what}");
            assert!(what.len() < 2000, "{what}");
        }
    };
    let steps = match steps(bytes) {
        Ok(steps) => steps,
        Err(error) => return inside(error),
    };
    for (index, step) in steps.iter().enumerate() {
        let end = step.byte_range().map_or(0, |range| range.end);
        assert!(step.index == index && end <= bytes.len());
        match read(bytes, step) {
            Ok(particles) => {
                let count = particles.positions.len();
                assert!(count <= bytes.len());
                for a in &particles.attributes {
                    assert_eq!(a.data.len(), count * a.components, "{}", a.name);
                }
            }
            Err(error) => inside(error),
        }
    }
}

/// Cuts `bytes` after every 97th byte.
#[track_caller]
pub(super) fn cut_everywhere(bytes: &[u8], steps: Steps, read: Read) {
    for len in (0..bytes.len()).step_by(97) {
        read_all(&bytes[..len], steps, read);
    }
}

/// Bytes to replace in a file: where (modulo its length) and by what.
pub(super) fn mutations() -> impl Strategy<Value = Vec<(usize, u8)>> {
    let bytes = b"0123456789 \n\r\t+-.,;:#\"eED/xyzINTM=\x00\xff".to_vec();
    prop::collection::vec((any::<usize>(), prop::sample::select(bytes)), 1..12)
}

/// `bytes` with `mutations` done.
pub(super) fn mutated(bytes: &[u8], mutations: &[(usize, u8)]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for (at, byte) in mutations {
        let at = at % bytes.len();
        bytes[at] = *byte;
    }
    bytes
}

/// Text of the letters that these formats are made of.
pub(super) fn letters() -> impl Strategy<Value = Vec<u8>> {
    let words = [
        "ITEM: ",
        "TIMESTEP",
        "NUMBER OF ATOMS",
        "BOX BOUNDS",
        "ATOMS",
        "TIME",
        "x",
        "y",
        "z",
        "id",
        "xs",
        "\n",
        "\n",
        "\n",
        " ",
        " ",
        "1",
        "2",
        "0",
        "-7",
        "1.5",
        "1e9",
        "nan",
        ",",
        ";",
        "\"",
        "#",
        "//",
        "Properties=",
        "pos:R:3",
        ":",
        "9999999999",
        "W",
        "\r\n",
        "\t",
        "Points:0",
    ];
    prop::collection::vec(prop::sample::select(words.to_vec()), 0..120)
        .prop_map(|words| words.concat().into_bytes())
}
