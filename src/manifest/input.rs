//! `[input]`: which particles, and what they mean.

use spherule_jobs::FrameRange;

use super::named;
use super::reader::{Field, Section};
use super::schema::{name_schema, words};
use super::write::{Entries, Toml, described};

named! {
    /// Which axis of the simulation points up.
    UpAxis {
        /// +x
        X = "x",
        /// +y
        Y = "y",
        /// +z
        Z = "z",
        /// -x
        NegX = "-x",
        /// -y
        NegY = "-y",
        /// -z
        NegZ = "-z",
    }
}

impl UpAxis {
    /// As a unit vector.
    pub const fn vector(self) -> [f64; 3] {
        match self {
            Self::X => [1.0, 0.0, 0.0],
            Self::Y => [0.0, 1.0, 0.0],
            Self::Z => [0.0, 0.0, 1.0],
            Self::NegX => [-1.0, 0.0, 0.0],
            Self::NegY => [0.0, -1.0, 0.0],
            Self::NegZ => [0.0, 0.0, -1.0],
        }
    }
}

/// How large particles are.
#[derive(Debug, Clone, PartialEq)]
pub enum RadiusSetting {
    /// As the file has it, else estimated from the spacing.
    Auto,
    /// The same for all, world units.
    Length(f64),
    /// From an attribute.
    Attribute {
        /// Its name.
        attribute: String,
        /// What it is multiplied by: 0.5 for a diameter.
        scale: f64,
    },
}

/// `[input]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// One directory or pattern, or files; relative to the manifest. Never empty.
    pub path: Vec<String>,
    /// Which frames; None is all.
    pub frames: Option<FrameRange>,
    /// Names of the parts of a file (sets, blocks) to keep; None is all.
    pub parts: Option<Vec<String>>,
    /// How large particles are.
    pub radius: RadiusSetting,
    /// Which axis points up; None is what the format's users are used to: y for BGEO and
    /// SPlisHSPlasH, else z.
    pub up: Option<UpAxis>,
    /// Whether native frames are mapped, not read: false where files may be cut short while they are used.
    pub mmap: bool,
    /// Whether all that is used of native frames is compared with its checksums (true), or only the nodes
    /// (false); None goes by the size.
    pub verify: Option<bool>,
}

impl Input {
    /// All of `path`, with the defaults.
    pub fn new(path: impl Into<String>) -> Self {
        Self {
            path: vec![path.into()],
            frames: None,
            parts: None,
            radius: RadiusSetting::Auto,
            up: None,
            mmap: true,
            verify: None,
        }
    }

    pub(super) fn read(mut section: Section<'_>) -> Self {
        let path = section.optional("path", read_path);
        if section.lacks("path") {
            section.missing(
                "path",
                "a directory, a pattern as \"dump.#.vtk\", or a list of files",
            );
        }
        let input = Self {
            path: path.unwrap_or_default(),
            frames: section.value("frames", None, read_frames),
            parts: section.optional("parts", |f| names(f, "a list of names, as [\"fluid\"]")),
            radius: section.value("radius", RadiusSetting::Auto, RadiusSetting::read),
            up: section.value("up", None, read_up),
            mmap: section.value("mmap", true, Field::bool),
            verify: section.value("verify", None, read_verify),
        };
        section.finish();
        input
    }

    pub(super) fn entries(&self, out: &mut Entries) {
        out.section("input");
        out.put(
            "path",
            &Paths(&self.path),
            "a directory, a pattern (#, %04d, *), or a list of files",
        );
        // The same files may be named in many ways; jobs know them by their fingerprints.
        out.depends_on(None);
        out.put(
            "frames",
            &Frames(self.frames.as_ref()),
            "all, or a range: 7 | 1-10 | 1-10x2 | 1-5,8",
        );
        // More frames of the same job are not another job.
        out.depends_on(None);
        out.maybe(
            "parts",
            self.parts.as_ref(),
            "[\"fluid\"]",
            "sets or blocks to keep; default: all",
        );
        out.put(
            "radius",
            &self.radius,
            "a length, auto (of the file, else by the neighbours; medium: 1.8 times as large), or \
             { attribute = \"radius\", scale = 1.0 }",
        );
        out.put("up", &Up(self.up), "auto | x | y | z | -x | -y | -z");
        out.put(
            "mmap",
            &self.mmap,
            "false reads native frames where they may be cut short meanwhile",
        );
        // Neither changes the pictures.
        out.depends_on(None);
        out.put(
            "verify",
            &Verify(self.verify),
            "checksums of native frames: auto (up to 1 GiB) | true | false",
        );
        out.depends_on(None);
    }
}

#[expect(
    clippy::option_option,
    reason = "the outer one is a problem, the inner one is `auto`"
)]
fn read_verify(field: &Field<'_>) -> Option<Option<bool>> {
    if field.as_text() == Some("auto") {
        return Some(None);
    }
    field.bool().map(Some)
}

fn read_up(field: &Field<'_>) -> Option<Option<UpAxis>> {
    if field.as_text() == Some("auto") {
        return Some(None);
    }
    field.choice(UpAxis::ALL).map(Some)
}

/// One path, or a list of them.
struct Paths<'a>(&'a [String]);

impl Toml for Paths<'_> {
    fn toml(&self) -> String {
        match self.0 {
            [one] => one.toml(),
            many => many.toml(),
        }
    }
}

described!(Paths<'_>, {
    "anyOf": [name_schema(), { "type": "array", "items": name_schema(), "minItems": 1 }],
});

/// A range, or all.
struct Frames<'a>(Option<&'a FrameRange>);

impl Toml for Frames<'_> {
    fn toml(&self) -> String {
        self.0
            .map_or_else(|| "all".toml(), |range| range.to_string().toml())
    }
}

described!(Frames<'_>, {
    "anyOf": [
        { "const": "all" },
        { "type": "integer" },
        { "type": "string", "pattern": range_pattern() },
    ],
});

/// Frame ranges as a regular expression; which numbers fit and which steps arrive is beyond it.
fn range_pattern() -> String {
    let number = r"\s*-?[0-9]+\s*";
    let part = format!("{number}(-{number}([xy:]{number})?)?");
    format!("^{part}(,{part})*$")
}

/// An axis, or auto.
struct Up(Option<UpAxis>);

impl Toml for Up {
    fn toml(&self) -> String {
        self.0.map_or("auto", UpAxis::name).toml()
    }
}

described!(Up, { "enum": words(&["auto"], UpAxis::ALL) });

/// Yes, no, or auto.
struct Verify(Option<bool>);

impl Toml for Verify {
    fn toml(&self) -> String {
        self.0.map_or_else(|| "auto".toml(), |all| all.toml())
    }
}

described!(Verify, { "enum": ["auto", true, false] });

described!(RadiusSetting, {
    "anyOf": [
        { "const": "auto" },
        { "type": "number", "exclusiveMinimum": 0 },
        {
            "type": "object",
            "properties": {
                "attribute": name_schema(),
                "scale": { "type": "number", "exclusiveMinimum": 0, "default": 1.0 },
            },
            "required": ["attribute"],
            "additionalProperties": false,
        },
    ],
});

fn read_path(field: &Field<'_>) -> Option<Vec<String>> {
    if field.items().is_some() {
        names(field, "a directory, a pattern, or a list of files")
    } else {
        Some(vec![field.name()?])
    }
}

/// A list of names that is not empty.
fn names(field: &Field<'_>, what: &str) -> Option<Vec<String>> {
    let items = field.or_wants(field.items().filter(|i| !i.is_empty()), what)?;
    items.iter().map(Field::name).collect()
}

#[expect(
    clippy::option_option,
    reason = "the outer one is a problem, the inner one is `all`"
)]
fn read_frames(field: &Field<'_>) -> Option<Option<FrameRange>> {
    let text = match (field.as_text(), field.as_integer()) {
        (Some("all"), _) => return Some(None),
        (Some(text), _) => text.to_owned(),
        (None, Some(frame)) => frame.to_string(),
        (None, None) => {
            field.wants("\"all\" or a frame range, as \"1-10\"");
            return None;
        }
    };
    match text.parse() {
        Ok(range) => Some(Some(range)),
        Err(e) => {
            field.fail(&e.to_string());
            None
        }
    }
}

impl RadiusSetting {
    fn read(field: &Field<'_>) -> Option<Self> {
        if field.as_text() == Some("auto") {
            return Some(Self::Auto);
        }
        if !field.is_table() {
            let length = field.as_number().filter(|v| *v > 0.0).map(Self::Length);
            return field.or_wants(
                length,
                "a length above 0, \"auto\", or { attribute = \"radius\", scale = 1.0 }",
            );
        }
        let mut section = field.section()?;
        let attribute = section.optional("attribute", Field::name);
        let scale = section.value("scale", 1.0, |f| f.number("a number above 0", |v| v > 0.0));
        if section.lacks("attribute") {
            section.missing("attribute", "the name of an attribute, as \"radius\"");
        }
        section.finish();
        let attribute = attribute?;
        Some(Self::Attribute { attribute, scale })
    }
}

impl Toml for RadiusSetting {
    fn toml(&self) -> String {
        match self {
            Self::Auto => "auto".toml(),
            Self::Length(length) => length.toml(),
            Self::Attribute { attribute, scale } => {
                let (attribute, scale) = (attribute.toml(), scale.toml());
                format!("{{ attribute = {attribute}, scale = {scale} }}")
            }
        }
    }
}
