//! The walk through a legacy file, from keyword line to keyword line, and what it finds.

use super::MAX_COMPONENTS;
use super::ascii::skip_integers;
use super::attributes::{ArrayHeader, count, field_array, keyword_array};
use super::cursor::{LineCursor, VtkLine, shown};
use super::keywords::{is_keyword, is_section_start, is_time_name, parse_version};
use super::payload::{ArrayNumbers, skip_values, take_values, value_count};
use super::types::{VtkEncoding, VtkType, stored_type};
use crate::read::input::TextInput;
use spherule_frame::{MemoryBudget, ParseError};

/// Where to stop walking.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WalkEnd {
    Points,
    End,
}

/// What the following attributes belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ArrayOwner {
    /// The dataset itself: time and the like, any length.
    Dataset,
    /// Particles, this many.
    Points(usize),
    /// Cells, this many; of no interest.
    Cells(usize),
}

/// The points.
pub(super) struct Points {
    pub(super) count: usize,
    /// Three a point.
    pub(super) numbers: ArrayNumbers,
}

/// Point data.
pub(super) struct PointArray {
    pub(super) name: String,
    pub(super) components: usize,
    pub(super) numbers: ArrayNumbers,
}

/// What the cells of a section are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CellSection {
    Polygons,
    Strips,
    /// Of several types, which CELL_TYPES has.
    Typed,
}

/// Cells, for those who read a mesh.
pub(super) struct Cells {
    pub(super) section: CellSection,
    /// Their keyword line.
    pub(super) at: usize,
    /// Cells; with offsets one more.
    pub(super) count: usize,
    /// From version 5.0 on.
    pub(super) offsets: Option<ArrayNumbers>,
    /// Before version 5.0 with the number of vertices in front of each cell.
    pub(super) connectivity: ArrayNumbers,
}

/// What a mesh has beside the points.
#[derive(Default)]
pub(super) struct MeshCells {
    pub(super) sections: Vec<Cells>,
    pub(super) types: Option<ArrayNumbers>,
}

/// The walk through the file and what it has found so far.
pub(super) struct Walker<'c, 'a> {
    cursor: LineCursor<'c, 'a>,
    /// What numbers that are text may still take.
    pub(super) budget: MemoryBudget,
    encoding: VtkEncoding,
    major: u32,
    section: ArrayOwner,
    dataset_named: bool,
    /// Components of the array just passed: METADATA may name each on a line.
    components: usize,
    pub(super) points: Option<Points>,
    pub(super) arrays: Vec<PointArray>,
    pub(super) time: Option<f64>,
    /// For a mesh its cells, which are taken instead of the arrays.
    pub(super) mesh: Option<MeshCells>,
}

impl<'c, 'a> Walker<'c, 'a> {
    /// Reads the first three lines of `text`, whose numbers may take as much as `budget`.
    pub(super) fn begin(
        text: &'c mut TextInput<'a>,
        budget: MemoryBudget,
    ) -> Result<Self, ParseError> {
        let mut cursor = LineCursor::new(text);
        let ended =
            |at: usize| move || ParseError::malformed(at, "the file ends inside its header");
        let first = cursor.line()?.ok_or_else(ended(cursor.at()))?;
        let major = parse_version(&first)?;
        let _title = cursor.line()?.ok_or_else(ended(cursor.at()))?;
        let kind = cursor.keyword_line()?.ok_or_else(ended(cursor.at()))?;
        let encoding = if kind.starts_with("BINARY") {
            VtkEncoding::Binary
        } else if kind.starts_with("ASCII") {
            VtkEncoding::Ascii
        } else {
            return Err(ParseError::malformed(
                kind.at,
                format!("line 3 is `{}`, not ASCII or BINARY", kind.shown()),
            ));
        };
        Ok(Self {
            cursor,
            budget,
            encoding,
            major,
            section: ArrayOwner::Dataset,
            dataset_named: false,
            components: 1,
            points: None,
            arrays: Vec::new(),
            time: None,
            mesh: None,
        })
    }

    /// Takes the cells instead of the arrays.
    pub(super) fn for_mesh(mut self) -> Self {
        self.mesh = Some(MeshCells::default());
        self
    }

    /// Whether numbers are text.
    pub(super) fn is_text(&self) -> bool {
        self.encoding == VtkEncoding::Ascii
    }

    pub(super) fn walk(&mut self, until: WalkEnd) -> Result<(), ParseError> {
        while let Some(line) = self.cursor.keyword_line()? {
            let keyword = line.first_word().to_ascii_uppercase();
            match keyword.as_slice() {
                b"DATASET" => self.dataset(&line)?,
                b"POINTS" if until == WalkEnd::Points => return Ok(()),
                b"POINTS" => self.points(&line)?,
                b"CELLS" | b"VERTICES" | b"LINES" | b"POLYGONS" | b"TRIANGLE_STRIPS" => {
                    self.cells(&line)?;
                }
                b"CELL_TYPES" => {
                    let types = count(&line, line.words().get(1))?;
                    let taken = self.take_for_mesh(
                        stored_type(line.at, b"int")?,
                        types,
                        &line.shown(),
                        true,
                    )?;
                    if let (Some(mesh), Some(taken)) = (&mut self.mesh, taken) {
                        mesh.types = Some(taken);
                    }
                }
                b"POINT_DATA" => self.point_data(&line)?,
                b"CELL_DATA" => {
                    self.section = ArrayOwner::Cells(count(&line, line.words().get(1))?);
                }
                b"FIELD" => self.field(&line)?,
                b"METADATA" => self.metadata()?,
                b"LOOKUP_TABLE" => self.lookup_table(&line)?,
                _ => self.attribute(&line)?,
            }
        }
        Ok(())
    }

    fn dataset(&mut self, line: &VtkLine) -> Result<(), ParseError> {
        let words = line.words();
        let kind = words.get(1).copied().unwrap_or_default().to_ascii_uppercase();
        match kind.as_slice() {
            b"POLYDATA" | b"UNSTRUCTURED_GRID" => {
                self.dataset_named = true;
                Ok(())
            }
            b"STRUCTURED_POINTS" | b"STRUCTURED_GRID" | b"RECTILINEAR_GRID" | b"IMAGE_DATA"
            | b"FIELD" | b"TABLE" | b"TREE" | b"DIRECTED_GRAPH" | b"UNDIRECTED_GRAPH" => {
                Err(ParseError::unsupported(format!(
                    "DATASET {} is not read; write POLYDATA or UNSTRUCTURED_GRID",
                    shown(&kind)
                )))
            }
            _ => Err(ParseError::malformed(
                line.at,
                format!("`{}` is not a VTK dataset type", line.shown()),
            )),
        }
    }

    fn points(&mut self, line: &VtkLine) -> Result<(), ParseError> {
        if !self.dataset_named {
            return Err(ParseError::malformed(line.at, "POINTS before DATASET"));
        }
        if self.points.is_some() {
            return Err(ParseError::malformed(line.at, "POINTS for the second time"));
        }
        let words = line.words();
        let count = count(line, words.get(1))?;
        let name = words.get(2).copied().unwrap_or_default();
        let stored = stored_type(line.at, name)?;
        let values = value_count(line.at, count, 3)?;
        let numbers = self.take(stored, values, "POINTS")?;
        self.points = Some(Points { count, numbers });
        self.components = 3;
        Ok(())
    }

    fn point_data(&mut self, line: &VtkLine) -> Result<(), ParseError> {
        let stated = count(line, line.words().get(1))?;
        match self.points.as_ref().map(|points| points.count) {
            Some(particles) if particles == stated => {
                self.section = ArrayOwner::Points(particles);
                Ok(())
            }
            Some(particles) => Err(ParseError::malformed(
                line.at,
                format!("POINT_DATA for {stated} points, POINTS has {particles}"),
            )),
            None => Err(ParseError::malformed(line.at, "POINT_DATA before POINTS")),
        }
    }

    /// Cells of any kind. Up to version 4.2 the second number counts integers; from 5.0 on the two
    /// numbers are the lengths of an OFFSETS and a CONNECTIVITY array.
    fn cells(&mut self, line: &VtkLine) -> Result<(), ParseError> {
        let words = line.words();
        let first = count(line, words.get(1))?;
        let second = count(line, words.get(2))?;
        let section = cell_section(line);
        let mut offsets = None;
        let connectivity = if self.major < 5 || !self.next_is("OFFSETS") {
            let stored = stored_type(line.at, b"int")?;
            self.take_for_mesh(stored, second, &line.shown(), section.is_some())?
        } else {
            offsets = self.cell_array(line, "OFFSETS", first, section.is_some())?;
            self.cell_array(line, "CONNECTIVITY", second, section.is_some())?
        };
        if let (Some(mesh), Some(section), Some(connectivity)) =
            (&mut self.mesh, section, connectivity)
        {
            mesh.sections.push(Cells { section, at: line.at, count: first, offsets, connectivity });
        }
        Ok(())
    }

    /// `OFFSETS` or `CONNECTIVITY` of the cells in `line`, with `values` numbers.
    fn cell_array(
        &mut self,
        line: &VtkLine,
        keyword: &str,
        values: usize,
        has_faces: bool,
    ) -> Result<Option<ArrayNumbers>, ParseError> {
        let next = self.cursor.keyword_line()?;
        let Some(next) = next.filter(|next| next.starts_with(keyword)) else {
            return Err(ParseError::malformed(
                self.cursor.at(),
                format!("{keyword} is missing after `{}`", line.shown()),
            ));
        };
        let words = next.words();
        let name = words.get(1).copied().unwrap_or_default();
        let stored = stored_type(next.at, name)?;
        let taken = self.take_for_mesh(stored, values, keyword, has_faces)?;
        if self.next_is("METADATA") {
            self.cursor.keyword_line()?;
            self.metadata()?;
        }
        Ok(taken)
    }

    /// Takes `values` numbers of cells that have faces if a mesh is read, otherwise skips them.
    fn take_for_mesh(
        &mut self,
        stored: VtkType,
        values: usize,
        what: &str,
        has_faces: bool,
    ) -> Result<Option<ArrayNumbers>, ParseError> {
        self.components = 1;
        if self.mesh.is_some() && has_faces {
            return self.take(stored, values, what).map(Some);
        }
        if self.is_text() {
            skip_integers(self.cursor.text(), values)?;
        } else {
            skip_values(&mut self.cursor, self.encoding, stored, values, what)?;
        }
        Ok(None)
    }

    fn skip(&mut self, line: &VtkLine, name: &str, values: usize) -> Result<(), ParseError> {
        let stored = stored_type(line.at, name.as_bytes())?;
        let what = line.shown();
        self.components = 1;
        skip_values(&mut self.cursor, self.encoding, stored, values, &what)
    }

    /// Finds `values` numbers; those that were read are no longer in the budget.
    fn take(
        &mut self,
        stored: VtkType,
        values: usize,
        what: &str,
    ) -> Result<ArrayNumbers, ParseError> {
        let how = (self.encoding, self.budget);
        let numbers = take_values(&mut self.cursor, how, stored, values, what)?;
        if let ArrayNumbers::Decoded(data) = &numbers {
            self.budget = self.budget.less(data.byte_len());
        }
        Ok(numbers)
    }

    /// `LOOKUP_TABLE name size`: RGBA, bytes in binary.
    fn lookup_table(&mut self, line: &VtkLine) -> Result<(), ParseError> {
        let words = line.words();
        let colors = count(line, words.last())?;
        let values = value_count(line.at, colors, 4)?;
        self.skip(line, "unsigned_char", values)
    }

    /// `FIELD name k` and its arrays. Fewer than `k` may follow: SPlisHSPlasH counts arrays that
    /// it does not write.
    fn field(&mut self, line: &VtkLine) -> Result<(), ParseError> {
        let arrays = count(line, line.words().last())?;
        let mut done = 0;
        while done < arrays {
            self.cursor.text().pass_blanks();
            let Some(next) = self.cursor.ahead(|cursor| cursor.line())? else {
                return Ok(());
            };
            if is_keyword(next.first_word())
                && field_array(&next).is_none()
                && !next.starts_with("METADATA")
            {
                return Ok(());
            }
            self.cursor.line()?;
            if let Some(header) = field_array(&next) {
                self.array(&next, header)?;
            } else if next.starts_with("METADATA") {
                self.metadata()?;
                continue;
            } else if !next.starts_with("NULL_ARRAY") {
                return Err(ParseError::malformed(
                    next.at,
                    format!("`{}` is not an array of a FIELD", next.shown()),
                ));
            }
            done += 1;
        }
        Ok(())
    }

    fn attribute(&mut self, line: &VtkLine) -> Result<(), ParseError> {
        match keyword_array(line, &mut self.cursor, self.encoding)? {
            Some(header) => self.array(line, header),
            None => Err(ParseError::malformed(
                line.at,
                format!("`{}` where a keyword should be", line.shown()),
            )),
        }
    }

    /// Takes the payload of one array and keeps it if it is numeric and per particle.
    fn array(&mut self, line: &VtkLine, header: ArrayHeader) -> Result<(), ParseError> {
        let ArrayHeader { name, components, tuples, stored } = header;
        let particles = self.points.as_ref().map(|points| points.count);
        // Some writers leave POINT_DATA out; outside a FIELD that is what they mean.
        let section = match self.section {
            ArrayOwner::Points(n) | ArrayOwner::Cells(n) => Some(n),
            ArrayOwner::Dataset => particles,
        };
        let Some(tuples) = tuples.or(section) else {
            return Err(ParseError::malformed(
                line.at,
                format!("`{}` before POINTS", line.shown()),
            ));
        };
        let is_ours = match self.section {
            ArrayOwner::Points(n) => n == tuples,
            ArrayOwner::Cells(_) => false,
            ArrayOwner::Dataset => is_keyword(line.first_word()) && particles == Some(tuples),
        };
        let values = value_count(line.at, tuples, components)?;
        if components > MAX_COMPONENTS {
            return Err(ParseError::malformed(
                line.at,
                format!("{components} components are too many"),
            ));
        }
        self.components = components;
        let what = line.shown();
        let is_time = self.section == ArrayOwner::Dataset && values == 1 && is_time_name(&name);
        let is_wanted = self.mesh.is_none() && (is_ours || is_time);
        if stored == VtkType::Text || components == 0 || !is_wanted {
            return skip_values(&mut self.cursor, self.encoding, stored, values, &what);
        }
        let numbers = self.take(stored, values, &what)?;
        let numbers = if line.first_word().eq_ignore_ascii_case(b"COLOR_SCALARS") {
            numbers.into_color_codes()
        } else {
            numbers
        };
        if is_time {
            self.time = Some(numbers.decode(self.cursor.bytes())?.get_f64(0));
        } else {
            self.arrays.push(PointArray { name, components, numbers });
        }
        Ok(())
    }

    /// Skips a METADATA block. An unnamed component has an empty line of its own, so the first
    /// empty line need not be the end; what follows it always begins with a known keyword or an
    /// array of the FIELD.
    fn metadata(&mut self) -> Result<(), ParseError> {
        loop {
            let Some(line) = self.cursor.ahead(|cursor| cursor.line())? else {
                return Ok(());
            };
            let is_names = line.starts_with("COMPONENT_NAMES");
            if !is_names && is_section_start(&line) {
                return Ok(());
            }
            self.cursor.line()?;
            if is_names {
                for _ in 0..self.components {
                    if self.cursor.line()?.is_none() {
                        return Ok(());
                    }
                }
            }
        }
    }

    fn next_is(&mut self, keyword: &str) -> bool {
        let next = self.cursor.ahead(|cursor| cursor.keyword_line());
        matches!(next, Ok(Some(line)) if line.starts_with(keyword))
    }
}

/// What the cells after `line` are; none for points and lines, which have no faces.
fn cell_section(line: &VtkLine) -> Option<CellSection> {
    match line.first_word().to_ascii_uppercase().as_slice() {
        b"POLYGONS" => Some(CellSection::Polygons),
        b"TRIANGLE_STRIPS" => Some(CellSection::Strips),
        b"CELLS" => Some(CellSection::Typed),
        _ => None,
    }
}
