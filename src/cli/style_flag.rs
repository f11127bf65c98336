//! The option `--style`: a style in one line.

use spherule_formats::ValueError;
use toml::{Table, Value};

/// Settings of `material` that may stand beside it, those of glass and water first.
const MATERIAL_KEYS: [&str; 8] = [
    "ior",
    "absorption",
    "absorption_length",
    "scattering",
    "scattering_length",
    "anisotropy",
    "roughness",
    "underlay",
];
/// Number of those of glass and water.
const OPTICS: usize = 6;

/// The table `[[style]]` of `type == 2: sticks, radius 0.3, color red`.
pub(super) fn style(text: &str) -> Result<Table, ValueError> {
    let expected = "a condition, how its particles are drawn, and settings, such as 'type == 2: sticks, radius 0.3, color \
                    red'; without a condition, ': hidden' is for all others; the looks of pictures are --look paper and others";
    table(text).ok_or_else(|| ValueError::new(expected, text))
}

fn table(text: &str) -> Option<Table> {
    let colon = outside(text, ':').next()?;
    let (condition, rest) = (text[..colon].trim(), &text[colon + 1..]);
    let mut table = Table::new();
    if !condition.is_empty() {
        table.insert("where".to_owned(), condition.into());
    }
    // Settings are separated by commas, except in brackets
    let mut start = 0;
    let ends: Vec<usize> = outside(rest, ',').chain([rest.len()]).collect();
    for (number, end) in ends.into_iter().enumerate() {
        let item = rest[start..end].trim();
        start = end + 1;
        match item.split_once(|c: char| c.is_whitespace() || c == '=') {
            None if number == 0 && !item.is_empty() => {
                table.insert("draw".to_owned(), item.into());
            }
            Some((key, value)) => {
                let value = value.trim().trim_start_matches('=').trim();
                table.insert(key.replace('-', "_"), setting(key, value));
            }
            None => return None,
        }
    }
    gather_material(&mut table);
    Some(table)
}

/// Moves settings of the material into its table. A material with optics and no type is that of water.
fn gather_material(table: &mut Table) {
    let own: Vec<(String, Value)> = MATERIAL_KEYS
        .into_iter()
        .filter_map(|key| Some((key.to_owned(), table.remove(key)?)))
        .collect();
    let Some((first, _)) = own.first() else {
        return;
    };
    let mut usual = Table::new();
    if MATERIAL_KEYS[..OPTICS].contains(&&**first) {
        usual.insert("type".to_owned(), "water".into());
    }
    let material = table.entry("material").or_insert_with(|| usual.into());
    if let Value::Table(material) = material {
        material.extend(own);
    }
}

/// The value of a setting: TOML, or text without quotes.
fn setting(key: &str, text: &str) -> Value {
    let parsed = toml::from_str::<Table>(&format!("value = {text}"));
    let value = parsed.ok().and_then(|mut table| table.remove("value"));
    match value {
        Some(value) => value,
        None if key == "material" => {
            let mut material = Table::new();
            material.insert("type".to_owned(), text.into());
            material.into()
        }
        None => text.into(),
    }
}

/// The places of `separator` in `text` outside brackets and quotes.
fn outside(text: &str, separator: char) -> impl Iterator<Item = usize> {
    let (mut depth, mut quote) = (0_i32, None);
    text.char_indices().filter_map(move |(place, c)| {
        match (quote, c) {
            (Some(open), _) if c == open => quote = None,
            (Some(_), _) => {}
            (None, '\'' | '"') => quote = Some(c),
            (None, '[' | '{' | '(') => depth += 1,
            (None, ']' | '}' | ')') => depth -= 1,
            (None, _) if c == separator && depth == 0 => return Some(place),
            _ => {}
        }
        None
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_style_fits_into_one_line() {
        let found = style("type == 2: sticks, radius 0.3, color red").unwrap();
        let expected = "where = \"type == 2\"\ndraw = \"sticks\"\nradius = 0.3\ncolor = \"red\"";
        assert_eq!(found, toml::from_str::<Table>(expected).unwrap());
        let found =
            style("part == 'a:b, c': spheres, color [1, 0, 0], material glass, range=[0, 2]");
        let expected = "where = \"part == 'a:b, c'\"\ndraw = \"spheres\"\ncolor = [1, 0, 0]\n\
                        material = { type = \"glass\" }\nrange = [0, 2]";
        assert_eq!(found.unwrap(), toml::from_str::<Table>(expected).unwrap());
        assert_eq!(style(": hidden").unwrap(), toml::from_str("draw = \"hidden\"").unwrap());
        // Settings of the material
        let found = style("type == 2: smooth, scattering white, scattering-length 0.1").unwrap();
        let expected = "where = \"type == 2\"\ndraw = \"smooth\"\n\
                        material = { type = \"water\", scattering = \"white\", scattering_length = 0.1 }";
        assert_eq!(found, toml::from_str::<Table>(expected).unwrap());
        let found = style("type == 2: smooth, ior 1.47, absorption [0.9, 0.7, 0.2]");
        let expected = "where = \"type == 2\"\ndraw = \"smooth\"\n\
                        material = { type = \"water\", ior = 1.47, absorption = [0.9, 0.7, 0.2] }";
        assert_eq!(found.unwrap(), toml::from_str::<Table>(expected).unwrap());
        let found = style(": union, roughness 0.2, material glass");
        let expected = "draw = \"union\"\nmaterial = { type = \"glass\", roughness = 0.2 }";
        assert_eq!(found.unwrap(), toml::from_str::<Table>(expected).unwrap());
    }

    #[test]
    fn other_texts_are_refused() {
        for text in ["", "type == 2", "type == 2:", "type == 2: spheres, red"] {
            assert!(style(text).is_err(), "{text}");
        }
    }
}
