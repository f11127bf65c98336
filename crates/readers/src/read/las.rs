//! LAS point clouds (`.las`), versions 1.0 to 1.4, formats of points 0 to 10, also compressed (`.laz`).
//!
//! A header, records of variable length, then points of equal length: coordinates in integers with a scale and an offset,
//! and what the format of points adds. Bytes beyond that are described by a record (`Extra Bytes`). After "LAS
//! Specification 1.4 - R15" of the ASPRS.

use std::borrow::Cow;

use glam::DVec3;

use super::columns::{self, ComponentStride, ParticleLayout, StridedColumn, check_room};
use super::numbers::NumberReader;
use super::{ByteSource, CUT_SHORT, Step};
use crate::format::Format;
use crate::reader::{Confidence, FileExtent, FormatInfo, Reader};
use spherule_frame::{
    Attribute, AttributeData, Endian, ParseError, Positions, RawParticles, ScalarType,
};

mod layered_times;
mod laz;
mod times;

/// LAS point clouds.
pub const FORMAT: Format = Format::new(&Las);

struct Las;

const MAGIC: &[u8] = b"LASF";
/// Offset of the minor version, and of the format of points.
const VERSION: usize = 25;
const POINT_FORMAT: usize = 104;
/// Bytes of the shortest header, and of one that has the count of version 1.4.
const MIN_HEADER: usize = 227;
const LARGE_HEADER: usize = 255;
/// The format of points has this bit in compressed files.
const COMPRESSED: u8 = 0x80;
/// Where the record of variable length with the extra bytes names itself.
const EXTRA_USER: &[u8] = b"LASF_Spec";
const EXTRA_RECORD: u16 = 4;
/// Bytes of the header of such a record, and of the description of a value in it.
const RECORD_HEADER: usize = 54;
const DESCRIPTION: usize = 192;

impl Reader for Las {
    fn info(&self) -> FormatInfo {
        FormatInfo { notes_need_whole_file: true, ..FormatInfo::new("las", &["las", "laz"]) }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        Ok(Confidence::signature_if(head.starts_with(MAGIC)))
    }

    /// Reads the points with intensity, classification, number of the source, time, colour, near infrared, and extra bytes
    /// in numbers.
    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let bytes = source.bytes();
        let header = LasHeader::parse(bytes)?;
        let bytes = if header.is_compressed {
            Cow::Owned(laz::unpack(bytes, &header, budget)?)
        } else {
            Cow::Borrowed(bytes)
        };
        let (bytes, budget) = (&*bytes, budget.less(header.unpacked_len()));
        check_room(header.start, header.count, header.record, bytes.len())?;
        let attributes = header.attributes(bytes);
        let layout = ParticleLayout::new(header.count, Vec::new(), Vec::new());
        let numbers: usize =
            attributes.iter().map(|c| c.component_strides.len() * c.scalar.size()).sum();
        let each = size_of::<DVec3>() + 3 * size_of::<i32>() + numbers;
        let need = (each as u64).saturating_mul(layout.count as u64);
        budget.check(need, "its numbers in memory are")?;
        let positions = header.positions(bytes)?;
        let mut read = Vec::new();
        for column in attributes {
            let components = column.component_strides.len();
            let mut data = columns::values(bytes, header.count, &column)?;
            if let (AttributeData::U8(classes), "classification", ..=5) =
                (&mut data, column.name.as_str(), header.format)
            {
                // The upper bits are flags
                classes.iter_mut().for_each(|class| *class &= 31);
            }
            read.push(Attribute { name: column.name, components, data });
        }
        Ok(RawParticles { positions, attributes: read, ..RawParticles::default() })
    }

    /// Points that have been decompressed.
    fn unpacked_arrays_len(&self, head: &[u8], _: FileExtent, _: &RawParticles) -> u64 {
        LasHeader::parse(head).map_or(0, |header| header.unpacked_len())
    }

    fn notes(&self, bytes: &[u8]) -> Vec<String> {
        let Ok(header) = LasHeader::parse(bytes) else {
            return Vec::new();
        };
        let name = if header.is_compressed { "LAZ" } else { "LAS" };
        let mut notes =
            vec![format!("{name} 1.{}, format of points {}", header.minor, header.format)];
        let (_, left_out) = header.extra_columns(bytes);
        if !left_out.is_empty() {
            let names = left_out.join(", ");
            notes.push(format!(
                "extra bytes that are scaled, or not numbers, are left out: {names}"
            ));
        }
        notes
    }
}

struct LasHeader {
    minor: u8,
    /// Bytes of the header, and number of the records behind it.
    len: usize,
    records: usize,
    /// Format, length and number of points, and where they start.
    format: u8,
    is_compressed: bool,
    record: usize,
    count: usize,
    start: usize,
    scale: DVec3,
    offset: DVec3,
}

impl LasHeader {
    fn parse(bytes: &[u8]) -> Result<Self, ParseError> {
        let at = |at: usize| NumberReader::new(bytes, at, Endian::Little);
        if !bytes.starts_with(MAGIC) {
            return Err(ParseError::malformed(0, "a LAS file begins with LASF"));
        }
        if bytes.len() < MIN_HEADER {
            let what = format!("a LAS header has {MIN_HEADER} bytes: {CUT_SHORT}");
            return Err(ParseError::malformed(bytes.len(), what));
        }
        let [minor] = at(VERSION).array()?;
        let len = usize::from(u16::from_le_bytes(at(94).array()?));
        let start = u32::from_le_bytes(at(96).array()?) as usize;
        let records = u32::from_le_bytes(at(100).array()?) as usize;
        let [stored] = at(POINT_FORMAT).array()?;
        // The next bit is set in some compressed files, too
        let is_compressed = stored & COMPRESSED != 0;
        let format = if is_compressed { stored & 0x3f } else { stored };
        let record = usize::from(u16::from_le_bytes(at(105).array()?));
        let Some((least, ..)) = offsets(format) else {
            let what = format!("the format of points {format}; formats 0 to 10 are read");
            return Err(ParseError::unsupported(what));
        };
        if record < least {
            let what = format!("points of {record} bytes, format {format} has {least}");
            return Err(ParseError::malformed(105, what));
        }
        let mut count = u64::from(u32::from_le_bytes(at(107).array()?));
        // Version 1.4 has larger counts behind the older header
        if minor >= 4 && len >= LARGE_HEADER && bytes.len() >= LARGE_HEADER {
            let large = at(247).u64()?;
            if count == 0 || large > count {
                count = large;
            }
        }
        let count = usize::try_from(count)
            .map_err(|_| ParseError::malformed(247, format!("{count} points")))?;
        let vector = |place: usize| -> Result<DVec3, ParseError> {
            let mut numbers = at(place);
            Ok(DVec3::new(numbers.f64()?, numbers.f64()?, numbers.f64()?))
        };
        let (scale, offset) = (vector(131)?, vector(155)?);
        if !scale.is_finite() || !offset.is_finite() || scale.x == 0.0 {
            let what =
                format!("the scale {scale} or the offset {offset} of coordinates is damaged");
            return Err(ParseError::malformed(131, what));
        }
        Ok(Self { minor, len, records, format, is_compressed, record, count, start, scale, offset })
    }

    /// Bytes of the file with its points decompressed; 0 if they are not compressed.
    fn unpacked_len(&self) -> u64 {
        let points = self.count.saturating_mul(self.record);
        if self.is_compressed { self.start.saturating_add(points) as u64 } else { 0 }
    }

    /// Numbers at byte `offset` of each point.
    fn column(&self, name: &str, scalar: ScalarType, n: usize, offset: usize) -> StridedColumn {
        let first = ComponentStride { start: self.start + offset, stride: self.record };
        StridedColumn::interleaved(name, (scalar, Endian::Little), n, first)
    }

    fn positions(&self, bytes: &[u8]) -> Result<Positions, ParseError> {
        let column = self.column("coordinates", ScalarType::I32, 3, 0);
        let AttributeData::I32(whole) = columns::values(bytes, self.count, &column)? else {
            return Ok(Positions::F64(Vec::new()));
        };
        let (triples, _) = whole.as_chunks::<3>();
        let position =
            |triple: &[i32; 3]| DVec3::from_array(triple.map(f64::from)) * self.scale + self.offset;
        Ok(Positions::F64(triples.iter().map(position).collect()))
    }

    /// The columns beside the coordinates of points that are there.
    fn attributes(&self, bytes: &[u8]) -> Vec<StridedColumn> {
        let (_, class, source, time, color, infrared) = offsets(self.format).unwrap_or_default();
        let mut columns = vec![
            self.column("intensity", ScalarType::U16, 1, 12),
            self.column("classification", ScalarType::U8, 1, class),
            self.column("point_source_id", ScalarType::U16, 1, source),
        ];
        let optional = [
            ("gps_time", ScalarType::F64, 1, time),
            ("color", self.color_type(bytes, color), 3, color),
            ("nir", ScalarType::U16, 1, infrared),
        ];
        for (name, scalar, components, offset) in
            optional.into_iter().filter(|(.., offset)| *offset > 0)
        {
            let mut column = self.column(name, scalar, components, offset);
            if name == "color" {
                let component = |index| ComponentStride {
                    start: self.start + offset + 2 * index,
                    stride: self.record,
                };
                column.component_strides = (0..components).map(component).collect();
            }
            columns.push(column);
        }
        columns.extend(self.extra_columns(bytes).0);
        columns
    }

    /// Colours have 16 bits, but many programs write codes of 8 bits there.
    fn color_type(&self, bytes: &[u8], offset: usize) -> ScalarType {
        let points = bytes.get(self.start..).unwrap_or_default().chunks_exact(self.record);
        let mut upper = points.take(self.count).flat_map(|point| {
            [1, 3, 5].map(|byte| point.get(offset + byte).copied().unwrap_or_default())
        });
        if upper.any(|byte| byte > 0) { ScalarType::U16 } else { ScalarType::U8 }
    }

    /// Columns of the extra bytes, and names of those that are left out.
    fn extra_columns(&self, bytes: &[u8]) -> (Vec<StridedColumn>, Vec<String>) {
        let (mut columns, mut left_out) = (Vec::new(), Vec::new());
        let (mut offset, ..) = offsets(self.format).unwrap_or_default();
        for description in self.extra_descriptions(bytes) {
            let [_, _, kind, options, ..] = *description;
            let (_, rest) = description.split_at(4);
            let letters = rest.iter().take(32).take_while(|b| **b != 0);
            let name: String =
                letters.map(|b| if b.is_ascii_graphic() { *b as char } else { '_' }).collect();
            let scalar = extra_type(kind);
            // Without a type, the options are the number of bytes
            let len = scalar.map_or(usize::from(options), ScalarType::size);
            let is_scaled = options & 0b1_1000 != 0;
            match scalar.filter(|_| !is_scaled && offset + len <= self.record) {
                Some(scalar) => columns.push(self.column(&name, scalar, 1, offset)),
                None => left_out.push(name),
            }
            offset += len;
        }
        (columns, left_out)
    }

    /// The descriptions of extra bytes.
    fn extra_descriptions<'a>(
        &self,
        bytes: &'a [u8],
    ) -> impl Iterator<Item = &'a [u8; DESCRIPTION]> {
        let record = self.record_of(bytes, EXTRA_USER, EXTRA_RECORD);
        record.map_or(&[][..], |(_, body)| body.as_chunks().0).iter()
    }

    /// The record of variable length that `user` numbers `id`, and where it is.
    fn record_of<'a>(&self, bytes: &'a [u8], user: &[u8], id: u16) -> Option<(usize, &'a [u8])> {
        let mut at = self.len;
        for _ in 0..self.records {
            let header = bytes.get(at..)?.get(..RECORD_HEADER)?;
            let number = |place: usize| u16::from_le_bytes([header[place], header[place + 1]]);
            let len = usize::from(number(20));
            at += RECORD_HEADER;
            let name = header[2..18].split(|byte| *byte == 0).next();
            if name == Some(user) && number(18) == id {
                return Some((at, bytes.get(at..)?.get(..len).unwrap_or_default()));
            }
            at += len;
        }
        None
    }
}

/// The shortest length of the points of a format, and offsets in them: of the classification, the number of the source, the
/// time, the colour and near infrared; 0 where there is none.
const fn offsets(format: u8) -> Option<(usize, usize, usize, usize, usize, usize)> {
    Some(match format {
        0 => (20, 15, 18, 0, 0, 0),
        1 => (28, 15, 18, 20, 0, 0),
        2 => (26, 15, 18, 0, 20, 0),
        3 => (34, 15, 18, 20, 28, 0),
        4 => (57, 15, 18, 20, 0, 0),
        5 => (63, 15, 18, 20, 28, 0),
        6 => (30, 16, 20, 22, 0, 0),
        7 => (36, 16, 20, 22, 30, 0),
        8 => (38, 16, 20, 22, 30, 36),
        9 => (59, 16, 20, 22, 0, 0),
        10 => (67, 16, 20, 22, 30, 36),
        _ => return None,
    })
}

const fn extra_type(kind: u8) -> Option<ScalarType> {
    Some(match kind {
        1 => ScalarType::U8,
        2 => ScalarType::I8,
        3 => ScalarType::U16,
        4 => ScalarType::I16,
        5 => ScalarType::U32,
        6 => ScalarType::I32,
        7 => ScalarType::U64,
        8 => ScalarType::I64,
        9 => ScalarType::F32,
        10 => ScalarType::F64,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::damage::{TestedReader, attribute, coordinates, names, numbers};

    const READER: TestedReader = TestedReader {
        steps: |bytes| FORMAT.steps(bytes),
        read: |bytes, step| FORMAT.read(bytes, step),
    };

    fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
        bytes[at..at + value.len()].copy_from_slice(value);
    }

    /// A file with two points of `format` and one extra number.
    fn cloud(minor: u8, format: u8, color: u16) -> Vec<u8> {
        let (least, class, source, time, rgb, nir) = offsets(format).expect("a format");
        let header_len: u16 = if minor == 4 { 375 } else { 227 };
        let mut bytes = vec![0; header_len.into()];
        put(&mut bytes, 0, MAGIC);
        put(&mut bytes, 24, &[1, minor]);
        put(&mut bytes, 94, &header_len.to_le_bytes());
        let start = u32::from(header_len) + 54 + 192;
        put(&mut bytes, 96, &start.to_le_bytes());
        put(&mut bytes, 100, &[1, 0, 0, 0, format]);
        let record = u16::try_from(least + 2).expect("short");
        put(&mut bytes, 105, &record.to_le_bytes());
        if minor < 4 {
            put(&mut bytes, 107, &[2]);
        } else {
            put(&mut bytes, 247, &[2]);
        }
        for (index, number) in [0.5, 0.25, 0.01, 100.0, -200.0, 0.0].into_iter().enumerate() {
            put(&mut bytes, 131 + 8 * index, &f64::to_le_bytes(number));
        }
        let mut extra = vec![0; 54 + 192];
        put(&mut extra, 2, b"LASF_Spec");
        put(&mut extra, 18, &[4, 0, 192, 0]);
        put(&mut extra, 54 + 2, &[4, 0]);
        put(&mut extra, 54 + 4, b"echo width");
        bytes.extend(extra);
        for point in [1_i32, -2] {
            let mut record = vec![0; least + 2];
            for axis in 0..3 {
                put(
                    &mut record,
                    4 * axis,
                    &(point * (1 + i32::try_from(axis).expect("small"))).to_le_bytes(),
                );
            }
            put(&mut record, 12, &[7, 1]);
            record[class] = 0xe2;
            record[source] = 9;
            for (offset, value) in
                [(time, &2.5_f64.to_le_bytes()[..]), (rgb, &color.to_le_bytes()), (nir, &[8])]
            {
                if offset > 0 {
                    put(&mut record, offset, value);
                }
            }
            put(&mut record, least, &(-3_i16).to_le_bytes());
            bytes.extend(record);
        }
        bytes
    }

    #[test]
    fn all_formats_of_points_are_read() {
        for (format, minor) in (0..=10).flat_map(|format| [(format, 0), (format, 2), (format, 4)]) {
            let bytes = cloud(minor, format, 513);
            assert_eq!(FORMAT.reader().sniff(&bytes), Ok(Confidence::Signature));
            let found = READER.one(&bytes);
            assert_eq!(
                coordinates(&found.positions),
                [[100.5, -199.5, 0.03], [99.0, -201.0, -0.06]]
            );
            let first = |name: &str| numbers(&attribute(&found, name).data)[0];
            assert_eq!(first("intensity"), 263.0);
            assert_eq!(first("classification"), if format < 6 { 2.0 } else { 226.0 });
            assert_eq!(first("point_source_id"), 9.0);
            assert_eq!(first("echo_width"), -3.0);
            let has = |name: &str| names(&found).contains(&name);
            assert_eq!(has("gps_time"), !matches!(format, 0 | 2));
            assert_eq!(has("color"), matches!(format, 2 | 3 | 5 | 7 | 8 | 10));
            assert_eq!(has("nir"), matches!(format, 8 | 10));
            if has("color") {
                assert_eq!(first("color"), 513.0);
                let eight = READER.one(&cloud(minor, format, 200));
                assert_eq!(
                    attribute(&eight, "color").data,
                    AttributeData::U8(vec![200, 0, 0, 200, 0, 0])
                );
            }
        }
    }

    #[test]
    fn damage_is_named() {
        let good = cloud(2, 3, 1);
        let error = |place: usize, value: &[u8]| {
            let mut bytes = good.clone();
            put(&mut bytes, place, value);
            READER.error_inside(&bytes).to_string()
        };
        for (place, value, message) in [
            (0, &b"X"[..], "begins with LASF"),
            (POINT_FORMAT, &[3 | COMPRESSED], "there is no record `laszip encoded`"),
            (POINT_FORMAT, &[11], "formats 0 to 10"),
            (105, &[10, 0], "points of 10 bytes, format 3 has 34"),
            (107, &[255; 4], "4294967295 particles need"),
            (96, &[255; 4], "2 particles need"),
            (131, &f64::NAN.to_le_bytes(), "of coordinates is damaged"),
        ] {
            assert!(error(place, value).contains(message), "{} | {message}", error(place, value));
        }
        READER.survives_truncation(&good, &[4, 104, 130, 227], good.len());
    }
}
