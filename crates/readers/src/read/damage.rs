//! What the tests of several readers share: sample files, and the damage every reader must survive.

use std::fs;
use std::io::Read as _;

use flate2::read::MultiGzDecoder;

use super::Step;
use spherule_frame::{Attribute, AttributeData, ParseError, Positions, RawParticles};

/// The functions of a reader module.
#[derive(Clone, Copy)]
pub(super) struct TestedReader {
    pub(super) steps: fn(&[u8]) -> Result<Vec<Step>, ParseError>,
    pub(super) read: fn(&[u8], &Step) -> Result<RawParticles, ParseError>,
}

impl TestedReader {
    /// All steps, or the first error. Checks what holds for whatever a reader returns.
    pub(super) fn all(self, bytes: &[u8]) -> Result<Vec<RawParticles>, ParseError> {
        let steps = (self.steps)(bytes).map_err(fit_to_show)?;
        let mut all = Vec::new();
        for step in steps.iter().take(4) {
            let particles = (self.read)(bytes, step).map_err(fit_to_show)?;
            for attribute in &particles.attributes {
                assert!(attribute.components > 0, "{} is empty", attribute.name);
                assert_eq!(
                    attribute.data.len(),
                    attribute.components * particles.positions.len(),
                    "{}",
                    attribute.name
                );
            }
            all.push(particles);
        }
        Ok(all)
    }

    /// The only step of a good file.
    #[track_caller]
    pub(super) fn one(self, bytes: &[u8]) -> RawParticles {
        let mut all = self.all(bytes).expect("a good file");
        assert_eq!(all.len(), 1);
        all.remove(0)
    }

    /// The message of the error that `read` gives for the first step, whatever `steps` returns.
    #[track_caller]
    pub(super) fn error(self, bytes: &[u8]) -> ParseError {
        fit_to_show((self.read)(bytes, &Step::whole(bytes.len())).expect_err("a bad file"))
    }

    /// The same, of a file without compression: the place is one of its bytes, or its end.
    #[track_caller]
    pub(super) fn error_inside(self, bytes: &[u8]) -> ParseError {
        let error = self.error(bytes);
        if let ParseError::Malformed { at, .. } = &error {
            assert!(*at <= bytes.len() as u64, "{error}: {} bytes", bytes.len());
        }
        error
    }

    /// Cuts the file at every 97th byte and at `sections`. The first `needed` bytes are all that a
    /// reader needs; shorter files must be refused, longer ones may be read.
    pub(super) fn survives_truncation(self, bytes: &[u8], sections: &[usize], needed: usize) {
        let cuts = (0..bytes.len()).step_by(97).chain(sections.iter().copied());
        for cut in cuts {
            let result = self.all(&bytes[..cut]);
            assert!(cut >= needed || result.is_err(), "cut at {cut} was read");
        }
    }
}

/// The same error, if a terminal can show it in one line that is not too long.
fn fit_to_show(error: ParseError) -> ParseError {
    let text = error.to_string();
    assert!(!text.contains(char::is_control), "{text:?}");
    assert!(text.len() < 4000, "{} bytes", text.len());
    error
}

/// A file of `tests/data`, inflated if it is gzipped.
pub(super) fn sample(path: &str) -> Vec<u8> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/");
    let bytes = fs::read(format!("{root}{path}")).expect("the sample is in the repository");
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return bytes;
    }
    let mut inflated = Vec::new();
    MultiGzDecoder::new(bytes.as_slice()).read_to_end(&mut inflated).expect("the sample is whole");
    inflated
}

/// Replaces the bytes at the given places.
pub(super) fn mutate(bytes: &[u8], changes: &[(proptest::sample::Index, u8)]) -> Vec<u8> {
    let mut mutated = bytes.to_vec();
    for (place, byte) in changes {
        let at = place.index(mutated.len());
        mutated[at] = *byte;
    }
    mutated
}

/// The attribute called `name`.
#[track_caller]
pub(super) fn attribute<'a>(particles: &'a RawParticles, name: &str) -> &'a Attribute {
    let found = particles.attributes.iter().find(|a| a.name == name);
    found.unwrap_or_else(|| panic!("no attribute {name} in {:?}", names(particles)))
}

/// Names of all attributes.
pub(super) fn names(particles: &RawParticles) -> Vec<&str> {
    particles.attributes.iter().map(|a| a.name.as_str()).collect()
}

/// All coordinates in f64.
pub(super) fn coordinates(positions: &Positions) -> Vec<[f64; 3]> {
    (0..positions.len()).map(|i| positions.get(i).to_array()).collect()
}

/// All numbers in f64.
pub(super) fn numbers(data: &AttributeData) -> Vec<f64> {
    (0..data.len()).map(|i| data.get_f64(i)).collect()
}
