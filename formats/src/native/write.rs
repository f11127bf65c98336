//! Makes native frames: sections at places known beforehand, filled run by run in tree order, so that a
//! frame of any size passes through in pieces.

use std::fmt;
use std::io;
use std::path::Path;

use glam::DVec3;
use glam::Vec3;
use rkyv::rancor;
use xxhash_rust::xxh3::Xxh3;

use super::layout::{
    ALIGN, AttributeIndex, Encoding, FrameIndex, HEADER_LEN, ORDER_KD, RadiiIndex, RadiusIndex,
    Section, blocks_of, header, nodes_len, positions_len,
};
use super::quantize::{Allowed, GROUP, Leaves, StoredBlock, encode};
use super::radii::CodedRadii;
use super::{Bound, RadiusRange, StoredType};
use crate::blocks::{Aabb, BLOCK_SIZE, Block, Q10Block, Q16Block};
use crate::order::index_u32;
use crate::write::atomic::Unpublished;

/// What a native frame will hold.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameSpec {
    /// Particles, fewer than 2^36 (blocks are counted in 32 bits).
    pub count: u64,
    /// How positions are stored.
    pub encoding: Encoding,
    /// How far they may be from the true ones; blocks beyond are stored as they are.
    pub bound: Bound,
    /// World position of the zero of the positions.
    pub origin: DVec3,
    /// How far the positions that are pushed are from the true ones already, scene units.
    pub rounding: f64,
    /// Radii.
    pub radius: RadiusSpec,
    /// Attributes.
    pub attributes: Vec<AttributeSpec>,
    /// Simulation time.
    pub time: Option<f64>,
    /// Step number of the simulation.
    pub step: Option<i64>,
    /// Particles that were left out because they were not finite.
    pub dropped: u64,
}

/// Radii of a frame that is to be written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RadiusSpec {
    /// Not told.
    None,
    /// All alike.
    Common(f32),
    /// One each, coded so.
    PerParticle(RadiusRange),
}

/// An attribute of a frame that is to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct AttributeSpec {
    /// Name.
    pub name: String,
    /// Numbers a particle.
    pub components: u32,
    /// Their type.
    pub stored: StoredType,
    /// Range of each component for [`StoredType::Ranged`], else empty.
    pub ranges: Vec<[f64; 2]>,
    /// Largest difference of a stored value from the true one.
    pub max_error: f64,
}

/// Particles that follow one another in tree order.
#[derive(Debug, Clone)]
pub struct Run<'a> {
    /// Positions relative to the frame's origin, finite; arranged by [`super::arrange`].
    pub positions: &'a [Vec3],
    /// Radii, for [`RadiusSpec::PerParticle`].
    pub radii: Option<&'a [f32]>,
    /// For each attribute its values as they are stored, little-endian.
    pub attributes: &'a [&'a [u8]],
}

/// Writes one native frame. Nothing is at its path before [`FrameWriter::finish`], and what there was stays
/// until then.
#[derive(Debug)]
pub struct FrameWriter {
    file: Unpublished,
    spec: FrameSpec,
    /// Particles that were pushed.
    pushed: u64,
    positions: Filling,
    nodes: Filling,
    radii: Filling,
    attributes: Vec<Filling>,
    /// Kept until the end: few, and their number is not known before.
    wide: Vec<Block>,
    max_error: f64,
    radius_error: f32,
    bounds: Aabb,
}

/// A section that is being filled.
struct Filling {
    offset: u64,
    /// Bytes when it is full.
    len: u64,
    filled: u64,
    hash: Xxh3,
}

impl FrameWriter {
    /// Begins the frame `path`.
    ///
    /// # Errors
    /// If there are too many particles, the machine is big-endian, or the temporary file beside `path` cannot be made.
    pub fn create(path: &Path, spec: FrameSpec) -> io::Result<Self> {
        if cfg!(target_endian = "big") {
            let what =
                "native frames are written as they lie in the memory of little-endian machines";
            return Err(io::Error::new(io::ErrorKind::Unsupported, what));
        }
        let too_many = || invalid(format!("{} particles are too many for a frame", spec.count));
        let mut places = Places {
            next: HEADER_LEN as u64,
        };
        let mut section = |len: Option<u64>| {
            let filling = len.and_then(|len| places.section(len));
            filling.ok_or_else(too_many)
        };
        if u32::try_from(blocks_of(spec.count)).is_err() {
            return Err(too_many());
        }
        let positions = section(positions_len(spec.count, spec.encoding))?;
        let nodes = section(nodes_len(spec.count))?;
        let radii = section(match spec.radius {
            RadiusSpec::PerParticle(range) => {
                Some(blocks_of(spec.count) * (BLOCK_SIZE * range.code.size()) as u64)
            }
            RadiusSpec::None | RadiusSpec::Common(_) => Some(0),
        })?;
        let mut attributes = Vec::with_capacity(spec.attributes.len());
        for attribute in &spec.attributes {
            attributes.push(section(spec.count.checked_mul(width(attribute)))?);
        }
        Ok(Self {
            file: Unpublished::create(path)?,
            pushed: 0,
            positions,
            nodes,
            radii,
            attributes,
            wide: Vec::new(),
            max_error: 0.0,
            radius_error: 0.0,
            bounds: Aabb::EMPTY,
            spec,
        })
    }

    /// Adds the next particles. All runs but the last have a multiple of 128.
    ///
    /// # Errors
    /// A run that does not fit the frame, or the system's reason why it cannot be written.
    pub fn push(&mut self, run: &Run) -> io::Result<()> {
        self.check(run)?;
        if run.positions.is_empty() {
            return Ok(());
        }
        let coded = match (self.spec.radius, run.radii) {
            (RadiusSpec::PerParticle(range), Some(radii)) => Some(range.coded(radii)),
            _ => None,
        };
        match self.spec.encoding {
            Encoding::F32 => self.push_leaves::<Block>(run.positions, coded.as_ref())?,
            Encoding::Q16 => self.push_leaves::<Q16Block>(run.positions, coded.as_ref())?,
            Encoding::Q10 => self.push_leaves::<Q10Block>(run.positions, coded.as_ref())?,
        }
        if let Some(coded) = coded {
            self.radius_error = self.radius_error.max(coded.max_error);
            self.radii.append(&self.file, &coded.bytes)?;
        }
        for (filling, bytes) in self.attributes.iter_mut().zip(run.attributes) {
            filling.append(&self.file, bytes)?;
        }
        self.pushed += run.positions.len() as u64;
        Ok(())
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// If particles are missing, or the file cannot be written.
    pub fn finish(self) -> io::Result<FrameIndex> {
        if self.pushed != self.spec.count {
            let (pushed, count) = (self.pushed, self.spec.count);
            return Err(invalid(format!(
                "{pushed} of {count} particles were written"
            )));
        }
        let end = [&self.positions, &self.nodes, &self.radii];
        let ends = end.into_iter().chain(&self.attributes).map(Filling::end);
        let mut places = Places {
            next: ends.max().unwrap_or(HEADER_LEN as u64),
        };
        let wide_bytes: &[u8] = bytemuck::cast_slice(&self.wide);
        let mut wide = places
            .section(wide_bytes.len() as u64)
            .ok_or_else(|| invalid("the file is too long".to_owned()))?;
        wide.append(&self.file, wide_bytes)?;
        let index = self.index(wide.done());
        let bytes = rkyv::to_bytes::<rancor::Error>(&index).map_err(io::Error::other)?;
        let offset = places.next;
        // Sections end where the next begins but for zeros, which a hole in the file reads as.
        self.file.write_all_at(&bytes, offset)?;
        let file_len = offset + bytes.len() as u64;
        self.file
            .write_all_at(&header(file_len, offset, &bytes), 0)?;
        self.file.publish()?;
        Ok(index)
    }

    fn push_leaves<B: StoredBlock>(
        &mut self,
        positions: &[Vec3],
        radii: Option<&CodedRadii>,
    ) -> io::Result<()> {
        let allowed = Allowed {
            bound: self.spec.bound,
            radius: match self.spec.radius {
                RadiusSpec::Common(radius) => Some(radius),
                RadiusSpec::None | RadiusSpec::PerParticle(_) => None,
            },
        };
        let mut leaves: Leaves<B> = encode(positions, radii, allowed);
        leaves.shift(index_u32(self.wide.len()));
        let blocks = bytemuck::cast_slice(&leaves.blocks);
        self.positions.append(&self.file, blocks)?;
        self.nodes
            .append(&self.file, bytemuck::cast_slice(&leaves.nodes))?;
        self.wide.append(&mut leaves.wide);
        self.max_error = self.max_error.max(leaves.max_error);
        self.bounds = self.bounds.union(leaves.bounds);
        Ok(())
    }

    fn check(&self, run: &Run) -> io::Result<()> {
        let len = run.positions.len();
        let after = self.pushed + len as u64;
        let is_whole = len.is_multiple_of(GROUP) || after == self.spec.count;
        let wants_radii = matches!(self.spec.radius, RadiusSpec::PerParticle(_));
        let has_radii = run.radii.map(<[f32]>::len) == wants_radii.then_some(len);
        let specs = &self.spec.attributes;
        let fit = run.attributes.len() == specs.len()
            && run
                .attributes
                .iter()
                .zip(specs)
                .all(|(bytes, spec)| bytes.len() as u64 == len as u64 * width(spec));
        if after <= self.spec.count && is_whole && has_radii && fit {
            return Ok(());
        }
        Err(invalid(format!(
            "{len} particles after {} do not fit a frame of {} as it was begun",
            self.pushed, self.spec.count
        )))
    }

    fn index(&self, wide: Section) -> FrameIndex {
        let spec = &self.spec;
        let attribute = |(spec, filling): (&AttributeSpec, &Filling)| AttributeIndex {
            name: spec.name.clone(),
            stored: spec.stored.code(),
            components: spec.components,
            ranges: spec.ranges.clone(),
            max_error: spec.max_error,
            section: filling.done(),
        };
        FrameIndex {
            count: spec.count,
            block: index_u32(BLOCK_SIZE),
            encoding: spec.encoding.code(),
            order: ORDER_KD,
            origin: spec.origin.to_array(),
            min: self.bounds.min.to_array(),
            max: self.bounds.max.to_array(),
            max_error: self.max_error + spec.rounding,
            positions: self.positions.done(),
            wide,
            nodes: self.nodes.done(),
            radius: match spec.radius {
                RadiusSpec::None => RadiusIndex::None,
                RadiusSpec::Common(radius) => RadiusIndex::Common(radius),
                RadiusSpec::PerParticle(range) => RadiusIndex::PerParticle(RadiiIndex {
                    code: range.code.code(),
                    low: range.low,
                    high: range.high,
                    max_error: self.radius_error,
                    section: self.radii.done(),
                }),
            },
            attributes: spec
                .attributes
                .iter()
                .zip(&self.attributes)
                .map(attribute)
                .collect(),
            time: spec.time,
            step: spec.step,
            dropped: spec.dropped,
        }
    }
}

/// Blocks of `positions` (in tree order, arranged) that `encoding` would have to keep as they are, under
/// `bound` for spheres of the common `radius`.
pub fn wide_blocks(
    positions: &[Vec3],
    encoding: Encoding,
    bound: Bound,
    radius: Option<f32>,
) -> usize {
    let allowed = Allowed { bound, radius };
    match encoding {
        Encoding::F32 => 0,
        Encoding::Q16 => encode::<Q16Block>(positions, None, allowed).wide.len(),
        Encoding::Q10 => encode::<Q10Block>(positions, None, allowed).wide.len(),
    }
}

/// Bytes of an attribute's values for one particle.
fn width(attribute: &AttributeSpec) -> u64 {
    u64::from(attribute.components) * attribute.stored.size() as u64
}

fn invalid(what: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, what)
}

/// Gives sections their places, one after the other.
struct Places {
    next: u64,
}

impl Places {
    /// A section of `len` bytes; none if that is beyond 64 bits.
    fn section(&mut self, len: u64) -> Option<Filling> {
        let offset = self.next;
        self.next = offset.checked_add(len)?.checked_next_multiple_of(ALIGN)?;
        Some(Filling {
            offset,
            len,
            filled: 0,
            hash: Xxh3::new(),
        })
    }
}

impl fmt::Debug for Filling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} of {} bytes at {}",
            self.filled, self.len, self.offset
        )
    }
}

impl Filling {
    fn append(&mut self, file: &Unpublished, bytes: &[u8]) -> io::Result<()> {
        debug_assert!(
            self.filled + bytes.len() as u64 <= self.len,
            "checked before"
        );
        file.write_all_at(bytes, self.offset + self.filled)?;
        self.filled += bytes.len() as u64;
        self.hash.update(bytes);
        Ok(())
    }

    /// Where the next section may begin.
    fn end(&self) -> u64 {
        (self.offset + self.len).next_multiple_of(ALIGN)
    }

    fn done(&self) -> Section {
        Section {
            offset: self.offset,
            len: self.len,
            xxh3: self.hash.digest(),
        }
    }
}
