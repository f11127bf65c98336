//! Legacy VTK 4.2, binary POLYDATA: a vertex a particle, attributes as field arrays.

use std::io::{self, Write};
use std::path::Path;

use glam::Vec3;

use super::atomic::publish;
use crate::attribute::with_values;
use crate::{Attribute, FrameError, ScalarType};

/// Writes `positions` and `attributes` (each one value group a particle) to `path`, whole or not
/// at all. Blanks in names become `_`, as the format wants it.
///
/// # Errors
/// [`FrameError::Io`]; also for attributes of another count, and for more particles than VTK's
/// 32-bit cells can count.
pub fn write(path: &Path, positions: &[Vec3], attributes: &[Attribute]) -> Result<(), FrameError> {
    publish(path, |file| fill(file, positions, attributes)).map_err(|e| FrameError::io(path, e))
}

fn fill(file: &mut impl Write, positions: &[Vec3], attributes: &[Attribute]) -> io::Result<()> {
    let invalid = |what: String| io::Error::new(io::ErrorKind::InvalidInput, what);
    let count = positions.len();
    // The list of cells has two i32 a particle and its length is an i32 too.
    let cells = i32::try_from(count)
        .ok()
        .filter(|count| count.checked_mul(2).is_some())
        .ok_or_else(|| invalid(format!("{count} particles are too many for legacy VTK")))?;
    write!(
        file,
        "# vtk DataFile Version 4.2\nparticles\nBINARY\nDATASET POLYDATA\nPOINTS {count} float\n"
    )?;
    for p in positions {
        for value in p.to_array() {
            file.write_all(&value.to_be_bytes())?;
        }
    }
    write!(file, "\nVERTICES {count} {}\n", 2 * cells)?;
    for index in 0..cells {
        file.write_all(&1i32.to_be_bytes())?;
        file.write_all(&index.to_be_bytes())?;
    }
    writeln!(file)?;
    if attributes.is_empty() {
        return Ok(());
    }
    write!(
        file,
        "POINT_DATA {count}\nFIELD FieldData {}\n",
        attributes.len()
    )?;
    for a in attributes {
        if a.components == 0 || count.checked_mul(a.components) != Some(a.data.len()) {
            return Err(invalid(format!(
                "attribute {} does not fit {count} particles",
                a.name
            )));
        }
        let name: String = a
            .name
            .chars()
            .map(|c| if c.is_whitespace() { '_' } else { c })
            .collect();
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
        // `long` has 4 bytes on Windows, these have 8 everywhere.
        ScalarType::I64 => "vtktypeint64",
        ScalarType::U64 => "vtktypeuint64",
        ScalarType::F32 => "float",
        ScalarType::F64 => "double",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::AttributeData;

    fn attribute(values: Vec<u16>) -> Attribute {
        Attribute {
            name: "my id".into(),
            components: 1,
            data: AttributeData::U16(values),
        }
    }

    #[test]
    fn one_particle_byte_for_byte() {
        let mut bytes = Vec::new();
        fill(
            &mut bytes,
            &[Vec3::new(1.0, 0.0, -2.0)],
            &[attribute(vec![258])],
        )
        .expect("memory");
        let expected = [
            b"# vtk DataFile Version 4.2\nparticles\nBINARY\nDATASET POLYDATA\n".as_slice(),
            b"POINTS 1 float\n\x3f\x80\0\0\0\0\0\0\xc0\0\0\0\n",
            b"VERTICES 1 2\n\0\0\0\x01\0\0\0\0\n",
            b"POINT_DATA 1\nFIELD FieldData 1\nmy_id 1 1 unsigned_short\n\x01\x02\n",
        ];
        assert_eq!(bytes, expected.concat());
    }

    #[test]
    fn attributes_that_do_not_fit_are_refused() {
        let dir = tempfile::tempdir().expect("a temporary directory");
        let path = dir.path().join("a.vtk");
        let error = write(&path, &[Vec3::ZERO], &[attribute(vec![])]).expect_err("no value");
        assert!(error.to_string().contains("my id") && !path.exists());
        write(&path, &[], &[]).expect("writable");
        assert!(path.exists());
    }
}
