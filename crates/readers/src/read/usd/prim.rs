//! Prims and those of their properties that particles need, without their values.

use std::ops::Range;

/// Most levels of prims in one another.
pub(super) const MAX_LEVELS: usize = 256;

/// The prims of a file.
#[derive(Debug)]
pub(super) struct PrimTree {
    /// The first one is the root of all others.
    pub(super) prims: Vec<Prim>,
    pub(super) properties: Vec<Property>,
    pub(super) metadata: Metadata,
}

/// What the layer says about itself.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Metadata {
    pub(super) is_z_up: bool,
    /// Metres of a length unit, if the file says so.
    pub(super) meters_per_unit: Option<f64>,
    /// Time codes of a second.
    pub(super) time_codes_per_second: Option<f64>,
    pub(super) frames_per_second: Option<f64>,
}

impl Metadata {
    /// Time codes of a second, with the default of USD.
    pub(super) fn rate(&self) -> f64 {
        let rate = self.time_codes_per_second.or(self.frames_per_second);
        rate.filter(|rate| rate.is_finite() && *rate > 0.0).unwrap_or(24.0)
    }
}

/// A name: a range of the text of the file, or of its tokens.
pub(super) type Name = Range<usize>;

/// A node of the scene.
#[derive(Debug, Clone)]
pub(super) struct Prim {
    pub(super) name: Name,
    /// Index of the prim that it is in; none for the root, and for prims in a variant.
    pub(super) parent: Option<usize>,
    pub(super) kind: PrimKind,
    /// Whether the prim is only an opinion about another one, a class, or inactive.
    pub(super) is_dormant: bool,
    /// Whether other files, variants or prims add to it.
    pub(super) has_arcs: bool,
    /// Its properties in [`PrimTree::properties`].
    pub(super) properties: Range<usize>,
}

/// Types of prims.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PrimKind {
    Points,
    Instancer,
    Other,
}

impl PrimKind {
    pub(super) fn of(type_name: &[u8]) -> Self {
        match type_name {
            b"Points" => Self::Points,
            b"PointInstancer" => Self::Instancer,
            _ => Self::Other,
        }
    }
}

/// An attribute of a prim.
#[derive(Debug, Clone)]
pub(super) struct Property {
    pub(super) name: Name,
    /// Its value at no time.
    pub(super) default: Option<Value>,
    pub(super) samples: Option<Samples>,
    /// Whether it is a curve over time.
    pub(super) has_spline: bool,
}

/// Where a value is in the file.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Binary(ValueRep),
    Text(TextValue),
}

/// Where a value of a binary file is: type, flags, and 48 bits for a place or a small value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ValueRep(pub(super) u64);

/// A value of a text file: the name of its type, and its text.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TextValue {
    pub(super) type_name: Range<usize>,
    pub(super) range: Range<usize>,
}

/// Values at times.
#[derive(Debug, Clone)]
pub(super) enum Samples {
    /// Bytes of the times and of the values: 8 for each.
    Binary { times: Range<usize>, values: Range<usize> },
    /// Sorted by time.
    Text(Vec<(f64, TextValue)>),
}

/// Whether a property called `name` may be needed.
pub(super) fn is_needed(name: &[u8]) -> bool {
    const NAMES: [&[u8]; 10] = [
        b"points",
        b"positions",
        b"widths",
        b"velocities",
        b"accelerations",
        b"ids",
        b"protoIndices",
        b"scales",
        b"visibility",
        b"xformOpOrder",
    ];
    NAMES.contains(&name) || name.starts_with(b"xformOp:") || name.starts_with(b"primvars:")
}

/// Sorts properties, which have the index of their prim, by prim and name, and tells the prims which are theirs. `text`
/// has the names. A property that is there several times, as in text files, becomes one.
pub(super) fn of_prims(
    mut found: Vec<(usize, Property)>,
    prims: &mut [Prim],
    text: &[u8],
) -> Vec<Property> {
    let name = |property: &Property| text.get(property.name.clone()).unwrap_or_default();
    found.sort_by(|(a, one), (b, other)| a.cmp(b).then_with(|| name(one).cmp(name(other))));
    found.dedup_by(|(prim, later), (first_prim, first)| {
        let is_same = prim == first_prim && name(later) == name(first);
        if is_same {
            first.default = later.default.take().or(first.default.take());
            first.samples = later.samples.take().or(first.samples.take());
            first.has_spline |= later.has_spline;
        }
        is_same
    });
    for (index, (prim, _)) in found.iter().enumerate() {
        let Some(prim) = prims.get_mut(*prim) else {
            continue;
        };
        if prim.properties.is_empty() {
            prim.properties.start = index;
        }
        prim.properties.end = index + 1;
    }
    found.into_iter().map(|(_, property)| property).collect()
}
