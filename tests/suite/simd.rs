//! The SIMD levels that tests use: the same list as in unit tests.

use spherule::accel::simd::SimdLevel;

#[path = "../../src/accel/simd/tested_levels.rs"]
mod levels;

pub(crate) use levels::tested_levels;
