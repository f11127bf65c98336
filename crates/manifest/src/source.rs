//! What a manifest was read from, so that it can be read again with other defaults.

use std::path::{Path, PathBuf};

use super::file::is_marked;
use super::ground::GroundKind;
use super::look::Look;
use super::problem::Problem;
use super::tree::TomlNode;
use super::{Manifest, ManifestError, Override};

/// The text of a manifest, and the values that replace or complete it.
#[derive(Debug, Clone)]
pub struct ManifestSource {
    text: String,
    /// For messages.
    path: PathBuf,
    overrides: Vec<Override>,
    /// The values that it gives, with those of its look; None if it is not TOML.
    given: Option<TomlNode>,
}

impl ManifestSource {
    /// `text` from the file `path`, which is only used for messages, with `overrides` in order. The text may be empty.
    pub fn new(text: impl Into<String>, path: &Path, overrides: Vec<Override>) -> Self {
        let text = text.into();
        let mut given = TomlNode::parse(&text).ok();
        if let Some(tree) = &mut given {
            // Problems are reported when it is read
            lay_over(tree, &text, overrides.clone(), |_| {});
        }
        Self { text, path: path.to_owned(), overrides, given }
    }

    /// The manifest, with warnings about obsolete forms.
    ///
    /// # Errors
    /// Same as [`Manifest::parse_with`].
    pub fn parse(&self) -> Result<(Manifest, Vec<String>), ManifestError> {
        Manifest::parse_with_warnings(&self.text, &self.path, self.overrides.clone())
    }

    /// The manifest with `defaults` for the values that neither it nor its look gives.
    ///
    /// # Errors
    /// Same as [`Manifest::parse_with`].
    pub fn parse_over(&self, defaults: Vec<Override>) -> Result<Manifest, ManifestError> {
        let defaults = defaults.into_iter().map(Override::under);
        let all = self.overrides.iter().cloned().chain(defaults).collect();
        Manifest::parse_with(&self.text, &self.path, all)
    }

    /// Name of the file in messages.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The values that it gives, without those of its look; empty if it is not TOML.
    pub(super) fn without_look(&self) -> TomlNode {
        let mut tree = TomlNode::parse(&self.text).unwrap_or_else(|_| TomlNode::empty());
        for own in self.overrides.iter().filter(|own| !own.is_under()) {
            // Problems are reported when it is read
            let _ = tree.lay_over(own.clone());
        }
        tree
    }

    /// The same with more `overrides`, which replace what it gives.
    #[must_use]
    pub fn with(&self, overrides: impl IntoIterator<Item = Override>) -> Self {
        let all = self.overrides.iter().cloned().chain(overrides).collect();
        Self::new(self.text.clone(), &self.path, all)
    }

    /// Whether neither the manifest nor an override or the look gives a value of the dotted `key`.
    pub fn lacks(&self, key: &str) -> bool {
        self.given.as_ref().is_some_and(|tree| !tree.has(key))
    }
}

/// Applies `overrides` to the `tree` of a manifest with this `text`, and then the defaults of its look and those among
/// the overrides to keys that are still missing.
pub(super) fn lay_over(
    tree: &mut TomlNode,
    text: &str,
    overrides: Vec<Override>,
    mut on_problem: impl FnMut(Problem),
) {
    let mut lay = |tree: &mut TomlNode, layer| {
        if let Err(problem) = tree.lay_over(layer) {
            on_problem(problem);
        }
    };
    let (under, over): (Vec<_>, Vec<_>) = overrides.into_iter().partition(Override::is_under);
    over.into_iter().for_each(|o| lay(tree, o));
    // Jobs write their settings as a whole
    if is_marked(text) {
        let none = Override::new("look", Look::None.name(), "the file");
        none.into_iter().for_each(|o| lay(tree, o.under()));
    }
    // The pattern of a look is not that of a ground which is named plain
    let kinds = ["render.ground", "render.ground.type"];
    let is_plain = kinds.iter().any(|key| tree.has_text(key, GroundKind::Plain.name()));
    let defaults = Look::of(tree).settings("look").into_iter().chain(under);
    defaults.filter(|o| !(is_plain && o.is_of("render.ground_pattern"))).for_each(|o| lay(tree, o));
}
