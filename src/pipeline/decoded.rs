//! A frame as plain particles: what foreign files become, and native frames that cannot be traced as they
//! are.

use glam::Vec3;
use rayon::prelude::*;
use spherule_formats::order::index_u32;
use spherule_formats::{Attribute, AttributeData, ParticleFrame, Radius, is_radius};

use super::load_error::{LoadError, missing};
use super::setup::{ColorRule, RadiusRule, Setup};
use crate::scene::RgbEncoding;
use crate::survey::{id_of, velocity_of};

/// A frame in memory, ready for the tree.
#[derive(Debug)]
pub struct DecodedFrame {
    /// Centres relative to the origin.
    pub centers: Vec<Vec3>,
    /// Radii.
    pub radius: Radius,
    /// What shading needs.
    pub shading: DecodedShading,
}

/// What shading needs of particles, in their order.
#[derive(Debug, Default)]
pub struct DecodedShading {
    /// Numbers for the colour map, one a particle; empty with a constant colour, and in a frame
    /// that lacks an attribute which nobody asked for.
    pub values: Vec<f32>,
    /// Colours that the particles bring, linear RGB; empty where they are not asked for.
    pub colors: Vec<Vec3>,
    /// Numbers for the `id` channel; None if the particle's index serves.
    pub ids: Option<Vec<u32>>,
    /// Velocities for the `V` channel.
    pub velocities: Option<Vec<Vec3>>,
}

impl DecodedFrame {
    /// Takes of `frame`, which was read from `file`, what `setup` asks for; tells how many radii were
    /// raised.
    pub(super) fn of(
        setup: &Setup,
        frame: ParticleFrame,
        file: &str,
    ) -> Result<(Self, u64), LoadError> {
        let (radius, clamped) = radii(setup, &frame, file)?;
        let colored_by = match &setup.picture.color {
            ColorRule::Constant(_) => None,
            ColorRule::Attribute { name, required, .. } | ColorRule::Rgb { name, required } => {
                match *required {
                    true => attribute(&frame, name, "colour", file)?,
                    false => frame.attribute(name),
                }
            }
        };
        let (values, colors) = match (&setup.picture.color, colored_by) {
            (ColorRule::Attribute { .. }, Some(by)) => (magnitudes(by, 1.0), Vec::new()),
            (ColorRule::Rgb { .. }, Some(by)) => (Vec::new(), colors(by)),
            _ => (Vec::new(), Vec::new()),
        };
        let channels = setup.picture.render.channels;
        let ids = if channels.id { ids(&frame) } else { None };
        let velocities = if channels.velocity {
            velocity_of(&frame.attributes).map(vectors)
        } else {
            None
        };
        let decoded = Self {
            centers: frame.positions,
            radius,
            shading: DecodedShading {
                values,
                colors,
                ids,
                velocities,
            },
        };
        Ok((decoded, clamped))
    }
}

impl DecodedFrame {
    /// Moves the particles `chosen`, indices in order, behind all others; the order is the same otherwise.
    /// Returns how many come before them. Who has no id keeps its place in the file as one if `ids` are asked
    /// for.
    pub(super) fn put_last(&mut self, chosen: &[u32], ids: bool) -> usize {
        let count = self.centers.len();
        let shading = &mut self.shading;
        if ids && shading.ids.is_none() && !chosen.is_empty() {
            shading.ids = Some((0..index_u32(count)).collect());
        }
        put_last(&mut self.centers, chosen);
        if let Radius::PerParticle(radii) = &mut self.radius {
            put_last(radii, chosen);
        }
        put_last(&mut shading.values, chosen);
        put_last(&mut shading.colors, chosen);
        if let Some(ids) = &mut shading.ids {
            put_last(ids, chosen);
        }
        if let Some(velocities) = &mut shading.velocities {
            put_last(velocities, chosen);
        }
        count - chosen.len()
    }
}

/// Moves the items with the indices `chosen` behind all others, if there are any.
fn put_last<T: Copy>(items: &mut [T], chosen: &[u32]) {
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
    /// Whether particles have colours of their own.
    pub fn has_colors(&self) -> bool {
        !self.values.is_empty() || !self.colors.is_empty()
    }

    /// Bytes of all of it.
    pub fn byte_len(&self) -> u64 {
        let ids = self.ids.as_deref().unwrap_or_default();
        let velocities = self.velocities.as_deref().unwrap_or_default();
        let colors = size_of_val(&self.values[..]) + size_of_val(&self.colors[..]);
        (colors + size_of_val(ids) + size_of_val(velocities)) as u64
    }
}

/// The attribute `name`; None in a frame without particles, which need not declare any.
fn attribute<'a>(
    frame: &'a ParticleFrame,
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

/// The radii of a frame and how many had to be raised.
fn radii(setup: &Setup, frame: &ParticleFrame, file: &str) -> Result<(Radius, u64), LoadError> {
    let mut radius = match &setup.picture.radius {
        RadiusRule::Common(radius) => Radius::Common(*radius),
        RadiusRule::FileOr(radius) => frame.radius.clone().unwrap_or(Radius::Common(*radius)),
        RadiusRule::Attribute { name, scale } => {
            match attribute(frame, name, "the radius", file)? {
                Some(attribute) => Radius::PerParticle(magnitudes(attribute, f64::from(*scale))),
                None => Radius::Common(setup.picture.least_radius),
            }
        }
    };
    if frame.is_empty() {
        return Ok((radius, 0));
    }
    let least = setup.picture.least_radius;
    let mut clamped = 0;
    let mut raise = |radius: &mut f32| {
        // Also true for NaN.
        if !(*radius >= least && is_radius(*radius)) {
            *radius = least;
            clamped += 1;
        }
    };
    match &mut radius {
        Radius::Common(radius) => raise(radius),
        Radius::PerParticle(radii) => radii.iter_mut().for_each(raise),
    }
    Ok((radius, clamped))
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "colours need no more than f32"
)]
fn magnitudes(attribute: &Attribute, scale: f64) -> Vec<f32> {
    (0..attribute.count())
        .into_par_iter()
        .map(|i| (attribute.magnitude(i) * scale) as f32)
        .collect()
}

/// The colours in `attribute`; black where it has fewer than three numbers a particle.
fn colors(attribute: &Attribute) -> Vec<Vec3> {
    let encoding = RgbEncoding::of(attribute.data.scalar_type());
    let components = attribute.components;
    let value = |i: usize, c: usize| match c < components {
        true => attribute.data.get_f64(i * components + c),
        false => 0.0,
    };
    (0..attribute.count())
        .into_par_iter()
        .map(|i| encoding.color([value(i, 0), value(i, 1), value(i, 2)]))
        .collect()
}

#[expect(clippy::cast_possible_truncation, reason = "the channel is f32")]
fn vectors(attribute: &Attribute) -> Vec<Vec3> {
    let value = |i: usize| attribute.data.get_f64(i) as f32;
    (0..attribute.count())
        .into_par_iter()
        .map(|i| Vec3::new(value(3 * i), value(3 * i + 1), value(3 * i + 2)))
        .collect()
}

/// The particles' ids, or the place in the file of particles that others were dropped between.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the channel has 32 bits; larger ids keep their low ones"
)]
fn ids(frame: &ParticleFrame) -> Option<Vec<u32>> {
    Some(match id_of(&frame.attributes).map(|a| &a.data) {
        Some(AttributeData::U32(v)) => v.clone(),
        Some(AttributeData::I32(v)) => v.iter().map(|id| id.cast_unsigned()).collect(),
        Some(AttributeData::U64(v)) => v.iter().map(|id| *id as u32).collect(),
        Some(AttributeData::I64(v)) => v.iter().map(|id| *id as u32).collect(),
        Some(AttributeData::U16(v)) => v.iter().map(|id| u32::from(*id)).collect(),
        Some(AttributeData::I16(v)) => v.iter().map(|id| i32::from(*id).cast_unsigned()).collect(),
        Some(AttributeData::U8(v)) => v.iter().map(|id| u32::from(*id)).collect(),
        Some(AttributeData::I8(v)) => v.iter().map(|id| i32::from(*id).cast_unsigned()).collect(),
        _ => return frame.file_index.clone(),
    })
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
                ids: None,
                velocities: None,
            },
        };
        assert_eq!(frame.put_last(&[], true), 6);
        assert_eq!(frame.shading.ids, None);
        assert_eq!(frame.put_last(&[0, 3, 5], true), 3);
        let order = [1.0, 2.0, 4.0, 0.0, 3.0, 5.0];
        assert_eq!(frame.centers, order.map(Vec3::splat));
        assert_eq!(frame.radius, Radius::PerParticle(order.to_vec()));
        assert_eq!(frame.shading.values, order);
        assert_eq!(frame.shading.colors, order.map(Vec3::splat));
        assert_eq!(frame.shading.ids, Some(vec![1, 2, 4, 0, 3, 5]));
        assert_eq!(frame.put_last(&[0, 1, 2, 3, 4, 5], false), 0);
    }
}
