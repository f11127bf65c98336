//! NPZ: a zip archive with one NPY array a member, stored or deflated.
//!
//! Here it is decided which members are positions, attributes and time; [`super::member`] gets at
//! their bytes. Members are opened in two steps: the header of each, then the contents of those that
//! hold particles.

use std::io::Cursor;

use zip::ZipArchive;

use super::header::{NpyHeader, show};
use super::layout::ArrayLayout;
use super::member::{self, ArrayMember, in_member, zip_error};
use super::{check_frame, frame_steps, read_array};
use crate::read::Step;
use crate::read::columns::{self, StridedColumn};
use spherule_frame::names::POSITION_ARRAYS;
use spherule_frame::{
    Attribute, AttributeData, MemoryBudget, ParseError, RawParticles, join_vectors,
};

/// Whether `bytes` begin like a zip archive, an empty one included.
pub(super) fn is_zip(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06")
}

/// An opened NPZ.
pub(super) struct Archive<'a> {
    bytes: &'a [u8],
    zip: ZipArchive<Cursor<&'a [u8]>>,
    members: Vec<ArrayMember>,
}

/// The members that hold the positions, as indices into `members`.
enum PositionMembers {
    /// One array of positions, or of structures with a position.
    Array(usize),
    /// One array for each of x, y and perhaps z.
    Axes(Vec<usize>),
}

impl<'a> Archive<'a> {
    /// Reads the directory and the header of every array.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] for damaged archives, [`ParseError::Unsupported`] for encryption and
    /// other compressions than deflate.
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, ParseError> {
        let mut zip = ZipArchive::new(Cursor::new(bytes)).map_err(|e| zip_error(&e, "npz"))?;
        // The same compressed bytes listed many times are a zip bomb.
        let overlaps = zip.has_overlapping_entries();
        if overlaps.map_err(|e| zip_error(&e, "npz"))? {
            return Err(ParseError::malformed(0, "npz members overlap"));
        }
        if zip.has_duplicate_names() {
            return Err(ParseError::malformed(0, "npz with two arrays of one name; save it again"));
        }
        let mut members = Vec::new();
        for index in 0..zip.len() {
            members.extend(member::open(&mut zip, index)?);
        }
        Ok(Self { bytes, zip, members })
    }

    /// See [`super::steps`].
    pub(super) fn steps(mut self, budget: MemoryBudget) -> Result<Vec<Step>, ParseError> {
        let (_, layout) = self.source()?;
        let mut steps = frame_steps(&layout);
        let times = self.times(&layout, budget)?;
        for step in &mut steps {
            step.time = time_of(times.as_ref(), step.index);
        }
        Ok(steps)
    }

    /// See [`super::read`].
    pub(super) fn read(
        mut self,
        frame: usize,
        budget: MemoryBudget,
    ) -> Result<RawParticles, ParseError> {
        let (source, layout) = self.source()?;
        check_frame(&layout, frame)?;
        let (mut particles, used) = match source {
            PositionMembers::Array(member) => {
                (self.read_positions(member, frame, budget)?, vec![member])
            }
            PositionMembers::Axes(members) => (self.read_axes(&members, &layout, budget)?, members),
        };
        let mut held = particles.byte_len();
        for member in 0..self.members.len() {
            if !used.contains(&member) && !self.is_time(member, &layout) {
                let left = budget.less(held);
                let attribute = self.attribute(member, &layout, frame, left)?;
                held += attribute.as_ref().map_or(0, |a| a.data.byte_len());
                particles.attributes.extend(attribute);
            }
        }
        join_vectors(&mut particles.attributes, budget.less(held));
        particles.time = time_of(self.times(&layout, budget)?.as_ref(), frame);
        Ok(particles)
    }

    /// Finds the positions by name, or takes the only array there is.
    fn source(&self) -> Result<(PositionMembers, ArrayLayout), ParseError> {
        let named = |name: &str| {
            let same = |m: &ArrayMember| m.name.eq_ignore_ascii_case(name);
            self.members.iter().position(same)
        };
        let layout_of =
            |member: usize| self.members.get(member).map(|m| ArrayLayout::of(&m.header));
        let mut refused = None;
        let only = (self.members.len() == 1).then_some(0);
        for member in POSITION_ARRAYS.iter().filter_map(|n| named(n)).chain(only) {
            match layout_of(member) {
                Some(Ok(layout)) => return Ok((PositionMembers::Array(member), layout)),
                Some(Err(error)) => {
                    refused.get_or_insert_with(|| in_member(error, self.name(member)));
                }
                None => {}
            }
        }
        if let (Some(x), Some(y)) = (named("x"), named("y")) {
            let axes: Vec<usize> = [x, y].into_iter().chain(named("z")).collect();
            if let Some(layout) = self.axes_layout(&axes) {
                return Ok((PositionMembers::Axes(axes), layout));
            }
        }
        Err(refused.unwrap_or_else(|| self.no_positions()))
    }

    fn name(&self, member: usize) -> &str {
        self.members.get(member).map_or("", |m| m.name.as_str())
    }

    /// x, y and z must be lists of numbers of the same length.
    fn axes_layout(&self, axes: &[usize]) -> Option<ArrayLayout> {
        let shapes: Option<Vec<&[usize]>> = axes
            .iter()
            .map(|axis| self.members.get(*axis).map(|m| m.header.shape.as_slice()))
            .collect();
        let shapes = shapes?;
        let Some([count]) = shapes.first() else {
            return None;
        };
        let layout = ArrayLayout { frames: None, count: *count, planes: false };
        let fits = |axis: &usize| {
            let member = self.members.get(*axis)?;
            layout.attribute(&member.name, &member.header, 0)
        };
        (shapes.iter().all(|s| s.len() == 1) && axes.iter().all(|a| fits(a).is_some()))
            .then_some(layout)
    }

    fn no_positions(&self) -> ParseError {
        let pickled: Vec<&str> = self
            .members
            .iter()
            .filter(|m| m.header.is_pickled())
            .map(|m| m.name.as_str())
            .collect();
        if !pickled.is_empty() {
            let pysph = if pickled.contains(&"solver_data") {
                " (from pysph: convert with `pysph dump_vtk`)"
            } else {
                ""
            };
            return ParseError::unsupported(format!(
                "npz members [{}] are pickled python objects ('|O'), which are never unpickled; \
                 save plain arrays with numpy.savez{pysph}",
                pickled.join(", ")
            ));
        }
        let shown = |m: &ArrayMember| format!("{} {}", m.name, show(&m.header.shape));
        let members: Vec<String> = self.members.iter().map(shown).collect();
        ParseError::unsupported(format!(
            "npz without positions among its members [{}]: save an (N, 3) array named positions",
            members.join(", ")
        ))
    }

    fn read_positions(
        &mut self,
        member: usize,
        frame: usize,
        budget: MemoryBudget,
    ) -> Result<RawParticles, ParseError> {
        let Some(found) = self.members.get(member) else {
            return Err(self.no_positions());
        };
        let contents = member::contents(self.bytes, &mut self.zip, found, budget)?;
        read_array(&contents, &found.header, frame).map_err(|e| in_member(e, &found.name))
    }

    fn read_axes(
        &mut self,
        members: &[usize],
        layout: &ArrayLayout,
        budget: MemoryBudget,
    ) -> Result<RawParticles, ParseError> {
        let mut parts: Vec<AttributeData> = Vec::with_capacity(members.len());
        let mut held = 0;
        for member in members {
            let axis = self.attribute(*member, layout, 0, budget.less(held))?;
            held += axis.as_ref().map_or(0, |a| a.data.byte_len());
            parts.push(axis.ok_or_else(|| self.no_positions())?.data);
        }
        Ok(RawParticles {
            positions: columns::positions(parts, layout.count),
            ..RawParticles::default()
        })
    }

    /// Member `member` as an attribute; `None` if it is not one number or group a particle.
    fn attribute(
        &mut self,
        member: usize,
        layout: &ArrayLayout,
        frame: usize,
        budget: MemoryBudget,
    ) -> Result<Option<Attribute>, ParseError> {
        let Some(found) = self.members.get(member) else {
            return Ok(None);
        };
        let Some(column) = layout.attribute(&found.name, &found.header, frame) else {
            return Ok(None);
        };
        let contents = member::contents(self.bytes, &mut self.zip, found, budget)?;
        let decoded = decode(&contents, layout.count, column);
        decoded.map_err(|e| in_member(e, &found.name))
    }

    /// Whether a member holds the time: one number, or one a step.
    fn is_time(&self, member: usize, layout: &ArrayLayout) -> bool {
        self.members.get(member).is_some_and(|m| {
            let named = ["time", "times", "t"].contains(&m.name.as_str());
            named
                && match m.header.shape.as_slice() {
                    [] | [1] => true,
                    [steps] => layout.frames == Some(*steps),
                    _ => false,
                }
        })
    }

    /// The member that holds the time.
    fn times(
        &mut self,
        layout: &ArrayLayout,
        budget: MemoryBudget,
    ) -> Result<Option<Attribute>, ParseError> {
        let times = (0..self.members.len()).find(|m| self.is_time(*m, layout));
        let Some(member) = times else {
            return Ok(None);
        };
        let Some(found) = self.members.get(member) else {
            return Ok(None);
        };
        // Read as one "particle" a step.
        let count: usize = found.header.shape.iter().product();
        let list = ArrayLayout { frames: None, count, planes: false };
        let flat = NpyHeader { shape: vec![count], ..found.header.clone() };
        let Some(column) = list.attribute(&found.name, &flat, 0) else {
            return Ok(None);
        };
        let contents = member::contents(self.bytes, &mut self.zip, found, budget)?;
        let decoded = decode(&contents, count, column);
        decoded.map_err(|e| in_member(e, &found.name))
    }
}

/// One time for all steps, or one a step.
fn time_of(times: Option<&Attribute>, frame: usize) -> Option<f64> {
    let data = &times?.data;
    let index = if data.len() == 1 { 0 } else { frame };
    (index < data.len()).then(|| data.get_f64(index))
}

/// One column by itself.
fn decode(
    bytes: &[u8],
    count: usize,
    column: StridedColumn,
) -> Result<Option<Attribute>, ParseError> {
    let components = column.component_strides.len();
    if components == 0 {
        return Ok(None);
    }
    let data = columns::values(bytes, count, &column)?;
    Ok(Some(Attribute { name: column.name, components, data }))
}
