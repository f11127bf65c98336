//! Defaults that follow from what the files say: colours and radii of elements, categories, walls, cells, floors, flat
//! data. Each rule gives settings under those of the manifest and its look, so that naming a key overrides it, and a
//! line that says what it did. `docs/manual/defaults.md` lists the rules.

use glam::DVec3;
use spherule_formats::sequence::PART_ATTRIBUTE;
use toml::Value;

use crate::manifest::{
    CameraMode, ColorSetting, Look, Manifest, ManifestSource, Override, ProjectionKind,
};
use crate::render::IntegratorKind;
use crate::surface::SurfaceKind;
use crate::survey::{Category, ELEMENT, Facts, WallSign, WallValues};

mod legend;
mod parts;
mod planned;

pub use parts::{Walls, walls};
pub use planned::planned;

/// The keys that rules set, except overlays. A job that goes on has the values of its plan.
const KEYS: [&str; 18] = [
    "input.radius",
    "input.up",
    "input.parts",
    "select.where",
    "camera.projection",
    "camera.view",
    "camera.azimuth",
    "camera.elevation",
    "camera.fov",
    "render.background",
    "render.ground",
    "render.integrator",
    COLOR,
    "material.ambient",
    "material.diffuse",
    "material.specular",
    "cell.visible",
    "bonds.find",
];

/// The key of the colours of particles.
const COLOR: &str = "material.color";

/// The colour of particles without elements, categories, colours and velocities, linear RGB: light, so that shading shows
/// their form.
const NEUTRAL: [f64; 3] = [0.42, 0.47, 0.54];

/// Vertical field of view in degrees. A long lens keeps parallel edges nearly parallel.
const FOV: f64 = 25.0;

/// The side from which cells are seen, degrees: three faces show, and their edges remain nearly upright.
const CELL_VIEW: [f64; 2] = [20.0, 12.0];

/// A cell is drawn if the particles extend along at least this part of two of its edges, as in a crystal, a liquid or a
/// slab; in a larger one they would be small.
const FILLED: f64 = 0.7;

/// The part of the particles that must be in a cell that is drawn: those of a molecule that was made whole, or moved, are
/// not.
const INSIDE: f64 = 0.9;

/// What the rules chose.
#[derive(Debug, Clone, Default)]
pub struct Defaults {
    /// The settings.
    pub settings: Vec<Override>,
    /// A line for the user for each rule that has something to say.
    pub lines: Vec<String>,
}

/// Applies the rules to a manifest.
struct Rules<'a> {
    manifest: &'a Manifest,
    source: &'a ManifestSource,
    facts: &'a Facts,
    files: Files<'a>,
    found: Defaults,
}

/// What the files say beside the facts of a frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct Files<'a> {
    /// Names of the parts of a step, by the numbers in the attribute `part`.
    pub parts: &'a [String],
    /// Whether y is up, and not z.
    pub is_y_up: bool,
}

/// The rules that act on particles with these `facts` from `files`, for the manifest that `source` gives.
pub fn rules(
    manifest: &Manifest,
    source: &ManifestSource,
    facts: &Facts,
    files: Files<'_>,
) -> Defaults {
    let mut rules = Rules { manifest, source, facts, files, found: Defaults::default() };
    if matches!(manifest.look, Look::None | Look::Whitted) || facts.particles == 0 {
        return rules.found;
    }
    rules.up();
    rules.lone();
    rules.random();
    let has_left_out = rules.leave_out();
    rules.elements();
    rules.categories(has_left_out);
    rules.scalar();
    rules.neutral();
    rules.cell();
    rules.floor();
    rules.flat();
    if rules.is_white() {
        rules.white();
    }
    rules.overlays();
    rules.found
}

impl Rules<'_> {
    /// Whether neither the manifest nor a rule so far gives a value of `key`.
    fn lacks(&self, key: &str) -> bool {
        self.source.lacks(key) && !self.has_set(key)
    }

    /// Whether a rule so far gives a value of `key`, or one in the table `key`.
    fn has_set(&self, key: &str) -> bool {
        self.found.settings.iter().any(|setting| setting.is_in(key))
    }

    /// Sets those of the keys that are missing. The `line` is said if there is one.
    fn set<const N: usize>(&mut self, settings: [(&str, Value); N], line: Option<String>) {
        let free = settings.into_iter().filter(|(key, _)| self.lacks(key));
        let settings: Vec<Override> = free
            .filter_map(|(key, value)| Override::new(key, value, "the defaults").ok())
            .collect();
        if !settings.is_empty() {
            self.found.settings.extend(settings);
            self.found.lines.extend(line);
        }
    }

    /// Whether the picture is in front of white.
    fn is_white(&self) -> bool {
        let is_own = matches!(self.manifest.look, Look::Auto | Look::Plain | Look::Paper);
        is_own && self.manifest.integrator() == IntegratorKind::Path
    }

    /// Leaves out virtual sites and walls. Whether there are walls, and they are left out.
    fn leave_out(&mut self) -> bool {
        let mut has_left_out = false;
        if self.facts.elements.is_some_and(|elements| elements.has_others) {
            let line = "left out: virtual sites and other particles that are not atoms (--where 'element >= 0' \
                        shows them)";
            self.set(
                [("select.where", "element >= 1 && element <= 118".into())],
                Some(line.to_owned()),
            );
        }
        let is_molecular = self.facts.elements.is_some() || self.is_periodic();
        // Parts with names are walls by these alone
        let has_names = |c: &&Category| c.name == PART_ATTRIBUTE && self.files.parts.len() > 1;
        let mut all = self.facts.categories.iter().filter(|c| !has_names(c));
        let found = all.find_map(|c| Some((c, c.walls.as_ref()?)));
        if let Some((Category { name, .. }, walls)) = found.filter(|_| !is_molecular) {
            let WallValues { values, sign } = walls;
            let all: Vec<String> = values.iter().map(|v| format!("{name} != {v}")).collect();
            let texts: Vec<String> = values.iter().map(i64::to_string).collect();
            let why = match sign {
                WallSign::Code(kind) => format!("walls by the codes of {kind}"),
                WallSign::Rest => "which rest around the others".to_owned(),
                WallSign::Around => "which surround the others".to_owned(),
            };
            let line = format!(
                "left out: particles with {name} {}, {why} (--where '{name} >= {}' shows them)",
                texts.join(", "),
                values.first().copied().unwrap_or_default()
            );
            has_left_out = self.lacks("select.where");
            self.set([("select.where", all.join(" && ").into())], Some(line));
        }
        has_left_out
    }

    /// Elements have their colours and radii, and the bonds of the file are drawn.
    fn elements(&mut self) {
        if self.facts.has_bonds {
            let line = "bonds of the file are drawn (--bonds none leaves them out)";
            self.set([("bonds.find", "file".into())], Some(line.to_owned()));
        }
        if self.facts.elements.is_none() {
            return;
        }
        let has_bonds = self.facts.has_bonds && self.source.lacks("bonds.find");
        let covalent = |scale: f64| -> Value {
            let keys = [("table", Value::from("covalent")), ("scale", scale.into())]
                .map(|(key, value)| (key.to_owned(), value));
            toml::Table::from_iter(keys).into()
        };
        let is_solid = self.facts.elements.is_some_and(|elements| elements.is_solid);
        let (radius, name) = if has_bonds {
            (covalent(0.5), "half their covalent radii")
        } else if is_solid {
            (covalent(1.0), "their covalent radii")
        } else {
            ("vdw".into(), "their van der Waals radii")
        };
        if self.has_open_colors() {
            let line = "elements have their usual colours (--color-by gives others)";
            self.set(
                [
                    ("material.color.attribute", ELEMENT.into()),
                    ("material.color.map", "jmol".into()),
                    ("material.color.scale", "categorical".into()),
                ],
                Some(line.to_owned()),
            );
        }
        if !self.facts.has_radii {
            let line = format!("elements have {name} (--radius gives another)");
            self.set([("input.radius", radius)], Some(line));
        }
    }

    /// Few integers are categories.
    fn categories(&mut self, has_left_out: bool) {
        let values = |category: &Category| {
            if has_left_out { category.without_walls.len() } else { category.values.len() }
        };
        let Some(category) = self.facts.categories.iter().find(|c| values(c) > 1) else {
            return;
        };
        if self.facts.elements.is_none() && !self.facts.has_colors && self.has_open_colors() {
            let line = format!(
                "coloured by `{}`, {} categories (--color-by gives another value)",
                category.name,
                values(category)
            );
            self.set(
                [
                    ("material.color.attribute", category.name.clone().into()),
                    ("material.color.scale", "categorical".into()),
                ],
                Some(line),
            );
            if category.name == PART_ATTRIBUTE && self.files.parts.len() > 1 {
                let names: toml::Table = self
                    .files
                    .parts
                    .iter()
                    .enumerate()
                    .map(|(number, name)| (number.to_string(), name.clone().into()))
                    .filter(|(number, _)| category.values.iter().any(|v| v.to_string() == *number))
                    .collect();
                self.set([("material.color.names", names.into())], None);
            }
        }
    }

    /// Whether no value or colour is given for the particles; a map may be.
    fn has_open_colors(&self) -> bool {
        match &self.manifest.material.color {
            ColorSetting::Auto => self.lacks(COLOR),
            ColorSetting::Mapped(by) => by.attribute.is_none(),
            ColorSetting::Rgb(_) => false,
        }
    }

    /// Particles at one place have no spacing.
    fn lone(&mut self) {
        let is_point = self.facts.bounds.is_some_and(|(min, max)| min == max);
        let has_size = self.facts.has_radii || self.facts.elements.is_some();
        if is_point && !has_size && !self.draws_a_body() {
            let line =
                "radius 1, as particles at one place have no spacing (--radius gives another)";
            self.set([("input.radius", 1.0.into())], Some(line.to_owned()));
        }
    }

    /// Particles at random distances have the radius that follows from their density.
    fn random(&mut self) {
        let is_open = self.facts.elements.is_none() && self.facts.flat_axis().is_none();
        if let Some(radius) = self.facts.random_radius.filter(|_| is_open && !self.draws_a_body()) {
            let radius = three_digits(radius);
            let line = format!(
                "radius {radius}, from the density, as the particles are at random distances (--radius gives another)"
            );
            self.set([("input.radius", radius.into())], Some(line));
        }
    }

    /// Whether the particles are drawn as one body.
    fn draws_a_body(&self) -> bool {
        self.manifest.surface.kind != SurfaceKind::Spheres
    }

    /// Which way is up, where neither the format nor the user says it.
    fn up(&mut self) {
        if self.facts.is_y_up
            && !self.files.is_y_up
            && self.facts.elements.is_none()
            && !self.is_periodic()
        {
            let line =
                "up is y: the particles lie on a plane at the lower end of the y axis (--up z)";
            self.set([("input.up", "y".into())], Some(line.to_owned()));
        }
    }

    /// Particles without velocities have the colours of a scalar.
    fn scalar(&mut self) {
        let facts = self.facts;
        let is_open = !facts.has_velocities && !facts.has_colors && self.has_open_colors();
        let name = facts.scalar.as_ref().filter(|_| is_open && !self.has_set(COLOR));
        if let Some(name) = name {
            let line = format!("coloured by `{name}` (--color-by gives another value)");
            self.set([("material.color.attribute", name.clone().into())], Some(line));
        }
    }

    /// Particles without values for colours have a neutral one.
    fn neutral(&mut self) {
        if !self.facts.has_velocities && !self.facts.has_colors {
            let color = NEUTRAL.map(Value::from).to_vec();
            self.set([(COLOR, color.into())], None);
        }
    }

    fn is_periodic(&self) -> bool {
        let cell = self.facts.cell.as_ref();
        cell.is_some_and(|cell| cell.periodic.contains(&true))
    }

    /// A simulation cell is drawn without perspective.
    fn cell(&mut self) {
        let filled = self.facts.cell_extent.iter().filter(|part| **part >= FILLED).count();
        if self.facts.cell.is_none() || filled < 2 || self.facts.in_cell < INSIDE {
            return;
        }
        let line =
            "the simulation cell of the file is drawn (--set cell.visible=false leaves it out)";
        self.set([("cell.visible", true.into())], Some(line.to_owned()));
        if self.is_placed_automatically() && self.facts.flat_axis().is_none() {
            let [azimuth, elevation] = CELL_VIEW;
            if self.lacks("camera.view") {
                self.set(
                    [("camera.azimuth", azimuth.into()), ("camera.elevation", elevation.into())],
                    None,
                );
            }
            let line = "drawn without perspective (--projection perspective)";
            self.set([("camera.projection", "orthographic".into())], Some(line.to_owned()));
        }
    }

    /// Molecules and periodic cells stand on nothing.
    fn floor(&mut self) {
        if self.facts.elements.is_some() || self.is_periodic() {
            self.set([("render.ground", "none".into())], None);
        }
    }

    /// White behind the particles, and a long lens.
    fn white(&mut self) {
        let white: Value = vec![Value::from(1.0); 3].into();
        self.set([("render.background", white)], None);
        if self.is_placed_automatically()
            && self.manifest.camera.projection == ProjectionKind::Perspective
            && !self.has_set("camera.projection")
        {
            self.set([("camera.fov", FOV.into())], None);
        }
    }

    fn is_placed_automatically(&self) -> bool {
        matches!(self.manifest.camera.mode, CameraMode::Auto | CameraMode::Turntable)
    }

    /// Two-dimensional data are seen from the front, in flat light.
    fn flat(&mut self) {
        let (Some(axis), true) = (self.facts.flat_axis(), self.is_placed_automatically()) else {
            return;
        };
        let is_y_up = self.files.is_y_up || self.has_set("input.up");
        let usual = if is_y_up { DVec3::Y } else { DVec3::Z };
        let own = self.manifest.input.up.map(|up| DVec3::from_array(up.vector()));
        let side = side_along(axis, own.unwrap_or(usual));
        if self.lacks("camera.azimuth") && self.lacks("camera.elevation") {
            self.set([("camera.view", side.into())], None);
        }
        // Atoms are told apart by their shading, and so are particles of one colour
        let is_lit = self.facts.elements.is_some() || !self.has_mapped_colors();
        let light = if is_lit { "" } else { " in flat light" };
        let line = format!(
            "the particles lie in a plane: seen from the {side}{light} (--view and --integrator path give others)"
        );
        self.set(
            [("camera.projection", "orthographic".into()), ("render.ground", "none".into())],
            Some(line),
        );
        if is_lit {
            return;
        }
        if self.is_white() && self.lacks("render.integrator") && self.has_plain_material() {
            self.set(
                [
                    ("render.integrator", "whitted".into()),
                    ("material.ambient", 1.0.into()),
                    ("material.diffuse", 0.0.into()),
                    ("material.specular", 0.0.into()),
                ],
                None,
            );
        }
    }

    /// Whether nothing of the material but its colour is given.
    fn has_plain_material(&self) -> bool {
        let mut plain = Manifest::new("").material;
        plain.color.clone_from(&self.manifest.material.color);
        plain == self.manifest.material
    }

    /// Whether the colours are those of a map.
    fn has_mapped_colors(&self) -> bool {
        match &self.manifest.material.color {
            ColorSetting::Rgb(_) => false,
            ColorSetting::Mapped(_) => true,
            ColorSetting::Auto => {
                self.has_set("material.color.attribute") || self.facts.has_velocities
            }
        }
    }
}

/// A positive number with three significant digits.
fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// The side from which a plane without extent along `axis` is seen.
fn side_along(axis: usize, up: DVec3) -> &'static str {
    if up[axis] != 0.0 {
        return "top";
    }
    // The front looks along y if z is up, and along z if y is up
    let front = if up.y != 0.0 { 2 } else { 1 };
    if axis == front { "front" } else { "right" }
}

#[cfg(test)]
mod tests;
