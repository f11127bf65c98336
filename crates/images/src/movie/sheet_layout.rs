//! Settings of sheets, and the places of their pictures.

use std::path::PathBuf;

use super::letters::LetterStyle;
use super::source::scaled_height;
use crate::output::view::DisplayView;
use crate::overlay::ColorBar;

/// Aspect ratio that sheets get if the number of columns is free.
const ASPECT: f64 = 1.6;

/// The format of a sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SheetFormat {
    /// Pixels alone.
    Png,
    /// The pictures as they are in their files; letters and colour bar as text and shapes.
    Pdf,
    /// The same.
    Svg,
}

/// Settings of a sheet.
#[derive(Debug, Clone, PartialEq)]
pub struct SheetSettings {
    /// Number of columns, or as many as make the sheet 1.6 times as wide as it is high.
    pub columns: Option<usize>,
    /// Largest width of the sheet in pixels.
    pub width: usize,
    /// Distance between pictures in pixels.
    pub gap: usize,
    /// Pixels per inch on paper, if they are stored.
    pub dpi: Option<u32>,
    /// Height of text in pixels.
    pub text: f32,
    /// How pictures are numbered, if they are.
    pub letters: Option<LetterStyle>,
    /// The colour bar for all pictures, if there is one.
    pub bar: Option<SheetBar>,
    /// The format of the file.
    pub format: SheetFormat,
}

/// A picture of a sheet.
#[derive(Debug, Clone, PartialEq)]
pub struct SheetSource {
    /// A PNG or OpenEXR file.
    pub path: PathBuf,
    /// How OpenEXR images are shown.
    pub view: DisplayView,
}

/// The colour bar of a sheet.
#[derive(Debug, Clone, PartialEq)]
pub struct SheetBar {
    /// The bar. Its direction is that of its place: vertical at the right, horizontal below.
    pub bar: ColorBar,
}

/// Places of the pictures on a sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SheetLayout {
    /// Number of columns and rows.
    pub cells: [usize; 2],
    /// Width and height of each picture in pixels.
    pub cell: [usize; 2],
    /// Width and height of the sheet in pixels.
    pub size: [usize; 2],
}

impl SheetLayout {
    /// The layout of `count` pictures of this size, at least one.
    pub fn new(count: usize, picture: [usize; 2], settings: &SheetSettings) -> Self {
        let count = count.max(1);
        let columns =
            settings.columns.unwrap_or_else(|| free_columns(count, picture)).clamp(1, count);
        let rows = count.div_ceil(columns);
        let gaps = settings.gap * (columns - 1);
        let width = settings.width.saturating_sub(gaps) / columns;
        // Pictures are never enlarged
        let width = width.clamp(1, picture[0]);
        let cell = [width, scaled_height(width, picture)];
        let size = |axis: usize, cells: usize| cells * cell[axis] + (cells - 1) * settings.gap;
        Self { cells: [columns, rows], cell, size: [size(0, columns), size(1, rows)] }
    }

    /// Left and top of picture number `index`.
    pub(super) fn place(&self, index: usize, gap: usize) -> [usize; 2] {
        let [column, row] = [index % self.cells[0], index / self.cells[0]];
        [column * (self.cell[0] + gap), row * (self.cell[1] + gap)]
    }
}

/// The number of columns whose sheet has the aspect ratio nearest to [`ASPECT`].
fn free_columns(count: usize, [width, height]: [usize; 2]) -> usize {
    let misfit = |columns: usize| {
        let rows = count.div_ceil(columns);
        let aspect = (columns * width) as f64 / (rows * height) as f64;
        // Empty cells look bad
        let empty = (columns * rows - count) as f64 / count as f64;
        (aspect / ASPECT).ln().abs() + empty
    };
    let best = (1..=count).min_by(|a, b| misfit(*a).total_cmp(&misfit(*b)));
    best.unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(columns: Option<usize>, width: usize) -> SheetSettings {
        SheetSettings {
            columns,
            width,
            gap: 8,
            dpi: None,
            text: 12.0,
            letters: None,
            bar: None,
            format: SheetFormat::Png,
        }
    }

    #[test]
    fn pictures_fill_the_width() {
        let layout = SheetLayout::new(9, [1920, 1080], &settings(None, 1920));
        assert_eq!(layout.cells, [3, 3]);
        assert_eq!(layout.cell, [634, 357]);
        assert_eq!(layout.size, [3 * 634 + 16, 3 * 357 + 16]);
        assert_eq!(layout.place(5, 8), [2 * 642, 365]);
        let layout = SheetLayout::new(9, [1920, 1080], &settings(Some(5), 1000));
        assert_eq!((layout.cells, layout.cell), ([5, 2], [193, 109]));
    }

    #[test]
    fn pictures_are_never_enlarged_and_never_vanish() {
        let layout = SheetLayout::new(2, [64, 36], &settings(Some(7), 1920));
        assert_eq!((layout.cells, layout.size), ([2, 1], [136, 36]));
        let layout = SheetLayout::new(1000, [1920, 2], &settings(Some(1000), 10));
        assert_eq!(layout.cell, [1, 1]);
        assert_eq!(SheetLayout::new(1, [7, 5], &settings(None, 100)).size, [7, 5]);
    }
}
