//! Frames as plain particles in memory: those of other formats, and native frames that cannot be traced in place.

use std::borrow::Cow;
use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use spherule_formats::order::index_u32;
use spherule_formats::{Attribute, AttributeData, Radius};

use super::SharedFrame;
use super::grains::{FrameGrains, grains_of};
use super::load_error::{LoadError, missing, missing_value};
use super::setup::{ColorRule, OpacityRule, Setup};
use super::styles::StyleRanges;
use crate::scene::material::DEFAULT_COLOR;
use crate::scene::{Camera, ColorMap, RgbEncoding};
use crate::survey::{id_of, part_of, velocity_of};
use spherule_frame::values::{Context, Value};

mod radii;

use radii::{FrameRadii, radii, radii_of};

/// A frame in memory, before the tree is built.
#[derive(Debug)]
pub struct DecodedFrame<'a> {
    /// Centres relative to the origin. Those of a caller are copied only if they are changed.
    pub centers: Cow<'a, [Vec3]>,
    /// Radii.
    pub radius: Radius,
    /// Attributes for shading.
    pub shading: DecodedShading,
}

/// Attributes of particles for shading, in the order of the particles.
#[derive(Debug, Default)]
pub struct DecodedShading {
    /// Scalars for the colour map, one per particle. Empty with a constant colour, and in a frame without the
    /// attribute if that is optional.
    pub values: Vec<f32>,
    /// Colours from an attribute, linear RGB; empty without one.
    pub colors: Vec<Vec3>,
    /// Scalars that opacities follow from; empty if all particles have the same.
    pub opacities: Vec<f32>,
    /// Values for the `id` channel; None if the index of the particle is used.
    pub ids: Option<Vec<u32>>,
    /// Velocities for the channels `V` and `motion`, and for motion blur until the tree is built.
    pub velocities: Option<Vec<Vec3>>,
    /// The attribute that divides particles into parts, and their parts, for Cryptomatte.
    pub parts: Option<(String, Vec<i32>)>,
    /// The floats of attribute channels, one plane for each.
    pub attributes: Vec<Vec<f32>>,
    /// Which particles have which style.
    pub(super) ranges: StyleRanges,
    /// Shapes of the grains of styles, until these are built.
    pub(super) grains: Vec<FrameGrains>,
}

impl<'a> DecodedFrame<'a> {
    /// Extracts from `frame`, which was read from `file` and has this `number`, what `setup` needs. Also returns the
    /// number of radii that were raised.
    pub(super) fn of(
        setup: &Setup,
        (frame, ranges): (SharedFrame<'a>, StyleRanges),
        number: i64,
        file: &str,
        notes: &mut Vec<String>,
    ) -> Result<(Self, u64), LoadError> {
        // Extract radii and colours
        let FrameRadii { radius, raised, unknown } = radii(setup, &frame, &ranges, file)?;
        if unknown > 0 {
            notes.push(format!(
                "frame {number}: {unknown} particles have no element with a known radius; they are drawn with a \
                 radius of 1 angstrom"
            ));
        }
        let looks = styled_values(setup, (&frame, &ranges), (number, file), &radius)?;
        // Extract ids and velocities for the channels
        let ids = if setup.picture.needs_ids() { ids(&frame) } else { None };
        let velocities = velocities_of(setup, &frame, file)?;
        let has_parts = setup.picture.render.channels.needs_parts();
        let parts = part_of(&frame.attributes).filter(|_| has_parts).and_then(parts);
        // Extract the planes of attribute channels
        let mut planes = Vec::new();
        for channel in &setup.picture.files.attributes {
            let found = attribute(&frame, &channel.name, "a channel", file)?;
            planes.extend((0..channel.components).map(|c| component(found, c)));
        }
        let grains = grains_of(setup, (&frame, &ranges), (number, file), notes)?;
        let decoded = Self {
            centers: frame.positions,
            radius,
            shading: DecodedShading {
                ids,
                velocities,
                parts,
                attributes: planes,
                grains,
                ranges,
                ..looks
            },
        };
        Ok((decoded, raised))
    }
}

/// What the colours and opacities of the particles of `frame` follow from, by the rules of their styles.
fn styled_values(
    setup: &Setup,
    (frame, ranges): (&SharedFrame<'_>, &StyleRanges),
    (number, file): (i64, &str),
    radius: &Radius,
) -> Result<DecodedShading, LoadError> {
    let mut found = DecodedShading::default();
    let count = frame.len();
    for (index, style) in setup.picture.particles.styles.iter().enumerate() {
        let range = ranges.of(index);
        let particles = (frame, range.clone());
        let (values, colors) =
            color_values(setup, particles.clone(), (number, file), radius, &style.color)?;
        fill(&mut found.values, count, range.start, values, f32::NAN);
        fill(&mut found.colors, count, range.start, colors, DEFAULT_COLOR);
        let opacities = opacities_of(setup, particles, (number, file), radius, &style.opacity)?;
        fill(&mut found.opacities, count, range.start, opacities, f32::NAN);
    }
    Ok(found)
}

/// Stores `part`, if it is not empty, in `all` from index `first` on; `all` then has `count` items, and `other` where
/// nothing is stored.
fn fill<T: Copy>(all: &mut Vec<T>, count: usize, first: usize, part: Vec<T>, other: T) {
    if part.len() == count {
        *all = part;
    } else if !part.is_empty() {
        all.resize(count, other);
        all[first..first + part.len()].copy_from_slice(&part);
    }
}

/// The scalars that the opacities of some particles of a frame follow from; empty if all have the same.
fn opacities_of(
    setup: &Setup,
    (frame, range): (&SharedFrame<'_>, Range<usize>),
    (number, file): (i64, &str),
    radius: &Radius,
    rule: &OpacityRule,
) -> Result<Vec<f32>, LoadError> {
    let OpacityRule::Value { name, .. } = rule else {
        return Ok(Vec::new());
    };
    if range.is_empty() {
        return Ok(Vec::new());
    }
    let value = Value::named(name, &frame.attributes)
        .ok_or_else(|| missing_value(name, "opacity", file, &frame.attributes))?;
    Ok(values_of(setup, (frame, range), number, radius, &value))
}

/// The velocities, if channels, motion blur or whitewater need them.
fn velocities_of(
    setup: &Setup,
    frame: &SharedFrame<'_>,
    file: &str,
) -> Result<Option<Vec<Vec3>>, LoadError> {
    let shutter = setup.picture.view.shutter.as_ref();
    let is_moved = shutter.is_some_and(|shutter| shutter.has_velocities);
    let is_mixed = setup.picture.surface.whitewater;
    let velocities = if setup.picture.render.channels.needs_velocities() || is_moved || is_mixed {
        velocity_of(&frame.attributes).map(vectors)
    } else {
        None
    };
    if is_moved && velocities.is_none() && !frame.is_empty() {
        let has = frame.attributes.iter().map(|a| a.name.as_str());
        let purpose = "motion blur, which camera.shutter = 0 turns off";
        return Err(missing("velocity", purpose, file, has));
    }
    if is_mixed && velocities.is_none() && !frame.is_empty() {
        let has = frame.attributes.iter().map(|a| a.name.as_str());
        return Err(missing("velocity", "surface.whitewater", file, has));
    }
    Ok(velocities)
}

impl DecodedFrame<'_> {
    /// Moves the particles `chosen` (ascending indices) behind all others; the order is otherwise unchanged. Returns
    /// the number of particles before them. If `ids` are needed, particles without an id get their position in the
    /// file as one.
    pub(super) fn move_to_end(&mut self, chosen: &[u32], ids: bool) -> usize {
        // Give particles ids before their order changes
        let count = self.centers.len();
        let shading = &mut self.shading;
        let all = count.max(shading.ranges.count());
        if ids && shading.ids.is_none() && !chosen.is_empty() {
            shading.ids = Some((0..index_u32(all)).collect());
        }
        // Move everything that there is one of for each particle; those of other styles stay behind them
        if !chosen.is_empty() {
            move_to_end(self.centers.to_mut(), chosen);
        }
        if let Radius::PerParticle(radii) = &mut self.radius {
            move_to_end(radii, chosen);
        }
        move_to_end(first(&mut shading.values, count), chosen);
        move_to_end(first(&mut shading.colors, count), chosen);
        move_to_end(first(&mut shading.opacities, count), chosen);
        if let Some(ids) = &mut shading.ids {
            move_to_end(first(ids, count), chosen);
        }
        if let Some(velocities) = &mut shading.velocities {
            move_to_end(first(velocities, count), chosen);
        }
        if let Some((_, parts)) = &mut shading.parts {
            move_to_end(first(parts, count), chosen);
        }
        for plane in &mut shading.attributes {
            move_to_end(first(plane, count), chosen);
        }
        count - chosen.len()
    }
}

/// The colours of particles by a rule.
pub(super) enum RuledColors<'a> {
    Constant(Vec3),
    Own(Vec<Vec3>),
    Mapped(Vec<f32>, &'a ColorMap),
}

impl RuledColors<'_> {
    /// The colour of a particle, linear RGB.
    pub(super) fn get(&self, particle: usize) -> Vec3 {
        match self {
            Self::Constant(color) => *color,
            Self::Own(colors) => colors[particle],
            Self::Mapped(values, map) => map.color(values[particle]),
        }
    }
}

/// The colours of the particles of `frame` by `rule`; see [`DecodedFrame::of`] for the rest.
pub(super) fn colors_by<'a>(
    setup: &Setup,
    frame: &SharedFrame<'_>,
    (number, file): (i64, &str),
    rule: &'a ColorRule,
) -> Result<RuledColors<'a>, LoadError> {
    if let ColorRule::Constant(color) = rule {
        return Ok(RuledColors::Constant(*color));
    }
    let all = 0..frame.len();
    let radius_rule = (&setup.picture.particles.first().radius, 1.0);
    let radius = radii_of(setup, radius_rule, frame, all.clone(), file)?.radius;
    let (values, colors) = color_values(setup, (frame, all), (number, file), &radius, rule)?;
    Ok(match rule {
        ColorRule::Attribute { map, .. } if !values.is_empty() => RuledColors::Mapped(values, map),
        _ if !colors.is_empty() => RuledColors::Own(colors),
        _ => RuledColors::Constant(DEFAULT_COLOR),
    })
}

/// The scalars for a colour map, or the colours, that `rule` takes from some particles of a frame. One of them is empty;
/// both are with a constant colour, or without an attribute that is optional.
fn color_values(
    setup: &Setup,
    (frame, range): (&SharedFrame<'_>, Range<usize>),
    (number, file): (i64, &str),
    radius: &Radius,
    rule: &ColorRule,
) -> Result<(Vec<f32>, Vec<Vec3>), LoadError> {
    // Look up colours, or scalars for the map
    Ok(match rule {
        ColorRule::Constant(_) => (Vec::new(), Vec::new()),
        ColorRule::Rgb { name, required } => {
            let found = if *required {
                attribute(frame, name, "colour", file)?
            } else {
                frame.attribute(name)
            };
            (Vec::new(), found.map(|found| colors_of(found, range)).unwrap_or_default())
        }
        ColorRule::Attribute { name, required, .. } => {
            let found = Value::named(name, &frame.attributes);
            if found.is_none() && *required && !range.is_empty() {
                return Err(missing_value(name, "colour", file, &frame.attributes));
            }
            let values =
                found.map(|value| values_of(setup, (frame, range), number, radius, &value));
            (values.unwrap_or_default(), Vec::new())
        }
    })
}

/// The first `count` items, or all if there are fewer.
fn first<T>(items: &mut [T], count: usize) -> &mut [T] {
    let count = count.min(items.len());
    &mut items[..count]
}

/// Moves the items with the indices `chosen` behind all others.
fn move_to_end<T: Copy>(items: &mut [T], chosen: &[u32]) {
    if items.is_empty() {
        return;
    }
    let last: Vec<T> = chosen.iter().map(|i| items[*i as usize]).collect();
    let mut chosen = chosen.iter().map(|i| *i as usize).peekable();
    let mut kept = 0;
    for i in 0..items.len() {
        if chosen.next_if_eq(&i).is_none() {
            items[kept] = items[i];
            kept += 1;
        }
    }
    items[kept..].copy_from_slice(&last);
}

impl DecodedShading {
    /// Whether particles have individual colours.
    pub fn has_colors(&self) -> bool {
        !self.values.is_empty() || !self.colors.is_empty()
    }

    /// Memory in bytes.
    pub fn byte_len(&self) -> u64 {
        let ids = self.ids.as_deref().unwrap_or_default();
        let velocities = self.velocities.as_deref().unwrap_or_default();
        let colors = size_of_val(&self.values[..]) + size_of_val(&self.colors[..]);
        let opacities = size_of_val(&self.opacities[..]);
        let parts = self.parts.as_ref().map_or(0, |(_, parts)| size_of_val(&parts[..]));
        let attributes = self.attributes.iter().map(|plane| size_of_val(&plane[..]));
        let channels = size_of_val(ids) + size_of_val(velocities) + parts;
        (colors + opacities + channels + attributes.sum::<usize>()) as u64
    }
}

/// The attribute `name`; None in a frame without particles, which need not have any attributes.
fn attribute<'a>(
    frame: &'a SharedFrame<'_>,
    name: &str,
    purpose: &'static str,
    file: &str,
) -> Result<Option<&'a Attribute>, LoadError> {
    let found = frame.attribute(name);
    if found.is_none() && !frame.is_empty() {
        let has = frame.attributes.iter().map(|a| a.name.as_str());
        return Err(missing(name, purpose, file, has));
    }
    Ok(found)
}

#[expect(clippy::cast_possible_truncation, reason = "colours need no more than f32")]
fn magnitudes(attribute: &Attribute, range: Range<usize>, scale: f64) -> Vec<f32> {
    range.into_par_iter().map(|i| (attribute.magnitude(i) * scale) as f32).collect()
}

/// The values that colour the particles in a range of frame `number`.
#[expect(clippy::cast_possible_truncation, reason = "colours need no more than f32")]
fn values_of(
    setup: &Setup,
    (frame, range): (&SharedFrame<'_>, Range<usize>),
    number: i64,
    radius: &Radius,
    value: &Value,
) -> Vec<f32> {
    let Some(value) = value.bind(|name| frame.attribute(name)) else {
        return Vec::new();
    };
    // The view is checked in advance
    let is_depth = matches!(value, Value::Depth);
    let camera = if is_depth { setup.camera_at(number).ok() } else { None };
    let context = DrawnContext { setup, frame, radius, camera };
    let particles = range.into_par_iter();
    particles.map(|i| value.get(i, &context) as f32).collect()
}

/// The particles that are drawn.
struct DrawnContext<'a, 'f> {
    setup: &'a Setup,
    frame: &'a SharedFrame<'f>,
    radius: &'a Radius,
    camera: Option<Camera>,
}

impl Context for DrawnContext<'_, '_> {
    fn position(&self, particle: usize) -> DVec3 {
        self.setup.picture.origin + self.frame.positions[particle].as_dvec3()
    }

    fn file_index(&self, particle: usize) -> usize {
        let indices = self.frame.file_index.as_ref();
        indices.map_or(particle, |indices| indices[particle] as usize)
    }

    fn radius(&self, particle: usize) -> f64 {
        match self.radius {
            Radius::Common(radius) => (*radius).into(),
            Radius::PerParticle(radii) => radii[particle].into(),
        }
    }

    fn depth(&self, particle: usize) -> f64 {
        let depth = |camera: &Camera| camera.depth_of(self.frame.positions[particle]).into();
        self.camera.as_ref().map_or(f64::NAN, depth)
    }

    fn up(&self) -> DVec3 {
        self.setup.picture.view.up
    }

    fn time(&self) -> f64 {
        self.frame.time.unwrap_or(f64::NAN)
    }
}

/// The colours in `range` of `attribute`; missing components are 0.
fn colors_of(attribute: &Attribute, range: Range<usize>) -> Vec<Vec3> {
    let encoding = RgbEncoding::of(attribute.data.scalar_type());
    let components = attribute.components;
    let value = |i: usize, c: usize| {
        if c < components { attribute.data.get_f64(i * components + c) } else { 0.0 }
    };
    range.into_par_iter().map(|i| encoding.color([value(i, 0), value(i, 1), value(i, 2)])).collect()
}

#[expect(clippy::cast_possible_truncation, reason = "the channel is f32")]
fn vectors(attribute: &Attribute) -> Vec<Vec3> {
    let value = |i: usize| attribute.data.get_f64(i) as f32;
    (0..attribute.count())
        .into_par_iter()
        .map(|i| Vec3::new(value(3 * i), value(3 * i + 1), value(3 * i + 2)))
        .collect()
}

/// Component `c` of an attribute; nothing in a frame without particles, and zeros if there is no such component.
#[expect(clippy::cast_possible_truncation, reason = "the channel is f32")]
fn component(attribute: Option<&Attribute>, c: usize) -> Vec<f32> {
    let Some(attribute) = attribute else {
        return Vec::new();
    };
    let components = attribute.components;
    let value = |i: usize| {
        if c < components { attribute.data.get_f64(i * components + c) as f32 } else { 0.0 }
    };
    (0..attribute.count()).into_par_iter().map(value).collect()
}

/// The ids of the particles, or their positions in the file if particles between them were dropped.
pub(super) fn ids(frame: &SharedFrame<'_>) -> Option<Vec<u32>> {
    let ids = id_of(&frame.attributes).and_then(|ids| low_bits(&ids.data));
    ids.or_else(|| frame.file_index.clone())
}

/// The name of an attribute with parts, and the parts.
fn parts(attribute: &Attribute) -> Option<(String, Vec<i32>)> {
    let parts = low_bits(&attribute.data)?.into_iter().map(u32::cast_signed).collect();
    Some((attribute.name.clone(), parts))
}

/// The low 32 bits of integers; None if the values are no integers.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the channel has 32 bits; larger ids keep their low ones"
)]
fn low_bits(data: &AttributeData) -> Option<Vec<u32>> {
    Some(match data {
        AttributeData::U32(v) => v.clone(),
        AttributeData::I32(v) => v.iter().map(|id| id.cast_unsigned()).collect(),
        AttributeData::U64(v) => v.iter().map(|id| *id as u32).collect(),
        AttributeData::I64(v) => v.iter().map(|id| *id as u32).collect(),
        AttributeData::U16(v) => v.iter().map(|id| u32::from(*id)).collect(),
        AttributeData::I16(v) => v.iter().map(|id| i32::from(*id).cast_unsigned()).collect(),
        AttributeData::U8(v) => v.iter().map(|id| u32::from(*id)).collect(),
        AttributeData::I8(v) => v.iter().map(|id| i32::from(*id).cast_unsigned()).collect(),
        _ => return None,
    })
}

/// The index of the particle that has `id` in the `id` channel.
pub(super) fn particle_with_id(frame: &SharedFrame<'_>, id: u32) -> Option<usize> {
    match ids(frame) {
        Some(ids) => ids.iter().position(|other| *other == id),
        None => usize::try_from(id).ok().filter(|index| *index < frame.positions.len()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chosen_particles_come_last_with_all_that_is_theirs() {
        let mut frame = DecodedFrame {
            centers: (0..6_u16).map(|i| Vec3::splat(f32::from(i))).collect(),
            radius: Radius::PerParticle((0..6_u16).map(f32::from).collect()),
            shading: DecodedShading {
                values: (0..6_u16).map(f32::from).collect(),
                colors: (0..6_u16).map(|i| Vec3::splat(f32::from(i))).collect(),
                parts: Some(("part".to_owned(), (0..6).collect())),
                attributes: vec![(0..6_u16).map(f32::from).collect()],
                ranges: StyleRanges::whole(6),
                ..DecodedShading::default()
            },
        };
        assert_eq!(frame.move_to_end(&[], true), 6);
        assert_eq!(frame.shading.ids, None);
        assert_eq!(frame.move_to_end(&[0, 3, 5], true), 3);
        let order = [1.0, 2.0, 4.0, 0.0, 3.0, 5.0];
        assert_eq!(frame.centers[..], order.map(Vec3::splat));
        assert_eq!(frame.radius, Radius::PerParticle(order.to_vec()));
        assert_eq!(frame.shading.values, order);
        assert_eq!(frame.shading.colors, order.map(Vec3::splat));
        assert_eq!(frame.shading.ids, Some(vec![1, 2, 4, 0, 3, 5]));
        assert_eq!(frame.shading.parts.as_ref().unwrap().1, [1, 2, 4, 0, 3, 5]);
        assert_eq!(frame.shading.attributes, [order]);
        assert_eq!(frame.move_to_end(&[0, 1, 2, 3, 4, 5], false), 0);
    }
}
