//! Wavefront OBJ: vertices and faces. Everything else (normals, texture coordinates, groups, materials, lines, curves)
//! is left out.
//!
//! Not the crate `tobj`: its errors name no place in the file, and it keeps no memory budget.

use memchr::memchr;

use super::builder::{CornerRange, Mesh, MeshBuilder};
use crate::read::text::{integer, number, shown, words};
use spherule_frame::{MemoryBudget, ParseError};

/// Whether the first statement is one that OBJ files begin with.
pub(super) fn is_obj(bytes: &[u8]) -> bool {
    const FIRST: [&[u8]; 12] =
        [b"v", b"vt", b"vn", b"vp", b"f", b"l", b"p", b"o", b"g", b"s", b"mtllib", b"usemtl"];
    let first = Statements::new(bytes).find_map(|statement| statement.words().next());
    first.is_some_and(|keyword| FIRST.contains(&keyword))
}

/// Reads a file.
///
/// # Errors
/// [`ParseError::Malformed`] at a statement that is damaged, or refers to a vertex that does not exist;
/// [`ParseError::TooLarge`].
pub(super) fn read(bytes: &[u8], budget: MemoryBudget) -> Result<Mesh, ParseError> {
    let mut builder = MeshBuilder::new(budget);
    // Faces may refer to vertices that follow, so all vertices come first.
    for statement in Statements::new(bytes) {
        let mut words = statement.words();
        match words.next() {
            Some(b"v") => {
                let mut vertex = [0.0; 3];
                for coordinate in &mut vertex {
                    let found = words.next().and_then(number);
                    *coordinate = found.ok_or_else(|| statement.fault("has no three numbers"))?;
                }
                builder.add_vertex(vertex)?;
            }
            Some(word) if !word.iter().all(|b| b.is_ascii_alphabetic() || *b == b'_') => {
                return Err(statement.fault("is not a statement of OBJ"));
            }
            _ => {}
        }
    }
    let all = builder.corners();
    // Vertices before the statement: negative indices count back from them.
    let mut before = 0;
    for statement in Statements::new(bytes) {
        let mut words = statement.words();
        match words.next() {
            Some(b"v") => before += 1,
            Some(b"f") => {
                builder.add_polygon(words.map(|word| corner(&statement, word, all, before)))?;
            }
            _ => {}
        }
    }
    builder.finish()
}

/// The vertex of a corner `vertex/texture/normal`, where all but the vertex may be missing.
fn corner(
    statement: &Statement<'_>,
    word: &[u8],
    all: CornerRange,
    before: i64,
) -> Result<u32, ParseError> {
    let index = word.split(|b| *b == b'/').next().and_then(integer);
    let Some(index) = index.filter(|index| *index != 0) else {
        let what = format!("has the corner {}; indices count from 1", shown(word));
        return Err(statement.fault(&what));
    };
    let from_zero = if index > 0 { index - 1 } else { before.saturating_add(index) };
    let vertex = all.vertex(statement.at, u64::try_from(from_zero).ok());
    vertex.map_err(|_| {
        // With the index as the file has it.
        let (there, count) =
            if index > 0 { ("in the file", i64::from(all.count())) } else { ("before it", before) };
        statement.fault(&format!("refers to vertex {index}; vertices {there}: {count}"))
    })
}

/// A line, and those that follow if it ends with a backslash.
struct Statement<'a> {
    at: usize,
    text: &'a [u8],
}

impl<'a> Statement<'a> {
    /// The words up to a comment.
    fn words(&self) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        let words = words(self.text)
            .map(|word| word.strip_suffix(b"\\").unwrap_or(word))
            .filter(|word| !word.is_empty());
        words.take_while(|word| !word.starts_with(b"#"))
    }

    fn fault(&self, what: &str) -> ParseError {
        ParseError::malformed(self.at, format!("{} {what}", shown(self.text)))
    }
}

struct Statements<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Statements<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let mark = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Self { bytes, at: mark }
    }
}

impl<'a> Iterator for Statements<'a> {
    type Item = Statement<'a>;

    fn next(&mut self) -> Option<Statement<'a>> {
        let at = self.at;
        let rest = self.bytes.get(at..).filter(|rest| !rest.is_empty())?;
        let mut end = 0;
        let mut is_comment = false;
        loop {
            let line = rest.get(end..).unwrap_or_default();
            let Some(newline) = memchr(b'\n', line) else {
                self.at = self.bytes.len();
                return Some(Statement { at, text: rest });
            };
            let line = line.get(..newline).unwrap_or_default();
            // A comment may end with a path, so its backslash joins nothing.
            is_comment |= end == 0 && line.trim_ascii_start().starts_with(b"#");
            let is_continued = line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\");
            end += newline + 1;
            if is_comment || !is_continued {
                self.at += end;
                return rest.get(..end).map(|text| Statement { at, text });
            }
        }
    }
}
