//! Where the files are that a list names: relative to the list, and not outside the directory of the first one.

use std::path::{Component, Path, PathBuf};

/// The directory that lists may name files of.
#[derive(Debug, Clone)]
pub(super) struct ListRoot {
    directory: PathBuf,
    /// Whether files may be elsewhere.
    may_leave: bool,
}

impl ListRoot {
    /// The directory of `list`, the file that a user named.
    pub(super) fn of(list: &Path, may_leave: bool) -> Self {
        let directory = list.parent().unwrap_or(Path::new("")).to_owned();
        Self { directory, may_leave }
    }

    /// The path of the file that `list` calls `name`; `None` if it is not inside the directory.
    ///
    /// Only names are compared: symbolic links in the directory are files of it, as everywhere.
    pub(super) fn resolve(&self, list: &Path, name: &str) -> Option<PathBuf> {
        let around = list.parent().unwrap_or(Path::new(""));
        let written = around.join(name);
        let inside = if Path::new(name).is_absolute() {
            let directory = normalized(&std::path::absolute(&self.directory).ok()?)?;
            let path = normalized(&written)?;
            path.strip_prefix(directory).ok().map(Path::to_owned)
        } else {
            let around = around.strip_prefix(&self.directory).ok();
            around.and_then(|around| normalized(&around.join(name)))
        };
        match inside {
            Some(inside) => Some(self.directory.join(inside)),
            None => self.may_leave.then_some(written),
        }
    }
}

/// `path` without `.` and `..`; `None` if it leaves the directory that it begins at.
fn normalized(path: &Path) -> Option<PathBuf> {
    let mut plain = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                let has_name = matches!(plain.components().next_back(), Some(Component::Normal(_)));
                if !has_name {
                    return None;
                }
                plain.pop();
            }
            other => plain.push(other),
        }
    }
    Some(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn resolves(list: &str, name: &str, to: Option<&str>) {
        let root = ListRoot::of(Path::new("run/all.pvd"), false);
        let found = root.resolve(Path::new(list), name);
        assert_eq!(found.as_deref(), to.map(Path::new), "{list} {name}");
    }

    #[test]
    fn names_are_relative_to_their_list() {
        resolves("run/all.pvd", "a.vtu", Some("run/a.vtu"));
        resolves("run/all.pvd", "./t/../a.vtu", Some("run/a.vtu"));
        resolves("run/all.pvd", "t0/a.pvtu", Some("run/t0/a.pvtu"));
        resolves("run/t0/a.pvtu", "a_0.vtu", Some("run/t0/a_0.vtu"));
        resolves("run/t0/a.pvtu", "../b/a_0.vtu", Some("run/b/a_0.vtu"));
    }

    #[test]
    fn names_stay_in_the_directory() {
        resolves("run/all.pvd", "../a.vtu", None);
        resolves("run/all.pvd", "t/../../run/a.vtu", None);
        resolves("run/t0/a.pvtu", "../../a.vtu", None);
        resolves("run/all.pvd", "/etc/a.vtu", None);
        let inside = std::path::absolute("run/t/a.vtu").expect("a directory to work in");
        let inside = inside.to_str().expect("UTF-8");
        resolves("run/all.pvd", inside, Some("run/t/a.vtu"));
    }

    #[test]
    fn names_may_leave_if_they_are_allowed_to() {
        let root = ListRoot::of(Path::new("run/all.pvd"), true);
        let resolve = |list: &str, name| root.resolve(Path::new(list), name);
        assert_eq!(resolve("run/all.pvd", "../a.vtu"), Some("run/../a.vtu".into()));
        assert_eq!(resolve("run/all.pvd", "/x/a.pvtu"), Some("/x/a.pvtu".into()));
        assert_eq!(resolve("/x/a.pvtu", "a_0.vtu"), Some("/x/a_0.vtu".into()));
        assert_eq!(resolve("run/all.pvd", "a.vtu"), Some("run/a.vtu".into()));
    }
}
