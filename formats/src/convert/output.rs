//! The output frame of a conversion, started when the first part is in order.

use super::columns::StoredColumns;
use super::order::{OrderedPart, PartData};
use super::settings::{ConvertError, Phase, RadiusRule};
use super::survey::{ConvertRequest, Survey};
use crate::FrameError;
use crate::native::{
    FrameDetails, FrameIndex, FrameSpec, FrameWriter, RadiusSpec, radius_range, smallest_encoding,
};

/// Writes ordered parts to the output frame.
pub(super) struct FrameOutput<'a> {
    pub(super) request: ConvertRequest<'a>,
    pub(super) columns: &'a StoredColumns,
    pub(super) survey: &'a Survey,
    /// Largest error of each attribute, known before the first part is written.
    pub(super) errors: Vec<f64>,
    /// The radius of all particles, if they have radii of their own that are all equal.
    common: Option<f32>,
    run_len: usize,
    pushed: u64,
    writer: Option<FrameWriter>,
}

impl<'a> FrameOutput<'a> {
    pub(super) fn new(
        request: ConvertRequest<'a>,
        columns: &'a StoredColumns,
        survey: &'a Survey,
        common: Option<f32>,
        run_len: usize,
    ) -> Self {
        Self {
            request,
            columns,
            survey,
            errors: vec![0.0; columns.attributes.len()],
            common,
            run_len,
            pushed: 0,
            writer: None,
        }
    }

    /// Writes `part` in the order of `ordered`.
    pub(super) fn push(
        &mut self,
        part: &PartData,
        ordered: &mut OrderedPart,
    ) -> Result<(), ConvertError> {
        // The first part starts the frame: the encoding depends on its positions
        let mut writer = match self.writer.take() {
            Some(writer) => writer,
            None => self.begin(ordered)?,
        };
        // Write it in runs, and report progress after each
        let mut first = 0;
        while first < part.len() {
            let end = part.len().min(first + self.run_len);
            ordered
                .push(part, self.columns, first..end, &mut writer)
                .map_err(|e| FrameError::io(self.request.path, e))?;
            self.pushed += (end - first) as u64;
            self.request.advance(Phase::Order, self.pushed, self.survey.count)?;
            first = end;
        }
        self.writer = Some(writer);
        Ok(())
    }

    /// Completes the frame, if the source did not change meanwhile.
    pub(super) fn finish(mut self) -> Result<FrameIndex, ConvertError> {
        let writer = match self.writer.take() {
            Some(writer) => writer,
            None => self.begin(&OrderedPart::default())?,
        };
        self.request.source.check()?;
        let total = self.survey.count;
        self.request.advance(Phase::Finish, total, total)?;
        let finished = writer.finish();
        Ok(finished.map_err(|e| FrameError::io(self.request.path, e))?)
    }

    /// Starts the frame; `ordered` are its first particles.
    fn begin(&self, ordered: &OrderedPart) -> Result<FrameWriter, ConvertError> {
        let ConvertRequest { source, settings, path, .. } = self.request;
        // Find the common radius
        let own = self.survey.radii.filter(|_| self.columns.radius.is_some());
        let common = match settings.radius {
            RadiusRule::All(radius) => Some(radius),
            RadiusRule::Source { otherwise } => {
                self.common.or(source.common_radius()).or(otherwise)
            }
        };
        // Choose the encoding
        let smallest = own.map(|[low, _]| low).or(common);
        let encoding = settings
            .encoding
            .unwrap_or_else(|| smallest_encoding(&ordered.positions, settings.bound, smallest));
        // Describe the frame
        let attributes = self.columns.attributes.iter().zip(&self.errors);
        let spec = FrameSpec {
            is_y_up: self.request.settings.is_y_up,
            count: self.survey.count,
            encoding,
            bound: settings.bound,
            origin: settings.origin,
            rounding: self.survey.rounding,
            radius: match (own, common) {
                (Some(ends), _) => {
                    RadiusSpec::PerParticle(radius_range(ends, encoding, settings.bound))
                }
                (None, Some(radius)) => RadiusSpec::Common(radius),
                (None, None) => RadiusSpec::None,
            },
            attributes: attributes.map(|(column, error)| column.spec(*error)).collect(),
            time: settings.time.or(source.time()),
            step: source.step(),
            dropped: source.count() - self.survey.count,
            details: FrameDetails { labels: source.labels(), cell: source.cell() },
        };
        Ok(FrameWriter::create(path, spec).map_err(|e| FrameError::io(path, e))?)
    }
}
