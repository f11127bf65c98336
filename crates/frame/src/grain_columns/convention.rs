//! Names and conventions of programs.

use super::source::Sources;
use super::{OrientationKind, QuaternionOrder, SizeKind};
use crate::Attribute;

/// What numbers for exponents are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ExponentKind {
    /// n1 and n2.
    Exponents,
    /// eps2 and eps1 of MercuryDPM.
    Mercury,
}

/// The columns of a frame, where there are any.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Found {
    pub(super) orientation: Option<(Sources, OrientationKind)>,
    pub(super) sizes: Option<(Sources, SizeKind)>,
    pub(super) exponents: Option<(Sources, ExponentKind)>,
}

const WXYZ: OrientationKind = OrientationKind::Quaternion(QuaternionOrder::Wxyz);
const XYZW: OrientationKind = OrientationKind::Quaternion(QuaternionOrder::Xyzw);

/// Vectors with an orientation, by names whose case matters.
const ORIENTATION_VECTORS: [(&str, OrientationKind); 5] = [
    // The schema `hoomd` of GSD
    ("orientation", WXYZ),
    // A standard property of OVITO
    ("Orientation", XYZW),
    // Instances of a PointInstancer in USD, whose quaternions are read with the real part first
    ("orientations", WXYZ),
    // A standard attribute of points in Houdini
    ("orient", XYZW),
    // `SuperQuadricParticleVtkWriter` of MercuryDPM
    ("orientationTensor", OrientationKind::Matrix),
];

/// Scalars with a quaternion.
const QUATERNION_SCALARS: [([&str; 4], OrientationKind); 6] = [
    // `compute property/atom` of LAMMPS, as a compute that is called `q` or `quat` in its manual, or by these names
    (["quatw", "quati", "quatj", "quatk"], WXYZ),
    (["c_q[1]", "c_q[2]", "c_q[3]", "c_q[4]"], WXYZ),
    (["c_quat[1]", "c_quat[2]", "c_quat[3]", "c_quat[4]"], WXYZ),
    // `dump custom` of LIGGGHTS
    (["quat1", "quat2", "quat3", "quat4"], WXYZ),
    // Columns that OVITO writes; older versions without the dot
    (["Orientation.X", "Orientation.Y", "Orientation.Z", "Orientation.W"], XYZW),
    (["OrientationX", "OrientationY", "OrientationZ", "OrientationW"], XYZW),
];

/// Vectors with a size.
const SIZE_VECTORS: [(&str, SizeKind); 4] = [
    ("AsphericalShape", SizeKind::SemiAxes),
    ("Aspherical Shape", SizeKind::SemiAxes),
    ("aspherical_shape", SizeKind::SemiAxes),
    // Twice the semi-axes, as a scale for glyphs in ParaView
    ("axesScales", SizeKind::Diameters),
];

/// Whether a vector of this name has sizes along the axes of a particle.
pub(crate) fn is_size(name: &str) -> bool {
    SIZE_VECTORS.iter().any(|(known, _)| known.eq_ignore_ascii_case(name))
}

/// Scalars with a size, except `shapex`, `shapey` and `shapez`.
const SIZE_SCALARS: [([&str; 3], SizeKind); 3] = [
    (["c_shape[1]", "c_shape[2]", "c_shape[3]"], SizeKind::Diameters),
    (["AsphericalShape.X", "AsphericalShape.Y", "AsphericalShape.Z"], SizeKind::SemiAxes),
    (["AsphericalShapeX", "AsphericalShapeY", "AsphericalShapeZ"], SizeKind::SemiAxes),
];

/// Sizes of both LAMMPS and LIGGGHTS.
const SHAPE: [&str; 3] = ["shapex", "shapey", "shapez"];

/// Columns that only LIGGGHTS writes.
const OF_LIGGGHTS: [&str; 2] = ["quat1", "blockiness1"];

/// Scalars with the exponents n1 and n2.
const EXPONENT_SCALARS: [[&str; 2]; 2] = [["blockiness1", "blockiness2"], ["block1", "block2"]];

/// The exponents of MercuryDPM.
const MERCURY_EXPONENTS: &str = "phiAndTheta";

impl Found {
    /// The columns among `attributes` whose names are those of a program.
    pub(super) fn among(attributes: &[Attribute]) -> Self {
        Self {
            orientation: orientation(attributes),
            sizes: sizes(attributes),
            exponents: exponents(attributes),
        }
    }
}

fn orientation(attributes: &[Attribute]) -> Option<(Sources, OrientationKind)> {
    let vector = |(name, kind): &(&str, OrientationKind)| {
        let sources = Sources::vector(attributes, |own| own == *name, kind.components())?;
        Some((sources, *kind))
    };
    let scalars = |(names, kind): &([&str; 4], OrientationKind)| {
        Some((Sources::scalars(attributes, names)?, *kind))
    };
    let mut vectors = ORIENTATION_VECTORS.iter();
    vectors.find_map(vector).or_else(|| QUATERNION_SCALARS.iter().find_map(scalars))
}

fn sizes(attributes: &[Attribute]) -> Option<(Sources, SizeKind)> {
    let vector = |(name, kind): &(&str, SizeKind)| {
        let is_name = |own: &str| own.eq_ignore_ascii_case(name);
        Some((Sources::vector(attributes, is_name, 3)?, *kind))
    };
    let scalars =
        |(names, kind): &([&str; 3], SizeKind)| Some((Sources::scalars(attributes, names)?, *kind));
    let shape = || {
        let is_of_liggghts = |a: &Attribute| crate::names::is_one_of(&a.name, &OF_LIGGGHTS);
        let kind = if attributes.iter().any(is_of_liggghts) {
            SizeKind::SemiAxes
        } else {
            SizeKind::Diameters
        };
        Some((Sources::scalars(attributes, &SHAPE)?, kind))
    };
    let mut vectors = SIZE_VECTORS.iter();
    vectors.find_map(vector).or_else(|| SIZE_SCALARS.iter().find_map(scalars)).or_else(shape)
}

fn exponents(attributes: &[Attribute]) -> Option<(Sources, ExponentKind)> {
    let scalars =
        |names: &[&str; 2]| Some((Sources::scalars(attributes, names)?, ExponentKind::Exponents));
    let mercury = || {
        let is_name = |own: &str| own.eq_ignore_ascii_case(MERCURY_EXPONENTS);
        Some((Sources::vector(attributes, is_name, 2)?, ExponentKind::Mercury))
    };
    EXPONENT_SCALARS.iter().find_map(scalars).or_else(mercury)
}
