//! Encodes films as OpenEXR images and PNG, JPEG and TIFF pictures, and verifies such files.
//!
//! This module opens no files: callers pass readers and writers, and publish complete files.

mod exr;
mod format;
mod preview;
mod verify;
pub mod view;

pub use exr::{
    Compression, CustomAttribute, DEFAULT_LIGHT_GROUP, EncodedExr, ExrBlock, ExrLayout, ExrOptions,
    OutputError, PackBuffers, PackedBlock, PlaneNames, TextAttribute, ambiguous_name,
    attribute_planes, encode_exr, layer_planes, pack_block, write_blocks, write_exr,
};
pub use format::{PictureFormat, encode_picture};
pub use preview::{PreviewBackground, PreviewOptions, encode_preview};
pub use verify::{ImageFault, ImageShape, verify_exr, verify_preview};
