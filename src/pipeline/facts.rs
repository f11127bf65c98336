//! What overlays show of the file of a frame.

use rayon::prelude::*;
use spherule_frame::values::{Column, Value};

use super::SharedFrame;
use super::setup::Setup;

/// What overlays show of the file of a frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FileFacts {
    /// Name of the first file.
    pub(super) file: String,
    /// Smallest and largest values, in the order of `Picture::overlay_values`.
    pub(super) ranges: Vec<Option<[f64; 2]>>,
}

impl FileFacts {
    /// The facts of a decoded frame.
    pub(super) fn of_decoded(setup: &Setup, frame: &SharedFrame<'_>, file: String) -> Self {
        let range = |name: &String| {
            let value = Value::named(name, &frame.attributes)?;
            column_range(&value.bind(|name| frame.attribute(name))?, frame.len())
        };
        let names = setup.picture.files.overlay_values.iter();
        Self { file, ranges: names.map(range).collect() }
    }
}

/// Smallest and largest value in a column of `count` particles.
pub(super) fn column_range<C: Column + Sync>(value: &Value<C>, count: usize) -> Option<[f64; 2]> {
    match value {
        Value::Magnitude(column) => range_of(count, |i| column.magnitude(i)),
        Value::Component(column, component) => range_of(count, |i| column.get(i, *component)),
        _ => None,
    }
}

/// Smallest and largest of `count` values that are finite.
fn range_of(count: usize, value: impl Fn(usize) -> f64 + Sync + Send) -> Option<[f64; 2]> {
    let values = (0..count).into_par_iter().map(value);
    let finite = values.filter(|value| value.is_finite());
    let pairs = finite.map(|value| [value, value]);
    pairs.reduce_with(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}
