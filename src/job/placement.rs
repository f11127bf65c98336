//! Where the table `[cell]` of a manifest places the particles of a sequence.

use std::sync::Arc;

use spherule_files::counted;
use spherule_formats::sequence::{Group, Placement};
use spherule_formats::{ParseError, RawParticles};
use spherule_selection::{Condition, Selection, UnknownName};

use crate::manifest::Cell;
use crate::pipeline::{attribute_list, covalent_lengths};
use crate::survey::ELEMENT;

/// What `cell` says of the particles of all frames; `angstrom` is the length of one in their unit.
pub(super) fn placement_of(cell: &Cell, angstrom: f64) -> Placement {
    let group = |key, condition: &Option<Condition>| {
        let condition = condition.clone()?;
        let selection = Selection { condition: Some(condition), ..Selection::default() };
        Some(Arc::new(ConditionGroup { key, selection }) as Arc<dyn Group>)
    };
    Placement {
        images: cell.images(),
        lengths: cell.unwrap.then(|| Arc::new(covalent_lengths(ELEMENT, angstrom))),
        center: group("cell.center", &cell.center),
        align: group("cell.align", &cell.align),
    }
}

/// The particles for which the condition of a key holds.
#[derive(Debug)]
struct ConditionGroup {
    key: &'static str,
    selection: Selection,
}

impl Group for ConditionGroup {
    fn particles(&self, frame: &RawParticles) -> Result<Vec<u32>, ParseError> {
        let chosen =
            self.selection.survivors(frame).map_err(|unknown| self.unknown(&unknown, frame))?;
        if !chosen.iter().any(|index| frame.positions.get(*index as usize).is_finite()) {
            let condition = self.selection.condition.as_ref().map_or("", Condition::as_str);
            return Err(ParseError::unsupported(format!(
                "{}: none of {} meets {condition}; `spherule inspect` lists the attributes of the file and their values",
                self.key,
                counted(frame.positions.len(), "particle"),
            )));
        }
        Ok(chosen)
    }
}

impl ConditionGroup {
    /// The error for a name without a value.
    fn unknown(&self, unknown: &UnknownName, frame: &RawParticles) -> ParseError {
        let what = unknown.text_fault("").unwrap_or_else(|| {
            let has = attribute_list(frame.attributes.iter().map(|a| a.name.as_str()));
            format!("no value `{}`; the file has {has}", unknown.name)
        });
        ParseError::unsupported(format!("{}: character {}: {what}", self.key, unknown.column))
    }
}
