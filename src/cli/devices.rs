//! `spherule devices`: the adapters that can render, and why there is none.

use super::{CliError, Outcome, print};
use crate::pipeline::gpu;

pub(super) fn run() -> Result<Outcome, CliError> {
    print::lines(gpu::adapters())?;
    Ok(Outcome::Done)
}
