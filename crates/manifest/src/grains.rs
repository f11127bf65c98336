//! Shapes, sizes and orientations of grains, for a style with `draw = "grains"`.

use serde_json::{Value as Json, json};
use spherule_frame::grain_columns::{AngleUnit, OrientationKind, QuaternionOrder};

use super::field::Field;
use super::inline_table::{InlineTable, inline_table};
use super::key::Key;
use super::keys::{Keys, keys};
use super::value::{Fault, FlagKind, Value, list, named, numbers_schema};

named! {
    /// Shapes of grains.
    GrainKind {
        /// Ellipsoids.
        Ellipsoid = "ellipsoid",
        /// Superquadrics.
        Superquadric = "superquadric",
        /// Capsules along z.
        Capsule = "capsule",
        /// Cylinders along z.
        Cylinder = "cylinder",
        /// Cuboids.
        Cuboid = "cuboid",
        /// A closed mesh.
        Mesh = "mesh",
        /// The convex hull of the vertices of a mesh.
        ConvexHull = "convex-hull",
    }
}

/// Numbers for all grains, or the columns that have those of each.
#[derive(Debug, Clone, PartialEq)]
pub enum GrainNumbers<const N: usize> {
    /// The same for all grains.
    Numbers([f64; N]),
    /// Names of columns.
    Names(Vec<String>),
}

impl<const N: usize> Value for GrainNumbers<N> {
    const FLAG: FlagKind = FlagKind::Toml;

    fn kind(key: &Key) -> String {
        format!("{N} numbers above 0, or names of columns, such as {}", key.example)
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        if let Some(numbers) = field.as_numbers::<N>() {
            let is_usable = |v: &f64| *v > 0.0 && *v <= f64::from(f32::MAX);
            let all = Some(numbers).filter(|numbers| numbers.iter().all(is_usable));
            return all.map(Self::Numbers).ok_or(Fault::Unwanted);
        }
        if field.as_text().is_some() {
            return String::parse(field, key).map(|name| Self::Names(vec![name]));
        }
        let items = field.items().ok_or(Fault::Unwanted)?;
        if items.iter().any(|item| item.as_text().is_none()) {
            return Err(Fault::Unwanted);
        }
        Vec::parse(field, key).map(Self::Names)
    }

    fn toml(&self) -> String {
        match self {
            Self::Numbers(numbers) => list(numbers.iter().map(|number| format!("{number:?}"))),
            Self::Names(names) => names.toml(),
        }
    }

    fn schema(key: &Key) -> Json {
        json!({ "anyOf": [numbers_schema(N), String::schema(key), Vec::<String>::schema(key)] })
    }
}

/// The columns with the orientations of grains: one of these.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GrainOrientation {
    /// Quaternions w, x, y, z.
    pub quaternion: Option<Vec<String>>,
    /// Quaternions x, y, z, w.
    pub quaternion_xyzw: Option<Vec<String>>,
    /// Euler angles about z, x and z, degrees.
    pub euler: Option<Vec<String>>,
    /// The same in radians.
    pub euler_radians: Option<Vec<String>>,
}

impl InlineTable for GrainOrientation {
    const EXAMPLE: &str = "{ quaternion = [\"qw\", \"qx\", \"qy\", \"qz\"] }";

    fn keys(&mut self, keys: &mut Keys<'_>) {
        keys!(keys:
            /// Columns of quaternions: w, x, y, z
            quaternion => self.quaternion, example("[\"qw\", \"qx\", \"qy\", \"qz\"]");
            /// Columns of quaternions: x, y, z, w
            quaternion_xyzw => self.quaternion_xyzw, example("[\"qx\", \"qy\", \"qz\", \"qw\"]");
            /// Columns of Euler angles about z, the new x and the new z, degrees
            euler => self.euler, example("[\"alpha\", \"beta\", \"gamma\"]");
            /// The same in radians
            euler_radians => self.euler_radians, example("[\"alpha\", \"beta\", \"gamma\"]");
        );
    }
}
inline_table!(GrainOrientation);

impl GrainOrientation {
    /// The columns, and what their numbers are.
    pub(super) fn named(&self) -> Option<(Vec<String>, OrientationKind)> {
        let quaternion = OrientationKind::Quaternion;
        let all = [
            (&self.quaternion, quaternion(QuaternionOrder::Wxyz)),
            (&self.quaternion_xyzw, quaternion(QuaternionOrder::Xyzw)),
            (&self.euler, OrientationKind::Euler(AngleUnit::Degrees)),
            (&self.euler_radians, OrientationKind::Euler(AngleUnit::Radians)),
        ];
        all.into_iter().find_map(|(names, kind)| Some((names.clone()?, kind)))
    }
}
