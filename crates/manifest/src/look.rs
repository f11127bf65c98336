//! Looks: named sets of defaults, which values in a manifest and options override. Those of some looks depend on the
//! particles and are found elsewhere (`defaults`).

use toml::Value;

use super::Override;
use super::key::Affects;
use super::keys::{Keys, keys};
use super::tree::TomlNode;
use super::value::{Named, named};

named! {
    /// A look, see the module.
    Look {
        /// What the particles suggest, in front of white, with a legend: see `defaults`.
        Auto = "auto",
        /// The same without a legend.
        Plain = "plain",
        /// The same as `auto`.
        Paper = "paper",
        /// Matte particles in a grey photo studio, with path tracing.
        Studio = "studio",
        /// Clear water on sand, under a clear sky.
        Water = "water",
        /// The model of the thesis: lights without extent, ambient light and highlights.
        Whitted = "whitted",
        /// The defaults of the keys, whatever the particles are. Manifests that jobs write have it.
        None = "none",
    }
}

/// Water: one body with a smooth surface. Its colour comes from absorption, and its reflections from the sky; the sun
/// makes caustics on the ground. The terms of the thesis's model and the background are for `integrator = "whitted"`.
/// Tuned by eye on dam breaks.
const WATER: &str = r#"
render.integrator = "path"
render.surface = "smooth"
render.max_depth = 8
render.background = { bottom = [0.75, 0.80, 0.86], top = [0.30, 0.52, 0.92] }
render.ground = true
render.ground_color = [0.36, 0.33, 0.28]
render.ground_pattern = "sand"
environment.type = "sky"
environment.visible = true
material.color = [0.6, 0.85, 0.9]
material.ambient = 0.0
material.diffuse = 0.0
material.specular = 1.0
material.shininess = 600.0
material.ior = 1.333
material.reflection = 1.0
material.transmission = 1.0
material.absorption = [0.42, 0.78, 0.86]
"#;

/// A photo studio, whose light is the default environment.
const STUDIO: &str = r#"
render.integrator = "path"
render.background = "studio"
"#;

/// The thesis's equation 4.1, without a ground.
const WHITTED: &str = r#"
render.integrator = "whitted"
render.ground = false
"#;

/// A quick preview: few samples, and paths that end at the second surface. [`draft`] lays it over a manifest.
const DRAFT: &str = r#"
image.samples = 4
render.noise = "off"
render.indirect = "ambient"
render.denoise = "auto"
"#;

/// The settings of a quick preview, whatever a manifest says. `shown` is the name of their origin in messages.
pub fn draft(shown: &str) -> Vec<Override> {
    settings(DRAFT, shown).collect()
}

/// The settings in `text`.
fn settings(text: &str, shown: &str) -> impl Iterator<Item = Override> {
    let sections: toml::Table = text.parse().expect("built-in settings are valid TOML");
    let key = |(section, keys): (String, Value)| match keys {
        Value::Table(keys) => {
            keys.into_iter().map(|(key, value)| (format!("{section}.{key}"), value)).collect()
        }
        value => vec![(section, value)],
    };
    let set = move |(key, value): (String, Value)| {
        Override::new(&key, value, shown).expect("built-in keys have names")
    };
    sections.into_iter().flat_map(key).map(set)
}

pub(super) fn keys(look: &mut Look, legend: &mut bool, keys: &mut Keys<'_>) {
    keys!(keys:
        /// Defaults of the settings that are not given: auto | plain | paper | studio | water | whitted | none
        ///
        /// auto follows from the particles, in front of white, with a legend. plain has no legend; paper is the same as
        /// auto. studio is a grey room, water clear water on sand, whitted the model of the thesis. none leaves the
        /// defaults of the keys as this file has them.
        look => *look, affects(Affects::Nothing), flag("look", "NAME", "Look");
        /// Whether the looks auto and paper add a legend: the colours with their values, and the time
        ///
        /// [[overlay]] with the type colorbar replaces the former, and with the type text the latter.
        legend => *legend, affects(Affects::Nothing);
    );
}

impl Look {
    /// The look that the manifest in `tree` names, if it is known.
    pub(super) fn of(tree: &TomlNode) -> Self {
        let mut all = Self::names().into_iter();
        let found = all.find(|(_, name)| tree.has_text("look", name));
        found.map_or(Self::Auto, |(look, _)| look)
    }

    /// Whether pictures have a legend unasked.
    pub const fn has_legend(self) -> bool {
        matches!(self, Self::Auto | Self::Paper)
    }

    /// Its defaults. `shown` is the name of their origin in messages: the option that selected the look.
    pub(super) fn settings(self, shown: &str) -> Vec<Override> {
        let text = match self {
            Self::Water => WATER,
            Self::Studio => STUDIO,
            Self::Whitted => WHITTED,
            // These depend on the particles
            Self::Auto | Self::Plain | Self::Paper | Self::None => return Vec::new(),
        };
        settings(text, shown).map(Override::under).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::Vec3;

    use super::*;
    use crate::{Absorption, GroundKind, GroundPattern, GroundSetting, Manifest, marked};
    use spherule_surface::SurfaceKind;
    use spherule_tracer::render::IntegratorKind;
    use spherule_tracer::scene::Background;

    fn water(text: &str, sets: &[&str]) -> Manifest {
        let sets =
            sets.iter().chain(&["look=water"]).map(|set| Override::parse(set).unwrap()).collect();
        Manifest::parse_with(text, Path::new("job.toml"), sets).unwrap()
    }

    #[test]
    fn every_look_is_read() {
        for (look, name) in Look::names() {
            let text = format!("look = \"{name}\"\ninput.path = \"data\"");
            let manifest = Manifest::parse(&text, Path::new("job.toml")).unwrap();
            assert_eq!(manifest.look, look);
            let shown = manifest.to_commented_toml();
            assert_eq!(Manifest::parse(&shown, Path::new("x")).unwrap(), manifest);
        }
    }

    #[test]
    fn water_preset_is_a_transparent_union_on_a_ground() {
        let plain = water("input.path = \"data\"", &[]);
        assert_eq!(plain.surface.kind, SurfaceKind::Smooth);
        assert_eq!(plain.render.max_depth, 8);
        assert_eq!(plain.render.ground_pattern, GroundPattern::Sand);
        assert_eq!(plain.material.constants.transmission, 1.0);
        assert!(
            plain.render.ground == Some(GroundSetting::of(GroundKind::Plain))
                && matches!(plain.material.absorption, Absorption::Color(color) if color.x < 1.0)
        );
    }

    #[test]
    fn a_studio_traces_paths() {
        let look = |look: Look, text: &str| {
            let text = format!("look = \"{}\"\ninput.path = \"data\"\n{text}", look.name());
            Manifest::parse(&text, Path::new("job.toml")).unwrap()
        };
        let plain = look(Look::Studio, "").render;
        assert_eq!(plain.integrator, Some(IntegratorKind::Path));
        assert_eq!(plain.ground, None);
        assert_eq!(plain.background, Some(Background::Studio { up: Vec3::Z }));
        // A source of light of the manifest's own
        look(Look::Studio, "environment.image = \"hall.exr\"");
        let own = look(Look::Studio, "render.integrator = \"whitted\"\nrender.ground = false");
        assert_eq!(own.integrator(), IntegratorKind::Whitted);
        assert_eq!(own.render.ground, Some(GroundSetting::of(GroundKind::None)));
    }

    #[test]
    fn explicit_settings_override_a_look() {
        let text = "input.path = \"data\"\n[render]\nmax_depth = 5\nground_tile = 2\n[material]\nabsorption = [1, 1, 1]";
        let mixed = water(text, &["render.surface=spheres", "render.background=[1,0,0]"]);
        assert_eq!(mixed.render.max_depth, 5);
        assert_eq!(mixed.render.ground_tile, Some(2.0));
        assert_eq!(mixed.material.absorption, Absorption::default());
        assert_eq!(mixed.surface.kind, SurfaceKind::Spheres);
        assert_eq!(mixed.render.background, Some(Background::Constant(Vec3::X)));
        assert_eq!(mixed.render.ground, Some(GroundSetting::of(GroundKind::Plain)));
        // An error in the file is reported once, with its position.
        let wrong = "input.path = \"data\"\nrender = 3";
        let look = vec![Override::parse("look=water").unwrap()];
        let error = Manifest::parse_with(wrong, Path::new("job.toml"), look).unwrap_err();
        assert_eq!(error.messages().len(), 1, "{error}");
        assert!(error.to_string().contains("line 2"), "{error}");
    }

    #[test]
    fn a_ground_that_is_named_plain_has_no_pattern_of_a_look() {
        let pattern = |text: &str, sets: &[&str]| {
            let text = format!("input.path = \"data\"\n{text}");
            water(&text, sets).render.ground_pattern
        };
        assert_eq!(pattern("", &["render.ground=plain"]), GroundPattern::Plain);
        assert_eq!(pattern("render.ground = \"plain\"", &[]), GroundPattern::Plain);
        assert_eq!(pattern("render.ground = true", &[]), GroundPattern::Sand);
        for own in ["sand", "checker"] {
            let set = format!("render.ground_pattern={own}");
            let both = pattern("", &["render.ground=plain", &set]);
            assert_eq!(both, pattern("", &[&set]));
        }
    }

    #[test]
    fn unknown_look_lists_the_known_ones() {
        let text = "look = \"watre\"\ninput.path = \"data\"";
        let error = Manifest::parse(text, Path::new("job.toml")).unwrap_err().to_string();
        assert!(
            error.contains("look: expected one of auto, plain, paper, studio, water"),
            "{error}"
        );
        assert!(error.ends_with("did you mean water?"), "{error}");
    }

    #[test]
    fn manifests_of_jobs_have_no_look() {
        let text = "input.path = \"data\"";
        let look = |text: &str| Manifest::parse(text, Path::new("job.toml")).unwrap().look;
        assert_eq!(look(text), Look::Auto);
        assert_eq!(look(&marked(text)), Look::None);
        assert_eq!(look(&marked(&format!("look = \"studio\"\n{text}"))), Look::Studio);
    }
}
