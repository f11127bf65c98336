//! `[input]`: the particles and the interpretation of their data.

use std::ops::{Deref, DerefMut};

use serde_json::{Value as Json, json};
use spherule_jobs::FrameRange;
use spherule_tracer::scene::RadiusTable;

use super::by_integer::ByInteger;
use super::color::ELEMENT;
use super::field::Field;
use super::key::{Affects, Key};
use super::keys::section;
use super::rule::{Rule, conditions, rules};
use super::value::{Fault, FlagKind, Value, named, quoted};

named! {
    /// The axis of the simulation that points up.
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
    /// The unit vector.
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

/// Source of the radii.
#[derive(Debug, Clone, PartialEq)]
pub enum RadiusSetting {
    /// The radius of the file, or an estimate from the spacing of particles.
    Auto,
    /// One radius for all particles, world units.
    Length(f64),
    /// An attribute.
    Attribute {
        /// Its name.
        attribute: String,
        /// Factor on its values: 0.5 for a diameter.
        scale: f64,
    },
    /// By an integer attribute.
    Table {
        /// Its name.
        attribute: String,
        /// The radii.
        table: RadiusTable,
        /// Factor on them.
        scale: f64,
    },
}

/// The word for the radii of the file, or an estimate.
const AUTO: &str = "auto";

/// Rules between the keys of a table of radii.
pub(super) const RULES: &[Rule] = rules! {
    "table" Given => "values" Missing: "the radii are in `table`; leave one of the two out";
    "table" Missing => "attribute" Given: "the name of an attribute, such as \"radius\"";
};

/// Words for radii of elements.
const TABLES: [(&str, RadiusTable); 2] =
    [("vdw", RadiusTable::VanDerWaals), ("covalent", RadiusTable::Covalent)];

section! {
    /// Particles to render, and the interpretation of their data
    Input {
        /// A directory, a pattern (#, %04d, *), or a list of files
        path: Paths = Paths::default(), affects(Affects::Nothing),
            required("a directory, a pattern as \"dump.#.vtk\", or a list of files");
        /// Frames to render: 7 | 1-10 | 1-10x2 | 1-5,8
        ///
        /// 10-1 has the same frames as 1-10, from the last to the first.
        frames: Option<FrameRange> = None, or("all"), affects(Affects::Nothing), flag("frames", "RANGE", "Input");
        /// Render one frame so many times, with the numbers from 0, for a camera that moves
        ///
        /// It is the middle one; name its file to have another. --turntable 36 sets it with a camera that goes around once.
        repeat: Option<u32> = None, from(1), to(100_000), affects(Affects::Nothing), example("36"), unset("all frames once");
        /// Parts to keep if frames consist of several files or blocks: fluid,oil
        ///
        /// Case does not matter, and a fragment of a name is enough.
        parts: Option<Vec<String>> = None, example("[\"fluid\"]"), unset("all"), flag("parts", "LIST", "Input");
        /// Read files outside the directory of a list of files, such as a .pvd, that names them
        ///
        /// Without it, a list may only name files in its own directory and in those below.
        follow_links: bool = false, affects(Affects::Nothing), flag("follow-links", "", "Input");
        /// Read the vertices of meshes (PLY with faces) as particles
        ///
        /// Without it, a mesh is refused, since its vertices are a surface. --mesh draws the surface.
        mesh_points: bool = false, flag("mesh-points", "", "Input");
        /// File with the properties of the atoms of a trajectory: .gro, .pdb, .psf or other
        ///
        /// Elements and other attributes that do not change are added to all frames. Atoms are joined by `id` if both
        /// files have it; otherwise the file has as many atoms as the frames, in the same order.
        topology: Option<String> = None, example("\"conf.gro\""), unset("none"), flag("topology", "FILE", "Input");
        /// Particle radius: a length, auto, or { attribute = "radius", scale = 1.0 }
        ///
        /// `auto` takes the radius from the files. Without one, it is half the typical distance between neighbours
        /// for spheres, an estimate from the particle density for smooth, and 1.8 times this estimate for union.
        /// `vdw` and `covalent` are the radii of chemical elements; { table = "vdw", scale = 0.25 } makes them smaller.
        /// { attribute = "type", values = { 1 = 0.5, 2 = 0.7 } } has a radius for each type.
        radius: RadiusSetting = RadiusSetting::Auto, flag("radius", "RADIUS", "Input");
        /// Axis that points up: x, y, z, -x, -y, -z, or auto
        ///
        /// `auto` is y for files of Houdini and SPlisHSPlasH, what USD files say, and z for all others. To set the camera itself, use
        /// --set with camera.eye, camera.look_at, camera.fov or camera.mode.
        up: Option<UpAxis> = None, or("auto"), flag("up", "UP", "Camera");
        /// Whether native frames are mapped into memory; --no-mmap reads them
        ///
        /// Reading is for files that another program may truncate during the render.
        mmap: bool = true, affects(Affects::Nothing), flag("no-mmap", "", "Input");
        /// Verify the checksums of native frames: auto (up to 1 GiB) | true | false
        verify: Option<bool> = None, or("auto"), affects(Affects::Nothing);
    }
}

impl Input {
    /// All frames at `path`, with default settings.
    pub fn new(path: impl Into<String>) -> Self {
        Self { path: Paths(vec![path.into()]), ..Self::default() }
    }
}

/// One path or a list of paths; not empty in a manifest that was read.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Paths(pub Vec<String>);

impl Deref for Paths {
    type Target = Vec<String>;

    fn deref(&self) -> &Vec<String> {
        &self.0
    }
}

impl DerefMut for Paths {
    fn deref_mut(&mut self) -> &mut Vec<String> {
        &mut self.0
    }
}

impl Value for Paths {
    fn kind(_: &Key) -> String {
        "a directory, a pattern, or a list of files".to_owned()
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        match field.items() {
            Some(items) if items.is_empty() => Err(Fault::Unwanted),
            Some(_) => Vec::parse(field, key).map(Self),
            None => match field.as_text().filter(|text| !text.trim().is_empty()) {
                Some(path) => Ok(Self(vec![path.to_owned()])),
                None => field.value::<String>(key).map(|path| Self(vec![path])).ok_or(Fault::Noted),
            },
        }
    }

    fn toml(&self) -> String {
        match &self[..] {
            [one] => one.toml(),
            _ => self.0.toml(),
        }
    }

    fn schema(key: &Key) -> Json {
        json!({ "anyOf": [String::schema(key), <Vec<String>>::schema(key)] })
    }
}

impl Value for RadiusSetting {
    const FLAG: FlagKind = FlagKind::NumberOrText;

    fn kind(_: &Key) -> String {
        "a length above 0, \"auto\", \"vdw\", \"covalent\", or { attribute = \"radius\", scale = 1.0 }".to_owned()
    }

    fn words() -> Vec<&'static str> {
        let tables = TABLES.iter().map(|(word, _)| *word);
        [AUTO].into_iter().chain(tables).collect()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        // Words and lengths come without a table
        match field.as_text() {
            Some(AUTO) => return Ok(Self::Auto),
            Some(word) => {
                let table = table_named(word).ok_or(Fault::Unwanted)?;
                return Ok(Self::of_elements(table));
            }
            None => {}
        }
        let Some(mut section) = field.as_table() else {
            let length = field.as_number().filter(|v| *v > 0.0);
            return length.map(Self::Length).ok_or(Fault::Unwanted);
        };
        // Read the table; with radii by value, the attribute has a usual name
        let mut attribute = None::<String>;
        let (mut scale, mut table, mut values) = (1.0, None::<TableName>, None::<ByInteger<f64>>);
        section.read(&Key::new("table", &[]), &mut table);
        section.read(&Key::new("values", &[]), &mut values);
        section.read(&Key::new("attribute", &[]), &mut attribute);
        section.read(&Key::new("scale", &[]).above(0), &mut scale);
        section.check(RULES);
        section.finish();
        // Choose between values and their names
        let table = table.and_then(|TableName(word)| table_named(word));
        let values = values.map(|values| RadiusTable::Values(values.0));
        let name = |usual: &str| attribute.clone().unwrap_or_else(|| usual.to_owned());
        Ok(match table.or(values) {
            Some(table) => Self::Table { attribute: name(ELEMENT), table, scale },
            None => Self::Attribute { attribute: name(""), scale },
        })
    }

    fn toml(&self) -> String {
        let (attribute, table, scale) = match self {
            Self::Auto => return quoted(AUTO),
            Self::Length(length) => return length.toml(),
            Self::Attribute { attribute, scale } => (attribute, None, scale),
            Self::Table { attribute, table, scale } => (attribute, Some(table), scale),
        };
        let word = TABLES.iter().find(|(_, known)| Some(known) == table);
        let table = match (word, table) {
            (Some((word, _)), _) if attribute == ELEMENT && *scale == 1.0 => return quoted(word),
            (Some((word, _)), _) => format!("table = {}, ", quoted(word)),
            (None, Some(RadiusTable::Values(values))) => {
                format!("values = {}, ", ByInteger(values.clone()).toml())
            }
            (None, _) => String::new(),
        };
        let (attribute, scale) = (attribute.toml(), scale.toml());
        format!("{{ attribute = {attribute}, {table}scale = {scale} }}")
    }

    fn schema(key: &Key) -> Json {
        let scale = json!({ "type": "number", "exclusiveMinimum": 0, "default": 1.0 });
        json!({ "anyOf": [
            { "enum": Self::words() },
            { "type": "number", "exclusiveMinimum": 0 },
            {
                "type": "object",
                "properties": {
                    "attribute": String::schema(key),
                    "table": TableName::schema(key),
                    "values": <ByInteger<f64>>::schema(key),
                    "scale": scale,
                },
                "allOf": conditions(RULES),
                "additionalProperties": false,
            },
        ] })
    }
}

impl RadiusSetting {
    /// The radii of elements in `table`.
    pub fn of_elements(table: RadiusTable) -> Self {
        Self::Table { attribute: ELEMENT.to_owned(), table, scale: 1.0 }
    }
}

fn table_named(word: &str) -> Option<RadiusTable> {
    let found = TABLES.iter().find(|(known, _)| *known == word);
    found.map(|(_, table)| table.clone())
}

/// The word for a table of radii.
#[derive(Debug, Clone, Copy, PartialEq)]
struct TableName(&'static str);

impl Value for TableName {
    fn kind(_: &Key) -> String {
        format!("one of {}", Self::words().join(", "))
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let mut words = Self::words().into_iter();
        let found = words.find(|word| field.as_text() == Some(word));
        found.map(Self).ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        quoted(self.0)
    }

    fn schema(_: &Key) -> Json {
        json!({ "enum": Self::words() })
    }

    fn words() -> Vec<&'static str> {
        TABLES.iter().map(|(word, _)| *word).collect()
    }
}
