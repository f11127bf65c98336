//! A pass over the declared keys, to read a manifest or to list it.
//!
//! `section!` declares a table of the manifest as a struct, `keys!` the keys of a struct that is defined elsewhere.
//! Both expand to one call of [`Keys::key`] per key.

use super::key::Key;
use super::list::Entries;
use super::reader::Section;
use super::value::Slot;

/// Declares a table of the manifest: a struct, its defaults and its keys. The doc comment of a field is the text that
/// users read; its first paragraph is the comment in the file. A field after `@` is itself a table with keys.
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

            pub(super) fn keys(&mut self, keys: &mut $crate::keys::Keys<'_>) {
                $(keys.key(
                    $crate::key::Key::new(stringify!($field), &[$($doc),+])
                        $(.$rule($($argument),*))*,
                    &mut self.$field,
                );)+
            }
        }
    };
}
pub(super) use section;

/// Declares the keys of values that are stored elsewhere: `name => place, rules;`.
macro_rules! keys {
    ($keys:ident: $($(#[doc = $doc:literal])+ $name:ident => $place:expr
        $(, $rule:ident($($argument:expr),* $(,)?))*;)+) => {{
        $($keys.key(
            $crate::key::Key::new(stringify!($name), &[$($doc),+])
                $(.$rule($($argument),*))*,
            &mut $place,
        );)+
    }};
}
pub(super) use keys;

/// A pass over the keys of a table, to read or to list them.
pub(super) enum Keys<'a> {
    Read(Section<'a>),
    List(&'a mut Entries),
}

impl<'a> Keys<'a> {
    /// Visits one key.
    pub(super) fn key<S: Slot>(&mut self, key: Key, slot: &mut S) {
        match self {
            Self::Read(section) => section.read(&key, slot),
            Self::List(entries) => entries.push::<S::Value>(key, slot.get()),
        }
    }

    /// Visits the table `name`.
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

    /// Visits the list of tables `name`; `path` is the full key.
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

    /// The table that is being read, for checks of dependencies between keys.
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
