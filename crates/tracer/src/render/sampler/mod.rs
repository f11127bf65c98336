//! Sampling: positions on the film ([`FilmSampler`]), and random numbers along paths ([`PathSeed`]). Both depend only
//! on the pixel and on the index of the sample.

mod film;
mod filter;
mod hash;
mod multi_jitter;
mod sobol;

pub use film::FilmSampler;
pub use filter::{FilterKind, MAX_FILTER_WIDTH, PixelFilter};
pub use multi_jitter::MultiJitter;
pub use sobol::PathSeed;
pub(super) use sobol::{get_1d_lanes, get_2d_lanes};
