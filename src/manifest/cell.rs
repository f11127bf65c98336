//! `[cell]`: the simulation cell.

use glam::Vec3;

use super::keys::section;

/// Default colour of the edges, linear RGB: nearly black.
const COLOR: Vec3 = Vec3::splat(0.02);

section! {
    /// The simulation cell, in files that have one: LAMMPS dumps, extended XYZ and GSD
    Cell {
        /// Draw the edges of the cell
        ///
        /// An automatic camera then shows the whole cell.
        visible: bool = false, flag("cell", "", "Look");
        /// Radius of the edges, or auto: 0.0015 times the diagonal of the cell
        radius: Option<f32> = None, or("auto"), unit("a length"), above(0), single();
        /// Colour of the edges, linear RGB
        color: Vec3 = COLOR, from(0), to(1);
    }
}
