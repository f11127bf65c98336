//! Options that stand for several keys of the manifest, or for items of its lists.

use clap::Args;
use clap::builder::NonEmptyStringValueParser;
use spherule_formats::ValueError;
use toml::{Table, Value};

use super::CliError;
use super::key_flags::over;
use super::numbers::number;
use super::paths::path_as_typed;
use super::style_flag::style;
use crate::manifest::Override;

/// Options that are short for more than one key.
#[derive(Debug, Args)]
pub(super) struct Shortcuts {
    /// Width and height of the image in one: 1280x720, or 85mmx60mm on paper
    #[arg(long, value_name = "WIDTHxHEIGHT", help_heading = "Image", display_order = 0, value_parser = Size::parse,
        conflicts_with_all = ["width", "height"])]
    size: Option<Size>,
    /// Orthographic projection: the same as --projection orthographic
    #[arg(long, help_heading = "Camera", display_order = 0, conflicts_with = "projection")]
    ortho: bool,
    /// Value at the lower end of the colour map; --vmin LOW --vmax HIGH is the same as --range LOW HIGH
    #[arg(long, value_name = "LOW", allow_negative_numbers = true, value_parser = number, requires = "vmax",
        conflicts_with = "range", help_heading = "Look", display_order = 0)]
    vmin: Option<f64>,
    /// Value at the upper end of the colour map
    #[arg(long, value_name = "HIGH", allow_negative_numbers = true, value_parser = number, requires = "vmin",
        conflicts_with = "range", help_heading = "Look", display_order = 0)]
    vmax: Option<f64>,
    /// Draw the colours with their values in a free corner of the previews
    ///
    /// The same as [[overlay]] type = "colorbar" in a manifest, which has more settings, such as corner and size.
    #[arg(long, visible_alias = "legend", aliases = ["colourbar", "color-bar", "colour-bar", "cbar"],
        help_heading = "Look", display_order = 0)]
    colorbar: bool,
    /// Draw neither the colours nor the time unasked
    ///
    /// The same as legend = false in a manifest. Overlays that are asked for are drawn.
    #[arg(long, aliases = ["no-colorbar", "no-colourbar", "no-overlay", "no-overlays"], help_heading = "Look",
        display_order = 0)]
    no_legend: bool,
    /// Title of the colours, which are then drawn as with --colorbar
    #[arg(long, value_name = "TEXT", help_heading = "Look", display_order = 0,
        value_parser = NonEmptyStringValueParser::new())]
    title: Option<String>,
    /// Unit of the colours, after their title, which are then drawn as with --colorbar
    #[arg(long, value_name = "UNIT", help_heading = "Look", display_order = 0,
        value_parser = NonEmptyStringValueParser::new())]
    unit: Option<String>,
    /// Draw the time, or the frame number of files without times, in a free corner of the previews
    ///
    /// The same as [[overlay]] type = "text" in a manifest, which has more settings, such as text = "t = {time:.2f} s".
    #[arg(long, alias = "timestamp", help_heading = "Look", display_order = 0)]
    time_stamp: bool,
    /// Draw a text, which may contain {time:.2f}, {frame:04d} or {particles:,}. May be repeated.
    ///
    /// The same as [[overlay]] type = "text" in a manifest, which has more settings.
    #[arg(long, value_name = "TEXT", help_heading = "Look", display_order = 0,
        value_parser = NonEmptyStringValueParser::new())]
    text: Vec<String>,
    /// Draw a length of the scene as a bar
    ///
    /// The same as [[overlay]] type = "scale_bar" in a manifest, which has more settings: length and unit.
    #[arg(long, alias = "scalebar", help_heading = "Look", display_order = 0)]
    scale_bar: bool,
    /// Draw the directions of the axes
    ///
    /// The same as [[overlay]] type = "axes" in a manifest.
    #[arg(long, help_heading = "Look", display_order = 0)]
    axes: bool,
    /// Draw some of the particles in their own way: 'type == 2: sticks, radius 0.3, color red'. May be repeated.
    ///
    /// The same as [[style]] in a manifest. The first style whose condition holds takes a particle; ': hidden' without
    /// a condition takes all others.
    #[arg(long, value_name = "CONDITION: DRAW, SETTINGS", allow_hyphen_values = true, help_heading = "Look",
        display_order = 0, value_parser = style)]
    style: Vec<Table>,
    /// Draw an attribute as arrows, whose length is the scale times the attribute: velocity:0.05. May be repeated.
    ///
    /// The same as [[arrows]] in a manifest, which has more settings: radius, colour, every n-th particle.
    #[arg(long, value_name = "ATTRIBUTE:SCALE", help_heading = "Look", display_order = 0, value_parser = Arrows::parse)]
    arrows: Vec<Arrows>,
    /// Draw only a slice: z=0.5:0.1 has the particles up to 0.05 from z = 0.5
    ///
    /// The same as select.slab in a manifest.
    #[arg(long, value_name = "AXIS=VALUE:THICKNESS", help_heading = "Input", display_order = 0, value_parser = slice)]
    slice: Option<Table>,
    /// Draw only one side of a plane: 'x<0.5'. May be repeated.
    ///
    /// The same as [[clip]] type = "plane" in a manifest, which has more settings: mode = "cut" cuts spheres open.
    #[arg(long, value_name = "AXIS<VALUE", help_heading = "Input", display_order = 0, value_parser = clip)]
    clip: Vec<Table>,
}

/// Both sides of the image, as typed.
#[derive(Debug, Clone)]
struct Size {
    width: String,
    height: String,
}

/// Arrows of an attribute.
#[derive(Debug, Clone)]
struct Arrows {
    attribute: String,
    scale: f64,
}

impl Size {
    fn parse(text: &str) -> Result<Self, ValueError> {
        let sides = text
            .split_once(['x', 'X'])
            .filter(|(width, height)| [width, height].iter().all(|s| !s.is_empty()));
        let (width, height) = sides
            .ok_or_else(|| ValueError::new("the width and the height, such as 1280x720", text))?;
        Ok(Self { width: width.to_owned(), height: height.to_owned() })
    }
}

impl Arrows {
    fn parse(text: &str) -> Result<Self, ValueError> {
        let arrows = text.rsplit_once(':').and_then(|(attribute, scale)| {
            Some(Self { attribute: attribute.to_owned(), scale: scale.parse().ok()? })
        });
        arrows.ok_or_else(|| {
            let expected =
                "an attribute and the length of an arrow per unit of it, such as velocity:0.05";
            ValueError::new(expected, text)
        })
    }
}

/// The table `select.slab` of `z=0.5:0.1`.
fn slice(text: &str) -> Result<Table, ValueError> {
    let parts = || {
        let (axis, rest) = text.split_once('=')?;
        let (center, thickness) = rest.split_once(':')?;
        let mut table = Table::new();
        table.insert("axis".to_owned(), axis.trim().into());
        table.insert("center".to_owned(), finite(center)?.into());
        table.insert("thickness".to_owned(), finite(thickness)?.into());
        Some(table)
    };
    let expected = "an axis, the middle of the slice and its thickness, such as z=0.5:0.1; --clip z<0.5 draws one side";
    parts().ok_or_else(|| ValueError::new(expected, text))
}

/// The item of `clip` that keeps the particles with `x<0.5`. Its normal points to those that are left out.
fn clip(text: &str) -> Result<Table, ValueError> {
    let parts = || {
        let (axis, value) = text.split_once(['<', '>'])?;
        let value = finite(value.strip_prefix('=').unwrap_or(value))?;
        let axis = Some(axis.trim()).filter(|axis| ["x", "y", "z"].contains(axis))?;
        let (normal, offset) = if text.contains('<') {
            (axis.to_owned(), value)
        } else {
            (format!("-{axis}"), -value)
        };
        let mut table = Table::new();
        table.insert("type".to_owned(), "plane".into());
        table.insert("normal".to_owned(), normal.into());
        table.insert("offset".to_owned(), offset.into());
        Some(table)
    };
    let expected = "an axis, < or > and a coordinate, such as x<0.5";
    parts().ok_or_else(|| ValueError::new(expected, text))
}

/// The finite number in `text`.
fn finite(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|v: &f64| v.is_finite())
}

/// A number as an integer or a float, or else text.
fn side(text: &str) -> Value {
    match text.parse::<i64>() {
        Ok(pixels) => pixels.into(),
        Err(_) => text.into(),
    }
}

/// The item `table` of the list `key`; messages call it `shown`.
fn append(key: &str, table: Table, shown: &str) -> Result<Override, CliError> {
    Override::append(key, table, shown).map_err(|e| CliError::other(e.to_string()))
}

/// An overlay with this `type` and these other keys.
fn overlay(kind: &str, keys: &[(&str, Option<&String>)]) -> Table {
    let mut table = Table::new();
    table.insert("type".to_owned(), kind.into());
    for (key, value) in keys {
        if let Some(value) = value {
            table.insert((*key).to_owned(), (*value).clone().into());
        }
    }
    table
}

impl Shortcuts {
    /// Adds the given options, over a manifest that is in a file if `from_file`.
    pub(super) fn add_overrides(
        &self,
        list: &mut Vec<Override>,
        from_file: bool,
    ) -> Result<(), CliError> {
        // Each shortcut stands for one or two keys
        if let Some(Size { width, height }) = &self.size {
            list.push(over("image.width", side(width), "--size")?);
            list.push(over("image.height", side(height), "--size")?);
        }
        if self.no_legend {
            list.push(over("legend", false, "--no-legend")?);
        }
        if self.ortho {
            list.push(over("camera.projection", "orthographic", "--ortho")?);
        }
        if let (Some(low), Some(high)) = (self.vmin, self.vmax) {
            let range = vec![low, high];
            list.push(over("material.color.range", range, "--vmin, --vmax")?);
        }
        if let Some(slice) = &self.slice {
            list.push(over("select.slab", slice.clone(), "--slice")?);
        }
        for style in &self.style {
            let mut style = style.clone();
            if let Some(Value::String(mesh)) = style.get_mut("mesh") {
                *mesh = path_as_typed(mesh, from_file)?;
            }
            list.push(append("style", style, "--style")?);
        }
        for clip in &self.clip {
            list.push(append("clip", clip.clone(), "--clip")?);
        }
        for Arrows { attribute, scale } in &self.arrows {
            let mut table = Table::new();
            table.insert("attribute".to_owned(), attribute.clone().into());
            table.insert("scale".to_owned(), (*scale).into());
            list.push(append("arrows", table, "--arrows")?);
        }
        self.add_overlays(list)
    }

    fn add_overlays(&self, list: &mut Vec<Override>) -> Result<(), CliError> {
        let (title, unit) = (self.title.as_ref(), self.unit.as_ref());
        if self.colorbar || title.is_some() || unit.is_some() {
            let layout = String::from("auto");
            let keys = [("layout", Some(&layout)), ("title", title), ("unit", unit)];
            let table = overlay("colorbar", &keys);
            list.push(append("overlay", table, "--colorbar")?);
        }
        if self.time_stamp {
            list.push(append("overlay", overlay("text", &[]), "--time-stamp")?);
        }
        for text in &self.text {
            let table = overlay("text", &[("text", Some(text))]);
            list.push(append("overlay", table, "--text")?);
        }
        if self.scale_bar {
            list.push(append("overlay", overlay("scale_bar", &[]), "--scale-bar")?);
        }
        if self.axes {
            list.push(append("overlay", overlay("axes", &[]), "--axes")?);
        }
        Ok(())
    }
}
