//! Channels of an image: those with fixed names, and attributes by their names.

use std::borrow::Cow;

use serde_json::{Value as Json, json};

use super::field::Field;
use super::key::Key;
use super::value::{Fault, FlagKind, Value, list, named, quoted};

/// Prefix of the name of an attribute.
pub const ATTRIBUTE_CHANNEL: &str = "attribute:";

named! {
    /// Channels with fixed names.
    NamedChannel {
        /// Colour and coverage, premultiplied.
        Rgba = "RGBA",
        /// Distance along the view axis.
        Z = "Z",
        /// Normal.
        N = "N",
        /// Particle id.
        Id = "id",
        /// Position in the world.
        P = "P",
        /// Velocity.
        V = "V",
        /// Base colour, before lighting.
        Albedo = "albedo",
        /// All light channels.
        Lights = "lights",
        /// Light that opaque surfaces reflect diffusely.
        Diffuse = "diffuse",
        /// Light that opaque surfaces reflect glossily.
        Specular = "specular",
        /// Light by reflection at mirroring and transmissive surfaces.
        Reflection = "reflection",
        /// Light by refraction.
        Refraction = "refraction",
        /// Lights that the camera sees.
        Emission = "emission",
        /// The background that the camera sees.
        Background = "background",
        /// Light by its light group.
        LightGroups = "light_groups",
        /// Colour before denoising.
        Noisy = "noisy",
        /// Fraction of direct light that arrives.
        Shadow = "shadow",
        /// Motion on the film to the next frame.
        Motion = "motion",
        /// All Cryptomatte layers.
        Cryptomatte = "cryptomatte",
        /// Cryptomatte by particle.
        CryptoParticle = "crypto_particle",
        /// Cryptomatte by material.
        CryptoMaterial = "crypto_material",
        /// Cryptomatte by part.
        CryptoPart = "crypto_part",
        /// What is drawn over previews.
        Overlay = "overlay",
    }
}

/// A channel of an image.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Channel {
    /// With a fixed name.
    Named(NamedChannel),
    /// The attribute of this name.
    Attribute(String),
}

impl Channel {
    /// The name in a manifest.
    pub fn name(&self) -> Cow<'static, str> {
        match self {
            Self::Named(channel) => Cow::Borrowed(channel.name()),
            Self::Attribute(name) => Cow::Owned(format!("{ATTRIBUTE_CHANNEL}{name}")),
        }
    }
}

impl Value for Channel {
    fn kind(_: &Key) -> String {
        format!("one of {} or attribute:NAME", Self::words().join(", "))
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let text = field.as_text().ok_or(Fault::Unwanted)?;
        match text.strip_prefix(ATTRIBUTE_CHANNEL) {
            Some(name) if name.trim().is_empty() => Err(Fault::Unwanted),
            Some(name) => Ok(Self::Attribute(name.to_owned())),
            None => NamedChannel::parse(field, key).map(Self::Named),
        }
    }

    fn toml(&self) -> String {
        quoted(&self.name())
    }

    fn schema(key: &Key) -> Json {
        let attribute = json!({ "type": "string", "pattern": r"^attribute:\s*\S" });
        json!({ "anyOf": [NamedChannel::schema(key), attribute] })
    }

    fn words() -> Vec<&'static str> {
        NamedChannel::words()
    }
}

/// At least one channel, and no duplicates.
impl Value for Vec<Channel> {
    const FLAG: FlagKind = FlagKind::List;

    fn kind(key: &Key) -> String {
        format!("a list of {}, such as {}", key.name, key.example)
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let items = field.items().filter(|items| !items.is_empty());
        let mut channels = Self::new();
        for item in items.ok_or(Fault::Unwanted)? {
            let channel = item.value::<Channel>(key).ok_or(Fault::Noted)?;
            if channels.contains(&channel) {
                item.fail(&format!("{} is there twice", channel.name()));
                return Err(Fault::Noted);
            }
            channels.push(channel);
        }
        Ok(channels)
    }

    fn toml(&self) -> String {
        list(self.iter().map(Value::toml))
    }

    fn schema(key: &Key) -> Json {
        let items = Channel::schema(key);
        json!({ "type": "array", "items": items, "minItems": 1, "uniqueItems": true })
    }
}
