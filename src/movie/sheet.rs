//! Contact sheets: small pictures side by side.

use std::path::{Path, PathBuf};

use super::source::scaled_height;
use super::{MovieError, Observer};
use crate::picture::{MARKER, Picture};

/// Colour between the pictures.
const PAPER: [u8; 3] = [255; 3];

/// Aspect ratio that sheets get if the number of columns is free.
const ASPECT: f64 = 1.6;

/// Settings of a sheet.
#[derive(Debug, Clone, PartialEq)]
pub struct SheetSettings {
    /// Number of columns, or as many as make the sheet 1.6 times as wide as it is high.
    pub columns: Option<usize>,
    /// Largest width of the sheet in pixels.
    pub width: usize,
    /// Distance between pictures in pixels.
    pub gap: usize,
    /// Exposure of OpenEXR images, stops.
    pub exposure: f32,
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
        let columns = settings.columns.unwrap_or_else(|| free_columns(count, picture));
        let columns = columns.clamp(1, count);
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
    fn place(&self, index: usize, gap: usize) -> [usize; 2] {
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

/// Writes a sheet of the pictures `paths` to `file`, as PNG, where it replaces an older file.
///
/// # Errors
/// See [`MovieError`]. There is no new file then.
pub fn write_sheet(
    paths: &[PathBuf],
    settings: &SheetSettings,
    file: &Path,
    observer: &dyn Observer,
) -> Result<SheetLayout, MovieError> {
    let mut sheet: Option<(Picture, SheetLayout)> = None;
    for (index, path) in paths.iter().enumerate() {
        if observer.stops() {
            return Err(MovieError::Stopped);
        }
        let picture = Picture::read(path, settings.exposure)?;
        let (sheet, layout) = match &mut sheet {
            Some(sheet) => sheet,
            empty => {
                let layout = SheetLayout::new(paths.len(), picture.size(), settings);
                check(&layout)?;
                let [width, height] = layout.size;
                empty.insert((Picture::filled(width, height, PAPER), layout))
            }
        };
        let [left, top] = layout.place(index, settings.gap);
        sheet.put(&picture.scaled(layout.cell[0], layout.cell[1]), left, top);
        observer.on_picture(index + 1);
    }
    let (sheet, layout) = sheet.ok_or(MovieError::Empty)?;
    let io = |source| MovieError::Io { path: file.to_owned(), source };
    let png = sheet.png(MARKER).map_err(io)?;
    spherule_jobs::publish(file, &png).map_err(io)?;
    Ok(layout)
}

/// Refuses a sheet of more than 16384 pixels in a direction or 134 million pixels.
fn check(layout: &SheetLayout) -> Result<(), MovieError> {
    let [width, height] = layout.size;
    if width.max(height) <= 1 << 14 && width * height <= 1 << 27 {
        return Ok(());
    }
    Err(MovieError::TooLarge { format: "a sheet", size: layout.size })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(columns: Option<usize>, width: usize) -> SheetSettings {
        SheetSettings { columns, width, gap: 8, exposure: 0.0 }
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
