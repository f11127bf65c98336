//! `[[overlay]]`: what is drawn over previews.

use glam::Vec3;
use serde_json::{Value as Json, json};
use spherule_images::overlay::{Corner, Layout, Orientation, Template, TickChoice};

use super::bar_ticks::LabelFormat;
use super::field::Field;
use super::key::Key;
use super::keys::{Keys, keys};
use super::text_size::TextSize;
use super::value::{Fault, Named, Value, named, numbers_schema, quoted};

named!(
    Corner: TopLeft = "top-left",
    TopRight = "top-right",
    BottomLeft = "bottom-left",
    BottomRight = "bottom-right"
);

named!(Layout: Over = "over", Beside = "beside");

/// The place of one overlay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OverlayLayout {
    /// Over the picture where it covers no particles, otherwise beside it.
    Auto,
    /// Over the picture.
    Over,
    /// Beside the picture.
    Beside,
}

named!(OverlayLayout: Auto = "auto", Over = "over", Beside = "beside");

named!(Orientation: Vertical = "vertical", Horizontal = "horizontal");

pub(super) const ABOUT: &[&str] = &[
    "What is drawn over previews, and in the channel overlay, but never in RGBA: colour bars, text, scale bars, axes, \
     pictures",
];

/// The key `type`.
#[derive(Clone, Copy, PartialEq)]
enum OverlayType {
    ColorBar,
    Text,
    ScaleBar,
    Axes,
    Image,
}

named!(
    OverlayType: ColorBar = "colorbar",
    Text = "text",
    ScaleBar = "scale_bar",
    Axes = "axes",
    Image = "image"
);

/// What an overlay shows.
#[derive(Debug, Clone, PartialEq)]
pub enum OverlayKind {
    /// The colours of the particles.
    ColorBar {
        /// The title; by default the name of the value.
        title: Option<String>,
        /// The unit of the values, if it is shown.
        unit: Option<String>,
        /// Length as a fraction of the height of the picture.
        length: f32,
        /// Its direction.
        orientation: Orientation,
        /// Where ticks are; by default at round values and both ends.
        ticks: Option<TickChoice>,
        /// How numbers are written; by default as short as possible.
        format: Option<LabelFormat>,
        /// What values are multiplied by before they are shown.
        factor: Option<f64>,
    },
    /// Text.
    Text {
        /// The text; by default the time, or the frame number of files without times.
        text: Option<OverlayText>,
    },
    /// A length in the scene.
    ScaleBar {
        /// The length; by default a round one.
        length: Option<f64>,
        /// The unit of length, if it is shown.
        unit: Option<String>,
    },
    /// The directions of the axes.
    Axes,
    /// A picture.
    Image {
        /// The PNG file.
        path: String,
        /// Height as a fraction of the height of the picture that it is drawn over.
        height: f32,
    },
}

/// Text with variables.
#[derive(Debug, Clone, PartialEq)]
pub struct OverlayText {
    text: String,
    template: Template,
}

/// One `[[overlay]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Overlay {
    /// What it shows.
    pub kind: OverlayKind,
    /// Whether it is over or beside the picture; by default as the image says.
    pub layout: Option<OverlayLayout>,
    /// The corner; by default the one with the fewest particles.
    pub corner: Option<Corner>,
    /// Distance from the corner as fractions of the height of the picture.
    pub offset: [f64; 2],
    /// Height of text.
    pub size: TextSize,
    /// Colour of text and lines, linear RGB; by default black or white.
    pub color: Option<Vec3>,
}

/// Default height of text: 12 pixels at 480 rows.
const SIZE: f32 = 0.026;

impl Default for Overlay {
    fn default() -> Self {
        Self {
            kind: OverlayKind::of(OverlayType::ColorBar),
            layout: None,
            corner: None,
            offset: [0.04, 0.04],
            size: TextSize::Fraction(SIZE),
            color: None,
        }
    }
}

impl OverlayText {
    /// Reads a text with variables.
    ///
    /// # Errors
    /// See [`Template::parse`].
    pub fn parse(text: &str) -> Result<Self, String> {
        Ok(Self { text: text.to_owned(), template: Template::parse(text)? })
    }

    /// The text as it was written.
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// The text with its variables.
    pub const fn template(&self) -> &Template {
        &self.template
    }
}

impl OverlayKind {
    fn of(kind: OverlayType) -> Self {
        match kind {
            OverlayType::ColorBar => Self::ColorBar {
                title: None,
                unit: None,
                length: 0.4,
                orientation: Orientation::Vertical,
                ticks: None,
                format: None,
                factor: None,
            },
            OverlayType::Text => Self::Text { text: None },
            OverlayType::ScaleBar => Self::ScaleBar { length: None, unit: None },
            OverlayType::Axes => Self::Axes,
            OverlayType::Image => Self::Image { path: "logo.png".to_owned(), height: 0.1 },
        }
    }

    /// The name of its type in a manifest.
    pub fn type_name(&self) -> &'static str {
        let all = OverlayType::names().into_iter();
        let mut own = all.filter(|(kind, _)| *kind == self.overlay_type());
        own.next().map_or("", |(_, name)| name)
    }

    const fn overlay_type(&self) -> OverlayType {
        match self {
            Self::ColorBar { .. } => OverlayType::ColorBar,
            Self::Text { .. } => OverlayType::Text,
            Self::ScaleBar { .. } => OverlayType::ScaleBar,
            Self::Axes => OverlayType::Axes,
            Self::Image { .. } => OverlayType::Image,
        }
    }
}

impl Overlay {
    /// Whether the size of its text is the default.
    pub fn has_default_size(&self) -> bool {
        self.size == TextSize::Fraction(SIZE)
    }

    /// One overlay of each type.
    pub(super) fn examples() -> Vec<Self> {
        let of_type = |(kind, _)| Self { kind: OverlayKind::of(kind), ..Self::default() };
        OverlayType::names().into_iter().map(of_type).collect()
    }

    pub(super) fn keys(&mut self, keys: &mut Keys<'_>) {
        let mut kind = self.kind.overlay_type();
        let key = Key::new("type", &["colorbar | text | scale_bar | axes | image"]);
        keys.key(key.required("\"colorbar\" or \"text\", for example"), &mut kind);
        if let Some(section) = keys.reading() {
            // The type determines which keys are known, so the rest is not checked.
            if !section.has("type") {
                section.close();
                return;
            }
            self.kind = OverlayKind::of(kind);
        }
        match &mut self.kind {
            OverlayKind::ColorBar { title, unit, length, orientation, ticks, format, factor } => {
                keys!(keys:
                    /// Title above the bar
                    title => *title, example("\"Speed\""), unset("what the colours show");
                    /// Unit of the values, after the title
                    unit => *unit, example("\"m/s\""), unset("no unit");
                    /// Length of the bar as a fraction of the height of the picture
                    ///
                    /// Categories have swatches instead of a bar.
                    length => *length, above(0), to(1);
                    /// Direction: vertical | horizontal
                    orientation => *orientation;
                    /// Labels: about so many, or at these values in the unit that is shown
                    ticks => *ticks, example("[0, 2, 4]"), unset("round values and both ends");
                    /// Format of the numbers: ".2f", ".1e", "%.2e", ",.0f", as in texts
                    format => *format, example("\".2f\""), unset("as short as possible");
                    /// What values are multiplied by before they are shown: 0.001 for Pa as kPa
                    factor => *factor, from(1e-30), to(1e30), example("0.001"), unset("1");
                )
            }
            OverlayKind::Text { text } => keys!(keys:
                /// Text with {time:.2f}, {frame:04d}, {particles:,}, {file}, {density.min:.1f} or {density.max:.1f}
                ///
                /// Values are those of the frame. {{ and }} are braces. A line break is \n.
                text => *text, example("\"t = {time:.2f} s\""),
                    unset("the time, or the frame number of files without times");
            ),
            OverlayKind::ScaleBar { length, unit } => keys!(keys:
                /// Length in the scene
                ///
                /// It is exact in orthographic projection. In perspective, it is right at the distance of the centre of
                /// the particles.
                length => *length, unit("a length"), above(0), example("0.5"), unset("a round length");
                /// Unit of length
                unit => *unit, example("\"m\""), unset("no unit");
            ),
            OverlayKind::Axes => {}
            OverlayKind::Image { path, height } => keys!(keys:
                /// A PNG file, such as a logo; its alpha is kept
                path => *path, example("\"logo.png\""),
                    required("a picture needs its file, such as \"logo.png\"");
                /// Height as a fraction of the height of the picture
                height => *height, above(0), to(1);
            ),
        }
        keys!(keys:
            /// Place: auto | over | beside the picture, which is then smaller than the image
            ///
            /// auto is over the picture in a corner without particles, and beside it if there is none.
            /// Beside, overlays are at the right, or at the left if their corner is there; horizontal colour bars are
            /// below, or above. offset has no effect then.
            layout => self.layout, example("\"over\""), unset("that of image.layout");
            /// Corner: auto | top-left | top-right | bottom-left | bottom-right
            ///
            /// auto is the corner where the fewest particles of the surveyed frames are. Overlays in the same corner
            /// are stacked.
            corner => self.corner, or("auto");
            /// Horizontal and vertical distance from the corner, as fractions of the height of the picture
            offset => self.offset;
            /// Height of text as a fraction of the height of the picture, or in points on paper: "7pt"
            ///
            /// Points need the dots per inch of the picture, image.dpi, or 300 without it.
            size => self.size, above(0), to(0.25);
            /// Colour of text and lines, linear RGB, or auto: black or white
            color => self.color, or("auto"), from(0), to(1);
        );
    }
}

/// Largest offset.
const MAX_OFFSET: f64 = 10.0;

impl Value for [f64; 2] {
    fn kind(_: &Key) -> String {
        format!("two numbers from -{MAX_OFFSET} to {MAX_OFFSET}, such as [0.04, 0.04]")
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let is_near = |pair: &Self| pair.iter().all(|v| v.abs() <= MAX_OFFSET);
        field.as_numbers().filter(is_near).ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        format!("[{:?}, {:?}]", self[0], self[1])
    }

    fn schema(_: &Key) -> Json {
        let mut schema = numbers_schema(2);
        schema["items"]["minimum"] = json!(-MAX_OFFSET);
        schema["items"]["maximum"] = json!(MAX_OFFSET);
        schema
    }
}

impl Value for OverlayText {
    fn kind(_: &Key) -> String {
        "text in quotes".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let text = field.as_text().ok_or(Fault::Unwanted)?;
        Self::parse(text).map_err(Fault::Because)
    }

    fn toml(&self) -> String {
        quoted(&self.text)
    }

    fn schema(_: &Key) -> Json {
        json!({ "type": "string" })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Manifest;

    fn read(text: &str) -> Result<Vec<Overlay>, String> {
        let text = format!("input.path = \"a\"\n{text}");
        let manifest = Manifest::parse(&text, Path::new("job.toml"));
        manifest.map(|manifest| manifest.overlays).map_err(|e| e.to_string())
    }

    #[test]
    fn overlays_have_types() {
        assert_eq!(read("").unwrap(), []);
        let text = "[[overlay]]\ntype = \"colorbar\"\ntitle = \"Speed\"\nunit = \"m/s\"\ncorner = \"top-right\"\n\
                    [[overlay]]\ntype = \"text\"\ntext = \"{frame}\"\nsize = 0.05\noffset = [0.1, 0]";
        let found = read(text).unwrap();
        assert_eq!(found[0].corner, Some(Corner::TopRight));
        assert_eq!(found[1].offset, [0.1, 0.0]);
        let text = OverlayText::parse("{frame}").unwrap();
        assert_eq!(found[1].kind, OverlayKind::Text { text: Some(text) });
    }

    #[test]
    fn impossible_overlays_are_refused() {
        for (text, part) in [
            ("", "overlay.0.type: is missing"),
            ("type = \"colourbar\"", "did you mean colorbar?"),
            ("type = \"text\"\ntext = \"{tme}\"", "overlay.0.text: unknown variable `{tme}`"),
            ("type = \"text\"\ntitle = \"a\"", "overlay.0.title: unknown key"),
            ("type = \"axes\"\ncorner = \"top\"", "overlay.0.corner: expected one of"),
            (
                "type = \"axes\"\nsize = 0.5",
                "overlay.0.size: expected a number above 0, at most 0.25",
            ),
            ("type = \"axes\"\noffset = [1, 11]", "overlay.0.offset: expected two numbers"),
            ("type = \"scale_bar\"\nlength = 0", "overlay.0.length: expected a length above 0"),
            ("type = \"image\"", "overlay.0.path: is missing; a picture needs its file"),
            (
                "type = \"image\"\npath = \"a.png\"\nheight = 2",
                "overlay.0.height: expected a number above 0, at most 1",
            ),
        ] {
            let error = read(&format!("[[overlay]]\n{text}")).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
