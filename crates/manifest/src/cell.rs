//! `[cell]`: the simulation cell.

use glam::Vec3;
use serde_json::{Value as Json, json};
use spherule_frame::PeriodicImages;
use spherule_selection::Condition;

use super::field::Field;
use super::key::Key;
use super::keys::section;
use super::value::{Fault, FlagKind, Value, list};

/// Default colour of the edges, linear RGB: nearly black.
const COLOR: Vec3 = Vec3::splat(0.02);

section! {
    /// The simulation cell, in files that have one, such as extended XYZ, LAMMPS, GSD, H5MD and molecular formats
    Cell {
        /// Draw the edges of the cell
        ///
        /// An automatic camera then shows the whole cell.
        visible: bool = false, flag("cell", "", "Look");
        /// Radius of the edges, or auto: 0.0015 times the diagonal of the cell
        radius: Option<f32> = None, or("auto"), unit("a length"), above(0), single();
        /// Colour of the edges, linear RGB
        color: Vec3 = COLOR, from(0), to(1);
        /// Number of cells along each edge, with copies of all particles: [2, 2, 1]
        ///
        /// Copies have the ids of their originals, and the cell that is drawn encloses them.
        replicate: Replicate = Replicate::default(), flag("replicate", "A,B,C", "Input");
        /// Move particles into the cell, along the edges along which it repeats
        wrap: bool = false, flag("wrap", "", "Input");
        /// Make molecules whole, by their bonds, or without bonds by the image flags ix, iy and iz
        ///
        /// Bonds are those of the file or of input.topology. Without bonds and image flags, bonds are found by distance, by
        /// covalent radii. With wrap, the first particle of each molecule is in the cell.
        unwrap: bool = false, flag("unwrap", "", "Input");
        /// Keep the particles of a condition in the middle of the cell: residue_name == 'LIG'
        ///
        /// All particles are moved around them: molecules as a whole with unwrap, else each by itself. Without a periodic
        /// cell, the centre of these particles stays where it is in the first frame.
        center: Option<Condition> = None, example("\"residue_name == 'LIG'\""), unset("particles stay where they are"),
            flag("center", "CONDITION", "Input");
        /// Turn and move each frame so that the particles of a condition are as in the first frame, by least squares
        ///
        /// Vectors such as velocities turn as well, and the cell. Particles are matched by their ids, or without ids in
        /// their order. Cells that cut these particles need unwrap.
        align: Option<Condition> = None, example("\"atom_name == 'CA'\""), unset("particles stay where they are"),
            flag("align", "CONDITION", "Input");
    }
}

impl Cell {
    /// What is done with the particles.
    pub const fn images(&self) -> PeriodicImages {
        PeriodicImages { replicate: self.replicate.0, wrap: self.wrap, unwrap: self.unwrap }
    }

    /// Whether frames are placed like the first one.
    pub const fn has_reference(&self) -> bool {
        self.center.is_some() || self.align.is_some()
    }
}

/// Number of cells along each edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Replicate(pub [u32; 3]);

/// Most cells along an edge.
const MAX_CELLS: u32 = 1000;

impl Default for Replicate {
    fn default() -> Self {
        Self([1; 3])
    }
}

impl Value for Replicate {
    const FLAG: FlagKind = FlagKind::Integers;

    fn kind(_: &Key) -> String {
        format!("three whole numbers from 1 to {MAX_CELLS}, such as [2, 2, 1]")
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let items = field.items().ok_or(Fault::Unwanted)?;
        let number = |item: &Field<'_>| {
            let number = item.as_integer().and_then(|n| u32::try_from(n).ok())?;
            (1..=MAX_CELLS).contains(&number).then_some(number)
        };
        let found: Option<Vec<u32>> = items.iter().map(number).collect();
        let numbers = found.and_then(|numbers| numbers.try_into().ok());
        numbers.map(Self).ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        list(self.0.iter().map(u32::to_string))
    }

    fn schema(_: &Key) -> Json {
        json!({
            "type": "array",
            "items": { "type": "integer", "minimum": 1, "maximum": MAX_CELLS },
            "minItems": 3,
            "maxItems": 3,
        })
    }
}
