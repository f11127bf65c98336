//! Defaults that follow from what the files say: colours and radii of elements, categories, walls, cells, floors, flat
//! data. Each rule gives settings under those of the manifest and its look, so that naming a key overrides it, and a
//! line that says what it did. `docs/manual/defaults.md` lists the rules.

use glam::DVec3;
use spherule_formats::read::bead_name;
use spherule_formats::sequence::PART_ATTRIBUTE;
use spherule_formats::{ValueNames, element_symbol};
use toml::Value;

use crate::manifest::{
    ColorSetting, Look, Manifest, ManifestSource, Override, ProjectionKind, Style,
};
use crate::render::IntegratorKind;
use crate::scene::ColorMap;
use crate::survey::{BEAD, Category, ELEMENT, Facts};

mod legend;
mod planned;
mod radius;
mod shapes;
mod style;
mod view;
mod walls;

pub use planned::planned;
pub use walls::{Walls, walls};

/// The keys that rules set, except overlays. A job that goes on has the values of its plan.
const KEYS: [&str; 20] = [
    "input.radius",
    "input.up",
    "input.parts",
    "select.where",
    "camera.projection",
    "camera.fit",
    "camera.up",
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

/// The colours of elements, and those with white atoms that can be seen in front of white.
const ELEMENTS: &str = ColorMap::ELEMENTS;
const ON_WHITE: &str = ColorMap::ELEMENTS_ON_WHITE;

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

/// The least extent of particles along each edge of a cell without periodic boundaries that is drawn.
const LEAST_FILLED: f64 = 0.4;

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
    /// Which of them are walls. The facts are those of the others.
    pub walls: Option<&'a Walls>,
    /// Names behind the numbers of other attributes.
    pub names: &'a [ValueNames],
    /// Whether y is up, and not z.
    pub is_y_up: bool,
    /// Whether the particles are atoms or groups of them in files of this format.
    pub is_molecular: bool,
}

/// The rules that act on particles with these `facts` from `files`, for the manifest that `source` gives.
pub fn rules(
    manifest: &Manifest,
    source: &ManifestSource,
    facts: &Facts,
    files: Files<'_>,
) -> Defaults {
    let mut rules = Rules { manifest, source, facts, files, found: Defaults::default() };
    rules.texts();
    if matches!(manifest.look, Look::None | Look::Whitted) || facts.particles == 0 {
        return rules.found;
    }
    // The order matters: later rules see what earlier ones have set
    rules.up();
    rules.shapes();
    rules.grains();
    rules.lone();
    rules.sheet();
    rules.random();
    rules.leave_out();
    let has_walls = rules.walls();
    rules.elements();
    rules.categories(has_walls);
    rules.scalar();
    rules.neutral();
    rules.cell();
    rules.ground();
    rules.molecule();
    rules.flat();
    rules.tails();
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

    /// Leaves out virtual sites, and water that hides other molecules.
    fn leave_out(&mut self) {
        let (mut conditions, mut lines) = (Vec::new(), Vec::new());
        if self.facts.elements.is_some_and(|elements| elements.has_others) {
            conditions.push("element >= 1 && element <= 118".to_owned());
            let line = "left out: virtual sites and other particles that are not atoms (--where 'element >= 0' \
                        shows them)";
            lines.push(line.to_owned());
        }
        // Who has styles says what is drawn
        let water = self.facts.hiding_water.join(", ");
        if !water.is_empty() && self.manifest.styles.is_empty() {
            conditions.push(format!("!(residue_name in ({water}))"));
            lines.push(format!(
                "left out: water, which hides the other molecules (--where 'index >= 0' shows it, \
                 --style 'residue_name in ({water}): spheres, opacity 0.1' draws it clear)"
            ));
        }
        if !conditions.is_empty() && self.lacks("select.where") {
            self.set([("select.where", conditions.join(" && ").into())], None);
            self.found.lines.extend(lines);
        }
    }

    /// Elements have their colours and radii, and the bonds of the file are drawn.
    fn elements(&mut self) {
        // Draw the bonds that the file has
        if self.facts.has_bonds {
            let line = "bonds of the file are drawn (--bonds none leaves them out)";
            self.set([("bonds.find", "file".into())], Some(line.to_owned()));
        }
        // Say why beads do not look like atoms
        if self.facts.has_beads {
            let line = "the particles are beads: neighbours are farther apart than atoms (--color-by element --radius \
                        vdw draws atoms)";
            self.found.lines.push(line.to_owned());
        }
        if self.facts.elements.is_none() {
            return;
        }
        // Choose the radii
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
        // Set colours and radii, as far as nothing else does
        if self.has_open_colors() {
            let line = "elements have their usual colours (--color-by gives others)";
            self.set(
                [
                    ("material.color.attribute", ELEMENT.into()),
                    (
                        "material.color.map",
                        if self.is_white() { ON_WHITE } else { ELEMENTS }.into(),
                    ),
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

    /// Text that colours particles has categories: its numbers mean nothing.
    fn texts(&mut self) {
        let ColorSetting::Mapped(by) = &self.manifest.material.color else {
            return;
        };
        let mut texts = self.facts.texts.iter();
        let is_text = |name: &String| texts.any(|text| text.eq_ignore_ascii_case(name));
        if by.values.is_none() && by.attribute.as_ref().is_some_and(is_text) {
            self.set([("material.color.scale", "categorical".into())], None);
        }
    }

    /// Few integers are categories.
    fn categories(&mut self, has_walls: bool) {
        // Choose the category that says most
        let values = |category: &Category| {
            if has_walls { category.without_walls.len() } else { category.values.len() }
        };
        // Numbers of beads that are no elements mean nothing without their names
        let has_meaning = |c: &&Category| !self.facts.has_beads || c.name != ELEMENT;
        let mut all = self.facts.categories.iter().filter(has_meaning);
        // What rests beside one kind that moves needs no colour of its own: speed says more
        let is_moving = |value: &&i64, c: &Category| !c.resting.contains(value);
        let tells = |c: &&Category| {
            let moving = c.without_walls.iter().filter(|value| is_moving(value, c)).count();
            values(c) > 1 && (c.resting.is_empty() || moving != 1)
        };
        let Some(category) = all.find(tells) else {
            return;
        };
        // Colour by it, with its names
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
            let names = self.names_of(category);
            if !names.is_empty() {
                self.set([("material.color.names", names.into())], None);
            }
        }
    }

    /// The names of the values of `category` that the files give.
    fn names_of(&self, category: &Category) -> toml::Table {
        let name = |value: i64| -> Option<String> {
            if category.name == PART_ATTRIBUTE && self.files.parts.len() > 1 {
                return self.files.parts.get(usize::try_from(value).ok()?).cloned();
            }
            if category.name == BEAD {
                return bead_name(value).map(str::to_owned);
            }
            let mut all = self.files.names.iter();
            let names = all.find(|names| names.attribute.eq_ignore_ascii_case(&category.name))?;
            let known = names.names.iter().find(|(known, _)| *known == value);
            known.map(|(_, name)| name.clone()).or_else(|| {
                element_symbol(value).filter(|_| category.name == ELEMENT).map(str::to_owned)
            })
        };
        let named = category.values.iter().filter_map(|value| Some((*value, name(*value)?)));
        named.map(|(value, name)| (value.to_string(), name.into())).collect()
    }

    /// Whether no value or colour is given for the particles; a map may be.
    fn has_open_colors(&self) -> bool {
        match &self.manifest.material.color {
            ColorSetting::Auto => self.lacks(COLOR),
            ColorSetting::Mapped(by) => by.attribute.is_none(),
            ColorSetting::Rgb(_) => false,
        }
    }

    /// Which way is up, where neither the format nor the user says it.
    fn up(&mut self) {
        let is_open = !self.files.is_y_up && !self.is_molecular() && !self.is_periodic();
        if let Some(up) = self.facts.up.filter(|_| is_open) {
            let names = [(DVec3::X, "x"), (DVec3::NEG_X, "-x"), (DVec3::NEG_Y, "-y")];
            let name = names.iter().find(|(axis, _)| *axis == up).map_or("y", |(_, name)| name);
            let end = if name.starts_with('-') { "upper" } else { "lower" };
            let axis = name.trim_start_matches('-');
            let line = format!(
                "up is {name}: the particles lie on a plane at the {end} end of the {axis} axis (--up z)"
            );
            self.set([("input.up", name.into())], Some(line));
        }
    }

    /// Particles without velocities have the colours of a scalar.
    fn scalar(&mut self) {
        let facts = self.facts;
        let says_more = !facts.has_velocities || facts.has_even_speed;
        let is_open = says_more && !facts.has_colors && self.has_open_colors();
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

    /// Whether the particles are atoms, or groups of them.
    fn is_molecular(&self) -> bool {
        self.facts.elements.is_some() || self.facts.has_beads
    }

    fn is_periodic(&self) -> bool {
        let cell = self.facts.cell.as_ref();
        cell.is_some_and(|cell| cell.periodic.contains(&true))
    }

    /// Whether the boundaries in the plane of flat data are periodic.
    fn is_periodic_in_plane(&self) -> bool {
        let flat = self.facts.flat_axis();
        let periodic = self.facts.cell.as_ref().map_or([false; 3], |cell| cell.periodic);
        (0..3).all(|axis| Some(axis) == flat || periodic[axis])
    }

    /// A simulation cell is drawn without perspective.
    // Decide whether the cell shows where the particles are
    fn cell(&mut self) {
        let extent = self.facts.cell_extent;
        let filled = extent.iter().filter(|part| **part >= FILLED).count();
        // A box of walls may be much larger than what has come to rest in it
        let is_empty = !self.is_periodic() && extent.iter().any(|part| *part < LEAST_FILLED);
        // A cloud without an end is framed without its outer parts, and walls around a plane say where its sides are
        let is_walled = self.facts.flat_axis().is_some() && !self.is_periodic_in_plane();
        let is_needless = is_empty || is_walled || self.facts.has_heavy_tails;
        if self.facts.cell.is_none() || filled < 2 || self.facts.in_cell < INSIDE || is_needless {
            return;
        }
        let line =
            "the simulation cell of the file is drawn (--set cell.visible=false leaves it out)";
        self.set([("cell.visible", true.into())], Some(line.to_owned()));
        // Look at it without perspective, from a side that shows its depth
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

    /// Molecules, gases and periodic cells stand on nothing.
    fn ground(&mut self) {
        let is_free = self.files.is_molecular || self.facts.is_gas;
        if self.is_molecular() || self.is_periodic() || is_free {
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

    /// Whether nothing of the material but its colour is given.
    fn has_plain_material(&self) -> bool {
        let mut plain = Manifest::new("").material;
        plain.color.clone_from(&self.manifest.material.color);
        plain == self.manifest.material
    }

    /// Whether the colours are those of a map.
    fn has_mapped_colors(&self) -> bool {
        self.manifest.styles.iter().any(Style::has_legend) || self.has_mapped_particles()
    }

    /// Whether the colours of particles without a style are those of a map.
    fn has_mapped_particles(&self) -> bool {
        match &self.manifest.material.color {
            ColorSetting::Rgb(_) => false,
            ColorSetting::Mapped(_) => true,
            // Glass and water are not seen in the colours of their particles
            ColorSetting::Auto if !self.manifest.material.shows_colors() => false,
            ColorSetting::Auto => {
                self.has_set("material.color.attribute") || self.facts.has_velocities
            }
        }
    }
}

#[cfg(test)]
mod tests;
