//! What "auto" means for a sequence, settled once from a look at its frames: the origin, the box
//! that the camera frames, the particle radius, the range of the colour map.
//!
//! Percentiles rather than extremes, so that one escaped particle neither shrinks the picture nor
//! washes out the colours. The answer is kept with the job, so that all frames, runs and machines
//! agree.

use std::collections::BTreeSet;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use spherule_formats::sequence::{Loaded, Sequence};
use spherule_formats::{Attribute, FrameError, ParticleFrame, Positions, Radius, choose_origin};

use crate::scene::Bounds;

/// Frames looked at; evenly spread, first and last among them. All of a shorter sequence.
const FRAMES: usize = 24;
/// Particles of a frame that percentiles are taken from.
const SAMPLE: usize = 20_000;
/// Fewest particles of which one alone may count as escaped: of a handful each matters.
const ESCAPE_MIN: usize = 16;
/// Distances to the nearest neighbour that the radius is estimated from.
const NEIGHBOUR_QUERIES: usize = 512;
/// Distance computations that the estimate may cost: half a second for a frame of 1e7.
const NEIGHBOUR_BUDGET: usize = 1_000_000_000;
/// Names under which simulations write velocities.
const VELOCITY_NAMES: [&str; 6] = ["velocity", "velocities", "vel", "velo", "v", "U"];

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Survey {
    /// World position that all coordinates are relative to.
    pub origin: DVec3,
    /// Box of the bulk of the particles over the sequence, world units.
    pub min: DVec3,
    /// Its upper corner.
    pub max: DVec3,
    /// Radius for frames that do not bring their own: half the usual distance of neighbours.
    pub radius: Option<f32>,
    /// Whether the frames bring radii of their own.
    pub has_radii: bool,
    /// How far the spheres reach beyond their centres, as far as the frames tell: the 99th
    /// percentile of the radii of the frame with the largest; 0 where they bring none.
    pub reach: f32,
    /// The attribute that colours were asked for by, if any, with its range.
    pub color: Option<ColorRange>,
    /// Which way is up for users of this format, unit vector.
    pub up: DVec3,
    /// Names of all attributes seen.
    pub attributes: Vec<String>,
    /// Particles of the fullest frame looked at.
    pub most_particles: usize,
    /// Frames looked at.
    pub frames: usize,
    /// What the heaviest frame looked at takes in memory. Jobs of the first versions lack it.
    #[serde(default)]
    pub weight: Option<FrameWeight>,
}

/// Bytes and counts of a frame as it was read: what the need of others is told by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct FrameWeight {
    /// Particles, those included that are not finite.
    pub particles: u64,
    /// Bytes of its files, unpacked if by gzip.
    pub stored: u64,
    /// Bytes of the largest of its files, uncompressed.
    pub content: u64,
    /// Bytes of the numbers read from them.
    pub raw: u64,
    /// Bytes of the positions among them.
    pub positions: u64,
    /// Files.
    pub files: u64,
    /// Whether the file brings a radius for each particle.
    pub own_radii: bool,
    /// Whether it brings ids.
    pub ids: bool,
    /// Whether it brings velocities.
    pub velocities: bool,
}

/// An attribute and the range its colours span.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ColorRange {
    /// Name of the attribute.
    pub attribute: String,
    /// Value at the map's start.
    pub low: f64,
    /// Value at the map's end.
    pub high: f64,
}

/// What a job needs to know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Question<'a> {
    /// About colours.
    pub color: ColorQuestion<'a>,
    /// About radii.
    pub radius: RadiusQuestion<'a>,
}

/// What is asked about radii.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RadiusQuestion<'a> {
    /// Nothing: it is given.
    None,
    /// What the frames bring, or an estimate where they bring none.
    Auto,
    /// The largest values of an attribute times a factor.
    Attribute(&'a str, f64),
}

/// What is asked about colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColorQuestion<'a> {
    /// No attribute is needed.
    None,
    /// The velocity, if there is one.
    Speed,
    /// This attribute.
    Attribute(&'a str),
}

/// Running totals over the frames.
struct Totals {
    bounds: Option<(DVec3, DVec3)>,
    radius: Option<(usize, f32)>,
    has_radii: bool,
    reach: f32,
    range: Option<(f64, f64)>,
    color: Option<String>,
    velocity: Option<String>,
    attributes: BTreeSet<String>,
    most_particles: usize,
    frames: usize,
    weight: Option<FrameWeight>,
}

impl Survey {
    /// Looks at `sequence`. Frames that cannot be read are passed over here; they are reported when
    /// their turn comes.
    ///
    /// # Errors
    /// If none of the frames can be read, why the first one cannot.
    pub fn of(sequence: &Sequence, question: Question) -> Result<Self, FrameError> {
        Self::of_frames(sequence, spread(sequence.frames().len()), question)
    }

    /// Looks at the frames of `sequence` with these indices.
    ///
    /// # Errors
    /// As [`Self::of`].
    pub fn of_frames(
        sequence: &Sequence,
        indices: impl IntoIterator<Item = usize>,
        question: Question,
    ) -> Result<Self, FrameError> {
        let mut totals = Totals {
            bounds: None,
            radius: None,
            has_radii: false,
            reach: 0.0,
            range: None,
            color: None,
            velocity: None,
            attributes: BTreeSet::new(),
            most_particles: 0,
            frames: 0,
            weight: None,
        };
        let mut failure = None;
        for index in indices {
            match sequence.load_measured(index) {
                Ok(loaded) => {
                    let files = sequence.inputs(index).len() as u64;
                    totals.take_in(loaded, files, question);
                }
                Err(error) => {
                    failure.get_or_insert(error);
                }
            }
        }
        match failure {
            Some(error) if totals.frames == 0 => Err(error),
            _ => Ok(totals.finish(if sequence.is_y_up() {
                DVec3::Y
            } else {
                DVec3::Z
            })),
        }
    }

    /// The box as the scene takes it.
    pub fn bounds(&self) -> Bounds {
        Bounds {
            min: self.min,
            max: self.max,
        }
    }
}

/// The attribute of `frame` that holds velocities, if any does.
pub fn velocity_of(attributes: &[Attribute]) -> Option<&Attribute> {
    VELOCITY_NAMES.iter().find_map(|name| {
        attributes
            .iter()
            .find(|a| a.components == 3 && a.name.eq_ignore_ascii_case(name))
    })
}

/// Names under which simulations write ids, the usual one first: also numpy's plural and
/// DualSPHysics'.
const ID_NAMES: [&str; 3] = ["id", "ids", "Idp"];

/// The attribute that holds ids, if any does: exactly by name, or failing that without regard to
/// case.
pub fn id_of(attributes: &[Attribute]) -> Option<&Attribute> {
    ID_NAMES.iter().find_map(|name| {
        let exact = attributes.iter().find(|a| a.name == *name);
        let alike = || {
            attributes
                .iter()
                .find(|a| a.name.eq_ignore_ascii_case(name))
        };
        exact.or_else(alike).filter(|a| a.components == 1)
    })
}

/// Up to [`FRAMES`] indices below `count`, evenly spread.
fn spread(count: usize) -> Vec<usize> {
    if count <= FRAMES {
        return (0..count).collect();
    }
    (0..FRAMES)
        .map(|i| i * (count - 1) / (FRAMES - 1))
        .collect()
}

impl Totals {
    fn take_in(&mut self, loaded: Loaded, files: u64, question: Question) {
        self.frames += 1;
        let mut weight = FrameWeight::of(&loaded, files);
        let raw = loaded.particles;
        self.attributes
            .extend(raw.attributes.iter().map(|a| a.name.clone()));
        if let Some((min, max)) = robust_bounds(&raw.positions) {
            self.bounds = Some(match self.bounds {
                Some((low, high)) => (low.min(min), high.max(max)),
                None => (min, max),
            });
        }
        if self.velocity.is_none() {
            self.velocity = velocity_of(&raw.attributes).map(|a| a.name.clone());
        }
        let wanted = match question.color {
            ColorQuestion::None => None,
            ColorQuestion::Speed => self.velocity.clone(),
            ColorQuestion::Attribute(name) => Some(name.to_owned()),
        };
        let origin = self
            .bounds
            .map_or(DVec3::ZERO, |(min, max)| choose_origin(min, max));
        let frame = ParticleFrame::from_raw(raw, origin);
        self.most_particles = self.most_particles.max(frame.len());
        weight.own_radii = matches!(frame.radius, Some(Radius::PerParticle(_)));
        if self.weight.is_none_or(|heaviest| weight.raw > heaviest.raw) {
            self.weight = Some(weight);
        }
        if let Some(name) = wanted {
            if let Some(attribute) = frame.attribute(&name)
                && let Some((low, high)) = robust_range(attribute)
            {
                let (a, b) = self.range.unwrap_or((low, high));
                self.range = Some((a.min(low), b.max(high)));
            }
            self.color = Some(name);
        }
        match question.radius {
            RadiusQuestion::None => {}
            RadiusQuestion::Auto => self.take_in_radius(&frame),
            RadiusQuestion::Attribute(name, scale) => {
                if let Some(attribute) = frame.attribute(name) {
                    let radius = |i| narrow(attribute.magnitude(i) * scale);
                    self.reach = self.reach.max(robust_largest(attribute.count(), radius));
                }
            }
        }
    }

    fn take_in_radius(&mut self, frame: &ParticleFrame) {
        match &frame.radius {
            Some(Radius::Common(radius)) => {
                self.has_radii = true;
                self.reach = self.reach.max(*radius);
            }
            Some(Radius::PerParticle(radii)) => {
                self.has_radii = true;
                self.reach = self.reach.max(robust_largest(radii.len(), |i| radii[i]));
            }
            None => {
                // The fullest frame knows the spacing best.
                let fuller = self.radius.is_none_or(|(count, _)| frame.len() > count);
                if fuller && let Some(radius) = estimate_radius(&frame.positions) {
                    self.radius = Some((frame.len(), radius));
                }
            }
        }
    }

    fn finish(self, up: DVec3) -> Survey {
        let (min, max) = self
            .bounds
            .unwrap_or((DVec3::splat(-0.5), DVec3::splat(0.5)));
        let color = self.color.map(|attribute| {
            let (low, high) = self.range.unwrap_or((0.0, 1.0));
            ColorRange {
                attribute,
                low,
                high,
            }
        });
        Survey {
            origin: choose_origin(min, max),
            min,
            max,
            radius: self.radius.map(|(_, radius)| radius),
            has_radii: self.has_radii,
            reach: self.reach,
            color,
            up,
            attributes: self.attributes.into_iter().collect(),
            most_particles: self.most_particles,
            frames: self.frames,
            weight: self.weight,
        }
    }
}

impl FrameWeight {
    /// All but the radii, which are looked for later.
    fn of(loaded: &Loaded, files: u64) -> Self {
        let raw = &loaded.particles;
        Self {
            particles: raw.positions.len() as u64,
            stored: loaded.all_bytes,
            content: loaded.content_bytes,
            raw: raw.byte_len(),
            positions: raw.positions.byte_len(),
            files,
            own_radii: false,
            ids: id_of(&raw.attributes).is_some(),
            velocities: velocity_of(&raw.attributes).is_some(),
        }
    }
}

/// The box of the particles, except that on each axis it reaches beyond the middle 98 % by at most
/// half their extent. None without finite particles.
///
/// Below 100 particles, where that would leave none out, the outermost on each side of an axis is
/// not of the middle, and the box may reach beyond by the longest side of the middle: one of a few
/// particles that lies off the others' plane belongs to the picture.
fn robust_bounds(positions: &Positions) -> Option<(DVec3, DVec3)> {
    let count = positions.len();
    let finite = |i| Some(positions.get(i)).filter(|p: &DVec3| p.is_finite());
    let stride = count.div_ceil(SAMPLE).max(1);
    let mut sample: Vec<DVec3> = (0..count).step_by(stride).filter_map(finite).collect();
    let (min, max) = (0..count)
        .into_par_iter()
        .filter_map(finite)
        .map(|p| (p, p))
        .reduce_with(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
    let few = sample.len() < 100;
    let outside = match sample.len() / 100 {
        0 => usize::from(sample.len() >= ESCAPE_MIN),
        percent => percent,
    };
    let (mut first, mut last) = (min, max);
    for axis in 0..3 {
        sample.sort_unstable_by(|a, b| a[axis].total_cmp(&b[axis]));
        let above = (sample.len() - outside).saturating_sub(1);
        if let (Some(low), Some(high)) = (sample.get(outside), sample.get(above)) {
            (first[axis], last[axis]) = (low[axis], high[axis]);
        }
    }
    let extent = last - first;
    let margin = if few {
        DVec3::splat(extent.max_element())
    } else {
        0.5 * extent
    };
    Some((min.max(first - margin), max.min(last + margin)))
}

#[expect(clippy::cast_possible_truncation, reason = "radii are f32")]
fn narrow(value: f64) -> f32 {
    value as f32
}

/// The 99th percentile of `count` radii; 0 without finite ones.
fn robust_largest(count: usize, radius: impl Fn(usize) -> f32) -> f32 {
    let stride = count.div_ceil(SAMPLE).max(1);
    let mut radii: Vec<f32> = (0..count)
        .step_by(stride)
        .map(radius)
        .filter(|r| r.is_finite() && *r > 0.0)
        .collect();
    radii.sort_unstable_by(f32::total_cmp);
    let place = (radii.len() - radii.len() / 100).saturating_sub(1);
    radii.get(place).copied().unwrap_or(0.0)
}

/// The middle 99 % of an attribute's values (vectors by magnitude, from zero up).
fn robust_range(attribute: &Attribute) -> Option<(f64, f64)> {
    let count = attribute.count();
    let stride = count.div_ceil(SAMPLE).max(1);
    let mut values: Vec<f64> = (0..count)
        .step_by(stride)
        .map(|i| attribute.magnitude(i))
        .filter(|v| v.is_finite())
        .collect();
    values.sort_unstable_by(f64::total_cmp);
    let low = *values.get(values.len() / 200)?;
    let high = *values.get((values.len() - values.len() / 200).saturating_sub(1))?;
    let is_vector = attribute.components > 1;
    Some((if is_vector { 0.0 } else { low }, high))
}

/// Half the median distance to the nearest neighbour. None for fewer than two distinct particles.
fn estimate_radius(positions: &[Vec3]) -> Option<f32> {
    let queries = (NEIGHBOUR_BUDGET / positions.len().max(1)).clamp(16, NEIGHBOUR_QUERIES);
    let stride = positions.len().div_ceil(queries).max(1);
    let mut distances: Vec<f32> = positions
        .iter()
        .step_by(stride)
        .filter_map(|from| {
            let nearest = positions
                .par_chunks(64 * 1024)
                .map(|chunk| {
                    chunk
                        .iter()
                        .map(|to| from.distance_squared(*to))
                        .filter(|d| *d > 0.0)
                        .fold(f32::INFINITY, f32::min)
                })
                .reduce(|| f32::INFINITY, f32::min);
            nearest.is_finite().then(|| nearest.sqrt())
        })
        .collect();
    distances.sort_unstable_by(f32::total_cmp);
    distances.get(distances.len() / 2).map(|d| 0.5 * d)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `side` by `side` particles in the unit square of a plane, and one more.
    fn plane_and(side: u8, other: DVec3) -> (DVec3, DVec3) {
        let step = |i: u8| f64::from(i) / f64::from(side - 1);
        let mut all: Vec<DVec3> = (0..side)
            .flat_map(|i| (0..side).map(move |j| DVec3::new(step(i), step(j), 0.0)))
            .collect();
        all.push(other);
        robust_bounds(&Positions::F64(all)).unwrap()
    }

    #[test]
    fn one_escaped_particle_is_left_out_of_many_and_of_few() {
        for side in [5, 20] {
            for escaped in [DVec3::X, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z] {
                let (min, max) = plane_and(side, 1e4 * escaped);
                assert!(min.min_element() >= -1.0, "{side} {escaped}: {min}");
                assert!(max.max_element() <= 2.0, "{side} {escaped}: {max}");
                assert!(min.x <= 0.0 && min.y <= 0.0 && max.x >= 1.0 && max.y >= 1.0);
            }
        }
    }

    #[test]
    fn one_of_few_that_lies_near_is_kept() {
        assert_eq!(plane_and(5, DVec3::new(0.5, 0.5, 0.9)).1.z, 0.9);
        // Of less than sixteen none is left out.
        assert_eq!(plane_and(3, DVec3::new(0.5, 0.5, 1e4)).1.z, 1e4);
    }
}
