//! Which particles of a frame have which style.

use std::borrow::Cow;
use std::ops::Range;

use glam::Vec3;
use spherule_formats::{ParticleFrame, Radius, RawParticles};

use super::SharedFrame;
use super::load_error::{LoadError, unknown_name};
use super::setup::{ParticleRules, Setup, StyleForm};
use crate::scene::{Material, Owner};
use crate::selection::Divided;
use crate::surface::SurfaceKind;
use crate::survey::PART_NAMES;

/// The particles of the styles of a frame.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct StyleRanges {
    /// Number of particles up to the end of each.
    ends: Vec<usize>,
}

impl StyleRanges {
    /// The ranges of a frame with so many particles of one kind.
    pub(super) fn whole(particles: usize) -> Self {
        Self { ends: vec![particles] }
    }

    /// Number of all particles.
    pub(super) fn count(&self) -> usize {
        self.ends.last().copied().unwrap_or(0)
    }

    /// The particles of the style with this index.
    pub(super) fn of(&self, style: usize) -> Range<usize> {
        let start = if style == 0 { 0 } else { self.ends[style - 1] };
        start..self.ends[style]
    }
}

impl ParticleRules {
    /// Number of styles, the first ones, whose spheres are in one tree.
    pub(super) fn styles_in_tree(&self, setup: &Setup) -> usize {
        let is_opaque = setup.picture.scene.particle_material().transmission == 0.0;
        if is_opaque && setup.picture.surface.kind == SurfaceKind::Spheres {
            self.sphere_styles()
        } else {
            1
        }
    }

    /// Number of styles, the first ones, that are drawn as spheres, apart from the first, which may be a body.
    pub(super) fn sphere_styles(&self) -> usize {
        1 + self.others().partition_point(|style| matches!(style.form, StyleForm::Spheres))
    }
}

/// The particles of `particles` that are drawn, in the order of their styles.
pub(super) fn in_order_of_styles(
    setup: &Setup,
    particles: RawParticles,
    survivors: &[u32],
    file: &str,
) -> Result<(SharedFrame<'static>, StyleRanges), LoadError> {
    let rules = &setup.picture.particles;
    let Divided { order, ends } = rules
        .division
        .divide(&particles, survivors)
        .map_err(|e| unknown_name(&e, (key_of(setup, &e.name), file), &particles.attributes))?;
    let count = particles.positions.len();
    let frame = ParticleFrame::from_selected(particles, order.clone(), setup.picture.origin);
    // Particles that are not finite are gone; the others have kept their order
    let ends = match &frame.file_index {
        Some(kept) if frame.dropped > 0 => {
            let mut places = vec![0; count];
            for (place, index) in order.iter().enumerate() {
                places[*index as usize] = place;
            }
            let end = |end: &usize| kept.partition_point(|index| places[*index as usize] < *end);
            ends.iter().map(end).collect()
        }
        _ => ends,
    };
    Ok((frame.with_positions(Cow::Owned), StyleRanges { ends }))
}

/// The key of the condition that has a value of this name.
fn key_of(setup: &Setup, name: &str) -> &'static str {
    let is_part = |material: &Material| matches!(material.owner, Owner::Part(_));
    if name == PART_NAMES[0] && setup.picture.scene.materials.iter().any(is_part) {
        "material.part"
    } else {
        "style.where"
    }
}

/// What a style draws of its particles.
#[derive(Debug)]
pub(super) struct StyleParticles {
    /// The style.
    pub(super) style: usize,
    /// Index in the frame of the first particle.
    pub(super) first: u32,
    /// Centres relative to the origin.
    pub(super) centers: Vec<Vec3>,
    /// Radii.
    pub(super) radius: Radius,
}

impl StyleParticles {
    /// Takes the particles from index `first` on away from `centers` and `radius`.
    pub(super) fn split_off(
        (style, first): (usize, usize),
        centers: &mut Cow<'_, [Vec3]>,
        radius: &mut Radius,
    ) -> Self {
        Self {
            style,
            first: u32::try_from(first).unwrap_or(u32::MAX),
            centers: centers.to_mut().split_off(first),
            radius: match radius {
                Radius::Common(radius) => Radius::Common(*radius),
                Radius::PerParticle(radii) => Radius::PerParticle(radii.split_off(first)),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn styles_take_their_particles_from_the_end() {
        let ranges = StyleRanges { ends: vec![2, 5, 5, 6] };
        assert_eq!([0, 1, 2, 3].map(|style| ranges.of(style)), [0..2, 2..5, 5..5, 5..6]);
        let mut centers: Cow<'_, [Vec3]> = (0..6_u16).map(|i| Vec3::splat(f32::from(i))).collect();
        let mut radius = Radius::PerParticle((0..6_u16).map(f32::from).collect());
        let last = StyleParticles::split_off((3, 5), &mut centers, &mut radius);
        assert_eq!((last.first, &last.centers[..]), (5, &[Vec3::splat(5.0)][..]));
        assert_eq!(last.radius, Radius::PerParticle(vec![5.0]));
        assert_eq!(centers.len(), 5);
    }
}
