//! Orientations and sizes of particles that are not spheres, among the columns of a frame.
//!
//! Programs write them under different names and with different conventions. [`GrainColumns::find`] knows these, without
//! options:
//!
//! | program | orientation | size | exponents |
//! |---|---|---|---|
//! | GSD, HOOMD-blue | `orientation`: w x y z | | |
//! | OVITO | `Orientation` or `Orientation.X` to `.W`: x y z w | `AsphericalShape`: semi-axes | |
//! | LAMMPS | `quatw quati quatj quatk`; `c_q[1]` or `c_quat[1]` to `[4]`: w x y z | `shapex shapey shapez`, `c_shape[1]` to `[3]`: diameters | `block1 block2` |
//! | LIGGGHTS | `quat1` to `quat4`: w x y z | `shapex shapey shapez`: semi-axes | `blockiness1 blockiness2` |
//! | MercuryDPM | `orientationTensor`: a rotation matrix, row by row | `axesScales`: diameters | `phiAndTheta` |
//! | Houdini | `orient`: x y z w | | |
//! | USD | `orientations`: w x y z, as they are read | | |
//!
//! `shapex shapey shapez` are semi-axes next to columns of LIGGGHTS, else diameters. The case of `orientation` matters
//! for a vector of four numbers, since it is the only difference between GSD and OVITO; other names are compared without
//! regard to case. A vector and its numbered components are the same: `c_q[1]` is a column or a component. Columns of
//! other names, or of one of these names with another meaning, are named explicitly ([`GrainColumns::named`]).
//! [`AngularVelocities`] has the columns that say how particles turn.

mod angular_velocity;
mod convention;
mod error;
mod rotation;
mod source;

#[cfg(test)]
mod tests;

use rayon::prelude::*;

use crate::Attribute;
pub use angular_velocity::AngularVelocities;
pub(crate) use convention::is_size;
use convention::{ExponentKind, Found};
pub use error::GrainColumnError;
use rotation::{from_euler, from_matrix};
use source::Sources;

/// Order of the four numbers of a quaternion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum QuaternionOrder {
    /// The real part first: w, x, y, z.
    Wxyz,
    /// The real part last: x, y, z, w.
    Xyzw,
}

/// Unit of angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum AngleUnit {
    /// 360 are a full turn.
    Degrees,
    /// 2 pi are a full turn.
    Radians,
}

/// What the numbers of a size are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SizeKind {
    /// Half the size along each axis of the particle.
    SemiAxes,
    /// The whole size along each axis of the particle.
    Diameters,
}

impl SizeKind {
    /// The factor that makes semi-axes of the numbers.
    const fn factor(self) -> f64 {
        match self {
            Self::SemiAxes => 1.0,
            Self::Diameters => 0.5,
        }
    }
}

/// How the numbers of an orientation are read. All rotate from the axes of the particle to those of the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum OrientationKind {
    /// Four numbers of a quaternion.
    Quaternion(QuaternionOrder),
    /// Three Euler angles, about the z axis, the rotated x axis and the rotated z axis.
    Euler(AngleUnit),
    /// Nine numbers of a rotation matrix, row by row.
    Matrix,
}

impl OrientationKind {
    /// How many numbers it has.
    pub const fn components(self) -> usize {
        match self {
            Self::Quaternion(_) => 4,
            Self::Euler(_) => 3,
            Self::Matrix => 9,
        }
    }
}

/// Columns that a user names. What is None is found by the names of programs.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct GrainNames {
    /// Names of columns, or of their components (`q.x`, `q[0]`), which together have the numbers of an orientation.
    pub orientation: Option<(Vec<String>, OrientationKind)>,
    /// Names with three numbers, or with one for particles of equal semi-axes.
    pub sizes: Option<(Vec<String>, SizeKind)>,
    /// Names with the exponents n1 and n2 of superquadrics: along z and in the cross section.
    pub exponents: Option<Vec<String>>,
    /// Names with three numbers of an angular velocity, radians per unit of time about the axes of the scene. Only
    /// [`AngularVelocities::named`] reads them.
    pub angular_velocity: Option<Vec<String>>,
}

/// Orientations and sizes of the particles of a frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GrainColumns {
    /// Quaternions x, y, z, w as in the file, which may be not normalised. NaN where the file has no rotation. Empty
    /// without columns.
    pub orientations: Vec<[f32; 4]>,
    /// Semi-axes, in units of the file. Empty without columns.
    pub sizes: Vec<[f32; 3]>,
    /// Exponents n1 and n2 of superquadrics `(|x/a|^n2 + |y/b|^n2)^(n1/n2) + |z/c|^n1 = 1`.
    pub exponents: Option<Vec<[f32; 2]>>,
    /// The names of the columns, in the order of the numbers: orientations, sizes, exponents.
    pub used: Vec<String>,
}

/// Columns of particles that are not spheres.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherShapes {
    /// Their names.
    pub used: Vec<String>,
    /// The median of the mean semi-axes, in units of the file.
    pub radius: f64,
}

impl GrainColumns {
    /// Orientations and sizes of `attributes` whose names are those of a program; None if there are neither.
    pub fn find(attributes: &[Attribute]) -> Option<Self> {
        let found = Found::among(attributes);
        let is_grain = found.orientation.is_some() || found.sizes.is_some();
        is_grain.then(|| Self::read(attributes, &found))
    }

    /// Orientations and sizes in the columns with these names; those without a name as by [`Self::find`].
    ///
    /// # Errors
    /// There is no such column, or the columns have another number of components.
    pub fn named(attributes: &[Attribute], names: &GrainNames) -> Result<Self, GrainColumnError> {
        let mut found = Found::among(attributes);
        if let Some((columns, kind)) = &names.orientation {
            let sources =
                Sources::named(attributes, columns, "an orientation", &[kind.components()])?;
            found.orientation = Some((sources, *kind));
        }
        if let Some((columns, kind)) = &names.sizes {
            let sources = Sources::named(attributes, columns, "a size", &[3, 1])?;
            found.sizes = Some((sources, *kind));
        }
        if let Some(columns) = &names.exponents {
            let sources = Sources::named(attributes, columns, "exponents", &[2])?;
            found.exponents = Some((sources, ExponentKind::Exponents));
        }
        Ok(Self::read(attributes, &found))
    }

    /// The columns of particles that are not spheres: there are orientations and sizes, all sizes of the particles in
    /// `sample` are above 0, and one of them differs from a sphere. None otherwise.
    pub fn of_other_shapes(
        attributes: &[Attribute],
        sample: impl Iterator<Item = usize>,
    ) -> Option<OtherShapes> {
        let Found { orientation, sizes, exponents } = Found::among(attributes);
        let ((orientation, _), (sizes, kind)) = orientation.zip(sizes)?;
        // Look for an axis that differs, or for exponents that are not those of an ellipsoid
        let (mut is_other, mut radii) = (false, Vec::new());
        let mut numbers = [0.0; source::MAX_NUMBERS];
        for index in sample {
            let size = sizes.read(attributes, index, &mut numbers);
            if !size.iter().all(|axis| *axis > 0.0 && *axis < f64::INFINITY) {
                return None;
            }
            is_other |= size.iter().any(|axis| *axis != size[0]);
            radii.push(kind.factor() * size.iter().sum::<f64>() / size.len() as f64);
            if let Some((exponents, kind)) = &exponents {
                let round = if *kind == ExponentKind::Mercury { 1.0 } else { 2.0 };
                let own = exponents.read(attributes, index, &mut numbers);
                is_other |= own.iter().any(|exponent| *exponent != round);
            }
        }
        let exponents = exponents.as_ref().map(|(sources, _)| sources);
        let used = [&orientation, &sizes].into_iter().chain(exponents);
        let used = used.flat_map(|sources| sources.names(attributes)).collect();
        radii.sort_by(f64::total_cmp);
        is_other.then(|| OtherShapes { used, radius: radii[radii.len() / 2] })
    }

    /// Reads the columns that were found.
    fn read(attributes: &[Attribute], found: &Found) -> Self {
        let mut columns = Self::default();
        if let Some((sources, kind)) = &found.orientation {
            columns.used.extend(sources.names(attributes));
            columns.orientations = sources.map(attributes, |numbers| orientation(numbers, *kind));
        }
        if let Some((sources, kind)) = &found.sizes {
            columns.used.extend(sources.names(attributes));
            columns.sizes = sources.map(attributes, |numbers| {
                [0, 1, 2].map(|axis| narrow(kind.factor() * numbers[axis.min(sources.len() - 1)]))
            });
        }
        if let Some((sources, kind)) = &found.exponents {
            columns.used.extend(sources.names(attributes));
            columns.exponents = Some(sources.map(attributes, |numbers| match kind {
                ExponentKind::Exponents => [narrow(numbers[0]), narrow(numbers[1])],
                // The equation of MercuryDPM has 2 / eps as exponents, and the file eps2 before eps1
                ExponentKind::Mercury => [narrow(2.0 / numbers[1]), narrow(2.0 / numbers[0])],
            }));
        }
        columns
    }
}

/// A quaternion x, y, z, w.
fn orientation(numbers: &[f64], kind: OrientationKind) -> [f32; 4] {
    let quaternion = match (kind, numbers) {
        (OrientationKind::Quaternion(QuaternionOrder::Wxyz), &[w, x, y, z, ..]) => [x, y, z, w],
        (OrientationKind::Quaternion(QuaternionOrder::Xyzw), &[x, y, z, w, ..]) => [x, y, z, w],
        (OrientationKind::Euler(unit), &[a, b, c, ..]) => from_euler([a, b, c], unit),
        (OrientationKind::Matrix, numbers) => from_matrix(numbers),
        _ => [f64::NAN; 4],
    };
    quaternion.map(narrow)
}

/// `value` in single precision.
#[expect(clippy::cast_possible_truncation, reason = "rounds")]
const fn narrow(value: f64) -> f32 {
    value as f32
}

impl Sources {
    /// A value for each particle, of its numbers.
    fn map<T: Send>(&self, attributes: &[Attribute], of: impl Fn(&[f64]) -> T + Sync) -> Vec<T> {
        let count = self.count(attributes);
        let value = |index| {
            let mut numbers = [0.0; source::MAX_NUMBERS];
            of(self.read(attributes, index, &mut numbers))
        };
        (0..count).into_par_iter().with_min_len(4096).map(value).collect()
    }
}
