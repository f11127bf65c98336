//! The native frame file `.spf`: particles in blocks that can be traced in place.
//!
//! [`layout`] has the bytes, [`write()`] makes files, [`NativeFile`] maps them. All parsing works on
//! `&[u8]`. Files written by other programs are [`crate::read`]'s.

use glam::{DVec3, Vec3};
use xxhash_rust::xxh3::xxh3_64;

use crate::read::Step;
use crate::{Attribute, AttributeData, Endian, ParseError, Positions, RawParticles, ScalarType};

pub mod layout;
mod map;
mod write;

pub use layout::{FrameIndex, MAGIC, PositionBlock};
pub use map::{Access, NativeFile};
pub use write::write;

use layout::{AttributeIndex, BLOCK, RadiusIndex, Section};

/// A checked view of the bytes of a native frame.
#[derive(Debug, Clone, Copy)]
pub struct NativeFrame<'a> {
    bytes: &'a [u8],
    index: &'a FrameIndex,
}

impl<'a> NativeFrame<'a> {
    /// A view of `bytes`, from which `index` was parsed by [`layout::parse`].
    const fn with_index(bytes: &'a [u8], index: &'a FrameIndex) -> Self {
        Self { bytes, index }
    }

    /// What the frame holds.
    pub const fn index(&self) -> &'a FrameIndex {
        self.index
    }

    /// The position blocks in place; `None` on a big-endian machine, or for bytes that are not
    /// aligned to 64 (those of a [`NativeFile`] are).
    pub fn blocks(&self) -> Option<&'a [PositionBlock]> {
        self.plain(&self.index.positions)
    }

    /// Radii of the particles in place, if there is one each; conditions as for [`Self::blocks`].
    pub fn radii(&self) -> Option<&'a [f32]> {
        match &self.index.radius {
            RadiusIndex::PerParticle(section) => self.plain(section),
            _ => None,
        }
    }

    /// A copy of the attribute `name`.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if its section is not what the index says.
    pub fn attribute(&self, name: &str) -> Option<Result<Attribute, ParseError>> {
        let found = self.index.attributes.iter().find(|a| a.name == name)?;
        Some(self.decode(found))
    }

    /// Compares every section with its checksum, which opening does not do.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] at the first section that differs.
    pub fn verify(&self) -> Result<(), ParseError> {
        self.verify_section("the positions", &self.index.positions)?;
        if let RadiusIndex::PerParticle(section) = &self.index.radius {
            self.verify_section("the radii", section)?;
        }
        for attribute in &self.index.attributes {
            self.verify_section(&format!("attribute {}", attribute.name), &attribute.section)?;
        }
        Ok(())
    }

    fn verify_section(&self, what: &str, section: &Section) -> Result<(), ParseError> {
        let bytes = self.section(section)?;
        if xxh3_64(bytes) == section.xxh3 {
            return Ok(());
        }
        let at = usize::try_from(section.offset).unwrap_or(usize::MAX);
        Err(ParseError::malformed(
            at,
            format!("{what} are damaged: the checksum differs; convert again"),
        ))
    }

    /// Everything, in world coordinates: f32 where the origin is zero, else f64.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if a section is not what the index says.
    pub fn to_raw(&self) -> Result<RawParticles, ParseError> {
        let mut attributes = Vec::with_capacity(self.index.attributes.len());
        for attribute in &self.index.attributes {
            attributes.push(self.decode(attribute)?);
        }
        if !attributes
            .iter()
            .any(|a| a.name.eq_ignore_ascii_case("radius"))
        {
            attributes.extend(self.radius_attribute()?);
        }
        Ok(RawParticles {
            positions: self.positions()?,
            attributes,
            time: self.index.time,
            step: self.index.step,
        })
    }

    fn positions(&self) -> Result<Positions, ParseError> {
        let bytes = self.section(&self.index.positions)?;
        // The index was checked: `count` particles are in so many blocks of these bytes.
        let count = usize::try_from(self.index.count).unwrap_or(0);
        let origin = DVec3::from_array(self.index.origin);
        let blocks = bytes.chunks_exact(size_of::<PositionBlock>());
        let all = blocks.flat_map(|block| (0..BLOCK).map(move |lane| position(block, lane)));
        let all = all.take(count);
        Ok(if origin == DVec3::ZERO {
            let mut positions = Vec::with_capacity(count);
            positions.extend(all);
            Positions::F32(positions)
        } else {
            let mut positions = Vec::with_capacity(count);
            positions.extend(all.map(|p| p.as_dvec3() + origin));
            Positions::F64(positions)
        })
    }

    fn decode(&self, attribute: &AttributeIndex) -> Result<Attribute, ParseError> {
        let kind = layout::scalar_of(attribute.scalar)
            .ok_or_else(|| ParseError::unsupported("an attribute type that is not known"))?;
        Ok(Attribute {
            name: attribute.name.clone(),
            components: attribute.components as usize,
            data: kind.decode(Endian::Little, self.section(&attribute.section)?)?,
        })
    }

    /// Radii that no attribute of the name carries, as the attribute that readers look for.
    fn radius_attribute(&self) -> Result<Option<Attribute>, ParseError> {
        let data = match &self.index.radius {
            RadiusIndex::None => return Ok(None),
            RadiusIndex::Common(radius) => {
                AttributeData::F32(vec![
                    *radius;
                    usize::try_from(self.index.count).unwrap_or(0)
                ])
            }
            RadiusIndex::PerParticle(section) => {
                ScalarType::F32.decode(Endian::Little, self.section(section)?)?
            }
        };
        Ok(Some(Attribute {
            name: "radius".to_owned(),
            components: 1,
            data,
        }))
    }

    fn section(&self, section: &Section) -> Result<&'a [u8], ParseError> {
        let end = section.offset.checked_add(section.len);
        usize::try_from(section.offset)
            .ok()
            .zip(end.and_then(|end| usize::try_from(end).ok()))
            .and_then(|(start, end)| self.bytes.get(start..end))
            .ok_or_else(|| ParseError::malformed(0, "a section lies outside the file"))
    }

    fn plain<T: bytemuck::Pod>(&self, section: &Section) -> Option<&'a [T]> {
        if cfg!(target_endian = "big") {
            return None;
        }
        bytemuck::try_cast_slice(self.section(section).ok()?).ok()
    }
}

/// Particle `lane` of the bytes of a block.
fn position(block: &[u8], lane: usize) -> Vec3 {
    let axis = |axis: usize| {
        let at = (axis * BLOCK + lane) * 4;
        let bytes = block.get(at..).and_then(|b| b.first_chunk());
        f32::from_le_bytes(*bytes.expect("a block has three axes"))
    };
    Vec3::new(axis(0), axis(1), axis(2))
}

/// The only step of a native frame.
///
/// # Errors
/// As [`layout::parse`].
pub fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    let index = layout::parse(bytes)?;
    let step = Step {
        number: index.step,
        time: index.time,
        ..Step::whole(bytes.len())
    };
    Ok(vec![step])
}

/// Reads a native frame like any other format, every section verified.
///
/// # Errors
/// As [`layout::parse`] and [`NativeFrame::verify`].
pub fn read(bytes: &[u8], _step: &Step) -> Result<RawParticles, ParseError> {
    let index = layout::parse(bytes)?;
    let frame = NativeFrame::with_index(bytes, &index);
    frame.verify()?;
    frame.to_raw()
}

#[cfg(test)]
mod tests;
