//! The number that a surface has in place of a material. What the material is, only the scene knows.

/// Index of a material in the list of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MaterialId(u16);

impl MaterialId {
    /// The material of the particles.
    pub const PARTICLES: Self = Self(0);
    /// Foam and spray.
    pub const SPRAY: Self = Self(1);
    /// The ground.
    pub const GROUND: Self = Self(2);
    /// Number of the materials that every scene has: those above.
    pub const BASIC: usize = 3;
    /// Maximum number of materials of a scene.
    pub const MAX: usize = 1 << 16;

    /// The material at `index`; None from [`Self::MAX`] on.
    pub fn at(index: usize) -> Option<Self> {
        u16::try_from(index).ok().map(Self)
    }

    /// Its index.
    #[inline(always)]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}
