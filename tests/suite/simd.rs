//! The SIMD levels that tests use: the same list as in unit tests.

pub(crate) use spherule::accel::simd::tested_levels::tested_levels;
