//! Encodes films as OpenEXR images, PNG, JPEG and TIFF pictures and PDF and SVG figures, and verifies such files.
//!
//! This module opens no files: callers pass readers and writers, and publish complete files.

mod base64;
mod exr;
mod figure;
mod format;
mod preview;
mod srgb;
mod verify;
pub mod view;

pub use base64::{base64, data_url};
pub use exr::{
    Compression, CustomAttribute, DEFAULT_LIGHT_GROUP, EncodedExr, ExrBlock, ExrLayout, ExrOptions,
    OutputError, PackBuffers, PackedBlock, PlaneNames, TextAttribute, ambiguous_name,
    attribute_planes, encode_exr, encoder_bytes, pack_block, plane_channels, write_blocks,
    write_exr,
};
pub use figure::{Figure, FigurePicture};
pub use format::{PictureFormat, encode_figure, encode_picture};
pub use preview::{PreviewBackground, PreviewOptions, PreviewPage, encode_preview, picture_bytes};
pub use srgb::SrgbPixels;
pub use verify::{ImageFault, ImageShape, verify_exr, verify_preview};
