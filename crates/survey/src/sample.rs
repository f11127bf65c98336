//! Samples one frame for the survey: all of it, or for large frames a part, with the rest taken from the index or
//! read in runs.

use std::path::Path;

use glam::DVec3;
use spherule_formats::convert::{RawSource, open_source};
use spherule_formats::native::layout::RadiusIndex;
use spherule_formats::native::{Access, FrameIndex, NativeFile, NativeFrame};
use spherule_formats::sequence::Sequence;
use spherule_formats::{
    FrameError, ParseError, PositionSlice, Positions, RawParticles, choose_origin, find_radius,
    is_near,
};
use spherule_selection::Selection;

use super::packing::{self, Spacing, SpacingRequest};
use super::robust::{self, NEIGHBOUR_QUERIES, half_median_and_least, robust_bounds};
use super::stream;
use super::{FrameWeight, Question, id_of, velocity_of};

/// Number of particles to sample in a native frame; smaller frames are read completely.
const MAX_SAMPLE: usize = 1 << 17;

/// Particle count above which a binary file of another format is sampled and not read into memory.
const LARGE: u64 = 1 << 20;

/// A sample of a frame.
pub(super) struct FrameSample {
    /// The particles, or some of them.
    pub(super) particles: RawParticles,
    /// Number of particles of the frame that are drawn.
    pub(super) count: usize,
    /// Bounding box of all particles, if it is known.
    pub(super) extremes: Option<(DVec3, DVec3)>,
    /// The spacing of neighbours among all particles, if it was requested.
    pub(super) spacing: Option<Spacing>,
    /// Origin of the coordinates in a native frame.
    pub(super) origin: Option<DVec3>,
    pub(super) weight: FrameWeight,
}

impl FrameSample {
    /// Samples frame `index` of `sequence`, one of `frames` frames.
    pub(super) fn of(
        sequence: &Sequence,
        index: usize,
        (question, frames): (Question, usize),
    ) -> Result<Self, FrameError> {
        let request = question.radius.spacing(frames);
        let whole = match question.selection {
            // Few of the particles of a sample may be drawn; the spacing is the same as without a selection
            Some(selection) if !selection.is_all() => Self {
                spacing: Self::spacing_of_large(sequence, index, request)?,
                ..Self::of_files(sequence, index)?
            },
            _ => Self::of_source(sequence, index, request)?,
        };
        let mut sample = whole.of_question(question, request);
        let time = &mut sample.particles.time;
        *time = sequence.listed_time(index).or(*time);
        Ok(sample)
    }

    /// The spacing of a frame that would not be read as a whole without a selection; None for others.
    fn spacing_of_large(
        sequence: &Sequence,
        index: usize,
        request: Option<SpacingRequest>,
    ) -> Result<Option<Spacing>, FrameError> {
        if request.is_none() {
            return Ok(None);
        }
        let sample = match sequence.native_file(index) {
            Some(_) => Some(Self::of_source(sequence, index, request)?),
            None => Self::of_large(sequence, index, request)?,
        };
        Ok(sample.and_then(|sample| sample.spacing))
    }

    /// Whether there are more particles than those that were sampled.
    pub(super) fn is_part(&self) -> bool {
        self.particles.positions.len() < self.count
    }

    fn of_source(
        sequence: &Sequence,
        index: usize,
        request: Option<SpacingRequest>,
    ) -> Result<Self, FrameError> {
        match sequence.native_file(index) {
            Some(path) => {
                let file = NativeFile::open(path, Access::Map)?;
                let sample = Self::of_native(&file, request).map_err(|e| e.in_file(path))?;
                file.check()?;
                Ok(sample)
            }
            None => match Self::of_large(sequence, index, request)? {
                Some(sample) => Ok(sample),
                None => Self::of_files(sequence, index),
            },
        }
    }

    /// Samples a binary file of many particles; None for other files.
    fn of_large(
        sequence: &Sequence,
        index: usize,
        request: Option<SpacingRequest>,
    ) -> Result<Option<Self>, FrameError> {
        // Other files are read as a whole
        let Some(path) = sequence.lone_file(index) else {
            return Ok(None);
        };
        let Some(source) = open_source(path)?.filter(|s| s.count() > LARGE) else {
            return Ok(None);
        };
        // Read the file once, for positions, spacing and bounds
        let (particles, spacing, extremes) = stream::survey(&*source, path, MAX_SAMPLE, request)?;
        source.check()?;
        // Estimate the memory of the frame from its attributes
        let stored = std::fs::metadata(path).map_or(0, |meta| meta.len());
        let widths = source.attributes().iter().map(|a| a.width() as u64);
        let count = source.count();
        let attributes = count.saturating_mul(widths.sum());
        // The length of the file shows whether positions are in double precision.
        let is_double = stored >= attributes.saturating_add(count.saturating_mul(24));
        let position_len = source.position_len().unwrap_or(if is_double { 24 } else { 12 });
        let positions = count.saturating_mul(position_len);
        Ok(Some(Self {
            weight: FrameWeight {
                particles: count,
                stored,
                content: stored,
                raw: positions.saturating_add(attributes),
                positions,
                files: 1,
                own_radii: false,
                ids: id_of(&particles.attributes).is_some(),
                velocities: velocity_of(&particles.attributes).is_some(),
                in_place: false,
            },
            count: usize::try_from(count).unwrap_or(usize::MAX),
            extremes,
            spacing,
            origin: None,
            particles,
        }))
    }

    /// Samples particles in memory as if they were in a file called `name`.
    pub(super) fn of_memory(
        name: &str,
        raw: &RawParticles<PositionSlice<'_>>,
        question: Question,
    ) -> Result<Self, FrameError> {
        // Sample many particles in runs, unless a selection needs all
        let path = Path::new(name);
        let source = RawSource::borrowed(path, raw)?;
        let count = raw.positions.len();
        let request = question.radius.spacing(1);
        let (mut spacing, mut part) = (None, None);
        if count as u64 > LARGE {
            let (particles, found, extremes) = stream::survey(&source, path, MAX_SAMPLE, request)?;
            spacing = found;
            let is_whole = question.selection.is_none_or(Selection::is_all);
            part = is_whole.then_some((particles, extremes));
        }
        let (particles, extremes) = part.unwrap_or_else(|| (raw.to_owned_particles(), None));
        // Describe them like those of a file
        let sample = Self {
            weight: FrameWeight {
                particles: count as u64,
                ids: id_of(&raw.attributes).is_some(),
                velocities: velocity_of(&raw.attributes).is_some(),
                ..FrameWeight::default()
            },
            count,
            extremes,
            spacing,
            origin: None,
            particles,
        };
        Ok(sample.of_question(question, request))
    }

    fn of_files(sequence: &Sequence, index: usize) -> Result<Self, FrameError> {
        let loaded = sequence.load_measured(index)?;
        let raw = &loaded.particles;
        let weight = FrameWeight {
            particles: raw.positions.len() as u64,
            stored: loaded.all_bytes,
            content: loaded.content_bytes,
            raw: raw.byte_len(),
            positions: raw.positions.byte_len(),
            files: sequence.inputs(index).len() as u64,
            // Determined later, after the radii have been extracted.
            own_radii: false,
            ids: id_of(&raw.attributes).is_some(),
            velocities: velocity_of(&raw.attributes).is_some(),
            in_place: false,
        };
        Ok(Self {
            count: raw.positions.len(),
            extremes: None,
            spacing: None,
            origin: None,
            weight,
            particles: loaded.particles,
        })
    }

    /// The sample without the particles that are not drawn, or that cuts leave out. The spacing is that of all of them:
    /// a slice or every tenth particle has spheres of the same size.
    fn of_question(mut self, question: Question, request: Option<SpacingRequest>) -> Self {
        let has_radius = find_radius(&self.particles.attributes).is_some();
        if let Some(request) = request.filter(|_| !has_radius && self.spacing.is_none()) {
            self.spacing = spacing_of(&self.particles.positions, request);
        }
        let Some(selection) = question.selection else {
            return self;
        };
        // A name without a value is reported later, with the attributes that there are
        if let Ok(survivors) = selection.survivors(&self.particles)
            && !selection.is_all()
        {
            self.particles.select(&survivors);
            self.count = survivors.len();
        }
        // A thin slice may cut spheres without their centres
        if let Ok(survivors) = selection.of_cuts().survivors(&self.particles)
            && !selection.cuts.is_empty()
            && !survivors.is_empty()
        {
            self.particles.select(&survivors);
            self.extremes = None;
        }
        self
    }

    fn of_native(file: &NativeFile, request: Option<SpacingRequest>) -> Result<Self, ParseError> {
        // Find out whether all particles are read
        let frame = file.frame_unchecked();
        let index = file.index();
        let too_many = |_| ParseError::unsupported("more particles than this machine can count");
        let count = usize::try_from(index.count).map_err(too_many)?;
        let is_part = count > MAX_SAMPLE;
        if !is_part {
            // Small frames are verified completely: it takes little time, and damage might not show in percentiles.
            frame.verify()?;
        }
        // Read some of the particles, and the spacing of all if nothing gives a radius
        frame.verify_nodes()?;
        let particles = frame.sample(MAX_SAMPLE)?;
        let spacing = match (index.radius, request) {
            (RadiusIndex::None, Some(request)) if is_part => stored_spacing(&frame, request)?,
            _ => None,
        };
        // Bounds are in the index
        let origin = DVec3::from_array(index.origin);
        let corner = |c: [f32; 3]| glam::Vec3::from_array(c).as_dvec3() + origin;
        Ok(Self {
            weight: weight(file, &particles),
            count,
            extremes: is_part.then(|| (corner(index.min), corner(index.max))),
            spacing,
            origin: Some(origin),
            particles,
        })
    }
}

/// The spacing of neighbours among `positions`.
fn spacing_of(positions: &Positions, request: SpacingRequest) -> Option<Spacing> {
    let bounds = robust_bounds(positions, None)?;
    let origin = choose_origin(bounds.outer.0, bounds.outer.1);
    let relative = (0..positions.len()).map(|i| (positions.get(i) - origin).as_vec3());
    robust::spacing_of(&relative.filter(is_near).collect(), request)
}

/// The spacing of neighbours in a native frame.
fn stored_spacing(
    frame: &NativeFrame<'_>,
    request: SpacingRequest,
) -> Result<Option<Spacing>, ParseError> {
    let distances = frame.neighbour_distances(NEIGHBOUR_QUERIES)?;
    let Some((touching, closest)) = half_median_and_least(distances) else {
        return Ok(None);
    };
    let packed = if request.needs_packed {
        let counts = frame.neighbour_counts(NEIGHBOUR_QUERIES, packing::reach(touching))?;
        packing::packed_radius(touching, counts)
    } else {
        None
    };
    Ok(Some(Spacing { touching, closest, packed }))
}

/// Size of a native frame as if it were read, because some settings require that.
fn weight(file: &NativeFile, particles: &RawParticles) -> FrameWeight {
    let index: &FrameIndex = file.index();
    // Estimate the numbers in memory, in double precision if the origin requires it
    let positions = if index.origin == [0.0; 3] { 12 } else { 24 };
    let attributes = index.attributes.iter().map(|a| a.section.len);
    let radii = match index.radius {
        RadiusIndex::None => 0,
        RadiusIndex::Common(_) | RadiusIndex::PerParticle(_) => 4,
    };
    let positions = positions * index.count;
    FrameWeight {
        particles: index.count,
        stored: file.byte_len(),
        content: file.byte_len(),
        raw: attributes.fold(positions + radii * index.count, u64::saturating_add),
        positions,
        files: 1,
        own_radii: matches!(index.radius, RadiusIndex::PerParticle(_)),
        ids: id_of(&particles.attributes).is_some(),
        velocities: velocity_of(&particles.attributes).is_some(),
        in_place: true,
    }
}
