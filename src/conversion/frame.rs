//! One frame becomes a native one.

use std::fmt;
use std::time::Instant;

use serde::Serialize;
use spherule_formats::native::layout::RadiusIndex;
use spherule_formats::native::{self, FrameIndex, StoreSettings};
use spherule_formats::{FrameError, ParticleFrame, Radius, Sequence};

use super::attributes::Storage;
use super::{Conversion, ConvertTask};

/// What came of a frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConvertedFrame {
    /// Particles stored.
    pub particles: u64,
    /// Particles left out because a coordinate was not finite.
    pub dropped: u64,
    /// How positions are stored.
    pub encoding: &'static str,
    /// Bytes of positions and nodes.
    pub bytes: u64,
    /// No stored position is farther than this from the true one, scene units.
    pub max_error: f64,
    /// The same as a fraction of the smallest radius, if there is one.
    pub max_error_of_radius: Option<f64>,
    /// Wall time of the conversion, seconds.
    pub seconds: f64,
    /// What the user should know of the frame.
    #[serde(skip)]
    pub notes: Vec<String>,
}

/// Converts the frame of `task`: its file appears whole or not at all.
///
/// # Errors
/// [`FrameError`] if the frame cannot be read, or its file not be written.
pub fn convert_frame(
    conversion: &Conversion,
    sequence: &Sequence,
    task: &ConvertTask,
) -> Result<ConvertedFrame, FrameError> {
    let start = Instant::now();
    let settings = &conversion.settings;
    let loaded = sequence.load_measured(task.index)?;
    let raw = loaded.particles;
    let step = raw.step;
    let store = StoreSettings {
        encoding: settings.encoding,
        bound: settings.bound,
        rounding: raw.positions.rounding(conversion.origin),
    };
    let mut frame = ParticleFrame::from_raw(raw, conversion.origin);
    let own = frame.radius.take();
    frame.radius = match settings.radius {
        Some(radius) => Some(Radius::Common(radius)),
        None => own.or(conversion.estimate.map(Radius::Common)),
    };
    let is_stored = |name: &str| settings.attributes.of(name) != Storage::Off;
    frame.attributes.retain(|a| is_stored(&a.name));
    let index = native::store(&task.output, &frame, step, &store)?;
    Ok(ConvertedFrame::new(&index, start, loaded.notes))
}

impl ConvertedFrame {
    fn new(index: &FrameIndex, start: Instant, notes: Vec<String>) -> Self {
        let stored = [&index.positions, &index.wide, &index.nodes];
        let radius = match &index.radius {
            RadiusIndex::None => None,
            RadiusIndex::Common(radius) => Some(*radius),
            RadiusIndex::PerParticle(radii) => Some(radii.low),
        };
        let radius = radius.map(f64::from).filter(|radius| *radius > 0.0);
        Self {
            particles: index.count,
            dropped: index.dropped,
            encoding: index.encoding().name(),
            bytes: stored.iter().map(|section| section.len).sum(),
            max_error: index.max_error,
            max_error_of_radius: radius.map(|radius| index.max_error / radius),
            seconds: start.elapsed().as_secs_f64(),
            notes,
        }
    }
}

/// Count, bytes and error for people.
impl fmt::Display for ConvertedFrame {
    #[expect(clippy::cast_precision_loss, reason = "for people")]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let each = self.bytes as f64 / self.particles.max(1) as f64;
        write!(
            f,
            "{} particles, {}, {each:.2} bytes each for positions and nodes, largest error {:.3e}",
            self.particles, self.encoding, self.max_error
        )?;
        if let Some(fraction) = self.max_error_of_radius {
            write!(f, " ({fraction:.2e} of the smallest radius)")?;
        }
        if self.dropped > 0 {
            write!(f, ", {} dropped (not finite)", self.dropped)?;
        }
        write!(f, ", {:.2} s", self.seconds)
    }
}
