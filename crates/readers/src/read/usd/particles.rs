//! The particles of one time step: values of each prim, one prim after another.

use std::collections::BTreeSet;

use glam::{DAffine3, DVec3};

use super::layer::Layer;
use super::number_type::Numbers;
use super::prim::{Prim, PrimKind, Property};
use super::scene::{ParticlePrims, numbers_at, positions, tokens_at};
use super::transform::world_from_prim;
use crate::read::columns;
use spherule_frame::join::{Part, join, join_numbered};
use spherule_frame::{
    Attribute, AttributeData, MemoryBudget, ParseError, RawParticles, map_values,
};

/// The attribute that widths become: that of a sphere is its diameter.
pub(super) const DIAMETER: &str = "diameter";

const PRIMVARS: &[u8] = b"primvars:";
const INDICES: &[u8] = b":indices";

/// Reads the particles of all prims at a time code.
///
/// # Errors
/// [`ParseError`] if values are damaged or do not fit into `budget`, or if transforms are not read.
pub(super) fn particles(
    layer: &Layer<'_>,
    prims: &ParticlePrims,
    time: Option<f64>,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    // The values of prims are joined: both are in memory at the end
    let mut left = MemoryBudget::less(budget, budget.bytes() / 2);
    let mut parts = Vec::new();
    for (number, prim) in (0..).zip(&prims.prims) {
        if let Some(particles) = particles_of(layer, *prim, time, &mut left)? {
            let name = layer.path(&layer.chain(*prim).unwrap_or_default());
            parts.push(Part { number, name, particles });
        }
    }
    let joined = match prims.prims.len() {
        0 | 1 => join(parts, budget),
        _ => join_numbered(parts, budget),
    }?;
    Ok(RawParticles { time: time.map(|time| time / layer.metadata.rate()), ..joined })
}

/// The particles of the prim with index `prim`; `None` if it has none, or is not drawn.
fn particles_of(
    layer: &Layer<'_>,
    prim: usize,
    time: Option<f64>,
    budget: &mut MemoryBudget,
) -> Result<Option<RawParticles>, ParseError> {
    let chain = layer.chain(prim).unwrap_or_default();
    let (Some(own), Some(property)) = (layer.prims.get(prim), positions(layer, prim)) else {
        return Ok(None);
    };
    for index in &chain {
        if is_invisible(layer, *index, time)? {
            return Ok(None);
        }
    }
    // Read positions
    let positions = numbers_at(layer, property, time, *budget)?;
    if positions.is_none()
        && let Some(type_name) = layer.foreign_type(property)
    {
        let path = layer.path(&chain);
        let what =
            format!("the positions of {path} have the unknown type {type_name}; use point3f[]");
        return Err(ParseError::unsupported(what));
    }
    let Some(mut positions) = positions.filter(|positions| positions.len() > 0) else {
        return Ok(None);
    };
    let is_float = matches!(positions.data, AttributeData::F32(_) | AttributeData::F64(_));
    if positions.components != 3 || !is_float {
        let path = layer.path(&chain);
        let what = format!("the positions of {path} are not vectors of three numbers");
        return Err(ParseError::unsupported(what));
    }
    let world = world_from_prim(layer, &chain, time)?;
    if world != DAffine3::IDENTITY {
        // Positions in double precision, and those of the file
        budget.check(24 * positions.len() as u64, "its positions in memory are")?;
        positions.data = transformed(&positions.data, world);
    }
    *budget = budget.less(positions.data.byte_len());
    // Read everything else
    let mut names = BTreeSet::new();
    let mut attributes = Vec::new();
    for property in layer.properties(own) {
        let Some(name) = attribute_name(layer, own, property) else {
            continue;
        };
        if names.contains(&name) {
            continue;
        }
        let Some(values) = values(layer, own, property, time, *budget)? else {
            continue;
        };
        let Some(mut data) =
            for_each_particle(values.data, values.components, positions.len(), *budget)?
        else {
            continue;
        };
        if world != DAffine3::IDENTITY {
            transform_attribute(&name, &mut data, world);
        }
        *budget = budget.less(data.byte_len());
        names.insert(name.clone());
        attributes.push(Attribute { name, components: values.components, data });
    }
    let count = positions.len();
    let positions = columns::positions(vec![positions.data], count);
    Ok(Some(RawParticles { positions, attributes, ..RawParticles::default() }))
}

/// Whether a prim is hidden at a time code.
fn is_invisible(layer: &Layer<'_>, prim: usize, time: Option<f64>) -> Result<bool, ParseError> {
    let prim = layer.prims.get(prim);
    let property = prim.and_then(|prim| layer.property(prim, b"visibility"));
    match property {
        Some(property) => Ok(tokens_at(layer, property, time)?.contains(&&b"invisible"[..])),
        None => Ok(false),
    }
}

/// The attribute that a property becomes; `None` if it becomes none.
pub(super) fn attribute_name(
    layer: &Layer<'_>,
    prim: &Prim,
    property: &Property,
) -> Option<String> {
    let name = layer.text(&property.name);
    let is_instancer = prim.kind == PrimKind::Instancer;
    if let Some(name) = name.strip_prefix(PRIMVARS) {
        let is_attribute = !name.is_empty() && !name.ends_with(INDICES);
        return is_attribute.then(|| String::from_utf8_lossy(name).into_owned());
    }
    let name = match name {
        b"widths" if !is_instancer => DIAMETER,
        b"velocities" => "velocities",
        b"accelerations" => "accelerations",
        b"ids" => "ids",
        b"protoIndices" if is_instancer => "protoIndices",
        b"scales" if is_instancer => "scales",
        _ => return None,
    };
    Some(name.to_owned())
}

/// The values of a property, which for some primvars are those of a shorter list at indices.
fn values(
    layer: &Layer<'_>,
    prim: &Prim,
    property: &Property,
    time: Option<f64>,
    budget: MemoryBudget,
) -> Result<Option<Numbers>, ParseError> {
    let Some(values) = numbers_at(layer, property, time, budget)? else {
        return Ok(None);
    };
    let name = [layer.text(&property.name), INDICES].concat();
    let Some(indices) = layer.property(prim, &name) else {
        return Ok(Some(values));
    };
    let budget = budget.less(values.data.byte_len());
    let indices = match numbers_at(layer, indices, time, budget)?.map(|indices| indices.data) {
        Some(AttributeData::I32(indices)) => indices,
        _ => return Ok(Some(values)),
    };
    let need = (indices.len() * values.components * values.data.scalar_type().size()) as u64;
    budget.less(4 * indices.len() as u64).check(need, "its numbers in memory are")?;
    // An index beyond the list: the values of the primvar are not known
    let data = at_indices(&values.data, values.components, &indices);
    Ok(data.map(|data| Numbers { data, ..values }))
}

fn at_indices(data: &AttributeData, components: usize, indices: &[i32]) -> Option<AttributeData> {
    let most = data.len() / components.max(1);
    let is_inside = |index: &i32| usize::try_from(*index).is_ok_and(|index| index < most);
    if !indices.iter().all(is_inside) {
        return None;
    }
    let places = indices.iter().flat_map(|index| {
        let start = components * index.unsigned_abs() as usize;
        start..start + components
    });
    Some(map_values!(data, v => places.map(|place| v[place]).collect()))
}

/// The values if there is one for each of `count` particles; a single one is repeated. `None` for other lengths.
fn for_each_particle(
    data: AttributeData,
    components: usize,
    count: usize,
    budget: MemoryBudget,
) -> Result<Option<AttributeData>, ParseError> {
    if data.len() == components * count {
        return Ok(Some(data));
    }
    if data.len() != components {
        return Ok(None);
    }
    let need = (count as u64).saturating_mul(data.byte_len());
    budget.check(need, "its numbers in memory are")?;
    Ok(Some(map_values!(data, v => v.repeat(count))))
}

fn transformed(positions: &AttributeData, world: DAffine3) -> AttributeData {
    let points = (0..positions.len() / 3).flat_map(|index| {
        let point =
            DVec3::from_array(std::array::from_fn(|axis| positions.get_f64(3 * index + axis)));
        world.transform_point3(point).to_array()
    });
    AttributeData::F64(points.collect())
}

/// Turns and scales velocities and accelerations, and scales diameters by the mean over all directions.
fn transform_attribute(name: &str, data: &mut AttributeData, world: DAffine3) {
    let is_vector = matches!(name, "velocities" | "accelerations");
    match data {
        AttributeData::F32(v) if is_vector => {
            for vector in v.as_chunks_mut::<3>().0 {
                let own = DVec3::from_array(vector.map(f64::from));
                *vector = world.transform_vector3(own).as_vec3().to_array();
            }
        }
        AttributeData::F64(v) if is_vector => {
            for vector in v.as_chunks_mut::<3>().0 {
                *vector = world.transform_vector3(DVec3::from_array(*vector)).to_array();
            }
        }
        #[expect(clippy::cast_possible_truncation, reason = "to the type of the file")]
        AttributeData::F32(v) if name == DIAMETER => {
            let factor = libm::cbrt(world.matrix3.determinant().abs());
            v.iter_mut().for_each(|width| *width = (f64::from(*width) * factor) as f32);
        }
        AttributeData::F64(v) if name == DIAMETER => {
            let factor = libm::cbrt(world.matrix3.determinant().abs());
            v.iter_mut().for_each(|width| *width *= factor);
        }
        _ => {}
    }
}
