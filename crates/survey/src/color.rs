//! The range of the values that colour particles, over the sampled frames.

use std::collections::BTreeSet;

use glam::DVec3;
use serde::{Deserialize, Serialize};
use spherule_formats::{ParticleFrame, Radius};
use spherule_frame::values::{Context, Value};

use super::RadiusQuestion;
use super::robust::{percentile, robust_range, sorted_sample};

/// Largest number of categories.
pub const MAX_CATEGORIES: usize = 64;

/// What a job needs to know about colours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ColorQuestion<'a> {
    /// No attribute is needed.
    None,
    /// The velocity if there is one, otherwise an attribute with colours if there is one.
    Speed(RangeQuestion),
    /// This value: see [`Value::named`].
    Value(&'a str, RangeQuestion),
}

/// The kind of range.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum RangeQuestion {
    /// The middle 99 % of the values, from zero for magnitudes of vectors.
    #[default]
    Robust,
    /// The middle 99 % of the values above 0.
    Positive,
    /// Between these percentiles.
    Percentiles([f64; 2]),
    /// Between these percentiles of the values above 0.
    PositivePercentiles([f64; 2]),
    /// All values, which are integers.
    Categories,
}

/// A value and its range for a colour map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ColorRange {
    /// Name of the value.
    pub attribute: String,
    /// Value at the start of the map.
    pub low: f64,
    /// Value at the end of the map.
    pub high: f64,
    /// Whether values of 0 or less were left out of a range that must be above 0.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub left_out: bool,
    /// The values if they are categories, rising.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub categories: Option<Categories>,
}

/// Values of categories.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Categories {
    /// These integers, rising.
    Values(Vec<i64>),
    /// A value is no integer.
    Fractional,
    /// There are more than [`MAX_CATEGORIES`].
    TooMany,
}

/// The range of `values`; None without any, or for categories.
pub fn range_of(mut values: Vec<f64>, question: RangeQuestion) -> Option<(f64, f64)> {
    values.sort_unstable_by(f64::total_cmp);
    match question {
        RangeQuestion::Robust | RangeQuestion::Positive => robust_range(&values),
        RangeQuestion::Percentiles([low, high])
        | RangeQuestion::PositivePercentiles([low, high]) => {
            percentile(&values, low).zip(percentile(&values, high))
        }
        RangeQuestion::Categories => None,
    }
}

/// Totals over the frames.
#[derive(Debug, Default)]
pub(super) struct ColorTotals {
    name: Option<String>,
    range: Option<(f64, f64)>,
    /// Samples of all frames, for percentiles.
    pool: Vec<f64>,
    left_out: bool,
    categories: BTreeSet<i64>,
    is_fractional: bool,
    /// Whether the particles were those of a style, and a frame had none of them.
    pub(super) was_empty: bool,
}

/// What values need beside the particles.
#[derive(Clone, Copy)]
pub(super) struct FrameContext<'a> {
    pub(super) frame: &'a ParticleFrame,
    /// Particle count of the frame, which may be sampled.
    pub(super) count: usize,
    /// Origin of the positions.
    pub(super) origin: DVec3,
    pub(super) up: DVec3,
    pub(super) radius: RadiusQuestion<'a>,
}

impl Context for FrameContext<'_> {
    fn position(&self, particle: usize) -> DVec3 {
        self.origin + self.frame.positions[particle].as_dvec3()
    }

    fn radius(&self, particle: usize) -> f64 {
        match (self.radius, &self.frame.radius) {
            (question @ (RadiusQuestion::Attribute(..) | RadiusQuestion::Table(..)), _) => {
                question.radius_by_attribute(&self.frame.attributes, particle).unwrap_or(f64::NAN)
            }
            (_, Some(Radius::PerParticle(radii))) => radii[particle].into(),
            (_, Some(Radius::Common(radius))) => (*radius).into(),
            (_, None) => f64::NAN,
        }
    }

    fn up(&self) -> DVec3 {
        self.up
    }

    fn time(&self) -> f64 {
        self.frame.time.unwrap_or(f64::NAN)
    }
}

impl ColorTotals {
    pub(super) fn add(
        &mut self,
        velocity: Option<&str>,
        question: ColorQuestion,
        context: FrameContext<'_>,
    ) {
        let (name, range) = match question {
            ColorQuestion::None => return,
            ColorQuestion::Speed(range) => (velocity, range),
            ColorQuestion::Value(name, range) => (Some(name), range),
        };
        let Some(name) = name else { return };
        self.name = Some(name.to_owned());
        let frame = context.frame;
        let value = Value::named(name, &frame.attributes)
            .and_then(|value| value.bind(|name| frame.attribute(name)));
        let Some(value) = value else { return };
        let is_length = value.is_length();
        let (count, value): (usize, &dyn Fn(usize) -> f64) = match value {
            // It depends on the camera, which is placed later
            Value::Depth => return,
            // The frame may be sampled, without its last index
            #[expect(clippy::cast_precision_loss, reason = "a range of colours")]
            Value::Index => (2, &|i| (i * context.count.saturating_sub(1)) as f64),
            Value::Time => (frame.len().min(1), &|i| value.get(i, &context)),
            _ => (frame.len(), &|i| value.get(i, &context)),
        };
        self.add_values(count, value, range, is_length);
    }

    fn add_values(
        &mut self,
        count: usize,
        value: impl Fn(usize) -> f64,
        question: RangeQuestion,
        is_length: bool,
    ) {
        if question == RangeQuestion::Categories {
            return self.add_categories((0..count).map(value));
        }
        // Leave out what the scale cannot show
        let mut values = sorted_sample(count, value);
        let is_positive =
            matches!(question, RangeQuestion::Positive | RangeQuestion::PositivePercentiles(_));
        if is_positive {
            let below = values.partition_point(|value| *value <= 0.0);
            self.left_out |= below > 0;
            values.drain(..below);
        }
        // Pool the values for percentiles of all frames, or join the ranges of frames
        match question {
            RangeQuestion::Percentiles(_) | RangeQuestion::PositivePercentiles(_) => {
                self.pool.append(&mut values);
            }
            _ => {
                if let Some((lowest, high)) = robust_range(&values) {
                    let low = if is_length && !is_positive { 0.0 } else { lowest };
                    let (a, b) = self.range.unwrap_or((low, high));
                    self.range = Some((a.min(low), b.max(high)));
                }
            }
        }
    }

    fn add_categories(&mut self, values: impl Iterator<Item = f64>) {
        let mut last = f64::NAN;
        for value in values.filter(|value| value.is_finite()) {
            // Neighbours often have the same value
            if value == last {
                continue;
            }
            last = value;
            if value.fract() != 0.0 {
                self.is_fractional = true;
                return;
            }
            #[expect(clippy::cast_possible_truncation, reason = "an integer, or saturated")]
            self.categories.insert(value as i64);
            if self.categories.len() > MAX_CATEGORIES {
                return;
            }
        }
    }

    pub(super) fn finish(self, question: ColorQuestion) -> Option<ColorRange> {
        let attribute = self.name?;
        // Those of a style may have been in no frame
        if self.was_empty
            && self.range.is_none()
            && self.pool.is_empty()
            && self.categories.is_empty()
        {
            return None;
        }
        let range = match question {
            ColorQuestion::None => RangeQuestion::Robust,
            ColorQuestion::Speed(range) | ColorQuestion::Value(_, range) => range,
        };
        let found = match range {
            RangeQuestion::Percentiles(_) | RangeQuestion::PositivePercentiles(_) => {
                range_of(self.pool, range)
            }
            _ => self.range,
        };
        let (low, high) = found.unwrap_or((0.0, 1.0));
        let categories = (range == RangeQuestion::Categories).then_some(match self.categories {
            _ if self.is_fractional => Categories::Fractional,
            all if all.len() > MAX_CATEGORIES => Categories::TooMany,
            all => Categories::Values(all.into_iter().collect()),
        });
        Some(ColorRange { attribute, low, high, left_out: self.left_out, categories })
    }
}
