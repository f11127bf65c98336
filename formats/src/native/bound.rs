//! The allowed distance of a stored position from the true one.

/// The largest allowed distance.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Bound {
    /// Any distance is allowed.
    #[default]
    None,
    /// A length in scene units.
    Length(f64),
    /// A fraction of the radius. If radii differ, the smallest radius of the block is used.
    OfRadius(f64),
}

impl Bound {
    /// The length in scene units for spheres of this radius. Without a radius, a fraction gives 0.
    pub fn length(self, radius: Option<f32>) -> f64 {
        match self {
            Self::None => f64::INFINITY,
            Self::Length(length) => length,
            Self::OfRadius(fraction) => fraction * f64::from(radius.unwrap_or(0.0)),
        }
    }
}
