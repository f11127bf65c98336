//! Part files of DualSPHysics (`Part_0000.bi4`): the particles of one time step.
//!
//! `items` reads the container. Constants of the case are values of the root item; the item `PART_####` has the values
//! of the time step and the arrays. After `JPartDataBi4` of DualSPHysics 5.4. Ids of particles are in the order fixed,
//! moving, floating, fluid, and the root item has the numbers of the first three.

use super::columns::{ComponentStride, ParticleLayout, StridedColumn, check_room};
use super::{ByteSource, Step};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader};
use spherule_frame::{Attribute, AttributeData, MemoryBudget, ParseError, RawParticles};

mod items;
#[cfg(test)]
mod tests;

use items::{Item, ItemArray, ItemReader, ItemValue};

/// Part files of DualSPHysics.
pub const FORMAT: Format = Format::new(&Bi4);

struct Bi4;

/// Name of the content in the header.
const PART_DATA: &str = "JPartDataBi4";

/// The attribute that has the type of each particle.
const PART: &str = "part";

impl Reader for Bi4 {
    fn info(&self) -> FormatInfo {
        FormatInfo { notes_need_whole_file: true, ..FormatInfo::new("bi4", &["bi4"]) }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        match items::content_name(head) {
            None => Ok(Confidence::No),
            Some(PART_DATA) => Ok(Confidence::Signature),
            Some(other) => Err(ParseError::unsupported(format!(
                "a DualSPHysics file of {other}, which has no particles of a time step; give the files Part_####.bi4"
            ))),
        }
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        let bytes = source.bytes();
        let mut step = Step::whole(bytes.len());
        // A damaged file has a step, too, so that reading it gives the error
        let file = PartFile::read(bytes, budget).ok();
        step.time = file.and_then(|file| file.part.real("TimeStep"));
        Ok(vec![step])
    }

    /// Reads all particles with all their arrays, under the names of the file. Adds `radius`, which is half of the
    /// distance of particles `Dp`, and `part`, if their ids tell it: 0 fixed, 1 moving, 2 floating, 3 fluid.
    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let bytes = source.bytes();
        PartFile::read(bytes, budget)?.particles(bytes, budget)
    }

    fn notes(&self, bytes: &[u8]) -> Vec<String> {
        let file = PartFile::read(bytes, MemoryBudget::UNLIMITED);
        file.map_or_else(|_| Vec::new(), |file| file.notes())
    }
}

/// The items of a file that are of use.
struct PartFile<'a> {
    endian: spherule_frame::Endian,
    /// Constants of the case.
    root: Item<'a>,
    /// The time step.
    part: Item<'a>,
}

impl<'a> PartFile<'a> {
    fn read(bytes: &'a [u8], budget: MemoryBudget) -> Result<Self, ParseError> {
        let mut reader = ItemReader::new(bytes, budget)?;
        let (mut root, mut part) = (None, None);
        reader.items(|depth, item| {
            if depth == 0 {
                root = Some(item);
            } else if depth == 1 && item.name.starts_with(b"PART_") && part.is_none() {
                part = Some(item);
            }
        })?;
        match (root, part) {
            (Some(root), Some(part)) => Ok(Self { endian: reader.endian, root, part }),
            _ => Err(ParseError::malformed(
                bytes.len(),
                "the file has no item PART_####, and no particles",
            )),
        }
    }

    /// Number of particles, and their positions.
    fn positions(&self) -> Result<(usize, &ItemArray<'a>), ParseError> {
        let count = self
            .part
            .count("Npok")
            .and_then(|count| usize::try_from(count).ok())
            .ok_or_else(|| {
                ParseError::malformed(self.part.at, "the item has no number of particles (Npok)")
            })?;
        let is_positions = |array: &&ItemArray<'_>| {
            matches!(array.name, b"Pos" | b"Posd") && matches!(array.element, Some((_, 3)))
        };
        let positions = self.part.arrays.iter().find(is_positions);
        let positions = positions.ok_or_else(|| {
            ParseError::malformed(self.part.at, "the item has no positions (Pos or Posd)")
        })?;
        Ok((count, positions))
    }

    fn particles(&self, bytes: &[u8], budget: MemoryBudget) -> Result<RawParticles, ParseError> {
        // Find the columns
        let (count, positions) = self.positions()?;
        let mut attributes = Vec::new();
        for array in &self.part.arrays {
            let Some((scalar, components)) = array.element else {
                continue;
            };
            if array.count != count {
                let name = String::from_utf8_lossy(array.name);
                let what =
                    format!("the array `{name}` has {} elements of {count} particles", array.count);
                return Err(ParseError::malformed(array.range.start, what));
            }
            check_room(array.range.start, count, scalar.size() * components, array.range.end)?;
            if !matches!(array.name, b"Pos" | b"Posd") {
                attributes.push(self.column(array, scalar, components));
            }
        }
        let axes = positions.element.map(|(scalar, n)| self.column(positions, scalar, n));
        let layout = ParticleLayout {
            time: self.part.real("TimeStep"),
            step: self.part.count("Step").and_then(|step| i64::try_from(step).ok()),
            ..ParticleLayout::new(count, axes.into_iter().collect(), attributes)
        };
        // Radii and types have four bytes each
        let need = layout.byte_len().saturating_add(8 * count as u64);
        budget.check(need, "its numbers in memory are")?;
        let mut particles = layout.particles(bytes)?;
        // Add what follows from the constants
        let types = self.types(&particles);
        let mut add = |name: &str, data| {
            if !particles.attributes.iter().any(|a| a.name == name) {
                particles.attributes.push(Attribute { name: name.to_owned(), components: 1, data });
            }
        };
        if let Some(radius) = self.radius() {
            add(spherule_frame::names::RADIUS, AttributeData::F32(vec![radius; count]));
        }
        if let Some(types) = types {
            add(PART, AttributeData::U32(types));
        }
        Ok(particles)
    }

    fn column(
        &self,
        array: &ItemArray<'_>,
        scalar: spherule_frame::ScalarType,
        components: usize,
    ) -> StridedColumn {
        let first =
            ComponentStride { start: array.range.start, stride: scalar.size() * components };
        let name = String::from_utf8_lossy(array.name);
        StridedColumn::interleaved(name, (scalar, self.endian), components, first)
    }

    /// Half of the distance of particles.
    #[expect(clippy::cast_possible_truncation, reason = "radii are f32")]
    fn radius(&self) -> Option<f32> {
        let distance = self.root.real("Dp");
        let radius = distance.map(|distance| (distance / 2.0) as f32);
        radius.filter(|radius| radius.is_finite() && *radius > 0.0)
    }

    /// The first ids of moving, floating and fluid particles, if the file has the numbers of all.
    fn first_ids(&self) -> Option<[u64; 3]> {
        let [fixed, moving, floating] =
            ["CaseNfixed", "CaseNmoving", "CaseNfloat"].map(|name| self.root.count(name));
        let fixed = fixed?;
        let moving = fixed.checked_add(moving?)?;
        Some([fixed, moving, moving.checked_add(floating?)?])
    }

    /// Types of particles by their ids: 0 fixed, 1 moving, 2 floating, 3 fluid.
    fn types(&self, particles: &RawParticles) -> Option<Vec<u32>> {
        let first_ids = self.first_ids()?;
        let of = |id: u64| first_ids.iter().map(|first| u32::from(id >= *first)).sum();
        let ids = particles.attributes.iter().find(|a| matches!(a.name.as_str(), "Idp" | "Idpd"));
        match &ids?.data {
            AttributeData::U32(ids) => Some(ids.iter().map(|id| of((*id).into())).collect()),
            AttributeData::U64(ids) => Some(ids.iter().map(|id| of(*id)).collect()),
            _ => None,
        }
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let Some(ItemValue::Text(program)) = self.root.value("AppName") {
            notes.push(format!("written by {}", String::from_utf8_lossy(program)));
        }
        if self.first_ids().is_some() {
            let what = "attribute `part` is the type of the particles: 0 fixed boundary, 1 moving boundary, 2 floating \
                        bodies, 3 fluid";
            notes.push(what.to_owned());
        }
        if let Some(distance) = self.root.real("Dp") {
            notes.push(format!(
                "attribute `radius` is half of the distance of particles, Dp = {distance}"
            ));
        }
        if let Some(pieces @ 2..) = self.root.count("Npiece") {
            notes.push(format!(
                "the file is one of {pieces} pieces of its time step; 'Part_p*_#.bi4' reads all of them"
            ));
        }
        notes
    }
}
