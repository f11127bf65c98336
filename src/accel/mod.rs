//! Placeholder: room for `accel`.
