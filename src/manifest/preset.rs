//! Looks: named sets of defaults, which values in a manifest and options override.

use spherule_formats::ValueError;
use toml::Value;

use super::Override;
use super::nearest::nearest;

/// A look, see the module.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// Clear water on sand, under a clear sky.
    Water,
    /// Matte particles in a photo studio, with path tracing.
    Studio,
    /// The same in front of white, for print.
    Paper,
    /// The model of the thesis: lights without extent, ambient light and highlights.
    Whitted,
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
render.ground = "shadow_catcher"
render.background = "studio"
"#;

/// White paper in the light of a studio.
const PAPER: &str = r#"
render.integrator = "path"
render.ground = "shadow_catcher"
render.background = [1.0, 1.0, 1.0]
"#;

/// The thesis's equation 4.1, without a ground.
const WHITTED: &str = r#"
render.integrator = "whitted"
render.ground = false
"#;

/// A quick preview: few samples, and paths that end at the second surface. [`draft`] lays it over a manifest.
const DRAFT: &str = r#"
image.samples = 4
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
        Value::Table(keys) => keys
            .into_iter()
            .map(|(key, value)| (format!("{section}.{key}"), value))
            .collect(),
        value => vec![(section, value)],
    };
    let set = move |(key, value): (String, Value)| {
        Override::new(&key, value, shown).expect("built-in keys have names")
    };
    sections.into_iter().flat_map(key).map(set)
}

impl Look {
    /// All looks with their names.
    pub const ALL: &[(Self, &'static str)] = &[
        (Self::Water, "water"),
        (Self::Studio, "studio"),
        (Self::Paper, "paper"),
        (Self::Whitted, "whitted"),
    ];

    /// The look with a name.
    ///
    /// # Errors
    /// The name is unknown; lists the known ones.
    pub fn named(name: &str) -> Result<Self, ValueError> {
        let found = Self::ALL.iter().find(|(_, known)| *known == name);
        found.map(|(look, _)| *look).ok_or_else(|| {
            let known: Vec<&str> = Self::ALL.iter().map(|(_, known)| *known).collect();
            ValueError::one_of(&known, name).with_similar(nearest(name, &known))
        })
    }

    /// Its defaults. `shown` is the name of their origin in messages: the option that selected the look.
    pub fn settings(self, shown: &str) -> Vec<Override> {
        let text = match self {
            Self::Water => WATER,
            Self::Studio => STUDIO,
            Self::Paper => PAPER,
            Self::Whitted => WHITTED,
        };
        settings(text, shown).map(Override::under).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::Vec3;

    use super::*;
    use crate::manifest::{GroundKind, GroundPattern, GroundSetting, Manifest};
    use crate::render::IntegratorKind;
    use crate::scene::Background;
    use crate::surface::SurfaceKind;

    fn water(text: &str, sets: &[&str]) -> Manifest {
        let sets = sets.iter().map(|set| Override::parse(set).unwrap());
        let all = Look::Water
            .settings("--look water")
            .into_iter()
            .chain(sets)
            .collect();
        Manifest::parse_with(text, Path::new("job.toml"), all).unwrap()
    }

    #[test]
    fn every_look_is_read() {
        for (look, name) in Look::ALL {
            assert_eq!(Look::named(name).unwrap(), *look);
            let text = "input.path = \"data\"";
            let manifest =
                Manifest::parse_with(text, Path::new("job.toml"), look.settings("--look water"))
                    .unwrap();
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
                && plain.material.absorption[0] < 1.0
        );
    }

    #[test]
    fn studio_and_paper_trace_paths_above_a_shadow_catcher() {
        let look = |look: Look, text: &str| {
            let text = format!("input.path = \"data\"\n{text}");
            Manifest::parse_with(&text, Path::new("job.toml"), look.settings("--look")).unwrap()
        };
        for (name, background) in [
            (Look::Studio, Background::Studio { up: Vec3::Z }),
            (Look::Paper, Background::Constant(Vec3::ONE)),
        ] {
            let plain = look(name, "").render;
            assert_eq!(plain.integrator, Some(IntegratorKind::Path));
            assert_eq!(
                plain.ground,
                Some(GroundSetting::of(GroundKind::ShadowCatcher))
            );
            assert_eq!(plain.background, Some(background));
            // A source of light of the manifest's own
            look(name, "environment.image = \"hall.exr\"");
        }
        let own = look(
            Look::Studio,
            "render.integrator = \"whitted\"\nrender.ground = false",
        );
        assert_eq!(own.integrator(), IntegratorKind::Whitted);
        assert_eq!(own.render.ground, Some(GroundSetting::of(GroundKind::None)));
    }

    #[test]
    fn explicit_settings_override_a_look() {
        let text = "input.path = \"data\"\n[render]\nmax_depth = 5\nground_tile = 2\n[material]\nabsorption = [1, 1, 1]";
        let mixed = water(
            text,
            &["render.surface=spheres", "render.background=[1,0,0]"],
        );
        assert_eq!(mixed.render.max_depth, 5);
        assert_eq!(mixed.render.ground_tile, Some(2.0));
        assert_eq!(mixed.material.absorption, Vec3::ONE);
        assert_eq!(mixed.surface.kind, SurfaceKind::Spheres);
        assert_eq!(mixed.render.background, Some(Background::Constant(Vec3::X)));
        assert_eq!(
            mixed.render.ground,
            Some(GroundSetting::of(GroundKind::Plain))
        );
        // An error in the file is reported once, with its position.
        let wrong = "input.path = \"data\"\nrender = 3";
        let error = Manifest::parse_with(
            wrong,
            Path::new("job.toml"),
            Look::Water.settings("--look water"),
        );
        let error = error.unwrap_err();
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
        assert_eq!(
            pattern("render.ground = \"plain\"", &[]),
            GroundPattern::Plain
        );
        assert_eq!(pattern("render.ground = true", &[]), GroundPattern::Sand);
        for own in ["sand", "checker"] {
            let set = format!("render.ground_pattern={own}");
            let both = pattern("", &["render.ground=plain", &set]);
            assert_eq!(both, pattern("", &[&set]));
        }
    }

    #[test]
    fn unknown_look_lists_the_known_ones() {
        let error = Look::named("watre").unwrap_err();
        assert_eq!(
            error.to_string(),
            "expected one of water, studio, paper, whitted, found \"watre\"; did you mean water?"
        );
        assert_eq!(Look::named("lava").unwrap_err().similar, None);
    }
}
