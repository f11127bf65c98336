//! Where samples lie: on the film ([`FilmSampler`]), and in what is drawn along their paths ([`PathSeed`]). Both depend
//! on the pixel and on the number of the sample alone.

mod film;
mod hash;
mod multi_jitter;
mod sobol;

pub use film::FilmSampler;
pub use multi_jitter::MultiJitter;
pub use sobol::PathSeed;
