//! Codecs of `ffmpeg`, with settings that look good at any content.

use std::fmt;
use std::str::FromStr;

/// How `ffmpeg` compresses pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Codec {
    /// H.264, which everything plays.
    H264,
    /// Apple ProRes 422 HQ, for editing.
    ProRes,
    /// VP9, for web pages.
    Vp9,
}

/// The text is not a codec.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("choose one of h264, prores, vp9")]
pub struct CodecError;

impl Codec {
    /// All codecs.
    pub const ALL: [Self; 3] = [Self::H264, Self::ProRes, Self::Vp9];

    /// Its name in options.
    pub const fn name(self) -> &'static str {
        match self {
            Self::H264 => "h264",
            Self::ProRes => "prores",
            Self::Vp9 => "vp9",
        }
    }

    /// How pixels are stored. Players need the half resolution of colours.
    pub(super) const fn pixel_format(self) -> &'static str {
        match self {
            Self::H264 | Self::Vp9 => "yuv420p",
            Self::ProRes => "yuv422p10le",
        }
    }

    /// Encoder and quality. A constant rate factor gives all frames the same quality, and long movies a larger file.
    pub(super) const fn arguments(self) -> &'static [&'static str] {
        match self {
            Self::H264 => &["-c:v", "libx264", "-preset", "medium", "-crf", "16"],
            Self::ProRes => &["-c:v", "prores_ks", "-profile:v", "3", "-vendor", "apl0"],
            Self::Vp9 => &["-c:v", "libvpx-vp9", "-crf", "22", "-b:v", "0", "-row-mt", "1"],
        }
    }
}

impl fmt::Display for Codec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Codec {
    type Err = CodecError;

    fn from_str(text: &str) -> Result<Self, CodecError> {
        Self::ALL.into_iter().find(|codec| codec.name() == text).ok_or(CodecError)
    }
}
