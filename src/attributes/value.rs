//! Values of particles, by name: attributes, their components, and values that follow from the geometry.

use spherule_formats::names;

use super::Named;

/// A number for each particle.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ParticleValue {
    /// The magnitude of an attribute.
    Magnitude(String),
    /// A component of an attribute.
    Component(String, usize),
    /// Height along the up direction, in world units.
    Height,
    /// Distance from the camera along its view axis.
    Depth,
    /// Index of the particle in its frame.
    Index,
    /// Radius of the particle.
    Radius,
}

/// Names of values that need no attribute. Except for the radius, an attribute of the same name has precedence.
pub const GEOMETRIC_VALUES: [&str; 4] = ["height", "depth", "index", "radius"];

/// Names of components.
const COMPONENTS: [(&str, usize); 8] = [
    ("x", 0),
    ("y", 1),
    ("z", 2),
    ("w", 3),
    ("r", 0),
    ("g", 1),
    ("b", 2),
    ("a", 3),
];

impl ParticleValue {
    /// The value `name` of particles with `attributes`. Names are compared without regard to case; `v.x` and `v[0]` are
    /// the first component of `v`, `v.magnitude` is its length.
    pub fn named<A: Named>(name: &str, attributes: &[A]) -> Option<Self> {
        // The radius that is drawn may be another one than that of the file
        if name.eq_ignore_ascii_case(names::RADIUS) {
            return Some(Self::Radius);
        }
        let find = |name: &str| {
            attributes
                .iter()
                .find(|a| a.name().eq_ignore_ascii_case(name))
        };
        if let Some(attribute) = find(name) {
            return Some(Self::Magnitude(attribute.name().to_owned()));
        }
        if let Some((base, part)) = split(name)
            && let Some(attribute) = find(base)
        {
            let name = attribute.name().to_owned();
            return match part {
                Part::Magnitude => Some(Self::Magnitude(name)),
                Part::Component(c) if c < attribute.components() => Some(Self::Component(name, c)),
                Part::Component(_) => None,
            };
        }
        Self::geometric(name)
    }

    /// The value that needs no attribute with this name.
    pub fn geometric(name: &str) -> Option<Self> {
        match name.to_ascii_lowercase().as_str() {
            "height" => Some(Self::Height),
            "depth" => Some(Self::Depth),
            "index" => Some(Self::Index),
            "radius" => Some(Self::Radius),
            _ => None,
        }
    }

    /// Name of its attribute, if it has one.
    pub fn attribute(&self) -> Option<&str> {
        match self {
            Self::Magnitude(name) | Self::Component(name, _) => Some(name),
            Self::Height | Self::Depth | Self::Index | Self::Radius => None,
        }
    }

    /// Whether it is computed from positions or radii.
    pub const fn needs_geometry(&self) -> bool {
        matches!(self, Self::Height | Self::Depth | Self::Radius)
    }
}

enum Part {
    Magnitude,
    Component(usize),
}

/// Splits `v.x`, `v[0]` or `v.magnitude`.
fn split(name: &str) -> Option<(&str, Part)> {
    if let Some((base, index)) = name
        .strip_suffix(']')
        .and_then(|rest| rest.rsplit_once('['))
    {
        return Some((base, Part::Component(index.parse().ok()?)));
    }
    let (base, part) = name.rsplit_once('.')?;
    let part = part.to_ascii_lowercase();
    if part == "magnitude" {
        return Some((base, Part::Magnitude));
    }
    let found = COMPONENTS.iter().find(|(name, _)| *name == part);
    found.map(|(_, component)| (base, Part::Component(*component)))
}

#[cfg(test)]
mod tests {
    use spherule_formats::{Attribute, AttributeData};

    use super::*;

    #[test]
    fn values_have_names() {
        let attribute = |name: &str, components: usize| Attribute {
            name: name.to_owned(),
            components,
            data: AttributeData::F32(Vec::new()),
        };
        let all = [
            attribute("Velocity", 3),
            attribute("index", 1),
            attribute("a.x", 1),
        ];
        let component = |c| ParticleValue::Component("Velocity".to_owned(), c);
        for (name, expected) in [
            (
                "velocity",
                Some(ParticleValue::Magnitude("Velocity".to_owned())),
            ),
            (
                "velocity.magnitude",
                Some(ParticleValue::Magnitude("Velocity".to_owned())),
            ),
            ("VELOCITY.Y", Some(component(1))),
            ("velocity[2]", Some(component(2))),
            ("velocity.w", None),
            ("velocity[3]", None),
            ("velocity[x]", None),
            ("velocity.", None),
            ("height", Some(ParticleValue::Height)),
            ("depth", Some(ParticleValue::Depth)),
            ("Radius", Some(ParticleValue::Radius)),
            // Attributes have precedence
            ("index", Some(ParticleValue::Magnitude("index".to_owned()))),
            ("A.X", Some(ParticleValue::Magnitude("a.x".to_owned()))),
            ("speed", None),
            ("", None),
        ] {
            assert_eq!(ParticleValue::named(name, &all), expected, "{name}");
        }
    }
}
