//! Dependencies between tables: what one allows another.

use glam::Vec3;
use spherule_jobs::FrameRange;
use spherule_surface::SurfaceKind;
use spherule_tracer::render::{
    FilmPlane, IntegratorKind, MAX_LITERAL_DEPTH, MAX_SIDE, MAX_TRANSMISSIVE_BODIES,
};
use spherule_tracer::scene::MaterialId;

use super::bonds::BondSearch;
use super::camera::ProjectionKind;
use super::channel::Channel;
use super::color::ColorSetting;
use super::keys::Keys;
use super::overlay::{Overlay, OverlayKind};
use super::problem::{Problem, Problems};
use super::reader::Section;
use super::rule::{Rule, rules};
use super::tree::TomlNode;
use super::{Manifest, ManifestError};

/// Maximum number of clips.
const MAX_CLIPS: usize = 64;

/// Maximum number of kinds of arrows.
const MAX_ARROWS: usize = 16;

/// Maximum number of styles.
const MAX_STYLES: usize = 64;

/// Maximum number of overlays.
const MAX_OVERLAYS: usize = 64;

const NEEDS_NUMBER: &str =
    "several frames would get the same name; put #### into the name (example: frame.####.exr)";

const RENDERED_AS_A_WHOLE: &str = "is given, but stereo pairs are rendered as a whole; remove it";
const IS_CLEAR: &str = "glass and water are transparent already; choose matte, plastic or metal, or leave the \
                        opacity out";

/// Rules between keys of different tables.
pub(super) const RULES: &[Rule] = rules! {
    "camera.stereo" Is["true"] => "image.crop" Missing: RENDERED_AS_A_WHOLE;
    "camera.stereo" Is["true"] => "image.overscan" MissingOr["0"]: RENDERED_AS_A_WHOLE;
    "job.follow" Is["true"] => "trails.frames" MissingOr["0"]:
        "earlier frames may be completed later when job.follow is set; render the sequence when it is complete";
    "image.samples" Is["1"], "render.noise" MissingOr["off"] => "render.denoise" MissingOrNot["true"]:
        "needs at least 2 samples per pixel (image.samples), whose difference is the noise";
    // Each surface has options of its own
    "render.surface" MissingOr["spheres"] => "surface.normals" MissingOrNot["field"]:
        "\"field\" is for one body; for smooth normals of spheres take \"pca\", for one body set render.surface to \
         \"union\" or \"smooth\"";
    "render.surface" Is["smooth"] => "surface.normals" MissingOrNot["sphere", "pca"]:
        "a smooth surface has the normals of its field; take \"auto\" or \"field\", or set render.surface to \
         \"spheres\" or \"union\"";
    "render.surface" MissingOrNot["smooth"] => "surface.exact" MissingOr["false"]:
        "is for the smooth surface alone; set render.surface to \"smooth\", or leave it out (spheres are always exact)";
    "render.surface" MissingOr["spheres"] => "surface.spray" MissingOr["false"]:
        "lies beside one body; set render.surface to \"union\" or \"smooth\", or leave it out";
    "render.surface" MissingOrNot["smooth"] => "surface.whitewater" MissingOr["false"]:
        "lies on a smooth surface; set render.surface to \"smooth\", or leave it out";
    "surface.whitewater" Is["true"] => "surface.spray" MissingOr["false"]:
        "is given, but whitewater has spray of its own; leave one of both out";
    "render.surface" MissingOr["spheres"], "surface.normals" Is["field", "pca"] => "camera.shutter" MissingOr["0"]:
        "motion blur of spheres needs surface.normals = \"sphere\"";
    "render.surface" IsNot["spheres"] => "material.part" Missing:
        "one body has one material; set render.surface to \"spheres\", or leave the parts out";
    "render.surface" IsNot["spheres"] => "material.opacity" MissingOr["1"]:
        "only separate spheres have an opacity; set render.surface to \"spheres\", or make the body of glass or water \
         (material.type)";
    // Clear spheres have no opacity
    "material.type" Is["glass", "water"] => "material.opacity" MissingOr["1"]: IS_CLEAR;
    "material.type" MissingOr["auto", "whitted"], "material.transmission" IsNot["0"]
        => "material.opacity" MissingOr["1"]: IS_CLEAR;
    // The Whitted integrator has no materials of parts and no shadow catcher
    "render.integrator" Is["whitted"] => "material.part" Missing:
        "render.integrator = \"whitted\" has one material for all particles; choose \"path\" (--integrator path), or \
         leave the parts out";
    "render.integrator" Is["whitted"] => "mist.visibility" Missing:
        "render.integrator = \"whitted\" has no mist; choose \"path\" (--integrator path), or leave it out";
    "render.integrator" Is["whitted"] => "render.ground" MissingOrNot["shadow_catcher"]:
        "render.integrator = \"whitted\" has no shadow catcher; choose \"path\" (--integrator path), or a plain ground";
};

const OPAQUE: &str =
    "has no effect: light does not enter this material; set type = \"glass\" or \"water\"";
const NOT_FOLLOWED: &str = "render.integrator = \"whitted\" does not follow the light that media scatter; \
     choose \"path\" (--integrator path), or leave it out";

impl Manifest {
    /// Checks the rules between keys of different tables, for a manifest that was made or changed by a program.
    ///
    /// # Errors
    /// A key breaks a rule.
    pub fn check_rules(&self) -> Result<(), ManifestError> {
        let tree =
            TomlNode::parse(&self.entries().file()).expect("what is written as TOML is TOML");
        let problems = Problems::default();
        Section::root(&tree, &problems).check(RULES);
        let first = problems.errors.into_inner().into_iter().next();
        first.map_or(Ok(()), |Problem { key, what, .. }| {
            Err(ManifestError::of_key(&key, format!("{key}: {what}")))
        })
    }

    /// Checks that each of `frame_count` frames gets a separate image.
    ///
    /// # Errors
    /// There are several frames, or more may follow, but the name of the output has no number.
    pub fn check_frame_count(&self, frame_count: usize) -> Result<(), ManifestError> {
        let range = self.input.frames.as_ref();
        let more_may_come = self.job.follow && range.is_none_or(FrameRange::has_several);
        if self.output.path.has_number() || (frame_count <= 1 && !more_may_come) {
            return Ok(());
        }
        let count = match frame_count {
            several @ 2.. => format!("{several} frames"),
            _ => "all frames that come".to_owned(),
        };
        let what = format!(
            "output.path: {} for {count}: {NEEDS_NUMBER}, or select one frame (input.frames)",
            self.output.path
        );
        Err(ManifestError::of_key("output.path", what))
    }

    /// Checks dependencies between tables.
    pub(super) fn check(&self, root: &mut Keys<'_>) {
        let Some(root) = root.reading() else {
            return;
        };
        root.check(RULES);
        self.check_counts(root);
        self.image.check(root);
        self.check_layout(root);
        if self.camera.stereo {
            self.check_stereo(root);
        }
        if self.camera.projection == ProjectionKind::Equirectangular {
            self.check_equirectangular(root);
        }
        self.check_branches(root);
        self.check_styles(root);
        self.check_scattering(root);
        self.check_noise(root);
        self.mist.check(root);
    }

    /// Checks that tiles may have as many samples as they have at least.
    fn check_noise(&self, root: &mut Section<'_>) {
        let least = self.image.samples;
        if let Some(most) = self.image.max_samples.filter(|_| self.render.noise.is_some())
            && most < least
        {
            let what = format!("{most} is below image.samples, which is {least}");
            root.section("image").wrong("max_samples", &what);
        }
    }

    /// Checks that thin glass has one colour, and that several clear kinds of particles are bodies, and not too many.
    fn check_styles(&self, root: &mut Section<'_>) {
        for (number, style) in self.styles.iter().enumerate() {
            if style.is_thin_glass() && matches!(style.color, ColorSetting::Mapped(_)) {
                let what = "thin glass has one colour; set [red, green, blue] or a name";
                root.wrong(&format!("style.{number}.color"), what);
            }
        }
        // List the clear ones: the key that makes each clear, and the one by which it becomes a body
        let of_rest = (self.material.is_clear()).then(|| {
            let is_body = self.surface.kind != SurfaceKind::Spheres;
            ("material.type".to_owned(), "render.surface".to_owned(), is_body)
        });
        let styles = self.styles.iter().enumerate().filter(|(_, style)| style.is_clear());
        let styles = styles.map(|(number, style)| {
            (format!("style.{number}.material"), format!("style.{number}.draw"), style.is_body())
        });
        let clear: Vec<_> = of_rest.into_iter().chain(styles).collect();
        // Check them
        if clear.len() > 1 {
            for (key, draw, _) in clear.iter().filter(|(.., is_body)| !is_body) {
                let others = clear.iter().map(|(other, ..)| other);
                let other = others.filter(|other| *other != key).min().map_or("", String::as_str);
                let what = format!(
                    "{other} is clear, too, and only one kind of clear particles may be separate spheres; \
                     set {draw} = \"smooth\" or \"union\""
                );
                root.wrong(key, &what);
            }
        }
        if let Some((key, ..)) = clear.get(MAX_TRANSMISSIVE_BODIES) {
            let count = clear.len();
            let what =
                format!("{count} clear bodies, but at most {MAX_TRANSMISSIVE_BODIES} are possible");
            root.wrong(key, &what);
        }
    }

    /// Checks that the integrator follows the light that media scatter, and warns where light does not enter them.
    fn check_scattering(&self, root: &mut Section<'_>) {
        let of_rest = ("material".to_owned(), self.material.scattering, self.material.is_clear());
        let of_styles = self.styles.iter().enumerate().filter_map(|(number, style)| {
            let own = style.material.as_ref()?;
            Some((format!("style.{number}.material"), own.scattering, own.is_clear()))
        });
        for (table, scattering, is_clear) in std::iter::once(of_rest).chain(of_styles) {
            if scattering == Vec3::ZERO {
                continue;
            }
            let key = format!("{table}.scattering");
            if !is_clear {
                root.warn(&key, OPAQUE);
            } else if self.integrator() == IntegratorKind::Whitted {
                root.wrong(&key, NOT_FOLLOWED);
            }
        }
    }

    /// Checks the lengths of lists.
    fn check_counts(&self, root: &mut Section<'_>) {
        let meshes = self.meshes.len();
        let arrows = self.arrows.len();
        if arrows > MAX_ARROWS {
            let what = format!("{arrows} kinds of arrows, but at most {MAX_ARROWS} are possible");
            root.wrong("arrows", &what);
        }
        let styles = self.styles.len();
        if styles > MAX_STYLES {
            let what = format!("{styles} styles, but at most {MAX_STYLES} are possible");
            root.wrong("style", &what);
        }
        // All that has a material of its own has a place in the scene
        let parts = self.material.parts.len();
        let others = MaterialId::BASIC
            + usize::from(self.cell.visible)
            + usize::from(self.trails.frames > 0)
            + usize::from(self.bonds.find != BondSearch::None)
            + arrows.min(MAX_ARROWS)
            + 2 * styles.min(MAX_STYLES);
        let max = MaterialId::MAX - others;
        if meshes + parts > max {
            let what = format!(
                "{meshes} meshes and {parts} materials of parts (material.part), but at most {max} are possible"
            );
            root.wrong("mesh", &what);
        }
        // Refuse longer lists than a picture has places for
        let clips = self.clips.len();
        if clips > MAX_CLIPS {
            let what = format!("{clips} clips, but at most {MAX_CLIPS} are possible");
            root.wrong("clip", &what);
        }
        let overlays = self.overlays.len();
        if overlays > MAX_OVERLAYS {
            let what = format!("{overlays} overlays, but at most {MAX_OVERLAYS} are possible");
            root.wrong("overlay", &what);
        }
    }

    /// Checks that paths which branch at each sphere end.
    fn check_branches(&self, root: &mut Section<'_>) {
        let depth = self.render.max_depth;
        let is_limited = self.render.min_weight > 0.0 || depth <= MAX_LITERAL_DEPTH;
        if is_limited || !self.branches_at_spheres() {
            return;
        }
        root.section("render").wrong(
            "min_weight",
            &format!(
                "0 follows both branches at transmissive spheres, which doubles the rays at each level; with \
                 max_depth = {depth} choose at least 1e-5, or a max_depth of at most {MAX_LITERAL_DEPTH}"
            ),
        );
    }

    /// Checks that there may be overlays beside the picture.
    fn check_layout(&self, root: &mut Section<'_>) {
        if !self.has_strips() {
            return;
        }
        if let Some(key) = self.against_strips() {
            let what = format!(
                "has overlays beside the picture (layout), which do not go with {key}; remove one of them"
            );
            root.wrong("overlay", &what);
        }
    }

    /// Checks that a stereo pair suits the image and the channels.
    fn check_stereo(&self, root: &mut Section<'_>) {
        let image = &self.image;
        if image.crop.is_none() && image.overscan == 0 && self.picture().data_size().is_none() {
            let what = format!(
                "makes the picture larger than {MAX_SIDE} pixels; make image.width smaller"
            );
            root.section("camera").wrong("stereo", &what);
        }
        for plane in [FilmPlane::Motion, FilmPlane::MotionBack] {
            if self.output.channels.contains(&Channel::plane(plane)) {
                let name = plane.name();
                let what =
                    format!("{name} is given, but stereo pairs have no such channel; remove it");
                root.section("output").wrong("channels", &what);
            }
        }
    }

    /// Checks that an equirectangular picture has its usual shape, and no scale.
    fn check_equirectangular(&self, root: &mut Section<'_>) {
        let is_scale_bar = |overlay: &Overlay| matches!(overlay.kind, OverlayKind::ScaleBar { .. });
        if self.overlays.iter().any(is_scale_bar) {
            let what = "has a scale bar, but an equirectangular picture has no scale; remove it";
            root.wrong("overlay", what);
        }
        let [width, height] = self.image.size();
        if width != 2 * height {
            root.section("camera").warn(
                "projection",
                &format!(
                    "equirectangular pictures are twice as wide as high, but this one is {width}x{height}; \
                     --width {0} --height {height} makes it so",
                    2 * height
                ),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn read(text: &str) -> Result<Manifest, String> {
        let text = format!("input.path = \"a\"\n{text}");
        Manifest::parse(&text, Path::new("job.toml")).map_err(|error| error.to_string())
    }

    #[test]
    fn contradictory_tables_are_refused() {
        for (text, message) in [
            ("surface.normals = \"field\"", "surface.normals: \"field\" is for one body"),
            ("surface.exact = true", "surface.exact: is for the smooth surface alone"),
            (
                "render.surface = \"union\"\nsurface.exact = true",
                "surface.exact: is for the smooth",
            ),
            ("surface.spray = true", "surface.spray: lies beside one body"),
            ("surface.whitewater = true", "surface.whitewater: lies on a smooth surface"),
            (
                "render.surface = \"union\"\nsurface.whitewater = true",
                "surface.whitewater: lies on a smooth surface; set render.surface to \"smooth\"",
            ),
            (
                "render.surface = \"smooth\"\nsurface.whitewater = true\nsurface.spray = true",
                "surface.spray: is given, but whitewater has spray of its own",
            ),
            (
                "render.surface = \"smooth\"\nsurface.normals = \"pca\"",
                "surface.normals: a smooth surface has the normals of its field",
            ),
            (
                "render.integrator = \"whitted\"\nrender.ground = \"shadow_catcher\"",
                "render.ground: render.integrator = \"whitted\" has no shadow catcher",
            ),
            (
                "camera.shutter = 0.5\nsurface.normals = \"pca\"",
                "camera.shutter: motion blur of spheres needs surface.normals",
            ),
            (
                "trails.frames = 3\njob.follow = true",
                "trails.frames: earlier frames may be completed later",
            ),
            (
                "material = { transmission = 1, opacity = 0.5 }",
                "material.opacity: glass and water are transparent already",
            ),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.starts_with("job.toml: line ") && error.contains(message), "{error}");
        }
        for text in [
            "surface.normals = \"pca\"",
            "render.surface = \"union\"\nsurface.normals = \"field\"\nsurface.spray = true",
            "render.surface = \"smooth\"\nsurface.exact = true",
            "render.surface = \"smooth\"\nsurface.whitewater = true\nsurface.spray = false",
            "render.integrator = \"whitted\"\nrender.ground = \"checker\"",
        ] {
            read(text).unwrap().check_rules().unwrap();
        }
    }

    #[test]
    fn what_programs_change_is_checked_too() {
        // The material selects the integrator, which has no parts
        let manifest = read("material.shininess = 5\n[[material.part]]\nparts = [1]").unwrap();
        let error = manifest.check_rules().unwrap_err();
        assert_eq!(error.key(), Some("material.part"));
        let expected = "material.part: render.integrator = \"whitted\" has one material";
        assert!(error.to_string().starts_with(expected), "{error}");
        let mut manifest = Manifest::new("a");
        manifest.check_rules().unwrap();
        manifest.surface.spray = true;
        let expected = "surface.spray: lies beside one body";
        assert!(manifest.check_rules().unwrap_err().to_string().starts_with(expected));
    }
}
