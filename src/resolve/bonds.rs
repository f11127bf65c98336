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
    let Some(search) = bond_rule(own.find, survey, "bonds.find")? else {
        return Ok(None);
    };
    // Choose their colour and radius
    let color = rule(&own.color, particles, survey, ELEMENT, "bonds.color")?;
    let radius = own.radius.unwrap_or_else(|| narrow(RADIUS * reach));
    Ok(look(scene, radius, &own.color, color).map(|look| BondStyle { rule: search, look }))
}

/// How bonds are found, if they are drawn; `key` says so.
///
/// # Errors
/// There are no elements.
pub(super) fn bond_rule(
    search: BondSearch,
    survey: &Survey,
    key: &'static str,
) -> Result<Option<BondRule>, ResolveError> {
    Ok(match search {
        BondSearch::None => None,
        BondSearch::File => Some(BondRule::File),
        BondSearch::Distance(distance) => Some(BondRule::Distance(narrow(distance))),
        BondSearch::Covalent => {
            require_attribute(survey, key, ELEMENT)?;
            let name = ELEMENT.to_owned();
            Some(BondRule::Covalent { name, angstrom: survey.angstrom })
        }
    })
}
