//! Determines the meaning of "auto" for a sequence, once, from a sample of its frames: the origin, the box that the
//! camera frames, the particle radius, the range of the colour map.
//!
//! It uses percentiles and not extremes, so that a single outlier neither shrinks the picture nor reduces the
//! contrast of colours. The result is stored with the job, so that all frames, runs and machines use the same values.

use crate::math::narrow;
use std::collections::BTreeMap;

use glam::DVec3;
use serde::{Deserialize, Serialize};
use spherule_formats::sequence::Sequence;
use spherule_formats::{
    Attribute, FrameError, Labels, ParticleFrame, PositionSlice, Radius, RawParticles,
    SimulationCell, choose_origin, sample_indices,
};

pub use spherule_frame::values::{PART_NAMES, id_of, part_of, shown_name, velocity_of};

use crate::scene::{RadiusTable, RgbEncoding, is_rgb};
use crate::selection::Selection;

mod beads;
mod color;
mod facts;
mod gas;
mod grains;
mod moments;
mod outline;
mod packing;
mod robust;
mod sample;
mod shape;
mod sheet;
mod standing;
mod stream;
mod tank;
mod upright;
mod walls;
mod weight;

pub use color::{Categories, ColorQuestion, ColorRange, MAX_CATEGORIES, RangeQuestion, range_of};
use color::{ColorTotals, FrameContext};
use facts::flat_axis;
pub use facts::{BEAD, Category, ELEMENT, Elements, Facts};
pub use grains::GrainRadius;
use moments::Moments;
use outline::Outermost;
pub use outline::{Fit, Outline};
use packing::{Spacing, SpacingRequest};
use robust::{RobustBounds, robust_bounds, robust_largest, sample_of, sorted_sample};
use sample::FrameSample;
pub use shape::Axes;
use standing::{is_falling, standing};
pub use tank::Tank;
pub use walls::{WallSign, WallValues};
use weight::has_surface;
pub use weight::{FrameWeight, SurfaceQuestion, SurfaceWeight};

/// Maximum number of frames to sample; evenly distributed, including the first and the last one.
const FRAMES: usize = 24;

/// Maximum number of positions to keep.
const POINTS: usize = 2048;

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
    /// Colours.
    pub color: ColorQuestion<'a>,
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
    /// The selection, with heights along `up`.
    fn selection_with(&self, up: DVec3) -> Option<Selection> {
        self.selection.map(|selection| Selection { up: Some(up), ..selection.clone() })
    }
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

/// Running totals over the frames.
struct Totals {
    bounds: Option<RobustBounds>,
    outermost: Outermost,
    standing: f64,
    bottom_standing: Option<f64>,
    lowest: Option<f64>,
    cells: Vec<SimulationCell>,
    /// The spacing in each frame, with its number of particles.
    spacings: Vec<(u64, Spacing)>,
    has_radii: bool,
    reach: f32,
    color: ColorTotals,
    labels: Labels,
    points: Vec<DVec3>,
    velocity: Option<String>,
    rgb: Option<RgbAttribute>,
    attributes: BTreeMap<String, usize>,
    most_particles: usize,
    frames: usize,
    weight: Option<FrameWeight>,
    surfaces: Vec<SurfaceWeight>,
    origin: Origins,
    moments: Moments,
}

/// Origins of the coordinates in native frames.
#[derive(Clone, Copy, PartialEq)]
enum Origins {
    /// No frame so far.
    None,
    /// All frames have this origin.
    Shared(DVec3),
    /// Origins differ, or there are frames of other formats.
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
    pub fn rests_on_floor(&self, up: DVec3) -> bool {
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

/// The median of an estimate over the frames, weighted by their particle counts: neither frames with few particles nor
/// a lattice at the start decides.
fn of_frames(
    spacings: &[(u64, Spacing)],
    estimate: impl Fn(&Spacing) -> Option<f32>,
) -> Option<f32> {
    let estimates =
        spacings.iter().filter_map(|(count, spacing)| Some((estimate(spacing)?, *count)));
    let mut estimates: Vec<(f32, u64)> = estimates.collect();
    estimates.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let all: u64 = estimates.iter().map(|(_, count)| count).sum();
    let mut below = 0;
    let median = estimates.iter().find(|(_, count)| {
        below += count;
        2 * below >= all
    });
    median.map(|(estimate, _)| *estimate)
}

/// Up to [`FRAMES`] indices below `count`, evenly distributed.
fn spread(count: usize) -> Vec<usize> {
    if count <= FRAMES {
        return (0..count).collect();
    }
    (0..FRAMES).map(|i| i * (count - 1) / (FRAMES - 1)).collect()
}

impl Totals {
    fn new() -> Self {
        Self {
            bounds: None,
            outermost: Outermost::default(),
            standing: 0.0,
            bottom_standing: None,
            lowest: None,
            cells: Vec::new(),
            spacings: Vec::new(),
            has_radii: false,
            reach: 0.0,
            color: ColorTotals::default(),
            labels: Labels::new(),
            points: Vec::new(),
            velocity: None,
            rgb: None,
            attributes: BTreeMap::new(),
            most_particles: 0,
            frames: 0,
            weight: None,
            surfaces: Vec::new(),
            origin: Origins::None,
            moments: Moments::default(),
        }
    }

    /// Adds a frame, which the camera shows if it `is_framed`.
    fn add(&mut self, sample: FrameSample, question: Question, up: DVec3, is_framed: bool) {
        self.frames += 1;
        self.origin = self.origin.and(sample.origin);
        let FrameSample { particles: raw, count, extremes, spacing, mut weight, .. } = sample;
        for attribute in &raw.attributes {
            let components = self.attributes.entry(attribute.name.clone()).or_insert(0);
            *components = attribute.components.max(*components);
        }
        for (column, labels) in &raw.labels {
            self.labels.entry(column.clone()).or_default().extend(labels.clone());
        }
        // Extend the bounds
        let found = robust_bounds(&raw.positions, extremes);
        self.bounds = match (self.bounds, found) {
            (Some(before), Some(found)) => Some(before.and(found)),
            (before, found) => before.or(found),
        };
        if is_framed {
            self.outermost.add(&raw.positions, count);
        }
        let velocity = velocity_of(&raw.attributes);
        if !velocity.is_some_and(|velocity| is_falling(&raw.positions, velocity, up)) {
            let standing = standing(&sample_of(&raw.positions), count, up);
            self.standing = self.standing.max(standing);
        }
        let is_new = |cell: &SimulationCell| !self.cells.contains(cell);
        if is_framed && let Some(cell) = raw.cell.filter(is_new) {
            self.cells.push(cell);
        }
        // Find velocity and colours
        if self.velocity.is_none() {
            self.velocity = velocity_of(&raw.attributes).map(|a| a.name.clone());
        }
        if self.rgb.is_none() {
            self.rgb = match question.color {
                ColorQuestion::None => None,
                ColorQuestion::Speed(_) => RgbAttribute::of(&raw.attributes, None),
                ColorQuestion::Value(name, _) => RgbAttribute::of(&raw.attributes, Some(name)),
            };
        }
        let origin =
            self.bounds.map_or(DVec3::ZERO, |bounds| choose_origin(bounds.outer.0, bounds.outer.1));
        // Count particles, and remember the heaviest frame
        let sampled = raw.positions.len();
        let frame = ParticleFrame::from_raw(raw, origin);
        // In a sample, only the sampled particles are checked for being finite.
        let count = count - (sampled - frame.len());
        self.most_particles = self.most_particles.max(count);
        if !weight.in_place {
            weight.own_radii = matches!(frame.radius, Some(Radius::PerParticle(_)));
        }
        if self.weight.is_none_or(|heaviest| weight.raw > heaviest.raw) {
            self.weight = Some(weight);
        }
        // Update the ranges of colour and radius
        let context = FrameContext { frame: &frame, count, origin, up, radius: question.radius };
        let velocity = self.velocity.as_deref();
        self.color.add(velocity, question.color, context);
        if question.points && is_framed {
            let some = sample_indices(frame.len(), POINTS).map(|i| frame.positions[i]);
            self.points.extend(some.map(|p| origin + p.as_dvec3()));
        }
        match question.radius {
            RadiusQuestion::None => {}
            RadiusQuestion::Given => {
                self.spacings.extend(spacing.map(|spacing| (weight.particles, spacing)));
            }
            RadiusQuestion::Auto | RadiusQuestion::AutoOfBody => {
                self.add_radius(&frame, weight.particles, spacing);
                if let Some(Radius::PerParticle(radii)) = &frame.radius {
                    self.add_lowest(&frame, origin, up, |i| radii[i]);
                }
            }
            RadiusQuestion::Attribute(..) | RadiusQuestion::Table(..) => {
                let radius = |i| question.radius.radius_by_attribute(&frame.attributes, i);
                let radius = |i| narrow(radius(i).unwrap_or_default());
                self.reach = self.reach.max(robust_largest(frame.len(), radius));
                self.add_lowest(&frame, origin, up, radius);
            }
        }
    }

    /// Adds the lowest place of the spheres of a frame, whose particles have these radii.
    fn add_lowest(
        &mut self,
        frame: &ParticleFrame,
        origin: DVec3,
        up: DVec3,
        radius: impl Fn(usize) -> f32,
    ) {
        let bottom = |i: usize| {
            let center = origin + frame.positions[i].as_dvec3();
            center.dot(up) - f64::from(radius(i))
        };
        let bottoms = sorted_sample(frame.len(), bottom);
        let found = bottoms.get(bottoms.len() / 1000).copied();
        self.lowest = self.lowest.into_iter().chain(found).reduce(f64::min);
        // Grains of different sizes stand on their lowest points
        let sample: Vec<DVec3> = bottoms.into_iter().map(|bottom| bottom * up).collect();
        let standing = standing(&sample, frame.len(), up);
        self.bottom_standing = Some(self.bottom_standing.unwrap_or(0.0).max(standing));
    }

    /// Adds the size of the surface of frame `index`. Large frames are read as a whole for it, as they are when they are
    /// rendered; nothing is known of one that cannot be read.
    fn add_surface(
        &mut self,
        sequence: &Sequence,
        index: usize,
        sample: &FrameSample,
        question: Question,
    ) {
        let Some(surface) = question.surface else {
            return;
        };
        let place = (index, sample.weight.particles);
        let weight = |raw: &RawParticles| {
            SurfaceWeight::of(raw, place, sample.spacing, surface, question.radius)
        };
        let found = if sample.is_part() {
            sequence.load_raw(index).ok().and_then(|raw| weight(&raw))
        } else {
            weight(&sample.particles)
        };
        self.surfaces.extend(found);
    }

    /// Adds the radii of `frame`, which has `count` particles before the selection.
    fn add_radius(&mut self, frame: &ParticleFrame, count: u64, spacing: Option<Spacing>) {
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
                self.spacings.extend(spacing.map(|spacing| (count, spacing)));
            }
        }
    }

    fn finish(self, question: Question, up: DVec3) -> Survey {
        let bounds = self.bounds.map(|bounds| bounds.outer);
        let (min, max) = bounds.unwrap_or((DVec3::splat(-0.5), DVec3::splat(0.5)));
        let color = self.color.finish(question.color);
        // Speed has precedence over colours.
        let rgb = self.rgb.filter(|rgb| {
            let is_colored_by =
                |color: &ColorRange| rgb.attribute.eq_ignore_ascii_case(&color.attribute);
            color.as_ref().is_none_or(is_colored_by)
        });
        // Use the origin of native frames: with a different one, they could not be traced in place.
        let origin = match self.origin {
            Origins::Shared(origin) => origin,
            Origins::None | Origins::Mixed => choose_origin(min, max),
        };
        let in_place = self.origin == Origins::Shared(origin);
        let points = sample_indices(self.points.len(), POINTS)
            .map(|i| self.points[i])
            .map(|point| (point - origin).as_vec3().to_array());
        let weight = self.weight.map(|weight| FrameWeight { in_place, ..weight });
        Survey {
            origin,
            min,
            max,
            layers: self.bounds.map(|bounds| bounds.layers),
            is_flat: flat_axis(min, max).is_some(),
            standing: Some(self.standing),
            bottom_standing: self.bottom_standing,
            lowest: self.lowest,
            outline: self.outermost.outline(question.fit, origin),
            cells: self.cells,
            radius: of_frames(&self.spacings, |spacing| Some(spacing.touching)),
            packed_radius: of_frames(&self.spacings, |spacing| spacing.packed),
            has_radii: self.has_radii,
            reach: self.reach,
            color,
            rgb,
            points: points.collect(),
            up,
            components: self.attributes.values().copied().collect(),
            attributes: self.attributes.into_keys().collect(),
            labels: self.labels,
            frame_time: self.moments.time_step(),
            largest_time: self.moments.largest_time(),
            frame_numbers: self.moments.number_step(),
            most_particles: self.most_particles,
            frames: self.frames,
            angstrom: 1.0,
            time_unit: None,
            weight,
            surfaces: self.surfaces,
        }
    }
}

#[cfg(test)]
#[path = "radius_tests.rs"]
mod tests;
