//! Writes native frames: one pass over the particles, a small buffer, no copy of the frame.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use bytemuck::Zeroable;
use glam::Vec3;
use rkyv::rancor;
use xxhash_rust::xxh3::Xxh3;

use super::layout::{
    ALIGN, AttributeIndex, BLOCK, ENCODING_F32, FrameIndex, HEADER_LEN, ORDER_FILE, PositionBlock,
    RadiusIndex, Section, header, scalar_code,
};
use crate::attribute::with_values;
use crate::write::atomic::publish;
use crate::{Attribute, AttributeData, FrameError, ParticleFrame, Radius};

/// Writes `frame` to `path`, whole or not at all; `step` is its number in the simulation.
///
/// # Errors
/// [`FrameError::Io`]; also if an attribute or the radii do not have one value group a particle.
pub fn write(path: &Path, frame: &ParticleFrame, step: Option<i64>) -> Result<(), FrameError> {
    check(frame)
        .and_then(|()| publish(path, |file| fill(file, frame, step)))
        .map_err(|e| FrameError::io(path, e))
}

fn check(frame: &ParticleFrame) -> io::Result<()> {
    let bad = |what: String| Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    for a in &frame.attributes {
        if a.components == 0 || frame.len().checked_mul(a.components) != Some(a.data.len()) {
            return bad(format!(
                "attribute {} has {} values of {} components for {} particles",
                a.name,
                a.data.len(),
                a.components,
                frame.len()
            ));
        }
    }
    match &frame.radius {
        Some(Radius::PerParticle(radii)) if radii.len() != frame.len() => bad(format!(
            "{} radii for {} particles",
            radii.len(),
            frame.len()
        )),
        _ => Ok(()),
    }
}

fn fill(file: &mut BufWriter<File>, frame: &ParticleFrame, step: Option<i64>) -> io::Result<()> {
    let mut out = Sections { file, at: 0 };
    // The true header follows when the index is known.
    out.write(&[0; HEADER_LEN])?;
    let positions = out.section(|sink| write_blocks(&frame.positions, sink))?;
    let mut attributes = Vec::with_capacity(frame.attributes.len());
    for attribute in &frame.attributes {
        attributes.push(AttributeIndex {
            name: attribute.name.clone(),
            scalar: scalar_code(attribute.data.scalar_type()),
            components: u32::try_from(attribute.components).map_err(io::Error::other)?,
            section: out.section(|sink| write_values(&attribute.data, sink))?,
        });
    }
    let radius = match &frame.radius {
        None => RadiusIndex::None,
        Some(Radius::Common(radius)) => RadiusIndex::Common(*radius),
        Some(Radius::PerParticle(radii)) => RadiusIndex::PerParticle(
            match frame.attributes.iter().position(|a| holds(a, radii)) {
                Some(same) => attributes[same].section,
                None => out.section(|sink| write_numbers(radii, |v| v.to_le_bytes(), sink))?,
            },
        ),
    };
    let (min, max) = frame
        .positions
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), p| {
            (min.min(*p), max.max(*p))
        });
    let index = FrameIndex {
        count: frame.len() as u64,
        block: u32::try_from(BLOCK).map_err(io::Error::other)?,
        encoding: ENCODING_F32,
        order: ORDER_FILE,
        origin: frame.origin.to_array(),
        min: min.to_array(),
        max: max.to_array(),
        max_error: 0.0,
        positions,
        radius,
        attributes,
        time: frame.time,
        step,
        dropped: frame.dropped,
    };
    let index = rkyv::to_bytes::<rancor::Error>(&index).map_err(io::Error::other)?;
    out.align()?;
    let offset = out.at;
    out.write(&index)?;
    let file_len = out.at;
    file.seek(SeekFrom::Start(0))?;
    file.write_all(&header(file_len, offset, &index))
}

/// True if `attribute` stores exactly `radii`, so that one section does for both.
fn holds(attribute: &Attribute, radii: &[f32]) -> bool {
    matches!(&attribute.data, AttributeData::F32(v) if attribute.components == 1 && v == radii)
}

struct Sections<'a> {
    file: &'a mut BufWriter<File>,
    at: u64,
}

/// Takes bytes of a section, in order.
type Sink<'a> = dyn FnMut(&[u8]) -> io::Result<()> + 'a;

impl Sections<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.at += bytes.len() as u64;
        self.file.write_all(bytes)
    }

    fn align(&mut self) -> io::Result<()> {
        let zeros = [0; 64];
        let missing = self.at.next_multiple_of(ALIGN) - self.at;
        let missing = usize::try_from(missing).map_err(io::Error::other)?;
        self.write(&zeros[..missing])
    }

    fn section(
        &mut self,
        fill: impl FnOnce(&mut Sink<'_>) -> io::Result<()>,
    ) -> io::Result<Section> {
        self.align()?;
        let offset = self.at;
        let mut hash = Xxh3::new();
        fill(&mut |bytes| {
            hash.update(bytes);
            self.write(bytes)
        })?;
        Ok(Section {
            offset,
            len: self.at - offset,
            xxh3: hash.digest(),
        })
    }
}

fn write_blocks(positions: &[Vec3], sink: &mut Sink<'_>) -> io::Result<()> {
    for chunk in positions.chunks(BLOCK) {
        let mut block = PositionBlock::zeroed();
        for lane in 0..BLOCK {
            // Past the end the last particle stands again: harmless to bounds and nearest hits.
            let p = chunk[lane.min(chunk.len() - 1)];
            (block.x[lane], block.y[lane], block.z[lane]) = (p.x, p.y, p.z);
        }
        if cfg!(target_endian = "little") {
            sink(bytemuck::bytes_of(&block))?;
        } else {
            for axis in [&block.x, &block.y, &block.z] {
                write_numbers(axis, |v| v.to_le_bytes(), sink)?;
            }
        }
    }
    Ok(())
}

fn write_values(data: &AttributeData, sink: &mut Sink<'_>) -> io::Result<()> {
    with_values!(data, v => write_numbers(v, |x| x.to_le_bytes(), sink))
}

/// Numbers by way of a small buffer, so that byte order costs no copy of the array.
fn write_numbers<T: bytemuck::Pod, const N: usize>(
    values: &[T],
    bytes_of: impl Fn(T) -> [u8; N],
    sink: &mut Sink<'_>,
) -> io::Result<()> {
    if cfg!(target_endian = "little") {
        return sink(bytemuck::cast_slice(values));
    }
    let mut buffer = Vec::with_capacity(4096 * N);
    for chunk in values.chunks(4096) {
        buffer.clear();
        for value in chunk {
            buffer.extend_from_slice(&bytes_of(*value));
        }
        sink(&buffer)?;
    }
    Ok(())
}
