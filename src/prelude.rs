//! What a program needs to render particles in memory: `use spherule::prelude::*`.

pub use glam::{DVec3, Vec3};
pub use spherule_formats::{Attribute, AttributeData, PositionSlice};

pub use crate::render::{Film, FilmPlane};
pub use crate::still::{
    Particles, StillError, StillImage, StillSettings, particles, render, scalar,
};
