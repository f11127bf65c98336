//! Every sample and damaged file with random harm done to it: anything may come of it but a panic.

use std::fs;
use std::path::PathBuf;

use proptest::prelude::*;
use proptest::sample::Index;
use spherule_formats::FrameFile;

use super::{directory, make, read_all};
use crate::harness::sample;

/// What happens to a file on the way.
#[derive(Debug, Clone)]
enum Harm {
    /// A byte becomes another.
    Byte(Index, u8),
    /// Bytes are lost.
    Lose(Index, u8),
    /// A piece comes twice.
    Repeat(Index, u8),
    /// The rest is missing.
    Cut(Index),
}

fn harm() -> impl Strategy<Value = Harm> {
    let place = || any::<Index>();
    // Digits and separators are what text formats stumble over.
    let byte = prop_oneof![any::<u8>(), prop::sample::select(&b"0123456789-+.eE \n,<>\"'"[..])];
    prop_oneof![
        8 => (place(), byte).prop_map(|(at, byte)| Harm::Byte(at, byte)),
        1 => (place(), any::<u8>()).prop_map(|(at, length)| Harm::Lose(at, length)),
        1 => (place(), any::<u8>()).prop_map(|(at, length)| Harm::Repeat(at, length)),
        1 => place().prop_map(Harm::Cut),
    ]
}

fn harmed(bytes: &[u8], harms: &[Harm], in_head: bool) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for harm in harms {
        if bytes.is_empty() {
            break;
        }
        // Most of a file is numbers; what is believed stands at its start.
        let reach = if in_head { bytes.len().min(400) } else { bytes.len() };
        let end = |at: usize, length: u8| (at + usize::from(length)).min(bytes.len());
        match harm {
            Harm::Byte(at, byte) => bytes[at.index(reach)] = *byte,
            Harm::Lose(at, length) => {
                let at = at.index(reach);
                let end = end(at, *length);
                bytes.drain(at..end);
            }
            Harm::Repeat(at, length) => {
                let at = at.index(reach);
                let piece = bytes[at..end(at, *length)].to_vec();
                bytes.splice(at..at, piece);
            }
            Harm::Cut(at) => bytes.truncate(at.index(reach)),
        }
    }
    bytes
}

/// Every sample, and the damaged ones on top.
fn samples() -> Vec<(PathBuf, Vec<u8>)> {
    let mut all = Vec::new();
    for folder in [
        "emitter_sph",
        "lammps_drop/steps",
        "public_partio",
        "public_splashsurf",
        "pysph",
        "single_frames",
    ] {
        let entries = fs::read_dir(sample(folder)).expect("a directory of samples");
        all.extend(entries.map(|e| e.expect("an entry").path()).filter(|p| p.is_file()));
    }
    all.extend(make::files().into_iter().map(|(name, _)| directory().join(name)));
    all.sort();
    let mut samples = Vec::new();
    for path in all {
        let bytes = fs::read(&path).expect("a sample");
        // Harm to a gzip stream seldom gets past its checksum.
        if let Ok(file) = FrameFile::open(&path)
            && file.bytes() != bytes
        {
            samples.push((path.clone(), file.bytes().to_vec()));
        }
        samples.push((path, bytes));
    }
    samples
}

/// Harmed copies of each sample.
const CASES: u32 = 48;

#[test]
fn mutated_samples_do_not_panic() {
    let config = ProptestConfig {
        cases: CASES,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(7),
        ..ProptestConfig::default()
    };
    for (path, bytes) in samples() {
        let mut runner = proptest::test_runner::TestRunner::new(config.clone());
        let harms = (prop::collection::vec(harm(), 1..6), any::<bool>());
        let result = runner.run(&harms, |(harms, in_head)| {
            let bytes = harmed(&bytes, &harms, in_head);
            // Either is fine, as long as it comes back.
            let _ = read_all(&path, FrameFile::from_bytes(&path, bytes));
            Ok(())
        });
        result.unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    }
}
