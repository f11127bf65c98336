//! Styles that rules add: grains, and walls around the others.

use toml::{Table, Value};

use crate::manifest::{ManifestSource, Override};

/// The key of styles.
pub(super) const STYLE: &str = "style";

/// Colour of walls in a plane, linear RGB: a light grey, beside which colours stand out.
const GREY: f64 = 0.55;

/// All particles, with their own shapes.
pub(super) fn grains() -> Table {
    table([("draw", "grains".into())])
}

/// The particles for which `condition` holds, as glass behind everything else.
pub(super) fn glass(condition: &str) -> Table {
    let material = table([("type", "thin-glass".into()), ("underlay", true.into())]);
    table([
        ("where", condition.into()),
        ("draw", "smooth".into()),
        ("material", Value::Table(material)),
    ])
}

/// The particles for which `condition` holds, as grey spheres.
pub(super) fn grey(condition: &str) -> Table {
    table([("where", condition.into()), ("color", vec![Value::from(GREY); 3].into())])
}

fn table<const N: usize>(pairs: [(&str, Value); N]) -> Table {
    pairs.map(|(key, value)| (key.to_owned(), value)).into_iter().collect()
}

/// The `style` as a setting.
pub(super) fn layer(style: Table, shown: &str) -> Option<Override> {
    Override::append(STYLE, style, shown).ok()
}

/// The style in the `planned` settings of a job if a rule has added it, and there is no other.
pub(super) fn planned(planned: &[(String, String)]) -> Option<Table> {
    let own: Vec<_> = planned.iter().filter(|setting| is_of_style(setting)).collect();
    let condition = own.iter().find(|(key, _)| key == "style.0.where");
    let condition = condition.and_then(|(_, text)| value(text));
    let condition = condition.as_ref().and_then(Value::as_str).unwrap_or_default();
    [grains(), glass(condition), grey(condition)].into_iter().find(|style| {
        let settings = settings_of(style.clone());
        !settings.is_empty() && settings.iter().eq(own.iter().copied())
    })
}

/// What the plan of a job has of this style alone; nothing if its condition is none.
fn settings_of(style: Table) -> Vec<(String, String)> {
    let source = ManifestSource::new("input.path = \"any\"", "".as_ref(), Vec::new());
    let alone = source.parse_over(layer(style, "").into_iter().collect());
    let settings = alone.map(|manifest| manifest.settings()).unwrap_or_default();
    settings.into_iter().filter(is_of_style).collect()
}

fn is_of_style((key, _): &(String, String)) -> bool {
    key.strip_prefix(STYLE).is_some_and(|rest| rest.starts_with('.'))
}

/// A value that was written as TOML.
pub(super) fn value(text: &str) -> Option<Value> {
    let mut table: Table = format!("value = {text}").parse().ok()?;
    table.remove("value")
}
