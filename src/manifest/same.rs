//! Settings of an older job that are written otherwise than now and make the same pictures.
//!
//! Keys and values have changed between versions. A job goes on with the settings that its plan has, so what makes no
//! difference to the pictures must not look like a change.

use super::write::Toml;
use super::{ColorMap, ColorSetting, Manifest};

const MIN_WEIGHT: &str = "render.min_weight";
const COLOR: &str = "material.color";
/// Who renders; not in a manifest as long as there is one.
pub(super) const RENDERER: &str = "renderer";

impl Manifest {
    /// The [`Manifest::settings`], each in the words of the `planned` settings of a job where those make the same
    /// pictures. `has_rgb` says whether the job found colours in the attribute that it is coloured by.
    pub fn settings_as_planned(
        &self,
        planned: &[(String, String)],
        has_rgb: bool,
    ) -> Vec<(String, String)> {
        let value = |key: &str| planned.iter().find(|(k, _)| k == key).map(|(_, v)| v);
        let mut settings = self.settings();
        match (self.literal_min_weight(), value(MIN_WEIGHT)) {
            // No picture depends on it. If those of the job did, the material has changed as well.
            (None, Some(old)) => settings.push((MIN_WEIGHT.to_owned(), old.clone())),
            // Versions without the key followed both branches always.
            (Some(0.0), None) => settings.retain(|(key, _)| key != MIN_WEIGHT),
            _ => {}
        }
        // Versions without the key had one renderer.
        if value(RENDERER).is_none() {
            settings.retain(|(key, _)| key != RENDERER);
        }
        if let Some(old) = value(COLOR)
            && self.has_color_written(old, has_rgb)
            && let Some((_, new)) = settings.iter_mut().find(|(key, _)| key == COLOR)
        {
            new.clone_from(old);
        }
        settings
    }

    /// [`super::Render::min_weight`], if any picture depends on it.
    fn literal_min_weight(&self) -> Option<f32> {
        self.branches_at_spheres().then_some(self.render.min_weight)
    }

    /// Whether `text` is another way to write the colour by an attribute: with the usual map where none is needed, as
    /// all older versions wrote it, or without.
    fn has_color_written(&self, text: &str, has_rgb: bool) -> bool {
        let ColorSetting::Attribute {
            attribute,
            map,
            range,
        } = &self.material.color
        else {
            return false;
        };
        // Attributes that are colours go through a map only if one is named.
        let is_mapped = range.is_some() || !has_rgb;
        let written = |map| {
            let (attribute, range) = (attribute.clone(), *range);
            let same = ColorSetting::Attribute {
                attribute,
                map,
                range,
            };
            same.toml() == text
        };
        let is_usual = matches!(map, None | Some(ColorMap::Viridis));
        is_mapped && is_usual && (written(None) || written(Some(ColorMap::Viridis)))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn manifest(rest: &str) -> Manifest {
        let text = format!("input.path = \"a\"\n{rest}");
        Manifest::parse(&text, Path::new("job.toml")).unwrap()
    }

    /// The settings of `manifest` as another version wrote them: `key` with another value, or without it.
    fn rewritten(manifest: &Manifest, key: &str, value: Option<&str>) -> Vec<(String, String)> {
        let mut settings = manifest.settings();
        settings.retain(|(k, _)| k != key);
        settings.extend(value.map(|value| (key.to_owned(), value.to_owned())));
        settings
    }

    #[track_caller]
    fn changes(manifest: &Manifest, planned: &[(String, String)], has_rgb: bool) -> Vec<String> {
        let now = manifest.settings_as_planned(planned, has_rgb);
        let changes = spherule_jobs::compare_settings(planned, &now);
        changes.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn the_least_weight_matters_to_transmissive_spheres_alone() {
        let glass = "material.transmission = 1\n";
        for (rest, planned, wanted) in [
            ("", None, ""),
            ("", Some("0.5"), ""),
            ("render.min_weight = 0.5", None, ""),
            (
                "render.surface = \"medium\"\nmaterial.transmission = 1",
                None,
                "",
            ),
            (glass, None, "render.min_weight: (not set) -> 0.0009765625"),
            (glass, Some("0.5"), "render.min_weight: 0.5 -> 0.0009765625"),
            ("material.transmission = 1\nrender.min_weight = 0", None, ""),
        ] {
            let manifest = manifest(rest);
            let planned = rewritten(&manifest, MIN_WEIGHT, planned);
            let found = changes(&manifest, &planned, false);
            assert_eq!(found.join("; "), wanted, "{rest}");
        }
    }

    #[test]
    fn the_usual_map_may_be_named_or_not() {
        let by = |rest: &str| format!("{{ attribute = \"density\"{rest} }}");
        let (plain, viridis, turbo) = (by(""), by(", map = \"viridis\""), by(", map = \"turbo\""));
        let range = ", range = [1.0, 2.0]";
        let (ranged, both) = (by(range), by(&format!(", map = \"viridis\"{range}")));
        for (now, planned, has_rgb, is_same) in [
            (&plain, &viridis, false, true),
            (&viridis, &plain, false, true),
            // These particles bring colours: without a map they are taken as they are.
            (&plain, &viridis, true, false),
            (&viridis, &plain, true, false),
            (&viridis, &viridis, true, true),
            (&ranged, &both, true, true),
            (&ranged, &plain, false, false),
            (&plain, &turbo, false, false),
            (&turbo, &viridis, false, false),
        ] {
            let manifest = manifest(&format!("material.color = {now}"));
            let planned = rewritten(&manifest, COLOR, Some(planned.as_str()));
            let found = changes(&manifest, &planned, has_rgb);
            assert_eq!(found.is_empty(), is_same, "{now} {planned:?} {found:?}");
        }
    }
}
