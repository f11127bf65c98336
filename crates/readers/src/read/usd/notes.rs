//! Notes about a USD file: units, parts, and what is not in its particles.

use super::layer::Layer;
use super::particles::{DIAMETER, attribute_name};
use super::prim::PrimKind;
use super::scene::{ParticlePrims, numbers_at};
use spherule_frame::MemoryBudget;
use spherule_frame::join::PART;

/// Most parts that a note lists.
const LISTED: usize = 12;

/// Memory for a value that is looked at.
const VALUE_BUDGET: MemoryBudget = MemoryBudget::new(1 << 16, "");

/// See [`crate::reader::Reader::notes`].
pub(super) fn notes(layer: &Layer<'_>) -> Vec<String> {
    let mut notes = Vec::new();
    let metadata = layer.metadata;
    let meters = metadata.meters_per_unit;
    let (unit, is_default) = (meters.unwrap_or(0.01), meters.is_none());
    notes.push(format!(
        "a length unit is {unit} m{}, and {} points up; times are time codes divided by {} a second",
        if is_default { " (the default of USD)" } else { "" },
        if metadata.is_z_up { "z" } else { "y" },
        metadata.rate(),
    ));
    let Ok(prims) = ParticlePrims::find(layer) else {
        return notes;
    };
    // Parts
    let path = |prim: &usize| layer.path(&layer.chain(*prim).unwrap_or_default());
    if prims.prims.len() > 1 {
        let parts = prims.prims.iter().take(LISTED).enumerate();
        let parts: Vec<String> =
            parts.map(|(number, prim)| format!("{number} = {}", path(prim))).collect();
        let more = if prims.prims.len() > LISTED { ", ..." } else { "" };
        notes.push(format!("attribute `{PART}` has numbers for prims: {}{more}", parts.join(", ")));
    }
    // Attributes whose meaning is not in their name
    let has = |name: &str| {
        let mut owners = prims.prims.iter().filter_map(|prim| layer.prims.get(*prim));
        owners.any(|prim| {
            let mut own = layer.properties(prim).iter();
            own.any(|property| attribute_name(layer, prim, property).as_deref() == Some(name))
        })
    };
    if has(DIAMETER) {
        notes.push(format!("the widths of points are the attribute `{DIAMETER}`"));
    }
    let is_instancer =
        |prim: &usize| layer.prims.get(*prim).is_some_and(|prim| prim.kind == PrimKind::Instancer);
    if prims.prims.iter().any(is_instancer) {
        let what = "the instances of a PointInstancer are particles; its prototypes and orientations are not used";
        notes.push(what.to_owned());
    }
    if is_transformed(layer, &prims) {
        let what =
            "positions, velocities, accelerations and widths are transformed as the file says";
        notes.push(what.to_owned());
    }
    if prims.has_arcs {
        let what = "other files, variants and classes that the file refers to are not read";
        notes.push(what.to_owned());
    }
    notes
}

/// Whether prims with particles, or those above them, have transforms.
fn is_transformed(layer: &Layer<'_>, prims: &ParticlePrims) -> bool {
    let mut chains = prims.prims.iter().take(LISTED).filter_map(|prim| layer.chain(*prim));
    chains.any(|chain| {
        let mut all = chain.iter().filter_map(|index| layer.prims.get(*index));
        all.any(|prim| {
            let mut own = layer.properties(prim).iter();
            own.any(|property| {
                let is_operation = layer.text(&property.name).starts_with(b"xformOp:");
                let has_value = || numbers_at(layer, property, None, VALUE_BUDGET) != Ok(None);
                is_operation && (property.samples.is_some() || has_value())
            })
        })
    })
}
