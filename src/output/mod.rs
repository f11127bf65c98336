//! Films to bytes: OpenEXR for work, PNG to look at. Encodes into memory; putting a file in place
//! whole is the caller's. And back: whether such a file is sound.

mod exr;
mod preview;
mod verify;
pub mod view;

pub use exr::{
    Compression, CustomAttribute, EncodedExr, ExrLayout, ExrOptions, OutputError, PackBuffers,
    PackedBlock, encode_exr, pack_block, write_blocks, write_exr,
};
pub use preview::{PreviewOptions, encode_preview};
pub use verify::{ImageFault, ImageShape, verify_exr, verify_preview};
