//! Reader module; see [`crate::read`].
use super::Step;
use crate::{ParseError, RawParticles};

/// The time steps that `bytes` hold.
pub fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    Ok(vec![Step::whole(bytes.len())])
}

/// Reads one of the [`steps`].
pub fn read(_bytes: &[u8], _step: &Step) -> Result<RawParticles, ParseError> {
    Err(ParseError::unsupported("this reader is not written yet"))
}
