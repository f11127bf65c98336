//! Which particles are drawn.

use super::{ResolveError, color, similar};
use crate::manifest::Manifest;
use crate::pipeline::attribute_list;
use crate::selection::{OTHER_NAMES, Selection};
use crate::survey::Survey;

/// The selection of `manifest`.
///
/// # Errors
/// The particles have no value with a name in the condition.
pub(super) fn selection(manifest: &Manifest, survey: &Survey) -> Result<Selection, ResolveError> {
    let selection = manifest.selection();
    if survey.most_particles == 0 {
        return Ok(selection);
    }
    // Whether files have times shows when they are read
    let checked = selection.check_names(&color::known_attributes(survey), Some(0.0));
    match checked {
        Ok(()) => Ok(selection),
        Err(unknown) => {
            let others = OTHER_NAMES.map(str::to_owned);
            let all = [&survey.attributes[..], &others].concat();
            let name = unknown.name.split(['.', '[']).next().unwrap_or_default();
            Err(ResolveError::UnknownName {
                column: unknown.column,
                hint: similar(name, &all),
                has: attribute_list(all.iter().map(String::as_str)),
                name: unknown.name,
            })
        }
    }
}
