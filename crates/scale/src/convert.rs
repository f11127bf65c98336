//! Makes the native frame for cells that are traced in place.

use std::path::Path;
use std::time::Instant;

use spherule_formats::ParticleFrame;
use spherule_formats::native::layout::RadiusIndex;
use spherule_formats::native::{self, Bound, StoreSettings};

use super::peaks::Peaks;
use super::{CellError, CellRequest, Particles};
use crate::report::Conversion;

/// Maximum error of compact positions, equal to the default of `convert`.
const BOUND: Bound = Bound::OfRadius(0.02);

/// Makes or reads the particles of `request` and writes them to `path` in its encoding.
///
/// # Errors
/// Describes why they do not fit into memory, cannot be read, or the file cannot be written.
pub fn convert(request: &CellRequest, path: &Path) -> Result<Conversion, CellError> {
    let settings =
        StoreSettings { encoding: request.representation.encoding(), bound: BOUND, rounding: 0.0 };
    let peaks = Peaks::default();
    let start = Instant::now();
    let particles = peaks.during(|| Particles::of(request))?;
    let load_seconds = start.elapsed().as_secs_f64();
    let frame = frame_of(particles, request);
    let store_start = Instant::now();
    let index = peaks.during(|| native::store(path, &frame, None, &settings))?;
    let seconds = store_start.elapsed().as_secs_f64();
    let length =
        path.metadata().map_err(|source| CellError::Io { path: path.to_owned(), source })?.len();
    // The maximum error is also given relative to the smallest radius
    let smallest = match index.radius {
        RadiusIndex::None => 0.0,
        RadiusIndex::Common(radius) => f64::from(radius),
        RadiusIndex::PerParticle(radii) => f64::from(radii.low),
    };
    Ok(Conversion {
        load_seconds,
        seconds,
        file_bytes: length,
        max_error: index.max_error,
        max_error_of_radius: (smallest > 0.0).then(|| index.max_error / smallest),
        rss: peaks.summary(),
    })
}

fn frame_of(particles: Particles, request: &CellRequest) -> ParticleFrame {
    ParticleFrame {
        positions: particles.centers,
        radius: Some(particles.radius),
        attributes: Vec::new(),
        origin: request.stage.origin,
        time: None,
        cell: None,
        bonds: Vec::new(),
        shapes: None,
        dropped: 0,
        file_index: None,
    }
}
