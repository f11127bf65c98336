//! Ray counters.

/// Number of rays traced, by purpose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RayCounts {
    /// Camera rays.
    pub primary: u64,
    /// Shadow rays.
    pub shadow: u64,
    /// Reflected rays.
    pub reflection: u64,
    /// Refracted rays, into or out of a transmissive body.
    pub refraction: u64,
}

impl RayCounts {
    /// Number of all rays.
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
