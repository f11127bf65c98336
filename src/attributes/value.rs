//! Values of particles, by name: attributes, their components, and values that follow from the geometry.

use glam::DVec3;
use spherule_formats::names;

use super::{Named, velocity_of};

/// A number for each particle.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ParticleValue {
    /// The magnitude of an attribute.
    Magnitude(String),
    /// A component of an attribute.
    Component(String, usize),
    /// World coordinate on an axis: 0 is x.
    Position(usize),
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
pub const GEOMETRIC_VALUES: [&str; 7] = ["x", "y", "z", "height", "depth", "index", "radius"];

/// Name of the magnitude of the velocity, whatever its attribute is called.
pub const SPEED: &str = "speed";

/// Names of the components of the velocity, whatever its attribute is called.
const VELOCITY_COMPONENTS: [&str; 3] = ["vx", "vy", "vz"];

/// Names of components.
const COMPONENTS: [(&str, usize); 8] =
    [("x", 0), ("y", 1), ("z", 2), ("w", 3), ("r", 0), ("g", 1), ("b", 2), ("a", 3)];

impl ParticleValue {
    /// The value `name` of particles with `attributes`. Names are compared without regard to case; `v.x` and `v[0]` are
    /// the first component of `v`, `v.magnitude` is its length.
    pub fn named<A: Named>(name: &str, attributes: &[A]) -> Option<Self> {
        // The radius that is drawn may be another one than that of the file
        if name.eq_ignore_ascii_case(names::RADIUS) {
            return Some(Self::Radius);
        }
        let find = |name: &str| attributes.iter().find(|a| a.name().eq_ignore_ascii_case(name));
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
        Self::geometric(name).or_else(|| Self::of_velocity(name, attributes))
    }

    /// The speed or a component of the velocity, if `name` is one.
    fn of_velocity<A: Named>(name: &str, attributes: &[A]) -> Option<Self> {
        let velocity = velocity_of(attributes)?.name().to_owned();
        let name = name.to_ascii_lowercase();
        if name == SPEED {
            return Some(Self::Magnitude(velocity));
        }
        let axis = VELOCITY_COMPONENTS.iter().position(|known| *known == name);
        axis.map(|axis| Self::Component(velocity, axis))
    }

    /// The value that needs no attribute with this name.
    pub fn geometric(name: &str) -> Option<Self> {
        match name.to_ascii_lowercase().as_str() {
            "x" => Some(Self::Position(0)),
            "y" => Some(Self::Position(1)),
            "z" => Some(Self::Position(2)),
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
            Self::Position(_) | Self::Height | Self::Depth | Self::Index | Self::Radius => None,
        }
    }

    /// The direction in which positions are measured, if they are.
    pub fn direction(&self, up: DVec3) -> Option<DVec3> {
        match self {
            Self::Position(axis) => Some(DVec3::AXES[*axis]),
            Self::Height => Some(up),
            _ => None,
        }
    }

    /// Whether it is computed from positions or radii.
    pub const fn needs_geometry(&self) -> bool {
        matches!(self, Self::Position(_) | Self::Height | Self::Depth | Self::Radius)
    }
}

/// The name of a value in pictures and messages: the magnitude of a velocity is called speed.
pub fn shown_name(name: &str) -> &str {
    let is_velocity = names::VELOCITY.iter().any(|v| name.eq_ignore_ascii_case(v));
    if is_velocity { SPEED } else { name }
}

enum Part {
    Magnitude,
    Component(usize),
}

/// Splits `v.x`, `v[0]` or `v.magnitude`.
fn split(name: &str) -> Option<(&str, Part)> {
    if let Some((base, index)) = name.strip_suffix(']').and_then(|rest| rest.rsplit_once('[')) {
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
        let all = [attribute("Velocity", 3), attribute("index", 1), attribute("a.x", 1)];
        let component = |c| ParticleValue::Component("Velocity".to_owned(), c);
        for (name, expected) in [
            ("velocity", Some(ParticleValue::Magnitude("Velocity".to_owned()))),
            ("velocity.magnitude", Some(ParticleValue::Magnitude("Velocity".to_owned()))),
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
            ("speed", Some(ParticleValue::Magnitude("Velocity".to_owned()))),
            ("vy", Some(component(1))),
            ("Z", Some(ParticleValue::Position(2))),
            ("w", None),
            ("", None),
        ] {
            assert_eq!(ParticleValue::named(name, &all), expected, "{name}");
        }
        // Attributes have precedence, and there is no speed without a velocity
        let own = [attribute("x", 1), attribute("vx", 1)];
        for name in ["x", "vx"] {
            let expected = ParticleValue::Magnitude(name.to_owned());
            assert_eq!(ParticleValue::named(name, &own), Some(expected));
        }
        assert_eq!(ParticleValue::named("speed", &own), None);
    }

    #[test]
    fn velocities_are_shown_as_speed() {
        for (name, shown) in [("Vel", "speed"), ("density", "density"), ("speed", "speed")] {
            assert_eq!(shown_name(name), shown);
        }
    }
}
