//! Mutations of the committed inputs: fuzzing without a nightly toolchain.
//!
//! A number of inputs per target that are the same in each run; with `PROPTEST_CASES`, as many others; with
//! `FUZZ_TARGETS`, of these targets alone:
//!
//! ```text
//! PROPTEST_CASES=1000000 FUZZ_TARGETS=csv,npy cargo test --release -p spherule-formats --test corpus mutated
//! ```

use std::fs;

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

use super::targets::TARGETS;
use super::{corpus, inputs};

/// Inputs per target by default.
const CASES: u32 = 256;

/// Bytes that are at the ends of the range of some number, or no number at all.
const WORDS: [&[u8]; 12] = [
    b"\xff\xff\xff\xff",
    b"\x00\x00\x00\x00",
    b"\x00\x00\x00\x80",
    b"\x7f\xff\xff\xff",
    b"\x01\x00\x00\x00",
    b"\x00\x00\x00\x01",
    b"\xff\xff\xff\xff\xff\xff\xff\xff",
    b"\x00\x00\x10\x00\x00\x00\x00\x00",
    b"9999999999",
    b"-1",
    b"1e308",
    b"nan",
];

/// A change of an input.
#[derive(Debug, Clone)]
enum Edit {
    Flip(Index, u8),
    Overwrite(Index, &'static [u8]),
    Insert(Index, &'static [u8]),
    Cut(Index),
    Remove(Index, usize),
    /// Copies so many bytes to another place.
    Repeat(Index, usize, Index),
    /// Overwrites with so many bytes of another input of the target.
    Splice(Index, Index, usize, Index),
}

impl Edit {
    fn any() -> impl Strategy<Value = Self> {
        let place = any::<Index>;
        prop_oneof![
            3 => (place(), 0..8_u8).prop_map(|(at, bit)| Self::Flip(at, 1 << bit)),
            1 => (place(), 1..=255_u8).prop_map(|(at, bits)| Self::Flip(at, bits)),
            3 => (place(), select(&WORDS[..])).prop_map(|(at, word)| Self::Overwrite(at, word)),
            1 => (place(), select(&WORDS[..])).prop_map(|(at, word)| Self::Insert(at, word)),
            1 => place().prop_map(Self::Cut),
            1 => (place(), 1..16_usize).prop_map(|(at, len)| Self::Remove(at, len)),
            1 => (place(), 1..64_usize, place()).prop_map(|(from, len, to)| Self::Repeat(from, len, to)),
            1 => (place(), place(), 1..256_usize, place())
                .prop_map(|(input, from, len, to)| Self::Splice(input, from, len, to)),
        ]
    }

    fn apply(&self, bytes: &mut Vec<u8>, all: &[Vec<u8>]) {
        let len = bytes.len();
        let place = |at: &Index| at.index(len + 1);
        match self {
            Self::Flip(at, bits) => {
                let at = place(at);
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= bits;
                }
            }
            Self::Overwrite(at, word) => overwrite(bytes, place(at), word),
            Self::Insert(at, word) => {
                let at = place(at);
                bytes.splice(at..at, word.iter().copied());
            }
            Self::Cut(at) => bytes.truncate(place(at)),
            Self::Remove(at, len) => {
                let at = place(at);
                bytes.drain(at..(at + len).min(bytes.len()));
            }
            Self::Repeat(from, len, to) => {
                let (from, to) = (place(from), place(to));
                let copy = bytes[from..(from + len).min(bytes.len())].to_vec();
                bytes.splice(to..to, copy);
            }
            Self::Splice(input, from, len, to) => {
                let other = input.get(all);
                let from = from.index(other.len() + 1);
                let end = (from + len).min(other.len());
                overwrite(bytes, place(to), &other[from..end]);
            }
        }
    }
}

/// Replaces the bytes at `at` by `new`, as far as there are any.
fn overwrite(bytes: &mut [u8], at: usize, new: &[u8]) {
    let rest = &mut bytes[at..];
    let len = new.len().min(rest.len());
    rest[..len].copy_from_slice(&new[..len]);
}

#[test]
fn mutated_inputs_keep_the_promises() {
    let is_long = std::env::var_os("PROPTEST_CASES").is_some();
    let mut config = Config { failure_persistence: None, ..Config::default() };
    if !is_long {
        config.cases = CASES;
    }
    let wanted = std::env::var("FUZZ_TARGETS").ok();
    let is_wanted = |name: &str| {
        let mut names = wanted.iter().flat_map(|names| names.split(','));
        wanted.is_none() || names.any(|wanted| wanted == name)
    };
    for (name, target) in TARGETS.into_iter().filter(|(name, _)| is_wanted(name)) {
        let all: Vec<Vec<u8>> = inputs(&corpus().join(name))
            .iter()
            .map(|path| fs::read(path).expect("readable"))
            .collect();
        let mut runner = if is_long {
            TestRunner::new(config.clone())
        } else {
            let random = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
            TestRunner::new_with_rng(config.clone(), random)
        };
        let edited = (any::<Index>(), vec(Edit::any(), 1..6));
        let kept = runner.run(&edited, |(input, edits)| {
            let mut bytes = input.get(&all).clone();
            for edit in &edits {
                edit.apply(&mut bytes, &all);
            }
            target(&bytes);
            Ok(())
        });
        if let Err(broken) = kept {
            panic!("{name}: {broken}");
        }
    }
}
