//! Bonds between particles.

use super::rods::{look, rule};
use super::{ResolveError, require_attribute};
use crate::manifest::{BondSearch, Manifest};
use crate::math::narrow;
use crate::pipeline::{BondRule, BondStyle, ColorRule};
use crate::scene::Scene;
use crate::survey::{ELEMENT, Survey};

/// Automatic radius in radii of the particles.
const RADIUS: f64 = 1.0 / 3.0;

/// How bonds are drawn, if they are; see [`arrows`](super::arrows::arrows).
///
/// # Errors
/// There are no elements, or colours are not determined.
pub(super) fn bonds(
    scene: &mut Scene,
    manifest: &Manifest,
    survey: &Survey,
    particles: &ColorRule,
    reach: f64,
) -> Result<Option<BondStyle>, ResolveError> {
    let own = &manifest.bonds;
    // Choose how bonds are found
    let search = match own.find {
        BondSearch::None => return Ok(None),
        BondSearch::File => BondRule::File,
        BondSearch::Distance(distance) => BondRule::Distance(narrow(distance)),
        BondSearch::Covalent => {
            require_attribute(survey, "bonds.find", ELEMENT)?;
            BondRule::Covalent { name: ELEMENT.to_owned(), angstrom: survey.angstrom }
        }
    };
    // Choose their colour and radius
    let color = rule(&own.color, particles, survey, ELEMENT, "bonds.color")?;
    let radius = own.radius.unwrap_or_else(|| narrow(RADIUS * reach));
    Ok(look(scene, radius, &own.color, color).map(|look| BondStyle { rule: search, look }))
}
