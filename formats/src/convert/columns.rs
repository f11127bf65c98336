//! The row of bytes that is stored for each particle beside its position.

use std::path::Path;

use half::f16;

use super::settings::{AttributeChoice, ConvertError, ConvertSettings, RadiusRule};
use super::source::{ParticleSource, SourceAttribute};
use crate::names::{self, RADII, RADIUS};
use crate::native::{AttributeSpec, StoredType};
use crate::{ScalarType, is_radius};

/// The layout of the rows of a conversion: first the radius in f32 if particles have their own, then the
/// attributes as they are stored.
#[derive(Debug, Clone)]
pub(super) struct StoredColumns {
    pub(super) radius: Option<RadiusColumn>,
    pub(super) attributes: Vec<StoredColumn>,
}

/// The attribute that holds the radii.
#[derive(Debug, Clone, Copy)]
pub(super) struct RadiusColumn {
    /// Index of the attribute in the source.
    pub(super) attribute: usize,
    scalar: ScalarType,
    scale: f64,
}

/// One attribute.
#[derive(Debug, Clone)]
pub(super) struct StoredColumn {
    /// Index in the source; `None` for the particle's index.
    pub(super) attribute: Option<usize>,
    pub(super) name: String,
    pub(super) components: usize,
    pub(super) scalar: ScalarType,
    pub(super) stored: StoredType,
    /// Range of each component, for [`StoredType::Ranged`].
    pub(super) ranges: Vec<[f64; 2]>,
}

impl RadiusColumn {
    pub(super) const WIDTH: usize = size_of::<f32>();

    /// The radii of particles; `values` are their values in the source.
    #[expect(clippy::cast_possible_truncation, reason = "radii are f32 in the renderer")]
    pub(super) fn radii<'a>(&self, values: &'a [u8]) -> impl Iterator<Item = f32> + use<'a> {
        let Self { scalar, scale, .. } = *self;
        let stored = StoredType::Plain(scalar);
        let values = values.chunks_exact(scalar.size());
        values.map(move |value| (stored.value(value, [0.0; 2]) * scale) as f32)
    }
}

impl StoredColumn {
    /// Bytes of one particle in the source.
    pub(super) fn source_width(&self) -> usize {
        self.components * self.scalar.size()
    }

    /// Stored bytes of one particle.
    pub(super) fn width(&self) -> usize {
        self.components * self.stored.size()
    }

    /// Stores the values of one particle; returns the largest error.
    #[inline]
    pub(super) fn store(&self, values: &[u8], to: &mut [u8]) -> f64 {
        // Copy values that keep their type
        if self.stored == StoredType::Plain(self.scalar) {
            to.copy_from_slice(values);
            return 0.0;
        }
        // Convert the others, and measure the largest error
        let plain = StoredType::Plain(self.scalar);
        let values = values.chunks_exact(self.scalar.size());
        let mut largest = 0.0_f64;
        match self.stored {
            StoredType::Plain(_) => {
                for (value, to) in values.zip(to.chunks_exact_mut(4)) {
                    let value = plain.value(value, [0.0; 2]);
                    #[expect(clippy::cast_possible_truncation, reason = "as asked for")]
                    let single = value as f32;
                    to.copy_from_slice(&single.to_le_bytes());
                    largest = largest.max(difference(value, f64::from(single)));
                }
            }
            StoredType::Half => {
                for (value, to) in values.zip(to.chunks_exact_mut(2)) {
                    let value = plain.value(value, [0.0; 2]);
                    let half = f16::from_f64(value);
                    to.copy_from_slice(&half.to_le_bytes());
                    largest = largest.max(difference(value, half.to_f64()));
                }
            }
            StoredType::Ranged => {
                for ((value, to), range) in values.zip(to).zip(&self.ranges) {
                    let value = plain.value(value, [0.0; 2]);
                    *to = code_of(value, *range);
                    let stored = StoredType::Ranged.value(&[*to], *range);
                    largest = largest.max(difference(value, stored));
                }
            }
        }
        largest
    }

    pub(super) fn spec(&self, max_error: f64) -> AttributeSpec {
        AttributeSpec {
            name: self.name.clone(),
            components: u32::try_from(self.components).unwrap_or(u32::MAX),
            stored: self.stored,
            ranges: self.ranges.clone(),
            max_error,
        }
    }
}

/// The absolute error. Equal infinities have no error, nor has NaN that is stored as NaN.
fn difference(value: f64, stored: f64) -> f64 {
    let is_same = value == stored || value.is_nan() && stored.is_nan();
    if is_same { 0.0 } else { (value - stored).abs() }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a cast saturates")]
fn code_of(value: f64, range: [f64; 2]) -> u8 {
    let (low, step) = StoredType::ranged(range);
    if step > 0.0 { ((value - low) / step).round() as u8 } else { 0 }
}

impl StoredColumns {
    /// The columns that `settings` select from `source`.
    pub(super) fn choose(
        source: &dyn ParticleSource,
        settings: &ConvertSettings,
        path: &Path,
    ) -> Result<Self, ConvertError> {
        let attributes = source.attributes();
        check(attributes, settings, path)?;
        // Find out where the radii come from
        let radius = match settings.radius {
            RadiusRule::All(_) => None,
            RadiusRule::Source { .. } => radius_of(attributes),
        };
        let has_radius = match settings.radius {
            RadiusRule::All(_) => true,
            RadiusRule::Source { otherwise } => {
                radius.is_some() || source.common_radius().or(otherwise).is_some()
            }
        };
        // Choose how to store each attribute
        let mut columns = Vec::new();
        for (number, attribute) in attributes.iter().enumerate() {
            let stored = match settings.choice(&attribute.name) {
                AttributeChoice::AsIs => StoredType::Plain(attribute.scalar),
                AttributeChoice::Single => StoredType::Plain(ScalarType::F32),
                AttributeChoice::Half => StoredType::Half,
                AttributeChoice::Ranged => StoredType::Ranged,
                AttributeChoice::LeaveOut => continue,
            };
            // The radii are stored already.
            if has_radius && is_float(attribute) && attribute.name.eq_ignore_ascii_case(RADIUS) {
                continue;
            }
            columns.push(StoredColumn {
                attribute: Some(number),
                name: attribute.name.clone(),
                components: attribute.components,
                scalar: attribute.scalar,
                stored,
                ranges: Vec::new(),
            });
        }
        // Add the particle indices
        let has_ids = attributes.iter().any(|a| a.name.eq_ignore_ascii_case("id"));
        if settings.keep_ids && !has_ids {
            columns.push(place_column(source.count()));
        }
        Ok(Self { radius, attributes: columns })
    }

    /// Bytes of a row.
    pub(super) fn width(&self) -> usize {
        let radius = self.radius.map_or(0, |_| RadiusColumn::WIDTH);
        radius + self.attributes.iter().map(StoredColumn::width).sum::<usize>()
    }

    /// The largest number of bytes that one particle has for one attribute of the source.
    pub(super) fn widest(&self) -> usize {
        let widths = self.attributes.iter().map(StoredColumn::source_width);
        widths.chain([8]).max().unwrap_or(8)
    }
}

impl ConvertSettings {
    fn choice(&self, name: &str) -> AttributeChoice {
        let named = self.attributes.iter().find(|(n, _)| n == name);
        named.map_or(self.other_attributes, |(_, choice)| *choice)
    }
}

fn place_column(count: u64) -> StoredColumn {
    let is_short = u32::try_from(count).is_ok();
    let scalar = if is_short { ScalarType::U32 } else { ScalarType::U64 };
    StoredColumn {
        attribute: None,
        name: "id".to_owned(),
        components: 1,
        scalar,
        stored: StoredType::Plain(scalar),
        ranges: Vec::new(),
    }
}

fn is_float(attribute: &SourceAttribute) -> bool {
    let is_float = matches!(attribute.scalar, ScalarType::F32 | ScalarType::F64);
    is_float && attribute.components == 1
}

/// The attribute that holds radii, by the names that simulations and Houdini use.
fn radius_of(attributes: &[SourceAttribute]) -> Option<RadiusColumn> {
    let named = |(name, scale): (&str, f64)| {
        let is_it = |a: &SourceAttribute| is_float(a) && a.name.eq_ignore_ascii_case(name);
        let attribute = attributes.iter().position(is_it)?;
        let scalar = attributes[attribute].scalar;
        Some(RadiusColumn { attribute, scalar, scale })
    };
    RADII.into_iter().find_map(named)
}

fn check(
    attributes: &[SourceAttribute],
    settings: &ConvertSettings,
    path: &Path,
) -> Result<(), ConvertError> {
    // Check that each named attribute exists
    for (name, _) in &settings.attributes {
        if !attributes.iter().any(|a| a.name == *name) {
            let there: Vec<&str> = attributes.iter().map(|a| a.name.as_str()).collect();
            let there = if there.is_empty() {
                "there are none".to_owned()
            } else {
                format!("there are {}", there.join(", "))
            };
            let what = format!("no attribute is called {name}; {there}");
            return Err(ConvertError::refused(path, what));
        }
    }
    // Check that ids are stored without loss
    for attribute in attributes {
        let is_changed = !matches!(
            settings.choice(&attribute.name),
            AttributeChoice::AsIs | AttributeChoice::LeaveOut
        );
        if is_changed && names::is_one_of(&attribute.name, &names::ID) {
            let what = format!(
                "attribute {} holds ids, and another number is another particle; keep it as it is or leave it out",
                attribute.name
            );
            return Err(ConvertError::refused(path, what));
        }
    }
    // Check the common radius
    if let RadiusRule::All(radius) | RadiusRule::Source { otherwise: Some(radius) } =
        settings.radius
        && !is_radius(radius)
    {
        let what = format!("{radius} is not a radius; give one above zero");
        return Err(ConvertError::refused(path, what));
    }
    Ok(())
}
