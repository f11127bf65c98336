//! Contact sheets and figures of several panels: pictures side by side, with letters and a common colour bar.

use std::path::{Path, PathBuf};

use super::panels::{Decoration, LetterStyle, SheetBar};
use super::source::scaled_height;
use super::{MovieError, Observer};
use crate::output::{Figure, FigurePicture};
use crate::overlay::{FrameView, Page, draw, marks};
use crate::picture::{MARKER, Picture};

/// Colour between the pictures.
const PAPER: [u8; 3] = [255; 3];

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
    /// Exposure of OpenEXR images, stops.
    pub exposure: f32,
}

/// A finished sheet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FinishedSheet {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// The layout of the pictures.
    pub layout: SheetLayout,
    /// Pictures with another aspect ratio than the first, which are smaller than their places.
    pub narrower: Vec<PathBuf>,
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

/// A sheet that is being put together.
struct Sheet {
    layout: SheetLayout,
    page: Page,
    decoration: Decoration,
    panels: Vec<Panel>,
    narrower: Vec<PathBuf>,
}

/// A picture and its place.
struct Panel {
    picture: Picture,
    at: [usize; 2],
    /// Width and height on the sheet.
    shown: [usize; 2],
}

/// Writes a sheet of the pictures `sources` to `file`, where it replaces an older file.
///
/// # Errors
/// See [`MovieError`]. There is no new file then.
pub fn write_sheet(
    sources: &[SheetSource],
    settings: &SheetSettings,
    file: &Path,
    observer: &dyn Observer,
) -> Result<FinishedSheet, MovieError> {
    let mut sheet: Option<Sheet> = None;
    for (index, SheetSource { path, exposure }) in sources.iter().enumerate() {
        if observer.stops() {
            return Err(MovieError::Stopped);
        }
        let picture = Picture::read(path, *exposure)?;
        let sheet = match &mut sheet {
            Some(sheet) => sheet,
            empty => empty.insert(Sheet::new(sources.len(), picture.size(), settings)?),
        };
        sheet.add(index, path, picture, settings);
        observer.on_picture(index + 1);
    }
    let mut sheet = sheet.ok_or(MovieError::Empty)?;
    let io = |source| MovieError::Io { path: file.to_owned(), source };
    let bytes = match settings.format {
        SheetFormat::Png => sheet.drawn().png_on_paper(MARKER, settings.dpi),
        SheetFormat::Pdf => sheet.figure(settings.dpi).to_pdf(),
        SheetFormat::Svg => sheet.figure(settings.dpi).to_svg(),
    };
    spherule_jobs::publish(file, &bytes.map_err(io)?).map_err(io)?;
    let size = sheet.page.size.map(|side| side as usize);
    Ok(FinishedSheet { size, layout: sheet.layout, narrower: sheet.narrower })
}

impl Sheet {
    fn new(
        count: usize,
        picture: [usize; 2],
        settings: &SheetSettings,
    ) -> Result<Self, MovieError> {
        let (layout, decoration) = Decoration::around(count, picture, settings)?;
        let page = decoration.page;
        check(&page)?;
        Ok(Self { layout, page, decoration, panels: Vec::new(), narrower: Vec::new() })
    }

    /// Adds picture number `index`, as large as its place allows.
    fn add(&mut self, index: usize, path: &Path, picture: Picture, settings: &SheetSettings) {
        let cell = self.layout.cell;
        let shown = fitted(picture.size(), cell);
        // A pixel is a matter of rounding
        if (0..2).any(|axis| shown[axis] + 1 < cell[axis]) {
            self.narrower.push(path.to_owned());
        }
        let place = self.layout.place(index, settings.gap);
        let at = [0, 1]
            .map(|axis| place[axis] + self.page.at[axis] as usize + (cell[axis] - shown[axis]) / 2);
        let small = picture.scaled(shown[0], shown[1]);
        self.decoration.add_letter(index, place, &small, settings);
        let picture = if settings.format == SheetFormat::Png { small } else { picture };
        self.panels.push(Panel { picture, at, shown });
    }

    /// The sheet as pixels.
    fn drawn(&mut self) -> Picture {
        let [width, height] = self.page.size.map(|side| side as usize);
        let mut sheet = Picture::filled(width, height, PAPER);
        for Panel { picture, at: [left, top], .. } in &self.panels {
            sheet.put(picture, *left, *top);
        }
        let sprites = draw(&self.decoration.overlays, &self.page, &FrameView::default());
        for y in 0..height {
            for sprite in &sprites {
                sprite.draw_over(i32::try_from(y).unwrap_or(i32::MAX), sheet.row_mut(y));
            }
        }
        sheet
    }

    /// The sheet for formats with text and shapes.
    fn figure(&mut self, dpi: Option<u32>) -> Figure {
        let pixels = |v: [usize; 2]| v.map(|side| u32::try_from(side).unwrap_or(u32::MAX));
        let pictures = self.panels.drain(..).map(|panel| FigurePicture {
            size: pixels(panel.picture.size()),
            bytes: panel.picture.rgb().to_vec(),
            has_alpha: false,
            at: pixels(panel.at),
            shown: pixels(panel.shown),
        });
        Figure {
            size: self.page.size,
            dpi,
            paper: Some(PAPER),
            pictures: pictures.collect(),
            drawings: marks(&self.decoration.overlays, &self.page, &FrameView::default()),
        }
    }
}

/// The largest size with the aspect ratio of `picture` in a place, without enlarging it.
fn fitted(picture: [usize; 2], cell: [usize; 2]) -> [usize; 2] {
    let width = cell[0].min(picture[0]);
    let height = scaled_height(width, picture);
    if height <= cell[1] {
        return [width, height];
    }
    let width = (cell[1] * picture[0]).div_ceil(picture[1].max(1));
    [width.clamp(1, cell[0]), cell[1]]
}

/// Refuses a sheet of more than 16384 pixels in a direction or 134 million pixels.
fn check(page: &Page) -> Result<(), MovieError> {
    let [width, height] = page.size.map(|side| side as usize);
    if width.max(height) <= 1 << 14 && width * height <= 1 << 27 {
        return Ok(());
    }
    Err(MovieError::TooLarge { format: "a sheet", size: [width, height] })
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
