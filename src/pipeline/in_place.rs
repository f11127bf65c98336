//! Native frames are traced where they lie: nothing is copied, and attributes are looked up hit by hit.

use std::path::Path;

use glam::{DVec3, Vec3};
use spherule_formats::blocks::StoredLeaves;
use spherule_formats::native::layout::RadiusIndex;
use spherule_formats::native::{AttributeView, FrameIndex, NativeFile, NativeFrame, StoredType};
use spherule_formats::sequence::Sequence;
use spherule_formats::{FrameError, ScalarType, is_radius};

use super::load_error::{LoadError, missing};
use super::setup::{ColorRule, RadiusRule, Setup};
use crate::accel::Structure;
use crate::render::{NO_ID, ShadeSource, mean};
use crate::scene::{ColorMap, RgbEncoding};
use crate::survey::{Named, id_of, velocity_of};

/// Bytes of a frame up to which everything that is used is compared with its checksum before it is traced;
/// of a larger one only the nodes, which are read anyhow: rays touch little of the rest.
const VERIFIED: u64 = 1 << 30;

/// A native frame, open.
#[derive(Debug)]
pub struct StoredFrame {
    // Large, and handed from stage to stage.
    file: Box<NativeFile>,
    structure: Structure,
    /// Of all particles; None if each has its own.
    radius: Option<f32>,
    names: Names,
}

/// Attributes that shading asks for, by their names in the file.
#[derive(Debug, Default)]
struct Names {
    values: Option<String>,
    ids: Option<String>,
    velocities: Option<String>,
}

/// What came of opening a frame.
pub(super) enum Opened {
    /// It can be traced where it lies; so many radii are raised.
    InPlace(StoredFrame, u64),
    /// It must be decoded; of a native frame, why.
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
        let file = NativeFile::open(path, setup.run.access).map_err(LoadError::Frame)?;
        let structure = setup.stored_structure();
        let radius = match particles_in_place(setup, file.index()) {
            Ok(radius) => radius,
            Err(why) => {
                let note = format!("native frames are decoded before they are traced: {why}");
                return Ok(Opened::Decode(Some(note)));
            }
        };
        let names = Names::of(setup, &file)?;
        let frame = Self {
            file: Box::new(file),
            structure,
            radius: radius.common,
            names,
        };
        frame.verify(setup.run.verify).map_err(LoadError::Frame)?;
        Ok(Opened::InPlace(frame, radius.raised))
    }

    /// Simulation time, if known.
    pub fn time(&self) -> Option<f64> {
        self.file.index().time
    }

    /// Particles.
    pub fn particles(&self) -> u64 {
        self.file.index().count
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Whose order and nodes it is said to have: k-d cells along a curve serve for both.
    pub fn structure(&self) -> Structure {
        self.structure
    }

    /// The radius of all particles; None if each has its own.
    pub fn radius(&self) -> Option<f32> {
        self.radius
    }

    /// Whether anything is looked up by particle.
    pub fn needs_indices(&self, setup: &Setup) -> bool {
        let channels = setup.picture.render.channels;
        channels.id || channels.velocity || self.names.values.is_some()
    }

    /// The particles in place.
    ///
    /// # Errors
    /// As [`NativeFrame::leaves`].
    pub fn leaves(&self) -> Result<StoredLeaves<'_>, FrameError> {
        let leaves = self.frame().leaves();
        leaves.map_err(|e| e.in_file(self.path()))
    }

    /// What shading looks up, in the file.
    pub fn shading<'a>(&'a self, color: &'a ColorRule, default: Vec3) -> StoredShading<'a> {
        let frame = self.frame();
        let view = |name: &Option<String>| frame.attribute(name.as_deref()?);
        let color = match (color, view(&self.names.values)) {
            (ColorRule::Constant(color), _) => StoredColor::Constant(*color),
            (ColorRule::Attribute { .. } | ColorRule::Rgb { .. }, None) => {
                StoredColor::Constant(default)
            }
            (ColorRule::Rgb { .. }, Some(values)) => StoredColor::Rgb {
                encoding: encoding(&values),
                values,
            },
            (ColorRule::Attribute { map, .. }, Some(values)) => StoredColor::Mapped { values, map },
        };
        StoredShading {
            color,
            ids: view(&self.names.ids),
            velocities: view(&self.names.velocities),
        }
    }

    /// Whether it is mapped, not read.
    pub fn is_mapped(&self) -> bool {
        self.file.is_mapped()
    }

    /// Bytes of the attributes that shading looks up.
    pub fn attribute_bytes(&self) -> u64 {
        let used = self.names.all();
        let all = self.file.index().attributes.iter();
        let used = all.filter(|a| used.contains(&a.name.as_str()));
        used.map(|a| a.section.len).sum()
    }

    /// Whether the file is still what it was when it was opened: asked before the image is believed.
    ///
    /// # Errors
    /// [`FrameError::Malformed`] if it is not.
    pub fn check(&self) -> Result<(), FrameError> {
        self.file.check()
    }

    fn frame(&self) -> NativeFrame<'_> {
        self.file.frame_unchecked()
    }

    /// Compares with the checksums: all that is used if `all` or there is not too much of it, else the
    /// nodes.
    fn verify(&self, all: Option<bool>) -> Result<(), FrameError> {
        let used = self.names.all();
        let frame = self.frame();
        let verified = match all.unwrap_or(frame.used_bytes(&used) <= VERIFIED) {
            true => frame.verify_used(&used),
            false => frame.verify_nodes(),
        };
        verified.map_err(|e| e.in_file(self.path()))?;
        // Else what is missing would be called damaged.
        self.check()
    }
}

impl Names {
    fn all(&self) -> Vec<&str> {
        let all = [&self.values, &self.ids, &self.velocities];
        all.into_iter().filter_map(Option::as_deref).collect()
    }

    fn of(setup: &Setup, file: &NativeFile) -> Result<Self, LoadError> {
        let frame = file.frame_unchecked();
        let attributes = frame.attributes();
        let values = match &setup.picture.color {
            ColorRule::Constant(_) => None,
            ColorRule::Attribute { name, required, .. } | ColorRule::Rgb { name, required } => {
                let found = frame.attribute(name).map(|a| a.name().to_owned());
                if found.is_none() && *required && file.index().count > 0 {
                    let path = file.path().display().to_string();
                    let has = attributes.iter().map(Named::name);
                    return Err(missing(name, "colour", &path, has));
                }
                found
            }
        };
        let channels = setup.picture.render.channels;
        let name = |found: Option<&AttributeView>| found.map(|a| a.name().to_owned());
        Ok(Self {
            values,
            // As in decoded frames, ids are whole numbers.
            ids: name(id_of(&attributes).filter(|a| channels.id && a.low_bits(0).is_some())),
            velocities: name(velocity_of(&attributes).filter(|_| channels.velocity)),
        })
    }
}

/// Radii as a frame that is traced in place has them.
struct PlacedRadius {
    /// Of all; None if each has its own.
    common: Option<f32>,
    /// So many are raised to the least.
    raised: u64,
}

/// The radii of a frame, if it can be traced in place; else why not.
fn particles_in_place(setup: &Setup, index: &FrameIndex) -> Result<PlacedRadius, String> {
    if let Some(why) = setup.needs_copy() {
        return Err(why);
    }
    if DVec3::from_array(index.origin) != setup.picture.origin {
        return Err(
            "they are relative to another origin than the sequence, for 12 bytes a particle \
                    and more; convert the sequence as a whole to save that"
                .to_owned(),
        );
    }
    let common = match (&setup.picture.radius, &index.radius) {
        (RadiusRule::Attribute { .. }, _) => {
            return Err("the radius is an attribute, for 12 bytes a particle and more".to_owned());
        }
        (RadiusRule::Common(radius), _) | (RadiusRule::FileOr(radius), RadiusIndex::None) => {
            *radius
        }
        (RadiusRule::FileOr(_), RadiusIndex::Common(radius)) => *radius,
        (RadiusRule::FileOr(_), RadiusIndex::PerParticle(radii))
            if radii.low >= setup.picture.least_radius =>
        {
            return Ok(PlacedRadius {
                common: None,
                raised: 0,
            });
        }
        (RadiusRule::FileOr(_), RadiusIndex::PerParticle(_)) => {
            return Err("some radii are too small to be seen and are raised".to_owned());
        }
    };
    // Also of what is no number.
    let is_seen = common >= setup.picture.least_radius && is_radius(common);
    Ok(PlacedRadius {
        common: Some(if is_seen {
            common
        } else {
            setup.picture.least_radius
        }),
        raised: if is_seen { 0 } else { index.count },
    })
}

/// A [`ShadeSource`] over attributes where they lie.
#[derive(Debug, Clone, Copy)]
pub struct StoredShading<'a> {
    color: StoredColor<'a>,
    ids: Option<AttributeView<'a>>,
    velocities: Option<AttributeView<'a>>,
}

#[derive(Debug, Clone, Copy)]
enum StoredColor<'a> {
    Constant(Vec3),
    Rgb {
        values: AttributeView<'a>,
        encoding: RgbEncoding,
    },
    Mapped {
        values: AttributeView<'a>,
        map: &'a ColorMap,
    },
}

/// As colours of decoded particles are understood: codes of fewer bits are decoded to floats.
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
    #[expect(
        clippy::cast_possible_truncation,
        reason = "colours need no more than f32"
    )]
    fn color(&self, index: u32) -> Vec3 {
        match &self.color {
            StoredColor::Constant(color) => *color,
            StoredColor::Rgb { values, encoding } => stored_rgb(values, *encoding, index),
            StoredColor::Mapped { values, map } => {
                map.color(values.magnitude(index as usize) as f32)
            }
        }
    }

    fn constant_color(&self) -> Option<Vec3> {
        match &self.color {
            StoredColor::Constant(color) => Some(*color),
            StoredColor::Rgb { .. } | StoredColor::Mapped { .. } => None,
        }
    }

    #[expect(
        clippy::cast_possible_truncation,
        reason = "colours need no more than f32"
    )]
    fn blended_color(&self, parts: &[(u32, f32)]) -> Vec3 {
        match &self.color {
            StoredColor::Constant(color) => *color,
            StoredColor::Rgb { values, encoding } => {
                mean(parts, |i| stored_rgb(values, *encoding, i))
            }
            StoredColor::Mapped { values, map } => {
                map.color(mean(parts, |i| values.magnitude(i as usize) as f32))
            }
        }
    }

    fn id(&self, index: u32) -> u32 {
        self.ids
            .map_or(index, |ids| ids.low_bits(index as usize).unwrap_or(NO_ID))
    }

    #[expect(clippy::cast_possible_truncation, reason = "the channel is f32")]
    fn velocity(&self, index: u32) -> Vec3 {
        self.velocities.map_or(Vec3::ZERO, |velocities| {
            let component = |c: usize| velocities.get(index as usize, c) as f32;
            Vec3::new(component(0), component(1), component(2))
        })
    }
}
