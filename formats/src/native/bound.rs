//! How far a stored position may be from the true one.

/// The largest distance that is allowed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Bound {
    /// Any.
    #[default]
    None,
    /// A length in scene units.
    Length(f64),
    /// A fraction of the radius; of the smallest in a block where radii differ.
    OfRadius(f64),
}

impl Bound {
    /// The length for spheres of this radius. Without a radius a fraction of it allows nothing.
    pub fn length(self, radius: Option<f32>) -> f64 {
        match self {
            Self::None => f64::INFINITY,
            Self::Length(length) => length,
            Self::OfRadius(fraction) => fraction * f64::from(radius.unwrap_or(0.0)),
        }
    }
}
