//! `[select]`: the particles that are drawn.

use serde_json::{Value as Json, json};
use spherule_jobs::FrameRange;
use spherule_selection::{Condition, Region};

use super::field::Field;
use super::key::Key;
use super::keys::{Keys, keys};
use super::value::{Fault, FlagKind, Named, Value, named};

named! {
    /// An axis of the simulation.
    Axis {
        /// x
        X = "x",
        /// y
        Y = "y",
        /// z
        Z = "z",
    }
}

impl Axis {
    /// Its index: 0, 1 or 2.
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// A slice of the particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slab {
    /// The axis that it is normal to.
    pub axis: Axis,
    /// Coordinate of its middle.
    pub center: f64,
    /// Its thickness.
    pub thickness: f64,
}

impl Slab {
    /// The region that contains the centres of its particles.
    pub fn region(&self) -> Region {
        Region::Slab {
            axis: self.axis.index(),
            low: self.center - 0.5 * self.thickness,
            high: self.center + 0.5 * self.thickness,
        }
    }
}

/// The particles that are drawn: those that meet all of these.
#[derive(Debug, Clone, PartialEq)]
pub struct Select {
    /// A condition on their values.
    pub condition: Option<Condition>,
    /// Their ids, or their indices if they have none.
    pub ids: Option<FrameRange>,
    /// Only multiples of this number among the ids, or indices.
    pub every: u32,
    /// A slice that contains their centres.
    pub slab: Option<Slab>,
}

impl Default for Select {
    fn default() -> Self {
        Self { condition: None, ids: None, every: 1, slab: None }
    }
}

/// Largest step between ids.
pub(super) const MAX_STEP: u32 = 1_000_000_000;

pub(super) const ABOUT: &[&str] = &[
    "Particles that are drawn: those that meet all of these; camera and colours are chosen for them",
];

impl Select {
    pub(super) fn keys(&mut self, keys: &mut Keys<'_>) {
        keys!(keys:
            /// Condition on values of particles: speed > 2 && z < 0.5 && type in (1, 2)
            ///
            /// Operators are `&& || ! < <= > >= == != + - * /`, functions are abs, sqrt, min and max; `in (...)` lists
            /// values, `within 5 of (...)` takes what is near others. `velocity` is the magnitude of a vector, `velocity.x` a
            /// component. Other values are x, y, z, speed, height, index, id, radius, time, part and text columns.
            where => self.condition, example("\"speed > 2 && z < 0.5\""), unset("all particles"),
                flag("where", "CONDITION", "Input");
            /// Ids of particles, in the notation of frames: 1-100,200; indices from 0 if they have no ids
            ids => self.ids, example("\"1-100,200\""), unset("all ids");
            /// Draw only every n-th particle: ids, or indices, that are multiples of this number
            every => self.every, from(1), to(MAX_STEP);
            /// A slice: particles with their centres in it, as { axis = "z", center = 0.5, thickness = 0.1 }
            slab => self.slab, example("{ axis = \"z\", center = 0.5, thickness = 0.1 }"), unset("no slice");
        );
    }
}

impl Value for Condition {
    const FLAG: FlagKind = FlagKind::Text(true);

    fn kind(_: &Key) -> String {
        "a condition in quotes, such as \"speed > 2\"".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let text = field.as_text().ok_or(Fault::Unwanted)?;
        Self::parse(text).map_err(|e| Fault::Because(e.to_string()))
    }

    fn toml(&self) -> String {
        self.as_str().to_owned().toml()
    }

    /// All but comparisons is beyond it.
    fn schema(_: &Key) -> Json {
        json!({ "type": "string", "pattern": "<|>|==|!=| in |within" })
    }
}

impl Value for Slab {
    fn kind(_: &Key) -> String {
        "{ axis = \"z\", center = 0.5, thickness = 0.1 }".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let mut section = field.as_table().ok_or(Fault::Unwanted)?;
        let mut slab = Self { axis: Axis::Z, center: 0.0, thickness: 1.0 };
        let key = |name, why| Key::new(name, &[]).required(why);
        section.read(&key("axis", "x, y or z"), &mut slab.axis);
        section.read(&key("center", "the coordinate of the middle"), &mut slab.center);
        let thickness = key("thickness", "the thickness of the slice");
        section.read(&thickness.above(0), &mut slab.thickness);
        section.finish();
        Ok(slab)
    }

    fn toml(&self) -> String {
        let (center, thickness) = (self.center.toml(), self.thickness.toml());
        let axis = self.axis.toml();
        format!("{{ axis = {axis}, center = {center}, thickness = {thickness} }}")
    }

    fn schema(_: &Key) -> Json {
        json!({
            "type": "object",
            "properties": {
                "axis": { "enum": Axis::names().iter().map(|(_, name)| *name).collect::<Vec<_>>() },
                "center": { "type": "number" },
                "thickness": { "type": "number", "exclusiveMinimum": 0 },
            },
            "required": ["axis", "center", "thickness"],
            "additionalProperties": false,
        })
    }
}
