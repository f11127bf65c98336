//! `[[arrows]]`: arrows of vector attributes at the particles.

use glam::Vec3;
use spherule_surface::rods::Anchor;

use super::color::ColorSetting;
use super::keys::{Keys, keys};
use super::select::MAX_STEP;
use super::value::named;

pub(super) const ABOUT: &[&str] =
    &["Arrows of an attribute with three components at the particles"];

named!(Anchor: Tail = "tail", Center = "center");

/// Default colour, linear RGB: nearly black, as of the simulation cell.
const COLOR: Vec3 = Vec3::splat(0.02);

/// One `[[arrows]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrows {
    /// Name of the attribute.
    pub attribute: String,
    /// Length of an arrow per unit of the attribute.
    pub scale: f64,
    /// Radius of the shafts; by default a part of that of the particles.
    pub radius: Option<f32>,
    /// Only particles whose id is a multiple of this have arrows.
    pub every: u32,
    /// The point of an arrow that is at its particle.
    pub anchor: Anchor,
    /// Their colours; automatic ones are those of the particles.
    pub color: ColorSetting,
}

impl Default for Arrows {
    fn default() -> Self {
        Self {
            attribute: "velocity".to_owned(),
            scale: 1.0,
            radius: None,
            every: 1,
            anchor: Anchor::Tail,
            color: ColorSetting::Rgb(COLOR),
        }
    }
}

impl Arrows {
    pub(super) fn keys(&mut self, keys: &mut Keys<'_>) {
        keys!(keys:
            /// Attribute with three components; inspect lists attributes
            attribute => self.attribute, example("\"velocity\""),
                required("arrows need an attribute, such as \"velocity\"");
            /// Length of an arrow per unit of the attribute
            ///
            /// With 0.05 and velocities in m/s, an arrow is as long as its particle moves in 0.05 s.
            scale => self.scale, above(0), single(), example("0.05"),
                required("the length of an arrow per unit of the attribute, such as 0.05");
            /// Radius of the shafts, or auto: a third of the radius of the particles
            ///
            /// Heads are 2.4 times as thick, and 6 radii long. Short arrows are thinner.
            radius => self.radius, or("auto"), unit("a length"), above(0), single();
            /// Draw only arrows of particles whose id is a multiple of this
            every => self.every, from(1), to(MAX_STEP);
            /// The point of an arrow that is at its particle: tail | center
            anchor => self.anchor;
            /// Colour, linear RGB, { attribute = "velocity", range = [0, 5] }, or auto: that of the particle
            ///
            /// The keys of a map are those of material.color. It needs a range, unless material.color shows the same
            /// attribute, whose range and scale it then has.
            color => self.color, from(0);
        );
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{ColorMapping, Manifest};

    fn read(text: &str) -> Result<Vec<Arrows>, String> {
        let text = format!("input.path = \"a\"\n{text}");
        let manifest = Manifest::parse(&text, Path::new("job.toml"));
        manifest.map(|m| m.arrows).map_err(|e| e.to_string())
    }

    #[test]
    fn arrows_have_defaults() {
        assert_eq!(read("").unwrap(), []);
        let usual = read("[[arrows]]\nattribute = \"velocity\"\nscale = 1").unwrap();
        assert_eq!(usual, [Arrows::default()]);
        let text = "[[arrows]]\nattribute = \"f\"\nscale = 0.5\nradius = 0.1\nevery = 3\nanchor = \"center\"\n\
                    color = { attribute = \"f\" }\n[[arrows]]\nattribute = \"g\"\nscale = 2\ncolor = \"auto\"";
        let found = read(text).unwrap();
        assert_eq!(found[0].anchor, Anchor::Center);
        assert_eq!(found[0].color, ColorSetting::Mapped(ColorMapping::by("f")));
        assert_eq!(found[1].color, ColorSetting::Auto);
    }

    #[test]
    fn impossible_arrows_are_refused() {
        for (text, part) in [
            ("scale = 1", "arrows.0.attribute: is missing; arrows need"),
            ("attribute = \"v\"", "arrows.0.scale: is missing; the length"),
            ("attribute = \"v\"\nscale = -1", "arrows.0.scale: expected"),
            ("attribute = \"v\"\nscale = 1\nradius = 0", "arrows.0.radius: expected"),
            ("attribute = \"v\"\nscale = 1\nevery = 0", "arrows.0.every: expected"),
            ("attribute = \"v\"\nscale = 1\nanchor = \"head\"", "tail, center"),
        ] {
            let error = read(&format!("[[arrows]]\n{text}")).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
        let many = "[[arrows]]\nattribute = \"v\"\nscale = 1\n".repeat(17);
        let error = read(&many).unwrap_err();
        assert!(error.contains("arrows: 17 kinds of arrows"), "{error}");
    }
}
