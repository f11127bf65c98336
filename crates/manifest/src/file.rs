//! The file of a manifest: reading, and recognising the ones that `render` writes next to its images.
//!
//! A file that a user wrote or edited is never overwritten. So a manifest that `render` writes ends with a line that
//! contains a checksum of everything above it; if that is valid, the file has not been edited.

use std::io;
use std::path::Path;

use spherule_jobs::{read_regular_text, text_hash};

/// Maximum length of a manifest, longer than any real one.
const MAX_BYTES: u64 = 16 << 20;

/// The last line, before and after the checksum.
const MARK: (&str, &str) =
    ("# Written by spherule, blake3 ", ". Once edited, this file is not overwritten any more.\n");

/// The text of the manifest at `path`.
///
/// # Errors
/// It cannot be read, is not a regular file, or is too long for a manifest.
pub fn read_manifest(path: &Path) -> io::Result<String> {
    read_regular_text(path, MAX_BYTES)
}

/// `text` with the mark of a manifest that has not been edited.
pub fn marked(text: &str) -> String {
    format!("{text}\n{}{}{}", MARK.0, text_hash(text), MARK.1)
}

/// Whether `text` is unchanged since [`marked`].
pub fn is_marked(text: &str) -> bool {
    let Some((content, rest)) = text.rsplit_once(MARK.0) else {
        return false;
    };
    let content = content.strip_suffix('\n');
    content.is_some_and(|content| rest.strip_suffix(MARK.1) == Some(&text_hash(content)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Manifest;

    #[test]
    fn edited_pages_are_distinguished_from_generated_ones() {
        let manifest = Manifest::new("in");
        let text = marked(&manifest.to_commented_toml());
        assert!(is_marked(&text));
        assert_eq!(Manifest::parse(&text, Path::new("job.toml")).unwrap(), manifest);
        assert!(!is_marked(&manifest.to_commented_toml()));
        for edited in [
            format!("# mine\n{text}"),
            format!("{text}# mine\n"),
            text.replace("width = ", "width =  "),
            text.replace('\n', "\r\n"),
            String::new(),
        ] {
            assert!(!is_marked(&edited), "{edited}");
        }
    }
}
