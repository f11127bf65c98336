//! The index of a native frame: sections, sizes, bytes per particle. Large frames are not read completely.

use std::path::Path;

use serde_json::{Value, json};
use spherule_formats::blocks::{BLOCK_SIZE, Block, Node};
use spherule_formats::native::layout::{RadiusIndex, UP_Y, VERSION, blocks_of};
use spherule_formats::native::{Access, FrameIndex, NativeFile, RadiusCode, StoredType};
use spherule_formats::stats::FrameStats;
use spherule_formats::{FrameError, Labels, ScalarType};

use super::Inspected;
use crate::report::THESIS_BYTES_PER_PARTICLE;

/// Maximum number of particles for which a frame is read completely; larger ones are sampled.
const LARGEST_READ: u64 = 4_000_000;
/// Number of sampled particles: reading a page that is not in memory takes about 20 µs.
const SAMPLE: usize = 32_768;

/// Summary of a native frame.
pub(super) struct NativeFacts {
    pub(super) index: FrameIndex,
    /// Length of the file.
    bytes: u64,
    /// Number of sampled particles, if the frame was sampled.
    pub(super) sample: Option<usize>,
}

/// Inspects the native frame at `path`.
///
/// # Errors
/// [`FrameError`] if it is damaged, as far as it is read.
pub(super) fn inspect(
    path: &Path,
    number: Option<i64>,
    verify: bool,
) -> Result<Inspected<'_>, FrameError> {
    let file = NativeFile::open(path, Access::Map)?;
    let summary = summarise(&file, verify);
    // That the file was changed explains whatever was found.
    file.check()?;
    let (stats, sample) = summary?;
    let index = file.index().clone();
    let bytes = file.byte_len();
    Ok(Inspected {
        file: path,
        format: "spf",
        frame: index.step.or(number),
        time: index.time,
        encoding: index.encoding().name(),
        stats,
        bytes_per_particle: (index.count > 0).then(|| bytes as f64 / index.count as f64),
        cell: index.details.cell,
        native: Some(NativeFacts::new(index, bytes, sample)),
        labels: Labels::new(),
        bond_count: 0,
        topology: None,
        notes: Vec::new(),
        verified: verify,
    })
}

/// Statistics of the frame, and the number of particles if it was sampled.
fn summarise(file: &NativeFile, verify: bool) -> Result<(FrameStats, Option<usize>), FrameError> {
    let frame = file.frame()?;
    let index = file.index();
    let is_large = index.count > LARGEST_READ;
    let checked = match (verify, is_large) {
        (true, _) => frame.verify_all(),
        (false, true) => Ok(()),
        (false, false) => frame.verify(),
    };
    let raw = checked
        .and_then(|()| if is_large { frame.sample(SAMPLE) } else { frame.to_raw() })
        .map_err(|e| e.in_file(file.path()))?;
    let mut stats = FrameStats::of(&raw);
    stats.dropped += index.dropped;
    if is_large {
        complete(&mut stats, index);
    }
    Ok((stats, is_large.then(|| raw.positions.len())))
}

/// Replaces statistics of a sample by exact values from the index.
fn complete(stats: &mut FrameStats, index: &FrameIndex) {
    stats.count = index.count;
    let origin = glam::DVec3::from_array(index.origin);
    let world = |corner: [f32; 3]| glam::Vec3::from_array(corner).as_dvec3() + origin;
    stats.bounds = Some((world(index.min), world(index.max)));
    stats.radius = match &index.radius {
        RadiusIndex::None => stats.radius,
        RadiusIndex::Common(radius) => Some((*radius, *radius)),
        RadiusIndex::PerParticle(radii) => Some((radii.low, radii.high)),
    };
    for attribute in &mut stats.attributes {
        let mut known = index.attributes.iter();
        let stored = known.find(|a| a.name == attribute.name);
        attribute.scalar_type = match stored.and_then(|a| StoredType::of_code(a.stored)) {
            Some(StoredType::Plain(kind)) => kind,
            _ => ScalarType::F32,
        };
    }
}

/// Bytes of a file by purpose.
struct Parts {
    positions: u64,
    radii: u64,
    attributes: u64,
    nodes: u64,
    /// Header, index, zeros between sections.
    rest: u64,
    all: u64,
}

impl NativeFacts {
    pub(super) const fn new(index: FrameIndex, bytes: u64, sample: Option<usize>) -> Self {
        Self { index, bytes, sample }
    }

    fn parts(&self) -> Parts {
        let index = &self.index;
        let positions = index.positions.len + index.wide.len;
        let radii = match &index.radius {
            RadiusIndex::PerParticle(radii) => radii.section.len,
            RadiusIndex::None | RadiusIndex::Common(_) => 0,
        };
        let attributes = index.attributes.iter().map(|a| a.section.len).sum();
        let nodes = index.nodes.len;
        let known = positions + radii + attributes + nodes;
        Parts {
            positions,
            radii,
            attributes,
            nodes,
            rest: self.bytes.saturating_sub(known),
            all: self.bytes,
        }
    }

    fn blocks(&self) -> [u64; 3] {
        [
            blocks_of(self.index.count),
            self.index.wide.len / size_of::<Block>() as u64,
            self.index.nodes.len / size_of::<Node>() as u64,
        ]
    }

    /// `bytes` per particle.
    fn each(&self, bytes: u64) -> Option<f64> {
        (self.index.count > 0).then(|| bytes as f64 / self.index.count as f64)
    }

    pub(super) fn to_json(&self) -> Value {
        let index = &self.index;
        let parts = self.parts();
        let [blocks, wide, nodes] = self.blocks();
        json!({
            "version": VERSION,
            "order": "k-d",
            "up": (self.index.up == UP_Y).then_some("y"),
            "block_size": BLOCK_SIZE,
            "blocks": blocks,
            "wide_blocks": wide,
            "nodes": nodes,
            "origin": index.origin,
            "min": index.min.map(f64::from),
            "max": index.max.map(f64::from),
            "max_error": index.max_error,
            "step": index.step,
            "dropped": index.dropped,
            "radius": self.radius_json(),
            "attributes": index.attributes.iter().map(|a| json!({
                "name": a.name,
                "stored": stored_name(a.stored),
                "components": a.components,
                "ranges": a.ranges,
                "max_error": a.max_error,
            })).collect::<Vec<_>>(),
            "sections": index.sections().into_iter().map(|(what, section)| json!({
                "name": what.strip_prefix("the ").unwrap_or(&what),
                "offset": section.offset,
                "bytes": section.len,
                "xxh3": format!("{:016x}", section.xxh3),
            })).collect::<Vec<_>>(),
            "file_bytes": self.bytes,
            "bytes_per_particle": {
                "positions": self.each(parts.positions),
                "radii": self.each(parts.radii),
                "attributes": self.each(parts.attributes),
                "nodes": self.each(parts.nodes),
                "rest": self.each(parts.rest),
                "all": self.each(parts.all),
                "positions_and_nodes": self.each(parts.positions + parts.nodes),
                "thesis_positions_and_structure": THESIS_BYTES_PER_PARTICLE,
            },
            "sample": self.sample,
        })
    }

    fn radius_json(&self) -> Value {
        match &self.index.radius {
            RadiusIndex::None => Value::Null,
            RadiusIndex::Common(radius) => json!({"common": radius}),
            RadiusIndex::PerParticle(radii) => json!({
                "stored": radius_name(radii.code),
                "min": radii.low,
                "max": radii.high,
                "max_error": radii.max_error,
            }),
        }
    }

    /// Lines for people.
    pub(super) fn to_lines(&self) -> Vec<String> {
        let index = &self.index;
        let [blocks, wide, nodes] = self.blocks();
        let mut lines = vec![
            format!(
                "  version {VERSION}, k-d order, {blocks} blocks of {BLOCK_SIZE} ({wide} kept as f32), {nodes} nodes"
            ),
            format!("  largest error {:e}, origin {:?}", index.max_error, index.origin),
        ];
        lines.extend(index.step.map(|step| format!("  step {step}")));
        lines.extend(self.bytes_lines());
        for (what, section) in index.sections() {
            let name = what.strip_prefix("the ").unwrap_or(&what);
            let (bytes, place) = (section.len, section.offset);
            lines.push(format!("  {name}: {bytes} bytes at {place}"));
        }
        if let RadiusIndex::PerParticle(radii) = &index.radius {
            let (stored, error) = (radius_name(radii.code), radii.max_error);
            lines.push(format!("  radii stored as {stored}, largest error {error:e}"));
        }
        for attribute in &index.attributes {
            let (name, stored) = (&attribute.name, stored_name(attribute.stored));
            let error = attribute.max_error;
            lines.push(format!("  {name} stored as {stored}, largest error {error:e}"));
        }
        lines
    }

    fn bytes_lines(&self) -> Vec<String> {
        let parts = self.parts();
        let Some(all) = self.each(parts.all) else {
            return Vec::new();
        };
        let each = |bytes| self.each(bytes).unwrap_or(0.0);
        let mut line = "  bytes per particle:".to_owned();
        for (bytes, what) in [
            (parts.positions, "positions"),
            (parts.radii, "radii"),
            (parts.attributes, "attributes"),
            (parts.nodes, "nodes"),
            (parts.rest, "header, index and padding"),
        ] {
            line += &format!(" {:.2} {what},", each(bytes));
        }
        vec![
            line + &format!(" {all:.2} in all"),
            format!(
                "  positions and nodes: {:.2} bytes per particle (thesis: {} bytes per particle)",
                each(parts.positions + parts.nodes),
                THESIS_BYTES_PER_PARTICLE
            ),
        ]
    }
}

fn stored_name(code: u32) -> &'static str {
    StoredType::of_code(code).map_or("unknown", StoredType::name)
}

fn radius_name(code: u32) -> &'static str {
    match RadiusCode::of_code(code) {
        Some(RadiusCode::U8) => "u8",
        Some(RadiusCode::U16) => "u16",
        Some(RadiusCode::F32) => "f32",
        None => "unknown",
    }
}
