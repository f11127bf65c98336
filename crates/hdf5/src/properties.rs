//! The data sets of a group as properties of its particles.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::file::ObjectKey;
use super::node::Node;
use super::piece::Piece;
use super::slice::Slice;
use super::stored::{Storage, Stored};
use super::types::Field;
use super::values::Values;
use spherule_frame::names::RECORD_VECTORS;
use spherule_frame::{MemoryBudget, ParseError};

/// Most numbers of a data set that is read beside the particles, such as a list of times.
const MAX_NUMBERS: u64 = 1 << 24;

/// Names of data sets that each have the positions along one axis.
pub(super) const AXES: [&str; 3] = ["x", "y", "z"];

/// Properties by name. The components of a vector may be several pieces.
pub(super) type Named = Vec<(String, Vec<Piece>)>;

/// Finds properties of `count` particles.
pub(super) struct PropertyFinder {
    pub(super) count: u64,
    pub(super) budget: MemoryBudget,
    /// Properties found so far.
    pub(super) found: Named,
    /// Names of data sets that were left out: of another length or of an unknown type.
    pub(super) left_out: Vec<String>,
    /// Object headers of the data sets in use, so that none is counted twice.
    used: BTreeSet<ObjectKey>,
}

impl PropertyFinder {
    pub(super) const fn new(count: u64, budget: MemoryBudget) -> Self {
        Self { count, budget, found: Vec::new(), left_out: Vec::new(), used: BTreeSet::new() }
    }

    /// Makes the data set a position, so that it does not become a property.
    pub(super) fn exclude(&mut self, stored: &Stored) {
        self.used.insert(stored.key());
    }

    /// The positions, whose axes x, y and z are data sets of their own; z may be missing. The particles are as many as
    /// the values of x. `values` are those of an axis, `what` says in messages what an axis has.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if x or y is missing or an axis has another length, and those of `values`.
    pub(super) fn positions(
        &mut self,
        node: &Node,
        what: &str,
        values: impl Fn(&str) -> Result<Option<Values>, ParseError>,
    ) -> Result<Vec<Piece>, ParseError> {
        let mut positions = Vec::new();
        for (index, name) in AXES.into_iter().enumerate() {
            let Some(axis) = values(name)? else {
                if index == 2 {
                    continue;
                }
                let what = format!("{} has no {what} {name}", node.path());
                return Err(ParseError::malformed(0, what));
            };
            if index == 0 {
                self.count = axis.count();
            }
            if axis.count() != self.count || axis.components() != 1 {
                let (shape, count) = (&axis.stored().shape, self.count);
                let what = format!("shape {shape:?} for {count} particles");
                return Err(axis.stored().bad(what));
            }
            self.exclude(axis.stored());
            positions.push(Piece::Stored(axis));
        }
        Ok(positions)
    }

    /// Adds the data set `dataset` of `node` as `name` if it has `slice` for the particles.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if it is damaged, [`ParseError::TooLarge`].
    pub(super) fn add(
        &mut self,
        node: &Node,
        dataset: &str,
        name: &str,
        slice: &Slice,
    ) -> Result<(), ParseError> {
        let stored = match Stored::open(node, dataset) {
            Err(ParseError::Unsupported { .. }) => {
                self.left_out.push(name.to_owned());
                return Ok(());
            }
            other => other?,
        };
        let Some(stored) = stored.map(Arc::new) else {
            return Ok(());
        };
        // Writers leave space unallocated for what they do not compute.
        if self.used.contains(&stored.key()) || matches!(stored.place, Storage::Missing) {
            return Ok(());
        }
        self.add_stored(&stored, name, slice)
    }

    /// [`Self::add`] of a data set that is open.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub(super) fn add_stored(
        &mut self,
        stored: &Arc<Stored>,
        name: &str,
        slice: &Slice,
    ) -> Result<(), ParseError> {
        let fields = Field::of_compound(&stored.datatype);
        if !fields.is_empty() && slice.field.is_none() {
            for (field_name, field) in fields {
                let slice = Slice { field: Some(field), ..slice.clone() };
                let name = format!("{name}.{field_name}");
                self.add_values(stored, &name, &slice)?;
            }
            self.used.insert(stored.key());
            return Ok(());
        }
        self.add_values(stored, name, slice)?;
        if slice.field.is_none() {
            self.used.insert(stored.key());
        }
        Ok(())
    }

    fn add_values(
        &mut self,
        stored: &Arc<Stored>,
        name: &str,
        slice: &Slice,
    ) -> Result<(), ParseError> {
        match Values::find(stored, slice, self.budget) {
            Ok(Some(values)) if values.count() == self.count => {
                let piece = vec![Piece::Stored(values)];
                self.found.push((name.to_owned(), piece));
            }
            Ok(_) | Err(ParseError::Unsupported { .. }) => self.left_out.push(name.to_owned()),
            Err(error) => return Err(error),
        }
        Ok(())
    }

    /// Joins scalars that are known to be the components of a vector.
    pub(super) fn join_vectors(&mut self) {
        for (name, components) in RECORD_VECTORS {
            self.join(name, components);
        }
    }

    /// Joins the scalars `components` as `name` if all are there.
    pub(super) fn join(&mut self, name: &str, components: &[&str]) {
        let is_scalar = |pieces: &[Piece]| pieces.len() == 1 && pieces[0].components() == 1;
        let place = |component: &&str| {
            let mut found = self.found.iter();
            found.position(|(name, pieces)| {
                name.eq_ignore_ascii_case(component) && is_scalar(pieces)
            })
        };
        let is_free = !self.found.iter().any(|(other, _)| other == name);
        let places: Option<Vec<usize>> = components.iter().map(place).collect();
        let Some(places) = places.filter(|_| is_free) else {
            return;
        };
        let pieces = places.iter().flat_map(|place| self.found[*place].1.clone());
        let vector = (name.to_owned(), pieces.collect());
        let first = places.iter().copied().min().unwrap_or(0);
        self.found[first] = vector;
        let mut index = 0;
        self.found.retain(|_| {
            let is_kept = index == first || !places.contains(&index);
            index += 1;
            is_kept
        });
    }
}

/// All values of `slice` of the data set `name`; `None` if there is no such data set, or it has no numbers.
///
/// # Errors
/// [`ParseError`] if the data set is damaged.
pub(super) fn values(
    node: &Node,
    name: &str,
    slice: &Slice,
    budget: MemoryBudget,
) -> Result<Option<Values>, ParseError> {
    match Stored::open(node, name)? {
        Some(stored) => Values::find(&Arc::new(stored), slice, budget),
        None => Ok(None),
    }
}

/// The numbers of a small data set, or of one number; `None` if there are none.
///
/// # Errors
/// [`ParseError`] if it is damaged, or has very many.
pub(super) fn numbers(
    node: &Node,
    name: &str,
    budget: MemoryBudget,
) -> Result<Option<Vec<f64>>, ParseError> {
    let Some(mut stored) = Stored::open(node, name)? else {
        return Ok(None);
    };
    if stored.shape.is_empty() {
        stored.shape = vec![1];
    }
    let stored = Arc::new(stored);
    let Some(values) = Values::find(&stored, &Slice::ALL, budget)? else {
        return Ok(None);
    };
    let count = values.count().saturating_mul(values.components() as u64);
    if count > MAX_NUMBERS {
        return Err(stored.bad(format!("{count} numbers, at most {MAX_NUMBERS} are read")));
    }
    budget.check(count.saturating_mul(16), "its lists are")?;
    let rows = usize::try_from(values.count()).unwrap_or(0);
    let numbers = Piece::Stored(values).all(rows)?;
    Ok(Some(numbers))
}
