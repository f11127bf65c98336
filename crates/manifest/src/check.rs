//! Dependencies between tables: what one allows another.

use spherule_jobs::FrameRange;
use spherule_tracer::render::{FilmPlane, MAX_LITERAL_DEPTH, MAX_SIDE};
use spherule_tracer::surface::MaterialId;

use super::bonds::BondSearch;
use super::camera::ProjectionKind;
use super::channel::Channel;
use super::keys::Keys;
use super::overlay::{Overlay, OverlayKind};
use super::reader::Section;
use super::{Manifest, ManifestError};

/// Maximum number of clips.
const MAX_CLIPS: usize = 64;

/// Maximum number of kinds of arrows.
const MAX_ARROWS: usize = 16;

/// Maximum number of overlays.
const MAX_OVERLAYS: usize = 64;

const NEEDS_NUMBER: &str =
    "several frames would get the same name; put #### into the name (example: frame.####.exr)";

impl Manifest {
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
    }

    /// Checks the lengths of lists.
    fn check_counts(&self, root: &mut Section<'_>) {
        let meshes = self.meshes.len();
        let arrows = self.arrows.len();
        if arrows > MAX_ARROWS {
            let what = format!("{arrows} kinds of arrows, but at most {MAX_ARROWS} are possible");
            root.wrong("arrows", &what);
        }
        // The simulation cell, arrows, trails and bonds take the places of meshes
        let others = usize::from(self.cell.visible)
            + usize::from(self.trails.frames > 0)
            + usize::from(self.bonds.find != BondSearch::None)
            + arrows.min(MAX_ARROWS);
        let max = MaterialId::MAX_MESHES - others;
        if meshes > max {
            root.wrong("mesh", &format!("{meshes} meshes, but at most {max} are possible"));
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
        let part = [("crop", image.crop.is_some()), ("overscan", image.overscan > 0)];
        for (key, _) in part.iter().filter(|(_, is_given)| *is_given) {
            let what = "is given, but stereo pairs are rendered as a whole; remove it";
            root.section("image").wrong(key, what);
        }
        if image.crop.is_none() && image.overscan == 0 && self.picture().data_size().is_none() {
            let what = format!(
                "makes the picture larger than {MAX_SIDE} pixels; make image.width smaller"
            );
            root.section("camera").wrong("stereo", &what);
        }
        if self.output.channels.contains(&Channel::plane(FilmPlane::Motion)) {
            let what = "motion is given, but stereo pairs have no such channel; remove it";
            root.section("output").wrong("channels", what);
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
