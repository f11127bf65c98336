//! Writes native frames. The offsets of the sections are known in advance, and the sections are filled run by
//! run in tree order, so that a frame of any size can be written in pieces.

use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

use glam::DVec3;
use glam::Vec3;
use spherule_files::Publisher;

use super::layout::{
    ALIGN, AttributeIndex, Encoding, FrameDetails, FrameIndex, HEADER_LEN, ORDER_KD, RadiiIndex,
    RadiusIndex, Section, UP_Y, blocks_of, header, index_bytes, nodes_len, positions_len,
};
use super::quantize::{EncodeLimits, EncodedLeaves, GROUP, StoredBlock, encode};
use super::radii::CodedRadii;
use super::sections::{SectionOffsets, SectionProgress, SectionWriter, piece};
use super::{Bound, RadiusRange, StoredType};
use crate::blocks::{Aabb, BLOCK_SIZE, Block, Q10Block, Q16Block};
use crate::order::index_u32;

/// Describes a native frame that will be written.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameSpec {
    /// Number of particles, fewer than 2^36 (blocks are counted in 32 bits).
    pub count: u64,
    /// How positions are stored.
    pub encoding: Encoding,
    /// Largest distance of positions from the true ones; blocks that exceed it are stored as f32.
    pub bound: Bound,
    /// Whether y points up in the program that made the particles; otherwise the axis is unknown.
    pub is_y_up: bool,
    /// World position that stored positions are relative to.
    pub origin: DVec3,
    /// Distance of the pushed positions from the true ones before encoding, scene units.
    pub rounding: f64,
    /// Radii.
    pub radius: RadiusSpec,
    /// Attributes.
    pub attributes: Vec<AttributeSpec>,
    /// Simulation time.
    pub time: Option<f64>,
    /// Step number of the simulation.
    pub step: Option<i64>,
    /// Particles that were dropped because they were not finite.
    pub dropped: u64,
    /// What the frame has beside the particles.
    pub details: FrameDetails,
}

/// The radii of a frame that will be written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RadiusSpec {
    /// The radii are unknown.
    None,
    /// All particles have this radius.
    Common(f32),
    /// Each particle has its own radius, coded in this way.
    PerParticle(RadiusRange),
}

/// An attribute of a frame that will be written.
#[derive(Debug, Clone, PartialEq)]
pub struct AttributeSpec {
    /// Name.
    pub name: String,
    /// Numbers per particle.
    pub components: u32,
    /// The stored type of the numbers.
    pub stored: StoredType,
    /// The range of each component for [`StoredType::Ranged`], else empty.
    pub ranges: Vec<[f64; 2]>,
    /// Largest difference of a stored value from the true one.
    pub max_error: f64,
}

/// Successive particles in tree order.
#[derive(Debug, Clone)]
pub struct Run<'a> {
    /// Finite positions relative to the frame's origin, arranged by [`super::arrange`].
    pub positions: &'a [Vec3],
    /// Radii, for [`RadiusSpec::PerParticle`].
    pub radii: Option<&'a [f32]>,
    /// For each attribute, its values in their stored form, little-endian.
    pub attributes: &'a [&'a [u8]],
}

/// Particles that are encoded at once: enough for many threads, and few enough that the codes are still in the
/// cache when they are written.
const CODED_LEN: usize = 1 << 18;

/// Numbers of the sections in file order. Attributes follow, and the wide blocks are the last section, because
/// their length is not known in advance.
const POSITIONS: usize = 0;
const NODES: usize = 1;
const RADII: usize = 2;
const ATTRIBUTES: usize = 3;

/// Writes one native frame. [`FrameWriter::finish`] creates or replaces the file at its path; before that, an
/// earlier file stays unchanged.
#[derive(Debug)]
pub struct FrameWriter {
    sections: SectionWriter,
    spec: FrameSpec,
    /// Number of particles that were pushed.
    pushed: u64,
    /// Number of blocks that are stored as f32.
    wide: u64,
    max_error: f64,
    radius_error: f32,
    bounds: Aabb,
}

impl FrameWriter {
    /// Starts the frame `path`.
    ///
    /// # Errors
    /// If there are too many particles, if the machine is big-endian, or if the temporary file beside `path`
    /// cannot be created.
    pub fn create(path: &Path, spec: FrameSpec) -> io::Result<Self> {
        if cfg!(target_endian = "big") {
            let what = "native frames can only be written on little-endian machines";
            return Err(io::Error::new(io::ErrorKind::Unsupported, what));
        }
        let sections = sections_of(&spec)
            .filter(|_| u32::try_from(blocks_of(spec.count)).is_ok())
            .ok_or_else(|| invalid(format!("{} particles are too many for a frame", spec.count)))?;
        Ok(Self {
            sections: SectionWriter::begin(Publisher::create(path)?, sections)?,
            pushed: 0,
            wide: 0,
            max_error: 0.0,
            radius_error: 0.0,
            bounds: Aabb::EMPTY,
            spec,
        })
    }

    /// Adds the next particles. The length of every run except the last must be a multiple of 128.
    ///
    /// # Errors
    /// If the run does not fit the frame, or the system's error if this run or an earlier one cannot be
    /// written.
    pub fn push(&mut self, run: &Run) -> io::Result<()> {
        self.check(run)?;
        let mut first = 0;
        for positions in run.positions.chunks(CODED_LEN) {
            let end = first + positions.len();
            let radii = run.radii.map(|radii| &radii[first..end]);
            self.push_positions(positions, radii)?;
            for (number, bytes) in run.attributes.iter().enumerate() {
                let width = bytes.len() / run.positions.len();
                let own = bytes[first * width..end * width].to_vec();
                self.sections.append(ATTRIBUTES + number, piece(own))?;
            }
            first = end;
        }
        self.pushed += run.positions.len() as u64;
        Ok(())
    }

    /// Completes the file and renames it to its path.
    ///
    /// # Errors
    /// If particles are missing, or the file cannot be written.
    pub fn finish(self) -> io::Result<FrameIndex> {
        // Check that all particles were written
        let Self { pushed, .. } = self;
        if pushed != self.spec.count {
            let count = self.spec.count;
            return Err(invalid(format!("{pushed} of {count} particles were written")));
        }
        // Wait for the sections
        let mut filled = self.sections.finish()?;
        let sections: Vec<Section> = filled.sections.iter().map(SectionProgress::done).collect();
        let measured = FrameSummary {
            max_error: self.max_error,
            radius_error: self.radius_error,
            bounds: self.bounds,
        };
        // Write the index behind them
        let index = index_of(&self.spec, &measured, &sections);
        let (bytes, details) = index_bytes(&index)?;
        let end = index.wide.offset + index.wide.len;
        let offset = end.next_multiple_of(ALIGN);
        // The gap between the sections and the index is a hole in the file, which reads as zeros.
        filled.file.seek(SeekFrom::Start(offset))?;
        filled.file.write_all(&bytes)?;
        // Write the header and publish the file
        let file_len = offset + bytes.len() as u64;
        let header = header(file_len, offset, &bytes, details);
        filled.file.rewind()?;
        filled.file.write_all(&header)?;
        filled.file.commit()?;
        Ok(index)
    }

    fn push_positions(&mut self, positions: &[Vec3], radii: Option<&[f32]>) -> io::Result<()> {
        let coded = match (self.spec.radius, radii) {
            (RadiusSpec::PerParticle(range), Some(radii)) => Some(range.coded(radii)),
            _ => None,
        };
        match self.spec.encoding {
            Encoding::F32 => self.push_leaves::<Block>(positions, coded.as_ref())?,
            Encoding::Q16 => self.push_leaves::<Q16Block>(positions, coded.as_ref())?,
            Encoding::Q10 => self.push_leaves::<Q10Block>(positions, coded.as_ref())?,
        }
        if let Some(coded) = coded {
            self.radius_error = self.radius_error.max(coded.max_error);
            self.sections.append(RADII, piece(coded.bytes))?;
        }
        Ok(())
    }

    fn push_leaves<B: StoredBlock>(
        &mut self,
        positions: &[Vec3],
        radii: Option<&CodedRadii>,
    ) -> io::Result<()> {
        // Encode the leaves
        let allowed = EncodeLimits {
            bound: self.spec.bound,
            radius: match self.spec.radius {
                RadiusSpec::Common(radius) => Some(radius),
                RadiusSpec::None | RadiusSpec::PerParticle(_) => None,
            },
        };
        let mut leaves: EncodedLeaves<B> = encode(positions, radii, allowed);
        // There are fewer wide blocks than blocks, which are counted in 32 bits.
        leaves.shift(u32::try_from(self.wide).map_err(io::Error::other)?);
        // Update the summary of the frame
        self.wide += leaves.wide.len() as u64;
        self.max_error = self.max_error.max(leaves.max_error);
        self.bounds = self.bounds.union(leaves.bounds);
        // Append the sections
        self.sections.append(POSITIONS, piece(leaves.blocks))?;
        self.sections.append(NODES, piece(leaves.nodes))?;
        if !leaves.wide.is_empty() {
            let wide = ATTRIBUTES + self.spec.attributes.len();
            self.sections.append(wide, piece(leaves.wide))?;
        }
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
}

/// The sections at their offsets; `None` if the file would be too long.
fn sections_of(spec: &FrameSpec) -> Option<Vec<SectionProgress>> {
    let mut places = SectionOffsets { next: HEADER_LEN as u64 };
    let radii = match spec.radius {
        RadiusSpec::PerParticle(range) => {
            blocks_of(spec.count).checked_mul((BLOCK_SIZE * range.code.size()) as u64)?
        }
        RadiusSpec::None | RadiusSpec::Common(_) => 0,
    };
    let mut sections = vec![
        places.section(positions_len(spec.count, spec.encoding)?)?,
        places.section(nodes_len(spec.count)?)?,
        places.section(radii)?,
    ];
    for attribute in &spec.attributes {
        sections.push(places.section(spec.count.checked_mul(width(attribute))?)?);
    }
    sections.push(places.section(0)?);
    Some(sections)
}

/// Values that are known when all runs are written.
struct FrameSummary {
    max_error: f64,
    radius_error: f32,
    bounds: Aabb,
}

fn index_of(spec: &FrameSpec, measured: &FrameSummary, sections: &[Section]) -> FrameIndex {
    let wide = ATTRIBUTES + spec.attributes.len();
    let attribute = |(spec, section): (&AttributeSpec, &Section)| AttributeIndex {
        name: spec.name.clone(),
        stored: spec.stored.code(),
        components: spec.components,
        ranges: spec.ranges.clone(),
        max_error: spec.max_error,
        section: *section,
    };
    // Sections are in a fixed order: those of all frames, then one for each attribute, then uncoded blocks
    let attributes = spec.attributes.iter().zip(&sections[ATTRIBUTES..wide]);
    FrameIndex {
        count: spec.count,
        block: index_u32(BLOCK_SIZE),
        encoding: spec.encoding.code(),
        order: ORDER_KD,
        up: if spec.is_y_up { UP_Y } else { 0 },
        origin: spec.origin.to_array(),
        min: measured.bounds.min.to_array(),
        max: measured.bounds.max.to_array(),
        max_error: measured.max_error + spec.rounding,
        positions: sections[POSITIONS],
        wide: sections[wide],
        nodes: sections[NODES],
        radius: match spec.radius {
            RadiusSpec::None => RadiusIndex::None,
            RadiusSpec::Common(radius) => RadiusIndex::Common(radius),
            RadiusSpec::PerParticle(range) => RadiusIndex::PerParticle(RadiiIndex {
                code: range.code.code(),
                low: range.low,
                high: range.high,
                max_error: measured.radius_error,
                section: sections[RADII],
            }),
        },
        attributes: attributes.map(attribute).collect(),
        time: spec.time,
        step: spec.step,
        dropped: spec.dropped,
        details: spec.details.clone(),
    }
}

/// The number of blocks of `positions` (in tree order, arranged) that `encoding` would have to store as f32
/// under `bound`, for spheres of the common `radius`.
pub fn wide_blocks(
    positions: &[Vec3],
    encoding: Encoding,
    bound: Bound,
    radius: Option<f32>,
) -> usize {
    let allowed = EncodeLimits { bound, radius };
    let runs = positions.chunks(CODED_LEN);
    runs.map(|run| match encoding {
        Encoding::F32 => 0,
        Encoding::Q16 => encode::<Q16Block>(run, None, allowed).wide.len(),
        Encoding::Q10 => encode::<Q10Block>(run, None, allowed).wide.len(),
    })
    .sum()
}

/// Bytes per particle of an attribute's values.
fn width(attribute: &AttributeSpec) -> u64 {
    u64::from(attribute.components) * attribute.stored.size() as u64
}

fn invalid(what: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, what)
}
