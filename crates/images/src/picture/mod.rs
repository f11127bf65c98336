//! Finished pictures as input, for movies, contact sheets and pages: 8-bit sRGB from PNG previews, or from OpenEXR
//! images by the same view transform; planes of OpenEXR images; scaling in linear light.
//!
//! Sizes are checked before memory for pixels is allocated. `hdr` reads images that light a scene or lie in it.

use std::io;
use std::path::Path;

use crate::file::{Fault, ImageFormat, ImageReadError, read};
use crate::output::view::DisplayView;

mod exr;
mod origin;
mod png;
mod scale;

pub use exr::{EXR_EXTENSION, PlaneSamples, SampledPlanes, read_planes};
pub use origin::{MARKER, is_own_file};

/// Largest width and height in pixels.
pub const MAX_SIDE: usize = 1 << 15;

/// Largest number of pixels: 8192 x 8192.
const MAX_PIXELS: usize = 1 << 26;

/// An 8-bit sRGB picture, row by row from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    width: usize,
    height: usize,
    rgb: Vec<u8>,
}

impl Picture {
    /// A picture of these bytes: three for each pixel.
    ///
    /// # Panics
    /// The number of bytes does not fit the size.
    pub fn new(width: usize, height: usize, rgb: Vec<u8>) -> Self {
        assert_eq!(rgb.len(), 3 * width * height, "three bytes for each pixel");
        Self { width, height, rgb }
    }

    /// A picture of one colour.
    pub fn filled(width: usize, height: usize, color: [u8; 3]) -> Self {
        Self::new(width, height, color.repeat(width * height))
    }

    /// Reads the picture at `path`: a PNG file, or the colours of an OpenEXR image, shown by `view`.
    ///
    /// # Errors
    /// See [`ImageReadError`]; messages begin with the path.
    pub fn read(path: &Path, view: DisplayView) -> Result<Self, ImageReadError> {
        read(path, |mut file| match ImageFormat::of(&mut file)? {
            ImageFormat::OpenExr => exr::picture(file, view),
            _ => png::picture(file),
        })
    }

    /// Width in pixels.
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub const fn height(&self) -> usize {
        self.height
    }

    /// Width and height in pixels.
    pub const fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// The bytes: three for each pixel, row by row from the top.
    pub fn rgb(&self) -> &[u8] {
        &self.rgb
    }

    /// The colours of the pixels, row by row from the top.
    pub fn pixels(&self) -> &[[u8; 3]] {
        self.rgb.as_chunks().0
    }

    /// The bytes of row `y`.
    pub fn row(&self, y: usize) -> &[u8] {
        &self.rgb[3 * self.width * y..][..3 * self.width]
    }

    /// The bytes of row `y`, to draw over.
    pub fn row_mut(&mut self, y: usize) -> &mut [u8] {
        &mut self.rgb[3 * self.width * y..][..3 * self.width]
    }

    /// Puts `other` into this picture with its first pixel at `left` and `top`. What is outside is left out.
    pub fn put(&mut self, other: &Self, left: usize, top: usize) {
        let count = other.width.min(self.width.saturating_sub(left));
        let rows = other.height.min(self.height.saturating_sub(top));
        for y in 0..rows {
            let start = 3 * (self.width * (top + y) + left);
            self.rgb[start..start + 3 * count].copy_from_slice(&other.row(y)[..3 * count]);
        }
    }

    /// The picture with its last column and row repeated up to `width` and `height`.
    #[must_use]
    pub fn padded(self, width: usize, height: usize) -> Self {
        if [width, height] == self.size() {
            return self;
        }
        let mut rgb = Vec::with_capacity(3 * width * height);
        for y in 0..height {
            for x in 0..width {
                let (x, y) = (x.min(self.width - 1), y.min(self.height - 1));
                rgb.extend_from_slice(&self.row(y)[3 * x..3 * x + 3]);
            }
        }
        Self::new(width, height, rgb)
    }

    /// The file as PNG, with `software` as its origin.
    ///
    /// # Errors
    /// The encoder refuses the picture.
    pub fn png(&self, software: &str) -> io::Result<Vec<u8>> {
        png::encode(self, software, None)
    }

    /// The same with a number of pixels per inch on paper, if it is known.
    ///
    /// # Errors
    /// The encoder refuses the picture.
    pub fn png_on_paper(&self, software: &str, dpi: Option<u32>) -> io::Result<Vec<u8>> {
        png::encode(self, software, dpi)
    }
}

/// Checks a size before memory for its pixels is allocated.
fn check_size(width: usize, height: usize) -> Result<(), Fault> {
    let pixels = width.checked_mul(height);
    let is_good = width.max(height) <= MAX_SIDE && pixels.is_some_and(|p| p <= MAX_PIXELS);
    if is_good && pixels != Some(0) {
        return Ok(());
    }
    Err(Fault::Other(format!(
        "has {width}x{height} pixels; at most {MAX_PIXELS} pixels and {MAX_SIDE} in a row are possible"
    )))
}

/// Reads a PNG file with its alpha: the width, and the pixels of 8-bit sRGB, row by row from the top, whose colours are
/// not multiplied by alpha.
///
/// # Errors
/// See [`ImageReadError`]; messages begin with the path.
pub fn read_rgba(path: &Path) -> Result<(usize, Vec<[u8; 4]>), ImageReadError> {
    read(path, png::rgba)
}

/// The number of pixels per inch on paper that the PNG file at `path` stores; None for other files.
///
/// # Errors
/// See [`ImageReadError`]; messages begin with the path.
pub fn read_dpi(path: &Path) -> Result<Option<u32>, ImageReadError> {
    read(path, |mut file| match ImageFormat::of(&mut file)? {
        ImageFormat::OpenExr => Ok(None),
        _ => png::dpi(file),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn padding_repeats_the_last_column_and_row() {
        let picture = Picture::new(1, 2, vec![1, 2, 3, 4, 5, 6]);
        assert_eq!(picture.clone().padded(1, 2), picture);
        let padded = picture.padded(2, 3);
        assert_eq!(padded.row(0), [1, 2, 3, 1, 2, 3]);
        assert_eq!(padded.row(1), [4, 5, 6, 4, 5, 6]);
        assert_eq!(padded.row(2), padded.row(1));
    }

    #[test]
    fn pictures_are_cut_at_the_edge_of_others() {
        let mut page = Picture::filled(3, 2, [9; 3]);
        page.put(&Picture::filled(2, 2, [1; 3]), 2, 1);
        page.put(&Picture::filled(2, 2, [5; 3]), 7, 7);
        assert_eq!(page.row(0), [9; 9]);
        assert_eq!(page.row(1), [9, 9, 9, 9, 9, 9, 1, 1, 1]);
    }

    #[test]
    fn files_that_are_no_pictures_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        for (name, bytes) in [
            ("a.png", &b"GIF89a"[..]),
            ("b.png", b""),
            ("c.exr", b"\x76\x2f\x31\x01\x02\0\0\0"),
            ("d.exr", b"no image"),
        ] {
            let path = dir.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            let error = Picture::read(&path, DisplayView::default()).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
        let error =
            Picture::read(&dir.path().join("none.png"), DisplayView::default()).unwrap_err();
        assert!(matches!(error, ImageReadError::Io { .. }), "{error}");
    }

    #[test]
    fn damaged_png_files_are_errors() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let picture = Picture::filled(40, 30, [20, 90, 200]);
        let whole = picture.png("test").unwrap();
        let header = &whole[..whole.len() / 2];
        std::fs::write(&path, header).unwrap();
        assert!(Picture::read(&path, DisplayView::default()).is_err());
        for at in (0..whole.len()).step_by(3) {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x41;
            std::fs::write(&path, &bytes).unwrap();
            // No panic and no huge allocation; text chunks have no effect on the pixels
            let _ = Picture::read(&path, DisplayView::default());
            std::fs::write(&path, &whole[..at]).unwrap();
            // Only the end mark may be missing
            let read = Picture::read(&path, DisplayView::default());
            assert!(read.is_err() || read.is_ok_and(|read| read == picture), "{at}");
        }
    }
}
