//! Channels for compositing, read back from images with a decoder that is independent of the encoder.

mod cryptomatte;
mod data;
mod light_groups;
mod lights;
mod parts;
