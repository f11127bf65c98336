//! Native frames that are traced in place: nothing is copied, and attributes are looked up hit by hit.

use std::path::Path;

use glam::{DVec3, Vec3};
use spherule_formats::blocks::StoredLeaves;
use spherule_formats::native::layout::RadiusIndex;
use spherule_formats::native::{AttributeView, FrameIndex, NativeFile, NativeFrame, StoredType};
use spherule_formats::sequence::Sequence;
use spherule_formats::{FrameError, ScalarType, SimulationCell, is_radius};

use super::facts::{FileFacts, column_range};
use super::load_error::{LoadError, missing, missing_value};
use super::setup::{ColorRule, OpacityRule, Picture, RadiusRule, Setup};
use crate::accel::Structure;
use crate::render::{NO_ID, ShadeSource, mean, opacity_of};
use crate::scene::{ColorMap, RgbEncoding};
use crate::survey::{id_of, part_of, velocity_of};
use spherule_frame::values::{Context, Named, Value};

/// In frames up to this size (bytes), all data in use are verified with their checksums before tracing. In larger
/// frames only the nodes are, which are read anyway; rays touch little of the rest.
const MAX_VERIFIED: u64 = 1 << 30;

/// An open native frame.
#[derive(Debug)]
pub struct StoredFrame {
    // Boxed because it is large and moves between stages.
    file: Box<NativeFile>,
    structure: Structure,
    /// Common radius; None if each particle has its own.
    radius: Option<f32>,
    names: Names,
}

/// Names of the attributes that shading needs, as in the file.
#[derive(Debug, Default)]
struct Names {
    /// The attribute with colours.
    rgb: Option<String>,
    /// The value that is mapped to colours.
    values: Option<Value>,
    /// The value that opacities follow from.
    opacity: Option<Value>,
    ids: Option<String>,
    velocities: Option<String>,
    parts: Option<String>,
    /// Attributes with channels; the second is the number of components.
    channels: Vec<(Option<String>, usize)>,
}

/// Result of opening a frame.
pub(super) enum Opened {
    /// It can be traced in place; with the number of raised radii.
    InPlace(StoredFrame, u64),
    /// It must be decoded; with the reason for a native frame.
    Decode(Option<String>),
}

impl StoredFrame {
    /// Opens frame `index`.
    pub(super) fn open(
        setup: &Setup,
        sequence: &Sequence,
        index: usize,
    ) -> Result<Opened, LoadError> {
        let Some(path) = sequence.native_file(index) else {
            return Ok(Opened::Decode(None));
        };
        // Open the file, and check whether it can be traced in place
        let file = NativeFile::open(path, setup.run.access).map_err(LoadError::Frame)?;
        let structure = setup.stored_structure();
        let radius = match particles_in_place(setup, file.index()) {
            Ok(radius) => radius,
            Err(why) => {
                let note = format!("native frames are decoded before they are traced: {why}");
                return Ok(Opened::Decode(Some(note)));
            }
        };
        // Find the attributes, and verify the data
        let names = Names::of(setup, &file)?;
        let frame = Self { file: Box::new(file), structure, radius: radius.common, names };
        frame.verify(setup.run.verify).map_err(LoadError::Frame)?;
        Ok(Opened::InPlace(frame, radius.raised))
    }

    /// Simulation time, if known.
    pub fn time(&self) -> Option<f64> {
        self.file.index().time
    }

    /// Particle count.
    pub fn particles(&self) -> u64 {
        self.file.index().count
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// The structure to report: k-d cells along a curve count as either.
    pub fn structure(&self) -> Structure {
        self.structure
    }

    /// The common radius; None if each particle has its own.
    pub fn radius(&self) -> Option<f32> {
        self.radius
    }

    /// Whether attributes are looked up by particle.
    pub fn needs_indices(&self, setup: &Setup) -> bool {
        setup.needs_indices(self.names.values.is_some() || self.names.rgb.is_some())
    }

    /// The particles in place.
    ///
    /// # Errors
    /// Same as [`NativeFrame::leaves`].
    pub fn leaves(&self) -> Result<StoredLeaves<'_>, FrameError> {
        let leaves = self.frame().leaves();
        leaves.map_err(|e| e.in_file(self.path()))
    }

    /// Attributes for shading, in the file.
    pub fn shading<'a>(&'a self, picture: &'a Picture, default: Vec3) -> StoredShading<'a> {
        // Look up the attributes by the names that were found when the frame was opened
        let frame = self.frame();
        let view = |name: &Option<String>| frame.attribute(name.as_deref()?);
        let color = match &picture.particles.first().color {
            ColorRule::Constant(color) => Some(StoredColor::Constant(*color)),
            ColorRule::Rgb { .. } => view(&self.names.rgb)
                .map(|values| StoredColor::Rgb { encoding: encoding(&values), values }),
            ColorRule::Attribute { map, .. } => {
                let values = self
                    .names
                    .values
                    .as_ref()
                    .and_then(|value| StoredValues::of(&frame, value, self.time()));
                values.map(|values| StoredColor::Mapped { values, map })
            }
        };
        let color = color.unwrap_or(StoredColor::Constant(default));
        // Choose how opacities are looked up
        let opacity = match (&picture.particles.first().opacity, &self.names.opacity) {
            (OpacityRule::Constant(opacity), _) => StoredOpacity::Constant(*opacity),
            (OpacityRule::Value { range, .. }, value) => {
                let values =
                    value.as_ref().and_then(|value| StoredValues::of(&frame, value, self.time()));
                let of = |values| StoredOpacity::Mapped(values, *range);
                values.map_or(StoredOpacity::Constant(1.0), of)
            }
        };
        StoredShading {
            color,
            opacity,
            ids: view(&self.names.ids),
            velocities: view(&self.names.velocities),
            parts: view(&self.names.parts),
            channels: (self.names.channels.iter())
                .map(|(name, components)| (view(name), *components))
                .collect(),
        }
    }

    /// What overlays show of the frame; `file` is the name of its file.
    pub(super) fn facts(&self, setup: &Setup, file: String) -> FileFacts {
        let names = setup.picture.files.overlay_values.iter();
        let ranges = names.map(|name| self.range(name)).collect();
        FileFacts { file, ranges }
    }

    /// Smallest and largest value of this name.
    fn range(&self, name: &str) -> Option<[f64; 2]> {
        let frame = self.frame();
        let count = usize::try_from(self.particles()).ok()?;
        let value = Value::named(name, &frame.attributes())?;
        column_range(&value.bind(|name| frame.attribute(name))?, count)
    }

    /// The simulation cell.
    pub(super) fn cell(&self) -> Option<&SimulationCell> {
        self.file.index().details.cell.as_ref()
    }

    /// Whether the file is mapped and not read.
    pub fn is_mapped(&self) -> bool {
        self.file.is_mapped()
    }

    /// Bytes of the attributes for shading.
    pub fn attribute_bytes(&self) -> u64 {
        let used = self.names.all();
        let all = self.file.index().attributes.iter();
        let used = all.filter(|a| used.contains(&a.name.as_str()));
        used.map(|a| a.section.len).sum()
    }

    /// Checks that the file has not changed since it was opened. Must be called before an image is used.
    ///
    /// # Errors
    /// [`FrameError::Malformed`] if it has.
    pub fn check(&self) -> Result<(), FrameError> {
        self.file.check()
    }

    fn frame(&self) -> NativeFrame<'_> {
        self.file.frame_unchecked()
    }

    /// Verifies checksums: of all data in use if `all` is set or, by default, if there is not too much of it;
    /// otherwise of the nodes.
    fn verify(&self, all: Option<bool>) -> Result<(), FrameError> {
        let used = self.names.all();
        let frame = self.frame();
        let verified = if all.unwrap_or(frame.used_bytes(&used) <= MAX_VERIFIED) {
            frame.verify_used(&used)
        } else {
            frame.verify_nodes()
        };
        verified.map_err(|e| e.in_file(self.path()))?;
        // A truncated file would otherwise be reported as damaged.
        self.check()
    }
}

impl Names {
    fn all(&self) -> Vec<&str> {
        let all = [&self.rgb, &self.ids, &self.velocities, &self.parts];
        let channels = self.channels.iter().map(|(name, _)| name);
        let all = all.into_iter().chain(channels);
        let values = [&self.values, &self.opacity].into_iter().flatten().filter_map(Value::column);
        let mut names: Vec<&str> = all.filter_map(Option::as_deref).chain(values).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    fn of(setup: &Setup, file: &NativeFile) -> Result<Self, LoadError> {
        let columns = Columns::of(file);
        // Find the attributes that settings name
        let (mut rgb, mut values) = (None, None);
        match &setup.picture.particles.first().color {
            ColorRule::Constant(_) => {}
            ColorRule::Rgb { name, required } => rgb = columns.find(name, "colour", *required)?,
            ColorRule::Attribute { name, required, .. } => {
                values = columns.value(name, "colour", *required)?;
            }
        }
        let mut opacity = None;
        if let OpacityRule::Value { name, .. } = &setup.picture.particles.first().opacity {
            opacity = columns.value(name, "opacity", true)?;
        }
        // Find the attributes with channels
        let with_channels = setup
            .picture
            .files
            .attributes
            .iter()
            .map(|channel| {
                let found = columns.find(&channel.name, "a channel", true)?;
                Ok((found, channel.components))
            })
            .collect::<Result<_, LoadError>>()?;
        // Find those with usual names
        let attributes = columns.attributes;
        let channels = setup.picture.render.channels;
        let name = |found: Option<&AttributeView>| found.map(|a| a.name().to_owned());
        Ok(Self {
            rgb,
            values,
            opacity,
            // Only integers are ids, as in decoded frames.
            ids: name(
                id_of(&attributes).filter(|a| channels.needs_ids() && a.low_bits(0).is_some()),
            ),
            velocities: name(velocity_of(&attributes).filter(|_| channels.needs_velocities())),
            parts: name(part_of(&attributes).filter(|_| channels.needs_parts())),
            channels: with_channels,
        })
    }
}

/// The attributes of a native frame, by the names in settings.
struct Columns<'a> {
    file: &'a NativeFile,
    attributes: Vec<AttributeView<'a>>,
}

impl<'a> Columns<'a> {
    fn of(file: &'a NativeFile) -> Self {
        Self { file, attributes: file.frame_unchecked().attributes() }
    }

    /// The name of the attribute in the file. It may be missing if it is not `required`, or without particles.
    fn find(
        &self,
        name: &str,
        purpose: &'static str,
        required: bool,
    ) -> Result<Option<String>, LoadError> {
        let found = self.file.frame_unchecked().attribute(name).map(|a| a.name().to_owned());
        if found.is_none() && required && self.file.index().count > 0 {
            let path = self.file.path().display().to_string();
            let has = self.attributes.iter().map(Named::name);
            return Err(missing(name, purpose, &path, has));
        }
        Ok(found)
    }

    /// The value of particles. It may be missing like an attribute.
    fn value(
        &self,
        name: &str,
        purpose: &'static str,
        required: bool,
    ) -> Result<Option<Value>, LoadError> {
        let found = Value::named(name, &self.attributes);
        if found.is_none() && required && self.file.index().count > 0 {
            let path = self.file.path().display().to_string();
            return Err(missing_value(name, purpose, &path, &self.attributes));
        }
        Ok(found)
    }
}

/// Radii of a frame that is traced in place.
pub(super) struct PlacedRadius {
    /// Common radius; None if each particle has its own.
    pub(super) common: Option<f32>,
    /// Number of radii raised to the minimum.
    raised: u64,
}

/// The radii of a frame if it can be traced in place, otherwise the reason why not.
pub(super) fn particles_in_place(
    setup: &Setup,
    index: &FrameIndex,
) -> Result<PlacedRadius, String> {
    // Check that neither settings nor origin require a copy
    if let Some(why) = setup.needs_copy() {
        return Err(why);
    }
    if DVec3::from_array(index.origin) != setup.picture.origin {
        return Err(
            "they are relative to another origin than the sequence, for 12 bytes per particle \
                    and more; convert the sequence as a whole to save that"
                .to_owned(),
        );
    }
    // Find the radii
    let common = match (&setup.picture.particles.first().radius, &index.radius) {
        (RadiusRule::Attribute { .. } | RadiusRule::Table { .. }, _) => {
            return Err("the radius is an attribute, for 12 bytes per particle and more".to_owned());
        }
        (RadiusRule::Common(radius), _) | (RadiusRule::FileOr(radius), RadiusIndex::None) => {
            *radius
        }
        (RadiusRule::FileOr(_), RadiusIndex::Common(radius)) => *radius,
        (RadiusRule::FileOr(_), RadiusIndex::PerParticle(radii))
            if radii.low >= setup.picture.particles.least_radius =>
        {
            return Ok(PlacedRadius { common: None, raised: 0 });
        }
        (RadiusRule::FileOr(_), RadiusIndex::PerParticle(_)) => {
            return Err("some radii are too small to be seen and are raised".to_owned());
        }
    };
    // Raise a common radius that is too small or NaN
    let is_visible = common >= setup.picture.particles.least_radius && is_radius(common);
    Ok(PlacedRadius {
        common: Some(if is_visible { common } else { setup.picture.particles.least_radius }),
        raised: if is_visible { 0 } else { index.count },
    })
}

/// A [`ShadeSource`] over attributes in place.
#[derive(Debug, Clone)]
pub struct StoredShading<'a> {
    color: StoredColor<'a>,
    opacity: StoredOpacity<'a>,
    ids: Option<AttributeView<'a>>,
    velocities: Option<AttributeView<'a>>,
    parts: Option<AttributeView<'a>>,
    /// Attributes with channels; the second is the number of components.
    channels: Vec<(Option<AttributeView<'a>>, usize)>,
}

#[derive(Debug, Clone, Copy)]
enum StoredOpacity<'a> {
    Constant(f32),
    /// Values, and those with opacity 0 and 1.
    Mapped(StoredValues<'a>, [f32; 2]),
}

#[derive(Debug, Clone, Copy)]
enum StoredColor<'a> {
    Constant(Vec3),
    Rgb { values: AttributeView<'a>, encoding: RgbEncoding },
    Mapped { values: StoredValues<'a>, map: &'a ColorMap },
}

/// Values of particles in place, none of those that need a copy of the particles.
#[derive(Debug, Clone, Copy)]
struct StoredValues<'a> {
    value: Value<AttributeView<'a>>,
    time: f64,
}

impl<'a> StoredValues<'a> {
    fn of(frame: &NativeFrame<'a>, value: &Value, time: Option<f64>) -> Option<Self> {
        let value = value.bind(|name| frame.attribute(name)).filter(|_| !value.needs_geometry())?;
        Some(Self { value, time: time.unwrap_or(f64::NAN) })
    }

    #[expect(clippy::cast_possible_truncation, reason = "colours need no more than f32")]
    fn get(&self, index: u32) -> f32 {
        self.value.get(index as usize, self) as f32
    }
}

impl Context for StoredValues<'_> {
    fn position(&self, _particle: usize) -> DVec3 {
        DVec3::NAN
    }

    fn up(&self) -> DVec3 {
        DVec3::NAN
    }

    fn time(&self) -> f64 {
        self.time
    }
}

/// The encoding of colours, as for decoded particles: codes of fewer bits are decoded to floats.
fn encoding(values: &AttributeView) -> RgbEncoding {
    RgbEncoding::of(match values.stored() {
        StoredType::Plain(kind) => kind,
        StoredType::Half | StoredType::Ranged => ScalarType::F32,
    })
}

fn stored_rgb(values: &AttributeView, encoding: RgbEncoding, index: u32) -> Vec3 {
    encoding.color([0, 1, 2].map(|component| values.get(index as usize, component)))
}

impl ShadeSource for StoredShading<'_> {
    fn color(&self, index: u32) -> Vec3 {
        match &self.color {
            StoredColor::Constant(color) => *color,
            StoredColor::Rgb { values, encoding } => stored_rgb(values, *encoding, index),
            StoredColor::Mapped { values, map } => map.color(values.get(index)),
        }
    }

    fn constant_color(&self) -> Option<Vec3> {
        match &self.color {
            StoredColor::Constant(color) => Some(*color),
            StoredColor::Rgb { .. } | StoredColor::Mapped { .. } => None,
        }
    }

    fn blended_color(&self, parts: &[(u32, f32)]) -> Vec3 {
        match &self.color {
            StoredColor::Constant(color) => *color,
            StoredColor::Rgb { values, encoding } => {
                mean(parts, |i| stored_rgb(values, *encoding, i))
            }
            StoredColor::Mapped { values, map } if map.categories().is_some() => {
                mean(parts, |i| map.color(values.get(i)))
            }
            StoredColor::Mapped { values, map } => map.color(mean(parts, |i| values.get(i))),
        }
    }

    fn id(&self, index: u32) -> u32 {
        self.ids.map_or(index, |ids| ids.low_bits(index as usize).unwrap_or(NO_ID))
    }

    #[expect(clippy::cast_possible_truncation, reason = "the channel is f32")]
    fn velocity(&self, index: u32) -> Vec3 {
        self.velocities.map_or(Vec3::ZERO, |velocities| {
            let component = |c: usize| velocities.get(index as usize, c) as f32;
            Vec3::new(component(0), component(1), component(2))
        })
    }

    fn is_translucent(&self) -> bool {
        !matches!(self.opacity, StoredOpacity::Constant(1.0))
    }

    fn opacity(&self, index: u32) -> f32 {
        match &self.opacity {
            StoredOpacity::Constant(opacity) => *opacity,
            StoredOpacity::Mapped(values, range) => opacity_of(values.get(index), *range),
        }
    }

    fn part(&self, index: u32) -> Option<(&str, i32)> {
        let parts = self.parts.as_ref()?;
        Some((parts.name(), parts.low_bits(index as usize)?.cast_signed()))
    }

    #[expect(clippy::cast_possible_truncation, reason = "the channel is f32")]
    fn attributes(&self, index: u32, floats: &mut [f32]) {
        let components = self.channels.iter().flat_map(|(view, components)| {
            (0..*components).map(move |c| {
                let view = view.as_ref().filter(|view| c < view.components());
                view.map_or(0.0, |view| view.get(index as usize, c) as f32)
            })
        });
        for (float, value) in floats.iter_mut().zip(components) {
            *float = value;
        }
    }
}
