//! The legend of a picture: its colours with their values, and the time. All text of a picture has one size.

use toml::Table;

use super::Rules;
use crate::manifest::{Overlay, Override, ProjectionKind, TextSize};

/// Height of text as a fraction of the picture.
const TEXT_SIZE: TextSize = TextSize::Fraction(0.032);

/// The same on paper: what journals ask for.
const TEXT_ON_PAPER: TextSize = TextSize::Points(7.0);

/// Smaller pictures, in pixels of their shorter side, have no legend: its text could not be read.
const MIN_SIDE: u32 = 240;

/// The type of overlay that shows the colours.
pub(super) const COLORS: &str = "colorbar";
/// The type of overlay that shows the time.
pub(super) const TIME: &str = "text";

impl Rules<'_> {
    /// Adds what a legend has and the manifest lacks: an overlay that is given replaces that of the same type.
    pub(super) fn overlays(&mut self) {
        let has_legend = self.has_legend();
        let size = self.text_size(has_legend);
        if let Some(size) = size {
            self.set_text_size(size);
        }
        if !has_legend {
            return;
        }
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
                let item = Override::append("overlay", item, "the defaults");
                self.found.settings.extend(item);
            }
        }
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
