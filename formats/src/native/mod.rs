//! The native frame file `.spf`.

use crate::read::Step;
use crate::{ParseError, RawParticles};

/// The first bytes of every native frame.
pub const MAGIC: &[u8; 8] = b"SPHERULE";

/// The only step of a native frame.
pub fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    Ok(vec![Step::whole(bytes.len())])
}

/// Reads a native frame.
pub fn read(_bytes: &[u8], _step: &Step) -> Result<RawParticles, ParseError> {
    Err(ParseError::unsupported("this reader is not written yet"))
}
