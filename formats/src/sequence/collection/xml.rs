//! The lists that VTK and ParaView write as XML.

use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use super::entry::{LineCounter, List, ListEntry, ListKind, PartLabel, TextPlace, label};
use crate::ParseError;
use crate::read::vtk_xml::{attribute, short};

/// Most elements in one another.
const MAX_DEPTH: usize = 64;

/// The XML file of this kind.
///
/// Entities other than those of XML itself are errors, so that none expands to more than it is.
///
/// # Errors
/// [`ParseError`] at the fault in the XML.
pub(super) fn list(bytes: &[u8], kind: ListKind) -> Result<List, ParseError> {
    let mut lines = LineCounter::new(bytes);
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let place = lines.place(error.valid_up_to());
        place.malformed("not text in UTF-8; save the list as UTF-8")
    })?;
    let mut parser =
        ListParser { list: List { kind, entries: Vec::new(), ghost_level: 0 }, open: Vec::new() };
    // Read element by element, with the line of each for messages
    let mut reader = Reader::from_str(text);
    loop {
        let start = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX);
        let event = reader.read_event();
        let place = lines.place(start);
        match event {
            Ok(Event::Start(tag)) => parser.start(&tag, place)?,
            Ok(Event::Empty(tag)) => {
                parser.start(&tag, place)?;
                parser.open.pop();
            }
            Ok(Event::End(_)) => {
                parser.open.pop();
            }
            Ok(Event::Eof) if parser.open.is_empty() => break,
            Ok(Event::Eof) => {
                let what = "the file ends before </VTKFile>; it may still be being written";
                return Err(place.malformed(what));
            }
            Ok(_) => {}
            Err(error) => return Err(place.malformed(format!("bad XML: {error}"))),
        }
    }
    Ok(parser.list)
}

/// An element that is open.
struct OpenElement {
    /// Its name behind those of the blocks around it.
    block: String,
    /// Blocks in it so far.
    child_count: usize,
    /// Whether the files in it are pieces of one block.
    is_partitioned: bool,
}

struct ListParser {
    list: List,
    open: Vec<OpenElement>,
}

impl ListParser {
    /// Takes the start of an element.
    fn start(&mut self, tag: &BytesStart<'_>, place: TextPlace) -> Result<(), ParseError> {
        if self.open.len() >= MAX_DEPTH {
            let what = format!("more than {MAX_DEPTH} elements in one another");
            return Err(place.malformed(what));
        }
        // Add the files that the element names; which elements do depends on the kind of list
        let local = tag.local_name();
        let name: &str = local.as_ref();
        let mut block = String::new();
        match (self.list.kind, name) {
            (ListKind::Collection, "DataSet") => self.timed(tag, place)?,
            (ListKind::Pieces, "Piece") => {
                let source = text_of(tag, place, "Source")?;
                if source.is_empty() {
                    return Err(place.malformed("a <Piece> without Source, the name of its file"));
                }
                self.push(source, None, PartLabel::default(), place);
            }
            (ListKind::Pieces, "PUnstructuredGrid" | "PPolyData") => {
                let level = text_of(tag, place, "GhostLevel")?;
                self.list.ghost_level = level.parse().unwrap_or(0);
            }
            (
                ListKind::Blocks,
                "Block" | "Piece" | "Partition" | "Partitions" | "DataSet" | "DataSets",
            ) => block = self.block(tag, place)?,
            (ListKind::Blocks, _) => {
                let around = self.open.last().map_or("", |element| &element.block);
                around.clone_into(&mut block);
            }
            _ => {}
        }
        self.open.push(OpenElement { block, child_count: 0, is_partitioned: name == "Partitions" });
        Ok(())
    }

    /// A file of a collection, with its time.
    fn timed(&mut self, tag: &BytesStart<'_>, place: TextPlace) -> Result<(), ParseError> {
        let written = text_of(tag, place, "timestep")?;
        let time = match written.parse::<f64>() {
            _ if written.is_empty() => None,
            // Zero is the same time with either sign.
            Ok(value) if value.is_finite() => Some(value + 0.0),
            _ => {
                let what = format!("timestep=\"{}\" is not a number", short(&written));
                return Err(place.malformed(what));
            }
        };
        // Refuse a mixture, whose order would be unclear
        let has_time = |entry: &ListEntry| entry.time.is_some();
        let first = self.list.entries.first();
        if first.is_some_and(|first| has_time(first) != time.is_some()) {
            let what = "some files have a timestep and others have none; give all of them one";
            return Err(place.malformed(what));
        }
        // Add the file, with the labels of its part
        let file = text_of(tag, place, "file")?;
        if file.is_empty() {
            return Err(place.malformed("a <DataSet> without file, the name of its file"));
        }
        let part = PartLabel {
            group: label(text_of(tag, place, "group")?),
            part: label(text_of(tag, place, "part")?),
            name: label(text_of(tag, place, "name")?),
        };
        self.push(file, time, part, place);
        Ok(())
    }

    /// A block, or a file as one. Returns its name, or its index if it has none, behind those of the blocks around it.
    fn block(&mut self, tag: &BytesStart<'_>, place: TextPlace) -> Result<String, ParseError> {
        // Find its name, or its place among its siblings
        let mut name = text_of(tag, place, "name")?;
        if name.is_empty() {
            name = text_of(tag, place, "index")?;
        }
        // Put the names of the blocks around it in front; the pieces of a partitioned block share its name
        if let Some(parent) = self.open.last_mut() {
            parent.child_count += 1;
            if parent.is_partitioned {
                name.clone_from(&parent.block);
            } else if name.is_empty() {
                name = (parent.child_count - 1).to_string();
            }
            if !parent.is_partitioned && !parent.block.is_empty() {
                name = format!("{}/{name}", parent.block);
            }
        }
        let name = label(name);
        // A block without data has no file.
        let file = text_of(tag, place, "file")?;
        if !file.is_empty() {
            let part = PartLabel { name: name.clone(), ..PartLabel::default() };
            self.push(file, None, part, place);
        }
        Ok(name)
    }

    fn push(&mut self, path: String, time: Option<f64>, part: PartLabel, place: TextPlace) {
        self.list.entries.push(ListEntry { path, time, part, place });
    }
}

/// The value of an attribute, or nothing if it is not there.
fn text_of(tag: &BytesStart<'_>, place: TextPlace, name: &str) -> Result<String, ParseError> {
    let value = attribute(tag, place.at, name).map_err(|error| match error {
        ParseError::Malformed { what, .. } => place.malformed(what),
        other => other,
    })?;
    Ok(value.unwrap_or_default())
}
