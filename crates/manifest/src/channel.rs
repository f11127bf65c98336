//! Channels of an image: those with fixed names, and attributes by their names.

use std::borrow::Cow;

use serde_json::{Value as Json, json};
use spherule_tracer::render::{FilmPlane, NamedChannel};

use super::field::Field;
use super::key::Key;
use super::value::{Fault, FlagKind, Value, list, quoted};

/// Prefix of the name of an attribute.
const ATTRIBUTE_CHANNEL: &str = "attribute:";

/// A channel of an image.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Channel {
    /// With a fixed name.
    Named(NamedChannel),
    /// The attribute of this name.
    Attribute(String),
}

impl Channel {
    /// The channel of one plane.
    pub const fn plane(plane: FilmPlane) -> Self {
        Self::Named(NamedChannel::Plane(plane))
    }

    /// The channel with this name in a manifest.
    pub fn from_name(name: &str) -> Option<Self> {
        match name.strip_prefix(ATTRIBUTE_CHANNEL) {
            Some(attribute) if attribute.trim().is_empty() => None,
            Some(attribute) => Some(Self::Attribute(attribute.to_owned())),
            None => NamedChannel::from_name(name).map(Self::Named),
        }
    }

    /// The fixed name.
    pub const fn named(&self) -> Option<NamedChannel> {
        match self {
            Self::Named(channel) => Some(*channel),
            Self::Attribute(_) => None,
        }
    }

    /// The attribute.
    pub fn attribute(&self) -> Option<&str> {
        match self {
            Self::Named(_) => None,
            Self::Attribute(name) => Some(name),
        }
    }

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

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        field.as_text().and_then(Self::from_name).ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        quoted(&self.name())
    }

    fn schema(_: &Key) -> Json {
        let attribute = json!({ "type": "string", "pattern": r"^attribute:\s*\S" });
        json!({ "anyOf": [{ "enum": Self::words() }, attribute] })
    }

    fn words() -> Vec<&'static str> {
        NamedChannel::ALL.map(NamedChannel::name).to_vec()
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
