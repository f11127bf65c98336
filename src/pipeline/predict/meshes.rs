//! Memory of meshes.

use super::super::setup::{Setup, StyleForm};

/// Memory of the meshes that all frames share, also of those of grains.
pub(super) fn shared(setup: &Setup) -> u64 {
    let trees = (setup.picture.things.meshes.iter()).filter_map(|thing| thing.mesh.tree.as_ref());
    let of_grains = setup.picture.particles.styles.iter().filter_map(|style| match &style.form {
        StyleForm::Grains(rules) => rules.mesh.as_ref().map(|mesh| mesh.bytes() as u64),
        _ => None,
    });
    trees.map(|tree| tree.bytes() as u64).chain(of_grains).sum()
}

/// Memory for reading the meshes that all frames share: each of them is built next to those before it.
pub(super) fn reading_shared(setup: &Setup) -> u64 {
    let trees = (setup.picture.things.meshes.iter()).filter_map(|thing| thing.mesh.tree.as_ref());
    let sums = trees.scan(0, |before, tree| {
        let need = *before + tree.building_bytes();
        *before += tree.bytes() as u64;
        Some(need)
    });
    sums.max().unwrap_or(0)
}
