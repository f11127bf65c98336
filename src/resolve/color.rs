//! Colours of particles: which value they show, and through which map.

use super::ResolveError;
use super::error::{require_attribute, similar};
use crate::manifest::{ColorMapping, ColorSetting, RangeSetting, ScaleKind};
use crate::math::narrow;
use crate::pipeline::{ColorRule, attribute_list};
use crate::scene::{Camera, ColorMap, ColorScale, UnknownColorMap, material};
use crate::survey::{
    Categories, ColorQuestion, ColorRange, MAX_CATEGORIES, RangeQuestion, RgbAttribute, Survey,
    range_of,
};
use spherule_formats::ScalarType;
use spherule_frame::join::ColumnShape;
use spherule_frame::names;
use spherule_frame::values::{Value, value_names};

const ATTRIBUTE: &str = "material.color.attribute";
const SCALE: &str = "material.color.scale";

/// [`ColorMapping::threshold`] as a fraction of the largest value of the range.
const THRESHOLD: f64 = 0.01;

/// What the survey has to determine.
pub(super) fn question(setting: &ColorSetting) -> ColorQuestion<'_> {
    match setting {
        ColorSetting::Auto => ColorQuestion::Speed(RangeQuestion::default()),
        ColorSetting::Rgb(_) => ColorQuestion::None,
        ColorSetting::Mapped(by) => match &by.attribute {
            Some(name) => ColorQuestion::Value(name, range_question(by)),
            None => ColorQuestion::Speed(range_question(by)),
        },
    }
}

fn range_question(by: &ColorMapping) -> RangeQuestion {
    match (by.scale(), by.range) {
        (ScaleKind::Categorical, _) => RangeQuestion::Categories,
        (ScaleKind::Log, Some(RangeSetting::Percentiles(range))) => {
            RangeQuestion::PositivePercentiles(range)
        }
        (_, Some(RangeSetting::Percentiles(range))) => RangeQuestion::Percentiles(range),
        (ScaleKind::Log, _) => RangeQuestion::Positive,
        _ => RangeQuestion::Robust,
    }
}

/// Whether particles are coloured by their distance from the camera.
pub(super) fn is_depth(setting: &ColorSetting) -> bool {
    let ColorSetting::Mapped(by) = setting else {
        return false;
    };
    let name = by.attribute.as_deref();
    name.and_then(|name| Value::named::<ColumnShape<'_>>(name, &[])) == Some(Value::Depth)
}

/// The range of the distances of the surveyed particles from the camera, as far as they are in front of it.
fn depth_range(survey: &Survey, camera: &Camera, by: &ColorMapping) -> Option<(f64, f64)> {
    let point = |p: &[f32; 3]| f64::from(camera.depth_of((*p).into()));
    let depths = survey.points.iter().map(point);
    let visible = depths.filter(|depth| *depth > 0.0).collect();
    range_of(visible, range_question(by))
}

/// The source of the colours by a `setting`; "auto" depends on the attributes that exist. `range`: that of the values.
pub(super) fn rule(
    setting: &ColorSetting,
    range: Option<&ColorRange>,
    survey: &Survey,
    camera: Option<&Camera>,
) -> Result<ColorRule, ResolveError> {
    // Find which keys describe the mapping: constant colours and colours of the file need none
    let constant = ColorRule::Constant(material::DEFAULT_COLOR);
    let by = match setting {
        ColorSetting::Rgb(rgb) => return Ok(ColorRule::Constant(*rgb)),
        ColorSetting::Auto => match (range, &survey.rgb) {
            (Some(_), _) => &ColorMapping::default(),
            (None, Some(rgb)) => {
                return Ok(ColorRule::Rgb { name: rgb.attribute.clone(), required: false });
            }
            (None, None) => return Ok(constant),
        },
        ColorSetting::Mapped(by) => by,
    };
    // Without a name, the attribute is the one that the survey chose
    let Some(name) = &by.attribute else {
        return match range {
            Some(color) => mapped(by, color, false, false),
            None => {
                require_attribute(survey, "material.color", "velocity")?;
                Ok(constant)
            }
        };
    };
    let value = value_of(survey, name, ATTRIBUTE)?;
    require_categories(survey, by, name, SCALE)?;
    // Any other key means that vectors are mapped by their length
    let is_rgb = |rgb: &RgbAttribute| rgb.attribute.eq_ignore_ascii_case(name);
    if by.is_plain() && survey.rgb.as_ref().is_some_and(is_rgb) {
        return Ok(ColorRule::Rgb { name: name.clone(), required: true });
    }
    mapped_value(by, name, (&value, range), survey, camera)
}

/// Maps the value `name`: over the range in the survey, or for depths over that from the camera.
fn mapped_value(
    by: &ColorMapping,
    name: &str,
    (value, range): (&Value, Option<&ColorRange>),
    survey: &Survey,
    camera: Option<&Camera>,
) -> Result<ColorRule, ResolveError> {
    let mut color = range.cloned().unwrap_or_else(|| ColorRange {
        attribute: name.to_owned(),
        low: 0.0,
        high: 1.0,
        left_out: false,
        categories: None,
    });
    name.clone_into(&mut color.attribute);
    if *value == Value::Depth {
        let camera = camera.ok_or_else(|| ResolveError::Unsupported {
            key: ATTRIBUTE,
            what: "the range of depth depends on the camera".to_owned(),
        })?;
        if let Some(ends) = depth_range(survey, camera, by) {
            (color.low, color.high) = ends;
        }
    }
    mapped(by, &color, true, value.needs_geometry())
}

/// The value `name` of the particles in the survey.
///
/// # Errors
/// There is none, which is a problem of `key`.
pub(super) fn value_of(
    survey: &Survey,
    name: &str,
    key: &'static str,
) -> Result<Value, ResolveError> {
    let known = known_attributes(survey);
    let is_known = |value: &Value| *value != Value::Time || survey.largest_time.is_some();
    match Value::named(name, &known).filter(is_known) {
        Some(value) => Ok(value),
        None if survey.most_particles == 0 => Ok(Value::Magnitude(name.to_owned())),
        None => {
            let all = value_names(&known, is_known);
            Err(ResolveError::MissingAttribute {
                key,
                name: name.to_owned(),
                hint: similar(name, &all),
                has: attribute_list(all.iter().map(String::as_str)),
            })
        }
    }
}

/// Whether `name` is a column of text in the survey.
pub(super) fn is_text(survey: &Survey, name: &str) -> bool {
    names::is_one_of(name, &names::TEXTS)
        && survey.labels.keys().any(|column| column.eq_ignore_ascii_case(name))
}

/// Checks that `by` does not map text as if it were numbers.
///
/// # Errors
/// It does, which is a problem of `key`.
pub(super) fn require_categories(
    survey: &Survey,
    by: &ColorMapping,
    name: &str,
    key: &'static str,
) -> Result<(), ResolveError> {
    if by.scale() == ScaleKind::Categorical || !is_text(survey, name) {
        return Ok(());
    }
    let what = format!("`{name}` is text, which has no range; set scale = \"categorical\"");
    Err(ResolveError::Unsupported { key, what })
}

/// The attributes in the survey, whose types it does not know.
pub(super) fn known_attributes(survey: &Survey) -> Vec<ColumnShape<'_>> {
    let components = survey.components.iter().copied();
    (survey.attributes.iter())
        .zip(components.chain(std::iter::repeat(3)))
        .map(|(name, components)| ColumnShape { name, components, scalar: ScalarType::F32 })
        .collect()
}

/// Colours by a value with the range in `color`, unless `by` has another one.
pub(super) fn mapped(
    by: &ColorMapping,
    color: &ColorRange,
    required: bool,
    needs_geometry: bool,
) -> Result<ColorRule, ResolveError> {
    let map = match by.scale() {
        ScaleKind::Categorical => categories(by, color)?,
        _ => continuous(by, color)?,
    };
    Ok(ColorRule::Attribute { name: color.attribute.clone(), map, required, needs_geometry })
}

fn unknown_map(error: UnknownColorMap) -> ResolveError {
    ResolveError::Unsupported { key: "material.color.map", what: error.to_string() }
}

fn unsupported_scale(what: String) -> ResolveError {
    ResolveError::Unsupported { key: SCALE, what }
}

fn categories(by: &ColorMapping, color: &ColorRange) -> Result<ColorMap, ResolveError> {
    // Given colours need no survey
    if let Some(values) = &by.values {
        return Ok(ColorMap::of_colors(values.0.clone()));
    }
    // Find the categories, or say why there are none
    let name = &color.attribute;
    let none = Vec::new();
    let values = match &color.categories {
        Some(Categories::Values(values)) => values,
        Some(Categories::Fractional) => {
            let what = format!("`{name}` has values that are not integers; choose another scale");
            return Err(unsupported_scale(what));
        }
        Some(Categories::TooMany) => {
            let is_text = names::is_one_of(name, &names::TEXTS);
            let remedy = if is_text { "colour by another value" } else { "choose another scale" };
            let what =
                format!("`{name}` has more than {MAX_CATEGORIES} different values; {remedy}");
            return Err(unsupported_scale(what));
        }
        None => &none,
    };
    // Frames that were not surveyed may have the other categories with names
    let named = by.names.iter().flat_map(|names| names.0.iter().map(|(value, _)| *value));
    let mut all: Vec<i64> = values.iter().copied().chain(named).collect();
    all.sort_unstable();
    all.dedup();
    ColorMap::of_categories(&by.map().name(), &all).map_err(unknown_map)
}

fn continuous(by: &ColorMapping, color: &ColorRange) -> Result<ColorMap, ResolveError> {
    // Choose the ends of the map
    let range = match by.range {
        Some(RangeSetting::Values(range)) => range,
        Some(RangeSetting::Symmetric) => {
            let high = color.low.abs().max(color.high.abs());
            [-high, high]
        }
        Some(RangeSetting::Percentiles(_)) | None => [color.low, color.high],
    };
    // Choose the scale
    let scale = match by.scale() {
        ScaleKind::Linear | ScaleKind::Categorical => ColorScale::Linear,
        ScaleKind::Log => {
            // The user accepts other values by giving a range
            let is_given = matches!(by.range, Some(RangeSetting::Values(_)));
            if color.left_out && !is_given {
                return Err(unsupported_scale(format!(
                    "`{}` has values of 0 or less, which have no logarithm; give a range above 0, whose first colour \
                     they get, or set scale = \"symlog\"",
                    color.attribute
                )));
            }
            ColorScale::Log
        }
        ScaleKind::SymLog => {
            let largest = range[0].abs().max(range[1].abs());
            let usual = if largest > 0.0 { THRESHOLD * largest } else { 1.0 };
            ColorScale::SymLog { threshold: by.threshold.unwrap_or(usual) }
        }
    };
    // Make the map
    let name = by.map().name();
    let map = match scale {
        ColorScale::Linear => ColorMap::new(&name, narrow(range[0]), narrow(range[1])),
        scale => ColorMap::with_scale(&name, range, scale),
    };
    Ok(map.map_err(unknown_map)?.with_steps(by.steps))
}
