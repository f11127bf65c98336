//! Running totals over the frames of a survey, and the survey that follows from them.

use std::collections::BTreeMap;

use glam::DVec3;
use spherule_formats::order::index_u32;
use spherule_formats::sequence::Sequence;
use spherule_formats::{
    Labels, ParticleFrame, Radius, RawParticles, SimulationCell, choose_origin, sample_indices,
};
use spherule_selection::Division;
use spherule_tree::math::narrow;

use super::color::{ColorTotals, FrameContext};
use super::facts::flat_axis;
use super::moments::Moments;
use super::outline::Outermost;
use super::packing::Spacing;
use super::robust::{RobustBounds, robust_bounds, robust_largest, sample_of, sorted_sample};
use super::sample::FrameSample;
use super::standing::{is_falling, standing};
use super::{
    ColorQuestion, ColorRange, FrameWeight, Question, RadiusQuestion, RgbAttribute, StyleQuestions,
    SurfaceWeight, Survey, velocity_of,
};

/// Maximum number of positions to keep.
const POINTS: usize = 2048;

/// Running totals over the frames.
pub(super) struct Totals {
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
    /// Of styles that share colours.
    shared: ColorTotals,
    /// The colours of styles.
    styles: Vec<ColorTotals>,
    labels: Labels,
    points: Vec<DVec3>,
    velocity: Option<String>,
    speed: Option<f32>,
    rgb: Option<RgbAttribute>,
    attributes: BTreeMap<String, usize>,
    most_particles: usize,
    pub(super) frames: usize,
    weight: Option<FrameWeight>,
    surfaces: Vec<SurfaceWeight>,
    origin: Origins,
    pub(super) moments: Moments,
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

impl Totals {
    pub(super) fn new() -> Self {
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
            shared: ColorTotals::default(),
            styles: Vec::new(),
            labels: Labels::new(),
            points: Vec::new(),
            velocity: None,
            speed: None,
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
    pub(super) fn add(
        &mut self,
        sample: FrameSample,
        question: Question,
        up: DVec3,
        is_framed: bool,
    ) {
        self.frames += 1;
        self.origin = self.origin.and(sample.origin);
        self.add_names(&sample.particles);
        self.add_extent(&sample, up, is_framed);
        let FrameSample { particles: raw, count, spacing, mut weight, .. } = sample;
        self.find_velocity_and_colors(&raw, question.color);
        self.add_speed(&raw);
        let origin =
            self.bounds.map_or(DVec3::ZERO, |bounds| choose_origin(bounds.outer.0, bounds.outer.1));
        let groups = question.styles.and_then(|styles| groups_of(styles, &raw, up));
        // Count particles, and remember the heaviest frame
        let sampled = raw.positions.len();
        let frame = ParticleFrame::from_raw(raw, origin);
        // In a sample, only the sampled particles are checked for being finite.
        let finite_count = count - (sampled - frame.len());
        self.most_particles = self.most_particles.max(finite_count);
        if !weight.in_place {
            weight.own_radii = matches!(frame.radius, Some(Radius::PerParticle(_)));
        }
        if self.weight.is_none_or(|heaviest| weight.raw > heaviest.raw) {
            self.weight = Some(weight);
        }
        // Update the ranges of colour and radius
        let radius = question.radius;
        let context = FrameContext { frame: &frame, count: finite_count, origin, up, radius };
        let velocity = self.velocity.as_deref();
        match groups.zip(question.styles) {
            None => self.color.add(velocity, question.color, context),
            Some((groups, styles)) => {
                self.styles.resize_with(styles.colors.len(), ColorTotals::default);
                let add = |total: &mut ColorTotals, question, raw| {
                    let frame = &ParticleFrame::from_raw(raw, origin);
                    total.was_empty |= frame.is_empty();
                    total.add(velocity, question, FrameContext { frame, ..context });
                };
                add(&mut self.color, question.color, groups.first);
                if let Some(shared) = groups.shared {
                    add(&mut self.shared, styles.shared, shared);
                }
                let questions = styles.colors.iter().zip(groups.others);
                for (total, (question, raw)) in self.styles.iter_mut().zip(questions) {
                    if let Some(question) = question {
                        add(total, *question, raw);
                    }
                }
            }
        }
        if question.points && is_framed {
            let some = sample_indices(frame.len(), POINTS).map(|i| frame.positions[i]);
            self.points.extend(some.map(|p| origin + p.as_dvec3()));
        }
        self.add_radii(context, spacing.map(|spacing| (weight.particles, spacing)));
    }

    /// Adds where the particles of a frame are, how high they stand, and its simulation cell.
    fn add_extent(&mut self, sample: &FrameSample, up: DVec3, is_framed: bool) {
        let (raw, count) = (&sample.particles, sample.count);
        let found = robust_bounds(&raw.positions, sample.extremes);
        self.bounds = match (self.bounds, found) {
            (Some(before), Some(found)) => Some(before.and(found)),
            (before, found) => before.or(found),
        };
        if is_framed {
            self.outermost.add(&raw.positions, count);
        }
        // Particles that fall do not stand on a floor in this frame
        let velocity = velocity_of(&raw.attributes);
        if !velocity.is_some_and(|velocity| is_falling(&raw.positions, velocity, up)) {
            let standing = standing(&sample_of(&raw.positions), count, up);
            self.standing = self.standing.max(standing);
        }
        let is_new = |cell: &SimulationCell| !self.cells.contains(cell);
        if is_framed && let Some(cell) = raw.cell.filter(is_new) {
            self.cells.push(cell);
        }
    }

    /// Adds the attributes of a frame, and the names of their values.
    fn add_names(&mut self, raw: &RawParticles) {
        for attribute in &raw.attributes {
            let components = self.attributes.entry(attribute.name.clone()).or_insert(0);
            *components = attribute.components.max(*components);
        }
        for (column, labels) in &raw.labels {
            self.labels.entry(column.clone()).or_default().extend(labels.clone());
        }
    }

    /// Finds the attributes with velocities and with colours, unless an earlier frame had them.
    fn find_velocity_and_colors(&mut self, raw: &RawParticles, color: ColorQuestion) {
        if self.velocity.is_none() {
            self.velocity = velocity_of(&raw.attributes).map(|a| a.name.clone());
        }
        if self.rgb.is_none() {
            self.rgb = match color {
                ColorQuestion::None => None,
                ColorQuestion::Speed(_) => RgbAttribute::of(&raw.attributes, None),
                ColorQuestion::Value(name, _) => RgbAttribute::of(&raw.attributes, Some(name)),
            };
        }
    }

    /// Adds the speed of the fastest particles of a frame.
    fn add_speed(&mut self, raw: &RawParticles) {
        if let Some(velocity) = velocity_of(&raw.attributes) {
            let speed = robust_largest(velocity.count(), |i| narrow(velocity.magnitude(i)));
            self.speed = Some(self.speed.unwrap_or(0.0).max(speed));
        }
    }

    /// Adds the radii of a frame, or the spacing of its particles with their number before the selection.
    fn add_radii(&mut self, context: FrameContext, spacing: Option<(u64, Spacing)>) {
        let FrameContext { frame, origin, up, radius, .. } = context;
        match radius {
            RadiusQuestion::None => {}
            RadiusQuestion::Given => self.spacings.extend(spacing),
            RadiusQuestion::Auto | RadiusQuestion::AutoOfBody => {
                self.add_own_radii(frame, spacing);
                if let Some(Radius::PerParticle(radii)) = &frame.radius {
                    self.add_lowest(frame, origin, up, |i| radii[i]);
                }
            }
            RadiusQuestion::Attribute(..) | RadiusQuestion::Table(..) => {
                let by_attribute = |i| {
                    let found = radius.radius_by_attribute(&frame.attributes, i);
                    narrow(found.unwrap_or_default())
                };
                self.reach = self.reach.max(robust_largest(frame.len(), by_attribute));
                self.add_lowest(frame, origin, up, by_attribute);
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
    pub(super) fn add_surface(
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

    /// Adds the radii that `frame` has, or else the spacing of its particles.
    fn add_own_radii(&mut self, frame: &ParticleFrame, spacing: Option<(u64, Spacing)>) {
        match &frame.radius {
            Some(Radius::Common(radius)) => {
                self.has_radii = true;
                self.reach = self.reach.max(*radius);
            }
            Some(Radius::PerParticle(radii)) => {
                self.has_radii = true;
                self.reach = self.reach.max(robust_largest(radii.len(), |i| radii[i]));
            }
            None => self.spacings.extend(spacing),
        }
    }

    /// The survey of all frames that were added, in the unit of their positions.
    pub(super) fn finish(self, question: Question, up: DVec3) -> Survey {
        // Suppose a box of size 1 without particles
        let bounds = self.bounds.map(|bounds| bounds.outer);
        let (min, max) = bounds.unwrap_or((DVec3::splat(-0.5), DVec3::splat(0.5)));
        let color = self.color.finish(question.color);
        let rgb = rgb_colors(self.rgb, color.as_ref());
        let questions = question.styles.map(|styles| &styles.colors[..]).unwrap_or_default();
        let styles = self.styles.into_iter().zip(questions);
        let shared = match question.styles {
            Some(styles) if !styles.first_shares => self.shared.finish(styles.shared),
            _ => color.clone(),
        };
        let finished = |(total, question): (ColorTotals, &Option<ColorQuestion<'_>>)| match question
        {
            Some(question) => total.finish(*question),
            None => shared.clone(),
        };
        let styles = styles.map(finished).collect();
        // Use the origin of native frames: with a different one, they could not be traced in place.
        let origin = match self.origin {
            Origins::Shared(origin) => origin,
            Origins::None | Origins::Mixed => choose_origin(min, max),
        };
        let in_place = self.origin == Origins::Shared(origin);
        // Keep some of the points, relative to the origin
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
            styles,
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
            speed: self.speed,
            surfaces: self.surfaces,
        }
    }
}

/// The particles of a frame, as they are drawn.
struct Groups {
    /// Those without a style, and with them those of styles that have their colours.
    first: RawParticles,
    /// Those of each style.
    others: Vec<RawParticles>,
    /// Those that share colours, if they do so without the first ones.
    shared: Option<RawParticles>,
}

/// The particles of `raw` in groups; None if names have no value, which is reported later.
fn groups_of(styles: &StyleQuestions<'_>, raw: &RawParticles, up: DVec3) -> Option<Groups> {
    let division = Division { up: Some(up), ..styles.division.clone() };
    let all: Vec<u32> = (0..index_u32(raw.positions.len())).collect();
    let divided = division.divide(raw, &all).ok()?;
    let of = |indices: &[u32]| {
        let mut group = raw.clone();
        group.select(indices);
        group
    };
    let mut first = divided.order[..divided.ends[0]].to_vec();
    let (mut shared, mut others) = (Vec::new(), Vec::new());
    for (ends, color) in divided.ends.windows(2).zip(&styles.colors) {
        let own = &divided.order[ends[0]..ends[1]];
        others.push(of(own));
        if color.is_none() {
            shared.extend(own);
        }
    }
    if styles.first_shares {
        first.append(&mut shared);
        first.sort_unstable();
    }
    shared.sort_unstable();
    let shared = (!styles.first_shares).then(|| of(&shared));
    Some(Groups { first: of(&first), others, shared })
}

/// The colours of the attribute `rgb`, unless the range of another attribute was found: speed has precedence.
fn rgb_colors(rgb: Option<RgbAttribute>, color: Option<&ColorRange>) -> Option<RgbAttribute> {
    rgb.filter(|rgb| {
        let is_colored_by =
            |color: &ColorRange| rgb.attribute.eq_ignore_ascii_case(&color.attribute);
        color.is_none_or(is_colored_by)
    })
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
