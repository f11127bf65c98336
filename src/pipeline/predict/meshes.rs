//! Memory of meshes.

use super::super::setup::Setup;

/// Memory of the meshes that all frames share.
pub(super) fn shared(setup: &Setup) -> u64 {
    let trees = (setup.picture.things.meshes.iter()).filter_map(|thing| thing.mesh.tree.as_ref());
    trees.map(|tree| tree.bytes() as u64).sum()
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
