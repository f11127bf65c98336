//! Radii of grains: columns whose names mean a radius in the files of some programs, and something else in those of
//! others. Their values decide.

use spherule_formats::names::without_unit;
use spherule_formats::{Attribute, AttributeData};

use super::robust::sorted_sample;

/// Names of radii and diameters, with the factor that converts them to radii. Those that are always radii are in
/// `names::RADII`.
const NAMES: [(&str, f64); 14] = [
    ("r", 1.0),
    ("rad", 1.0),
    ("radii", 1.0),
    ("particle_radius", 1.0),
    ("particleradius", 1.0),
    ("radius_p", 1.0),
    ("d", 0.5),
    ("dia", 0.5),
    ("diam", 0.5),
    ("diameters", 0.5),
    ("particle_diameter", 0.5),
    ("particlediameter", 0.5),
    ("size", 0.5),
    ("grain_size", 0.5),
];

/// The median radius of grains, relative to half the median distance of nearest neighbours: that is the radius of the
/// smaller ones where grains touch, and more in a gas.
const PLAUSIBLE: std::ops::RangeInclusive<f64> = 0.2..=2.5;

/// An attribute with radii.
#[derive(Debug, Clone, PartialEq)]
pub struct GrainRadius {
    /// Its name.
    pub attribute: String,
    /// The radius is the value times this factor.
    pub scale: f64,
}

impl GrainRadius {
    /// Whether an attribute of this name may have radii.
    pub(super) fn is_name(name: &str) -> bool {
        NAMES.iter().any(|(known, _)| without_unit(name).eq_ignore_ascii_case(known))
    }

    /// The first of `attributes` with positive numbers that fit half the distance of neighbours, `touching`.
    pub(super) fn of(attributes: &[Attribute], touching: f64) -> Option<Self> {
        let is_float = |a: &&Attribute| {
            a.components == 1 && matches!(a.data, AttributeData::F32(_) | AttributeData::F64(_))
        };
        let found = |(name, scale): &(&str, f64)| {
            let mut named = attributes.iter().filter(is_float);
            let attribute = named.find(|a| without_unit(&a.name).eq_ignore_ascii_case(name))?;
            let values = sorted_sample(attribute.count(), |i| attribute.data.get_f64(i));
            let median = values.get(values.len() / 2)? * scale;
            let is_positive = values.first().is_some_and(|least| *least > 0.0);
            let is_radius = is_positive && PLAUSIBLE.contains(&(median / touching));
            is_radius.then(|| Self { attribute: attribute.name.clone(), scale: *scale })
        };
        NAMES.iter().find_map(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute(name: &str, values: &[f64]) -> Attribute {
        let data = AttributeData::F64(values.to_vec());
        Attribute { name: name.to_owned(), components: 1, data }
    }

    #[test]
    fn values_decide_whether_a_column_has_radii() {
        let of = |attributes: &[Attribute]| GrainRadius::of(attributes, 0.1);
        let found = of(&[attribute("mass", &[0.1; 3]), attribute("Rad", &[0.08, 0.1, 0.12])]);
        assert_eq!(found, Some(GrainRadius { attribute: "Rad".to_owned(), scale: 1.0 }));
        let found = of(&[attribute("d", &[0.2; 3])]).expect("diameters");
        assert_eq!(found.scale, 0.5);
        // A distance from the axis, a colour, and counts
        for values in [[0.0, 0.1, 0.2], [3.0, 4.0, 5.0], [-0.1, 0.1, 0.1]] {
            assert_eq!(of(&[attribute("r", &values)]), None, "{values:?}");
        }
        let counts = AttributeData::I32(vec![1, 1, 1]);
        let counts = Attribute { name: "size".to_owned(), components: 1, data: counts };
        assert_eq!(GrainRadius::of(&[counts], 0.5), None);
    }
}
