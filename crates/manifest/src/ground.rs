//! `render.ground`: the kind of ground.

use glam::DVec3;
use serde_json::{Value as Json, json};

use super::field::Field;
use super::key::Key;
use super::reader::Section;
use super::rule::{Rule, conditions, rules};
use super::value::{Fault, FlagKind, Named, Value, named, quoted};

named! {
    /// Kinds of ground.
    GroundKind {
        /// No ground.
        None = "none",
        /// A plane of one colour, or with the pattern of `render.ground_pattern`.
        Plain = "plain",
        /// A plane with squares, every other one darker.
        Checker = "checker",
        /// An invisible plane: only shadows on it are visible.
        ShadowCatcher = "shadow_catcher",
        /// A plane with a picture.
        Image = "image",
    }
}

/// The setting: a name, alone or as the `type` of a table; `true` is a plain ground, `false` is none.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundSetting {
    /// The kind of ground.
    pub kind: GroundKind,
    /// The picture, only of [`GroundKind::Image`].
    pub image: Option<GroundImage>,
}

/// A picture on the ground.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundImage {
    /// The file.
    pub path: String,
    /// Its width; by default about the diagonal of the box of the particles.
    pub width: Option<f64>,
    /// A point above its centre, in world units; by default the centre of the particles.
    pub center: Option<DVec3>,
    /// Rotation, counterclockwise as seen from above, degrees.
    pub rotation: f64,
    /// Whether it is repeated.
    pub repeats: bool,
}

impl GroundImage {
    /// The picture at `path`, repeated.
    pub fn new(path: impl Into<String>) -> Self {
        Self { path: path.into(), width: None, center: None, rotation: 0.0, repeats: true }
    }

    /// Its keys with values, without the path.
    fn pairs(&self) -> impl Iterator<Item = String> {
        let width = self.width.map(|width| format!("width = {}", width.toml()));
        let center = self.center.map(|c| format!("center = {}", c.toml()));
        let others = [
            format!("rotation = {}", self.rotation.toml()),
            format!("repeat = {}", self.repeats.toml()),
        ];
        width.into_iter().chain(center).chain(others)
    }
}

impl GroundSetting {
    /// A ground without a picture.
    pub const fn of(kind: GroundKind) -> Self {
        Self { kind, image: None }
    }

    /// As TOML, with or without the path of a picture.
    fn text(&self, has_path: bool) -> String {
        let kind = match self.kind {
            // As older versions wrote it, if they knew it
            GroundKind::None => "false".to_owned(),
            GroundKind::Plain => "true".to_owned(),
            other => quoted(other.name()),
        };
        let Some(image) = &self.image else {
            return kind;
        };
        let path = has_path.then(|| format!("image = {}", image.path.toml()));
        let pairs: Vec<String> = path.into_iter().chain(image.pairs()).collect();
        format!("{{ type = {kind}, {} }}", pairs.join(", "))
    }
}

/// Rules between the keys of a table.
pub(super) const RULES: &[Rule] = rules! {
    "type" Is["image"] => "image" Given: "type = \"image\" needs a file, such as \"floor.png\"";
    "type" IsNot["image"] => "image", "width", "center", "rotation", "repeat" Missing:
        "is given, but only type = \"image\" uses it";
};

fn width_key() -> Key {
    Key::new("width", &[]).unit("a length").above(0).single()
}

/// The remedy for a picture without a file.
const NEEDS_FILE: &str =
    "needs a file: { type = \"image\", image = \"floor.png\" }, or [render.ground] with these keys";

/// Reads a table.
fn parse_table(section: &mut Section<'_>) -> GroundSetting {
    let mut kind = GroundKind::None;
    let key = Key::new("type", &[]).required("the kind of ground, such as \"shadow_catcher\"");
    section.read(&key, &mut kind);
    let mut image = GroundImage::new("");
    section.read(&Key::new("image", &[]), &mut image.path);
    section.read(&width_key(), &mut image.width);
    section.read(&Key::new("center", &[]), &mut image.center);
    section.read(&Key::new("rotation", &[]).unit("degrees"), &mut image.rotation);
    section.read(&Key::new("repeat", &[]), &mut image.repeats);
    section.check(RULES);
    GroundSetting { kind, image: (kind == GroundKind::Image).then_some(image) }
}

impl Value for GroundSetting {
    const FLAG: FlagKind = FlagKind::SwitchOrText(GroundKind::Plain.name());

    fn kind(_: &Key) -> String {
        format!("true, false or one of {}", GroundKind::words().join(", "))
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        if let Some(is_on) = field.as_bool() {
            return Ok(Self::of(if is_on { GroundKind::Plain } else { GroundKind::None }));
        }
        let Some(mut section) = field.as_table() else {
            let kind = GroundKind::parse(field, key)?;
            return match kind {
                GroundKind::Image => Err(Fault::Because(NEEDS_FILE.to_owned())),
                kind => Ok(Self::of(kind)),
            };
        };
        let setting = parse_table(&mut section);
        section.finish();
        Ok(setting)
    }

    fn toml(&self) -> String {
        self.text(true)
    }

    /// Without the path of a picture: a job may be moved together with it, and its content has a fingerprint.
    fn setting(&self) -> String {
        self.text(false)
    }

    fn schema(key: &Key) -> Json {
        // An image needs a file, so that its word alone is not enough
        let kind = GroundKind::schema(key);
        let kinds = GroundKind::words().into_iter();
        let without_file: Vec<&str> = kinds.filter(|w| *w != GroundKind::Image.name()).collect();
        json!({ "anyOf": [
            { "type": "boolean" },
            { "enum": without_file },
            {
                "type": "object",
                "properties": {
                    "type": kind,
                    "image": String::schema(key),
                    "width": f64::schema(&width_key()),
                    "center": DVec3::schema(key),
                    "rotation": f64::schema(&Key::new("rotation", &[])),
                    "repeat": bool::schema(key),
                },
                "required": ["type"],
                "additionalProperties": false,
                "allOf": conditions(RULES),
            },
        ] })
    }

    fn words() -> Vec<&'static str> {
        let kinds = GroundKind::names().into_iter().map(|(_, name)| name);
        kinds.chain(bool::words()).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Manifest;

    #[test]
    fn a_ground_is_switched_named_or_a_table() {
        let kind = |setting: &str| {
            let text = format!("input.path = \"a\"\n{setting}");
            let manifest = Manifest::parse(&text, Path::new("job.toml"));
            manifest.map(|manifest| manifest.render.ground.map(|ground| ground.kind))
        };
        for (setting, wanted) in [
            ("", None),
            ("render.ground = \"auto\"", None),
            ("render.ground = false", Some(GroundKind::None)),
            ("render.ground = true", Some(GroundKind::Plain)),
            ("render.ground = \"none\"", Some(GroundKind::None)),
            ("render.ground = \"checker\"", Some(GroundKind::Checker)),
            ("[render.ground]\ntype = \"shadow_catcher\"", Some(GroundKind::ShadowCatcher)),
        ] {
            assert_eq!(kind(setting), Ok(wanted), "{setting}");
        }
        for (setting, part) in [
            ("render.ground = 1", "expected true, false or one of none"),
            ("render.ground = \"shadowcatcher\"", "did you mean shadow_catcher?"),
            ("[render.ground]\nkind = 1", "render.ground.type: is missing"),
            ("[render.ground]\ntype = 1", "expected one of none"),
            ("render.ground = \"image\"", "render.ground: needs a file: { type"),
            ("[render.ground]\ntype = \"image\"", "render.ground.image: is missing"),
            (
                "render.ground = { type = \"image\", image = \"a.png\", width = 0 }",
                "render.ground.width: expected a length above 0",
            ),
            (
                "render.ground = { type = \"checker\", repeat = true }",
                "render.ground.repeat: is given, but only type = \"image\" uses it",
            ),
        ] {
            let error = kind(setting).unwrap_err().to_string();
            assert!(error.contains(part), "{setting}: {error}");
        }
    }

    #[test]
    fn pictures_are_written_as_they_were_read() {
        let read = |text: &str| {
            let text = format!("input.path = \"a\"\n{text}");
            let manifest = Manifest::parse(&text, Path::new("job.toml")).unwrap();
            manifest.render.ground.unwrap()
        };
        let plain = read("[render.ground]\ntype = \"image\"\nimage = \"a.png\"");
        assert_eq!(plain.image, Some(GroundImage::new("a.png")));
        let all = read(
            "render.ground = { type = \"image\", image = \"b/c.exr\", width = 2, center = [1, 2, 3], rotation = 30, \
             repeat = false }",
        );
        for setting in [plain, all] {
            assert_eq!(read(&format!("render.ground = {}", setting.toml())), setting);
            assert!(!setting.setting().contains("image ="), "{}", setting.setting());
        }
    }
}
