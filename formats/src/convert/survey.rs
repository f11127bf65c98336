//! The first pass over the source: number of particles, ranges of their values, and a sample of their positions.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::Vec3;
use rayon::prelude::*;

use super::batch::{Batch, BufferPool, ParticleRange};
use super::columns::{StoredColumn, StoredColumns};
use super::settings::{ConvertError, ConvertSettings, Phase, Progress};
use super::source::ParticleSource;
use crate::native::StoredType;
use crate::{is_near, is_radius};

/// The result of the first pass.
#[derive(Debug)]
pub(super) struct Survey {
    /// Particles with finite positions.
    pub(super) count: u64,
    /// The number of particles with finite positions in each batch.
    pub(super) kept: Vec<u32>,
    /// Largest distance that rounding to f32 moves a position, scene units.
    pub(super) rounding: f64,
    /// Smallest and largest radius, if particles have radii of their own.
    pub(super) radii: Option<[f32; 2]>,
    /// A sample of the positions, spread over the source.
    pub(super) sample: Vec<Vec3>,
    /// The range of each component of each column, for columns that store ranges.
    ranges: Vec<Vec<[f64; 2]>>,
}

/// How a source is read in batches.
#[derive(Debug, Clone, Copy)]
pub(super) struct BatchSettings {
    /// Particles of a batch.
    pub(super) batch_len: usize,
    /// One particle out of this many is in the sample; 0 for no sample.
    pub(super) sample_stride: u64,
}

/// The survey of one batch.
#[derive(Debug, Default)]
struct BatchSurvey {
    kept: u32,
    rounding_squared: f64,
    radii: Option<[f32; 2]>,
    bad_radii: bool,
    sample: Vec<Vec3>,
    ranges: Vec<Vec<[f64; 2]>>,
}

/// The arguments of a conversion.
#[derive(Clone, Copy)]
pub(super) struct ConvertRequest<'a> {
    pub(super) source: &'a dyn ParticleSource,
    pub(super) path: &'a Path,
    pub(super) settings: &'a ConvertSettings,
    pub(super) progress: &'a dyn Progress,
}

impl ConvertRequest<'_> {
    /// Reports the progress.
    ///
    /// # Errors
    /// If the progress callback cancels the conversion.
    pub(super) fn advance(&self, phase: Phase, done: u64, total: u64) -> Result<(), ConvertError> {
        if self.progress.advanced(phase, done, total).is_break() {
            return Err(ConvertError::Interrupted);
        }
        Ok(())
    }

    /// The error for a source that no longer returns the same data.
    pub(super) fn changed(&self) -> ConvertError {
        let checked = self.source.check().map_err(ConvertError::from);
        let what = "the source changed while it was converted; convert again when it rests";
        checked.err().unwrap_or_else(|| ConvertError::refused(self.path, what))
    }
}

/// Reads all particles once.
pub(super) fn survey(
    request: ConvertRequest,
    columns: &StoredColumns,
    reading: BatchSettings,
) -> Result<Survey, ConvertError> {
    let total = request.source.count();
    let stretches = total.div_ceil(reading.batch_len as u64);
    let (batches, done) = (BufferPool::<Batch>::default(), AtomicU64::new(0));
    // Survey batches in parallel; the results keep the order of the source
    let found: Vec<BatchSurvey> = (0..stretches)
        .into_par_iter()
        .map(|number| {
            let stretch = ParticleRange::nth(number, reading.batch_len, total);
            let mut batch = batches.take();
            let found = survey_range(request, columns, &mut batch, stretch, reading.sample_stride)?;
            batches.put(batch);
            let now = done.fetch_add(stretch.len as u64, Ordering::Relaxed) + stretch.len as u64;
            request.advance(Phase::Survey, now, total)?;
            Ok(found)
        })
        .collect::<Result<_, ConvertError>>()?;
    gathered(request.path, columns, found)
}

/// Surveys the particles of `stretch`, which are read into `batch`.
fn survey_range(
    request: ConvertRequest,
    columns: &StoredColumns,
    batch: &mut Batch,
    stretch: ParticleRange,
    stride: u64,
) -> Result<BatchSurvey, ConvertError> {
    let origin = request.settings.origin;
    // Read the positions
    batch.read_positions(request.source, origin, stretch)?;
    let mut found = BatchSurvey {
        kept: u32::try_from(batch.positions.len()).unwrap_or(u32::MAX),
        ..BatchSurvey::default()
    };
    // Measure how far rounding moves them
    let mut kept = batch.positions.iter();
    batch.for_each_place(|place| {
        if let Some(position) = kept.next() {
            let moved = (position.as_dvec3() + origin).distance_squared(batch.world[place]);
            found.rounding_squared = found.rounding_squared.max(moved);
        }
    });
    // Take the sample
    found.sample = sample_of(batch, origin, stretch, stride);
    // Find the range of the radii
    if let Some(radius) = &columns.radius {
        let width = request.source.attributes()[radius.attribute].width();
        batch.read_values(request.source, radius.attribute, width, stretch)?;
        batch.for_each_place(|place| {
            for radius in radius.radii(&batch.values[place * width..][..width]) {
                found.bad_radii |= !is_radius(radius);
                let [low, high] = found.radii.unwrap_or([radius; 2]);
                found.radii = Some([low.min(radius), high.max(radius)]);
            }
        });
    }
    // Find the ranges of the attributes
    for column in &columns.attributes {
        let ranges = column_ranges(request, column, batch, stretch)?;
        found.ranges.push(ranges);
    }
    Ok(found)
}

/// The range of each component of `column` in `stretch`; empty if the column does not store ranges.
fn column_ranges(
    request: ConvertRequest,
    column: &StoredColumn,
    batch: &mut Batch,
    stretch: ParticleRange,
) -> Result<Vec<[f64; 2]>, ConvertError> {
    let (StoredType::Ranged, Some(attribute)) = (column.stored, column.attribute) else {
        return Ok(Vec::new());
    };
    let (width, size) = (column.source_width(), column.scalar.size());
    batch.read_values(request.source, attribute, width, stretch)?;
    let mut ranges = vec![[f64::INFINITY, f64::NEG_INFINITY]; column.components];
    batch.for_each_place(|place| {
        let values = batch.values[place * width..][..width].chunks_exact(size);
        for (bytes, [low, high]) in values.zip(&mut ranges) {
            let value = StoredType::Plain(column.scalar).value(bytes, [0.0; 2]);
            // NaN must not be ignored: an infinite range is reported as an error.
            let end = if value.is_nan() { f64::INFINITY } else { value };
            (*low, *high) = (low.min(end), high.max(end));
        }
    });
    Ok(ranges)
}

/// A sample with one particle of each run of `stride`, at a pseudo-random index, because sources are often
/// ordered. The chosen particles do not depend on how the source is cut into batches.
fn sample_of(batch: &Batch, origin: glam::DVec3, stretch: ParticleRange, stride: u64) -> Vec<Vec3> {
    let mut sample = Vec::new();
    if stride == 0 {
        return sample;
    }
    let end = stretch.first + stretch.len as u64;
    for run in stretch.first / stride..end.div_ceil(stride) {
        let hash = run.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32;
        let place = run * stride + hash % stride;
        if (stretch.first..end).contains(&place) {
            #[expect(clippy::cast_possible_truncation, reason = "within a stretch")]
            let position = batch.world[(place - stretch.first) as usize];
            sample.push((position - origin).as_vec3());
        }
    }
    sample.retain(is_near);
    sample
}

fn gathered(
    path: &Path,
    columns: &StoredColumns,
    found: Vec<BatchSurvey>,
) -> Result<Survey, ConvertError> {
    let mut survey = Survey {
        count: 0,
        kept: Vec::with_capacity(found.len()),
        rounding: 0.0,
        radii: None,
        sample: Vec::new(),
        ranges: vec![Vec::new(); columns.attributes.len()],
    };
    // Merge the surveys of the batches in order
    for one in found {
        if one.bad_radii {
            let what = "a radius is negative or not a number; give one radius for all particles";
            return Err(ConvertError::refused(path, what));
        }
        survey.count += u64::from(one.kept);
        survey.kept.push(one.kept);
        survey.rounding = survey.rounding.max(one.rounding_squared);
        survey.radii = match (survey.radii, one.radii) {
            (Some(a), Some(b)) => Some([a[0].min(b[0]), a[1].max(b[1])]),
            (a, b) => a.or(b),
        };
        survey.sample.extend(one.sample);
        for (all, own) in survey.ranges.iter_mut().zip(one.ranges) {
            if all.is_empty() {
                *all = own;
            } else {
                for (all, own) in all.iter_mut().zip(own) {
                    *all = [all[0].min(own[0]), all[1].max(own[1])];
                }
            }
        }
    }
    survey.rounding = survey.rounding.sqrt();
    Ok(survey)
}

impl Survey {
    /// The columns with the ranges found by the survey. If all radii are equal, the radius column is removed
    /// and the common radius is returned as the second value.
    pub(super) fn settled(
        &self,
        path: &Path,
        mut columns: StoredColumns,
    ) -> Result<(StoredColumns, Option<f32>), ConvertError> {
        // Check and set the ranges
        for (column, ranges) in columns.attributes.iter_mut().zip(&self.ranges) {
            if column.stored != StoredType::Ranged {
                continue;
            }
            let is_finite = |range: &[f64; 2]| (range[1] - range[0]).is_finite();
            if self.count > 0 && !ranges.iter().all(is_finite) {
                let name = &column.name;
                let what = format!(
                    "attribute {name} has values that are not finite, which 8 bits cannot hold; store it as it is"
                );
                return Err(ConvertError::refused(path, what));
            }
            column.ranges =
                if self.count > 0 { ranges.clone() } else { vec![[0.0; 2]; column.components] };
        }
        // Replace equal radii by a common one
        let common = self.radii.filter(|[low, high]| low == high);
        if common.is_some() || self.count == 0 {
            columns.radius = None;
        }
        Ok((columns, common.map(|[low, _]| low)))
    }
}
