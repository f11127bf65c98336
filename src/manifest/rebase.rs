//! Paths of a manifest seen from another directory, so that the manifest can be written there.

use std::path::{Component, Path, PathBuf};

use super::{Manifest, OutputPattern};

impl Manifest {
    /// Rewrites the relative paths, now relative to `from`, to be relative to `to`; both must be
    /// absolute. Nothing is looked up on the disk. Absolute paths stay.
    ///
    /// # Errors
    /// A directory that would have to be named is not UTF-8, or `from` or `to` is not absolute.
    pub fn rebase(&mut self, from: &Path, to: &Path) -> Result<(), String> {
        for dir in [from, to] {
            if !dir.is_absolute() {
                return Err(format!(
                    "{}: an absolute directory is needed",
                    dir.display()
                ));
            }
        }
        for path in &mut self.input.path {
            *path = rebased(path, from, to)?;
        }
        let output = rebased(self.output.path.as_str(), from, to)?;
        self.output.path = OutputPattern::parse(&output)?;
        Ok(())
    }
}

fn rebased(path: &str, from: &Path, to: &Path) -> Result<String, String> {
    if Path::new(path).is_absolute() {
        return Ok(path.to_owned());
    }
    let target = without_dots(&from.join(path));
    let base = without_dots(to);
    let shared = target
        .components()
        .zip(base.components())
        .take_while(|(a, b)| a == b)
        .count();
    // Nothing shared, not even a root: another drive.
    let relative: PathBuf = if shared == 0 {
        target
    } else {
        let ups = base.components().skip(shared).map(|_| Component::ParentDir);
        ups.chain(target.components().skip(shared)).collect()
    };
    match relative.to_str() {
        Some("") => Ok(".".to_owned()),
        Some(text) => Ok(text.to_owned()),
        None => Err(format!("{}: the path is not UTF-8", relative.display())),
    }
}

/// Without `.` and, where possible, `..`.
pub fn without_dots(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                out.pop();
            }
            other => out.push(other),
        }
    }
    out
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn paths_follow_the_manifest() {
        let mut manifest = Manifest::new("data/dump.#.vtk");
        manifest.input.path.push("/abs/x.vtk".to_owned());
        manifest.input.path.push("../up/./x.vtk".to_owned());
        let (here, there) = (Path::new("/home/me/sim"), Path::new("/home/me/sim/out"));
        let before = manifest.clone();
        manifest.rebase(here, there).unwrap();
        assert_eq!(
            manifest.input.path,
            ["../data/dump.#.vtk", "/abs/x.vtk", "../../up/x.vtk"]
        );
        assert_eq!(manifest.output.path.as_str(), "frame.####.exr");
        manifest.rebase(there, here).unwrap();
        assert_eq!(manifest.output.path, before.output.path);
        assert_eq!(manifest.input.path[0], before.input.path[0]);
        assert!(manifest.rebase(Path::new("a"), there).is_err());
        let mut all = Manifest::new("out");
        all.rebase(here, there).unwrap();
        assert_eq!(all.input.path, ["."]);
    }
}
