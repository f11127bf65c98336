//! `[mist]`: mist above the ground, for the path integrator.

use glam::Vec3;
use spherule_tracer::scene::material::MAX_ANISOTROPY;
use spherule_tracer::scene::mist::DEFAULT_ANISOTROPY;

use super::key::Affects;
use super::keys::section;
use super::reader::Section;

section! {
    /// Mist above the ground, which falls off with the height, for integrator = "path"
    Mist {
        /// How far one sees in the mist at the ground: the distance at which 2 % of a contrast is left
        ///
        /// The mean distance between two scattering events there is this divided by 3.912 (Koschmieder 1924). The mist
        /// is in the air outside all bodies, above the ground, or above the lowest particles if there is no ground.
        visibility: Option<f64> = None, example("8.0"), unset("there is no mist"), unit("a length"), above(0), single();
        /// Height above the ground at which the mist has 1/e of its density there, or auto
        ///
        /// auto is a tenth of the diagonal of the box of the particles.
        height: Option<f64> = None, or("auto"), unit("a length"), above(0), single(), affects(Affects::Mist);
        /// Colour of the light that the mist scatters, linear RGB; the rest is absorbed
        color: Vec3 = Vec3::ONE, from(0), to(1), affects(Affects::Mist);
        /// Mean cosine of the angle of scattering: -0.95 (backwards), 0 (to all sides alike) to 0.95 (forwards)
        ///
        /// 0.7 is that of haze in continental air, 0.85 that of fog (Hess, Koepke and Schult 1998).
        anisotropy: f32 = DEFAULT_ANISOTROPY, from(-MAX_ANISOTROPY), to(MAX_ANISOTROPY), single(),
            affects(Affects::Mist);
    }
}

impl Mist {
    /// Warns about keys that have no effect because there is no mist.
    pub(super) fn check(&self, root: &Section<'_>) {
        let usual = Self::default();
        let changed = [
            ("mist.height", self.height != usual.height),
            ("mist.color", self.color != usual.color),
            ("mist.anisotropy", self.anisotropy != usual.anisotropy),
        ];
        let is_missing = self.visibility.is_none();
        for (key, _) in changed.into_iter().filter(|(_, is_changed)| is_missing && *is_changed) {
            root.warn(key, "has no effect: there is no mist; set mist.visibility");
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::Manifest;

    fn read(text: &str) -> Result<(Manifest, Vec<String>), String> {
        let text = format!("input.path = \"a\"\n{text}");
        Manifest::parse_with_warnings(&text, Path::new("job.toml"), Vec::new())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn settings_without_mist_change_nothing_and_are_reported() {
        let (usual, _) = read("").unwrap();
        for (key, value) in [("height", "0.5"), ("color", "[1, 0, 0]"), ("anisotropy", "0.1")] {
            let (manifest, warnings) = read(&format!("mist.{key} = {value}")).unwrap();
            let expected = format!("mist.{key}: has no effect: there is no mist");
            assert!(warnings.len() == 1 && warnings[0].contains(&expected), "{warnings:?}");
            assert_eq!(manifest.settings(), usual.settings());
            let both = format!("mist = {{ visibility = 3, {key} = {value} }}");
            let (manifest, warnings) = read(&both).unwrap();
            assert!(warnings.is_empty() && manifest.settings() != usual.settings());
        }
        assert!(usual.settings().iter().all(|(key, _)| !key.starts_with("mist.")));
    }

    #[test]
    fn mist_is_for_paths_and_has_positive_lengths() {
        // Whitted's model refuses it, whoever chose it
        for whitted in ["render.integrator = \"whitted\"", "material.shininess = 5"] {
            let text = format!("mist.visibility = 3\n{whitted}");
            let error = match read(&text) {
                Ok((manifest, _)) => manifest.check_rules().unwrap_err().to_string(),
                Err(error) => error,
            };
            let expected = "mist.visibility: render.integrator = \"whitted\" has no mist; choose";
            assert!(error.contains(expected), "{error}");
        }
        for (key, value) in [
            ("visibility", "0"),
            ("visibility", "-1"),
            ("visibility", "nan"),
            ("visibility", "1e60"),
            ("visibility", "inf"),
            ("height", "0"),
            ("height", "-0.5"),
            ("height", "1e-60"),
            ("color", "[1.5, 0, 0]"),
            ("color", "[nan, 0, 0]"),
            ("anisotropy", "0.96"),
            ("anisotropy", "nan"),
        ] {
            let error = read(&format!("mist.{key} = {value}")).unwrap_err();
            assert!(error.contains(&format!("mist.{key}: ")), "{value}: {error}");
        }
        read("mist = { visibility = 1e30, height = 1e-30 }").unwrap().0.check_rules().unwrap();
    }
}
