//! A manifest as a tree of values with their origin: a location in the file, or an option of the command line that
//! replaced them.

use std::collections::BTreeMap;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::problem::{Place, Problem};

#[derive(Debug, Clone)]
pub(super) struct TomlNode {
    pub(super) kind: Kind,
    pub(super) place: Place,
}

#[derive(Debug, Clone)]
pub(super) enum Kind {
    Text(String),
    Integer(i64),
    Float(f64),
    Bool(bool),
    Array(Vec<TomlNode>),
    /// Values by key, with the location of each key.
    Table(BTreeMap<String, (Place, TomlNode)>),
    /// Dates, and integers beyond 64 bits.
    Other,
}

/// A value that replaces one of the manifest, such as `--set render.max_depth=5`, or a default for it.
#[derive(Debug, Clone)]
pub struct Override {
    keys: Vec<String>,
    node: TomlNode,
    is_under: bool,
    /// Whether it is another item of a list.
    is_item: bool,
}

/// Why an override is invalid.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{shown}: {fault}")]
pub struct OverrideError {
    /// The option as the user typed it.
    shown: String,
    fault: OverrideFault,
}

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
enum OverrideFault {
    #[error("no `=` (example: render.max_depth=5)")]
    NoValue,
    #[error("invalid key `{0}` (example: render.max_depth)")]
    Key(String),
    #[error("{0}")]
    Toml(String),
}

impl Override {
    /// Parses `render.max_depth=5`: a dotted key and a TOML value. A value that is not TOML is treated as text, so
    /// that quotes are not needed.
    ///
    /// # Errors
    /// There is no `=`, a key is empty, or a list, table or quoted text is incomplete.
    pub fn parse(assignment: &str) -> Result<Self, OverrideError> {
        let shown = format!("--set {assignment}");
        let error = |fault| OverrideError { shown: shown.clone(), fault };
        let Some((key, value)) = assignment.split_once('=') else {
            return Err(error(OverrideFault::NoValue));
        };
        let keys = split_key(key).map_err(error)?;
        let place = Place::Option(shown.clone());
        let value = value.trim();
        let kind = match DeValue::parse(value) {
            Ok(parsed) => match TomlNode::from_toml(parsed, &|_| place.clone()).kind {
                Kind::Other => Kind::Text(value.to_owned()),
                kind => kind,
            },
            Err(e) if value.starts_with(['[', '{', '"', '\'']) => {
                return Err(error(OverrideFault::Toml(e.message().to_owned())));
            }
            Err(_) => Kind::Text(value.to_owned()),
        };
        Ok(Self { keys, node: TomlNode { kind, place }, is_under: false, is_item: false })
    }

    /// Sets the dotted `key` to `value`; `shown` is its name in messages, such as `--output`.
    ///
    /// # Errors
    /// A part of the key is empty.
    pub fn new(
        key: &str,
        value: impl Into<toml::Value>,
        shown: &str,
    ) -> Result<Self, OverrideError> {
        let place = Place::Option(shown.to_owned());
        Ok(Self {
            keys: split_key(key)
                .map_err(|fault| OverrideError { shown: shown.to_owned(), fault })?,
            node: TomlNode::from_value(value.into(), &place),
            is_under: false,
            is_item: false,
        })
    }

    /// Appends `item` to the list `key`; `shown` is its name in messages, such as `--mesh`.
    ///
    /// # Errors
    /// A part of the key is empty.
    pub fn append(
        key: &str,
        item: impl Into<toml::Value>,
        shown: &str,
    ) -> Result<Self, OverrideError> {
        Ok(Self { is_item: true, ..Self::new(key, item, shown)? })
    }

    /// Converts it to a default: values of the manifest and of other overrides take precedence.
    #[must_use]
    pub fn under(self) -> Self {
        Self { is_under: true, ..self }
    }

    pub(super) fn is_under(&self) -> bool {
        self.is_under
    }

    /// Whether it sets the dotted `key`, or one in the table `key`.
    pub fn is_in(&self, key: &str) -> bool {
        let mut own = self.keys.iter();
        key.split('.').all(|part| own.next().is_some_and(|own| own == part))
    }

    /// Whether it sets the dotted `key`.
    pub(super) fn is_of(&self, key: &str) -> bool {
        key.split('.').eq(&self.keys)
    }
}

fn split_key(key: &str) -> Result<Vec<String>, OverrideFault> {
    let keys: Vec<String> = key.split('.').map(|k| k.trim().to_owned()).collect();
    if keys.iter().any(String::is_empty) {
        return Err(OverrideFault::Key(key.to_owned()));
    }
    Ok(keys)
}

impl TomlNode {
    /// The location and the value of the dotted `key`.
    pub(super) fn entry(&self, key: &str) -> Option<&(Place, Self)> {
        let Kind::Table(table) = &self.kind else {
            return None;
        };
        match key.split_once('.') {
            Some((first, rest)) => table.get(first)?.1.entry(rest),
            None => table.get(key),
        }
    }

    /// A table without values.
    pub(super) fn empty() -> Self {
        Self { kind: Kind::Table(BTreeMap::new()), place: Place::Nowhere }
    }

    /// Whether there is a value of the dotted `key`, which may be one of an item of a list: `light.0.color`.
    pub(super) fn holds(&self, key: &str) -> bool {
        let (first, rest) = key.split_once('.').map_or((key, None), |(a, b)| (a, Some(b)));
        let child = match &self.kind {
            Kind::Table(table) => table.get(first).map(|(_, child)| child),
            Kind::Array(items) => first.parse::<usize>().ok().and_then(|index| items.get(index)),
            _ => None,
        };
        child.is_some_and(|child| rest.is_none_or(|rest| child.holds(rest)))
    }

    /// Whether there is a value of the dotted `key`.
    pub(super) fn has(&self, key: &str) -> bool {
        self.entry(key).is_some()
    }

    /// Whether the value of the dotted `key` is this `text`.
    pub(super) fn has_text(&self, key: &str, text: &str) -> bool {
        matches!(self.entry(key), Some((_, Self { kind: Kind::Text(found), .. })) if found == text)
    }

    /// Parses a whole file.
    pub(super) fn parse(text: &str) -> Result<Self, (Place, String)> {
        match DeTable::parse(text) {
            Ok(table) => {
                let place = Place::Byte(table.span().start);
                let kind = Kind::from_table(table.into_inner(), &Place::Byte);
                Ok(Self { kind, place })
            }
            Err(e) => Err((
                e.span().map_or(Place::Nowhere, |s| Place::Byte(s.start)),
                e.message().to_owned(),
            )),
        }
    }

    fn from_toml(value: Spanned<DeValue<'_>>, place: &dyn Fn(usize) -> Place) -> Self {
        let at = place(value.span().start);
        let kind = match value.into_inner() {
            DeValue::String(text) => Kind::Text(text.into_owned()),
            DeValue::Integer(i) => match i64::from_str_radix(i.as_str(), i.radix()) {
                Ok(i) => Kind::Integer(i),
                Err(_) => Kind::Other,
            },
            DeValue::Float(f) => f.as_str().parse().map_or(Kind::Other, Kind::Float),
            DeValue::Boolean(b) => Kind::Bool(b),
            DeValue::Datetime(_) => Kind::Other,
            DeValue::Array(items) => {
                Kind::Array(items.into_iter().map(|item| Self::from_toml(item, place)).collect())
            }
            DeValue::Table(table) => Kind::from_table(table, place),
        };
        Self { kind, place: at }
    }

    fn from_value(value: toml::Value, place: &Place) -> Self {
        let kind = match value {
            toml::Value::String(text) => Kind::Text(text),
            toml::Value::Integer(i) => Kind::Integer(i),
            toml::Value::Float(f) => Kind::Float(f),
            toml::Value::Boolean(b) => Kind::Bool(b),
            toml::Value::Datetime(_) => Kind::Other,
            toml::Value::Array(items) => {
                Kind::Array(items.into_iter().map(|item| Self::from_value(item, place)).collect())
            }
            toml::Value::Table(table) => Kind::Table(
                table
                    .into_iter()
                    .map(|(key, value)| (key, (place.clone(), Self::from_value(value, place))))
                    .collect(),
            ),
        };
        Self { kind, place: place.clone() }
    }

    /// Applies `overlay` to this tree and creates the necessary tables, also in place of `"auto"`, which is
    /// equivalent to a missing value. `light.0.intensity` refers to an item of a list. A default does not change
    /// existing values, but may be another item of a list.
    pub(super) fn lay_over(&mut self, overlay: Override) -> Result<(), Problem> {
        let mut node = self;
        for (at, key) in overlay.keys.iter().enumerate() {
            // Replace "auto" by an empty table
            let is_auto = matches!(&node.kind, Kind::Text(text) if text == "auto");
            if is_auto && !overlay.is_under {
                node.kind = Kind::Table(BTreeMap::new());
            }
            node = match node.child(&overlay, (at, key))? {
                Some(child) => child,
                None => return Ok(()),
            };
        }
        if overlay.is_item {
            return node.append(&overlay);
        }
        *node = overlay.node;
        Ok(())
    }

    /// The node at the key `at` of `overlay`, created if necessary; None for a default that is not needed.
    fn child(
        &mut self,
        overlay: &Override,
        (at, key): (usize, &String),
    ) -> Result<Option<&mut Self>, Problem> {
        let problem = |what: &str| Problem {
            place: overlay.node.place.clone(),
            key: overlay.keys[..=at].join("."),
            what: what.to_owned(),
        };
        let is_last = at + 1 == overlay.keys.len();
        let found = self.describe();
        // Take the node that is there, or make an empty table
        match &mut self.kind {
            Kind::Table(table)
                if is_last && overlay.is_under && !overlay.is_item && table.contains_key(key) =>
            {
                Ok(None)
            }
            Kind::Table(table) => {
                let place = &overlay.node.place;
                let empty = Self { kind: Kind::Table(BTreeMap::new()), place: place.clone() };
                let entry = table.entry(key.clone()).or_insert((place.clone(), empty));
                Ok(Some(&mut entry.1))
            }
            Kind::Array(items) if key.bytes().all(|b| b.is_ascii_digit()) => {
                let index = key.parse::<usize>().ok();
                let item = index.and_then(|i| items.get_mut(i));
                item.map(Some)
                    .ok_or_else(|| problem("the list has no such item; they count from 0"))
            }
            // The reader reports the problem.
            _ if overlay.is_under => Ok(None),
            _ => {
                let above = overlay.keys[..at].join(".");
                let what = format!("{above} is {found}, which has no keys; set {above} itself");
                Err(problem(&what))
            }
        }
    }

    /// Appends the item of `overlay` to this list, which may be a new, empty table.
    fn append(&mut self, overlay: &Override) -> Result<(), Problem> {
        let item = overlay.node.clone();
        let found = self.describe();
        match &mut self.kind {
            Kind::Array(items) => items.push(item),
            Kind::Table(table) if table.is_empty() => self.kind = Kind::Array(vec![item]),
            _ => {
                return Err(Problem {
                    place: overlay.node.place.clone(),
                    key: overlay.keys.join("."),
                    what: format!("expected a list, found {found}"),
                });
            }
        }
        Ok(())
    }

    /// Description of the value for messages.
    pub(super) fn describe(&self) -> String {
        match &self.kind {
            Kind::Text(text) => format!("the text {text:?}"),
            Kind::Integer(i) => i.to_string(),
            Kind::Float(f) => format!("{f:?}"),
            Kind::Bool(b) => b.to_string(),
            Kind::Array(items) => format!("a list of {}", items.len()),
            Kind::Table(_) => "a table".to_owned(),
            Kind::Other => "a date or a huge number".to_owned(),
        }
    }
}

impl Kind {
    fn from_table(table: DeTable<'_>, place: &dyn Fn(usize) -> Place) -> Self {
        Self::Table(
            table
                .into_iter()
                .map(|(key, value)| {
                    let at = place(key.span().start);
                    let node = TomlNode::from_toml(value, place);
                    (key.into_inner().into_owned(), (at, node))
                })
                .collect(),
        )
    }
}
