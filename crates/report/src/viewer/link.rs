//! Relative addresses of files.

use std::path::{Component, Path, PathBuf};

/// The address of `file` on a page at `page`. None if there is none, as on another drive or if a name is not UTF-8.
pub(super) fn relative(page: &Path, file: &Path) -> Option<String> {
    let (page, file) = (real(page)?, real(file)?);
    let from: Vec<Component<'_>> = page.parent()?.components().collect();
    let to: Vec<Component<'_>> = file.components().collect();
    let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return None;
    }
    let mut parts = vec!["..".to_owned(); from.len() - common];
    for component in &to[common..] {
        parts.push(escaped(component.as_os_str().to_str()?));
    }
    Some(parts.join("/"))
}

/// The absolute path with a directory without links.
fn real(path: &Path) -> Option<PathBuf> {
    let path = std::path::absolute(path).ok()?;
    let (dir, name) = (path.parent()?, path.file_name()?);
    let dir = dir.canonicalize().unwrap_or_else(|_| dir.to_owned());
    Some(dir.join(name))
}

/// A name in an address: everything but plain characters as percent codes.
fn escaped(name: &str) -> String {
    let mut text = String::new();
    for byte in name.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'~' => {
                text.push(char::from(byte))
            }
            other => text += &format!("%{other:02X}"),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_relative_and_escaped() {
        let relative = |page: &str, file: &str| relative(Path::new(page), Path::new(file)).unwrap();
        assert_eq!(relative("/a/b/view.html", "/a/b/f.1.png"), "f.1.png");
        assert_eq!(relative("/a/b/view.html", "/a/c/f.png"), "../c/f.png");
        assert_eq!(relative("view.html", "out/f.png"), "out/f.png");
        assert_eq!(
            relative("/a/v.html", "/a/b c/#1%?\"<ä.png"),
            "b%20c/%231%25%3F%22%3C%C3%A4.png"
        );
    }
}
