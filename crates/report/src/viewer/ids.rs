//! Which particle is under the pointer, and its values: compact, at a reduced resolution.
//!
//! The particles of a frame are numbered in the order in which they appear, and each sample has the number of its
//! particle. Neighbouring samples have equal or near numbers, so that they compress well. Tables have the ids and
//! values by number. All is compressed by zlib, in base64; `viewer.js` reads it. Numbers are little-endian:
//!
//! - u32: width and height in samples, particles `n`, values per particle `m`, distance of samples in pixels
//! - bytes 0, 1 and 2 of the numbers of all samples: first all low bytes. 0 is no particle, 1 the first one.
//! - `n` u32: ids
//! - `m` times `n` f32: values

use std::collections::HashMap;
use std::io::{self, Write};

use spherule_images::output::base64;
use spherule_images::picture::SampledPlanes;
use spherule_tracer::render::{FilmPlane, NO_ID};

use flate2::Compression;
use flate2::write::ZlibEncoder;

use super::channels::{attribute_vectors, depths, ids, length, vectors};

/// Names of the values in [`packed_ids`].
pub(super) fn value_names(planes: &SampledPlanes, attributes: &[String]) -> Vec<String> {
    columns(planes, attributes).into_iter().map(|(name, _)| name).collect()
}

/// A value at each sample.
type Column<'a> = (String, Box<dyn Fn(usize) -> f32 + 'a>);

/// The values that the planes have: attributes, speed, and depth.
fn columns<'a>(planes: &'a SampledPlanes, attributes: &[String]) -> Vec<Column<'a>> {
    let mut all: Vec<Column<'a>> = Vec::new();
    for name in attributes {
        if let Some(samples) = planes.floats(name) {
            all.push((name.clone(), Box::new(|i| samples[i])));
        } else if let Some(axes) = attribute_vectors(planes, name) {
            all.push((format!("|{name}|"), Box::new(move |i| length(&axes, i))));
        }
    }
    if let Some(axes) = vectors(planes, FilmPlane::Velocity) {
        all.push(("speed".to_owned(), Box::new(move |i| length(&axes, i))));
    }
    if let Some(samples) = depths(planes) {
        all.push(("depth".to_owned(), Box::new(|i| samples[i])));
    }
    all
}

/// Ids and values of the samples; None if the image has no ids. Values are those of the first sample of a particle.
pub(super) fn packed_ids(
    planes: &SampledPlanes,
    attributes: &[String],
) -> io::Result<Option<String>> {
    let Some(ids) = ids(planes) else {
        return Ok(None);
    };
    // Number the particles
    let mut numbers: HashMap<u32, u32> = HashMap::new();
    let mut firsts = Vec::new();
    let mut samples = Vec::with_capacity(ids.len());
    for (i, id) in ids.iter().enumerate() {
        if *id == NO_ID {
            samples.push(0);
            continue;
        }
        let next = u32::try_from(firsts.len() + 1).map_err(io::Error::other)?;
        let number = *numbers.entry(*id).or_insert(next);
        if number == next {
            firsts.push(i);
        }
        samples.push(number);
    }
    let columns = columns(planes, attributes);
    // Write the parts
    let mut file = ZlibEncoder::new(Vec::new(), Compression::new(7));
    let header = [planes.size[0], planes.size[1], firsts.len(), columns.len(), planes.step];
    for value in header {
        let value = u32::try_from(value).map_err(io::Error::other)?;
        file.write_all(&value.to_le_bytes())?;
    }
    for byte in 0..3 {
        let plane: Vec<u8> = samples.iter().map(|number| number.to_le_bytes()[byte]).collect();
        file.write_all(&plane)?;
    }
    for first in &firsts {
        file.write_all(&ids[*first].to_le_bytes())?;
    }
    for (_, value) in &columns {
        for first in &firsts {
            file.write_all(&value(*first).to_le_bytes())?;
        }
    }
    Ok(Some(base64(&file.finish()?)))
}
