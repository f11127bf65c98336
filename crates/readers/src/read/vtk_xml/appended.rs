//! The `<AppendedData>` element: found in the bytes, not by an XML parser, because raw data make
//! the file invalid XML.

use std::cell::Cell;

use memchr::memmem;

use spherule_frame::ParseError;

/// How often all appended bytes may be read. Writers give each array bytes of its own; a file whose arrays
/// share them could ask for work that grows with the square of its length.
const MAX_READS: usize = 4;

/// The blob after the underscore.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Appended<'a> {
    /// Byte of the file where the blob begins; offsets count from here.
    pub(super) at: usize,
    pub(super) blob: &'a [u8],
    pub(super) is_base64: bool,
    /// Bytes that arrays were read from so far.
    pub(super) spent: &'a Cell<usize>,
}

/// Where the XML in front of the appended data ends; `None` if there are no appended data.
pub(super) fn find(bytes: &[u8]) -> Option<usize> {
    memmem::find(bytes, b"<AppendedData")
}

impl<'a> Appended<'a> {
    /// Parses the element that begins at byte `tag`.
    ///
    /// # Errors
    /// Malformed if the tag or the underscore is missing, or the encoding is neither.
    pub(super) fn parse(
        bytes: &'a [u8],
        tag: usize,
        spent: &'a Cell<usize>,
    ) -> Result<Self, ParseError> {
        let from_tag = bytes.get(tag..).unwrap_or_default();
        let ended = || ParseError::malformed(bytes.len(), "the file ends inside <AppendedData>");
        let open = memchr::memchr(b'>', from_tag).ok_or_else(ended)?;
        let (attributes, rest) = from_tag.split_at(open);
        let rest = rest.get(1..).unwrap_or_default();
        let is_base64 = match encoding(attributes) {
            Some(b"raw") => false,
            Some(b"base64") | None => true,
            Some(_) => {
                return Err(ParseError::malformed(
                    tag,
                    "the encoding of <AppendedData> is not raw or base64",
                ));
            }
        };
        let trimmed = rest.trim_ascii_start();
        if attributes.ends_with(b"/") {
            return Ok(Self { at: tag, blob: &[], is_base64, spent });
        }
        let at = tag + open + 1 + (rest.len() - trimmed.len());
        let blob = match trimmed.split_first() {
            Some((b'_', blob)) => blob,
            Some(_) => {
                return Err(ParseError::malformed(at, "no underscore before the appended data"));
            }
            None => return Err(ended()),
        };
        // Raw data may spell the end tag; only the last one can be it.
        let end = if is_base64 {
            memchr::memchr(b'<', blob)
        } else {
            memmem::rfind(blob, b"</AppendedData")
        };
        Ok(Self {
            at: at + 1,
            blob: blob.get(..end.unwrap_or(blob.len())).unwrap_or_default(),
            is_base64,
            spent,
        })
    }

    /// Counts `used` bytes as read; false if that makes too many.
    pub(super) fn spend(&self, used: usize) -> bool {
        let spent = self.spent.get().saturating_add(used);
        self.spent.set(spent);
        spent <= self.blob.len().saturating_mul(MAX_READS)
    }
}

/// The value of `encoding="..."` in a tag.
fn encoding(tag: &[u8]) -> Option<&[u8]> {
    let name = memmem::find(tag, b"encoding")?;
    let value = tag
        .get(name + b"encoding".len()..)?
        .trim_ascii_start()
        .strip_prefix(b"=")?
        .trim_ascii_start();
    let (quote, value) = value.split_first()?;
    let end = memchr::memchr(*quote, value)?;
    value.get(..end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(file: &[u8], blob: Option<(&[u8], bool)>) {
        let tag = find(file).expect("the test has the tag");
        let spent = Cell::new(0);
        let found = Appended::parse(file, tag, &spent).ok();
        assert_eq!(found.map(|a| (a.blob, a.is_base64)), blob);
        if let Some(a) = found {
            assert_eq!(file.get(a.at..a.at + a.blob.len()), Some(a.blob));
        }
    }

    #[test]
    fn the_blob_is_behind_the_underscore() {
        check(
            b"<AppendedData encoding=\"raw\">\r\n  __<&\0</AppendedData></VTKFile>",
            Some((b"_<&\0", false)),
        );
        check(
            b"<AppendedData encoding='raw'>_a</AppendedData>b</AppendedData>",
            Some((b"a</AppendedData>b", false)),
        );
        check(
            b"<AppendedData encoding = \"base64\">_AAAA\n</AppendedData>",
            Some((b"AAAA\n", true)),
        );
        check(b"<AppendedData encoding=\"raw\">_cut", Some((b"cut", false)));
        check(b"<AppendedData encoding=\"raw\">", None);
        check(b"<AppendedData encoding=\"raw\">x", None);
        check(b"<AppendedData encoding=\"raw\"", None);
        check(b"<AppendedData encoding=\"hex\">_00", None);
    }
}
