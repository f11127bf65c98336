//! The SIMD levels that tests run with: the same list as for the tests next to the code.

use spherule::accel::simd::SimdLevel;

#[path = "../../src/accel/simd/tested_levels.rs"]
mod levels;

pub(crate) use levels::tested_levels;
