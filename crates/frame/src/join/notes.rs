//! Notes about columns that not all parts have in the same way.

use std::collections::BTreeMap;

use spherule_files::one_line;

use super::columns::PartColumns;

/// Most names that a note lists, of columns and of parts.
const LISTED: usize = 8;

/// Most notes about one join.
const MAX_NOTES: usize = 8;

/// Why a column is not as in its parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Omission {
    /// Some parts lack it and have NaN there.
    Missing,
    /// Some parts lack it, and it is left out.
    Incomplete,
    /// The parts have different numbers of components.
    Components,
    /// A part has it more than once.
    Repeated,
}

/// Columns with omissions, those of the same parts together.
pub(super) struct Omitted<'p> {
    parts: &'p [PartColumns<'p>],
    /// Names of columns by the indices of parts that have them.
    columns: BTreeMap<(Omission, Vec<usize>), Vec<String>>,
}

impl<'p> Omitted<'p> {
    pub(super) const fn new(parts: &'p [PartColumns<'p>]) -> Self {
        Self { parts, columns: BTreeMap::new() }
    }

    /// Adds the column `name` in the parts of `cells`.
    pub(super) fn add(&mut self, name: &str, omission: Omission, cells: &[(usize, usize)]) {
        let parts = cells.iter().map(|(part, _)| *part).collect();
        let columns = self.columns.entry((omission, parts)).or_default();
        if columns.last().is_none_or(|last| last != name) {
            columns.push(name.to_owned());
        }
    }

    pub(super) fn notes(&self) -> Vec<String> {
        let all = self.columns.iter();
        let mut notes: Vec<String> = all
            .take(MAX_NOTES)
            .map(|((omission, having), columns)| self.note(*omission, having, columns))
            .collect();
        let left = self.columns.values().skip(MAX_NOTES).map(Vec::len).sum::<usize>();
        if left > 0 {
            notes.push(format!("{left} more columns are not the same in all parts"));
        }
        notes
    }

    fn note(&self, omission: Omission, having: &[usize], columns: &[String]) -> String {
        let named = |index: usize| self.parts.get(index).map_or("", |part| part.name);
        let columns = listed("", columns.iter().map(String::as_str));
        // List the parts that lack something only if the note names them
        let lacking = || {
            let mut having = having.iter().peekable();
            let filled = (0..self.parts.len()).filter(|index| self.parts[*index].count > 0);
            let lacking = filled.filter(move |index| {
                while having.next_if(|part| *part < index).is_some() {}
                having.peek() != Some(&index)
            });
            listed("part", lacking.map(named))
        };
        // Say what becomes of the columns
        let note = match omission {
            Omission::Missing => format!("{} without {columns}: NaN there", lacking()),
            Omission::Incomplete => format!("{} without {columns}: left out", lacking()),
            Omission::Components => {
                let parts = listed("part", having.iter().map(|index| named(*index)));
                format!("{columns} with different numbers of components in {parts}: left out")
            }
            Omission::Repeated => {
                let parts = listed("part", having.iter().map(|index| named(*index)));
                format!("several columns {columns} in {parts}: the first is used")
            }
        };
        one_line(note)
    }
}

/// `part "a"`, or `parts "a", "b" and 7 more`.
fn listed<'a>(noun: &str, names: impl Iterator<Item = &'a str>) -> String {
    let mut count = 0;
    let mut shown = Vec::new();
    for name in names {
        count += 1;
        if count <= LISTED {
            shown.push(format!("`{name}`"));
        }
    }
    let noun = match (noun, count) {
        ("", _) => String::new(),
        (noun, 1) => format!("{noun} "),
        (noun, _) => format!("{noun}s "),
    };
    let more = match count - shown.len() {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("{noun}{}{more}", shown.join(", "))
}
