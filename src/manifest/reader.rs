//! Takes typed values out of a [`Node`] tree and gathers everything that is wrong with it, each
//! with its place and key, so that one look is enough to mend a manifest.

use std::cell::RefCell;

use super::tree::{Kind, Node, Place};

/// One thing wrong with a manifest.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Problem {
    pub(super) place: Place,
    /// Dotted; empty for the file as a whole.
    pub(super) key: String,
    pub(super) what: String,
}

pub(super) type Problems = RefCell<Vec<Problem>>;

/// A table being read. Keys that nobody asked for by the time of [`Section::finish`] are unknown.
pub(super) struct Section<'a> {
    path: String,
    node: Option<&'a Node>,
    asked: Vec<&'static str>,
    problems: &'a Problems,
}

/// One value that is there.
pub(super) struct Field<'a> {
    pub(super) key: String,
    node: &'a Node,
    problems: &'a Problems,
}

impl<'a> Section<'a> {
    pub(super) const fn root(node: &'a Node, problems: &'a Problems) -> Self {
        Self {
            path: String::new(),
            node: Some(node),
            asked: Vec::new(),
            problems,
        }
    }

    fn full_key(&self, key: &str) -> String {
        if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        }
    }

    /// The value under `key`, if there is one.
    pub(super) fn get(&mut self, key: &'static str) -> Option<Field<'a>> {
        self.asked.push(key);
        let Some(Kind::Table(table)) = self.node.map(|n| &n.kind) else {
            return None;
        };
        table.get(key).map(|(_, node)| Field {
            key: self.full_key(key),
            node,
            problems: self.problems,
        })
    }

    /// The table under `key`; a missing one reads as empty.
    pub(super) fn section(&mut self, key: &'static str) -> Self {
        let missing = Self {
            path: self.full_key(key),
            node: None,
            asked: Vec::new(),
            problems: self.problems,
        };
        self.get(key).and_then(|f| f.section()).unwrap_or(missing)
    }

    /// The value under `key` as `read` has it, or `default` if it is missing (or wrong, which is
    /// a problem by then).
    pub(super) fn value<T>(
        &mut self,
        key: &'static str,
        default: T,
        read: impl FnOnce(&Field<'a>) -> Option<T>,
    ) -> T {
        self.optional(key, read).unwrap_or(default)
    }

    /// The same without a default.
    pub(super) fn optional<T>(
        &mut self,
        key: &'static str,
        read: impl FnOnce(&Field<'a>) -> Option<T>,
    ) -> Option<T> {
        self.get(key).and_then(|field| read(&field))
    }

    /// Every table in the list under `key`.
    pub(super) fn sections(&mut self, key: &'static str) -> Vec<Self> {
        let Some(field) = self.get(key) else {
            return Vec::new();
        };
        let items = field.items().unwrap_or_else(|| {
            field.wants(&format!("a list of tables, as [[{}]] begins", field.key));
            Vec::new()
        });
        items.iter().filter_map(Field::section).collect()
    }

    /// Whether there is nothing under `key`.
    pub(super) fn lacks(&self, key: &str) -> bool {
        match self.node.map(|n| &n.kind) {
            Some(Kind::Table(table)) => !table.contains_key(key),
            _ => true,
        }
    }

    /// Notes that `key` is needed but missing.
    pub(super) fn missing(&self, key: &str, what: &str) {
        self.problem(self.place(), key, &format!("is missing; {what}"));
    }

    /// Notes what is wrong with `key` here.
    pub(super) fn wrong(&self, key: &str, what: &str) {
        let place = match self.node.map(|n| &n.kind) {
            Some(Kind::Table(table)) => table.get(key).map(|(place, _)| place.clone()),
            _ => None,
        };
        self.problem(place.unwrap_or_else(|| self.place()), key, what);
    }

    fn place(&self) -> Place {
        self.node.map_or(Place::Nowhere, |n| n.place.clone())
    }

    fn problem(&self, place: Place, key: &str, what: &str) {
        self.problems.borrow_mut().push(Problem {
            place,
            key: self.full_key(key),
            what: what.to_owned(),
        });
    }

    /// Notes every key that nobody asked for.
    pub(super) fn finish(self) {
        let Some(Kind::Table(table)) = self.node.map(|n| &n.kind) else {
            return;
        };
        for (key, (place, _)) in table {
            if self.asked.contains(&key.as_str()) {
                continue;
            }
            if self.problems.borrow().len() > super::MOST_TOLD {
                break;
            }
            let what = match nearest(key, &self.asked) {
                Some(known) => format!("unknown key; did you mean `{}`?", self.full_key(known)),
                None => match elsewhere(key, &self.path) {
                    Some(known) => format!("unknown key here; did you mean `{known}`?"),
                    None => format!("unknown key; known here: {}", self.asked.join(", ")),
                },
            };
            self.problem(place.clone(), key, &what);
        }
    }
}

impl<'a> Field<'a> {
    /// Notes that something else is wanted.
    pub(super) fn wants(&self, what: &str) {
        self.fail(&format!("wants {what}, not {}", self.node.describe()));
    }

    /// Notes that the value will not do.
    pub(super) fn fail(&self, what: &str) {
        self.problems.borrow_mut().push(Problem {
            place: self.node.place.clone(),
            key: self.key.clone(),
            what: what.to_owned(),
        });
    }

    /// The value, or a note that `what` is wanted.
    pub(super) fn or_wants<T>(&self, value: Option<T>, what: &str) -> Option<T> {
        if value.is_none() {
            self.wants(what);
        }
        value
    }

    pub(super) fn as_text(&self) -> Option<&'a str> {
        match &self.node.kind {
            Kind::Text(text) => Some(text),
            _ => None,
        }
    }

    pub(super) const fn as_integer(&self) -> Option<i64> {
        match self.node.kind {
            Kind::Integer(i) => Some(i),
            _ => None,
        }
    }

    /// A finite number; whole ones may do without a point.
    pub(super) fn as_number(&self) -> Option<f64> {
        match self.node.kind {
            #[expect(clippy::cast_precision_loss, reason = "what the user means by it")]
            Kind::Integer(i) => Some(i as f64),
            Kind::Float(f) if f.is_finite() => Some(f),
            _ => None,
        }
    }

    /// As many finite numbers as asked for.
    pub(super) fn as_numbers<const N: usize>(&self) -> Option<[f64; N]> {
        let numbers: Vec<f64> = self.items()?.iter().filter_map(Self::as_number).collect();
        let all = numbers.len() == self.items()?.len();
        numbers.try_into().ok().filter(|_| all)
    }

    pub(super) const fn is_table(&self) -> bool {
        matches!(self.node.kind, Kind::Table(_))
    }

    /// The items of a list.
    pub(super) fn items(&self) -> Option<Vec<Self>> {
        let Kind::Array(items) = &self.node.kind else {
            return None;
        };
        let item = |(index, node)| Self {
            key: format!("{}.{index}", self.key),
            node,
            problems: self.problems,
        };
        Some(items.iter().enumerate().map(item).collect())
    }

    pub(super) fn section(&self) -> Option<Section<'a>> {
        if !self.is_table() {
            self.wants("a table");
            return None;
        }
        Some(Section {
            path: self.key.clone(),
            node: Some(self.node),
            asked: Vec::new(),
            problems: self.problems,
        })
    }

    pub(super) fn text(&self) -> Option<String> {
        self.or_wants(self.as_text().map(str::to_owned), "text in quotes")
    }

    /// Text that is not empty.
    pub(super) fn name(&self) -> Option<String> {
        let text = self.as_text().filter(|t| !t.trim().is_empty());
        self.or_wants(text.map(str::to_owned), "a name in quotes")
    }

    pub(super) fn bool(&self) -> Option<bool> {
        let value = match self.node.kind {
            Kind::Bool(b) => Some(b),
            _ => None,
        };
        self.or_wants(value, "true or false")
    }

    pub(super) fn count(&self, from: u32, to: u32) -> Option<u32> {
        let value = self.as_integer().and_then(|i| u32::try_from(i).ok());
        let value = value.filter(|v| (from..=to).contains(v));
        self.or_wants(value, &format!("a whole number from {from} to {to}"))
    }

    /// A finite number for which `holds`; `what` says which those are.
    pub(super) fn number(&self, what: &str, holds: impl Fn(f64) -> bool) -> Option<f64> {
        self.or_wants(self.as_number().filter(|v| holds(*v)), what)
    }

    /// The same in single precision, for shading; must stay finite in it.
    pub(super) fn number32(&self, what: &str, holds: impl Fn(f32) -> bool) -> Option<f32> {
        let value = self.as_number().map(narrow);
        self.or_wants(value.filter(|v| v.is_finite() && holds(*v)), what)
    }

    pub(super) fn point(&self) -> Option<[f64; 3]> {
        self.or_wants(self.as_numbers(), "three numbers, as [0.0, 1.0, 2.0]")
    }

    pub(super) fn direction(&self) -> Option<[f64; 3]> {
        let value = self
            .as_numbers()
            .filter(|v: &[f64; 3]| v.iter().any(|c| *c != 0.0));
        self.or_wants(
            value,
            "three numbers that are not all 0, as [0.0, 0.0, 1.0]",
        )
    }

    /// One of `names`, each of which is a `what`.
    pub(super) fn choice_of<T: Copy>(&self, what: &str, names: &[(T, &'static str)]) -> Option<T> {
        let is_known = |text: &str| names.iter().any(|(_, name)| *name == text);
        let Some(unknown) = self.as_text().filter(|text| !is_known(text)) else {
            return self.choice(names);
        };
        let known: Vec<&'static str> = names.iter().map(|(_, name)| *name).collect();
        let hint = nearest(unknown, &known).map(|n| format!("; did you mean {n}?"));
        self.fail(&format!(
            "unknown {what} `{unknown}`; choose one of {}{}",
            known.join(", "),
            hint.unwrap_or_default()
        ));
        None
    }

    /// One of `names`.
    pub(super) fn choice<T: Copy>(&self, names: &[(T, &'static str)]) -> Option<T> {
        let known: Vec<&'static str> = names.iter().map(|(_, name)| *name).collect();
        let Some(text) = self.as_text() else {
            self.wants(&format!("one of {}", known.join(", ")));
            return None;
        };
        let found = names.iter().find(|(_, name)| *name == text);
        if found.is_none() {
            let hint = nearest(text, &known).map(|n| format!("; did you mean {n}?"));
            let hint = hint.unwrap_or_default();
            self.wants(&format!("one of {}", known.join(", ")));
            if let Some(problem) = self.problems.borrow_mut().last_mut() {
                problem.what.push_str(&hint);
            }
        }
        found.map(|(value, _)| *value)
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "callers check that it is finite"
)]
pub(super) const fn narrow(value: f64) -> f32 {
    value as f32
}

/// The known word that was probably meant, if any is near enough.
pub(crate) fn nearest<'k>(word: &str, known: &[&'k str]) -> Option<&'k str> {
    let distance = |k: &str| strsim::damerau_levenshtein(&word.to_lowercase(), &k.to_lowercase());
    let best = known.iter().min_by_key(|k| distance(k))?;
    let is_part = word.len() >= 4 && best.contains(word) || best.len() >= 4 && word.contains(*best);
    let limit = (word.chars().count().max(best.chars().count()) / 3).max(1);
    (is_part || distance(best) <= limit).then_some(*best)
}

/// The same key in a section where it is known: `samples` belongs into `image`.
fn elsewhere(key: &str, path: &str) -> Option<String> {
    super::known_keys()
        .into_iter()
        .filter(|known| !known.starts_with(&format!("{path}.")) || path.is_empty())
        .find(|known| known.rsplit('.').next() == Some(key))
}
