//! Geometry of Houdini 12 and later: binary JSON (`.bgeo`, and `.bgeo.sc` as `compression` decodes it) and text (`.geo`).
//!
//! `binary_json` and `text_json` read `tokens`, which `cursor` walks through; `numbers` reads arrays of them, `paged` the
//! values of an attribute, `geometry` the layout of the file. Only points are read. Classic files, which have the same
//! extension, are read by [`super::bgeo`].

use glam::{DVec3, Vec3};

use super::{ByteSource, Step, columns};
use crate::format::Format;
use crate::reader::{Confidence, FileExtent, FormatInfo, Reader};
use spherule_frame::{Attribute, AttributeData, MemoryBudget, ParseError, Positions, RawParticles};

mod binary_json;
mod cursor;
mod geometry;
mod numbers;
mod paged;
#[cfg(test)]
mod tests;
mod text_json;
mod tokens;

use geometry::Geometry;

/// Geometry of Houdini 12 and later.
pub const FORMAT: Format = Format::new(&Houdini);

struct Houdini;

impl Reader for Houdini {
    /// Those of text, and with the name of their compression; `.bgeo` is in the list of classic files.
    fn info(&self) -> FormatInfo {
        FormatInfo {
            notes_need_whole_file: true,
            ..FormatInfo::new("houdini", &["bgeosc", "bgeogz", "geo"])
        }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        Ok(Confidence::signature_if(cursor::endian(head).is_some()))
    }

    /// Reads all points with all their attributes of numbers and strings, under the names of the file.
    ///
    /// Numbers have the type of the file; half precision becomes f32, and strings are indices of their table.
    /// Positions of four components are divided by the last one unless it is 0 or 1.
    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let bytes = source.bytes();
        let mut geometry = Geometry::default();
        geometry.read(bytes, budget)?;
        particles(bytes, &geometry, budget)
    }

    /// The numbers of the largest attribute as they are stored; of text, all numbers in double precision.
    fn unpacked_arrays_len(&self, head: &[u8], _file: FileExtent, particles: &RawParticles) -> u64 {
        // Positions may have a fourth component
        let largest = particles.largest_array_len();
        let stored = largest + largest / 3;
        let is_text = binary_json::endian(head).is_none();
        if is_text { 2 * (particles.byte_len() + stored) } else { stored }
    }

    fn notes(&self, bytes: &[u8]) -> Vec<String> {
        let mut geometry = Geometry::default();
        // What is before a fault, or the end of the bytes, counts; reading the file reports the fault
        let _ = geometry.read(bytes, MemoryBudget::UNLIMITED);
        let mut notes = Vec::new();
        let version = geometry.version.as_ref();
        notes.extend(version.map(|version| format!("geometry of Houdini {version}")));
        if !geometry.primitive_types.is_empty() {
            let types = geometry.primitive_types.join(", ");
            notes.push(format!(
                "primitives ({types}) are not used; their points are read as particles"
            ));
        }
        if !geometry.unread.is_empty() {
            let names = geometry.unread.join(", ");
            notes.push(format!(
                "point attributes that are neither numbers nor strings are not read: {names}"
            ));
        }
        notes
    }

    /// Houdini's axes.
    fn is_y_up(&self, _head: &[u8]) -> bool {
        true
    }
}

/// The points of `geometry`, which is that of `bytes`.
fn particles(
    bytes: &[u8],
    geometry: &Geometry<'_>,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    if let Some(kind) = geometry.packed_type() {
        let what = format!(
            "geometry with packed primitives ({kind}), whose points are not read; unpack it in Houdini before it is \
             saved (Unpack node)"
        );
        return Err(ParseError::unsupported(what));
    }
    let end = bytes.len();
    let count = geometry.point_count;
    let count =
        count.ok_or_else(|| ParseError::malformed(end, "the file has no number of points"))?;
    let endian =
        cursor::endian(bytes).ok_or_else(|| ParseError::malformed(0, "not geometry of Houdini"))?;
    let mut particles =
        RawParticles { positions: Positions::F32(Vec::new()), ..RawParticles::default() };
    let mut has_positions = false;
    for attribute in &geometry.attributes {
        let left = budget.less(particles.byte_len());
        let (name, size) = (&attribute.name, attribute.values.size);
        if size == 0 {
            continue;
        }
        let data = attribute.values.decode(name, count, endian, left)?;
        if name != "P" {
            particles.attributes.push(Attribute { name: name.clone(), components: size, data });
        } else if !has_positions {
            particles.positions = positions(data, size, count)?;
            has_positions = true;
        }
    }
    if !has_positions {
        return Err(ParseError::malformed(end, "the points have no positions (attribute P)"));
    }
    Ok(particles)
}

/// Positions from the attribute P with `size` components.
fn positions(data: AttributeData, size: usize, count: usize) -> Result<Positions, ParseError> {
    match (size, data) {
        (3, data) => Ok(columns::positions(vec![data], count)),
        (4, AttributeData::F32(numbers)) => {
            let divided = numbers.as_chunks().0.iter().map(|[x, y, z, w]| {
                let position = Vec3::new(*x, *y, *z);
                if *w == 0.0 || *w == 1.0 { position } else { position / *w }
            });
            Ok(Positions::F32(divided.collect()))
        }
        (4, AttributeData::F64(numbers)) => {
            let divided = numbers.as_chunks().0.iter().map(|[x, y, z, w]| {
                let position = DVec3::new(*x, *y, *z);
                if *w == 0.0 || *w == 1.0 { position } else { position / *w }
            });
            Ok(Positions::F64(divided.collect()))
        }
        (_, data) => {
            let scalar = data.scalar_type().name();
            let what = format!(
                "positions (attribute P) of {size} components of the type {scalar}, which are not read"
            );
            Err(ParseError::unsupported(what))
        }
    }
}
