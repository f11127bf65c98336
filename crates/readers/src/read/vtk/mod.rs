//! Legacy VTK (`.vtk`), versions 1 to 5.1, ASCII and binary: the points of POLYDATA and
//! UNSTRUCTURED_GRID with all numeric point data.
//!
//! The file is walked line by line: a keyword line determines how many bytes of payload follow, exactly
//! those are taken or skipped, so nothing is ever searched for inside binary data. Cells and cell
//! data are stepped over: points without cells are particles too. `mesh` takes the cells instead of the point data.
//! Grids are refused. Layout after "VTK File Formats" (the VTK user's guide) and after files of VTK 9,
//! SPlisHSPlasH and others.

mod ascii;
mod attributes;
mod cursor;
mod keywords;
mod mesh;
mod payload;
mod positions;
#[cfg(test)]
mod tests;
mod types;
mod walk;

pub(in crate::read) use ascii::parse_values;
pub use mesh::read_mesh;
pub(in crate::read) use positions::positions;

use super::columns::{ParticleLayout, StridedColumn};
use super::input::TextInput;
use super::{ByteSource, Step};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{Attribute, MemoryBudget, ParseError, RawParticles};
use walk::{PointArray, WalkEnd, Walker};

/// More than any tensor or spectrum has. With no particles nothing else bounds the number, and
/// callers keep something for each component.
pub(in crate::read) const MAX_COMPONENTS: usize = 1 << 16;

/// A particle may have this many numbers, however few particles there are.
const FEW_COMPONENTS: usize = 4096;

/// Legacy VTK, text or binary.
pub const FORMAT: Format = Format::new(&LegacyVtk);

struct LegacyVtk;

impl Reader for LegacyVtk {
    fn info(&self) -> FormatInfo {
        FormatInfo::new("vtk", &["vtk"])
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        const MAGIC: &[u8] = b"# vtk DataFile";
        let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
        let start = text.get(..MAGIC.len());
        let is_vtk = start.is_some_and(|start| start.eq_ignore_ascii_case(MAGIC));
        Ok(Confidence::signature_if(is_vtk))
    }

    /// Words, if numbers are text.
    fn stream_unit(&self, head: &[u8]) -> Option<StreamUnit> {
        let mut text = TextInput::whole(head);
        let walker = Walker::begin(&mut text, MemoryBudget::UNLIMITED).ok()?;
        walker.is_text().then_some(StreamUnit::Words)
    }

    /// One step, with the time if a dataset-level FIELD before the points has it. Faults are reported by
    /// `read`, not here.
    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        let text = source.text();
        let mut step = Step::whole(text.left_about());
        step.time = Walker::begin(text, budget).ok().and_then(|mut walker| {
            // A fault on the way is for `read` to report; a time found before it is good.
            let _ = walker.walk(WalkEnd::Points);
            walker.time
        });
        Ok(vec![step])
    }

    /// [`ParseError::Malformed`] if the file is cut short or breaks the format,
    /// [`ParseError::Unsupported`] if it holds a grid or is of a later version.
    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let bytes = source.bytes();
        let text = source.text();
        let mut walker = Walker::begin(text, budget)?;
        walker.walk(WalkEnd::End)?;
        let points = walker.points.take();
        let (arrays, time) = (std::mem::take(&mut walker.arrays), walker.time);
        let points = points.ok_or_else(|| no_points(text.at()))?;
        let attribute = |array: PointArray| {
            Ok(Attribute {
                name: array.name,
                components: array.components,
                data: array.numbers.decode(bytes)?,
            })
        };
        let attributes: Result<_, ParseError> = arrays.into_iter().map(attribute).collect();
        Ok(RawParticles {
            positions: positions(points.numbers.decode(bytes)?),
            attributes: attributes?,
            time,
            ..RawParticles::default()
        })
    }

    /// `None` if some of the file is text or bits, or if a particle has more numbers than there are particles, so
    /// that empty arrays cannot claim many.
    fn layout(&self, bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
        let mut text = TextInput::whole(bytes);
        let mut walker = Walker::begin(&mut text, MemoryBudget::UNLIMITED)?;
        if walker.is_text() {
            return Ok(None);
        }
        walker.walk(WalkEnd::End)?;
        let points = walker.points.ok_or_else(|| no_points(bytes.len()))?;
        let components = walker.arrays.iter().map(|array| array.components);
        if components.fold(0, usize::saturating_add) > FEW_COMPONENTS.max(points.count) {
            return Ok(None);
        }
        let column = |array: PointArray| array.numbers.column(array.name, array.components);
        let attributes: Option<Vec<StridedColumn>> =
            walker.arrays.into_iter().map(column).collect();
        let axes = points.numbers.column("POINTS".to_owned(), 3);
        Ok(axes.zip(attributes).map(|(axes, attributes)| ParticleLayout {
            time: walker.time,
            ..ParticleLayout::new(points.count, vec![axes], attributes)
        }))
    }

    /// SPlisHSPlasH signs its files in the title.
    fn is_y_up(&self, head: &[u8]) -> bool {
        let mut lines = head.split(|b| *b == b'\n');
        let title = lines.nth(1).unwrap_or_default();
        title.starts_with(b"SPlisHSPlasH")
    }
}

fn no_points(end: usize) -> ParseError {
    ParseError::malformed(end, "the file ends before POINTS")
}
