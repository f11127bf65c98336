//! Evaluates the field at a point, directly from the particles.

use glam::Vec3;

use super::FieldParticles;
use super::kernel::{slope, weight};

/// The colour field at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sample {
    /// `phi`.
    pub(crate) value: f32,
    /// Its gradient, which points inward at a surface.
    pub(crate) gradient: Vec3,
}

impl FieldParticles {
    /// Calls `each` for all particles within the support of `point`, with index in the order of the bins, squared
    /// distance and offset from `point`.
    #[inline]
    fn around(&self, point: Vec3, mut each: impl FnMut(usize, f32, Vec3)) {
        let [x, y, z] = self.bins.cell_of(point);
        let limit = self.support() * self.support();
        for z in z.saturating_sub(1)..=z.saturating_add(1) {
            for y in y.saturating_sub(1)..=y.saturating_add(1) {
                // Visit the neighbouring bins of the row
                let run = self.bins.run(z, y, x.saturating_sub(1)..x.saturating_add(2));
                for place in self.bins.particles_in(run) {
                    let offset = self.bins.points()[place] - point;
                    let squared = offset.length_squared();
                    if squared < limit {
                        each(place, squared, offset);
                    }
                }
            }
        }
    }

    /// Calls `each` with the index in the frame and the offset from `point` of all particles within the support, in the
    /// order of the bins. Requires indices.
    pub fn each_offset(&self, point: Vec3, mut each: impl FnMut(u32, Vec3)) {
        self.around(point, |place, _, offset| {
            each(self.bins.indices()[place], offset);
        });
    }

    /// The field at `point`. Particles without a computed volume do not contribute.
    pub(crate) fn sample(&self, point: Vec3) -> Sample {
        let inverse = 1.0 / self.support();
        let (mut value, mut gradient) = (0.0, Vec3::ZERO);
        self.around(point, |place, squared, offset| {
            let distance = squared.sqrt();
            let q = distance * inverse;
            let volume = self.volumes[place];
            value += volume * weight(q);
            if distance > 0.0 {
                gradient -= (volume * slope(q) * inverse / distance) * offset;
            }
        });
        Sample { value, gradient }
    }

    /// Index in the frame of the particle nearest to `point`, if any is within the support. Ties in distance go to
    /// the lower index.
    pub fn nearest(&self, point: Vec3) -> Option<u32> {
        self.nearest_of(point, u32::MAX)
    }

    /// The same among the first `count` particles.
    pub fn nearest_of(&self, point: Vec3, count: u32) -> Option<u32> {
        let mut best: Option<(f32, u32)> = None;
        self.around(point, |place, squared, _| {
            let found = (squared, self.bins.indices()[place]);
            if found.1 < count && best.is_none_or(|best| found < best) {
                best = Some(found);
            }
        });
        best.map(|(_, index)| index)
    }

    /// Calls `each` with the index in the frame and the contribution to the field at `point` of all particles within
    /// the support.
    pub fn neighbours(&self, point: Vec3, each: &mut dyn FnMut(u32, f32)) {
        let inverse = 1.0 / self.support();
        self.around(point, |place, squared, _| {
            let part = self.volumes[place] * weight(squared.sqrt() * inverse);
            if part > 0.0 {
                each(self.bins.indices()[place], part);
            }
        });
    }
}
