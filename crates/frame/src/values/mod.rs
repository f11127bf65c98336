//! The values of particles that users name: in conditions, colours, opacities, overlays and messages.
//!
//! [`Value::named`] is the only table of names: columns, their components, and values that follow from positions,
//! velocities and time. [`Value::bind`] finds the column in memory or in a file, and [`Value::get`] computes the
//! value of a particle from it and from a [`Context`].

mod bound;
mod column;
mod value;

pub use bound::Context;
pub use column::{Column, Named, PART_NAMES, id_of, part_of, velocity_of};
pub use value::{SPEED, Value, shown_name, value_names};
