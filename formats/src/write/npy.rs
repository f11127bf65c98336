//! NPY version 1.0: positions as an array of shape (N, 3), `<f4`.

use std::io::{self, Write};
use std::path::Path;

use glam::Vec3;
use spherule_files::publish_with;

use super::stream::{publish_stream, write_positions};
use crate::FrameError;
use crate::convert::{ConvertError, ParticleSource, Progress};

/// Writes `positions` to `path`. The file appears complete or not at all.
///
/// # Errors
/// [`FrameError::Io`].
pub fn write(path: &Path, positions: &[Vec3]) -> Result<(), FrameError> {
    let written = publish_with(path, |file| fill(file, positions));
    written.map(|_| ()).map_err(|e| FrameError::io(path, e))
}

/// Writes the positions of `source` to `path` in source order, rounded to f32. The file appears complete or not
/// at all. The format has no equivalent for attributes.
///
/// # Errors
/// [`ConvertError::Frame`], or [`ConvertError::Interrupted`] if `progress` cancels.
pub fn stream(
    path: &Path,
    source: &dyn ParticleSource,
    progress: &dyn Progress,
) -> Result<(), ConvertError> {
    publish_stream(path, |file| {
        fill_header(file, source.count())?;
        write_positions(file, source, progress, f32::to_le_bytes)
    })
}

fn fill(file: &mut impl Write, positions: &[Vec3]) -> io::Result<()> {
    fill_header(file, positions.len() as u64)?;
    for p in positions {
        for value in p.to_array() {
            file.write_all(&value.to_le_bytes())?;
        }
    }
    Ok(())
}

fn fill_header(file: &mut impl Write, count: u64) -> io::Result<()> {
    let dict = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({count}, 3), }}");
    // Magic, version and length take 10 bytes. The data begins at a multiple of 64, after a newline.
    let header_len = (10 + dict.len() + 1).next_multiple_of(64) - 10;
    let length = u16::try_from(header_len).map_err(io::Error::other)?;
    file.write_all(b"\x93NUMPY\x01\x00")?;
    file.write_all(&length.to_le_bytes())?;
    writeln!(file, "{dict:width$}", width = header_len - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::BoxSource;
    use crate::generate::{BoxSettings, fill_box};

    #[test]
    fn output_equals_that_of_numpy() {
        for count in [0usize, 1, 1000] {
            let mut bytes = Vec::new();
            fill(&mut bytes, &vec![Vec3::new(1.0, 2.0, -3.0); count]).expect("memory");
            let data = bytes.len() - count * 12;
            assert_eq!((data % 64, bytes[data - 1]), (0, b'\n'));
            assert_eq!(usize::from(bytes[8]) + 256 * usize::from(bytes[9]) + 10, data);
            let header = String::from_utf8_lossy(&bytes[10..data]).into_owned();
            let expected =
                format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({count}, 3), }}");
            assert_eq!(header.trim_end(), expected);
            if count > 0 {
                assert_eq!(bytes[bytes.len() - 4..], (-3.0f32).to_le_bytes());
            }
        }
    }

    #[test]
    fn streams_are_the_same_files() {
        let settings = BoxSettings::thesis(20_000, 3);
        let dir = tempfile::tempdir().expect("a temporary directory");
        let (whole, streamed) = (dir.path().join("a.npy"), dir.path().join("b.npy"));
        write(&whole, &fill_box(&settings)).expect("writable");
        stream(&streamed, &BoxSource::new(settings, None), &()).expect("writable");
        let bytes = |path: &Path| std::fs::read(path).expect("readable");
        assert!(bytes(&whole) == bytes(&streamed));
    }
}
