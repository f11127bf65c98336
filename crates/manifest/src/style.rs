//! `[[style]]`: how some of the particles are drawn, unlike the others.

use glam::Vec3;
use spherule_frame::grain_columns::{GrainNames, SizeKind};
use spherule_selection::Condition;
use spherule_surface::SurfaceKind;
use spherule_tracer::scene::material::MAX_ANISOTROPY;
use spherule_tracer::scene::{self, Finish, Fresnel};

use super::absorption::Absorption;
use super::bonds::BondSearch;
use super::color::{ColorMapping, ColorSetting};
use super::color_map::{MapName, RangeSetting};
use super::grains::{GrainKind, GrainNumbers, GrainOrientation};
use super::inline_table::{InlineTable, inline_table};
use super::input::RadiusSetting;
use super::key::Key;
use super::keys::{Keys, keys};
use super::material::{Material, MaterialKind};
use super::mesh::MeshPath;
use super::opacity::OpacitySetting;
use super::part::ROUGHNESS;
use super::rule::{Rule, rules};
use super::value::named;
use super::{Arrows, Manifest, Trails};

pub(super) const ABOUT: &[&str] = &[
    "How some of the particles are drawn; the first style whose condition holds takes a particle",
];

named! {
    /// How the particles of a style are drawn.
    StyleDraw {
        /// A sphere each.
        Spheres = "spheres",
        /// The isosurface of the SPH field.
        Smooth = "smooth",
        /// Overlapping spheres as one body.
        Union = "union",
        /// Bonds, with atoms as thick as these.
        Sticks = "sticks",
        /// Bonds between smaller spheres.
        BallsAndSticks = "balls-and-sticks",
        /// Bodies with an orientation: ellipsoids, superquadrics and others.
        Grains = "grains",
        /// Arrows of a vector attribute, without spheres.
        Arrows = "arrows",
        /// Their ways over earlier frames, without spheres.
        Trails = "trails",
        /// Not at all.
        Hidden = "hidden",
    }
}

named! {
    /// Materials of styles.
    StyleMaterialKind {
        /// Light leaves in all directions alike.
        Matte = "matte",
        /// A matte base under a clear coat.
        Plastic = "plastic",
        /// A mirror in the base colour.
        Metal = "metal",
        /// A clear body of glass.
        Glass = "glass",
        /// A clear body of water.
        Water = "water",
        /// A clear body that does not refract: walls.
        ThinGlass = "thin-glass",
    }
}

const ONE_MAP: &str = "belongs to color_by, which is not given; a map may also be a table in color";
const GRAINS: &str = "belongs to a style with draw = \"grains\"";
const STICKS: &str = "are drawn by a style with draw = \"sticks\" or \"balls-and-sticks\"";
const OPAQUE_SPHERES: &str = "only opaque spheres and grains have one; set draw = \"spheres\", and matte, plastic or metal as material";

/// Transmittance of each side of thin glass without a colour, linear RGB: a light grey.
const THIN_GLASS: glam::Vec3 = glam::Vec3::new(0.93, 0.945, 0.945);

/// Rules between the keys of a style.
pub(super) const RULES: &[Rule] = rules! {
    "color_by" Given => "color" MissingOr["auto"]: "color_by is given too; leave one of the two out";
    "color_by" Missing => "map" Missing: ONE_MAP;
    "color_by" Missing => "range" Missing: ONE_MAP;
    "draw" Is["arrows"] => "arrows" Given: "which arrows, such as { attribute = \"velocity\", scale = 0.1 }";
    "draw" Is["trails"] => "trails" Given: "how long, such as { frames = 20 }";
    "draw" MissingOrNot["arrows"] => "arrows" Missing:
        "are drawn by a style with draw = \"arrows\"; for arrows at all particles there is [[arrows]]";
    "draw" MissingOrNot["trails"] => "trails" Missing:
        "are drawn by a style with draw = \"trails\"; for trails of all particles there is [trails]";
    "draw" MissingOrNot["sticks", "balls-and-sticks"] => "bonds" Missing: STICKS;
    "draw" Is["sticks", "balls-and-sticks"] => "material.type" MissingOrNot["glass", "water"]:
        "sticks are opaque; choose matte, plastic or metal";
    "draw" MissingOrNot["grains"] => "shape" Missing: GRAINS;
    "draw" MissingOrNot["grains"] => "mesh" Missing: GRAINS;
    "draw" MissingOrNot["grains"] => "size" Missing: GRAINS;
    "draw" MissingOrNot["grains"] => "exponents" Missing: GRAINS;
    "draw" MissingOrNot["grains"] => "orientation" Missing: GRAINS;
    "draw" MissingOrNot["grains"] => "angular_velocity" Missing: GRAINS;
    "shape" Is["mesh", "convex-hull"] => "mesh" Given: "which file, such as mesh = \"grain.stl\"";
    "shape" Is["ellipsoid", "superquadric", "capsule", "cylinder", "cuboid"] => "mesh" Missing:
        "belongs to shape = \"mesh\" or \"convex-hull\"";
    "draw" Is["grains"] => "material.type" MissingOrNot["glass", "water"]:
        "grains are opaque; choose matte, plastic or metal";
    "draw" Is["smooth", "union"] => "opacity" MissingOr["1"]: OPAQUE_SPHERES;
    "material.type" Is["thin-glass"] => "draw" Is["smooth", "union"]:
        "thin glass is the surface of a body, which draw = \"smooth\" and \"union\" have";
    "material.type" MissingOrNot["thin-glass"] => "material.underlay" MissingOr["false"]:
        "only thin glass is drawn behind everything else; set type = \"thin-glass\"";
    "material.type" Is["thin-glass"] => "color_by" Missing: "thin glass has one colour; set color";
    "material.type" Is["glass", "water"] => "opacity" MissingOr["1"]: OPAQUE_SPHERES;
};

/// The material of a style.
#[derive(Debug, Clone, PartialEq)]
pub struct StyleMaterial {
    /// Kind of material.
    pub kind: StyleMaterialKind,
    /// Roughness, 0 to 1; by default that of `[material]`, and glass and water are smooth.
    pub roughness: Option<f32>,
    /// Index of refraction of glass and water; by default 1.5 and 1.333.
    pub ior: Option<f32>,
    /// Transmittance of white light over [`Self::absorption_length`] inside.
    pub absorption: Absorption,
    /// The length for `absorption`; by default it depends on the extent of the particles.
    pub absorption_length: Option<f64>,
    /// Colour of the light that the medium inside scatters, linear RGB.
    pub scattering: Vec3,
    /// The mean distance between two scattering events where `scattering` is 1; by default it depends on the extent of the
    /// particles.
    pub scattering_length: Option<f64>,
    /// Mean cosine of the angle by which the medium inside deflects light.
    pub anisotropy: f32,
    /// Whether thin glass is drawn behind everything else.
    pub underlay: bool,
}

impl Default for StyleMaterial {
    fn default() -> Self {
        Self {
            kind: StyleMaterialKind::Matte,
            roughness: None,
            ior: None,
            absorption: Absorption::default(),
            absorption_length: None,
            scattering: Vec3::ZERO,
            scattering_length: None,
            anisotropy: 0.0,
            underlay: false,
        }
    }
}

impl InlineTable for StyleMaterial {
    const EXAMPLE: &str = "{ type = \"plastic\", roughness = 0.3 }";

    fn keys(&mut self, keys: &mut Keys<'_>) {
        let kind = Key::new("type", &["Kind"])
            .required("matte, plastic, metal, glass, water or thin-glass");
        keys.key(kind, &mut self.kind);
        keys!(keys:
            /// Roughness
            roughness => self.roughness, from(0), to(1);
            /// Index of refraction
            ior => self.ior, from(1), to(4), single();
            /// Transmittance of white light over absorption_length, or "color"
            absorption => self.absorption, from(0), to(1);
            /// The length for absorption
            absorption_length => self.absorption_length, above(0), single();
            /// Colour of the light that the medium inside scatters
            scattering => self.scattering, from(0), to(1);
            /// Mean distance between two scattering events where scattering is 1
            scattering_length => self.scattering_length, above(0), single();
            /// Mean cosine of the angle of scattering
            anisotropy => self.anisotropy, from(-MAX_ANISOTROPY), to(MAX_ANISOTROPY), single();
            /// Whether thin glass is drawn behind everything else
            underlay => self.underlay;
        );
    }
}
inline_table!(StyleMaterial);

impl StyleMaterial {
    /// Whether it is a medium, which light enters.
    pub const fn is_clear(&self) -> bool {
        matches!(self.kind, StyleMaterialKind::Glass | StyleMaterialKind::Water)
    }

    /// The same as `[material]`; `usual` is that table, from which the constants of Whitted's model are, and `ior` the index
    /// of refraction unless the style has one.
    pub fn as_material(&self, usual: &Material, ior: f32) -> Material {
        Material {
            kind: Some(match self.kind {
                StyleMaterialKind::Matte | StyleMaterialKind::ThinGlass => MaterialKind::Matte,
                StyleMaterialKind::Plastic => MaterialKind::Plastic,
                StyleMaterialKind::Metal => MaterialKind::Metal,
                StyleMaterialKind::Glass => MaterialKind::Glass,
                StyleMaterialKind::Water => MaterialKind::Water,
            }),
            roughness: self.roughness.unwrap_or(ROUGHNESS),
            absorption: self.absorption,
            absorption_length: self.absorption_length,
            scattering: self.scattering,
            scattering_length: self.scattering_length,
            anisotropy: self.anisotropy,
            constants: scene::Material { ior: self.ior.unwrap_or(ior), ..usual.constants },
            fresnel: self.is_clear().then_some(Fresnel::Exact).or(usual.fresnel),
            ..Material::default()
        }
    }

    /// The material in a scene, if it is no medium. `color` is that of the style.
    pub fn resolved(&self, color: &ColorSetting) -> scene::Material {
        let roughness = self.roughness.unwrap_or(ROUGHNESS);
        scene::Material {
            finish: match self.kind {
                StyleMaterialKind::Plastic => Finish::Plastic { roughness },
                StyleMaterialKind::Metal => Finish::Metal { roughness },
                StyleMaterialKind::ThinGlass => Finish::Pane,
                _ => Finish::Matte,
            },
            color: match color {
                ColorSetting::Rgb(color) if self.kind == StyleMaterialKind::ThinGlass => {
                    Some(*color)
                }
                _ => None,
            },
            is_underlay: self.underlay,
            ..scene::Material::DEFAULT
        }
    }
}

/// The bonds of a style.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StyleBonds {
    /// How they are found; by default as in `[bonds]`, else those of the file, else covalent ones.
    pub find: Option<BondSearch>,
    /// Their radius; by default half that of the balls.
    pub radius: Option<f32>,
}

impl InlineTable for StyleBonds {
    const EXAMPLE: &str = "{ find = \"covalent\", radius = 0.1 }";

    fn keys(&mut self, keys: &mut Keys<'_>) {
        keys!(keys:
            /// Which particles have a bond, as bonds.find
            find => self.find, or("auto");
            /// Radius
            radius => self.radius, or("auto"), unit("a length"), above(0), single();
        );
    }
}
inline_table!(StyleBonds);

impl InlineTable for Arrows {
    const EXAMPLE: &str = "{ attribute = \"velocity\", scale = 0.1 }";

    fn keys(&mut self, keys: &mut Keys<'_>) {
        Self::keys(self, keys);
    }
}
inline_table!(Arrows);

impl InlineTable for Trails {
    const EXAMPLE: &str = "{ frames = 20 }";

    fn keys(&mut self, keys: &mut Keys<'_>) {
        Self::keys(self, keys);
    }
}
inline_table!(Trails);

/// One `[[style]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Style {
    /// Its name in legends.
    pub name: Option<String>,
    /// Which particles it takes; None: all that no earlier style takes.
    pub condition: Option<Condition>,
    /// How they are drawn.
    pub draw: StyleDraw,
    /// Their radius, or that of sticks.
    pub radius: RadiusSetting,
    /// Source of the colours; `Auto` is that of `[material]`.
    pub color: ColorSetting,
    /// The value that colours them.
    pub color_by: Option<String>,
    /// Its colour map.
    pub map: Option<MapName>,
    /// Its range.
    pub range: Option<RangeSetting>,
    /// How much each sphere or grain covers of what is behind it.
    pub opacity: OpacitySetting,
    /// The material; by default that of `[material]` if it is opaque, else matte.
    pub material: Option<StyleMaterial>,
    /// Shape of grains; by default that of the mesh or of the file, or superquadrics if files have exponents, else
    /// ellipsoids.
    pub shape: Option<GrainKind>,
    /// File of the mesh of grains.
    pub mesh: Option<MeshPath>,
    /// Semi-axes of grains; by default the columns that the format is known for, else the radius.
    pub size: Option<GrainNumbers<3>>,
    /// Exponents n1 and n2 of superquadrics.
    pub exponents: Option<GrainNumbers<2>>,
    /// Orientation of grains; by default the columns that the format is known for.
    pub orientation: Option<GrainOrientation>,
    /// Columns of the angular velocity of grains; by default those that the format is known for.
    pub angular_velocity: Option<Vec<String>>,
    /// Bonds of sticks.
    pub bonds: Option<StyleBonds>,
    /// The arrows, if it draws these.
    pub arrows: Option<Arrows>,
    /// The trails, if it draws these.
    pub trails: Option<Trails>,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            name: None,
            condition: None,
            draw: StyleDraw::Spheres,
            radius: RadiusSetting::Auto,
            color: ColorSetting::Auto,
            color_by: None,
            map: None,
            range: None,
            opacity: OpacitySetting::Constant(1.0),
            material: None,
            shape: None,
            mesh: None,
            size: None,
            exponents: None,
            orientation: None,
            angular_velocity: None,
            bonds: None,
            arrows: None,
            trails: None,
        }
    }
}

impl Style {
    /// Reads or lists one table.
    pub(super) fn keys(&mut self, keys: &mut Keys<'_>) {
        keys!(keys:
            /// Name in the legend
            name => self.name, example("\"wall\""), unset("the condition");
            /// Condition on the particles, as select.where
            where => self.condition, example("\"type == 2\""), unset("all that no earlier style takes");
            /// How they are drawn: spheres | smooth | union | sticks | balls-and-sticks | grains | arrows | trails | hidden
            draw => self.draw;
            /// Radius as input.radius, of the balls or of the sticks
            ///
            /// By default spheres have those of input.radius, balls a quarter of them, and sticks an eighth of the largest.
            radius => self.radius;
            /// Colour as material.color; auto: that of material.color
            color => self.color, from(0);
            /// Value that colours them, with a colour map
            color_by => self.color_by, example("\"speed\""), unset("color");
            /// Colour map of color_by
            map => self.map, example("\"viridis\""), unset("as for material.color");
            /// Range of color_by
            range => self.range, example("[0.0, 4.0]"), unset("that of these particles in the sequence");
            /// Opacity of spheres or grains as material.opacity
            opacity => self.opacity;
            /// Material: { type = "plastic", roughness = 0.3 }, also with ior, absorption, scattering and others
            ///
            /// The keys of glass and water are those of [material]: ior, absorption, absorption_length, scattering,
            /// scattering_length and anisotropy. The types are matte, plastic, metal, glass, water, and thin-glass for
            /// walls: a body that light passes without refraction. With underlay = true it is drawn behind everything
            /// else. Where bodies of glass and water overlap, the first style fills the space.
            material => self.material, example("{ type = \"plastic\", roughness = 0.3 }"),
                unset("that of [material] if it is opaque, else matte");
            /// Shape of grains: ellipsoid | superquadric | capsule | cylinder | cuboid | mesh | convex-hull
            ///
            /// Capsules and cylinders are along their z axis. A mesh must be closed; convex-hull takes its vertices alone.
            shape => self.shape, example("\"superquadric\""),
                unset("mesh if there is one, else that of the types in GSD files, superquadric if files have exponents, or ellipsoid");
            /// File of the mesh of grains: STL, OBJ, PLY, VTK, VTP or VTU
            mesh => self.mesh, example("\"grain.stl\""), unset("no mesh");
            /// Semi-axes of grains, or factors on the mesh: three numbers, or the columns that have them
            size => self.size, example("[1.0, 0.5, 0.5]"),
                unset("columns of known names, else the radius; 1 for a mesh");
            /// Exponents of superquadrics, along z and across: two numbers, or the columns that have them
            exponents => self.exponents, example("[8.0, 2.0]"), unset("columns of known names");
            /// Orientation of grains: { quaternion = ["qw", "qx", "qy", "qz"] }, or quaternion_xyzw, euler, euler_radians
            orientation => self.orientation, example("{ quaternion = [\"qw\", \"qx\", \"qy\", \"qz\"] }"),
                unset("columns of known names");
            /// Columns of the angular velocity of grains, radians per unit of time, for motion blur
            angular_velocity => self.angular_velocity, example("[\"wx\", \"wy\", \"wz\"]"),
                unset("columns of known names");
            /// Bonds of sticks: { find = "covalent", radius = 0.1 }
            bonds => self.bonds, example("{ find = \"covalent\", radius = 0.1 }"),
                unset("those of [bonds]; without, those of the topology, covalent ones if there are elements, or those of the file");
            /// Arrows for draw = "arrows", with the keys of [[arrows]]
            arrows => self.arrows, example("{ attribute = \"velocity\", scale = 0.1 }"), unset("none");
            /// Trails for draw = "trails", with the keys of [trails]
            trails => self.trails, example("{ frames = 20 }"), unset("none");
        );
        if let Some(section) = keys.reading() {
            section.check(RULES);
            if self.mesh.as_ref().is_some_and(MeshPath::has_number) {
                section.wrong(
                    "mesh",
                    "has the number of a frame, but all frames have the same mesh of grains",
                );
            }
        }
    }

    /// The shape of its grains, if it is given.
    pub fn grain_kind(&self) -> Option<GrainKind> {
        self.shape.or(self.mesh.as_ref().map(|_| GrainKind::Mesh))
    }

    /// Whether it draws bonds.
    pub const fn has_sticks(&self) -> bool {
        matches!(self.draw, StyleDraw::Sticks | StyleDraw::BallsAndSticks)
    }

    /// Whether it draws one body.
    pub const fn is_body(&self) -> bool {
        matches!(self.draw, StyleDraw::Smooth | StyleDraw::Union)
    }

    /// Whether light passes through it.
    pub fn is_clear(&self) -> bool {
        self.material.as_ref().is_some_and(StyleMaterial::is_clear)
    }

    /// Whether light passes through it without refraction.
    pub fn is_thin_glass(&self) -> bool {
        self.material.as_ref().is_some_and(|own| own.kind == StyleMaterialKind::ThinGlass)
    }

    /// The surface of its particles, where grains count as spheres; None if they have none.
    pub const fn surface(&self) -> Option<SurfaceKind> {
        match self.draw {
            StyleDraw::Spheres
            | StyleDraw::Sticks
            | StyleDraw::BallsAndSticks
            | StyleDraw::Grains => Some(SurfaceKind::Spheres),
            StyleDraw::Smooth => Some(SurfaceKind::Smooth),
            StyleDraw::Union => Some(SurfaceKind::Union),
            StyleDraw::Arrows | StyleDraw::Trails | StyleDraw::Hidden => None,
        }
    }

    /// The colours, with those of `color_by` in one form; `usual` are those of `[material]`.
    pub fn colors(&self, usual: &ColorSetting) -> ColorSetting {
        match (&self.color_by, &self.color) {
            (Some(name), _) => ColorSetting::Mapped(ColorMapping {
                map: self.map,
                range: self.range,
                ..ColorMapping::by(name)
            }),
            (None, ColorSetting::Auto) if self.is_thin_glass() => ColorSetting::Rgb(THIN_GLASS),
            (None, ColorSetting::Auto) => usual.clone(),
            (None, color) => color.clone(),
        }
    }

    /// The columns of its grains that are named.
    pub fn grain_names(&self) -> GrainNames {
        let sizes = match &self.size {
            Some(GrainNumbers::Names(names)) => Some((names.clone(), SizeKind::SemiAxes)),
            _ => None,
        };
        let exponents = match &self.exponents {
            Some(GrainNumbers::Names(names)) => Some(names.clone()),
            _ => None,
        };
        let orientation = self.orientation.as_ref().and_then(GrainOrientation::named);
        let angular_velocity = self.angular_velocity.clone();
        GrainNames { orientation, sizes, exponents, angular_velocity }
    }

    /// Whether legends show it: a map, or a name with a colour.
    pub fn has_legend(&self) -> bool {
        let is_drawn = self.draw != StyleDraw::Hidden;
        is_drawn
            && match self.colors(&ColorSetting::Auto) {
                ColorSetting::Mapped(_) => true,
                ColorSetting::Rgb(_) => self.name.is_some(),
                ColorSetting::Auto => false,
            }
    }

    /// How it is called in legends.
    pub fn title(&self) -> String {
        let condition = self.condition.as_ref().map(Condition::as_str);
        self.name.clone().unwrap_or_else(|| condition.unwrap_or("others").to_owned())
    }
}

impl Manifest {
    /// The condition of the particles that no hidden style takes; None if all are drawn.
    pub(super) fn shown_condition(&self) -> Option<Condition> {
        let nothing = || Condition::parse("index < 0").expect("a condition");
        // From the last style on: whether there is a rest, and the condition of those of it that are drawn
        let (mut is_none, mut rest): (bool, Option<Condition>) = (false, None);
        for style in self.styles.iter().rev() {
            let is_hidden = style.draw == StyleDraw::Hidden;
            (is_none, rest) = match (style.condition.clone(), is_hidden) {
                (None, _) => (is_hidden, None),
                (Some(_), true) if is_none => (true, None),
                (Some(own), true) => {
                    let others = own.negated();
                    (
                        false,
                        Some(match rest {
                            Some(rest) => others.and(rest),
                            None => others,
                        }),
                    )
                }
                (Some(own), false) if is_none => (false, Some(own)),
                (Some(own), false) => (false, rest.map(|rest| own.or(rest))),
            };
        }
        if is_none { Some(nothing()) } else { rest }
    }
}

#[cfg(test)]
#[path = "style_tests.rs"]
mod tests;
