//! Converts one frame.

use std::fmt;
use std::time::Instant;

use serde::Serialize;
use spherule_formats::convert::{
    self, AttributeChoice, ConvertError, ConvertReport, NativeSource, ParticleSource, Progress,
    RadiusRule, RawSource, SourceAttribute, convert, open_source,
};
use spherule_formats::native::layout::RadiusIndex;
use spherule_formats::native::{Access, NativeFile};
use spherule_formats::{ScalarType, Sequence};

use super::attributes::{AttributeChoices, Storage};
use super::{Conversion, ConvertTask};

/// The result of converting a frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConvertedFrame {
    /// Number of particles stored.
    pub particles: u64,
    /// Particles that were dropped because a coordinate was not finite.
    pub dropped: u64,
    /// Encoding of positions.
    pub encoding: &'static str,
    /// Bytes of positions and nodes.
    pub bytes: u64,
    /// Largest position error, scene units.
    pub max_error: f64,
    /// Largest position error as a fraction of the smallest radius, if there is one.
    pub max_error_of_radius: Option<f64>,
    /// Wall-clock time of the conversion, seconds.
    pub seconds: f64,
    /// Wall-clock time by phase, seconds.
    pub phases: Vec<(&'static str, f64)>,
    /// Peak of anonymous memory, as counted by the conversion.
    pub peak_bytes: u64,
    /// Bytes written to temporary files.
    pub spilled_bytes: u64,
    /// Number of parts that were sorted separately.
    pub parts: usize,
    /// Notes for the user.
    #[serde(skip)]
    pub notes: Vec<String>,
}

/// Converts the frame of `task`. Its file appears complete or not at all. Binary files are mapped and streamed;
/// other files are read into memory.
///
/// # Errors
/// [`ConvertError`] if the frame cannot be read, cannot be stored with these settings, or cannot be written.
pub fn convert_frame(
    conversion: &Conversion,
    sequence: &Sequence,
    task: &ConvertTask,
    progress: &dyn Progress,
) -> Result<ConvertedFrame, ConvertError> {
    let start = Instant::now();
    let convert = |source: &dyn ParticleSource, notes: Vec<String>| {
        let settings = convert::ConvertSettings {
            time: sequence.listed_time(task.index),
            ..conversion.engine_settings(source)
        };
        let report = convert(source, &task.output, &settings, progress)?;
        Ok(ConvertedFrame::new(&report, start, notes))
    };
    // Convert a native frame again
    if let Some(path) = sequence.native_file(task.index) {
        let file = NativeFile::open(path, Access::Map)?;
        file.frame()?.verify().map_err(|e| e.in_file(path))?;
        return convert(&NativeSource::new(&file)?, Vec::new());
    }
    // Stream a binary file
    let streamed = sequence.lone_file(task.index).map(open_source).transpose()?;
    if let Some(source) = streamed.flatten() {
        return convert(&*source, source.notes().to_vec());
    }
    // Read everything else into memory
    let loaded = sequence.load_measured(task.index)?;
    let inputs = sequence.inputs(task.index);
    let path = inputs.first().copied().unwrap_or(&task.output);
    let source = RawSource::new(path, &loaded.particles)?;
    convert(&source, loaded.notes)
}

impl Conversion {
    /// The settings of the conversion library for a frame from `source`.
    fn engine_settings(&self, source: &dyn ParticleSource) -> convert::ConvertSettings {
        let settings = &self.settings;
        // Choose how to store each attribute of the source
        let choice = |attribute: &SourceAttribute| {
            let choice = settings.attributes.choice(attribute);
            (attribute.name.clone(), choice)
        };
        convert::ConvertSettings {
            encoding: settings.encoding,
            bound: settings.bound,
            origin: self.origin,
            is_y_up: self.is_y_up,
            radius: match settings.radius {
                Some(radius) => RadiusRule::All(radius),
                None => RadiusRule::Source { otherwise: self.estimate },
            },
            memory: settings.memory.map_or(convert::ConvertSettings::USUAL_MEMORY, |m| m.0),
            other_attributes: AttributeChoice::AsIs,
            attributes: source.attributes().iter().map(choice).collect(),
            keep_ids: settings.keep_ids,
            time: None,
            scratch_dir: None,
        }
    }
}

impl AttributeChoices {
    /// The storage of an attribute of a source. The rule for other attributes (`*`) does not apply to integers and
    /// radii, which would lose too much precision.
    fn choice(&self, attribute: &SourceAttribute) -> AttributeChoice {
        let storage = self.of(&attribute.name);
        let is_float = matches!(attribute.scalar, ScalarType::F32 | ScalarType::F64);
        let is_radius = attribute.name.eq_ignore_ascii_case("radius");
        let applies = self.names(&attribute.name) || is_float && !is_radius;
        match storage {
            Storage::Off => AttributeChoice::LeaveOut,
            Storage::F32 if applies => AttributeChoice::Single,
            Storage::F16 if applies => AttributeChoice::Half,
            Storage::U8 if applies => AttributeChoice::Ranged,
            _ => AttributeChoice::AsIs,
        }
    }
}

impl ConvertedFrame {
    fn new(report: &ConvertReport, start: Instant, notes: Vec<String>) -> Self {
        let index = &report.index;
        let stored = [&index.positions, &index.wide, &index.nodes];
        // Find the smallest radius, for the error in radii
        let smallest = match &index.radius {
            RadiusIndex::None => None,
            RadiusIndex::Common(radius) => Some(*radius),
            RadiusIndex::PerParticle(radii) => Some(radii.low),
        };
        let radius = smallest.map(f64::from).filter(|radius| *radius > 0.0);
        Self {
            particles: index.count,
            dropped: index.dropped,
            encoding: index.encoding().name(),
            bytes: stored.iter().map(|section| section.len).sum(),
            max_error: index.max_error,
            max_error_of_radius: radius.map(|radius| index.max_error / radius),
            seconds: start.elapsed().as_secs_f64(),
            phases: report.seconds.iter().map(|(p, s)| (p.name(), *s)).collect(),
            peak_bytes: report.peak_bytes,
            spilled_bytes: report.spilled_bytes,
            parts: report.parts,
            notes,
        }
    }
}

/// Count, bytes and error.
impl fmt::Display for ConvertedFrame {
    #[expect(clippy::cast_precision_loss, reason = "only displayed")]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let each = self.bytes as f64 / self.particles.max(1) as f64;
        write!(
            f,
            "{} particles, {}, {each:.2} bytes per particle for positions and nodes, largest error {:.3e}",
            self.particles, self.encoding, self.max_error
        )?;
        if let Some(fraction) = self.max_error_of_radius {
            write!(f, " ({fraction:.2e} of the smallest radius)")?;
        }
        if self.dropped > 0 {
            write!(f, ", {} dropped (not finite or too far away)", self.dropped)?;
        }
        write!(f, ", {:.2} s", self.seconds)
    }
}
