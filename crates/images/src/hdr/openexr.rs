//! OpenEXR images, block by block.

use std::io::{Read, Seek};

use exr::block::UncompressedBlock;
use exr::block::lines::LineRef;
use exr::meta::attribute::{ChannelDescription, SampleType};
use exr::meta::header::Header;
use glam::Vec3;

use super::{Check, Pixels};
use crate::file::Fault;

/// Maximum size of an uncompressed block, bytes.
const MAX_BLOCK_BYTES: u64 = 1 << 28;

/// Names of the components.
const COMPONENTS: [&str; 3] = ["R", "G", "B"];

/// Decodes the first part of a file with the channels R, G and B, in full resolution.
pub(super) fn decode(file: impl Read + Seek, check_size: Check) -> Result<Pixels, Fault> {
    // Read the headers
    let reader = exr::block::read(file, false)?;
    let meta = reader.meta_data().clone();
    // Find the part and its channels, and check their size
    let mut found = meta
        .headers
        .iter()
        .zip(0_usize..)
        .filter_map(|(header, part)| Some((part, header, components(header)?)));
    let Some((part, header, components)) = found.next() else {
        return Err(Fault::Other("has no part with the channels R, G and B".to_owned()));
    };
    check(header, check_size)?;
    let [width, height] = [header.layer_size.x(), header.layer_size.y()];
    // Decode the blocks of the part
    let mut pixels = vec![Vec3::ZERO; width * height];
    let chunks = reader.filter_chunks(false, |_, _, block| {
        block.layer == part && block.level.x() == 0 && block.level.y() == 0
    })?;
    for chunk in chunks {
        let block = UncompressedBlock::decompress_chunk(chunk?, &meta, false)?;
        for line in block.lines(&header.channels) {
            let place = line.location;
            let component = components.iter().position(|c| *c == place.channel);
            let start = place.position.y() * width + place.position.x();
            let row = pixels.get_mut(start..start + place.sample_count);
            let (Some(component), Some(row)) = (component, row) else {
                continue;
            };
            let kind = header.channels.list[place.channel].sample_type;
            for (pixel, value) in row.iter_mut().zip(samples(&line, kind)?) {
                pixel[component] = value;
            }
        }
    }
    Ok(Pixels { width, height, pixels })
}

/// Indices of the channels R, G and B, if the part has all of them.
fn components(header: &Header) -> Option<[usize; 3]> {
    let index = |name: &str| {
        let mut channels = header.channels.list.iter();
        channels.position(|channel| channel.name.eq(name))
    };
    let [r, g, b] = COMPONENTS.map(index);
    Some([r?, g?, b?])
}

fn check(header: &Header, check_size: Check) -> Result<(), Fault> {
    check_size(header.layer_size.x(), header.layer_size.y())?;
    let is_whole = |c: &ChannelDescription| c.sampling.x() == 1 && c.sampling.y() == 1;
    if header.deep || !header.channels.list.iter().all(is_whole) {
        return Err(Fault::Other(
            "has deep or subsampled pixels; write it with plain channels R, G and B".to_owned(),
        ));
    }
    if header.max_block_byte_size() as u64 > MAX_BLOCK_BYTES {
        return Err(Fault::Other(
            "has blocks of more than 256 MiB; write it with fewer channels or smaller tiles"
                .to_owned(),
        ));
    }
    Ok(())
}

/// The values of a line.
#[expect(clippy::cast_precision_loss, reason = "integers are seldom radiance")]
fn samples(line: &LineRef<'_>, kind: SampleType) -> Result<Vec<f32>, Fault> {
    let values: Result<Vec<f32>, exr::error::Error> = match kind {
        SampleType::F16 => {
            line.read_samples::<half::f16>().map(|v| v.map(half::f16::to_f32)).collect()
        }
        SampleType::F32 => line.read_samples::<f32>().collect(),
        SampleType::U32 => line.read_samples::<u32>().map(|v| v.map(|v| v as f32)).collect(),
    };
    Ok(values?)
}
