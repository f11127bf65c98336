//! Angular velocities of particles, radians per unit of time about the axes of the scene.
//!
//! Programs write them as vectors or components, which [`AngularVelocities::find`] knows by their names. HOOMD-blue
//! writes angular momenta instead: the quaternion `P = 2 q S` with the orientation `q` and the angular momentum `S` about
//! the axes of the particle (Kamberaj, Li and Hansen, "Time reversible and symplectic integrators for molecular dynamics
//! simulations of rigid molecules", 2005), and the principal moments of inertia. A moment of zero means that the particle
//! does not turn about that axis.

use glam::{DQuat, DVec3};

use super::source::Sources;
use super::{GrainColumnError, narrow};
use crate::Attribute;

/// Angular velocities of the particles of a frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AngularVelocities {
    /// One per particle, as in the file: they may be not finite.
    pub values: Vec<[f32; 3]>,
    /// The names of the columns.
    pub used: Vec<String>,
}

/// Vectors of angular velocities, in any case.
const VECTORS: [&str; 4] = [
    // `omegax omegay omegaz` of LAMMPS and LIGGGHTS
    "omega",
    // A standard property of OVITO
    "Angular Velocity",
    "AngularVelocity",
    "angular_velocity",
];

/// Components of angular velocities.
const SCALARS: [[&str; 3]; 3] = [
    ["omegax", "omegay", "omegaz"],
    ["Angular Velocity.X", "Angular Velocity.Y", "Angular Velocity.Z"],
    ["AngularVelocity.X", "AngularVelocity.Y", "AngularVelocity.Z"],
];

impl AngularVelocities {
    /// The columns of `attributes` whose names are those of a program; None without any.
    pub fn find(attributes: &[Attribute]) -> Option<Self> {
        let vector =
            |name: &&str| Sources::vector(attributes, |own| own.eq_ignore_ascii_case(name), 3);
        let scalars = |names: &[&str; 3]| Sources::scalars(attributes, names);
        let sources = VECTORS.iter().find_map(vector).or_else(|| SCALARS.iter().find_map(scalars));
        sources.map(|sources| Self::read(attributes, &sources)).or_else(|| of_momenta(attributes))
    }

    /// The columns with these `names`, which together have three numbers.
    ///
    /// # Errors
    /// There is no such column, or the columns have another number of components.
    pub fn named(attributes: &[Attribute], names: &[String]) -> Result<Self, GrainColumnError> {
        let sources = Sources::named(attributes, names, "an angular velocity", &[3])?;
        Ok(Self::read(attributes, &sources))
    }

    fn read(attributes: &[Attribute], sources: &Sources) -> Self {
        let values = sources.map(attributes, |numbers| [0, 1, 2].map(|axis| narrow(numbers[axis])));
        Self { values, used: sources.names(attributes) }
    }
}

/// The angular velocities of particles with the angular momenta of HOOMD-blue.
fn of_momenta(attributes: &[Attribute]) -> Option<AngularVelocities> {
    let vector =
        |name: &str, components| Sources::vector(attributes, |own| own == name, components);
    let names = ["orientation", "angmom", "moment_inertia"];
    let columns = [vector(names[0], 4)?, vector(names[1], 4)?, vector(names[2], 3)?];
    let numbers = columns.map(|sources| {
        sources.map(attributes, |numbers| {
            let component = |i: usize| numbers.get(i).copied().unwrap_or(0.0);
            [0, 1, 2, 3].map(component)
        })
    });
    let [orientations, momenta, inertia] = &numbers;
    let values = orientations.iter().zip(momenta).zip(inertia);
    let values = values.map(|((q, p), i)| of_momentum(*q, *p, [i[0], i[1], i[2]])).collect();
    Some(AngularVelocities { values, used: names.map(str::to_owned).to_vec() })
}

/// The angular velocity of a particle with an orientation and an angular momentum, quaternions w, x, y, z, and principal
/// moments of inertia.
fn of_momentum(orientation: [f64; 4], momentum: [f64; 4], inertia: [f64; 3]) -> [f32; 3] {
    let quaternion = |[w, x, y, z]: [f64; 4]| DQuat::from_xyzw(x, y, z, w);
    let (q, p) = (quaternion(orientation), quaternion(momentum));
    let own = 0.5 * (q.conjugate() * p).xyz();
    let about = |axis: usize| if inertia[axis] == 0.0 { 0.0 } else { own[axis] / inertia[axis] };
    (q * DVec3::new(about(0), about(1), about(2))).to_array().map(narrow)
}
