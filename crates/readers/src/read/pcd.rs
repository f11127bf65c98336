//! PCD files of the Point Cloud Library: text, binary and compressed, any fields.
//!
//! A header in lines (`FIELDS x y z rgb`, `SIZE`, `TYPE`, `COUNT`, `POINTS`, `DATA`), then records. Compressed files have
//! all values of a field one after another, in LZF. After the page "The PCD file format" of the library. Numbers are
//! little-endian, as all programs write them.

use super::columns::{
    self, ComponentStride, GrowingParticles, ParticleLayout, StridedColumn, check_room,
};
use super::input::TextInput;
use super::line_words::next_line;
use super::text::{self, Line, Lines};
use super::typed_text::{parse, push_number};
use super::{ByteSource, Step, lzf};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{Endian, MemoryBudget, ParseError, RawParticles, ScalarType};

/// PCD files.
pub const FORMAT: Format = Format::new(&Pcd);

struct Pcd;

/// What nearly all files begin with.
const MAGIC: &[u8] = b"# .PCD v";
/// Longest record, bytes; real ones have less than 4 KiB.
const MAX_RECORD: usize = 1 << 20;
/// Records that are decoded before they are appended to the arrays.
const BATCH: usize = 4096;
const NO_FIELDS: &str = "the PCD header lacks one of the lines FIELDS, SIZE and TYPE";
/// Bytes of the lengths before compressed data.
const LENGTHS: usize = 8;

impl Reader for Pcd {
    fn info(&self) -> FormatInfo {
        FormatInfo::new("pcd", &["pcd"])
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        match PcdHeader::parse(head) {
            Err(error @ ParseError::Unsupported { .. }) => Err(error),
            // The header may be longer
            Err(_) if head.starts_with(b"VERSION ") => Ok(Confidence::IfNamed),
            header => Ok(Confidence::signature_if(header.is_ok() || head.starts_with(MAGIC))),
        }
    }

    fn stream_unit(&self, head: &[u8]) -> Option<StreamUnit> {
        let header = PcdHeader::parse(head).ok()?;
        (header.encoding == Encoding::Ascii).then_some(StreamUnit::Words)
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let text = source.text();
        PcdHeader::parse(text.head())?;
        Ok(vec![Step::whole(text.left_about())])
    }

    /// Reads all fields. Colours that are packed into one number are taken apart.
    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let text = source.text();
        let bytes = text.head();
        let header = PcdHeader::parse(bytes)?;
        match header.encoding {
            Encoding::Ascii => read_text(text, &header, budget),
            Encoding::Binary => header.checked_layout(bytes)?.particles(bytes),
            Encoding::Compressed => {
                let planes = header.decompressed(bytes, budget)?;
                let left = budget.less(planes.len() as u64);
                left.check(planes.len() as u64, "its numbers in memory are")?;
                header.planes_layout()?.particles(&planes)
            }
        }
    }

    fn layout(&self, bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
        let header = PcdHeader::parse(bytes)?;
        let is_binary = header.encoding == Encoding::Binary;
        is_binary.then(|| header.checked_layout(bytes)).transpose()
    }

    fn unpacked_arrays_len(
        &self,
        head: &[u8],
        _file: crate::reader::FileExtent,
        _particles: &RawParticles,
    ) -> u64 {
        let header = PcdHeader::parse(head).ok();
        let packed = header.filter(|header| header.encoding == Encoding::Compressed);
        packed.map_or(0, |header| (header.points as u64).saturating_mul(header.record as u64))
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Ascii,
    Binary,
    Compressed,
}

/// A field of a record.
#[derive(Debug)]
struct Field {
    name: String,
    scalar: ScalarType,
    /// Numbers of each point.
    count: usize,
    /// Offset in a record.
    offset: usize,
}

impl Field {
    const fn len(&self) -> usize {
        self.scalar.size() * self.count
    }
}

#[derive(Debug)]
struct PcdHeader {
    fields: Vec<Field>,
    points: usize,
    /// Bytes of a point.
    record: usize,
    encoding: Encoding,
    /// Offset of the points.
    body: usize,
}

/// The number of points, or of those of a side.
fn count(value: Line<'_>) -> Result<usize, ParseError> {
    let count = text::integer(value.text).and_then(|count| usize::try_from(count).ok());
    count.ok_or_else(|| {
        let what = format!("{} is not a number of points", text::shown(value.text));
        ParseError::malformed(value.at, what)
    })
}

impl PcdHeader {
    fn parse(bytes: &[u8]) -> Result<Self, ParseError> {
        let mut lines = Lines::new(bytes, 0..bytes.len());
        let [mut fields, mut sizes, mut types, mut counts] = [const { None::<Line<'_>> }; 4];
        let (mut points, mut width, mut height) = (None, None, None);
        while let Some(line) = lines.next() {
            let (keyword, value) = split_keyword(line);
            match keyword {
                b"FIELDS" | b"COLUMNS" => fields = Some(value),
                b"SIZE" => sizes = Some(value),
                b"TYPE" => types = Some(value),
                b"COUNT" => counts = Some(value),
                b"WIDTH" => width = Some(count(value)?),
                b"HEIGHT" => height = Some(count(value)?),
                b"POINTS" => points = Some(count(value)?),
                b"VERSION" | b"VIEWPOINT" | b"" => {}
                b"DATA" => {
                    let encoding = match value.text {
                        b"ascii" => Encoding::Ascii,
                        b"binary" => Encoding::Binary,
                        b"binary_compressed" => Encoding::Compressed,
                        other if fields.is_some() && sizes.is_some() => {
                            let what = format!("PCD data of the kind {}", text::shown(other));
                            return Err(ParseError::unsupported(what + ": write binary ones"));
                        }
                        _ => return Err(ParseError::malformed(line.at, NO_FIELDS)),
                    };
                    let sides = width.zip(height.or(Some(1)));
                    let area = || sides.and_then(|(width, height)| width.checked_mul(height));
                    let (fields, record) = self::fields(line.at, fields, sizes, types, counts)?;
                    let points = points.or_else(area).ok_or_else(|| {
                        ParseError::malformed(line.at, "the PCD header has no number of POINTS")
                    })?;
                    return Ok(Self { fields, points, record, encoding, body: lines.at() });
                }
                _ if keyword.starts_with(b"#") => {}
                _ => {
                    let what = format!("{} is not a line of a PCD header", text::shown(line.text));
                    return Err(ParseError::malformed(line.at, what));
                }
            }
        }
        Err(ParseError::malformed(bytes.len(), "a PCD header without the line DATA"))
    }

    /// The columns of points whose field `index` begins at the byte `place(index)` with that stride.
    fn layout(
        &self,
        place: impl Fn(&Field) -> ComponentStride,
    ) -> Result<ParticleLayout, ParseError> {
        let is_axis = |field: &&Field| matches!(field.name.as_str(), "x" | "y" | "z");
        let axes = ["x", "y", "z"].map(|axis| self.fields.iter().find(|f| f.name == axis));
        let [Some(x), Some(y), Some(z)] = axes else {
            let names: Vec<&str> = self.fields.iter().take(12).map(|f| f.name.as_str()).collect();
            let what = format!("PCD points without x, y and z, they have [{}]", names.join(", "));
            return Err(ParseError::unsupported(what.escape_debug().to_string()));
        };
        let column = |field: &Field| {
            let scalar = (field.scalar, Endian::Little);
            StridedColumn::interleaved(&field.name, scalar, field.count, place(field))
        };
        let fields = self.fields.iter().filter(|f| f.name != "_" && !is_axis(f));
        let others = fields.map(|field| match field.name.as_str() {
            "rgb" | "rgba" if field.len() == 4 => packed_color(field, place(field)),
            _ => column(field),
        });
        let attributes = columns::group_vectors(others.collect());
        let positions = [x, y, z].map(|axis| {
            StridedColumn::interleaved(&axis.name, (axis.scalar, Endian::Little), 1, place(axis))
        });
        Ok(ParticleLayout::new(self.points, positions.into(), attributes))
    }

    /// The columns of records that begin at byte `start`.
    fn records_layout(&self, start: usize) -> Result<ParticleLayout, ParseError> {
        self.layout(|field| ComponentStride { start: start + field.offset, stride: self.record })
    }

    /// The same of the records in `bytes`, which are there.
    fn checked_layout(&self, bytes: &[u8]) -> Result<ParticleLayout, ParseError> {
        check_room(self.body, self.points, self.record, bytes.len())?;
        self.records_layout(self.body)
    }

    /// The columns of fields that follow one another.
    fn planes_layout(&self) -> Result<ParticleLayout, ParseError> {
        self.layout(|field| ComponentStride {
            start: field.offset * self.points,
            stride: field.len(),
        })
    }

    /// The fields of a compressed file.
    fn decompressed(&self, bytes: &[u8], budget: MemoryBudget) -> Result<Vec<u8>, ParseError> {
        let malformed = |what: String| ParseError::malformed(self.body, what);
        let stated = bytes.get(self.body..).and_then(|rest| rest.first_chunk::<LENGTHS>());
        let Some(stated) = stated else {
            return Err(malformed("the file ends before its compressed points".into()));
        };
        let (lengths, _) = stated.as_chunks::<4>();
        let [packed, unpacked] = [0, 1].map(|index| u32::from_le_bytes(lengths[index]) as usize);
        if self.points.checked_mul(self.record) != Some(unpacked) {
            let what = format!(
                "{} points of {} bytes are stated, and {unpacked} bytes of them",
                self.points, self.record
            );
            return Err(malformed(what));
        }
        budget.check(unpacked as u64, "decompressed it is")?;
        let start = self.body + LENGTHS;
        let Some(data) = bytes.get(start..).and_then(|rest| rest.get(..packed)) else {
            let left = bytes.len() - start;
            return Err(malformed(format!("{packed} compressed bytes, file has {left} left")));
        };
        let planes = lzf::decompress(data, unpacked)
            .map_err(|what| malformed(format!("compressed points are damaged: {what}")))?;
        if planes.len() < unpacked {
            let what = format!("compressed points end after {} of {unpacked} bytes", planes.len());
            return Err(malformed(what));
        }
        Ok(planes)
    }
}

/// The first word of a line, and what follows.
fn split_keyword(line: Line<'_>) -> (&[u8], Line<'_>) {
    let line_text = line.text.trim_ascii();
    let end = line_text.iter().position(u8::is_ascii_whitespace).unwrap_or(line_text.len());
    let (keyword, value) = line_text.split_at(end);
    (keyword, Line { text: value.trim_ascii(), ..line })
}

/// The fields and the length of a record by the lines of the header before the one at byte `at`.
fn fields(
    at: usize,
    names: Option<Line<'_>>,
    sizes: Option<Line<'_>>,
    types: Option<Line<'_>>,
    counts: Option<Line<'_>>,
) -> Result<(Vec<Field>, usize), ParseError> {
    let (Some(names), Some(sizes), Some(types)) = (names, sizes, types) else {
        return Err(ParseError::malformed(at, NO_FIELDS));
    };
    let (mut sizes, mut types) = (text::words(sizes.text), text::words(types.text));
    let mut counts = counts.map(|line| text::words(line.text));
    let mut record = 0;
    let mut fields = Vec::new();
    for name in text::words(names.text) {
        let shown = text::shown(name);
        let malformed = |what: String| ParseError::malformed(names.at, what);
        let size = sizes.next().unwrap_or_default();
        let known = types.next().and_then(|kind| scalar(kind, size));
        let scalar = known
            .ok_or_else(|| malformed(format!("the field {shown} has no valid TYPE and SIZE")))?;
        let stated = match &mut counts {
            Some(counts) => counts.next().and_then(text::integer),
            None => Some(1),
        };
        let count = stated
            .and_then(|count| usize::try_from(count).ok())
            .ok_or_else(|| malformed(format!("the field {shown} has no COUNT")))?;
        let field = Field {
            name: String::from_utf8_lossy(name).into_owned(),
            scalar,
            count: count.min(MAX_RECORD + 1),
            offset: record,
        };
        record += field.len();
        if record > MAX_RECORD {
            let what = format!("a point has more than {MAX_RECORD} bytes with the field {shown}");
            return Err(malformed(what));
        }
        fields.push(field);
    }
    Ok((fields, record))
}

fn scalar(kind: &[u8], size: &[u8]) -> Option<ScalarType> {
    Some(match (kind, size) {
        (b"I", b"1") => ScalarType::I8,
        (b"I", b"2") => ScalarType::I16,
        (b"I", b"4") => ScalarType::I32,
        (b"I", b"8") => ScalarType::I64,
        (b"U", b"1") => ScalarType::U8,
        (b"U", b"2") => ScalarType::U16,
        (b"U", b"4") => ScalarType::U32,
        (b"U", b"8") => ScalarType::U64,
        (b"F", b"4") => ScalarType::F32,
        (b"F", b"8") => ScalarType::F64,
        _ => return None,
    })
}

/// The colour in a number of four bytes: blue, green, red, and alpha, whatever type the number has.
fn packed_color(field: &Field, first: ComponentStride) -> StridedColumn {
    let bytes: &[usize] = if field.name == "rgba" { &[2, 1, 0, 3] } else { &[2, 1, 0] };
    let component = |byte: &usize| ComponentStride { start: first.start + byte, ..first };
    StridedColumn {
        name: "color".to_owned(),
        scalar: ScalarType::U8,
        endian: Endian::Little,
        component_strides: bytes.iter().map(component).collect(),
    }
}

/// Reads points in text, a line each.
fn read_text(
    text: &mut TextInput<'_>,
    header: &PcdHeader,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    text.go_to(header.body);
    let words: usize = header.fields.iter().map(|field| field.count).sum();
    // A number takes a character and a blank
    let most = (text.left_about() + 1) / (2 * words).max(1);
    let room = header.points.min(most);
    let mut growing = GrowingParticles::new(header.records_layout(0)?, room, budget);
    let mut packed = Vec::new();
    let mut left = header.points;
    while left > 0 {
        packed.clear();
        let batch = left.min(BATCH);
        for _ in 0..batch {
            text.pass_blank_lines(usize::MAX);
            pack(&mut packed, next_line(text, "line of a point")?, &header.fields)?;
        }
        growing.append(&packed, batch)?;
        left -= batch;
    }
    Ok(growing.into_particles())
}

/// Appends the numbers of a line as a record.
fn pack(packed: &mut Vec<u8>, line: Line<'_>, fields: &[Field]) -> Result<(), ParseError> {
    let mut words = text::words(line.text);
    for field in fields {
        for _ in 0..field.count {
            let word = words.next().unwrap_or_default();
            push_number(packed, word, field.scalar)
                .or_else(|| push_color(packed, word, field))
                .ok_or_else(|| {
                    let (name, kind) = (text::shown(field.name.as_bytes()), field.scalar.name());
                    let what = format!("field {name} is {}, not {kind}", text::shown(word));
                    ParseError::malformed(line.at, what)
                })?;
        }
    }
    Ok(())
}

/// Some programs write the integer of a colour whose type is a float, or the other way round.
fn push_color(packed: &mut Vec<u8>, word: &[u8], field: &Field) -> Option<()> {
    let is_color = matches!(field.name.as_str(), "rgb" | "rgba") && field.len() == 4;
    let number: f32 = parse(word).filter(|_| is_color)?;
    packed.extend_from_slice(&number.to_le_bytes());
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::damage::{TestedReader, attribute, coordinates, names, numbers};
    use crate::read::pieces;
    use spherule_frame::{AttributeData, Positions};

    fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
        pieces::steps(FORMAT, bytes)
    }

    fn read(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
        pieces::read(FORMAT, bytes, step)
    }

    const READER: TestedReader = TestedReader { steps, read };

    fn header(points: usize, data: &str) -> Vec<u8> {
        format!(
            "# .PCD v.7 - Point Cloud Data file format\nVERSION .7\nFIELDS x y z rgb normal_x normal_y normal_z _ h\n\
             SIZE 4 4 4 4 4 4 4 1 2\nTYPE F F F F F F F U I\nCOUNT 1 1 1 1 1 1 1 3 2\nWIDTH {points}\nHEIGHT 1\n\
             VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA {data}\n"
        )
        .into_bytes()
    }

    /// Two points field by field.
    fn planes() -> Vec<Vec<u8>> {
        let floats = |values: [f32; 2]| values.map(f32::to_le_bytes).concat();
        let color = [[30, 20, 10, 0], [3, 2, 1, 0]].concat();
        let mut planes =
            vec![floats([1.0, -1.5]), floats([2.0, f32::NAN]), floats([3.0, 0.25]), color];
        planes.extend([0.0, 1.0, 0.0].map(|n| floats([n, -n])));
        planes.extend([vec![9; 6], [7_i16, 8, -9, 10].map(i16::to_le_bytes).concat()]);
        planes
    }

    fn binary() -> Vec<u8> {
        let record = |point: usize| {
            planes()
                .iter()
                .flat_map(|plane| {
                    let len = plane.len() / 2;
                    plane[point * len..][..len].to_vec()
                })
                .collect::<Vec<u8>>()
        };
        [header(2, "binary"), record(0), record(1)].concat()
    }

    /// Literals only, which any compressor may write.
    fn compressed() -> Vec<u8> {
        let all = planes().concat();
        let data: Vec<u8> = all
            .chunks(32)
            .flat_map(|run| [&[u8::try_from(run.len() - 1).expect("short")], run].concat())
            .collect();
        let lengths =
            [data.len(), all.len()].map(|n| u32::try_from(n).expect("small").to_le_bytes());
        [header(2, "binary_compressed"), lengths.concat(), data].concat()
    }

    fn text() -> Vec<u8> {
        let color = |bytes: [u8; 4]| f32::from_le_bytes(bytes);
        let rows = format!(
            "1 2 3 {:e} 0 1 0 9 9 9 7 8\n-1.5 nan 0.25 {} -0 -1 -0 9 9 9 -9 10\n",
            color([30, 20, 10, 0]),
            color([3, 2, 1, 0]).to_bits()
        );
        [header(2, "ascii"), rows.into_bytes()].concat()
    }

    #[test]
    fn all_encodings_give_the_same() {
        for bytes in [binary(), compressed(), text()] {
            assert_eq!(FORMAT.reader().sniff(&bytes), Ok(Confidence::Signature));
            let found = READER.one(&bytes);
            assert_eq!(names(&found), ["color", "normal", "h"]);
            let Positions::F32(positions) = &found.positions else { panic!("f32") };
            assert_eq!(positions[0].to_array(), [1.0, 2.0, 3.0]);
            assert!(positions[1].y.is_nan());
            assert!(matches!(attribute(&found, "color").data, AttributeData::U8(_)));
            let color = numbers(&attribute(&found, "color").data);
            assert_eq!(color[..3], [10.0, 20.0, 30.0]);
            assert_eq!(numbers(&attribute(&found, "normal").data), [0., 1., 0., 0., -1., 0.]);
            assert_eq!(numbers(&attribute(&found, "h").data), [7., 8., -9., 10.]);
        }
        let layout = FORMAT.reader().layout(&binary()).expect("good").expect("binary");
        assert_eq!(layout.count, 2);
    }

    #[test]
    fn positions_may_be_double_and_the_order_any() {
        let text = "VERSION 0.7\r\nFIELDS rgba z y x intensity\r\nSIZE 4 8 8 8 4\r\nTYPE U F F F F\r\nWIDTH 1\r\n\
                    HEIGHT 1\r\nDATA ascii\r\n4278190335 0.1 0.2 0.3 5\r\n";
        assert_eq!(FORMAT.reader().sniff(text.as_bytes()), Ok(Confidence::Signature));
        let found = READER.one(text.as_bytes());
        assert_eq!(coordinates(&found.positions), [[0.3, 0.2, 0.1]]);
        assert_eq!(numbers(&attribute(&found, "color").data), [0.0, 0.0, 255.0, 255.0]);
        assert_eq!(numbers(&attribute(&found, "intensity").data), [5.0]);
        let empty = header(0, "ascii");
        assert_eq!(READER.one(&empty).positions.len(), 0);
    }

    #[test]
    fn damage_is_named() {
        let error = |bytes: &[u8]| READER.error_inside(bytes).to_string();
        let replaced = |from: &str, to: &str| {
            String::from_utf8(text()).expect("text").replacen(from, to, 1).into_bytes()
        };
        for (bytes, message) in [
            (
                replaced("POINTS 2", "POINTS 999999999999"),
                "no line of a point: the file is cut short",
            ),
            (
                replaced("COUNT 1", "COUNT 999999999999"),
                "more than 1048576 bytes with the field \"x\"",
            ),
            (replaced("COUNT 1 1 1 1 1 1 1 3 2", "COUNT 1"), "field \"y\" has no COUNT"),
            (replaced("TYPE F", "TYPE X"), "field \"x\" has no valid TYPE and SIZE"),
            (replaced("FIELDS x", "FIELDS u"), "points without x, y and z"),
            (replaced("DATA ascii", "DATA zip"), "PCD data of the kind \"zip\""),
            (replaced("\n-1.5", "\nhalf"), "field \"x\" is \"half\", not"),
            (replaced("SIZE 4", "LENGTH 4"), "is not a line of a PCD header"),
            (header(1 << 50, "binary"), "particles need"),
            (header(1 << 62, "binary"), "more than memory"),
            (header(1 << 60, "binary_compressed"), "ends before its compressed points"),
        ] {
            assert!(error(&bytes).contains(message), "{} | {message}", error(&bytes));
        }
        for bytes in [binary(), compressed(), text()] {
            let all = bytes.len();
            READER.survives_truncation(&bytes, &[8, 100, all - 20, all - 1], all - 4);
        }
        let mut damaged = compressed();
        let control = damaged.len() - planes().concat().len().div_ceil(32) - 20;
        damaged[control] = 0xff;
        assert!(READER.all(&damaged).is_ok() || error(&damaged).contains("damaged"));
        let tight = MemoryBudget::new(40, "take care");
        for bytes in [compressed(), text()] {
            let mut source = ByteSource::whole(&bytes);
            assert!(FORMAT.read_within(&mut source, &Step::whole(bytes.len()), tight).is_err());
        }
    }
}
