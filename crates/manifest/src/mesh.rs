//! `[[mesh]]`: triangle meshes next to the particles, such as tanks and obstacles.

use std::fmt;
use std::path::PathBuf;

use glam::{DVec3, Vec3};
use serde_json::{Value as Json, json};
use spherule_surface::mesh::VisibleFaces;

use super::field::Field;
use super::key::{Affects, Key};
use super::keys::{Keys, keys};
use super::pattern::FramePattern;
use super::rule::{Rule, rules};
use super::value::{Fault, Value, named, quoted};

pub(super) const ABOUT: &[&str] =
    &["Triangle meshes next to the particles: STL, OBJ, PLY, VTK, VTP and VTU files"];

named!(VisibleFaces: Both = "both", Front = "front", Back = "back");

named! {
    /// Materials of meshes.
    MeshMaterial {
        /// Light leaves in all directions alike.
        Matte = "matte",
        /// A matte base under a clear coat.
        Plastic = "plastic",
        /// A mirror in the base colour.
        Metal = "metal",
        /// Thin panes of glass.
        Glass = "glass",
    }
}

named! {
    /// Normals that shade meshes.
    MeshShading {
        /// Means of the normals of adjacent triangles, except at edges.
        Smooth = "smooth",
        /// The normals of the triangles.
        Flat = "flat",
    }
}

/// Default roughness of plastic and metal, as for particles.
const ROUGHNESS: f32 = 0.55;

/// The file of a mesh, or a pattern with the frame number for one file per frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MeshPath(FramePattern);

impl MeshPath {
    /// Parses a path.
    ///
    /// # Errors
    /// It names no file, or its placeholder for the frame number is invalid.
    pub fn parse(text: &str) -> Result<Self, String> {
        let pattern = FramePattern::parse(text, "walls.####.stl")?;
        if pattern.file_name().is_empty() {
            return Err("must name a file (example: tank.stl)".to_owned());
        }
        Ok(Self(pattern))
    }

    /// The path as it was written.
    pub fn as_str(&self) -> &str {
        self.0.as_str()
    }

    /// Whether each frame has a separate file.
    pub const fn has_number(&self) -> bool {
        self.0.has_number()
    }

    /// The file of `frame`.
    pub fn path_for(&self, frame: i64) -> PathBuf {
        self.0.path_for(frame)
    }
}

impl fmt::Display for MeshPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl Value for MeshPath {
    fn kind(_: &Key) -> String {
        "a file name in quotes".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let text = field.as_text().ok_or(Fault::Unwanted)?;
        Self::parse(text).map_err(Fault::Because)
    }

    fn toml(&self) -> String {
        quoted(self.as_str())
    }

    fn schema(_: &Key) -> Json {
        json!({ "type": "string", "pattern": r"[^/\\]$" })
    }

    /// Only the file name: a job may be moved together with its meshes, whose contents have fingerprints.
    fn setting(&self) -> String {
        quoted(self.0.file_name())
    }
}

/// One `[[mesh]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    /// The file.
    pub path: MeshPath,
    /// The material.
    pub material: MeshMaterial,
    /// Base colour, or transmittance of glass, linear RGB; by default light grey, and clear glass.
    pub color: Option<Vec3>,
    /// Roughness of plastic and metal, 0 to 1.
    pub roughness: f32,
    /// The normals for shading.
    pub normals: MeshShading,
    /// The visible faces.
    pub faces: VisibleFaces,
    /// Factor on the coordinates of the file.
    pub scale: f64,
    /// Translation after scaling.
    pub translate: DVec3,
    /// Whether it only hides what is behind it.
    pub holdout: bool,
}

impl Default for Mesh {
    fn default() -> Self {
        Self {
            path: MeshPath::parse("tank.stl").expect("a file"),
            material: MeshMaterial::Matte,
            color: None,
            roughness: ROUGHNESS,
            normals: MeshShading::Smooth,
            faces: VisibleFaces::Both,
            scale: 1.0,
            translate: DVec3::ZERO,
            holdout: false,
        }
    }
}

/// Rules between the keys.
pub(super) const RULES: &[Rule] = rules! {
    "material" Is["glass"] => "holdout" MissingOr["false"]:
        "hides what is behind the mesh, which glass does not; choose another material";
};

impl Mesh {
    pub(super) fn keys(&mut self, keys: &mut Keys<'_>) {
        keys!(keys:
            /// File of the mesh; with #### or %04d for the frame number, each frame has its own
            path => self.path, example("\"tank.stl\""),
                required("a mesh needs its file, such as \"tank.stl\"");
            /// Material: matte | plastic | metal | glass
            ///
            /// Glass is thin: each surface of the mesh is a whole pane, which light passes in a straight line. The
            /// walls of a tank are single surfaces then. With integrator = "whitted", glass does not reflect, and all
            /// others are matte.
            material => self.material;
            /// Colour, linear RGB; of glass, the part of the light that passes
            color => self.color, from(0), to(1), example("[0.6, 0.6, 0.6]"), unset("light grey, and clear glass");
            /// Roughness of plastic and metal, 0 (a mirror) to 1
            roughness => self.roughness, from(0), to(1), affects(Affects::PathTracing);
            /// Normals for shading: smooth (but for edges of more than 40 degrees) | flat
            normals => self.normals;
            /// Visible faces: both | front | back; back shows the inside of a closed tank
            ///
            /// The front of a triangle is the side from which its vertices are counterclockwise.
            faces => self.faces;
            /// Factor on the coordinates of the file, for another unit
            scale => self.scale, above(0), single();
            /// Translation in the unit of the particles, after scaling
            translate => self.translate;
            /// Hide what is behind the mesh, and leave a hole in A: for a body that is composited later
            ///
            /// The camera sees black with A = 0. The mesh still throws shadows and reflects light.
            holdout => self.holdout;
        );
        if let Some(section) = keys.reading() {
            section.check(RULES);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{Manifest, Override};

    fn read(text: &str) -> Result<Vec<Mesh>, String> {
        let text = format!("input.path = \"a\"\n{text}");
        let manifest = Manifest::parse(&text, Path::new("job.toml"));
        manifest.map(|manifest| manifest.meshes).map_err(|e| e.to_string())
    }

    #[test]
    fn meshes_have_defaults() {
        assert_eq!(read("").unwrap(), []);
        let meshes = read("[[mesh]]\npath = \"tank.stl\"").unwrap();
        assert_eq!(meshes, [Mesh::default()]);
        let text = "[[mesh]]\npath = \"a/w.%04d.obj\"\nmaterial = \"glass\"\nfaces = \"back\"\nnormals = \"flat\"
            scale = 0.001\ntranslate = [1, 2, 3]\n[[mesh]]\npath = \"b.vtk\"\nholdout = true";
        let meshes = read(text).unwrap();
        assert_eq!(meshes[0].path.path_for(7), Path::new("a/w.0007.obj"));
        assert!(meshes[0].path.has_number() && !meshes[1].path.has_number());
        assert_eq!(meshes[0].translate, DVec3::new(1.0, 2.0, 3.0));
        assert!(meshes[1].holdout);
    }

    #[test]
    fn impossible_meshes_are_refused() {
        for (text, part) in [
            ("[[mesh]]", "mesh.0.path: is missing; a mesh needs its file"),
            ("[[mesh]]\npath = \"\"", "mesh.0.path: must name a file"),
            ("[[mesh]]\npath = \"walls/\"", "mesh.0.path: must name a file"),
            ("[[mesh]]\npath = \"w.##.##.stl\"", "two numbers"),
            ("[[mesh]]\npath = \"##/w.stl\"", "not a directory's"),
            ("[[mesh]]\npath = 1", "mesh.0.path: expected a file name in quotes"),
            ("[[mesh]]\npath = \"a.stl\"\nscale = 0", "mesh.0.scale: expected"),
            ("[[mesh]]\npath = \"a.stl\"\ncolor = [2.0, 0, 0]", "mesh.0.color: expected"),
            ("[[mesh]]\npath = \"a.stl\"\nmaterial = \"gold\"", "matte, plastic, metal, glass"),
            (
                "[[mesh]]\npath = \"a.stl\"\nmaterial = \"glass\"\nholdout = true",
                "mesh.0.holdout: hides what is behind",
            ),
            ("mesh = \"a.stl\"", "mesh: expected a list of tables, such as [[mesh]]"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
        let many = "[[mesh]]\npath = \"a.stl\"\n".repeat(65_534);
        let error = read(&many).unwrap_err();
        assert!(error.contains("mesh: 65534 meshes"), "{error}");
        assert!(error.contains("at most 65533 are possible"), "{error}");
    }

    #[test]
    fn options_append_meshes() {
        let parse = |text: &str, paths: &[&str]| {
            let append = |path: &&str| {
                let table = toml::Table::from_iter([("path".to_owned(), (*path).into())]);
                Override::append("mesh", table, "--mesh").unwrap()
            };
            let text = format!("input.path = \"a\"\n{text}");
            let overrides = paths.iter().map(append).collect();
            Manifest::parse_with(&text, Path::new("job.toml"), overrides)
        };
        let meshes = parse("[[mesh]]\npath = \"a.stl\"", &["b.stl", "c.#.stl"]).unwrap().meshes;
        let paths: Vec<&str> = meshes.iter().map(|mesh| mesh.path.as_str()).collect();
        assert_eq!(paths, ["a.stl", "b.stl", "c.#.stl"]);
        assert_eq!(parse("", &["b.stl"]).unwrap().meshes.len(), 1);
        let error = parse("mesh = 3", &["b.stl"]).unwrap_err().to_string();
        assert!(error.contains("--mesh: mesh: expected a list, found 3"), "{error}");
        let error = parse("", &["##.##.stl"]).unwrap_err().to_string();
        assert!(error.starts_with("--mesh: mesh.0.path: "), "{error}");
    }
}
