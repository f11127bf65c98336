//! The planes of a film in addition to `R G B A`: one table with a row for each of them.
//!
//! The film, the integrators, image files, viewer pages and the Python package read the table. A new plane needs a row,
//! a place in [`NamedChannel::ALL`](super::NamedChannel::ALL), and the code that computes its values: `attributes.rs`
//! and `FilmTile::set_data` for the nearest sample of a pixel, `sample_layers.rs` for all samples.

use super::aov::NO_ID;
use Components::{Attributes, Levels, LightGroups, One};

const RGB: Components = Components::Named(&["R", "G", "B"]);
const RGBA: Components = Components::Named(&["R", "G", "B", "A"]);
const XYZ: Components = Components::Named(&["X", "Y", "Z"]);
const UV: Components = Components::Named(&["U", "V"]);
const INTEGER: Components = Components::Named(&["I"]);

/// Makes [`FilmPlane`] and its table.
macro_rules! planes {
    ($($(#[$doc:meta])+
        $plane:ident = $name:literal, $components:ident, $kind:ident, $source:ident, $use:ident;)+) => {
        /// A plane of a film: the values of a channel for all pixels.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum FilmPlane {
            $($(#[$doc])+ $plane,)+
        }

        const TABLE: &[Row] = &[$(Row {
            plane: FilmPlane::$plane,
            name: $name,
            components: $components,
            kind: PlaneKind::$kind,
            source: PlaneSource::$source,
            denoiser_use: DenoiserUse::$use,
        }),+];
    };
}

planes! {
    // plane         name               components   kind      source             denoiser

    /// Distance along the view axis; infinite without an intersection.
    Depth          = "Z",               One,         Distance, Nearest,           Feature;
    /// Unit normal of the visible side in world space.
    Normal         = "N",               XYZ,         Surface,  Nearest,           Feature;
    /// Position in world units.
    Position       = "P",               XYZ,         Position, Nearest,           Unused;
    /// Velocity of the particle.
    Velocity       = "V",               XYZ,         Particle, NearestVelocity,   Unused;
    /// Base colour without lighting, linear.
    Albedo         = "albedo",          RGB,         Particle, Nearest,           Feature;
    /// Id of the particle, or [`NO_ID`].
    Id             = "id",              INTEGER,     Id,       NearestId,         Unused;
    /// Light by its first interaction: [`LightClass::Diffuse`](super::layers::LightClass::Diffuse).
    Diffuse        = "diffuse",         RGB,         Light,    SampleLight,       Unused;
    /// [`LightClass::Specular`](super::layers::LightClass::Specular).
    Specular       = "specular",        RGB,         Light,    SampleLight,       Unused;
    /// [`LightClass::Reflection`](super::layers::LightClass::Reflection).
    Reflection     = "reflection",      RGB,         Light,    SampleLight,       Unused;
    /// [`LightClass::Refraction`](super::layers::LightClass::Refraction).
    Refraction     = "refraction",      RGB,         Light,    SampleLight,       Unused;
    /// [`LightClass::Emission`](super::layers::LightClass::Emission).
    Emission       = "emission",        RGB,         Light,    SampleLight,       Unused;
    /// [`LightClass::Background`](super::layers::LightClass::Background).
    Background     = "background",      RGB,         Light,    SampleLight,       Unused;
    /// Light after at most one interaction: what the camera sees of lights and of the background, and what the first
    /// surface reflects or refracts of it.
    Direct         = "direct",          RGB,         Light,    SampleLight,       Unused;
    /// Light after several interactions.
    Indirect       = "indirect",        RGB,         Light,    SampleLight,       Unused;
    /// The colour before denoising, linear.
    Noisy          = "noisy",           RGB,         Light,    Samples,           Unused;
    /// Light by its source, linear; the sum of all groups is the colour before denoising.
    LightGroups    = "light_groups",    LightGroups, Light,    Samples,           Unused;
    /// The fraction of direct light that arrives, 0 to 1.
    Shadow         = "shadow",          One,         Surface,  Samples,           Unused;
    /// The fraction of its light that arrives on a shadow catcher, 1 elsewhere.
    ShadowCatcher  = "shadow_catcher",  RGB,         Light,    Samples,           Unused;
    /// Motion on the film to the next frame, pixels; x to the right, y up.
    Motion         = "motion",          UV,          Surface,  NearestVelocity,   Unused;
    /// Motion on the film back to the previous frame, pixels; x to the right, y up.
    MotionBack     = "motion_back",     UV,          Surface,  NearestVelocity,   Unused;
    /// Attributes of the particle.
    Attributes     = "",                Attributes,  Particle, NearestAttributes, Unused;
    /// Cryptomatte: every particle is an object.
    CryptoParticle = "crypto_particle", Levels,      Matte,    SampleIds,         Unused;
    /// Cryptomatte: all surfaces of a material are an object.
    CryptoMaterial = "crypto_material", Levels,      Matte,    Samples,           Unused;
    /// Cryptomatte: all particles with the same part are an object.
    CryptoPart     = "crypto_part",     Levels,      Matte,    SampleParts,       Unused;
    /// What is drawn over previews, linear RGB with alpha. Rendering leaves it as it is.
    Overlay        = "overlay",         RGBA,        Light,    Overlays,          Unused;
}

/// A row of the table.
struct Row {
    plane: FilmPlane,
    name: &'static str,
    components: Components,
    kind: PlaneKind,
    source: PlaneSource,
    denoiser_use: DenoiserUse,
}

/// The components of a pixel. Each is a channel of image files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Components {
    /// One number; its channel has the name of the plane.
    One,
    /// Numbers whose channels have the name of the plane, a dot, and these names.
    Named(&'static [&'static str]),
    /// R, G and B of each light group.
    LightGroups,
    /// The components of the attributes with channels.
    Attributes,
    /// The objects of a pixel and their coverages, in turns.
    Levels,
}

/// Kinds of planes by the statistics of their values, which decide about sample types and compression.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlaneKind {
    /// Linear colours. Half-floats in files, which is sufficient for displays; all others keep all of their bits.
    Light,
    /// Distances, mostly with the same exponent; infinite without an intersection.
    Distance,
    /// Coordinates, mostly with the same exponent.
    Position,
    /// Floats that change from pixel to pixel, with changing exponents.
    Surface,
    /// Floats that all pixels of a particle share.
    Particle,
    /// Unsigned integers that all pixels of a particle share.
    Id,
    /// Values as those of [`Self::Particle`] and of [`Self::Surface`], in turns.
    Matte,
}

/// Where the value of a pixel comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PlaneSource {
    /// The intersection of the nearest sample.
    Nearest,
    /// The id of the particle there.
    NearestId,
    /// The velocity of the particle there.
    NearestVelocity,
    /// The attributes of the particle there.
    NearestAttributes,
    /// All samples.
    Samples,
    /// The light of all samples by its first interaction.
    SampleLight,
    /// The ids of the particles of all samples.
    SampleIds,
    /// The parts of the particles of all samples.
    SampleParts,
    /// Drawings.
    Overlays,
}

/// What denoising does with a plane. It replaces only the colours and the coverage of a film.
#[derive(Clone, Copy, PartialEq, Eq)]
enum DenoiserUse {
    /// Compares pixels by it.
    Feature,
    /// Ignores it.
    Unused,
}

impl FilmPlane {
    /// Number of planes.
    pub const COUNT: usize = TABLE.len();

    /// All planes, in the order of the table.
    pub fn all() -> impl Iterator<Item = Self> {
        TABLE.iter().map(|row| row.plane)
    }

    const fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }

    /// Name in a manifest, and start of the names of the channels of a file. Attributes have their own names.
    pub const fn name(self) -> &'static str {
        self.row().name
    }

    /// The numbers of a pixel.
    pub const fn components(self) -> Components {
        self.row().components
    }

    /// Statistics of the values.
    pub const fn kind(self) -> PlaneKind {
        self.row().kind
    }

    /// Whether its values are those of the nearest sample, or a drawing.
    pub(super) const fn is_from_nearest(self) -> bool {
        use PlaneSource::{
            Nearest, NearestAttributes, NearestId, NearestVelocity, Overlays, SampleIds,
            SampleLight, SampleParts, Samples,
        };
        match self.row().source {
            Nearest | NearestId | NearestVelocity | NearestAttributes | Overlays => true,
            Samples | SampleLight | SampleIds | SampleParts => false,
        }
    }

    /// Whether it is one of Cryptomatte: objects and their coverages.
    pub(super) const fn is_matte(self) -> bool {
        matches!(self.components(), Levels)
    }

    /// The value of a pixel without an intersection: the bits of all components.
    pub(super) const fn miss(self) -> u32 {
        match self.kind() {
            PlaneKind::Distance => f32::INFINITY.to_bits(),
            PlaneKind::Id => NO_ID,
            _ => 0,
        }
    }
}

/// A set of planes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PlaneSet(u32);

impl PlaneSet {
    /// No plane.
    pub const NONE: Self = Self(0);

    /// Features for denoising.
    pub(super) const FEATURES: Self = {
        let (mut set, mut i) = (Self::NONE, 0);
        while i < TABLE.len() {
            if matches!(TABLE[i].denoiser_use, DenoiserUse::Feature) {
                set.insert(TABLE[i].plane);
            }
            i += 1;
        }
        set
    };

    /// These planes.
    pub const fn of(planes: &[FilmPlane]) -> Self {
        let (mut set, mut i) = (Self::NONE, 0);
        while i < planes.len() {
            set.insert(planes[i]);
            i += 1;
        }
        set
    }

    /// The planes whose values come from one of `sources`.
    pub(super) const fn from(sources: &[PlaneSource]) -> Self {
        let (mut set, mut i) = (Self::NONE, 0);
        while i < TABLE.len() * sources.len() {
            let (row, source) = (&TABLE[i / sources.len()], sources[i % sources.len()]);
            if row.source as u8 == source as u8 {
                set.insert(row.plane);
            }
            i += 1;
        }
        set
    }

    /// Adds `plane`.
    pub const fn insert(&mut self, plane: FilmPlane) {
        self.0 |= 1 << plane as u32;
    }

    /// The planes of both sets.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether it contains `plane`.
    pub const fn contains(self, plane: FilmPlane) -> bool {
        self.0 >> plane as u32 & 1 == 1
    }

    /// Whether the sets have a common plane.
    pub const fn intersects(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_plane_has_its_own_row() {
        for (number, plane) in FilmPlane::all().enumerate() {
            assert_eq!(plane as usize, number);
            let same = FilmPlane::all().filter(|other| other.name() == plane.name());
            assert_eq!(same.count(), 1, "{plane:?}");
        }
        let features = PlaneSet::of(&[FilmPlane::Depth, FilmPlane::Normal, FilmPlane::Albedo]);
        assert_eq!(PlaneSet::FEATURES, features);
    }
}
