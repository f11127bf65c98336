//! Surveys a large file of another format without reading it into memory: it is streamed in runs.

use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;
use spherule_formats::convert::{ParticleSource, SourceAttribute};
use spherule_formats::{
    Attribute, Endian, FrameError, ParseError, Positions, RawParticles, sample_indices,
};

use super::packing::{self, Spacing, SpacingRequest};
use super::robust::{half_median_and_least, neighbour_queries};

/// Particles per read.
const RUN: usize = 1 << 16;
/// Particles per run of the sample: enough for reading a page of the file to be worthwhile.
const SAMPLE_RUN: usize = 64;

/// What the survey needs of many particles.
pub(super) type Streamed = (RawParticles, Option<Spacing>, Option<(DVec3, DVec3)>);

/// At most `most` particles of the file `path`, the spacing of all if there is a request and there are no radii, and the
/// bounding box of all.
pub(super) fn survey(
    source: &dyn ParticleSource,
    path: &Path,
    most: usize,
    request: Option<SpacingRequest>,
) -> Result<Streamed, FrameError> {
    let particles = sample(source, path, most)?;
    let is_radius = |a: &SourceAttribute| a.name.eq_ignore_ascii_case("radius");
    let has_radii = source.attributes().iter().any(is_radius);
    let spacing = match request.filter(|_| !has_radii) {
        Some(request) => spacing(source, &particles.positions, request)?,
        None => None,
    };
    Ok((particles, spacing, extremes(source)?))
}

/// Bounding box of all finite particles; `None` without any.
pub(super) fn extremes(source: &dyn ParticleSource) -> Result<Option<(DVec3, DVec3)>, FrameError> {
    let of_run = |positions: &[DVec3]| {
        let finite = positions.iter().filter(|p| p.is_finite());
        finite.fold(None, |box_: Option<(DVec3, DVec3)>, p| {
            let (min, max) = box_.unwrap_or((*p, *p));
            Some((min.min(*p), max.max(*p)))
        })
    };
    let join = |a: Option<(DVec3, DVec3)>, b: Option<(DVec3, DVec3)>| match (a, b) {
        (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
        (a, b) => a.or(b),
    };
    each_run(source, of_run, || None, join)
}

/// At most `most` particles of the file `path`, in short runs that are distributed over it.
pub(super) fn sample(
    source: &dyn ParticleSource,
    path: &Path,
    most: usize,
) -> Result<RawParticles, FrameError> {
    // Distribute the runs over the file
    let run_count = source.count().div_ceil(SAMPLE_RUN as u64);
    let runs = usize::try_from(run_count).unwrap_or(usize::MAX);
    let starts = || sample_indices(runs, (most / SAMPLE_RUN).max(1)).map(|run| run as u64);
    let run = |number: u64| {
        let first = number * SAMPLE_RUN as u64;
        let len = (source.count() - first).min(SAMPLE_RUN as u64);
        (first, usize::try_from(len).unwrap_or(SAMPLE_RUN))
    };
    // Read the positions
    let mut positions = Vec::new();
    for (first, len) in starts().map(run) {
        let start = positions.len();
        positions.resize(start + len, DVec3::ZERO);
        source.read_positions(first, &mut positions[start..])?;
    }
    // Read the attributes
    let mut attributes = Vec::with_capacity(source.attributes().len());
    for (number, attribute) in source.attributes().iter().enumerate() {
        let mut values = Vec::new();
        for (first, len) in starts().map(run) {
            let start = values.len();
            values.resize(start + len * attribute.width(), 0);
            source.read_values(number, first, &mut values[start..])?;
        }
        let decoded = decoded(attribute, &values);
        attributes.push(decoded.map_err(|e| e.in_file(path))?);
    }
    Ok(RawParticles {
        positions: Positions::F64(positions),
        attributes,
        time: source.time(),
        step: source.step(),
        labels: source.labels(),
        ..RawParticles::default()
    })
}

fn decoded(attribute: &SourceAttribute, values: &[u8]) -> Result<Attribute, ParseError> {
    Ok(Attribute {
        name: attribute.name.clone(),
        components: attribute.components,
        data: attribute.scalar.decode(Endian::Little, values)?,
    })
}

/// Some of the `sample`, for queries.
fn query_points(source: &dyn ParticleSource, sample: &Positions, frames: usize) -> Vec<DVec3> {
    let count = usize::try_from(source.count()).unwrap_or(usize::MAX);
    sample_indices(sample.len(), neighbour_queries(count, frames))
        .map(|i| sample.get(i))
        .filter(|p| p.is_finite())
        .collect()
}

/// The spacing of neighbours, from queries for some of the `sample` among all particles.
pub(super) fn spacing(
    source: &dyn ParticleSource,
    sample: &Positions,
    request: SpacingRequest,
) -> Result<Option<Spacing>, FrameError> {
    let queries = query_points(source, sample, request.frames);
    let Some((touching, closest)) = half_nearest(source, &queries)? else {
        return Ok(None);
    };
    let packed = if request.needs_packed {
        packing::packed_radius(touching, around(source, &queries, touching)?)
    } else {
        None
    };
    Ok(Some(Spacing { touching, closest, packed }))
}

/// Number of particles around each of `queries`.
fn around(
    source: &dyn ParticleSource,
    queries: &[DVec3],
    touching: f32,
) -> Result<Vec<u32>, FrameError> {
    let square = f64::from(packing::reach(touching)).powi(2);
    let of_run = |positions: &[DVec3]| {
        let count = |from: &DVec3| {
            let near = positions.iter().filter(|to| from.distance_squared(**to) <= square);
            near.map(|_| 1_u32).sum::<u32>()
        };
        queries.iter().map(count).collect::<Vec<u32>>()
    };
    let join = |mut a: Vec<u32>, b: Vec<u32>| {
        a.iter_mut().zip(&b).for_each(|(a, b)| *a += b);
        a
    };
    each_run(source, of_run, || vec![0; queries.len()], join)
}

/// Half the median distance from `queries` to the nearest neighbour among all particles, and half of what one of a hundred
/// has at most.
fn half_nearest(
    source: &dyn ParticleSource,
    queries: &[DVec3],
) -> Result<Option<(f32, f32)>, FrameError> {
    // Find the nearest neighbours within each run
    let of_run = |positions: &[DVec3]| {
        let nearest = |from: &DVec3| {
            let squares = positions.iter().map(|to| from.distance_squared(*to));
            squares.filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min)
        };
        queries.iter().map(nearest).collect::<Vec<f64>>()
    };
    // Join the runs: the nearest of all counts
    let join = |mut a: Vec<f64>, b: Vec<f64>| {
        a.iter_mut().zip(&b).for_each(|(a, b)| *a = a.min(*b));
        a
    };
    let far = || vec![f64::INFINITY; queries.len()];
    let nearest = each_run(source, of_run, far, join)?;
    let finite = nearest.into_iter().filter(|d| d.is_finite());
    #[expect(clippy::cast_possible_truncation, reason = "radii are f32")]
    let distances = finite.map(|square| square.sqrt() as f32).collect();
    Ok(half_median_and_least(distances))
}

/// Reads all positions in runs, and combines the results of `of_run`.
fn each_run<T: Send>(
    source: &dyn ParticleSource,
    of_run: impl Fn(&[DVec3]) -> T + Sync,
    nothing: impl Fn() -> T + Sync + Send,
    join: impl Fn(T, T) -> T + Sync + Send,
) -> Result<T, FrameError> {
    let runs = source.count().div_ceil(RUN as u64);
    (0..runs)
        .into_par_iter()
        .map_init(
            || vec![DVec3::ZERO; RUN],
            |positions, number| {
                let first = number * RUN as u64;
                let left = (source.count() - first).min(RUN as u64);
                let len = usize::try_from(left).unwrap_or(RUN);
                source.read_positions(first, &mut positions[..len])?;
                Ok(of_run(&positions[..len]))
            },
        )
        .try_reduce(&nothing, |a, b| Ok(join(a, b)))
}

#[cfg(test)]
mod tests {
    use spherule_formats::convert::{BoxSource, RawSource};
    use spherule_formats::generate::BoxSettings;

    use super::super::robust::spacing_of;
    use super::*;

    // Each of some thousand particles of the sample is searched for among all 200,000.
    #[test]
    fn streamed_survey_matches_a_survey_in_memory() {
        let source = BoxSource::new(BoxSettings::thesis(200_000, 3), None);
        let mut all = vec![DVec3::ZERO; 200_000];
        source.read_positions(0, &mut all).expect("there");
        let (min, max) = extremes(&source).expect("there").expect("some");
        assert!(all.iter().all(|p| p.cmpge(min).all() && p.cmple(max).all()));
        assert!(all.iter().any(|p| p.x == min.x) && all.iter().any(|p| p.z == max.z));
        let some = sample(&source, Path::new("box"), 4096).expect("there");
        assert!((3000..=4096).contains(&some.positions.len()));
        assert!((0..some.positions.len()).all(|i| all.contains(&some.positions.get(i))));
        let request = |needs_packed| SpacingRequest { needs_packed, frames: 1 };
        let streamed =
            spacing(&source, &some.positions, request(true)).expect("there").expect("some");
        let single = all.iter().map(|p| p.as_vec3()).collect();
        let whole = spacing_of(&single, request(true)).expect("some");
        let near = |a: f32, b: f32| assert!((a / b - 1.0).abs() < 0.1, "{a} {b}");
        near(streamed.touching, whole.touching);
        let packed = whole.packed.expect("requested");
        near(streamed.packed.expect("requested"), packed);
        // Nearest neighbours of randomly placed particles are close, so the two estimates differ.
        assert!(packed > 1.5 * whole.touching, "{packed} {whole:?}");
        let without_packed = spacing(&source, &some.positions, request(false)).expect("there");
        assert_eq!(without_packed, Some(Spacing { packed: None, ..streamed }));
    }

    #[test]
    fn nan_positions_have_no_extremes_and_no_spacing() {
        let raw = RawParticles {
            positions: Positions::F64(vec![DVec3::NAN; 3]),
            ..RawParticles::default()
        };
        let source = RawSource::new(Path::new("nan"), &raw).expect("whole");
        assert_eq!(extremes(&source).expect("there"), None);
        let request = SpacingRequest { needs_packed: true, frames: 1 };
        let spacing = spacing(&source, &raw.positions, request).expect("there");
        assert_eq!(spacing, None);
    }
}
