//! What a sequence of frames contains, from a sample of them: it determines the meaning of "auto", once for all frames.
//!
//! ```text
//! frames of formats -> [survey] -> sizes, ranges, kinds -> spherule: the settings nobody gave
//! ```
//!
//! - [`Survey`]: the origin, the box that the camera frames, the particle radius, the range of the colour map, and how
//!   much memory a frame needs. A [`Question`] says which of them, and for which particles.
//! - [`Facts`]: what the particles look like (elements, grains, categories, walls, tanks), from which defaults follow.
//!
//! A survey uses percentiles and not extremes, so that a single outlier neither shrinks the picture nor reduces the
//! contrast of colours. It is stored with the job, so that all frames, runs and machines use the same values. This crate
//! decides nothing: it knows no settings, and `spherule` makes scenes and defaults of what it finds.
//!
//! ```
//! use spherule_formats::{PositionSlice, RawParticles};
//! use spherule_survey::{Question, RadiusQuestion, Survey};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A cube of 1000 particles
//! let at = |i: u16| glam::Vec3::new(f32::from(i % 10), f32::from(i / 10 % 10), f32::from(i / 100));
//! let positions: Vec<glam::Vec3> = (0..1000).map(at).collect();
//! let particles = RawParticles {
//!     positions: PositionSlice::F32(&positions),
//!     attributes: Vec::new(),
//!     ..RawParticles::default()
//! };
//! let question = Question { radius: RadiusQuestion::Auto, ..Question::NOTHING };
//! let survey = Survey::of_particles("cube", &particles, question)?;
//! assert_eq!(survey.radius, Some(0.5));
//! # Ok(())
//! # }
//! ```
#![deny(unsafe_code)]

use glam::DVec3;
use serde::{Deserialize, Serialize};
use spherule_formats::sequence::Sequence;
use spherule_formats::{
    Attribute, FrameError, Labels, PositionSlice, RawParticles, SimulationCell,
};

use spherule_selection::{Division, Selection};
use spherule_tracer::scene::{RadiusTable, RgbEncoding, is_rgb};

pub use spherule_frame::values::{PART_NAMES, id_of, part_of, shown_name, velocity_of};

mod aspherical;
mod beads;
mod color;
mod facts;
mod gas;
mod grains;
mod moments;
mod neighbours;
mod outline;
mod packing;
mod robust;
mod sample;
mod shape;
mod sheet;
mod solvent;
mod standing;
mod stream;
mod tank;
mod totals;
mod upright;
mod walls;
mod weight;

pub use aspherical::ShapeSource;
pub use color::{Categories, ColorQuestion, ColorRange, MAX_CATEGORIES, RangeQuestion, range_of};
pub use facts::{BEAD, Category, ELEMENT, Elements, Facts};
pub use grains::GrainRadius;
pub use outline::{Fit, Outline};
use packing::SpacingRequest;
use sample::FrameSample;
pub use shape::Axes;
pub use tank::Tank;
use totals::Totals;
pub use walls::{WallSign, WallValues};
use weight::has_surface;
pub use weight::{DropCount, FrameWeight, SurfaceQuestion, SurfaceWeight};

/// Maximum number of frames to sample; evenly distributed, including the first and the last one.
const FRAMES: usize = 24;

/// Result of a survey.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Survey {
    /// World position that all coordinates are relative to.
    pub origin: DVec3,
    /// Lower corner of the box of most particles over the sequence, world units.
    pub min: DVec3,
    /// Upper corner of that box.
    pub max: DVec3,
    /// The lowest layers of particles on each axis over the sequence, and the highest. Jobs of earlier versions lack
    /// them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layers: Option<(DVec3, DVec3)>,
    /// Whether the particles lie in a plane. Jobs of earlier versions do not say so.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_flat: bool,
    /// The largest measure of particles on the lowest plane of a frame: 1 for a cube on a floor, about 0.1 for a ball.
    /// Jobs of earlier versions lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standing: Option<f64>,
    /// The same for the lowest points of spheres with radii of their own. Jobs of earlier versions lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bottom_standing: Option<f64>,
    /// The lowest place of the spheres along the up direction, without a few outliers, world units, if they have radii of
    /// their own. Jobs of earlier versions lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lowest: Option<f64>,
    /// The outermost particles, for the camera. Jobs of earlier versions lack them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outline: Option<Outline>,
    /// The simulation cells of the frames that the camera shows, each once; none of files that were only sampled.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cells: Vec<SimulationCell>,
    /// Radius for frames without radii: half the median distance of neighbours, whichever particles are drawn; the
    /// median of the frames.
    pub radius: Option<f32>,
    /// The same for the particles of one body: half the edge of the cube that each particle occupies inside, slightly
    /// enlarged. Only if it was requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub packed_radius: Option<f32>,
    /// Whether the frames contain radii.
    pub has_radii: bool,
    /// Extent of the spheres beyond their centres: the 99th percentile of the radii of the frame with the largest
    /// ones; 0 for frames without radii.
    pub reach: f32,
    /// The attribute for colours, if one was requested, with its range.
    pub color: Option<ColorRange>,
    /// The attribute with the colours of particles, unless they are coloured by speed. Jobs of earlier versions lack
    /// it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rgb: Option<RgbAttribute>,
    /// The ranges of the colours of styles, in their order. Jobs of earlier versions lack them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub styles: Vec<Option<ColorRange>>,
    /// Positions of some particles of all sampled frames, relative to the origin, if they were requested.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<[f32; 3]>,
    /// The up direction that is usual for this format, unit vector.
    pub up: DVec3,
    /// Names of all attributes in the sampled frames.
    pub attributes: Vec<String>,
    /// Components per particle of each of [`Self::attributes`]. Jobs of earlier versions lack them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub components: Vec<usize>,
    /// Names of parts and of other values. Jobs of earlier versions lack them.
    #[serde(default, skip_serializing_if = "Labels::is_empty")]
    pub labels: Labels,
    /// Mean time between consecutive frames, if the files contain times.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame_time: Option<f64>,
    /// The largest time of the first and the last frame, without a sign, if the files contain times.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub largest_time: Option<f64>,
    /// The unit of times, if the format has one. Jobs of earlier versions lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_unit: Option<String>,
    /// Mean difference of the numbers of consecutive frames, if there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame_numbers: Option<i64>,
    /// Largest particle count of the sampled frames.
    pub most_particles: usize,
    /// Number of sampled frames.
    pub frames: usize,
    /// Length of an angstrom in the unit of the positions. Jobs of earlier versions lack it.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub angstrom: f64,
    /// Size of the heaviest sampled frame. Jobs of the first versions lack it.
    #[serde(default)]
    pub weight: Option<FrameWeight>,
    /// Speed of the fastest particles: the 99th percentile of the frame where it is the highest. Jobs of earlier versions
    /// lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed: Option<f32>,
    /// The surfaces of some of the sampled frames, if they were requested.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub surfaces: Vec<SurfaceWeight>,
}

const fn one() -> f64 {
    1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_one(angstrom: &f64) -> bool {
    *angstrom == 1.0
}

/// An attribute with colours.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RgbAttribute {
    /// Name of the attribute.
    pub attribute: String,
    /// Encoding of the colours in the first frame that has it.
    pub encoding: RgbEncoding,
}

impl RgbAttribute {
    /// The first of `attributes` that contains colours; with a `name`, only the attribute of that name.
    fn of(attributes: &[Attribute], name: Option<&str>) -> Option<Self> {
        let has_name = |a: &&Attribute| name.is_none_or(|name| a.name.eq_ignore_ascii_case(name));
        let found = attributes.iter().filter(has_name).find(|a| is_rgb(a))?;
        Some(Self {
            attribute: found.name.clone(),
            encoding: RgbEncoding::of(found.data.scalar_type()),
        })
    }
}

/// What a job needs to know. The spacing of neighbours is that of all particles, everything else is about those that
/// are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Question<'a> {
    /// Colours; with styles those of the particles without one.
    pub color: ColorQuestion<'a>,
    /// The styles, if some particles have one.
    pub styles: Option<&'a StyleQuestions<'a>>,
    /// Radii.
    pub radius: RadiusQuestion<'a>,
    /// The up direction for heights; by default that of the format.
    pub up: Option<DVec3>,
    /// Whether positions of some particles are needed.
    pub points: bool,
    /// Which particles are drawn, if some are not.
    pub selection: Option<&'a Selection>,
    /// The particles that the camera shows.
    pub fit: Fit,
    /// Index of the only frame whose particles the camera shows, if there is one.
    pub framed: Option<usize>,
    /// The surface, if its memory depends on the places of the particles.
    pub surface: Option<SurfaceQuestion>,
}

impl Question<'_> {
    /// Nothing but what every survey finds: places and attributes of all particles.
    pub const NOTHING: Self = Self {
        color: ColorQuestion::None,
        styles: None,
        radius: RadiusQuestion::None,
        up: None,
        points: false,
        selection: None,
        fit: Fit::All,
        framed: None,
        surface: None,
    };

    /// The selection, with heights along `up`.
    fn selection_with(&self, up: DVec3) -> Option<Selection> {
        self.selection.map(|selection| Selection { up: Some(up), ..selection.clone() })
    }
}

/// What a job needs to know about particles that are drawn in different ways.
#[derive(Debug, Clone, PartialEq)]
pub struct StyleQuestions<'a> {
    /// Which particles have which style, by its index and 1.
    pub division: Division,
    /// The colours of each style; None: [`Self::shared`].
    pub colors: Vec<Option<ColorQuestion<'a>>>,
    /// Colours of several styles, whose range is that of all their particles.
    pub shared: ColorQuestion<'a>,
    /// Whether the particles without a style have these colours, too.
    pub first_shares: bool,
}

/// What a job needs to know about radii.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RadiusQuestion<'a> {
    /// Nothing.
    None,
    /// The spacing of particles, beside which a given radius is judged.
    Given,
    /// The radii of the frames, or an estimate for frames without.
    Auto,
    /// Same as `Auto`, and an estimate for particles of one body.
    AutoOfBody,
    /// The largest values of an attribute times a factor.
    Attribute(&'a str, f64),
    /// The largest radii of a table, by an attribute, times a factor.
    Table(&'a str, &'a RadiusTable, f64),
}

impl RadiusQuestion<'_> {
    /// The estimates that it needs, of each of so many `frames`.
    fn spacing(&self, frames: usize) -> Option<SpacingRequest> {
        let needs_spacing = matches!(self, Self::Given | Self::Auto | Self::AutoOfBody);
        needs_spacing.then_some(SpacingRequest { needs_packed: *self == Self::AutoOfBody, frames })
    }

    /// The same for positions in a unit in which an angstrom has this length.
    fn in_unit(self, angstrom: f64) -> Self {
        match self {
            Self::Table(name, table, scale) if table.is_of_elements() => {
                Self::Table(name, table, scale * angstrom)
            }
            other => other,
        }
    }

    /// The radius of particle `index` by one of `attributes`, if the question is about one and it has a radius.
    fn radius_by_attribute(&self, attributes: &[Attribute], index: usize) -> Option<f64> {
        let value = |name: &str| {
            let exact = attributes.iter().find(|a| a.name == name);
            let any_case = || attributes.iter().find(|a| a.name.eq_ignore_ascii_case(name));
            exact.or_else(any_case).map(|a| a.magnitude(index))
        };
        match self {
            Self::Attribute(name, scale) => Some(value(name)? * scale),
            Self::Table(name, table, scale) => {
                let radius = table.radius(value(name)?).or(table.other_radius())?;
                Some(radius * scale)
            }
            Self::None | Self::Given | Self::Auto | Self::AutoOfBody => None,
        }
    }
}

/// Fraction of the extent along an axis within which the outermost layer of particles lies if they rest on a floor: a
/// ball has much less of its volume there, a box or a heap more.
const FLOOR: f64 = 0.02;

/// [`Survey::standing`] from which on particles stand on a floor.
const STANDING: f64 = 0.3;

impl Survey {
    /// Length of the unit of a table of radii in the unit of the positions.
    pub fn unit_of(&self, table: &RadiusTable) -> f64 {
        if table.is_of_elements() { self.angstrom } else { 1.0 }
    }

    /// Whether particles lie on a floor at the lower end of the axis `up` at some time: a whole layer of them is at the
    /// lower end.
    pub fn rests_on_ground(&self, up: DVec3) -> bool {
        if self.bottom_standing.is_some_and(|standing| standing >= STANDING) {
            return true;
        }
        if self.standing.is_some_and(|standing| standing < STANDING) {
            return false;
        }
        let Some(layers) = self.layers else {
            return false;
        };
        let lowest = |(min, max): (DVec3, DVec3)| (up * min).min(up * max).element_sum();
        let floor = lowest((self.min, self.max));
        let extent = (up * (self.max - self.min)).abs().element_sum();
        lowest(layers) <= floor + FLOOR * extent
    }

    /// Surveys `sequence`. Frames that cannot be read are skipped here, and reported when they are rendered.
    ///
    /// # Errors
    /// If none of the frames can be read: the error of the first one.
    pub fn of(sequence: &Sequence, question: Question) -> Result<Self, FrameError> {
        let mut indices = spread(sequence.frames().len());
        if let Some(framed) = question.framed.filter(|framed| !indices.contains(framed)) {
            indices.push(framed);
            indices.sort_unstable();
        }
        Self::of_frames(sequence, indices, question)
    }

    /// Surveys the frames of `sequence` with these indices.
    ///
    /// # Errors
    /// Same as [`Self::of`].
    pub fn of_frames(
        sequence: &Sequence,
        indices: impl IntoIterator<Item = usize>,
        question: Question,
    ) -> Result<Self, FrameError> {
        // Find the units and the up direction of the format
        let format = sequence.format_info();
        let angstrom = format.map_or(1.0, |format| format.angstrom);
        let time_unit = format.and_then(|format| format.time_unit).map(str::to_owned);
        let mut totals = Totals::new();
        let format_up = if sequence.is_y_up() { DVec3::Y } else { DVec3::Z };
        let up = question.up.unwrap_or(format_up);
        let selection = question.selection_with(up);
        let question = Question {
            radius: question.radius.in_unit(angstrom),
            selection: selection.as_ref(),
            ..question
        };
        // Sample each frame; a frame that cannot be read does not stop the survey
        let mut failure = None;
        let indices: Vec<usize> = indices.into_iter().collect();
        let frames = indices.len();
        for (place, index) in indices.into_iter().enumerate() {
            match FrameSample::of(sequence, index, (question, frames)) {
                Ok(sample) => {
                    let is_weighed = match question.framed {
                        Some(framed) => framed == index,
                        None => has_surface(place, frames),
                    };
                    if is_weighed {
                        totals.add_surface(sequence, index, &sample, question);
                    }
                    let number = sequence.frames().get(index).map_or(0, |frame| frame.number);
                    totals.moments.add(index, number, sample.particles.time);
                    let is_framed = question.framed.is_none_or(|framed| framed == index);
                    totals.add(sample, question, up, is_framed);
                }
                Err(error) => {
                    failure.get_or_insert(error);
                }
            }
        }
        // Fail only if no frame was readable
        match failure {
            Some(error) if totals.frames == 0 => Err(error),
            _ => Ok(Self { angstrom, time_unit, ..totals.finish(question, format_up) }),
        }
    }
}

impl Survey {
    /// Surveys the particles of one frame in memory; `name` stands for their file in messages. The result is that of a
    /// file with the same particles: one that is surveyed without reading it completely if there are more than a
    /// million.
    ///
    /// # Errors
    /// An attribute does not have all of its components for each particle.
    pub fn of_particles(
        name: &str,
        particles: &RawParticles<PositionSlice<'_>>,
        question: Question,
    ) -> Result<Self, FrameError> {
        let up = question.up.unwrap_or(DVec3::Z);
        let selection = question.selection_with(up);
        let question = Question { selection: selection.as_ref(), ..question };
        let sample = FrameSample::of_memory(name, particles, question)?;
        let mut totals = Totals::new();
        totals.add(sample, question, up, true);
        Ok(totals.finish(question, DVec3::Z))
    }
}

/// Up to [`FRAMES`] indices below `count`, evenly distributed.
fn spread(count: usize) -> Vec<usize> {
    if count <= FRAMES {
        return (0..count).collect();
    }
    (0..FRAMES).map(|i| i * (count - 1) / (FRAMES - 1)).collect()
}

#[cfg(test)]
#[path = "radius_tests.rs"]
mod tests;
