//! Which particles of a frame are drawn: by a condition on their values, by their ids, and by regions.
//!
//! ```text
//! `type == 2 and z > 0` -> [selection] + frame -> the particles that satisfy it
//! ```
//!
//! - [`Condition`]: a comparison of values such as `speed > 2 && z < 0.5`, parsed from text. Errors name the character.
//! - [`Region`]: half-spaces, boxes and slabs.
//! - [`Selection`]: those that must hold for a particle. [`Selection::survivors`] finds the particles of a frame, in
//!   blocks and in parallel; the result does not depend on the number of threads.
//! - [`Division`]: conditions that divide particles into groups, which are drawn in different ways.
//!
//! The other particles are left out after a frame has been read, before anything is computed from it. This crate knows
//! no settings, and opens no files; `spherule-frame` says what the names of values mean.
//!
//! ```
//! use spherule_frame::{Attribute, AttributeData, Positions, RawParticles};
//! use spherule_selection::{Condition, Selection};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let particles = RawParticles {
//!     positions: Positions::F32(vec![glam::Vec3::ZERO; 3]),
//!     attributes: vec![Attribute {
//!         name: "density".to_owned(),
//!         components: 1,
//!         data: AttributeData::F32(vec![998.0, 1001.0, 1004.0]),
//!     }],
//!     ..RawParticles::default()
//! };
//! let selection =
//!     Selection { condition: Some(Condition::parse("density > 1000")?), ..Selection::default() };
//! let survivors = selection.survivors(&particles).expect("the frame has densities");
//! assert_eq!(survivors, [1, 2]);
//! # Ok(())
//! # }
//! ```
#![deny(unsafe_code)]

use std::collections::HashSet;

use glam::DVec3;
use rayon::prelude::*;
use spherule_formats::order::index_u32;
use spherule_frame::values::{Named, Value, id_of};
use spherule_frame::{Attribute, AttributeData, Labels, RawParticles};
use spherule_jobs::FrameRange;

mod condition;
mod division;
mod error;
mod evaluate;
mod near;
mod region;
#[cfg(test)]
mod tests;
mod texts;
mod token;
mod values;

pub use condition::Condition;
pub use division::{Claim, Divided, Division};
pub use error::ConditionError;
pub use region::Region;
pub use values::{NameFault, UnknownName};

use condition::{NameUse, NeighbourUse, Operation, TextUse};
use evaluate::{BLOCK, Operands, Stacks};
use near::near;
use texts::{MissingText, TextValue, code_of};
use values::{FileContext, value_of};

/// Particles that one task tests.
const RUN: usize = 64 * BLOCK;

/// Which particles are drawn: those that meet all of these.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Selection {
    /// A condition on their values.
    pub condition: Option<Condition>,
    /// Their ids, or their indices if they have none.
    pub ids: Option<FrameRange>,
    /// Only ids, or indices, that are multiples of this number, if it is above 1.
    pub every: u32,
    /// Regions that contain their centres.
    pub regions: Vec<Region>,
    /// Regions that spheres are cut to. Particles with centres outside are drawn as well, as their spheres may reach
    /// into them.
    pub cuts: Vec<Region>,
    /// The direction of heights, once it is known; without it, conditions have none.
    pub up: Option<DVec3>,
}

impl Selection {
    /// Whether all particles are drawn.
    pub const fn is_all(&self) -> bool {
        let is_by_id = self.ids.is_some() || self.every > 1;
        self.condition.is_none() && !is_by_id && self.regions.is_empty()
    }

    /// The particles with centres in the regions that spheres are cut to.
    pub fn of_cuts(&self) -> Self {
        Self { regions: self.cuts.clone(), ..Self::default() }
    }

    /// Checks that the names in the condition have values, for particles with `attributes` and the `labels` of a sequence.
    ///
    /// # Errors
    /// The first name that has none, or is text where a number is needed.
    pub fn check_names<A: Named>(
        &self,
        attributes: &[A],
        time: Option<f64>,
        labels: &Labels,
    ) -> Result<(), UnknownName> {
        self.values(attributes, time, (labels, MissingText::Error)).map(|_| ())
    }

    /// The values of the names in the condition, and what its texts stand for.
    fn values<A: Named>(
        &self,
        attributes: &[A],
        time: Option<f64>,
        (labels, missing): (&Labels, MissingText),
    ) -> Result<(Vec<Value>, Vec<TextValue<Value>>), UnknownName> {
        let Some(Condition { names, texts, operations, neighbours, .. }) = &self.condition else {
            return Ok(Default::default());
        };
        let value = |name: &NameUse| value_of(name, attributes, time, self.up);
        let values: Vec<Value> = names.iter().map(value).collect::<Result<_, _>>()?;
        // Numbers of text mean nothing
        let lists = neighbours.iter().map(|neighbour| &neighbour.operations);
        for operations in std::iter::once(operations).chain(lists) {
            for (index, operation) in operations.iter().enumerate() {
                if let Operation::Value(of) = *operation
                    && !matches!(operations.get(index + 1), Some(Operation::Text(_)))
                    && let Some(example) = texts::example(&values[of], labels)
                {
                    let NameUse { name, column } = names[of].clone();
                    let fault = NameFault::NotNumber { example: example.to_owned() };
                    return Err(UnknownName { name, column, fault });
                }
            }
        }
        // Programs have different names for water: one of a list is enough
        let listed = texts
            .iter()
            .filter(|used| used.list.is_some() && texts::has(&values[used.of], &used.text, labels));
        let known_lists: HashSet<Option<usize>> = listed.map(|used| used.list).collect();
        let text = |used: &TextUse| {
            let name = NameUse { name: used.text.clone(), column: used.column };
            match value(&name) {
                Ok(value) if used.may_be_value && !texts::is_text(&values[used.of]) => {
                    Ok(TextValue::Value(value))
                }
                _ => {
                    let of = (names[used.of].name.as_str(), &values[used.of]);
                    let text = (used.text.as_str(), used.column);
                    let is_listed = known_lists.contains(&used.list);
                    let missing = if is_listed { MissingText::NoParticle } else { missing };
                    code_of(of, text, labels, missing).map(TextValue::Code)
                }
            }
        };
        let texts = texts.iter().map(text).collect::<Result<_, _>>()?;
        Ok((values, texts))
    }

    /// Indices of the particles that are drawn, ascending. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// A name in the condition has no value. Frames without particles need no attributes.
    pub fn survivors(&self, particles: &RawParticles) -> Result<Vec<u32>, UnknownName> {
        let count = particles.positions.len();
        if count == 0 {
            return Ok(Vec::new());
        }
        // Look up the values of names and texts
        let labels = (&particles.labels, MissingText::NoParticle);
        let (values, texts) = self.values(&particles.attributes, particles.time, labels)?;
        let context = FileContext::new(particles, self.up);
        let values: Vec<Value<&Attribute>> =
            values.iter().filter_map(|value| context.bind(value)).collect();
        let bound = |text: &TextValue<Value>| match text {
            TextValue::Code(code) => Some(TextValue::Code(*code)),
            TextValue::Value(value) => context.bind(value).map(TextValue::Value),
        };
        let texts: Vec<TextValue<Value<&Attribute>>> = texts.iter().filter_map(bound).collect();
        // Find those that are near others; a condition on these may contain another one, which comes first
        let mut all_near: Vec<Vec<bool>> = Vec::new();
        let neighbours = self.condition.iter().flat_map(|condition| &condition.neighbours);
        for NeighbourUse { distance, operations } in neighbours {
            let operands = Operands { values: &values, texts: &texts, near: &all_near };
            let mut of = vec![false; count];
            of.par_chunks_mut(BLOCK).enumerate().for_each_init(
                Stacks::default,
                |stacks, (i, to)| {
                    stacks.evaluate(operations, operands, context, i * BLOCK, to);
                },
            );
            all_near.push(near(particles, *distance, &of));
        }
        // Mark the particles that are kept, in runs that do not depend on the threads
        let operands = Operands { values: &values, texts: &texts, near: &all_near };
        let ids = id_of(&particles.attributes);
        let mut marks = vec![false; count];
        let runs = marks.par_chunks_mut(RUN).enumerate();
        let counts: Vec<usize> = runs
            .map_init(Stacks::default, |stacks, (run, marks)| {
                for (block, keep) in marks.chunks_mut(BLOCK).enumerate() {
                    let first = run * RUN + block * BLOCK;
                    keep.fill(true);
                    if let Some(condition) = &self.condition {
                        let operations = &condition.operations;
                        stacks.evaluate(operations, operands, context, first, keep);
                    }
                    self.test_ids(ids, first, keep);
                    self.test_regions(particles, first, keep);
                }
                marks.iter().map(|mark| usize::from(*mark)).sum()
            })
            .collect();
        // Collect their indices
        Ok(marked_indices(&marks, &counts))
    }

    /// Clears the marks of particles without a selected id.
    fn test_ids(&self, ids: Option<&Attribute>, first: usize, keep: &mut [bool]) {
        if self.ids.is_none() && self.every <= 1 {
            return;
        }
        let id = |i: usize| match ids {
            Some(attribute) => integer(&attribute.data, first + i),
            None => i64::try_from(first + i).ok(),
        };
        let every = i64::from(self.every.max(1));
        let is_selected = |id: i64| {
            let in_ranges = || self.ids.as_ref().is_none_or(|ids| ids.contains(id));
            id % every == 0 && in_ranges()
        };
        for (i, keep) in keep.iter_mut().enumerate() {
            *keep = *keep && id(i).is_some_and(is_selected);
        }
    }

    /// Clears the marks of particles that are not in all regions.
    fn test_regions(&self, particles: &RawParticles, first: usize, keep: &mut [bool]) {
        for region in &self.regions {
            for (i, keep) in keep.iter_mut().enumerate() {
                *keep = *keep && region.contains(particles.positions.get(first + i));
            }
        }
    }
}

/// The indices of the marked particles, with the `counts` of marks in each run.
fn marked_indices(marks: &[bool], counts: &[usize]) -> Vec<u32> {
    let mut indices = vec![0; counts.iter().sum()];
    let mut rest = &mut indices[..];
    let mut parts = Vec::with_capacity(counts.len());
    for count in counts {
        let (part, after) = rest.split_at_mut(*count);
        parts.push(part);
        rest = after;
    }
    let runs = marks.par_chunks(RUN).zip(parts).enumerate();
    runs.for_each(|(run, (marks, mut to))| {
        for (block, keep) in marks.chunks(BLOCK).enumerate() {
            let mut kept = [0; BLOCK];
            let count = indices_of(run * RUN + block * BLOCK, keep, &mut kept);
            let (part, after) = to.split_at_mut(count);
            part.copy_from_slice(&kept[..count]);
            to = after;
        }
    });
    indices
}

/// Writes the indices of the marked particles of a block, and returns their number.
fn indices_of(first: usize, keep: &[bool], to: &mut [u32; BLOCK]) -> usize {
    // Every index is written, and the next one replaces those that are not kept: there is nothing to predict.
    let mut end = 0;
    for (i, keep) in keep.iter().enumerate() {
        to[end] = index_u32(first + i);
        end += usize::from(*keep);
    }
    end
}

/// Value `index` as an integer; None if it is not one.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::float_cmp,
    reason = "compared with the value"
)]
fn integer(data: &AttributeData, index: usize) -> Option<i64> {
    match data {
        AttributeData::I64(v) => Some(v[index]),
        AttributeData::U64(v) => i64::try_from(v[index]).ok(),
        other => {
            let value = other.get_f64(index);
            Some(value as i64).filter(|integer| *integer as f64 == value)
        }
    }
}
