//! The legend of a picture: its colours with their values, and the time. All text of a picture has one size.

use glam::DVec3;
use toml::Table;

use super::Rules;
use crate::manifest::{Overlay, Override, ProjectionKind, TextSize};
use crate::scene::{DEFAULT_AZIMUTH, DEFAULT_ELEVATION, view_direction};

/// Height of text as a fraction of the picture.
const TEXT_SIZE: TextSize = TextSize::Fraction(0.032);

/// The same on paper: what journals ask for.
const TEXT_ON_PAPER: TextSize = TextSize::Points(7.0);

/// Smaller pictures, in pixels of their shorter side, have no legend: its text could not be read.
const MIN_SIDE: u32 = 240;

/// A plane with this part of the aspect of the picture leaves no room for a legend in its corners.
const FILLS: f64 = 0.75;

/// A body that is so many times wider than the picture leaves room below it, and none at its sides.
const WIDE: f64 = 1.25;

/// The type of overlay that shows the colours.
pub(super) const COLORS: &str = "colorbar";
/// The type of overlay that shows the time.
pub(super) const TIME: &str = "text";

impl Rules<'_> {
    /// Adds what a legend has and the manifest lacks: an overlay that is given replaces that of the same type.
    pub(super) fn overlays(&mut self) {
        let has_legend = self.has_legend();
        // The size of texts follows from the picture
        let size = self.text_size(has_legend);
        if let Some(size) = size {
            self.set_text_size(size);
        }
        if !has_legend {
            return;
        }
        // Add a colour bar and the time where they mean something
        let mut kinds = Vec::new();
        if self.has_mapped_colors() {
            kinds.push(COLORS);
        }
        if self.facts.has_time {
            kinds.push(TIME);
        }
        for kind in kinds {
            let mut given = self.manifest.overlays.iter();
            if given.all(|overlay| overlay.kind.type_name() != kind) {
                let mut item = Table::new();
                item.insert("type".to_owned(), kind.into());
                item.extend(size.map(|size| ("size".to_owned(), size.to_value())));
                if kind == COLORS && self.may_have_strips() {
                    item.insert("layout".to_owned(), "auto".into());
                }
                item.extend(self.place_of(kind).map(|(key, value)| (key.to_owned(), value.into())));
                let item = Override::append("overlay", item, "the defaults");
                self.found.settings.extend(item);
            }
        }
    }

    /// How the colours, or the time, do not cover particles that leave no corner free: a wide body has room below it, and a
    /// plane or a cloud that fills the picture has room at its side.
    fn place_of(&self, kind: &str) -> Option<(&'static str, &'static str)> {
        let [width, height] = self.manifest.image.size();
        let aspect = self.shown_aspect()? * f64::from(height) / f64::from(width);
        let beside = Some(("layout", "beside")).filter(|_| self.may_have_strips());
        if self.has_set("camera.fit") {
            return beside;
        }
        if self.facts.flat_axis().is_some() {
            return beside.filter(|_| aspect > FILLS);
        }
        if self.has_set("cell.visible") {
            return None;
        }
        Some(("orientation", "horizontal")).filter(|_| aspect > WIDE && kind == COLORS)
    }

    /// Whether overlays may be beside the picture.
    fn may_have_strips(&self) -> bool {
        self.manifest.against_strips().is_none()
    }

    /// Width of the particles in the picture, divided by their height; none if they are not seen from the side of the rules.
    fn shown_aspect(&self) -> Option<f64> {
        let (min, max) = self.facts.bounds?;
        let extent = max - min;
        if let Some(axis) = self.facts.flat_axis() {
            let up = self.up_direction();
            let vertical =
                if up[axis] == 0.0 { (up.abs() * extent).element_sum() } else { extent.y };
            let across = extent.element_sum() - vertical;
            return Some(across / vertical).filter(|aspect| aspect.is_finite());
        }
        if self.has_set("camera.up") {
            let [across, vertical, _] = self.facts.axes?.deviations;
            return Some(across / vertical).filter(|aspect| aspect.is_finite());
        }
        let up = self.up_direction();
        let direction = view_direction(up, DEFAULT_AZIMUTH, DEFAULT_ELEVATION);
        let right = direction.cross(up).normalize_or(DVec3::X);
        let [across, vertical] =
            [right, right.cross(direction)].map(|axis| (axis.abs() * extent).element_sum());
        Some(across / vertical).filter(|aspect| aspect.is_finite())
    }

    fn has_legend(&self) -> bool {
        let manifest = self.manifest;
        let [width, height] = manifest.image.size();
        let is_plain = manifest.camera.projection != ProjectionKind::Equirectangular
            && !manifest.camera.stereo
            && manifest.image.crop.is_none();
        // An empty list is given, too
        let is_open = self.source.lacks("overlay") || !manifest.overlays.is_empty();
        let is_wanted = manifest.legend && manifest.look.has_legend();
        is_wanted && is_open && is_plain && width.min(height) >= MIN_SIDE
    }

    /// The size of all text that has none of its own: that of the first overlay with one. None if there is no reason to
    /// change it.
    fn text_size(&self, has_legend: bool) -> Option<TextSize> {
        let mut given = self.manifest.overlays.iter();
        let own = given.find(|overlay| !overlay.has_default_size()).map(|overlay| overlay.size);
        let usual = match self.manifest.image.dpi {
            Some(_) => Some(TEXT_ON_PAPER),
            None => Some(TEXT_SIZE).filter(|_| has_legend),
        };
        own.filter(|_| has_legend).or(usual)
    }

    fn set_text_size(&mut self, size: TextSize) {
        let overlays = self.manifest.overlays.iter().enumerate();
        let open = overlays.filter(|(_, overlay)| Overlay::has_default_size(overlay));
        let sizes = open.filter_map(|(index, _)| {
            let key = format!("overlay.{index}.size");
            Override::new(&key, size.to_value(), "the defaults").ok()
        });
        self.found.settings.extend(sizes);
    }
}
