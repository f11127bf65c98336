//! The rendered part of an image: the data window inside the display window, as OpenEXR calls them.

/// Position of the pixels of a film in the image of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DataWindow {
    /// Column of the left pixels in the image; negative beyond its left border.
    pub left: i32,
    /// Row of the top pixels in the image; negative beyond its top border.
    pub top: i32,
    /// Width and height of the image in pixels: the display window.
    pub image: [u32; 2],
}

impl DataWindow {
    /// The window of a film that is the whole image.
    pub const fn whole(width: u32, height: u32) -> Self {
        Self { left: 0, top: 0, image: [width, height] }
    }
}
