//! `[[clip]]`: planes and boxes that leave out particles, or cut their spheres.

use glam::DVec3;
use serde_json::{Value as Json, json};
use spherule_selection::Region;

use super::field::Field;
use super::input::UpAxis;
use super::key::Key;
use super::keys::{Keys, keys};
use super::value::{Fault, Named, Value, named};

pub(super) const ABOUT: &[&str] = &[
    "Planes and boxes that leave out the particles on one side; particles are left out if any of them leaves them out",
];

/// The key `type`.
#[derive(Clone, Copy, PartialEq)]
enum ClipType {
    Plane,
    Box,
}

named!(ClipType: Plane = "plane", Box = "box");

named! {
    /// The side of a box that is kept.
    KeptSide {
        /// Particles in the box.
        Inside = "inside",
        /// Particles outside of it.
        Outside = "outside",
    }
}

named! {
    /// What a clip does with the spheres at its border.
    ClipMode {
        /// Draws those with their centres on the kept side whole, and no others.
        Particles = "particles",
        /// Cuts them open.
        Cut = "cut",
    }
}

/// The normal of a plane: an axis, or a vector of any length that is not zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlaneNormal {
    /// A direction along an axis.
    Axis(UpAxis),
    /// Any direction.
    Vector(DVec3),
}

/// What a clip keeps.
#[derive(Debug, Clone, PartialEq)]
pub enum ClipKind {
    /// The side of a plane that its normal points away from.
    Plane {
        /// Its normal.
        normal: PlaneNormal,
        /// A point; the plane is `offset` from it along the normal.
        point: DVec3,
        /// Distance of the plane from the point.
        offset: f64,
    },
    /// The inside or the outside of a box.
    Box {
        /// A corner.
        min: DVec3,
        /// The opposite corner.
        max: DVec3,
        /// The side.
        keep: KeptSide,
    },
}

/// One `[[clip]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Clip {
    /// What it keeps.
    pub kind: ClipKind,
    /// What it does with spheres at its border.
    pub mode: ClipMode,
}

impl Default for Clip {
    fn default() -> Self {
        Self { kind: ClipKind::of(ClipType::Plane), mode: ClipMode::Particles }
    }
}

impl PlaneNormal {
    /// A vector of length 1.
    pub fn unit(&self) -> DVec3 {
        match self {
            Self::Axis(axis) => DVec3::from_array(axis.vector()),
            // Scaled first, so that the square of its length is in range
            Self::Vector(vector) => (*vector / vector.abs().max_element()).normalize_or(DVec3::Z),
        }
    }
}

impl ClipKind {
    const fn of(kind: ClipType) -> Self {
        match kind {
            ClipType::Plane => Self::Plane {
                normal: PlaneNormal::Axis(UpAxis::X),
                point: DVec3::ZERO,
                offset: 0.0,
            },
            ClipType::Box => {
                Self::Box { min: DVec3::ZERO, max: DVec3::ONE, keep: KeptSide::Inside }
            }
        }
    }

    const fn clip_type(&self) -> ClipType {
        match self {
            Self::Plane { .. } => ClipType::Plane,
            Self::Box { .. } => ClipType::Box,
        }
    }

    /// The region that is kept.
    pub fn region(&self) -> Region {
        match *self {
            Self::Plane { normal, point, offset } => {
                let normal = normal.unit();
                Region::HalfSpace { point: point + offset * normal, normal }
            }
            Self::Box { min, max, keep } => {
                let (min, max) = (min.min(max), min.max(max));
                match keep {
                    KeptSide::Inside => Region::Box { min, max },
                    KeptSide::Outside => Region::OutsideBox { min, max },
                }
            }
        }
    }
}

impl Clip {
    /// One clip of each type.
    pub(super) fn examples() -> Vec<Self> {
        let of_type = |(kind, _)| Self { kind: ClipKind::of(kind), ..Self::default() };
        ClipType::names().into_iter().map(of_type).collect()
    }

    pub(super) fn keys(&mut self, keys: &mut Keys<'_>) {
        let mut kind = self.kind.clip_type();
        let key = Key::new("type", &["plane | box"]);
        keys.key(key.required("\"plane\" or \"box\""), &mut kind);
        if let Some(section) = keys.reading() {
            // The type determines which keys are known, so the rest is not checked.
            if !section.has("type") {
                section.close();
                return;
            }
            self.kind = ClipKind::of(kind);
        }
        let mode = &mut self.mode;
        match &mut self.kind {
            ClipKind::Plane { normal, point, offset } => keys!(keys:
                /// Side of the plane that is left out: x, y, z, -x, -y, -z, or a vector towards it
                normal => *normal, required("the direction of the side that is left out, such as \"x\"");
                /// A point on the plane, if the offset is 0
                point => *point;
                /// Distance of the plane from the point, along the normal
                offset => *offset;
                /// Whole particles by their centres, or spheres cut open: particles | cut
                mode => *mode;
            ),
            ClipKind::Box { min, max, keep } => {
                keys!(keys:
                    /// A corner
                    min => *min, required("a box needs a corner, such as [0.0, 0.0, 0.0]");
                    /// The opposite corner
                    max => *max, required("a box needs two opposite corners, such as [1.0, 1.0, 1.0]");
                    /// Side that is kept: inside | outside
                    keep => *keep;
                    /// Whole particles by their centres, or spheres cut open: particles | cut
                    mode => *mode;
                );
            }
        }
    }
}

/// The rules of a vector.
fn direction() -> Key {
    Key::new("normal", &[]).direction()
}

impl Value for PlaneNormal {
    fn kind(_: &Key) -> String {
        "an axis or a vector, such as \"-x\" or [1.0, 1.0, 0.0]".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        if let Some(text) = field.as_text() {
            let mut axes = UpAxis::names().into_iter().filter(|(_, name)| *name == text);
            return axes.next().map(|(axis, _)| Self::Axis(axis)).ok_or(Fault::Unwanted);
        }
        let vector = DVec3::parse(field, &direction())?;
        Ok(Self::Vector(vector))
    }

    fn toml(&self) -> String {
        match self {
            Self::Axis(axis) => axis.toml(),
            Self::Vector(vector) => vector.toml(),
        }
    }

    fn schema(_: &Key) -> Json {
        let names: Vec<&str> = UpAxis::names().iter().map(|(_, name)| *name).collect();
        json!({ "anyOf": [{ "enum": names }, DVec3::schema(&direction())] })
    }
}
