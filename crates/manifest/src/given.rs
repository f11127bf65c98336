//! What a manifest gives: the values in its text and those that replace them, without its look and without defaults.

use super::list::Entry;
use super::source::ManifestSource;
use super::tree::TomlNode;
use super::{Manifest, ManifestError};

/// The first line of a manifest with only what is given.
const ABOUT: &str = "# A spherule job with the settings that were chosen; `spherule init` prints all of them.\n# Paths are relative to this file.";

impl ManifestSource {
    /// A manifest with the same values in one text, each with the comment of its key.
    ///
    /// # Errors
    /// The manifest is invalid.
    pub fn to_toml(&self) -> Result<String, ManifestError> {
        let (manifest, given) = self.given_values()?;
        let text = manifest.entries().file_of(|entry| given.holds(&entry.key));
        let sparse = format!("{ABOUT}\n{text}");
        // Old forms of keys are none of today's
        let is_same = Manifest::parse(&sparse, self.path()).is_ok_and(|read| read == manifest);
        Ok(if is_same { sparse } else { manifest.to_commented_toml() })
    }

    /// The values as assignments `key=value` for the option `--set`. A list is one value.
    ///
    /// # Errors
    /// The manifest is invalid.
    pub fn assignments(&self) -> Result<Vec<(String, String)>, ManifestError> {
        let (manifest, given) = self.given_values()?;
        let entries = manifest.entries();
        let own = entries.list().iter().filter(|entry| given.holds(&entry.key));
        let mut assignments: Vec<(String, String)> = Vec::new();
        let mut items: Vec<(&str, Vec<String>)> = Vec::new();
        for entry in own {
            let Some(value) = &entry.value else { continue };
            if !entry.is_of_item() {
                assignments.push((entry.key.clone(), value.clone()));
                continue;
            }
            // Collect the keys of each item of a list
            let text = format!("{} = {value}", entry.name());
            match items.last_mut() {
                Some((section, keys)) if *section == entry.section => keys.push(text),
                _ => items.push((&entry.section, vec![text])),
            }
        }
        // Join the items of each list
        for list in items.chunk_by(|(a, _), (b, _)| list_of(a) == list_of(b)) {
            let tables = list.iter().map(|(_, keys)| format!("{{ {} }}", keys.join(", ")));
            let value = format!("[{}]", tables.collect::<Vec<_>>().join(", "));
            assignments.push((list_of(list[0].0).to_owned(), value));
        }
        Ok(assignments)
    }

    /// The manifest, and the tree of what it gives.
    fn given_values(&self) -> Result<(Manifest, TomlNode), ManifestError> {
        let (manifest, _) = self.parse()?;
        Ok((manifest, self.without_look()))
    }
}

/// The list of the item `section`, such as `light` of `light.0`.
fn list_of(section: &str) -> &str {
    section.rsplit_once('.').map_or(section, |(list, _)| list)
}

impl Entry {
    /// Whether it is a key of an item of a list.
    fn is_of_item(&self) -> bool {
        let last = self.section.rsplit('.').next().unwrap_or_default();
        !last.is_empty() && last.bytes().all(|byte| byte.is_ascii_digit())
    }
}

impl Manifest {
    /// All keys with their values as TOML; None for those that are not set.
    pub fn values(&self) -> Vec<(String, Option<String>)> {
        let entries = self.entries();
        entries.list().iter().map(|entry| (entry.key.clone(), entry.value.clone())).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Override;

    fn source(text: &str, set: &[&str]) -> ManifestSource {
        let overrides = set.iter().map(|set| Override::parse(set).expect("an override"));
        ManifestSource::new(text, Path::new("job.toml"), overrides.collect())
    }

    #[test]
    fn only_what_is_given_is_written() {
        let text = "input.path = \"dump\"\n[image]\nwidth = 640\n[[light]]\ntype = \"sun\"\ndirection = [0, 0, -1]\n";
        let set = ["material.color.attribute=speed", "camera.zoom=2", "image.width=320"];
        let source = source(text, &set);
        let sparse = source.to_toml().expect("valid");
        let lines = sparse.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
        let keys: Vec<&str> = lines.map(|line| line.split(" =").next().unwrap_or(line)).collect();
        let expected = [
            "[input]",
            "path",
            "[camera]",
            "zoom",
            "[image]",
            "width",
            "[material]",
            "color",
            "[[light]]",
            "type",
            "direction",
        ];
        assert_eq!(keys, expected, "{sparse}");
        assert!(sparse.contains("width = 320   "), "{sparse}");
        // The text and the options give the same manifest
        let (manifest, _) = source.parse().expect("valid");
        assert_eq!(Manifest::parse(&sparse, Path::new("job.toml")), Ok(manifest.clone()));
        let set = source.assignments().expect("valid");
        let set: Vec<String> = set.iter().map(|(key, value)| format!("{key}={value}")).collect();
        let list: Vec<&str> = set.iter().map(String::as_str).collect();
        assert_eq!(super::tests::source("", &list).parse().expect("valid").0, manifest, "{set:?}");
    }

    #[test]
    fn old_forms_are_written_as_whole_manifests() {
        let source = source("input.path = \"dump\"\nlook = \"paper\"\nimage.samples = 4\n", &[]);
        let (manifest, _) = source.parse().expect("valid");
        let sparse = source.to_toml().expect("valid");
        assert!(sparse.lines().count() < 12, "{sparse}");
        assert_eq!(Manifest::parse(&sparse, Path::new("job.toml")), Ok(manifest));
        assert!(super::tests::source("image.samples = 0", &[]).to_toml().is_err());
    }
}
