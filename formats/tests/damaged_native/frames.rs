//! Small frames of every encoding, their bytes, and functions to change them.

use std::fs;
use std::ops::Range;

use glam::{DVec3, Vec3};
use spherule_formats::native::{
    self, Bound, Encoding, FrameIndex, RadiusCode, StoreSettings, layout,
};
use spherule_formats::{Attribute, AttributeData, ParticleFrame, Radius};

/// A native file in memory.
pub(crate) struct Stored {
    pub(crate) name: &'static str,
    pub(crate) bytes: Vec<u8>,
    pub(crate) index: FrameIndex,
}

impl Stored {
    fn new(name: &'static str, frame: &ParticleFrame, settings: StoreSettings) -> Self {
        let dir = tempfile::tempdir().expect("a temporary directory");
        let path = dir.path().join("a.spf");
        let index = native::store(&path, frame, Some(7), &settings).expect("writable");
        let bytes = fs::read(path).expect("readable");
        Self { name, bytes, index }
    }

    /// The range of the index in the bytes.
    pub(crate) fn index_range(&self) -> Range<usize> {
        word(&self.bytes, 24)..self.bytes.len()
    }

    /// The name and the start of the section that contains byte `at`; `None` between sections.
    pub(crate) fn section_at(&self, at: usize) -> Option<(String, u64)> {
        let at = at as u64;
        let holds = |s: &layout::Section| s.offset <= at && at < s.offset + s.len;
        let sections = self.index.sections().into_iter();
        let mut found = sections.filter(|(_, section)| holds(section));
        found.next().map(|(what, section)| (what, section.offset))
    }

    /// The same sections with another index; all checksums of header and index are correct.
    pub(crate) fn under(&self, index: &FrameIndex) -> Vec<u8> {
        let index = rkyv::to_bytes::<rkyv::rancor::Error>(index).expect("memory");
        self.under_bytes(&index)
    }

    /// The same sections with any bytes as the index.
    pub(crate) fn under_bytes(&self, index: &[u8]) -> Vec<u8> {
        let start = self.index_range().start;
        let mut bytes = self.bytes[..start].to_vec();
        bytes.extend_from_slice(index);
        let header = layout::header(bytes.len() as u64, start as u64, index, 0);
        bytes[..layout::HEADER_LEN].copy_from_slice(&header);
        bytes
    }
}

fn word(bytes: &[u8], at: usize) -> usize {
    let word = bytes[at..].first_chunk().expect("8 bytes");
    usize::try_from(u64::from_le_bytes(*word)).expect("small")
}

/// Frames in every encoding with all features: wide blocks, radii of each type, attributes, an origin.
pub(crate) fn all() -> Vec<Stored> {
    let coded = |encoding| StoreSettings {
        encoding: Some(encoding),
        bound: Bound::Length(0.02),
        rounding: 0.0,
    };
    let own = |spread: f32| Radius::PerParticle((0..150_u8).map(|i| radius(i, spread)).collect());
    let far = DVec3::new(1e6, -2.0, 0.0);
    let exact = StoreSettings::EXACT;
    let frames = vec![
        Stored::new("f32", &frame(None, DVec3::ZERO), exact),
        Stored::new("f32, radii", &frame(Some(own(1.0)), far), exact),
        Stored::new("q16", &frame(Some(Radius::Common(0.1)), far), coded(Encoding::Q16)),
        Stored::new("q16, radii", &frame(Some(own(100.0)), far), coded(Encoding::Q16)),
        Stored::new("q10", &frame(None, DVec3::ZERO), coded(Encoding::Q10)),
        Stored::new("q10, radii", &frame(Some(own(1.0)), DVec3::ZERO), coded(Encoding::Q10)),
    ];
    check_kinds(&frames);
    frames
}

/// Checks that the frames differ in the intended ways.
fn check_kinds(frames: &[Stored]) {
    let with = |name: &str| {
        let mut found = frames.iter().filter(|f| f.name == name);
        &found.next().expect("a frame of the name").index
    };
    let blocks = layout::blocks_of(150);
    for name in ["q16", "q10", "q10, radii"] {
        let wide = with(name).wide.len / 192;
        assert!(0 < wide && wide < blocks, "{name}: {wide} wide blocks");
    }
    let code = |name: &str| match &with(name).radius {
        layout::RadiusIndex::PerParticle(radii) => RadiusCode::of_code(radii.code),
        _ => None,
    };
    assert_eq!(code("f32, radii"), Some(RadiusCode::F32));
    assert_eq!(code("q16, radii"), Some(RadiusCode::U16));
    assert_eq!(code("q10, radii"), Some(RadiusCode::U8));
}

/// 150 particles in two nodes, the second one not full. A few particles are far away, so that their blocks are wide.
fn frame(radius: Option<Radius>, origin: DVec3) -> ParticleFrame {
    let mut numbers = Numbers(1);
    let mut unit = || numbers.below(1 << 16) as f32 / 65_536.0;
    let positions: Vec<Vec3> = (0..150)
        .map(|i| {
            let inside = Vec3::new(unit(), unit(), unit());
            inside * if i % 50 == 0 { 5e4 } else { 1.0 }
        })
        .collect();
    let attribute =
        |name: &str, components, data| Attribute { name: name.into(), components, data };
    let velocities = positions.iter().flat_map(Vec3::to_array).collect();
    ParticleFrame {
        attributes: vec![
            attribute("velocity", 3, AttributeData::F32(velocities)),
            attribute("id", 1, AttributeData::U64((0..150).collect())),
            attribute("kind", 1, AttributeData::I8(vec![-1; 150])),
        ],
        positions,
        origin,
        radius,
        time: Some(0.25),
        cell: None,
        bonds: Vec::new(),
        shapes: None,
        dropped: 3,
        file_index: None,
    }
}

fn radius(particle: u8, spread: f32) -> f32 {
    0.01 + spread * f32::from(particle) / 150.0
}

/// Pseudo-random numbers that are the same in every run (splitmix64).
pub(crate) struct Numbers(pub(crate) u64);

impl Numbers {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    pub(crate) fn below(&mut self, bound: usize) -> usize {
        usize::try_from(self.next() % bound as u64).expect("below a usize")
    }
}
