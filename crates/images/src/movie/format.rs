//! File formats of movies, by the extension of their name.

use std::path::Path;

use thiserror::Error;

use super::Codec;
use crate::picture::MAX_SIDE;

/// A file format that `ffmpeg` writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Container {
    /// `.mp4`
    Mp4,
    /// `.mov`
    Mov,
    /// `.mkv`
    Mkv,
    /// `.webm`
    WebM,
}

/// The format of a movie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MovieFormat {
    /// Written by `ffmpeg`.
    Ffmpeg {
        /// The file format.
        container: Container,
        /// The codec.
        codec: Codec,
    },
    /// GIF, with 255 colours.
    Gif,
    /// Animated PNG, without loss.
    Apng,
    /// Animated WebP, without loss.
    WebP,
}

/// Why a name and a codec do not give a format.
#[derive(Debug, PartialEq, Eq, Error)]
pub enum FormatError {
    /// The extension is unknown.
    #[error("the name must end in .mp4, .mov, .mkv, .webm, .gif, .png, .apng or .webp")]
    Extension,
    /// The container cannot have the codec.
    #[error("{extension} files cannot have the codec {codec}; choose one of {possible}")]
    Codec {
        /// The extension.
        extension: &'static str,
        /// The requested codec.
        codec: Codec,
        /// Codecs of this container.
        possible: String,
    },
    /// The format needs no codec.
    #[error("a codec can be chosen for .mp4, .mov, .mkv and .webm only")]
    NoCodec,
}

impl Container {
    /// The extension.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Mp4 => "mp4",
            Self::Mov => "mov",
            Self::Mkv => "mkv",
            Self::WebM => "webm",
        }
    }

    /// The name of `ffmpeg` for the format.
    pub(super) const fn muxer(self) -> &'static str {
        match self {
            Self::Mkv => "matroska",
            other => other.extension(),
        }
    }

    /// Codecs that players expect in the format; the first is the default.
    const fn codecs(self) -> &'static [Codec] {
        match self {
            Self::Mp4 => &[Codec::H264, Codec::Vp9],
            Self::Mov => &[Codec::H264, Codec::ProRes],
            Self::Mkv => &[Codec::H264, Codec::ProRes, Codec::Vp9],
            Self::WebM => &[Codec::Vp9],
        }
    }
}

impl MovieFormat {
    /// The format of the file `path`, with `codec` if there is a choice.
    ///
    /// # Errors
    /// See [`FormatError`].
    pub fn of(path: &Path, codec: Option<Codec>) -> Result<Self, FormatError> {
        // Choose the container by the extension
        let extension = path
            .extension()
            .and_then(|extension| extension.to_str())
            .unwrap_or_default()
            .to_ascii_lowercase();
        let container = match extension.as_str() {
            "mp4" | "m4v" => Container::Mp4,
            "mov" => Container::Mov,
            "mkv" => Container::Mkv,
            "webm" => Container::WebM,
            "gif" | "png" | "apng" | "webp" if codec.is_some() => return Err(FormatError::NoCodec),
            "gif" => return Ok(Self::Gif),
            "png" | "apng" => return Ok(Self::Apng),
            "webp" => return Ok(Self::WebP),
            _ => return Err(FormatError::Extension),
        };
        // Choose the codec, which must fit the container
        let possible = container.codecs();
        let codec = codec.unwrap_or(possible[0]);
        if possible.contains(&codec) {
            return Ok(Self::Ffmpeg { container, codec });
        }
        Err(FormatError::Codec {
            extension: container.extension(),
            codec,
            possible: possible.iter().map(|c| c.name()).collect::<Vec<_>>().join(", "),
        })
    }

    /// A name for messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ffmpeg { codec: Codec::H264, .. } => "H.264",
            Self::Ffmpeg { codec: Codec::ProRes, .. } => "ProRes",
            Self::Ffmpeg { codec: Codec::Vp9, .. } => "VP9",
            Self::Gif => "GIF",
            Self::Apng => "animated PNG",
            Self::WebP => "animated WebP",
        }
    }

    /// Whether `ffmpeg` writes it.
    pub const fn needs_ffmpeg(self) -> bool {
        matches!(self, Self::Ffmpeg { .. })
    }

    /// The size of the movie for pictures of this `size`: codecs that halve the resolution of colours need even sides.
    pub fn padded(self, size: [usize; 2]) -> [usize; 2] {
        if self.needs_ffmpeg() { size.map(|side| side.next_multiple_of(2)) } else { size }
    }

    /// Largest width and height.
    pub(super) const fn max_side(self) -> usize {
        match self {
            Self::Ffmpeg { .. } | Self::WebP => 1 << 14,
            Self::Gif | Self::Apng => MAX_SIDE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_decides() {
        let of = |name: &str, codec| MovieFormat::of(Path::new(name), codec);
        let ffmpeg = |container, codec| Ok(MovieFormat::Ffmpeg { container, codec });
        assert_eq!(of("a.MP4", None), ffmpeg(Container::Mp4, Codec::H264));
        assert_eq!(of("a.webm", None), ffmpeg(Container::WebM, Codec::Vp9));
        let prores = Some(Codec::ProRes);
        assert_eq!(of("a.mov", prores), ffmpeg(Container::Mov, Codec::ProRes));
        assert_eq!(of("a.b/a.gif", None), Ok(MovieFormat::Gif));
        assert_eq!(of("a.png", prores), Err(FormatError::NoCodec));
        for name in ["a", "a.avi", ".mp4", "a.mp4/"] {
            assert!(of(name, None).is_err() || name == "a.mp4/", "{name}");
        }
        let error = of("a.webm", prores).unwrap_err().to_string();
        assert_eq!(error, "webm files cannot have the codec prores; choose one of vp9");
    }

    #[test]
    fn codecs_have_even_sides() {
        let h264 = MovieFormat::of(Path::new("a.mp4"), None).unwrap();
        assert_eq!(h264.padded([961, 540]), [962, 540]);
        assert_eq!(MovieFormat::Gif.padded([961, 541]), [961, 541]);
    }
}
