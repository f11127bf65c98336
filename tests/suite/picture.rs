//! EXR images read back, so that tests can look at what a picture holds.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use exr::meta::MetaData;
use exr::prelude::{AttributeValue, FlatSamples, ReadChannels, ReadLayers, read};

/// `worldToCamera` of the image at `path`.
#[track_caller]
pub(crate) fn world_to_camera(path: &Path) -> [f32; 16] {
    let meta = MetaData::read_from_file(path, false).expect("an EXR");
    let matrix = meta.headers[0].own_attributes.world_to_camera;
    matrix.expect("the attribute")
}

/// The values of one channel, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Plane {
    /// Half or float in the file.
    Float(Vec<f32>),
    /// Unsigned integers.
    Uint(Vec<u32>),
}

/// An image with its channels by name.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Picture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) planes: BTreeMap<String, Plane>,
    /// The custom attribute `spherule`, if there is one.
    pub(crate) facts: Option<serde_json::Value>,
}

impl Picture {
    /// The image at `path`.
    #[track_caller]
    pub(crate) fn open(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        Self::decode(&bytes)
    }

    /// The image in `bytes`.
    #[track_caller]
    pub(crate) fn decode(bytes: &[u8]) -> Self {
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .from_buffered(Cursor::new(bytes))
            .expect("an EXR image");
        let parts = image.layer_data;
        let size = parts[0].size;
        assert!(parts.iter().all(|part| part.size == size));
        let facts = parts[0].attributes.other.iter().find_map(|(name, value)| {
            let AttributeValue::Text(text) = value else {
                return None;
            };
            let is_ours = *name == *"spherule";
            is_ours.then(|| serde_json::from_str(&text.to_string()).expect("JSON"))
        });
        let channels = parts.into_iter().flat_map(|part| part.channel_data.list);
        let planes = channels.map(|channel| {
            let plane = match channel.sample_data {
                FlatSamples::F16(v) => Plane::Float(v.into_iter().map(f32::from).collect()),
                FlatSamples::F32(v) => Plane::Float(v),
                FlatSamples::U32(v) => Plane::Uint(v),
            };
            (channel.name.to_string(), plane)
        });
        Self { width: size.width(), height: size.height(), planes: planes.collect(), facts }
    }

    /// The channel `name`, which must hold floating-point numbers.
    #[track_caller]
    pub(crate) fn floats(&self, name: &str) -> &[f32] {
        match self.planes.get(name) {
            Some(Plane::Float(values)) => values,
            other => panic!("channel {name} is {other:?}"),
        }
    }

    /// The channel `name`, which must hold integers.
    #[track_caller]
    pub(crate) fn integers(&self, name: &str) -> &[u32] {
        match self.planes.get(name) {
            Some(Plane::Uint(values)) => values,
            other => panic!("channel {name} is {other:?}"),
        }
    }
}
