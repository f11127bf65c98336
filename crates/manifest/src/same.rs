//! Compares settings with those of an older job, which may be written differently for the same images.
//!
//! Keys and values have changed between versions. A job resumes with the settings of its plan, so differences without
//! an effect on the images must not count as changes.

use spherule_surface::SprayStyle;
use spherule_tracer::render::{IntegratorKind, RendererKind};

use super::value::Value;
use super::{
    ColorMapping, ColorSetting, DeviceSetting, EnvironmentKind, ExtractSun, GroundKind,
    GroundReach, GroundSetting, Manifest, MapName,
};

const MIN_WEIGHT: &str = "render.min_weight";
const COLOR: &str = "material.color";
const INTEGRATOR: &str = "render.integrator";
const GROUND: &str = "render.ground";
const GROUND_WETNESS: &str = "render.ground_wetness";
const SPRAY_STYLE: &str = "surface.spray_style";
/// The defaults of older versions.
const OLD_INTEGRATOR: &str = "\"whitted\"";
const OLD_GROUND: &str = "false";
const OLD_GROUND_WETNESS: &str = "0.0";
const OLD_SPRAY_STYLE: &str = "\"spheres\"";
/// Earlier versions left suns in images of the environment, and saw these in 512x256 directions.
const EXTRACT_SUN: &str = "environment.extract_sun";
const DETAIL: &str = "environment.detail";
/// The ground of earlier versions had no horizon.
const GROUND_REACH: &str = "render.ground_reach";
/// Keys whose defaults have changed.
const CHANGED_DEFAULTS: [(&str, &str); 9] = [
    (INTEGRATOR, OLD_INTEGRATOR),
    (GROUND, OLD_GROUND),
    (GROUND_WETNESS, OLD_GROUND_WETNESS),
    (SPRAY_STYLE, OLD_SPRAY_STYLE),
    (EXTRACT_SUN, "\"off\""),
    (DETAIL, "false"),
    (GROUND_REACH, "\"near\""),
    // No value gives the skies of versions without these keys
    ("environment.turbidity", ""),
    ("environment.albedo", ""),
];
/// The default of `mode` of a clip.
const WHOLE_PARTICLES: &str = "\"particles\"";
const SURFACE: &str = "render.surface";
/// The value of [`SURFACE`] in older versions, and the equivalent current one.
const UNION: [&str; 2] = ["\"medium\"", "\"union\""];
/// The renderer; not a key of manifests as long as there is only one.
pub(super) const RENDERER: &str = "renderer";
/// Whether glass or water is rough; not a key of manifests.
pub(super) const ROUGH_INTERFACE: &str = "material.rough_interface";

/// Whether previews of images without background have alpha; not a key of manifests.
pub(super) const PREVIEW_ALPHA: &str = "output.preview_alpha";

impl Manifest {
    /// Gives automatic settings the defaults of the version that made a plan with the settings `planned`, so that a job
    /// is finished as it was begun.
    pub fn adopt_old_defaults(&mut self, planned: &[(String, String)]) {
        let is_old = |key: &str, old: &str| {
            let found = planned.iter().find(|(k, _)| k == key);
            found.is_none_or(|(_, value)| value == old)
        };
        let render = &mut self.render;
        let gpu = format!("{:?}", RendererKind::Gpu.name());
        if render.device == DeviceSetting::Auto && planned.contains(&(RENDERER.to_owned(), gpu)) {
            render.device = DeviceSetting::Gpu;
        }
        if render.integrator.is_none() && is_old(INTEGRATOR, OLD_INTEGRATOR) {
            render.integrator = Some(IntegratorKind::Whitted);
        }
        if render.ground.is_none() && is_old(GROUND, OLD_GROUND) {
            render.ground = Some(GroundSetting::of(GroundKind::None));
        }
        // Versions without these keys had dry ground, spray of spheres, and previews with a background
        let has = |name: &str| planned.iter().any(|(key, _)| key == name);
        if self.has_path_traced_body() && !has(GROUND_WETNESS) {
            self.render.ground_wetness = 0.0;
        }
        if self.has_path_traced_spray() && !has(SPRAY_STYLE) {
            self.surface.spray_style = SprayStyle::Spheres;
        }
        if self.has_environment(EnvironmentKind::Image) && !has(EXTRACT_SUN) {
            self.environment.extract_sun = ExtractSun::Off;
            self.environment.detail = false;
        }
        if !has(GROUND_REACH) {
            self.render.ground_reach = GroundReach::Near;
        }
        if self.has_transparent_previews() && !has(PREVIEW_ALPHA) {
            self.has_opaque_previews = true;
        }
    }

    /// The [`Manifest::settings`], but written as in the `planned` settings of a job if that means the same images.
    /// `has_rgb`: the attribute for the colours of the job contains colours.
    pub fn settings_as_planned(
        &self,
        planned: &[(String, String)],
        has_rgb: bool,
    ) -> Vec<(String, String)> {
        let value = |key: &str| planned.iter().find(|(k, _)| k == key).map(|(_, v)| v);
        let mut settings = self.settings();
        self.leave_out_unplanned(&mut settings, value);
        self.write_as_planned(&mut settings, value, has_rgb);
        settings
    }

    /// Leaves out settings that the version of a plan did not know, if it made the same images. `value`: those of the
    /// plan.
    fn leave_out_unplanned<'p>(
        &self,
        settings: &mut Vec<(String, String)>,
        value: impl Fn(&str) -> Option<&'p String>,
    ) {
        match (self.literal_min_weight(), value(MIN_WEIGHT)) {
            // No image depends on it. If those of the job did, the material has changed as well.
            (None, Some(old)) => settings.push((MIN_WEIGHT.to_owned(), old.clone())),
            // Versions without this key always traced both branches.
            (Some(0.0), None) => settings.retain(|(key, _)| key != MIN_WEIGHT),
            _ => {}
        }
        // Versions without a key made the same images as its current default, or as its old one
        let mut usual = Self::new("").settings();
        usual.retain(|(key, _)| CHANGED_DEFAULTS.iter().all(|(changed, _)| key != changed));
        usual.extend(CHANGED_DEFAULTS.map(|(key, value)| (key.to_owned(), value.to_owned())));
        let is_usual =
            |setting: &(String, String)| usual.contains(setting) && setting.0 != MIN_WEIGHT;
        settings.retain(|setting| value(&setting.0).is_some() || !is_usual(setting));
        // Versions without modes of clips drew whole particles
        settings.retain(|(key, default)| {
            let is_mode = key.starts_with("clip.") && key.ends_with(".mode");
            !is_mode || default != WHOLE_PARTICLES || value(key).is_some()
        });
        // Versions without this key had one renderer.
        if value(RENDERER).is_none() {
            settings.retain(|(key, _)| key != RENDERER);
        }
    }

    /// Writes settings as the plan does if that means the same images.
    fn write_as_planned<'p>(
        &self,
        settings: &mut [(String, String)],
        value: impl Fn(&str) -> Option<&'p String>,
        has_rgb: bool,
    ) {
        // The usual integrator may be written by name
        if let Some(old) = value(INTEGRATOR)
            && old != OLD_INTEGRATOR
            && self.integrator() == IntegratorKind::Path
            && let Some((_, new)) = settings.iter_mut().find(|(key, _)| key == INTEGRATOR)
        {
            new.clone_from(old);
        }
        // Use the old names of values
        if value(SURFACE).is_some_and(|old| old == UNION[0])
            && let Some((_, new)) = settings.iter_mut().find(|(key, _)| key == SURFACE)
            && new == UNION[1]
        {
            UNION[0].clone_into(new);
        }
        if let Some(old) = value(COLOR)
            && self.has_color_written(old, has_rgb)
            && let Some((_, new)) = settings.iter_mut().find(|(key, _)| key == COLOR)
        {
            new.clone_from(old);
        }
    }

    /// [`super::Render::min_weight`], if images depend on it.
    fn literal_min_weight(&self) -> Option<f32> {
        self.branches_at_spheres().then_some(self.render.min_weight)
    }

    /// Whether `text` is another form of the same colour by an attribute: with or without the default map. All older
    /// versions wrote it.
    fn has_color_written(&self, text: &str, has_rgb: bool) -> bool {
        let ColorSetting::Mapped(by) = &self.material.color else {
            return false;
        };
        if by.attribute.is_none() {
            return false;
        }
        // Attributes with colours are only mapped if a map is given.
        let is_mapped = by.range.is_some() || !has_rgb;
        let written = |map| {
            let same = ColorMapping { map, ..by.clone() };
            ColorSetting::Mapped(same).toml() == text
        };
        let is_usual = by.map.is_none_or(|map| map == MapName::DEFAULT);
        is_mapped && is_usual && (written(None) || written(Some(MapName::DEFAULT)))
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

    /// The settings of `manifest` as another version may have written them: `key` has another value, or is missing.
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
    fn jobs_of_older_versions_keep_their_integrator_and_ground() {
        let (mut old, mut current) = (manifest("render.integrator = \"whitted\""), manifest(""));
        old.render.ground = Some(GroundSetting::of(GroundKind::None));
        // Plans of versions with and without the keys
        let with = old.settings();
        let without = rewritten(&old, INTEGRATOR, None);
        for planned in [with, without] {
            assert_eq!(changes(&current, &planned, false).len(), 2);
            let mut adopted = current.clone();
            adopted.adopt_old_defaults(&planned);
            assert_eq!(adopted.integrator(), IntegratorKind::Whitted);
            assert_eq!(changes(&adopted, &planned, false), [""; 0]);
        }
        // Versions selected the integrator for a term with its default, too
        let mut named = manifest("material.transmission = 0.0");
        let whitted_plan = manifest("render.integrator = \"whitted\"").settings();
        named.adopt_old_defaults(&whitted_plan);
        assert_eq!(named.integrator(), IntegratorKind::Whitted);
        assert_eq!(changes(&named, &whitted_plan, false), [""; 0]);
        // A plan of this version
        let planned = current.settings();
        current.adopt_old_defaults(&planned);
        assert_eq!(current, manifest(""));
        let named = manifest("render.integrator = \"path\"");
        assert_eq!(changes(&named, &planned, false), [""; 0]);
        assert_eq!(changes(&current, &named.settings(), false), [""; 0]);
        let whitted = manifest("render.integrator = \"whitted\"");
        assert_ne!(changes(&whitted, &planned, false), [""; 0]);
    }

    #[test]
    fn jobs_of_older_versions_keep_their_spray() {
        let spray = "render.surface = \"smooth\"\nsurface.spray = true\n";
        let current = manifest(spray);
        let planned = rewritten(&current, SPRAY_STYLE, None);
        assert_eq!(
            changes(&current, &planned, false),
            ["surface.spray_style: (not set) -> \"soft\""]
        );
        let mut adopted = current.clone();
        adopted.adopt_old_defaults(&planned);
        assert!(!adopted.draws_soft_spray() && current.draws_soft_spray());
        assert_eq!(changes(&adopted, &planned, false), [""; 0]);
        let mut same = current.clone();
        same.adopt_old_defaults(&current.settings());
        assert_eq!(same, current);
        // Nothing else depends on it
        for rest in ["", "render.surface = \"smooth\"", "render.integrator = \"whitted\""] {
            let settings = manifest(rest).settings();
            assert!(settings.iter().all(|(key, _)| key != SPRAY_STYLE), "{rest}");
        }
    }

    #[test]
    fn jobs_of_older_versions_keep_the_background_of_previews() {
        let current = manifest("output.transparent = true");
        let planned = rewritten(&current, PREVIEW_ALPHA, None);
        let mut adopted = current.clone();
        adopted.adopt_old_defaults(&planned);
        assert!(adopted.has_opaque_previews && !current.has_opaque_previews);
        assert_eq!(changes(&adopted, &planned, false), [""; 0]);
        let mut same = current.clone();
        same.adopt_old_defaults(&current.settings());
        assert_eq!(same, current);
    }

    #[test]
    fn jobs_of_older_versions_keep_their_suns() {
        let current = manifest("environment.image = \"hall.exr\"");
        let mut planned = rewritten(&current, EXTRACT_SUN, None);
        planned.retain(|(key, _)| key != DETAIL);
        assert_eq!(changes(&current, &planned, false).len(), 2);
        let mut adopted = current.clone();
        adopted.adopt_old_defaults(&planned);
        assert_eq!(adopted.environment.extract_sun, ExtractSun::Off);
        assert!(!adopted.environment.detail);
        assert_eq!(changes(&adopted, &planned, false), [""; 0]);
        let mut same = current.clone();
        same.adopt_old_defaults(&current.settings());
        assert_eq!(same, current);
        // Nothing else depends on it
        assert!(manifest("").settings().iter().all(|(key, _)| key != EXTRACT_SUN));
    }

    #[test]
    fn jobs_of_older_versions_keep_their_dry_ground() {
        let current = manifest("render.surface = \"smooth\"");
        let planned = rewritten(&current, GROUND_WETNESS, None);
        assert_eq!(changes(&current, &planned, false), ["render.ground_wetness: (not set) -> 0.5"]);
        let mut adopted = current.clone();
        adopted.adopt_old_defaults(&planned);
        assert_eq!(adopted.render.ground_wetness, 0.0);
        assert_eq!(changes(&adopted, &planned, false), [""; 0]);
        let mut same = current.clone();
        same.adopt_old_defaults(&current.settings());
        assert_eq!(same, current);
    }

    #[test]
    fn min_weight_affects_only_transmissive_spheres() {
        let glass = "material.transmission = 1\n";
        for (rest, planned, expected) in [
            ("", None, ""),
            ("", Some("0.5"), ""),
            ("render.min_weight = 0.5", None, ""),
            ("render.surface = \"union\"\nmaterial.transmission = 1", None, ""),
            (glass, None, "render.min_weight: (not set) -> 0.0009765625"),
            (glass, Some("0.5"), "render.min_weight: 0.5 -> 0.0009765625"),
            ("material.transmission = 1\nrender.min_weight = 0", None, ""),
        ] {
            let manifest = manifest(rest);
            let planned = rewritten(&manifest, MIN_WEIGHT, planned);
            let found = changes(&manifest, &planned, false);
            assert_eq!(found.join("; "), expected, "{rest}");
        }
    }

    #[test]
    fn missing_keys_have_their_defaults() {
        let key = "image.samples";
        let plain = manifest("");
        let without = rewritten(&plain, key, None);
        assert!(changes(&plain, &without, false).is_empty());
        let other = manifest("image.samples = 3");
        let found = changes(&other, &without, false);
        assert_eq!(found, ["image.samples: (not set) -> 3"]);
    }

    #[test]
    fn clips_of_older_versions_draw_whole_particles() {
        let clip = "[[clip]]\ntype = \"plane\"\nnormal = \"x\"\n";
        let planned = rewritten(&manifest(clip), "clip.0.mode", None);
        assert_eq!(changes(&manifest(clip), &planned, false), [""; 0]);
        let cut = manifest(&format!("{clip}mode = \"cut\""));
        let found = changes(&cut, &planned, false);
        assert_eq!(found, ["clip.0.mode: (not set) -> \"cut\""]);
    }

    #[test]
    fn medium_is_an_obsolete_name_of_union() {
        let union = manifest("render.surface = \"union\"");
        let planned = rewritten(&union, SURFACE, Some("\"medium\""));
        assert!(changes(&union, &planned, false).is_empty());
        assert_eq!(manifest("render.surface = \"medium\""), union);
        let spheres = changes(&manifest(""), &planned, false).join("; ");
        assert!(spheres.contains("render.surface: \"medium\" -> \"spheres\""), "{spheres}");
    }

    #[test]
    fn default_map_may_be_explicit() {
        let by = |rest: &str| format!("{{ attribute = \"density\"{rest} }}");
        let (plain, viridis, turbo) = (by(""), by(", map = \"viridis\""), by(", map = \"turbo\""));
        let range = ", range = [1.0, 2.0]";
        let (ranged, both) = (by(range), by(&format!(", map = \"viridis\"{range}")));
        for (now, planned, has_rgb, is_same) in [
            (&plain, &viridis, false, true),
            (&viridis, &plain, false, true),
            // The particles contain colours, which are used unchanged if there is no map.
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
