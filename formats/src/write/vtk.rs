//! Legacy VTK, binary POLYDATA: one vertex per particle, attributes as field arrays. The version is 4.2, or 5.1
//! (whose cells are counted in 64 bits) for more particles than 4.2 can number.

use std::io::{self, Write};
use std::path::Path;

use glam::Vec3;
use spherule_files::publish_with;

use super::stream::{WriteError, publish_stream, write_numbers, write_positions, write_values};
use crate::convert::{ConvertError, ParticleSource, Progress};
use crate::{Attribute, FrameError, ScalarType};
use spherule_frame::with_values;

/// Writes `positions` and `attributes` (each with one value group per particle) to `path`. The file appears
/// complete or not at all. Blanks in names become `_`, as the format requires.
///
/// # Errors
/// [`FrameError::Io`], also if an attribute has another count, or if there are more particles than VTK's 32-bit
/// cells can count.
pub fn write(path: &Path, positions: &[Vec3], attributes: &[Attribute]) -> Result<(), FrameError> {
    let written = publish_with(path, |file| fill(file, positions, attributes));
    written.map(|_| ()).map_err(|e| FrameError::io(path, e))
}

/// Writes the particles of `source` to `path` in source order, with positions rounded to f32. The file appears
/// complete or not at all. Blanks in names become `_`, as the format requires.
///
/// # Errors
/// [`ConvertError::Frame`], or [`ConvertError::Interrupted`] if `progress` cancels.
pub fn stream(
    path: &Path,
    source: &dyn ParticleSource,
    progress: &dyn Progress,
) -> Result<(), ConvertError> {
    let cells = if source.count() <= MAX_SHORT { CellFormat::Short } else { CellFormat::Long };
    publish_stream(path, |file| fill_from(file, source, progress, cells))
}

/// Largest number of particles for version 4.2: the list of cells has two i32 per particle, and its length is an i32.
const MAX_SHORT: u64 = (i32::MAX / 2) as u64;

/// The format of the cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CellFormat {
    /// Version 4.2: for each cell its length and its particle, 32 bits each.
    Short,
    /// Version 5.1: the end of each cell, then the particles, 64 bits each.
    Long,
}

fn fill_from(
    file: &mut impl Write,
    source: &dyn ParticleSource,
    progress: &dyn Progress,
    cells: CellFormat,
) -> Result<(), WriteError> {
    // Write the header and the positions
    let count = source.count();
    let version = match cells {
        CellFormat::Short => "4.2",
        CellFormat::Long => "5.1",
    };
    write!(
        file,
        "# vtk DataFile Version {version}\nparticles\nBINARY\nDATASET POLYDATA\nPOINTS {count} float\n"
    )?;
    write_positions(file, source, progress, f32::to_be_bytes)?;
    // Write one vertex cell for each particle
    match cells {
        CellFormat::Short => {
            write!(file, "\nVERTICES {count} {}\n", 2 * count)?;
            // The upper half is the cell's length, 1; the lower half is the particle's index.
            write_numbers(file, count, progress, |i| ((1 << 32) | i).to_be_bytes())?;
        }
        CellFormat::Long => {
            write!(file, "\nVERTICES {} {count}\nOFFSETS vtktypeint64\n", count + 1)?;
            write_numbers(file, count + 1, progress, u64::to_be_bytes)?;
            write!(file, "\nCONNECTIVITY vtktypeint64\n")?;
            write_numbers(file, count, progress, u64::to_be_bytes)?;
        }
    }
    writeln!(file)?;
    // Write the attributes
    let attributes = source.attributes();
    if attributes.is_empty() {
        return Ok(());
    }
    let arrays = attributes.len();
    write!(file, "POINT_DATA {count}\nFIELD FieldData {arrays}\n")?;
    for (number, a) in attributes.iter().enumerate() {
        let (name, kind) = (word(&a.name), type_name(a.scalar));
        writeln!(file, "{name} {} {count} {kind}", a.components)?;
        write_values(file, source, number, progress)?;
        writeln!(file)?;
    }
    Ok(())
}

/// `name` with its blanks replaced.
fn word(name: &str) -> String {
    let blank_free = |c: char| if c.is_whitespace() { '_' } else { c };
    name.chars().map(blank_free).collect()
}

fn fill(file: &mut impl Write, positions: &[Vec3], attributes: &[Attribute]) -> io::Result<()> {
    let invalid = |what: String| io::Error::new(io::ErrorKind::InvalidInput, what);
    let count = positions.len();
    // The list of cells has two i32 per particle, and its length is an i32 too.
    let cells = i32::try_from(count)
        .ok()
        .filter(|count| count.checked_mul(2).is_some())
        .ok_or_else(|| invalid(format!("{count} particles are too many for legacy VTK")))?;
    // Write the header and the positions
    write!(
        file,
        "# vtk DataFile Version 4.2\nparticles\nBINARY\nDATASET POLYDATA\nPOINTS {count} float\n"
    )?;
    for p in positions {
        for value in p.to_array() {
            file.write_all(&value.to_be_bytes())?;
        }
    }
    // Write one vertex cell for each particle
    write!(file, "\nVERTICES {count} {}\n", 2 * cells)?;
    for index in 0..cells {
        file.write_all(&1i32.to_be_bytes())?;
        file.write_all(&index.to_be_bytes())?;
    }
    writeln!(file)?;
    // Write the attributes
    if attributes.is_empty() {
        return Ok(());
    }
    write!(file, "POINT_DATA {count}\nFIELD FieldData {}\n", attributes.len())?;
    for a in attributes {
        if a.components == 0 || count.checked_mul(a.components) != Some(a.data.len()) {
            return Err(invalid(format!("attribute {} does not fit {count} particles", a.name)));
        }
        let name = word(&a.name);
        let kind = type_name(a.data.scalar_type());
        writeln!(file, "{name} {} {count} {kind}", a.components)?;
        with_values!(&a.data, v => v.iter().try_for_each(|x| file.write_all(&x.to_be_bytes())))?;
        writeln!(file)?;
    }
    Ok(())
}

const fn type_name(kind: ScalarType) -> &'static str {
    match kind {
        ScalarType::I8 => "char",
        ScalarType::U8 => "unsigned_char",
        ScalarType::I16 => "short",
        ScalarType::U16 => "unsigned_short",
        ScalarType::I32 => "int",
        ScalarType::U32 => "unsigned_int",
        // `long` has 4 bytes on Windows; this type has 8 bytes everywhere.
        ScalarType::I64 => "vtktypeint64",
        ScalarType::U64 => "vtktypeuint64",
        ScalarType::F32 => "float",
        ScalarType::F64 => "double",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::{BlockSettings, BlockSource};
    use crate::read::vtk::FORMAT;
    use crate::{AttributeData, Positions};

    fn attribute(values: Vec<u16>) -> Attribute {
        Attribute { name: "my id".into(), components: 1, data: AttributeData::U16(values) }
    }

    #[test]
    fn one_particle_byte_for_byte() {
        let mut bytes = Vec::new();
        fill(&mut bytes, &[Vec3::new(1.0, 0.0, -2.0)], &[attribute(vec![258])]).expect("memory");
        let expected = [
            b"# vtk DataFile Version 4.2\nparticles\nBINARY\nDATASET POLYDATA\n".as_slice(),
            b"POINTS 1 float\n\x3f\x80\0\0\0\0\0\0\xc0\0\0\0\n",
            b"VERTICES 1 2\n\0\0\0\x01\0\0\0\0\n",
            b"POINT_DATA 1\nFIELD FieldData 1\nmy_id 1 1 unsigned_short\n\x01\x02\n",
        ];
        assert_eq!(bytes, expected.concat());
    }

    #[test]
    fn oversized_attributes_are_rejected() {
        let dir = tempfile::tempdir().expect("a temporary directory");
        let path = dir.path().join("a.vtk");
        let error = write(&path, &[Vec3::ZERO], &[attribute(vec![])]).expect_err("no value");
        assert!(error.to_string().contains("my id") && !path.exists());
        write(&path, &[], &[]).expect("writable");
        assert!(path.exists());
    }

    #[test]
    fn streams_contain_their_source() {
        let source = BlockSource::new(BlockSettings {
            count: 40_000,
            seed: 2,
            radius: None,
            has_velocity: true,
        });
        let read = |cells: CellFormat| {
            let mut bytes = Vec::new();
            assert!(fill_from(&mut bytes, &source, &(), cells).is_ok());
            let steps = FORMAT.steps(&bytes).expect("whole");
            FORMAT.read(&bytes, &steps[0]).expect("whole")
        };
        let (short, long) = (read(CellFormat::Short), read(CellFormat::Long));
        assert_eq!(short, long);
        let mut expected = vec![glam::DVec3::ZERO; 40_000];
        source.read_positions(0, &mut expected).expect("made");
        for (i, expected) in expected.iter().enumerate() {
            assert_eq!(short.positions.get(i), *expected);
        }
        let mut values = vec![0; 12 * 40_000];
        source.read_values(0, 0, &mut values).expect("made");
        let velocity = ScalarType::F32.decode(crate::Endian::Little, &values);
        assert_eq!(short.attributes[0].data, velocity.expect("whole"));

        let Positions::F32(positions) = &short.positions else { panic!("written in f32") };
        let dir = tempfile::tempdir().expect("a temporary directory");
        let (whole, streamed) = (dir.path().join("a.vtk"), dir.path().join("b.vtk"));
        write(&whole, positions, &short.attributes).expect("writable");
        stream(&streamed, &source, &()).expect("writable");
        let bytes = |path: &Path| std::fs::read(path).expect("readable");
        assert!(bytes(&whole) == bytes(&streamed));
    }
}
