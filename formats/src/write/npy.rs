//! NPY version 1.0: positions as an array of shape (N, 3), `<f4`.

use std::io::{self, Write};
use std::path::Path;

use glam::Vec3;

use super::atomic::publish;
use crate::FrameError;

/// Writes `positions` to `path`, whole or not at all.
///
/// # Errors
/// [`FrameError::Io`].
pub fn write(path: &Path, positions: &[Vec3]) -> Result<(), FrameError> {
    publish(path, |file| fill(file, positions)).map_err(|e| FrameError::io(path, e))
}

fn fill(file: &mut impl Write, positions: &[Vec3]) -> io::Result<()> {
    let dict = format!(
        "{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, 3), }}",
        positions.len()
    );
    // Magic, version and length take 10 bytes; data begin at a multiple of 64, after a newline.
    let header_len = (10 + dict.len() + 1).next_multiple_of(64) - 10;
    let length = u16::try_from(header_len).map_err(io::Error::other)?;
    file.write_all(b"\x93NUMPY\x01\x00")?;
    file.write_all(&length.to_le_bytes())?;
    writeln!(file, "{dict:width$}", width = header_len - 1)?;
    for p in positions {
        for value in p.to_array() {
            file.write_all(&value.to_le_bytes())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_is_what_numpy_writes() {
        for count in [0usize, 1, 1000] {
            let mut bytes = Vec::new();
            fill(&mut bytes, &vec![Vec3::new(1.0, 2.0, -3.0); count]).expect("memory");
            let data = bytes.len() - count * 12;
            assert_eq!((data % 64, bytes[data - 1]), (0, b'\n'));
            assert_eq!(
                usize::from(bytes[8]) + 256 * usize::from(bytes[9]) + 10,
                data
            );
            let header = String::from_utf8_lossy(&bytes[10..data]).into_owned();
            let expected =
                format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({count}, 3), }}");
            assert_eq!(header.trim_end(), expected);
            if count > 0 {
                assert_eq!(bytes[bytes.len() - 4..], (-3.0f32).to_le_bytes());
            }
        }
    }
}
