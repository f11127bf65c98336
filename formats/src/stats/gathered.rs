//! Statistics of particles that come in blocks.

use glam::DVec3;
use rayon::prelude::*;

use super::sums::{FloatSum, Sum};
use super::{AttributeStats, FrameStats};
use crate::{Attribute, FARTHEST, Positions, Radius, ScalarType, is_near};
use spherule_frame::find_radius;

/// The sums over the particles so far.
pub(super) struct Gathered {
    count: u64,
    dropped: u64,
    radius: Option<(f32, f32)>,
    axes: [FloatSum; 3],
    attributes: Vec<(String, ScalarType, Vec<Sum>)>,
}

impl Gathered {
    /// No particles yet. Attributes are given by name, type and number of components.
    pub(super) fn of(shapes: impl Iterator<Item = (String, ScalarType, usize)>) -> Self {
        let attributes = shapes.map(|(name, scalar, components)| {
            let is_float = matches!(scalar, ScalarType::F32 | ScalarType::F64);
            (name, scalar, vec![Sum::new(is_float); components])
        });
        Self {
            count: 0,
            dropped: 0,
            radius: None,
            axes: [const { FloatSum::new() }; 3],
            attributes: attributes.collect(),
        }
    }

    /// Adds particles. If others follow, they must be whole pieces.
    pub(super) fn add(&mut self, positions: &Positions, attributes: &[Attribute]) {
        let keep = near(positions);
        let count = keep.iter().filter(|k| **k).count();
        self.count += count as u64;
        self.dropped += (keep.len() - count) as u64;
        for (axis, sum) in self.axes.iter_mut().enumerate() {
            sum.add_axis(positions, &keep, axis);
        }
        for ((_, _, components), attribute) in self.attributes.iter_mut().zip(attributes) {
            for (component, sum) in components.iter_mut().enumerate() {
                sum.add(attribute, component, &keep);
            }
        }
        let ranges = [self.radius, radius_range(attributes, &keep)].into_iter().flatten();
        self.radius = ranges.reduce(|(a, b), (c, d)| (a.min(c), b.max(d)));
    }

    /// The statistics of all particles.
    pub(super) fn finish(self) -> FrameStats {
        let axes = &self.axes;
        let vector =
            |value: fn(&FloatSum) -> f64| DVec3::from_array([0, 1, 2].map(|a| value(&axes[a])));
        let some = self.count > 0;
        let stats = |(name, scalar_type, components): &(String, ScalarType, Vec<Sum>)| {
            let components = components.iter().map(Sum::stats).collect();
            AttributeStats { name: name.clone(), scalar_type: *scalar_type, components }
        };
        FrameStats {
            count: self.count,
            dropped: self.dropped,
            radius: self.radius,
            bounds: some.then(|| (vector(|a| a.min), vector(|a| a.max))),
            mean: some.then(|| vector(FloatSum::mean)),
            attributes: self.attributes.iter().map(stats).collect(),
        }
    }
}

/// Which positions are those of particles that are drawn.
fn near(positions: &Positions) -> Vec<bool> {
    let farthest = DVec3::splat(FARTHEST.into());
    match positions {
        Positions::F32(v) => v.par_iter().map(is_near).collect(),
        Positions::F64(v) => v.par_iter().map(|p| p.abs().cmple(farthest).all()).collect(),
    }
}

/// The radii that the renderer uses, of the particles that it keeps.
fn radius_range(attributes: &[Attribute], keep: &[bool]) -> Option<(f32, f32)> {
    match find_radius(attributes)? {
        Radius::Common(radius) => Some((radius, radius)),
        Radius::PerParticle(radii) => {
            let kept = radii.iter().zip(keep).filter(|(_, k)| **k);
            kept.map(|(radius, _)| *radius).fold(None, |range: Option<(f32, f32)>, r| match range {
                Some((min, max)) => Some((min.min(r), max.max(r))),
                None => Some((r, r)),
            })
        }
    }
}
