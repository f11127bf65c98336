//! Counts of rays.

/// Rays traced, by what they were for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RayCounts {
    /// From the camera.
    pub primary: u64,
    /// To a light.
    pub shadow: u64,
    /// Mirrored.
    pub reflection: u64,
    /// Into or out of a transmissive body.
    pub refraction: u64,
}

impl RayCounts {
    /// All together.
    pub const fn total(&self) -> u64 {
        self.primary + self.shadow + self.reflection + self.refraction
    }
}

impl std::ops::Add for RayCounts {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            primary: self.primary + other.primary,
            shadow: self.shadow + other.shadow,
            reflection: self.reflection + other.reflection,
            refraction: self.refraction + other.refraction,
        }
    }
}
