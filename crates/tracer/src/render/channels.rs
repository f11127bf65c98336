//! The channels of an image: a set of planes, and the names that stand for them.

use thiserror::Error;

use super::layers::{Layers, LightClass, MatteKind};
use super::planes::{Components, FilmPlane, PlaneSet, PlaneSource};

use PlaneSource::{
    Nearest, NearestAttributes, NearestId, NearestVelocity, SampleIds, SampleLight, SampleParts,
    Samples,
};

/// The planes of a film in addition to `R G B A`, which it always has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Channels {
    /// All planes apart from light groups and attributes, which are present if [`Self::layers`] has any.
    set: PlaneSet,
    /// The sizes of planes that depend on the job.
    pub layers: Layers,
}

/// The name of a channel in a manifest. Attributes have no fixed names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NamedChannel {
    /// Colour and coverage, premultiplied.
    Rgba,
    /// All classes of light.
    Lights,
    /// All Cryptomatte planes.
    Cryptomatte,
    /// One plane.
    Plane(FilmPlane),
}

/// An unknown channel name.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("no channel is called {name:?}, the known ones are {}", known_names())]
pub struct UnknownChannel {
    /// The name.
    pub name: String,
}

impl NamedChannel {
    /// All names, in the order of the manual.
    pub const ALL: [Self; 27] = [
        Self::Rgba,
        Self::Plane(FilmPlane::Depth),
        Self::Plane(FilmPlane::Normal),
        Self::Plane(FilmPlane::Id),
        Self::Plane(FilmPlane::Position),
        Self::Plane(FilmPlane::Velocity),
        Self::Plane(FilmPlane::Albedo),
        Self::Lights,
        Self::Plane(FilmPlane::Diffuse),
        Self::Plane(FilmPlane::Specular),
        Self::Plane(FilmPlane::Reflection),
        Self::Plane(FilmPlane::Refraction),
        Self::Plane(FilmPlane::Emission),
        Self::Plane(FilmPlane::Background),
        Self::Plane(FilmPlane::Direct),
        Self::Plane(FilmPlane::Indirect),
        Self::Plane(FilmPlane::LightGroups),
        Self::Plane(FilmPlane::Noisy),
        Self::Plane(FilmPlane::Shadow),
        Self::Plane(FilmPlane::ShadowCatcher),
        Self::Plane(FilmPlane::Motion),
        Self::Plane(FilmPlane::MotionBack),
        Self::Cryptomatte,
        Self::Plane(FilmPlane::CryptoParticle),
        Self::Plane(FilmPlane::CryptoMaterial),
        Self::Plane(FilmPlane::CryptoPart),
        Self::Plane(FilmPlane::Overlay),
    ];

    /// The channel with this name in a manifest. Renderers with passes of transmission mean refraction.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "transmission" => Some(Self::Plane(FilmPlane::Refraction)),
            _ => Self::ALL.into_iter().find(|channel| channel.name() == name),
        }
    }

    /// The name in a manifest.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rgba => "RGBA",
            Self::Lights => "lights",
            Self::Cryptomatte => "cryptomatte",
            Self::Plane(plane) => plane.name(),
        }
    }
}

fn known_names() -> String {
    let names = NamedChannel::ALL.map(NamedChannel::name);
    let [others @ .., last] = &names;
    format!("{} and {last}", others.join(", "))
}

impl Channels {
    /// Colour only.
    pub const COLOR: Self = Self { set: PlaneSet::NONE, layers: Layers::NONE };

    /// Colour and the data of the nearest sample of a pixel, without attributes and motion.
    pub const ALL: Self = Self::COLOR.with(&[
        FilmPlane::Depth,
        FilmPlane::Normal,
        FilmPlane::Position,
        FilmPlane::Velocity,
        FilmPlane::Albedo,
        FilmPlane::Id,
    ]);

    /// These and `planes`, which must not be light groups and attributes: [`Self::layers`] has those.
    #[must_use]
    pub const fn with(self, planes: &[FilmPlane]) -> Self {
        Self { set: self.set.with(PlaneSet::of(planes)), ..self }
    }

    /// The planes.
    pub const fn planes(&self) -> PlaneSet {
        let mut set = self.set;
        if self.layers.light_groups > 0 {
            set.insert(FilmPlane::LightGroups);
        }
        if self.layers.attributes > 0 {
            set.insert(FilmPlane::Attributes);
        }
        set
    }

    /// Whether `plane` is among them.
    pub const fn has(&self, plane: FilmPlane) -> bool {
        self.planes().contains(plane)
    }

    /// Number of components of a pixel in `plane`; 0 if it is not among them.
    pub const fn components(&self, plane: FilmPlane) -> usize {
        if !self.has(plane) {
            return 0;
        }
        match plane.components() {
            Components::One => 1,
            Components::Named(names) => names.len(),
            Components::LightGroups => 3 * self.layers.light_groups as usize,
            Components::Attributes => self.layers.attributes as usize,
            Components::Levels => 2 * self.layers.matte_levels as usize,
        }
    }

    /// [`Self::components`] of all planes, by their number.
    pub(super) fn sizes(&self) -> [usize; FilmPlane::COUNT] {
        let mut sizes = [0; FilmPlane::COUNT];
        for (plane, size) in FilmPlane::all().zip(&mut sizes) {
            *size = self.components(plane);
        }
        sizes
    }

    /// The Cryptomatte planes, in order.
    pub fn mattes(&self) -> impl Iterator<Item = MatteKind> + Clone + use<> {
        let set = self.set;
        MatteKind::ALL.into_iter().filter(move |kind| set.contains(kind.plane()))
    }

    /// Whether a channel depends on all samples of a pixel.
    pub(super) const fn needs_samples(&self) -> bool {
        let planes = const { PlaneSet::from(&[Samples, SampleLight, SampleIds, SampleParts]) };
        self.planes().intersects(planes)
    }

    /// Whether a channel is light by its first interaction.
    pub(super) const fn needs_light_classes(&self) -> bool {
        self.set.intersects(const { PlaneSet::from(&[SampleLight]) })
    }

    /// Whether a channel depends on the ids of particles.
    pub const fn needs_ids(&self) -> bool {
        self.set.intersects(const { PlaneSet::from(&[NearestId, SampleIds]) })
    }

    /// Whether a channel depends on the velocities of particles.
    pub const fn needs_velocities(&self) -> bool {
        self.set.intersects(const { PlaneSet::from(&[NearestVelocity]) })
    }

    /// Whether a channel depends on the parts of particles.
    pub const fn needs_parts(&self) -> bool {
        self.set.intersects(const { PlaneSet::from(&[SampleParts]) })
    }

    /// Whether a channel is that of the nearest sample of a pixel.
    pub const fn needs_nearest(&self) -> bool {
        self.set.intersects(const { PlaneSet::from(&[Nearest]) }) || self.needs_nearest_particle()
    }

    /// Whether the nearest sample of a pixel needs the index of its particle.
    pub const fn needs_nearest_particle(&self) -> bool {
        let planes = const { PlaneSet::from(&[NearestId, NearestVelocity, NearestAttributes]) };
        self.planes().intersects(planes)
    }

    /// Whether a channel depends on the attributes of single particles, so that their indices are needed.
    pub const fn needs_particles(&self) -> bool {
        self.needs_nearest_particle() || self.needs_ids() || self.needs_parts()
    }

    /// These and, if `has_features`, those that are features for denoising.
    #[must_use]
    pub(super) const fn with_features(self, has_features: bool) -> Self {
        if has_features { Self { set: self.set.with(PlaneSet::FEATURES), ..self } } else { self }
    }

    /// Colour and the channels with these names. A plane of light groups is for one group, without a name.
    pub fn of(names: impl IntoIterator<Item = NamedChannel>) -> Self {
        names.into_iter().fold(Self::COLOR, |mut channels, name| match name {
            NamedChannel::Rgba => channels,
            NamedChannel::Lights => channels.with(&LightClass::ALL.map(LightClass::plane)),
            NamedChannel::Cryptomatte => channels.with(&MatteKind::ALL.map(MatteKind::plane)),
            NamedChannel::Plane(FilmPlane::LightGroups) => {
                channels.layers.light_groups = 1;
                channels
            }
            NamedChannel::Plane(plane) => channels.with(&[plane]),
        })
    }

    /// Channels by their names in a manifest; `RGBA` is allowed, and always included. Attributes have no fixed names.
    ///
    /// # Errors
    /// If a name is unknown.
    pub fn from_names<'a>(
        names: impl IntoIterator<Item = &'a str>,
    ) -> Result<Self, UnknownChannel> {
        let unknown = |name: &str| UnknownChannel { name: name.to_owned() };
        let channel = |name| NamedChannel::from_name(name).ok_or_else(|| unknown(name));
        Ok(Self::of(names.into_iter().map(channel).collect::<Result<Vec<_>, _>>()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_plane_has_a_name_in_manifests() {
        for plane in FilmPlane::all().filter(|plane| *plane != FilmPlane::Attributes) {
            let channels = Channels::from_names([plane.name()]).unwrap();
            assert!(channels.has(plane), "{plane:?}");
            assert_eq!(FilmPlane::all().filter(|plane| channels.has(*plane)).count(), 1);
        }
        assert!(Channels::from_names([""]).is_err());
    }

    #[test]
    fn names_choose_planes() {
        let channels = Channels::from_names(["RGBA", "Z", "id"]).unwrap();
        assert_eq!(channels, Channels::COLOR.with(&[FilmPlane::Depth, FilmPlane::Id]));
        let channels = Channels::from_names(["lights", "cryptomatte"]).unwrap();
        assert_eq!(FilmPlane::all().filter(|plane| channels.has(*plane)).count(), 9);
        let error = Channels::from_names(["depth"]).unwrap_err().to_string();
        assert!(
            error.contains("\"depth\"") && error.ends_with("crypto_part and overlay"),
            "{error}"
        );
    }
}
