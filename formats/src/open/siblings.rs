//! The files that a file refers to: in its directory or below it.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use crate::native::MappedFile;
use crate::{FrameError, ParseError};
use spherule_readers::shared::{SharedBytes, Siblings};

/// Files that were mapped, by their paths.
type Opened = Arc<Mutex<BTreeMap<PathBuf, Arc<MappedFile>>>>;

/// The directory of a file, and the files of it that were opened for it.
#[derive(Debug, Clone)]
pub(crate) struct SiblingFiles {
    directory: PathBuf,
    opened: Opened,
}

impl SiblingFiles {
    /// The files beside the one at `path`.
    pub(crate) fn of(path: &Path) -> Self {
        Self { directory: directory_of(path), opened: Opened::default() }
    }

    /// `bytes` of a file among these.
    pub(crate) fn around(&self, bytes: SharedBytes) -> SharedBytes {
        bytes.among(Arc::new(self.clone()))
    }

    /// Checks that none of the opened files has changed, as [`MappedFile::check`].
    ///
    /// # Errors
    /// [`FrameError`] of the first one that has.
    pub(crate) fn check(&self) -> Result<(), FrameError> {
        let opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        opened.values().try_for_each(|file| file.check())
    }

    /// Paths of the opened files.
    pub(crate) fn paths(&self) -> Vec<PathBuf> {
        let opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        opened.keys().cloned().collect()
    }
}

impl Siblings for SiblingFiles {
    fn open(&self, name: &str) -> Result<SharedBytes, ParseError> {
        let refused = |why: String| {
            let what = format!("refers to the file `{name}`, {why}");
            ParseError::unsupported(what)
        };
        let written = Path::new(name);
        // Directories move with all their files, so only the name counts of an absolute path
        let inside = if written.is_absolute() {
            Path::new(written.file_name().unwrap_or_default())
        } else {
            written
        };
        let is_inside = |part| matches!(part, Component::Normal(_) | Component::CurDir);
        if !inside.components().all(is_inside) {
            let why = "which is not in its directory; copy it there, and refer to it by its name";
            return Err(refused(why.to_owned()));
        }
        // Open each file once: several readers may refer to it
        let path = self.directory.join(inside);
        let mut opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        let file = match opened.get(&path) {
            Some(file) => Arc::clone(file),
            None => {
                let map = MappedFile::open(&path)
                    .map_err(|e| refused(format!("which cannot be opened: {e}; copy it there")))?;
                let file = Arc::new(map);
                opened.insert(path.clone(), Arc::clone(&file));
                file
            }
        };
        // What that file refers to is in its own directory
        let siblings = Self { directory: directory_of(&path), opened: Arc::clone(&self.opened) };
        Ok(siblings.around(SharedBytes::new(file)))
    }
}

fn directory_of(path: &Path) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).to_owned()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn only_files_of_the_directory_are_opened() {
        let dir = tempfile::tempdir().expect("a temporary directory");
        let inside = dir.path().join("run");
        fs::create_dir_all(inside.join("parts")).expect("writable");
        fs::write(dir.path().join("secret"), b"no").expect("writable");
        fs::write(inside.join("parts/a"), b"first").expect("writable");
        fs::write(inside.join("parts/b"), b"second").expect("writable");
        let siblings = SiblingFiles::of(&inside.join("all"));
        let main = siblings.around(SharedBytes::new(Arc::new(Vec::new())));
        let part = main.sibling("./parts/a").expect("a file");
        assert_eq!(&*part, b"first");
        assert_eq!(&*part.sibling("b").expect("beside it"), b"second");
        assert_eq!(&*part.sibling("/elsewhere/b").expect("beside it"), b"second");
        for name in ["../secret", "parts/../../secret", "secret", "", "/", ".", "parts"] {
            let error = main.sibling(name).expect_err(name).to_string();
            assert!(error.contains(&format!("`{name}`")), "{error}");
        }
        assert_eq!(siblings.paths().len(), 2);
        assert!(siblings.check().is_ok());
        fs::write(inside.join("parts/b"), b"other").expect("writable");
        assert!(siblings.check().is_err());
    }

    #[test]
    fn bytes_in_memory_have_no_siblings() {
        let error = SharedBytes::new(Arc::new(Vec::new())).sibling("a");
        assert!(error.expect_err("no file").to_string().contains("in memory"));
    }
}
