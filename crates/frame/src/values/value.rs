//! The table of names.

use super::{Named, PART_NAMES, id_of, velocity_of};
use crate::names;

/// A number for each particle. `C` stands for a column: its name, or its data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Value<C = String> {
    /// The magnitude of a column.
    Magnitude(C),
    /// A component of a column.
    Component(C, usize),
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
    /// Time of the frame.
    Time,
}

/// Names of values that need no column.
const GEOMETRIC: [(&str, Value); 8] = [
    ("x", Value::Position(0)),
    ("y", Value::Position(1)),
    ("z", Value::Position(2)),
    ("radius", Value::Radius),
    ("height", Value::Height),
    ("depth", Value::Depth),
    ("index", Value::Index),
    ("time", Value::Time),
];

/// Those that have precedence over columns with their name: the radius that is drawn may be another one than that of
/// the file, and so may positions.
const FIRST: usize = 4;

/// Name of the id, whatever its column is called. Without ids, it is the index.
const ID: &str = "id";

/// Name of the part, whatever its column is called.
const PART: &str = PART_NAMES[0];

/// Name of the magnitude of the velocity, whatever its column is called.
pub const SPEED: &str = "speed";

/// Names of the components of the velocity, whatever its column is called.
const VELOCITY_COMPONENTS: [&str; 3] = ["vx", "vy", "vz"];

/// Names of components.
const COMPONENTS: [(&str, usize); 8] =
    [("x", 0), ("y", 1), ("z", 2), ("w", 3), ("r", 0), ("g", 1), ("b", 2), ("a", 3)];

impl Value {
    /// The value `name` of particles with `columns`. Names are compared without regard to case; `v.x` and `v[0]` are
    /// the first component of `v`, `v.magnitude` is its length.
    pub fn named<C: Named>(name: &str, columns: &[C]) -> Option<Self> {
        let is_name = |known: &str| name.eq_ignore_ascii_case(known);
        let geometric = |from: &[(&str, Self)]| {
            from.iter().find(|(known, _)| is_name(known)).map(|(_, value)| value.clone())
        };
        let find = |name: &str| columns.iter().find(|c| c.name().eq_ignore_ascii_case(name));
        let column = |column: &C| Self::Magnitude(column.name().to_owned());
        geometric(&GEOMETRIC[..FIRST])
            .or_else(|| id_of(columns).filter(|_| is_name(ID)).map(column))
            .or_else(|| find(name).map(column))
            .or_else(|| Self::component(name, find))
            .or_else(|| geometric(&GEOMETRIC[FIRST..]))
            .or_else(|| is_name(ID).then_some(Self::Index))
            .or_else(|| {
                let mut parts = PART_NAMES.iter().filter(|_| is_name(PART));
                parts.find_map(|part| find(part)).filter(|part| part.components() == 1).map(column)
            })
            .or_else(|| Self::of_velocity(name, columns))
    }

    /// The component or the length of a column.
    fn component<'c, C: Named + 'c>(
        name: &str,
        find: impl Fn(&str) -> Option<&'c C>,
    ) -> Option<Self> {
        let (base, part) = split(name)?;
        let column = find(base)?;
        let name = column.name().to_owned();
        match part {
            Part::Magnitude => Some(Self::Magnitude(name)),
            Part::Component(c) if c < column.components() => Some(Self::Component(name, c)),
            Part::Component(_) => None,
        }
    }

    /// The speed or a component of the velocity, if `name` is one.
    fn of_velocity<C: Named>(name: &str, columns: &[C]) -> Option<Self> {
        let velocity = velocity_of(columns)?.name().to_owned();
        if name.eq_ignore_ascii_case(SPEED) {
            return Some(Self::Magnitude(velocity));
        }
        let mut components = VELOCITY_COMPONENTS.iter();
        let axis = components.position(|known| name.eq_ignore_ascii_case(known));
        axis.map(|axis| Self::Component(velocity, axis))
    }

    /// Name of its column, if it has one.
    pub fn column(&self) -> Option<&str> {
        match self {
            Self::Magnitude(name) | Self::Component(name, _) => Some(name),
            _ => None,
        }
    }

    /// Whether it is computed from positions or radii.
    pub const fn needs_geometry(&self) -> bool {
        matches!(self, Self::Position(_) | Self::Height | Self::Depth | Self::Radius)
    }
}

/// The names of all values of particles with `columns`, each once, sorted without regard to case; those without a
/// column only if `is_known`.
pub fn value_names<C: Named>(columns: &[C], is_known: impl Fn(&Value) -> bool) -> Vec<String> {
    let of_velocity = velocity_of(columns).map(|_| [SPEED].into_iter().chain(VELOCITY_COMPONENTS));
    let geometric = GEOMETRIC.iter().filter(|(_, value)| is_known(value)).map(|(name, _)| *name);
    let part = Value::named(PART, columns).map(|_| PART);
    let others = geometric.chain(of_velocity.into_iter().flatten()).chain([ID]).chain(part);
    let mut all: Vec<String> =
        columns.iter().map(Named::name).chain(others).map(str::to_owned).collect();
    all.sort_by_cached_key(|name| (name.to_ascii_lowercase(), name.clone()));
    all.dedup_by(|a, b| a.eq_ignore_ascii_case(b));
    all
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
    use super::*;
    use crate::{Attribute, AttributeData};

    fn column(name: &str, components: usize) -> Attribute {
        Attribute { name: name.to_owned(), components, data: AttributeData::F32(Vec::new()) }
    }

    fn magnitude(name: &str) -> Option<Value> {
        Some(Value::Magnitude(name.to_owned()))
    }

    #[test]
    fn values_have_names() {
        let all = [column("Velocity", 3), column("index", 1), column("a.x", 1), column("type", 1)];
        let component = |c| Some(Value::Component("Velocity".to_owned(), c));
        for (name, expected) in [
            ("velocity", magnitude("Velocity")),
            ("velocity.magnitude", magnitude("Velocity")),
            ("VELOCITY.Y", component(1)),
            ("velocity[2]", component(2)),
            ("velocity.w", None),
            ("velocity[3]", None),
            ("velocity[x]", None),
            ("velocity.", None),
            ("height", Some(Value::Height)),
            ("depth", Some(Value::Depth)),
            ("Radius", Some(Value::Radius)),
            ("time", Some(Value::Time)),
            // Columns have precedence
            ("index", magnitude("index")),
            ("A.X", magnitude("a.x")),
            ("speed", magnitude("Velocity")),
            ("vy", component(1)),
            ("Z", Some(Value::Position(2))),
            ("part", magnitude("type")),
            ("ID", Some(Value::Index)),
            ("w", None),
            ("", None),
        ] {
            assert_eq!(Value::named(name, &all), expected, "{name}");
        }
    }

    #[test]
    fn positions_have_precedence_over_columns() {
        let own = [column("x", 1), column("vx", 1), column("Idp", 1), column("part", 1)];
        assert_eq!(Value::named("x", &own), Some(Value::Position(0)));
        assert_eq!(Value::named("x[0]", &own), Some(Value::Component("x".to_owned(), 0)));
        for (name, column) in [("vx", "vx"), ("id", "Idp"), ("part", "part")] {
            assert_eq!(Value::named(name, &own), magnitude(column));
        }
        // There is no speed without a velocity
        assert_eq!(Value::named("speed", &own), None);
    }

    #[test]
    fn each_name_is_listed_once() {
        let all = [column("Vel", 3), column("ID", 1), column("mass", 1), column("Radius", 1)];
        let names = value_names(&all, |value| *value != Value::Depth);
        let expected = [
            "height", "ID", "index", "mass", "Radius", "speed", "time", "Vel", "vx", "vy", "vz",
            "x", "y", "z",
        ];
        assert_eq!(names, expected);
        assert!(names.iter().all(|name| Value::named(name, &all).is_some()));
    }

    #[test]
    fn velocities_are_shown_as_speed() {
        for (name, shown) in [("Vel", "speed"), ("density", "density"), ("speed", "speed")] {
            assert_eq!(shown_name(name), shown);
        }
    }
}
