//! One declaration per key: what it is called, which values it takes, what `init`, the schema, the manual and the
//! command line say about it, and whether an image depends on it.
//!
//! `section!` declares a table of the manifest as a struct, `keys!` the keys of a struct that lives elsewhere. Both
//! expand to one call of [`Keys::key`] for each key. The same calls read a manifest and list it.

use super::list::Entries;
use super::reader::Section;
use super::value::{Slot, Value};

/// Declares a table of the manifest: a struct, its defaults and its keys. The doc comment of a field is the text that
/// users read; its first paragraph is the comment in the file. A field after `@` has keys of its own.
macro_rules! section {
    ($(#[doc = $about:literal])+ $name:ident {
        $($(#[doc = $doc:literal])+ $field:ident: $type:ty = $default:expr
            $(, $rule:ident($($argument:expr),* $(,)?))*;)+
        $(@ $(#[doc = $extra_doc:literal])+ $extra:ident: $extra_type:ty;)*
    }) => {
        $(#[doc = $about])+
        #[derive(Debug, Clone, PartialEq)]
        pub struct $name {
            $($(#[doc = $doc])+ pub $field: $type,)+
            $($(#[doc = $extra_doc])+ pub $extra: $extra_type,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self {
                    $($field: $default,)+
                    $($extra: Default::default(),)*
                }
            }
        }

        impl $name {
            pub(super) const ABOUT: &[&str] = &[$($about),+];

            pub(super) fn keys(&mut self, keys: &mut $crate::manifest::key::Keys<'_>) {
                $(keys.key(
                    $crate::manifest::key::Key::new(stringify!($field), &[$($doc),+])
                        $(.$rule($($argument),*))*,
                    &mut self.$field,
                );)+
            }
        }
    };
}
pub(super) use section;

/// Declares the keys of values that are elsewhere: `name => place, rules;`.
macro_rules! keys {
    ($keys:ident: $($(#[doc = $doc:literal])+ $name:ident => $place:expr
        $(, $rule:ident($($argument:expr),* $(,)?))*;)+) => {{
        $($keys.key(
            $crate::manifest::key::Key::new(stringify!($name), &[$($doc),+])
                $(.$rule($($argument),*))*,
            &mut $place,
        );)+
    }};
}
pub(super) use keys;

/// When images depend on a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Affects {
    Images,
    Nothing,
    SmoothSurfaces,
    /// Unions and smooth surfaces.
    Bodies,
    /// Spheres that reflect and refract.
    BranchingSpheres,
}

impl Affects {
    /// For the manual.
    #[cfg(test)]
    pub(super) const fn text(self) -> &'static str {
        match self {
            Self::Images => "yes",
            Self::Nothing => "no",
            Self::SmoothSurfaces => "smooth surfaces only",
            Self::Bodies => "unions and smooth surfaces only",
            Self::BranchingSpheres => "spheres that reflect and transmit only",
        }
    }
}

/// An end of the range of a number.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bound {
    pub(super) value: f64,
    pub(super) is_excluded: bool,
}

/// An option of the command line that sets a key.
#[derive(Debug, Clone, Copy)]
pub struct Flag {
    /// Without the hyphens.
    pub name: &'static str,
    /// What the help calls its value.
    pub value_name: &'static str,
    /// Heading in the help.
    pub heading: &'static str,
}

/// Rules of a declaration: each sets one field of the [`Key`].
macro_rules! rules {
    ($($(#[$doc:meta])+ $name:ident($($argument:ident: $type:ty)?) { $field:ident: $value:expr })+) => {
        impl Key {
            $($(#[$doc])+ pub(super) fn $name(self, $($argument: $type)?) -> Self {
                Self { $field: $value, ..self }
            })+
        }
    };
}

rules! {
    /// Least value.
    from(low: impl Into<f64>) { low: Some(Bound { value: low.into(), is_excluded: false }) }
    /// Greatest value that is too small.
    above(low: impl Into<f64>) { low: Some(Bound { value: low.into(), is_excluded: true }) }
    /// Greatest value.
    to(high: impl Into<f64>) { high: Some(Bound { value: high.into(), is_excluded: false }) }
    /// Least value that is too large.
    below(high: impl Into<f64>) { high: Some(Bound { value: high.into(), is_excluded: true }) }
    /// What a number counts, as "degrees".
    unit(unit: &'static str) { unit: Some(unit) }
    /// What a range that begins at 0 means there.
    zero(meaning: &'static str) { zero: Some(meaning) }
    /// Allows 0 beside the range.
    or_zero() { or_zero: true }
    /// Refuses the zero vector.
    direction() { is_direction: true }
    /// Requires that a number is in range in single precision, too.
    single() { is_single: true }
    /// The word that stands for a value that is not set, as "auto".
    or(word: &'static str) { word: Some(word) }
    /// A value where there is no default, as TOML.
    example(example: &'static str) { example: example }
    /// What happens where the key is not set.
    unset(unset: &'static str) { unset: Some(unset) }
    /// Why the key must be there.
    required(why: &'static str) { required: Some(why) }
    /// When images depend on the key.
    affects(affects: Affects) { affects: affects }
}

impl Key {
    /// An old word for a value, and the new one.
    pub(super) fn renamed(self, old: &'static str, new: &'static str) -> Self {
        let renamed = Some([old, new]);
        Self { renamed, ..self }
    }

    /// The option that sets the key, what the help calls its value, and the heading there.
    pub(super) fn flag(
        self,
        name: &'static str,
        value_name: &'static str,
        heading: &'static str,
    ) -> Self {
        let flag = Some(Flag {
            name,
            value_name,
            heading,
        });
        Self { flag, ..self }
    }
}

/// The declaration of a key; the rules above say what its fields mean.
#[derive(Debug, Clone, Copy)]
pub(super) struct Key {
    pub(super) name: &'static str,
    docs: &'static [&'static str],
    pub(super) low: Option<Bound>,
    pub(super) high: Option<Bound>,
    pub(super) unit: Option<&'static str>,
    zero: Option<&'static str>,
    pub(super) or_zero: bool,
    pub(super) is_direction: bool,
    pub(super) is_single: bool,
    pub(super) word: Option<&'static str>,
    pub(super) example: &'static str,
    pub(super) unset: Option<&'static str>,
    pub(super) required: Option<&'static str>,
    pub(super) affects: Affects,
    pub(super) renamed: Option<[&'static str; 2]>,
    pub(super) flag: Option<Flag>,
}

impl Key {
    pub(super) const fn new(name: &'static str, docs: &'static [&'static str]) -> Self {
        Self {
            name,
            docs,
            low: None,
            high: None,
            unit: None,
            zero: None,
            or_zero: false,
            is_direction: false,
            is_single: false,
            word: None,
            example: "",
            unset: None,
            required: None,
            affects: Affects::Images,
            renamed: None,
            flag: None,
        }
    }

    /// The comment of the key: the first paragraph of its documentation.
    pub(super) fn comment(&self) -> String {
        paragraphs(self.docs).swap_remove(0)
    }

    /// What the documentation says beyond the comment.
    pub(super) fn details(&self) -> Vec<String> {
        paragraphs(self.docs).split_off(1)
    }

    /// The range of a number in words: ` from 0 to 1`.
    pub(super) fn range(&self) -> String {
        let zero = self
            .zero
            .map(|zero| format!(" ({zero})"))
            .unwrap_or_default();
        let low = self.low.map(|b| (shown(b.value) + &zero, b.is_excluded));
        // No finite number is beyond the limit of single precision in a meaningful way.
        let high = self.high.filter(|b| b.value < f64::from(f32::MAX));
        let high = high.map(|b| (shown(b.value), b.is_excluded));
        match (low, high) {
            (None, None) => String::new(),
            (Some((low, false)), None) => format!(" from {low}"),
            (Some((low, true)), None) => format!(" above {low}"),
            (Some((low, false)), Some((high, false))) => format!(" from {low} to {high}"),
            (Some((low, true)), Some((high, true))) => format!(" between {low} and {high}"),
            (Some((low, true)), Some((high, false))) => format!(" above {low}, at most {high}"),
            (Some((low, false)), Some((high, true))) => format!(" from {low}, below {high}"),
            (None, Some((high, false))) => format!(" up to {high}"),
            (None, Some((high, true))) => format!(" below {high}"),
        }
    }

    /// Whether a finite number is in range.
    pub(super) fn holds(&self, value: f64) -> bool {
        let above = |b: Bound| value > b.value || !b.is_excluded && value == b.value;
        let below = |b: Bound| value < b.value || !b.is_excluded && value == b.value;
        let in_range = self.low.is_none_or(above) && self.high.is_none_or(below);
        value.is_finite() && (in_range || self.or_zero && value == 0.0)
    }

    /// What a message asks for.
    pub(super) fn wants<T: Value>(&self) -> String {
        let kind = T::kind(self);
        match self.word {
            Some(word @ "all") => format!("\"{word}\" or {kind}"),
            Some(word) => format!("{kind} or \"{word}\""),
            None => kind,
        }
    }
}

/// A bound in a message: bounds of single precision as they were written.
#[expect(clippy::cast_possible_truncation, reason = "for display")]
fn shown(value: f64) -> String {
    let value = value as f32;
    match value.abs() {
        0.0 | 1e-3..1e6 => value.to_string(),
        _ => format!("{value:e}"),
    }
}

/// Lines of a doc comment as paragraphs, each on one line.
pub(super) fn paragraphs(docs: &[&str]) -> Vec<String> {
    let lines: Vec<&str> = docs.iter().map(|line| line.trim()).collect();
    lines
        .split(|line| line.is_empty())
        .map(|p| p.join(" "))
        .collect()
}

/// The keys of a table, gone through to read them or to list them.
pub(super) enum Keys<'a> {
    Read(Section<'a>),
    List(&'a mut Entries),
}

impl<'a> Keys<'a> {
    /// One key.
    pub(super) fn key<S: Slot>(&mut self, key: Key, slot: &mut S) {
        match self {
            Self::Read(section) => section.read(&key, slot),
            Self::List(entries) => entries.push::<S::Value>(key, slot.get()),
        }
    }

    /// The table under `name`.
    pub(super) fn section(
        &mut self,
        name: &'static str,
        about: &[&'static str],
        keys: impl FnOnce(&mut Keys<'_>),
    ) {
        match self {
            Self::Read(section) => {
                let mut inner = Keys::Read(section.section(name));
                keys(&mut inner);
                inner.finish();
            }
            Self::List(entries) => {
                entries.section(name, about);
                keys(&mut Keys::List(entries));
            }
        }
    }

    /// The list of tables under `name`; `path` is the whole key.
    pub(super) fn list<T: Default>(
        &mut self,
        name: &'static str,
        path: &'static str,
        about: &[&'static str],
        items: &mut Vec<T>,
        mut keys: impl FnMut(&mut T, &mut Keys<'_>),
    ) {
        match self {
            Self::Read(section) => {
                for item in section.sections(name) {
                    let mut inner = Keys::Read(item);
                    let mut value = T::default();
                    keys(&mut value, &mut inner);
                    inner.finish();
                    items.push(value);
                }
            }
            Self::List(entries) => {
                for (index, item) in items.iter_mut().enumerate() {
                    entries.item(path, index, about);
                    keys(item, &mut Keys::List(entries));
                }
            }
        }
    }

    /// The table that is read, for what keys need of one another.
    pub(super) const fn reading(&mut self) -> Option<&mut Section<'a>> {
        match self {
            Self::Read(section) => Some(section),
            Self::List(_) => None,
        }
    }

    pub(super) fn finish(self) {
        if let Self::Read(section) = self {
            section.finish();
        }
    }
}
