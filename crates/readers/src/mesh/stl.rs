//! STL, binary and ASCII. Both store each triangle with its own three vertices; equal ones are merged, so that
//! triangles share them.

use std::collections::HashMap;

use super::builder::{Mesh, MeshBuilder};
use crate::read::text::{Line, Lines, number, shown, words};
use spherule_frame::{MemoryBudget, ParseError};

/// Bytes before the first triangle of a binary file: a text of 80 bytes and the number of triangles.
const HEADER: usize = 84;

/// Bytes of a triangle in a binary file: a normal, three vertices, and 16 bits without fixed meaning.
const RECORD: usize = 50;

/// Whether `bytes` are exactly the triangles that their header states. Text is never: its digits state more
/// triangles than fit. Binary files may begin with the word `solid`, too.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    stated_triangles(bytes).is_some_and(|count| needed_bytes(count) == bytes.len() as u64)
}

/// Whether a file that is not [`is_binary`] is text: it begins with the word of text files, and there are no zeros,
/// which a binary file has in its numbers.
pub(super) fn is_ascii(bytes: &[u8]) -> bool {
    let head = bytes.get(..4096).unwrap_or(bytes);
    let first = words(head).next().unwrap_or_default();
    first.eq_ignore_ascii_case(b"solid") && !head.contains(&0)
}

fn stated_triangles(bytes: &[u8]) -> Option<u32> {
    let count = bytes.get(HEADER - 4..)?.first_chunk()?;
    Some(u32::from_le_bytes(*count))
}

fn needed_bytes(count: u32) -> u64 {
    HEADER as u64 + RECORD as u64 * u64::from(count)
}

/// Reads a binary file.
///
/// # Errors
/// [`ParseError::Malformed`] if its length is not that of the triangles; [`ParseError::TooLarge`].
pub(super) fn read_binary(bytes: &[u8], budget: MemoryBudget) -> Result<Mesh, ParseError> {
    let Some(count) = stated_triangles(bytes) else {
        let what = "the file ends inside the header of a binary STL, which has 84 bytes";
        return Err(ParseError::malformed(bytes.len(), what));
    };
    let (need, len) = (needed_bytes(count), bytes.len());
    if need != len as u64 {
        let what =
            format!("{count} triangles of a binary STL need {need} bytes, the file has {len}");
        return Err(ParseError::malformed(HEADER - 4, what));
    }
    let mut merger = VertexMerger::new(budget);
    let records = bytes.get(HEADER..).unwrap_or_default();
    for record in records.as_chunks::<RECORD>().0 {
        // The normal is left out: it follows from the vertices.
        let (numbers, _) = record.as_chunks::<4>();
        let mut vertices = [[0.0; 3]; 3];
        for (to, from) in vertices.as_flattened_mut().iter_mut().zip(&numbers[3..]) {
            *to = f64::from(f32::from_le_bytes(*from));
        }
        merger.add_triangle(vertices)?;
    }
    merger.builder.finish()
}

/// Reads a text file of one or several solids.
///
/// # Errors
/// [`ParseError::Malformed`] at a line that does not belong there, or if the last solid does not end;
/// [`ParseError::TooLarge`].
pub(super) fn read_ascii(bytes: &[u8], budget: MemoryBudget) -> Result<Mesh, ParseError> {
    let mut merger = VertexMerger::new(budget);
    let mut corners = [[0.0; 3]; 3];
    let mut corner_count = 0;
    let mut is_open = false;
    for line in Lines::new(bytes, 0..bytes.len()) {
        let mut words = words(line.text);
        let Some(keyword) = words.next() else {
            continue;
        };
        match keyword.to_ascii_lowercase().as_slice() {
            b"solid" => is_open = true,
            b"endsolid" => is_open = false,
            b"facet" => corner_count = 0,
            b"outer" | b"endloop" => {}
            b"vertex" => {
                let Some(corner) = corners.get_mut(corner_count) else {
                    let what = "a facet with more than three vertices";
                    return Err(ParseError::malformed(line.at, what));
                };
                *corner = vertex(&line, words)?;
                corner_count += 1;
            }
            b"endfacet" if corner_count == corners.len() => merger.add_triangle(corners)?,
            b"endfacet" => {
                let what = format!("a facet with {corner_count} vertices, not 3");
                return Err(ParseError::malformed(line.at, what));
            }
            _ => {
                let what = format!("{} is not a keyword of STL", shown(keyword));
                return Err(ParseError::malformed(line.at, what));
            }
        }
    }
    if is_open {
        let what = "the file ends before endsolid; perhaps it is still being written";
        return Err(ParseError::malformed(bytes.len(), what));
    }
    merger.builder.finish()
}

/// The three numbers of a line `vertex x y z`.
fn vertex<'a>(
    line: &Line<'_>,
    words: impl Iterator<Item = &'a [u8]>,
) -> Result<[f64; 3], ParseError> {
    let mut words = words.fuse();
    let mut vertex = [0.0; 3];
    for coordinate in &mut vertex {
        *coordinate = words.next().and_then(number).ok_or_else(|| {
            let what = format!("{} has no three numbers", shown(line.text));
            ParseError::malformed(line.at, what)
        })?;
    }
    Ok(vertex)
}

/// Finds equal vertices.
struct VertexMerger {
    builder: MeshBuilder,
    /// Index of each vertex by the bits of its coordinates. Its hash is random, so no file can choose vertices with
    /// equal hashes.
    indices: HashMap<[u64; 3], u32>,
}

impl VertexMerger {
    fn new(budget: MemoryBudget) -> Self {
        Self { builder: MeshBuilder::new(budget), indices: HashMap::new() }
    }

    fn add_triangle(&mut self, corners: [[f64; 3]; 3]) -> Result<(), ParseError> {
        let mut triangle = [0; 3];
        for (index, vertex) in triangle.iter_mut().zip(corners) {
            *index = self.vertex(vertex)?;
        }
        self.builder.add_triangle(triangle)
    }

    fn vertex(&mut self, vertex: [f64; 3]) -> Result<u32, ParseError> {
        // Adding zero turns -0 into 0, which is the same place.
        let key = vertex.map(|coordinate| (coordinate + 0.0).to_bits());
        if let Some(index) = self.indices.get(&key) {
            return Ok(*index);
        }
        if self.indices.len() == self.indices.capacity() {
            self.grow()?;
        }
        let index = self.builder.add_vertex(vertex)?;
        self.indices.insert(key, index);
        Ok(index)
    }

    /// Doubles the table.
    fn grow(&mut self) -> Result<(), ParseError> {
        /// Bytes of an entry, with the eighth of the table that stays empty.
        const ENTRY: u64 = 38;
        const FIRST_ENTRIES: usize = 1792;
        let more = self.indices.len().max(FIRST_ENTRIES);
        // The old table is in memory until its entries are in the new one.
        self.builder.check((self.indices.len() + more) as u64 * ENTRY)?;
        self.builder.hold(more as u64 * ENTRY);
        self.indices.try_reserve(more).map_err(|_| {
            ParseError::too_large("the table of its vertices is larger than free memory")
        })
    }
}
