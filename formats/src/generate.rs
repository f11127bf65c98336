//! Seeded particle sets to measure with.
