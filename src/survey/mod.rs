//! What "auto" means for a sequence, settled once from a look at its frames: the origin, the box
//! that the camera frames, the particle radius, the range of the colour map.
//!
//! Percentiles rather than extremes, so that one escaped particle neither shrinks the picture nor
//! washes out the colours. The answer is kept with the job, so that all frames, runs and machines
//! agree.

use std::collections::BTreeSet;

use glam::DVec3;
use serde::{Deserialize, Serialize};
use spherule_formats::native::AttributeView;
use spherule_formats::sequence::Sequence;
use spherule_formats::{Attribute, FrameError, ID_NAMES, ParticleFrame, Radius, choose_origin};

use crate::scene::{RgbEncoding, is_rgb};

mod look;
mod packing;
mod robust;
mod stream;

use look::Look;
use packing::Spacing;
use packing::narrow;
use robust::{estimate_packed, estimate_radius, robust_bounds, robust_largest, robust_range};

/// Frames looked at; evenly spread, first and last among them. All of a shorter sequence.
const FRAMES: usize = 24;
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
    /// The same for the particles of one body: half the edge of the cube that each has for itself inside, and a
    /// little more. Told if it was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub packed_radius: Option<f32>,
    /// Whether the frames bring radii of their own.
    pub has_radii: bool,
    /// How far the spheres reach beyond their centres, as far as the frames tell: the 99th
    /// percentile of the radii of the frame with the largest; 0 where they bring none.
    pub reach: f32,
    /// The attribute that colours were asked for by, if any, with its range.
    pub color: Option<ColorRange>,
    /// The attribute whose values are the particles' colours, unless they are by speed. Jobs of earlier versions
    /// lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rgb: Option<RgbAttribute>,
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
    /// Whether it is a native frame relative to the origin of the sequence, which can be traced where it
    /// lies.
    #[serde(default)]
    pub in_place: bool,
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

/// An attribute whose values are colours.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RgbAttribute {
    /// Name of the attribute.
    pub attribute: String,
    /// What its numbers mean, in the first frame that has it.
    pub encoding: RgbEncoding,
}

impl RgbAttribute {
    /// The first of `attributes` that holds colours, or the one called `name`, if it does.
    fn of(attributes: &[Attribute], name: Option<&str>) -> Option<Self> {
        let is_wanted = |a: &&Attribute| name.is_none_or(|name| a.name.eq_ignore_ascii_case(name));
        let found = attributes.iter().filter(is_wanted).find(|a| is_rgb(a))?;
        Some(Self {
            attribute: found.name.clone(),
            encoding: RgbEncoding::of(found.data.scalar_type()),
        })
    }
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
    /// As `Auto`, and an estimate for particles that are one body as well.
    AutoOfBody,
    /// The largest values of an attribute times a factor.
    Attribute(&'a str, f64),
}

impl RadiusQuestion<'_> {
    fn is_auto(&self) -> bool {
        matches!(self, Self::Auto | Self::AutoOfBody)
    }

    fn is_packed(&self) -> bool {
        *self == Self::AutoOfBody
    }
}

/// What is asked about colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColorQuestion<'a> {
    /// No attribute is needed.
    None,
    /// The velocity, if there is one, else colours, if there are any.
    Speed,
    /// This attribute.
    Attribute(&'a str),
}

/// Running totals over the frames.
struct Totals {
    bounds: Option<(DVec3, DVec3)>,
    radius: Option<(usize, Spacing)>,
    has_radii: bool,
    reach: f32,
    range: Option<(f64, f64)>,
    color: Option<String>,
    velocity: Option<String>,
    rgb: Option<RgbAttribute>,
    attributes: BTreeSet<String>,
    most_particles: usize,
    frames: usize,
    weight: Option<FrameWeight>,
    origin: Origins,
}

/// What the coordinates of native frames are relative to.
#[derive(Clone, Copy, PartialEq)]
enum Origins {
    /// There was none yet.
    None,
    /// The same in all.
    Shared(DVec3),
    /// Different ones, or there are frames of another kind, too.
    Mixed,
}

impl Origins {
    fn and(self, origin: Option<DVec3>) -> Self {
        match (self, origin) {
            (Self::None, Some(origin)) => Self::Shared(origin),
            (Self::Shared(shared), Some(origin)) if shared == origin => self,
            _ => Self::Mixed,
        }
    }
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
            rgb: None,
            attributes: BTreeSet::new(),
            most_particles: 0,
            frames: 0,
            weight: None,
            origin: Origins::None,
        };
        let mut failure = None;
        for index in indices {
            match Look::at(sequence, index, question.radius) {
                Ok(look) => totals.take_in(look, question),
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
}

/// An attribute by name and components, wherever its values are.
pub trait Named {
    /// Its name.
    fn name(&self) -> &str;
    /// Numbers a particle.
    fn components(&self) -> usize;
}

impl Named for Attribute {
    fn name(&self) -> &str {
        &self.name
    }

    fn components(&self) -> usize {
        self.components
    }
}

impl Named for AttributeView<'_> {
    fn name(&self) -> &str {
        self.name()
    }

    fn components(&self) -> usize {
        self.components()
    }
}

/// The one of `attributes` that holds velocities, if any does.
pub fn velocity_of<A: Named>(attributes: &[A]) -> Option<&A> {
    VELOCITY_NAMES.iter().find_map(|name| {
        attributes
            .iter()
            .find(|a| a.components() == 3 && a.name().eq_ignore_ascii_case(name))
    })
}

/// The attribute that holds ids, if any does: exactly by name, or failing that without regard to
/// case.
pub fn id_of<A: Named>(attributes: &[A]) -> Option<&A> {
    ID_NAMES.iter().find_map(|name| {
        let exact = attributes.iter().find(|a| a.name() == *name);
        let alike = || {
            attributes
                .iter()
                .find(|a| a.name().eq_ignore_ascii_case(name))
        };
        exact.or_else(alike).filter(|a| a.components() == 1)
    })
}

/// What the neighbours in a frame tell.
fn spacing_of(frame: &ParticleFrame, how_packed: bool) -> Option<Spacing> {
    let touching = estimate_radius(&frame.positions)?;
    let packed = || estimate_packed(&frame.positions, touching);
    Some(Spacing {
        touching,
        packed: how_packed.then(packed).flatten(),
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
    fn take_in(&mut self, look: Look, question: Question) {
        self.frames += 1;
        self.origin = self.origin.and(look.origin);
        let Look {
            particles: raw,
            count,
            extremes,
            spacing,
            mut weight,
            ..
        } = look;
        self.attributes
            .extend(raw.attributes.iter().map(|a| a.name.clone()));
        if let Some((min, max)) = robust_bounds(&raw.positions, extremes) {
            self.bounds = Some(match self.bounds {
                Some((low, high)) => (low.min(min), high.max(max)),
                None => (min, max),
            });
        }
        if self.velocity.is_none() {
            self.velocity = velocity_of(&raw.attributes).map(|a| a.name.clone());
        }
        if self.rgb.is_none() {
            self.rgb = match question.color {
                ColorQuestion::None => None,
                ColorQuestion::Speed => RgbAttribute::of(&raw.attributes, None),
                ColorQuestion::Attribute(name) => RgbAttribute::of(&raw.attributes, Some(name)),
            };
        }
        let origin = self
            .bounds
            .map_or(DVec3::ZERO, |(min, max)| choose_origin(min, max));
        let seen = raw.positions.len();
        let frame = ParticleFrame::from_raw(raw, origin);
        // Of a part, none is known not to be finite.
        let count = count - (seen - frame.len());
        self.most_particles = self.most_particles.max(count);
        if !weight.in_place {
            weight.own_radii = matches!(frame.radius, Some(Radius::PerParticle(_)));
        }
        if self.weight.is_none_or(|heaviest| weight.raw > heaviest.raw) {
            self.weight = Some(weight);
        }
        self.take_in_color(&frame, question.color);
        match question.radius {
            RadiusQuestion::None => {}
            RadiusQuestion::Auto | RadiusQuestion::AutoOfBody => {
                let estimate =
                    || spacing.or_else(|| spacing_of(&frame, question.radius.is_packed()));
                self.take_in_radius(&frame, count, estimate);
            }
            RadiusQuestion::Attribute(name, scale) => {
                if let Some(attribute) = frame.attribute(name) {
                    let radius = |i| narrow(attribute.magnitude(i) * scale);
                    self.reach = self.reach.max(robust_largest(attribute.count(), radius));
                }
            }
        }
    }

    fn take_in_color(&mut self, frame: &ParticleFrame, question: ColorQuestion) {
        let wanted = match question {
            ColorQuestion::None => None,
            ColorQuestion::Speed => self.velocity.clone(),
            ColorQuestion::Attribute(name) => Some(name.to_owned()),
        };
        let Some(name) = wanted else { return };
        if let Some(attribute) = frame.attribute(&name)
            && let Some((low, high)) = robust_range(attribute)
        {
            let (a, b) = self.range.unwrap_or((low, high));
            self.range = Some((a.min(low), b.max(high)));
        }
        self.color = Some(name);
    }

    fn take_in_radius(
        &mut self,
        frame: &ParticleFrame,
        count: usize,
        estimate: impl Fn() -> Option<Spacing>,
    ) {
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
                let fuller = self.radius.is_none_or(|(known, _)| count > known);
                if fuller && let Some(spacing) = estimate() {
                    self.radius = Some((count, spacing));
                }
            }
        }
    }

    fn finish(self, up: DVec3) -> Survey {
        let (min, max) = self
            .bounds
            .unwrap_or((DVec3::splat(-0.5), DVec3::splat(0.5)));
        // Speed goes before colours.
        let rgb = self.rgb.filter(|rgb| {
            let is_asked = |color: &String| rgb.attribute.eq_ignore_ascii_case(color);
            self.color.as_ref().is_none_or(is_asked)
        });
        let color = self.color.map(|attribute| {
            let (low, high) = self.range.unwrap_or((0.0, 1.0));
            ColorRange {
                attribute,
                low,
                high,
            }
        });
        // Native frames have settled it already; another one would be in the way of tracing them as they
        // are.
        let origin = match self.origin {
            Origins::Shared(origin) => origin,
            Origins::None | Origins::Mixed => choose_origin(min, max),
        };
        let in_place = self.origin == Origins::Shared(origin);
        let weight = self.weight.map(|weight| FrameWeight { in_place, ..weight });
        Survey {
            origin,
            min,
            max,
            radius: self.radius.map(|(_, spacing)| spacing.touching),
            packed_radius: self.radius.and_then(|(_, spacing)| spacing.packed),
            has_radii: self.has_radii,
            reach: self.reach,
            color,
            rgb,
            up,
            attributes: self.attributes.into_iter().collect(),
            most_particles: self.most_particles,
            frames: self.frames,
            weight,
        }
    }
}
