//! The pictures of a movie, read one at a time.

use std::path::PathBuf;

use super::{FrameRate, MovieError, Observer};
use crate::output::view::DisplayView;
use crate::picture::Picture;

/// The pictures of a movie, in their order.
#[derive(Debug, Clone, PartialEq)]
pub struct MovieSource {
    /// Files: PNG previews or OpenEXR images.
    pub paths: Vec<PathBuf>,
    /// How often each picture is shown.
    pub repeats: Vec<u32>,
    /// Frames per second.
    pub rate: FrameRate,
    /// Width to which larger pictures are scaled, in pixels.
    pub width: Option<usize>,
    /// How OpenEXR images are shown.
    pub view: DisplayView,
}

impl MovieSource {
    /// Number of pictures, each counted as often as it is shown.
    pub fn shown(&self) -> u64 {
        self.repeats.iter().copied().map(u64::from).sum()
    }

    /// The size of the pictures, from the first one.
    ///
    /// # Errors
    /// There is none, or it cannot be read.
    pub fn size(&self) -> Result<[usize; 2], MovieError> {
        Ok(self.first()?.size())
    }

    /// The first picture.
    pub(super) fn first(&self) -> Result<Picture, MovieError> {
        let path = self.paths.first().ok_or(MovieError::Empty)?;
        Ok(self.fitted(Picture::read(path, self.view)?))
    }

    /// Passes all pictures to `take`, with the number of times that each is shown.
    pub(super) fn each(
        &self,
        observer: &dyn Observer,
        mut take: impl FnMut(Picture, u32) -> Result<(), MovieError>,
    ) -> Result<(), MovieError> {
        let mut expected = None;
        for (index, (path, repeats)) in self.paths.iter().zip(&self.repeats).enumerate() {
            if observer.stops() {
                return Err(MovieError::Stopped);
            }
            // Read the picture, which must have the size of the first
            let picture = Picture::read(path, self.view)?;
            let expected = *expected.get_or_insert(picture.size());
            if picture.size() != expected {
                return Err(MovieError::OtherSize {
                    path: path.clone(),
                    found: picture.size(),
                    expected,
                });
            }
            take(self.fitted(picture), *repeats)?;
            observer.on_picture(index + 1);
        }
        Ok(())
    }

    /// The picture in the requested size. Pictures are never enlarged.
    fn fitted(&self, picture: Picture) -> Picture {
        let [width, height] = picture.size();
        match self.width.filter(|wanted| *wanted < width) {
            None => picture,
            Some(wanted) => picture.scaled(wanted, scaled_height(wanted, [width, height])),
        }
    }
}

/// The height of a picture that is scaled to `width`.
pub(super) const fn scaled_height(width: usize, [old_width, old_height]: [usize; 2]) -> usize {
    let height = (old_height * width + old_width / 2) / old_width;
    if height == 0 { 1 } else { height }
}
