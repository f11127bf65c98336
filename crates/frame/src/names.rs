//! The names of particle properties in files: one table for readers, conversion and rendering.
//!
//! The preferred name comes first. Names are compared without regard to case, see [`is_one_of`]. Formats have
//! different lists for the same property where their conventions differ: `r` is a position among numpy arrays
//! and a colour among columns. A property without a list, such as density or mass, has no meaning to the
//! program and keeps its name in the file.

/// Names of a per-particle id. `ids` is common in numpy files, `Idp` and `Idpd` come from DualSPHysics, `ParticleIDs` from the
/// GADGET family.
pub const ID: [&str; 5] = ["id", "ids", "Idp", "Idpd", "ParticleIDs"];

/// Names of a velocity with three components.
pub const VELOCITY: [&str; 6] = ["velocity", "velocities", "vel", "velo", "v", "U"];

/// The name of radii that differ in native frames.
pub const RADIUS: &str = "radius";

/// Names of a radius or diameter, with the factor that converts it to a radius. `pscale` is Houdini's name.
pub const RADII: [(&str, f64); 3] = [(RADIUS, 1.0), ("pscale", 1.0), ("diameter", 0.5)];

/// Names of a colour with three or four components.
pub const COLOR: [&str; 9] =
    ["color", "colors", "colour", "colours", "rgb", "rgba", "rgbcolor", "cd", "displaycolor"];

/// Names of a colour whose integers are sRGB codes. `Cd` is missing because it is linear.
pub const COLOR_CODES: [&str; 4] = ["color", "colors", "rgb", "rgba"];

/// Names of numpy arrays and fields that hold positions.
pub const POSITION_ARRAYS: [&str; 9] =
    ["positions", "position", "pos", "points", "coordinates", "coords", "coord", "xyz", "r"];

/// Names of position columns without the component: `pos` for `pos_x`. The empty stem stands for plain `x`, `y`, `z`.
pub const POSITION_STEMS: [&str; 11] = [
    "",
    "pos",
    "points",
    "position",
    "positions",
    "point",
    "coords",
    "coord",
    "coordinates",
    "coordinate",
    "p",
];

/// Units of length at the end of names.
const LENGTHS: [&str; 12] =
    ["m", "cm", "mm", "um", "nm", "km", "ang", "angstrom", "au", "pc", "kpc", "mpc"];

/// A name without the unit of length that follows `_`, as in `pos_x_mm`.
pub fn without_unit(name: &str) -> &str {
    let is_unit = |unit: &str| LENGTHS.iter().any(|known| known.eq_ignore_ascii_case(unit));
    let unit = name.rsplit_once('_').filter(|(stem, unit)| !stem.is_empty() && is_unit(unit));
    unit.map_or(name, |(stem, _)| stem)
}

/// Names of positions among the `Properties` of extended XYZ.
pub const POSITION_PROPERTIES: [&str; 4] = ["pos", "position", "positions", "coordinates"];

/// The column with the names of chains, which are letters in most files.
pub const CHAIN: &str = "chain";
/// The column with the names of segments, by which CHARMM divides a system.
pub const SEGMENT: &str = "segment";
/// The column with the names of residues: `ALA`, `HOH`.
pub const RESIDUE_NAME: &str = "residue_name";
/// The column with the names of atoms in their residues: `CA`, `OW`.
pub const ATOM_NAME: &str = "atom_name";

/// Columns of molecular files with text. Readers give them as numbers ([`label_code`](crate::label_code)) with labels.
pub const TEXTS: [&str; 4] = [CHAIN, SEGMENT, RESIDUE_NAME, ATOM_NAME];

/// Names of elements or species among the `Properties` of extended XYZ.
pub const SPECIES_PROPERTIES: [&str; 3] = ["species", "element", "symbol"];

/// LAMMPS columns that hold names, even if all values look like numbers.
pub const LAMMPS_CATEGORIES: [&str; 2] = ["element", "typelabel"];

/// LAMMPS columns of integers that must stay exact.
pub const LAMMPS_INTEGERS: [&str; 3] = ["id", "type", "mol"];

/// LAMMPS columns that form a vector together, with the name of the vector.
pub const LAMMPS_VECTORS: [([&str; 3], &str); 4] = [
    (["vx", "vy", "vz"], "velocity"),
    (["fx", "fy", "fz"], "force"),
    (["omegax", "omegay", "omegaz"], "omega"),
    (["tqx", "tqy", "tqz"], "torque"),
];

/// Stems that are joined to a component without a separator, as in `vx` and `PosX`. The second entry is the
/// name of the vector, if it differs from the stem.
pub const JOINED_STEMS: [(&str, Option<&str>); 12] = [
    ("v", Some("velocity")),
    ("f", Some("force")),
    ("a", Some("acceleration")),
    ("n", Some("normal")),
    ("p", None),
    ("pos", None),
    ("position", None),
    ("coord", None),
    ("vel", None),
    ("velocity", None),
    ("acc", None),
    ("force", None),
];

/// Table columns that form a colour together.
pub const COLOR_COLUMNS: [[&str; 3]; 2] = [["red", "green", "blue"], ["r", "g", "b"]];

/// Scalars of binary records that form a vector together, with its name. The first complete entry is used.
pub const RECORD_VECTORS: [(&str, &[&str]); 7] = [
    ("velocity", &["vx", "vy", "vz"]),
    ("normal", &["nx", "ny", "nz"]),
    ("normal", &["normal_x", "normal_y", "normal_z"]),
    ("color", &["red", "green", "blue", "alpha"]),
    ("color", &["red", "green", "blue"]),
    ("color", &["diffuse_red", "diffuse_green", "diffuse_blue"]),
    ("color", &["r", "g", "b"]),
];

/// True if `name` is one of `names`, without regard to case.
pub fn is_one_of(name: &str, names: &[&str]) -> bool {
    names.iter().any(|known| known.eq_ignore_ascii_case(name))
}

/// True if `name` is a name of a radius or diameter.
pub fn is_radius_name(name: &str) -> bool {
    RADII.iter().any(|(known, _)| known.eq_ignore_ascii_case(name))
}
