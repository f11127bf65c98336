//! Colours. They are stored as linear RGB, and may be written as sRGB: a name, hexadecimal digits, or 8-bit integers.

use glam::Vec3;
use serde_json::{Value as Json, json};
use spherule_tracer::scene::RgbEncoding;
use spherule_tree::math::narrow;

use super::color_names::COLOR_NAMES;
use super::{Fault, FlagKind, Value, list, numbers_schema};
use crate::field::Field;
use crate::key::Key;

/// Integers up to this are hardly meant as 8-bit codes, which are nearly black there.
const DARKEST_CODE: i64 = 10;

/// The range of the key is that of each component.
impl Value for Vec3 {
    const FLAG: FlagKind = FlagKind::Toml;

    fn kind(key: &Key) -> String {
        format!(
            "a colour: linear RGB{}, such as [0.6, 0.7, 0.9], or sRGB, such as \"orange\", \"#ff8000\" or [255, 128, 0]",
            key.from(0).range()
        )
    }

    fn words() -> Vec<&'static str> {
        COLOR_NAMES.iter().map(|(name, _)| *name).collect()
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        if let Some(text) = field.as_text() {
            return named_or_hex(text);
        }
        if let Some(codes) = integers(field).filter(|codes| codes.iter().any(|code| *code > 1)) {
            return from_codes(field, codes);
        }
        let color = field.as_numbers().map(|c: [f64; 3]| c.map(narrow));
        let key = key.from(0);
        let holds = |c: &[f32; 3]| c.iter().all(|c| key.holds(f64::from(*c)));
        color.filter(holds).map(Self::from_array).ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        list(self.to_array().iter().map(Value::toml))
    }

    fn schema(key: &Key) -> Json {
        let mut linear = numbers_schema(3);
        linear["items"] = f32::schema(&key.from(0));
        json!({ "anyOf": [linear, { "$ref": format!("#/$defs/{COLOR_SCHEMA}") }] })
    }
}

/// Name of [`color_schema`] in the definitions of the schema.
pub(crate) const COLOR_SCHEMA: &str = "srgb";

/// The schema of colours in sRGB.
pub(crate) fn color_schema() -> Json {
    let mut codes = numbers_schema(3);
    codes["items"] = json!({ "type": "integer", "minimum": 0, "maximum": 255 });
    json!({
        "description": "sRGB: a name of CSS, #rgb, #rrggbb, or integers from 0 to 255",
        "anyOf": [
            codes,
            { "type": "string", "pattern": "^#([0-9a-fA-F]{3}){1,2}$" },
            { "enum": Vec3::words() },
        ],
    })
}

/// A list of three integers.
fn integers(field: &Field<'_>) -> Option<[i64; 3]> {
    let items = field.items()?;
    let integers: Option<Vec<i64>> = items.iter().map(Field::as_integer).collect();
    integers?.try_into().ok()
}

/// The colour with 8-bit `codes` in sRGB.
fn from_codes(field: &Field<'_>, codes: [i64; 3]) -> Result<Vec3, Fault> {
    if let Some(wrong) = codes.iter().find(|code| !(0..=255).contains(*code)) {
        let what = format!(
            "{wrong} is not in 0 to 255, the range of integers; linear RGB has decimal points"
        );
        return Err(Fault::Because(what));
    }
    let [r, g, b] = codes;
    if codes.iter().all(|code| *code <= DARKEST_CODE) {
        let what = format!(
            "[{r}, {g}, {b}] are integers from 0 to 255, so nearly black; [{r}.0, {g}.0, {b}.0] is linear RGB"
        );
        let place = &field.node.place;
        field.problems.warn(place, &field.key, &what);
    }
    #[expect(clippy::cast_precision_loss, reason = "checked to be small")]
    let codes = codes.map(|code| code as f64);
    Ok(RgbEncoding::Srgb8.color(codes))
}

/// The colour of a name of CSS, `#rgb` or `#rrggbb`.
fn named_or_hex(text: &str) -> Result<Vec3, Fault> {
    let code = match text.strip_prefix('#') {
        Some(digits) => hex_code(digits).ok_or_else(|| {
            Fault::Because(format!(
                "invalid colour {text:?}; # needs 3 or 6 hexadecimal digits, such as \"#ff8000\""
            ))
        })?,
        None => COLOR_NAMES
            .iter()
            .find(|(name, _)| text.eq_ignore_ascii_case(name))
            .map(|(_, code)| *code)
            .ok_or(Fault::Unwanted)?,
    };
    let [_, rgb @ ..] = code.to_be_bytes();
    Ok(RgbEncoding::Srgb8.color(rgb.map(f64::from)))
}

/// The number `0xRRGGBB` of 6 hexadecimal digits, or of 3 that stand for two each.
fn hex_code(digits: &str) -> Option<u32> {
    if !digits.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return None;
    }
    let code = u32::from_str_radix(digits, 16).ok()?;
    match digits.len() {
        3 => Some(
            [code >> 8, (code >> 4) & 15, code & 15]
                .iter()
                .fold(0, |all, digit| (all << 8) | (digit * 17)),
        ),
        6 => Some(code),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{ColorSetting, Manifest};
    use spherule_tracer::scene::Background;

    fn read(text: &str) -> Result<(Manifest, Vec<String>), String> {
        let text = format!("input.path = \"a\"\n{text}");
        Manifest::parse_with_warnings(&text, Path::new("job.toml"), Vec::new())
            .map_err(|error| error.to_string())
    }

    fn background(value: &str) -> Vec3 {
        match read(&format!("render.background = {value}")).unwrap().0.render.background {
            Some(Background::Constant(color)) => color,
            other => panic!("{value}: {other:?}"),
        }
    }

    #[test]
    fn colors_are_written_in_several_ways() {
        // sRGB code 128 is 0.2158605 in linear light, 0xcc is 0.6038274 (IEC 61966-2-1).
        let orange = Vec3::new(1.0, 0.215_860_5, 0.0);
        for value in ["\"#ff8000\"", "\"#FF8000\"", "[255, 128, 0]"] {
            assert!(background(value).abs_diff_eq(orange, 1e-6), "{value}");
        }
        let pale = Vec3::new(1.0, 0.603_827_4, 0.0);
        assert!(background("\"#fc0\"").abs_diff_eq(pale, 1e-6));
        assert_eq!(background("\"white\""), Vec3::ONE);
        assert_eq!(background("\"Red\""), Vec3::X);
        assert_eq!(background("\"rebeccapurple\""), background("[102, 51, 153]"));
        // Linear as before: fractions, and integers up to 1
        assert_eq!(background("[0.5, 0.25, 1]"), Vec3::new(0.5, 0.25, 1.0));
        assert_eq!(background("[1, 0, 1]"), Vec3::new(1.0, 0.0, 1.0));
        assert_eq!(background("[2.0, 3, 0]"), Vec3::new(2.0, 3.0, 0.0));
    }

    #[test]
    fn colors_have_these_forms_everywhere() {
        let text = r##"
            [material]
            color = "steelblue"
            absorption = "#abc"
            [[material.part]]
            parts = [1]
            color = [0, 128, 255]
            [render]
            ground_color = "tan"
            background = { bottom = "white", top = [10, 20, 200] }
            [cell]
            color = "black"
            [environment]
            type = "constant"
            color = "ivory"
            [[light]]
            type = "point"
            position = [0, 0, 1]
            color = "#fff"
            [[mesh]]
            path = "a.stl"
            color = "grey"
            [[overlay]]
            type = "axes"
            color = "navy"
            [trails]
            color = "red"
            [[arrows]]
            attribute = "v"
            scale = 1.0
            color = "auto"
        "##;
        let (manifest, warnings) = read(text).unwrap();
        assert_eq!(manifest.lights[0].color, Vec3::ONE);
        assert_eq!(manifest.trails.color, ColorSetting::Rgb(Vec3::X));
        assert!(warnings.is_empty(), "{warnings:?}");
        // The stored form is linear
        let stored = manifest.to_commented_toml();
        let again = Manifest::parse(&stored, Path::new("job.toml")).unwrap();
        assert_eq!(again, manifest);
        let categories =
            "material.color = { attribute = \"type\", values = { 1 = \"red\", 2 = \"#00f\" } }";
        let (manifest, _) = read(categories).unwrap();
        let ColorSetting::Mapped(mapping) = manifest.material.color else {
            panic!("no mapping");
        };
        assert_eq!(mapping.values.unwrap().0, [(1, Vec3::X), (2, Vec3::Z)]);
    }

    #[test]
    fn impossible_colors_are_refused() {
        for (value, part) in [
            ("\"#12345\"", "invalid colour \"#12345\"; # needs 3 or 6 hexadecimal digits"),
            ("\"#ggg\"", "invalid colour"),
            ("\"#+ff\"", "invalid colour"),
            ("\"#ä\"", "invalid colour"),
            ("\"notacolour\"", "expected a colour"),
            ("\"oragne\"", "did you mean orange?"),
            ("[300, 0, 0]", "300 is not in 0 to 255"),
            ("[2, -1, 0]", "-1 is not in 0 to 255"),
            ("[255, 0]", "expected a colour"),
            ("\"\"", "expected a colour"),
        ] {
            let error = read(&format!("render.ground_color = {value}")).unwrap_err();
            assert!(error.contains(part), "{value}: {error}");
        }
        let error = read("cell.color = [0.5, 2, 0]").unwrap_err();
        assert!(error.contains("linear RGB from 0 to 1"), "{error}");
        let (_, warnings) = read("render.background = [2, 1, 1]").unwrap();
        assert!(warnings[0].contains("[2.0, 1.0, 1.0] is linear RGB"), "{warnings:?}");
    }
}
