//! Pictures, such as logos.

use std::sync::Arc;

use super::Pen;
use super::canvas::Canvas;
use super::pixels::RgbaPixels;

/// A picture with alpha.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// The picture, as large as its file.
    pub source: Arc<RgbaPixels>,
    /// Height as a fraction of the height of the picture that it is drawn over.
    pub height: f32,
}

impl Image {
    /// Memory of the file's pixels, bytes.
    pub(super) fn bytes(&self) -> u64 {
        size_of_val(self.source.pixels()) as u64
    }

    pub(super) fn measure(&self, pen: &Pen) -> [f32; 2] {
        let height = (self.height * pen.picture).round().max(1.0);
        let aspect = self.source.width() as f32 / self.source.height() as f32;
        [(height * aspect).round().max(1.0), height]
    }

    pub(super) fn draw(&self, canvas: &mut dyn Canvas, corner: [f32; 2], pen: &Pen) {
        canvas.image(corner, self.measure(pen), &self.source);
    }
}
