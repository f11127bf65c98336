//! Converts the paths of a manifest to another base directory, so that the manifest can be written there.

use std::path::{Component, Path, PathBuf};

use super::{Manifest, MeshPath, OutputPattern, OverlayKind};

/// Why the paths of a manifest cannot be made relative to another directory.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RebaseError {
    /// A directory is not absolute.
    #[error("{}: an absolute directory is needed", dir.display())]
    NotAbsolute {
        /// The directory.
        dir: PathBuf,
    },
    /// A path is not UTF-8, as a manifest is.
    #[error("{}: the path is not UTF-8", path.display())]
    NotUtf8 {
        /// The path.
        path: PathBuf,
    },
    /// The output is not a pattern for images, because of the name of its directory.
    #[error("{path}: {reason}")]
    Output {
        /// The output.
        path: String,
        /// Why.
        reason: String,
    },
    /// A mesh is not a pattern, because of the name of its directory.
    #[error("{path}: {reason}")]
    Mesh {
        /// The mesh.
        path: String,
        /// Why.
        reason: String,
    },
}

impl Manifest {
    /// Converts relative paths from the base `from` to the base `to`; both must be absolute. Absolute paths do not
    /// change. Symbolic links on disk are followed.
    ///
    /// # Errors
    /// A directory that would appear in a path is not UTF-8, or `from` or `to` is not absolute.
    pub fn rebase(&mut self, from: &Path, to: &Path) -> Result<(), RebaseError> {
        for dir in [from, to] {
            if !dir.is_absolute() {
                return Err(RebaseError::NotAbsolute { dir: dir.to_owned() });
            }
        }
        // Change the paths of the input and of the output
        for path in self.input.path.iter_mut() {
            *path = rebased(path, from, to)?;
        }
        let output = rebased(self.output.path.as_str(), from, to)?;
        self.output.path = OutputPattern::parse(&output)
            .map_err(|reason| RebaseError::Output { path: output, reason })?;
        // Change those of files that pictures use
        if let Some(path) = &mut self.input.topology {
            *path = rebased(path, from, to)?;
        }
        if let Some(path) = &mut self.environment.image {
            *path = rebased(path, from, to)?;
        }
        let ground = self.render.ground.as_mut();
        if let Some(image) = ground.and_then(|ground| ground.image.as_mut()) {
            image.path = rebased(&image.path, from, to)?;
        }
        for overlay in &mut self.overlays {
            if let OverlayKind::Image { path, .. } = &mut overlay.kind {
                *path = rebased(path, from, to)?;
            }
        }
        let of_styles = self.styles.iter_mut().filter_map(|style| style.mesh.as_mut());
        for mesh in self.meshes.iter_mut().map(|mesh| &mut mesh.path).chain(of_styles) {
            let path = rebased(mesh.as_str(), from, to)?;
            *mesh = MeshPath::parse(&path).map_err(|reason| RebaseError::Mesh { path, reason })?;
        }
        if let Some(path) = &mut self.job.stop_file {
            *path = rebased(path, from, to)?;
        }
        Ok(())
    }
}

fn rebased(path: &str, from: &Path, to: &Path) -> Result<String, RebaseError> {
    if Path::new(path).is_absolute() {
        return Ok(path.to_owned());
    }
    let target = from.join(path);
    let short = relative(&without_dots(&target), &without_dots(to))?;
    // Links may remain in the path unless `..` has to pass one.
    let place = named_place(&target);
    if named_place(&real_dir(to).join(&short)) == place {
        return Ok(short);
    }
    relative(&place, &real_dir(to))
}

/// `target` relative to `base`, both absolute and without `..`.
fn relative(target: &Path, base: &Path) -> Result<String, RebaseError> {
    let shared = target.components().zip(base.components()).take_while(|(a, b)| a == b).count();
    // Without a common root, `target` is on another drive.
    let relative: PathBuf = if shared == 0 {
        target.to_owned()
    } else {
        let ups = base.components().skip(shared).map(|_| Component::ParentDir);
        ups.chain(target.components().skip(shared)).collect()
    };
    match relative.to_str() {
        Some("") => Ok(".".to_owned()),
        Some(text) => Ok(text.to_owned()),
        None => Err(RebaseError::NotUtf8 { path: relative }),
    }
}

/// A directory without links, `.` and `..`, as far as it exists; the part that does not exist yet is taken literally.
/// `path` must be absolute.
pub fn real_dir(path: &Path) -> PathBuf {
    // `x/..` must be resolved by the system and not by removing `x`, which may be a link.
    for existing in path.ancestors() {
        let Ok(real) = existing.canonicalize() else {
            continue;
        };
        let rest = path.strip_prefix(existing).unwrap_or(Path::new(""));
        return without_dots(&real.join(rest));
    }
    without_dots(path)
}

/// The same for a file or pattern; its own name is kept even if it is a link, because names have a meaning.
pub fn named_place(path: &Path) -> PathBuf {
    match (path.parent(), path.file_name()) {
        (Some(dir), Some(name)) => real_dir(dir).join(name),
        _ => real_dir(path),
    }
}

/// Removes `.` and, if possible, `..` from the text of a path.
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
    use crate::{Mesh, Style};

    #[test]
    fn paths_follow_the_manifest() {
        let mut manifest = Manifest::new("data/dump.#.vtk");
        manifest.input.path.push("/abs/x.vtk".to_owned());
        manifest.input.path.push("../up/./x.vtk".to_owned());
        manifest.job.stop_file = Some("control/stop".to_owned());
        manifest.input.topology = Some("conf.gro".to_owned());
        manifest.meshes =
            vec![Mesh { path: MeshPath::parse("walls.##.stl").unwrap(), ..Mesh::default() }];
        manifest.styles =
            vec![Style { mesh: MeshPath::parse("grain.stl").ok(), ..Style::default() }];
        let (here, there) = (Path::new("/home/me/sim"), Path::new("/home/me/sim/out"));
        let before = manifest.clone();
        manifest.rebase(here, there).unwrap();
        assert_eq!(*manifest.input.path, ["../data/dump.#.vtk", "/abs/x.vtk", "../../up/x.vtk"]);
        assert_eq!(manifest.output.path.as_str(), "frame.####.exr");
        assert_eq!(manifest.input.topology.as_deref(), Some("../conf.gro"));
        assert_eq!(manifest.meshes[0].path.as_str(), "../walls.##.stl");
        let grain = manifest.styles[0].mesh.as_ref().map(MeshPath::as_str);
        assert_eq!(grain, Some("../grain.stl"));
        assert_eq!(manifest.job.stop_file_in(there), Path::new("/home/me/sim/out/../control/stop"));
        assert_eq!(
            Manifest::new("a").job.stop_file_in(there),
            Path::new("/home/me/sim/out/job.stop")
        );
        manifest.rebase(there, here).unwrap();
        assert_eq!(manifest.output.path, before.output.path);
        assert_eq!(manifest.input.path[0], before.input.path[0]);
        assert!(manifest.rebase(Path::new("a"), there).is_err());
        let mut all = Manifest::new("out");
        all.rebase(here, there).unwrap();
        assert_eq!(*all.input.path, ["."]);
    }

    #[test]
    fn links_are_followed_before_dots() {
        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| root.path().join(name);
        for dir in ["work/in", "disk/deep/out", "disk/data"] {
            std::fs::create_dir_all(at(dir)).unwrap();
        }
        std::os::unix::fs::symlink(at("disk/deep/out"), at("work/out")).unwrap();
        std::os::unix::fs::symlink(at("disk/data"), at("work/data")).unwrap();
        let from = |path: &str, to: &str| rebased(path, &at("work"), &at(to)).unwrap();
        assert_eq!(from("in/f_#.vtk", "work/out"), "../../../work/in/f_#.vtk");
        assert_eq!(from("out/../f_#.vtk", "work/in"), "../../disk/deep/f_#.vtk");
        assert_eq!(from("data/f_#.vtk", "work/in"), "../data/f_#.vtk");
        assert_eq!(from("in/f_#.vtk", "work/new/out"), "../../in/f_#.vtk");
        let real = root.path().canonicalize().unwrap();
        assert_eq!(real_dir(&at("work/out/../new/../a")), real.join("disk/deep/a"));
        assert_eq!(named_place(&at("work/data")), real.join("work/data"));
    }
}
