//! Which files are which frame.
