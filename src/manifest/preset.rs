//! Looks: named sets of defaults, which values in a manifest and options override.

use toml::Value;

use super::{Override, nearest};

/// A look, see the module.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// Clear water on a checkerboard, under a sky.
    Water,
}

/// Water: one body with a smooth surface. It has no diffuse reflection, so its colour comes from absorption, and its
/// reflections from the sky. Tuned by eye on dam breaks.
const WATER: &str = r#"
render.surface = "smooth"
render.max_depth = 8
render.background = { bottom = [0.75, 0.80, 0.86], top = [0.30, 0.52, 0.92] }
render.ground = true
render.ground_color = [0.46, 0.44, 0.41]
render.ground_pattern = "checker"
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

impl Look {
    /// All looks with their names.
    pub const ALL: &[(Self, &'static str)] = &[(Self::Water, "water")];

    /// The look with a name.
    ///
    /// # Errors
    /// The name is unknown; lists the known ones.
    pub fn named(name: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|(_, known)| *known == name);
        found.map(|(look, _)| *look).ok_or_else(|| {
            let known: Vec<&str> = Self::ALL.iter().map(|(_, known)| *known).collect();
            let hint = nearest(name, &known).map(|n| format!("; did you mean {n}?"));
            format!(
                "unknown look `{name}`; available: {}{}",
                known.join(", "),
                hint.unwrap_or_default()
            )
        })
    }

    /// Its defaults. `shown` is the name of their origin in messages: the option that selected the look.
    pub fn settings(self, shown: &str) -> Vec<Override> {
        let text = match self {
            Self::Water => WATER,
        };
        let sections: toml::Table = text.parse().expect("a look of our own is TOML");
        let key = |(section, keys): (String, Value)| match keys {
            Value::Table(keys) => keys
                .into_iter()
                .map(|(key, value)| (format!("{section}.{key}"), value))
                .collect(),
            value => vec![(section, value)],
        };
        let set = |(key, value): (String, Value)| {
            let set = Override::new(&key, value, shown);
            set.expect("its keys have names").under()
        };
        sections.into_iter().flat_map(key).map(set).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::Vec3;

    use super::*;
    use crate::manifest::{GroundPattern, Manifest};
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
    fn water_is_one_clear_body_on_a_floor() {
        let plain = water("input.path = \"data\"", &[]);
        assert_eq!(plain.surface.kind, SurfaceKind::Smooth);
        assert_eq!(plain.render.max_depth, 8);
        assert_eq!(plain.render.ground_pattern, GroundPattern::Checker);
        assert_eq!(plain.material.constants.transmission, 1.0);
        assert!(plain.render.ground && plain.material.absorption[0] < 1.0);
    }

    #[test]
    fn what_is_said_goes_before_a_look() {
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
        assert!(mixed.render.ground);
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
    fn an_unknown_look_names_the_known() {
        let error = Look::named("watre").unwrap_err();
        assert!(
            error.contains("available: water; did you mean water?"),
            "{error}"
        );
        assert!(!Look::named("lava").unwrap_err().contains("did you mean"));
    }
}
