//! What overlays show of the file of a frame.

use rayon::prelude::*;
use spherule_formats::Attribute;

use super::SharedFrame;
use super::setup::Setup;
use crate::survey::ParticleValue;

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
        let range = |name: &String| match ParticleValue::named(name, &frame.attributes)? {
            ParticleValue::Magnitude(name) => {
                let attribute = frame.attribute(&name)?;
                range_of(attribute.count(), |i| attribute.magnitude(i))
            }
            ParticleValue::Component(name, c) => {
                let attribute: &Attribute = frame.attribute(&name)?;
                let value = |i: usize| attribute.data.get_f64(i * attribute.components + c);
                range_of(attribute.count(), value)
            }
            _ => None,
        };
        let names = setup.picture.overlay_values.iter();
        Self { file, ranges: names.map(range).collect() }
    }
}

/// Smallest and largest of `count` values that are finite.
pub(super) fn range_of(
    count: usize,
    value: impl Fn(usize) -> f64 + Sync + Send,
) -> Option<[f64; 2]> {
    let values = (0..count).into_par_iter().map(value);
    let finite = values.filter(|value| value.is_finite());
    let pairs = finite.map(|value| [value, value]);
    pairs.reduce_with(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}
