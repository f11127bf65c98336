//! Bytes as text in pages.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// `bytes` in base64, with padding (RFC 4648).
pub fn base64(bytes: &[u8]) -> String {
    STANDARD.encode(bytes)
}

/// A PNG as address of an image.
pub fn data_url(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", base64(png))
}
