//! What the planes for compositing divide pictures by: light by its first interaction, and objects; and the sizes of
//! planes that depend on the job.

use super::planes::FilmPlane;

/// Maximum number of components of attribute channels in a pixel.
pub const MAX_ATTRIBUTE_FLOATS: usize = 64;

/// Maximum number of light groups, with that of light without a group.
pub const MAX_LIGHT_GROUPS: usize = 64;

/// The usual number of levels of Cryptomatte.
pub const DEFAULT_MATTE_LEVELS: u8 = 6;

/// Maximum number of levels of Cryptomatte.
pub const MAX_MATTE_LEVELS: u8 = 32;

/// Classes of light by the first interaction of its path, seen from the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightClass {
    /// Diffuse reflection at an opaque surface, and ambient light.
    Diffuse,
    /// Glossy reflection at an opaque surface: the coat of plastic, metal, highlights.
    Specular,
    /// Reflection at a mirroring or transmissive surface.
    Reflection,
    /// Refraction at a transmissive surface.
    Refraction,
    /// Lights that the camera sees directly.
    Emission,
    /// The background or the environment that the camera sees directly.
    Background,
}

impl LightClass {
    /// All classes, in the order of their planes.
    pub const ALL: [Self; 6] = [
        Self::Diffuse,
        Self::Specular,
        Self::Reflection,
        Self::Refraction,
        Self::Emission,
        Self::Background,
    ];
    /// Number of classes.
    pub const COUNT: usize = Self::ALL.len();

    /// Its plane.
    pub const fn plane(self) -> FilmPlane {
        match self {
            Self::Diffuse => FilmPlane::Diffuse,
            Self::Specular => FilmPlane::Specular,
            Self::Reflection => FilmPlane::Reflection,
            Self::Refraction => FilmPlane::Refraction,
            Self::Emission => FilmPlane::Emission,
            Self::Background => FilmPlane::Background,
        }
    }
}

/// Ways to divide a picture into objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MatteKind {
    /// Every particle is an object.
    Particle,
    /// All surfaces of a material are an object.
    Material,
    /// All particles with the same part are an object.
    Part,
}

impl MatteKind {
    /// All kinds, in the order of their planes.
    pub const ALL: [Self; 3] = [Self::Particle, Self::Material, Self::Part];

    /// Its plane.
    pub const fn plane(self) -> FilmPlane {
        match self {
            Self::Particle => FilmPlane::CryptoParticle,
            Self::Material => FilmPlane::CryptoMaterial,
            Self::Part => FilmPlane::CryptoPart,
        }
    }
}

/// The sizes of planes whose number of components depends on the job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layers {
    /// Number of light groups in [`FilmPlane::LightGroups`]; 0 without the plane. The first group is that of light
    /// without a group.
    pub light_groups: u8,
    /// Number of components of [`FilmPlane::Attributes`]; 0 without the plane.
    pub attributes: u8,
    /// Maximum number of objects in a pixel of a Cryptomatte plane; even.
    pub matte_levels: u8,
}

impl Layers {
    /// Neither light groups nor attributes, and the usual number of levels.
    pub const NONE: Self =
        Self { light_groups: 0, attributes: 0, matte_levels: DEFAULT_MATTE_LEVELS };

    /// Sets the number of levels of Cryptomatte, rounded up to an even number.
    pub fn set_matte_levels(&mut self, levels: u32) {
        let levels = levels.clamp(1, u32::from(MAX_MATTE_LEVELS));
        self.matte_levels = u8::try_from(levels.next_multiple_of(2)).unwrap_or(MAX_MATTE_LEVELS);
    }

    /// Sets the number of light groups, if there is a plane for them: groups with `names`, and that of light without a
    /// group.
    pub fn set_light_groups(&mut self, names: usize) {
        if self.light_groups > 0 {
            self.light_groups = u8::try_from(1 + names).unwrap_or(u8::MAX);
        }
    }
}

impl Default for Layers {
    fn default() -> Self {
        Self::NONE
    }
}
