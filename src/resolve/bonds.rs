//! Bonds between particles.

use super::arrows::mapped;
use super::{ResolveError, narrow, require_attribute};
use crate::manifest::{BondSearch, ColorSetting, Manifest};
use crate::pipeline::{BondRule, BondStyle, ColorRule};
use crate::surface::MaterialId;
use crate::survey::Survey;

/// Automatic radius in radii of the particles.
const RADIUS: f64 = 1.0 / 3.0;

/// The attribute with atomic numbers.
const ELEMENT: &str = "element";

/// How bonds are drawn, if they are; see [`arrows`](super::arrows::arrows). Their material follows that of the trails.
///
/// # Errors
/// There are no elements, or colours are not determined.
pub(super) fn bonds(
    manifest: &Manifest,
    survey: &Survey,
    particles: &ColorRule,
    reach: f64,
) -> Result<Option<BondStyle>, ResolveError> {
    let own = &manifest.bonds;
    let rule = match own.find {
        BondSearch::None => return Ok(None),
        BondSearch::File => BondRule::File,
        BondSearch::Distance(distance) => BondRule::Distance(narrow(distance)),
        BondSearch::Covalent => {
            require_attribute(survey, "bonds.find", ELEMENT)?;
            BondRule::Covalent {
                name: ELEMENT.to_owned(),
                angstrom: survey.angstrom,
            }
        }
    };
    let others = manifest.meshes.len()
        + usize::from(manifest.cell.visible)
        + manifest.arrows.len()
        + usize::from(manifest.trails.frames > 0);
    let Some(material) = MaterialId::of_mesh(others) else {
        return Ok(None);
    };
    Ok(Some(BondStyle {
        rule,
        radius: own.radius.unwrap_or_else(|| narrow(RADIUS * reach)),
        color: match &own.color {
            ColorSetting::Rgb(_) => None,
            ColorSetting::Auto => Some(particles.clone()),
            ColorSetting::Mapped(by) => Some(mapped(by, survey, ELEMENT, "bonds.color")?),
        },
        material,
    }))
}
