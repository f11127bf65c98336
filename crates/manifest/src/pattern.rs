//! Names with a frame number, such as `out/frame.####.exr` or `out/frame.%04d.exr`, and the resulting paths.

use std::fmt;
use std::ops::Deref;
use std::path::{Path, PathBuf};

/// Maximum number of digits in a pattern; frame numbers have at most 19.
const MAX_DIGITS: usize = 32;

/// A path with an optional placeholder for the frame number. The length in `#` (or `%0Nd`) is the minimum number of
/// digits; larger numbers use more.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FramePattern {
    text: String,
    /// Directory and start of the name, up to the number.
    before: String,
    after: String,
    /// None if the name has no number.
    digits: Option<usize>,
}

impl FramePattern {
    /// Parses a pattern. Messages show `example`.
    ///
    /// # Errors
    /// It has a number in the name of a directory or several numbers, an unknown `%`, or a number with too many
    /// digits.
    pub fn parse(text: &str, example: &str) -> Result<Self, String> {
        // Find the number in the file name
        let name_at = text.rfind(std::path::is_separator).map_or(0, |i| i + 1);
        let (dir, name) = text.split_at(name_at);
        // Other `%` are characters of the directory
        let places = dir.match_indices(['#', '%']);
        let mut numbers = places.filter_map(|(at, _)| find_number(&dir[at..]).ok());
        if numbers.any(|number| number.is_some_and(|(start, ..)| start == 0)) {
            return Err("the frame number belongs into the file's name, not a directory's".into());
        }
        let Some((start, end, digits)) = find_number(name)? else {
            return Ok(Self {
                text: text.to_owned(),
                before: text.to_owned(),
                after: String::new(),
                digits: None,
            });
        };
        // Reject a second number
        let after = &name[end..];
        if find_number(after)?.is_some() {
            return Err(format!("has places for two numbers; use one (example: {example})"));
        }
        Ok(Self {
            text: text.to_owned(),
            before: format!("{dir}{}", &name[..start]),
            after: after.to_owned(),
            digits: Some(digits),
        })
    }

    /// The pattern as it was written.
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// Whether each frame gets a separate name.
    pub const fn has_number(&self) -> bool {
        self.digits.is_some()
    }

    /// The directory; empty for a bare name.
    pub fn dir(&self) -> &Path {
        Path::new(&self.text).parent().unwrap_or(Path::new(""))
    }

    /// The file name, with the placeholder for the number.
    pub fn file_name(&self) -> &str {
        let name_at = self.text.rfind(std::path::is_separator).map_or(0, |i| i + 1);
        &self.text[name_at..]
    }

    /// The path for `frame`. A negative number has its sign before the padded digits.
    pub fn path_for(&self, frame: i64) -> PathBuf {
        let Some(digits) = self.digits else {
            return PathBuf::from(&self.text);
        };
        let sign = if frame < 0 { "-" } else { "" };
        let number = frame.unsigned_abs();
        PathBuf::from(format!("{}{sign}{number:0digits$}{}", self.before, self.after))
    }
}

/// The [`FramePattern`] of images.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputPattern(FramePattern);

impl OutputPattern {
    /// Parses a pattern for EXR or PNG files.
    ///
    /// # Errors
    /// It does not end in `.exr` or `.png` or does not name a file, and those of [`FramePattern::parse`].
    pub fn parse(text: &str) -> Result<Self, String> {
        if !has_extension(text, "exr") && !has_extension(text, "png") {
            return Err("must end in .exr or .png (example: out/frame.####.exr)".to_owned());
        }
        FramePattern::parse(text, "frame.####.exr").map(Self)
    }

    /// Whether the images are PNG files, which have no previews and no channels besides RGBA.
    pub fn is_png(&self) -> bool {
        has_extension(self.as_str(), "png")
    }

    /// The path of the preview of `frame`: that of the image with `.png`.
    pub fn preview_path_for(&self, frame: i64) -> PathBuf {
        self.path_for(frame).with_extension("png")
    }
}

fn has_extension(path: &str, extension: &str) -> bool {
    let found = Path::new(path).extension();
    found.is_some_and(|found| found.eq_ignore_ascii_case(extension))
}

impl Deref for OutputPattern {
    type Target = FramePattern;

    fn deref(&self) -> &FramePattern {
        &self.0
    }
}

impl fmt::Display for OutputPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// Start, end and digits of the first placeholder for a number.
fn find_number(text: &str) -> Result<Option<(usize, usize, usize)>, String> {
    let Some(start) = text.find(['#', '%']) else {
        return Ok(None);
    };
    let rest = &text[start..];
    if rest.starts_with('#') {
        let digits = rest.bytes().take_while(|b| *b == b'#').count();
        return Ok(Some((start, start + digits, at_most(digits)?)));
    }
    let unknown = || format!("invalid frame number `{rest}`; use #### or %04d");
    let width = rest[1..].find('d').ok_or_else(unknown)?;
    let digits = match &rest[1..=width] {
        "" => 1,
        padded => padded
            .strip_prefix('0')
            .filter(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()))
            // Too large to parse means too many digits.
            .map(|n| n.parse().unwrap_or(usize::MAX))
            .ok_or_else(unknown)?,
    };
    Ok(Some((start, start + width + 2, at_most(digits)?)))
}

fn at_most(digits: usize) -> Result<usize, String> {
    if digits > MAX_DIGITS {
        return Err(format!(
            "more than {MAX_DIGITS} digits for the frame number; write ####, larger numbers take more"
        ));
    }
    Ok(digits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn path(pattern: &str, frame: i64, expected: &str) {
        let pattern = OutputPattern::parse(pattern).unwrap();
        assert_eq!(pattern.path_for(frame), Path::new(expected));
    }

    #[test]
    fn numbers_are_padded_and_never_cut() {
        path("out/frame.####.exr", 7, "out/frame.0007.exr");
        path("out/frame.####.exr", 123_456, "out/frame.123456.exr");
        path("out/frame.####.exr", -7, "out/frame.-0007.exr");
        path("out/frame.####.exr", i64::MIN, "out/frame.-9223372036854775808.exr");
        path("f#.exr", 12, "f12.exr");
        path("%04d.exr", 12, "0012.exr");
        path("a.%d.b.EXR", 12, "a.12.b.EXR");
        path("/x/ä_%012d.exr", 12, "/x/ä_000000000012.exr");
        path("still.exr", 12, "still.exr");
        path("100%~=x/f.#.exr", 12, "100%~=x/f.12.exr");
        path("50%/f.exr", 12, "50%/f.exr");
        let zeros = "0".repeat(30);
        path(&format!("{}.exr", "#".repeat(32)), 12, &format!("{zeros}12.exr"));
        path("%032d.exr", 12, &format!("{zeros}12.exr"));
    }

    #[test]
    fn parts() {
        let pattern = OutputPattern::parse("a/b/f.####.exr").unwrap();
        assert_eq!(pattern.dir(), Path::new("a/b"));
        assert_eq!(pattern.file_name(), "f.####.exr");
        assert!(pattern.has_number());
        assert_eq!(pattern.preview_path_for(3), Path::new("a/b/f.0003.png"));
        assert!(!pattern.is_png());
        let png = OutputPattern::parse("a/f.####.PNG").unwrap();
        assert!(png.is_png());
        assert_eq!(png.path_for(3), Path::new("a/f.0003.PNG"));
        let still = OutputPattern::parse("still.exr").unwrap();
        assert!(!still.has_number());
        assert_eq!(still.dir(), Path::new(""));
    }

    #[track_caller]
    fn refused(pattern: &str, what: &str) {
        let error = OutputPattern::parse(pattern).unwrap_err();
        assert!(error.contains(what), "{error}");
    }

    #[test]
    fn rejected_patterns() {
        refused("", ".exr");
        refused("out/", ".exr");
        refused("out/.exr", ".exr");
        refused("a.####.jpg", ".exr or .png");
        refused("####/a.exr", "directory");
        refused("a.##.##.exr", "two numbers");
        refused("a.##.%04d.exr", "two numbers");
        refused("a.%s.exr", "%04d");
        refused("a.%4d.exr", "%04d");
        refused("a.%0-4d.exr", "%04d");
        refused("a.%0d.exr", "%04d");
        for digits in [33, 65_535, 65_536, 70_000] {
            refused(&format!("{}.exr", "#".repeat(digits)), "more than 32 digits");
        }
        for width in ["033", "099999", "0999999d0999999", "099999999999999999999999"] {
            refused(
                &format!("a.%{width}d.exr"),
                if width.contains('d') { "digits" } else { "more than 32" },
            );
        }
    }
}
