//! Contact sheets and figures of several panels: pictures side by side, with letters and a common colour bar.

use std::path::{Path, PathBuf};

use super::panels::Decoration;
use super::sheet_layout::{SheetFormat, SheetLayout, SheetSettings, SheetSource};
use super::source::scaled_height;
use super::{MovieError, Observer};
use crate::output::{Figure, FigurePicture};
use crate::overlay::{FrameView, Page, draw, marks};
use crate::picture::{MARKER, Picture};

/// Colour between the pictures.
const PAPER: [u8; 3] = [255; 3];

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
    // Add picture by picture; the first decides the layout
    let mut sheet: Option<Sheet> = None;
    for (index, SheetSource { path, view }) in sources.iter().enumerate() {
        if observer.stops() {
            return Err(MovieError::Stopped);
        }
        let picture = Picture::read(path, *view)?;
        let sheet = match &mut sheet {
            Some(sheet) => sheet,
            empty => empty.insert(Sheet::new(sources.len(), picture.size(), settings)?),
        };
        sheet.add(index, path, picture, settings);
        observer.on_picture(index + 1);
    }
    // Write the sheet
    let mut sheet = sheet.ok_or(MovieError::Empty)?;
    let io = |source| MovieError::Io { path: file.to_owned(), source };
    let bytes = match settings.format {
        SheetFormat::Png => sheet.drawn().png_on_paper(MARKER, settings.dpi),
        SheetFormat::Pdf => sheet.figure(settings.dpi).to_pdf(),
        SheetFormat::Svg => sheet.figure(settings.dpi).to_svg(),
    };
    spherule_files::publish(file, &bytes.map_err(io)?).map_err(io)?;
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
