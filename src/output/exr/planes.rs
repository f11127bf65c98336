//! Which planes a file has, and where in a film their samples are.

use exr::meta::attribute::SampleType;

use crate::render::Channels;

/// One channel of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::output) struct Plane {
    /// Its name in the file.
    pub(in crate::output) name: &'static str,
    /// Where its samples come from.
    pub(super) source: Source,
}

/// A plane of a film, or one component of a plane of colours or vectors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Source {
    Color(usize),
    Depth,
    Normal(usize),
    Position(usize),
    Velocity(usize),
    Albedo(usize),
    Id,
}

/// Planes whose samples look alike to a compressor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PlaneKind {
    /// Halves that change from pixel to pixel.
    Color,
    /// Floats that do, and their exponents with them.
    Normal,
    /// Floats whose exponents stay the same: where the place is that a pixel shows.
    Place,
    /// What all pixels of a particle share.
    Particle,
}

impl Plane {
    const fn new(name: &'static str, source: Source) -> Self {
        Self { name, source }
    }

    /// What its samples are like.
    pub(super) const fn kind(&self) -> PlaneKind {
        match self.source {
            Source::Color(_) => PlaneKind::Color,
            Source::Normal(_) => PlaneKind::Normal,
            Source::Depth | Source::Position(_) => PlaneKind::Place,
            Source::Velocity(_) | Source::Albedo(_) | Source::Id => PlaneKind::Particle,
        }
    }

    /// Colours are half: a display has no use for more. Data keep all of their bits.
    pub(in crate::output) const fn sample_type(&self) -> SampleType {
        match self.source {
            Source::Color(_) => SampleType::F16,
            Source::Id => SampleType::U32,
            _ => SampleType::F32,
        }
    }
}

/// The planes of a file with `channels`, in the order that a user would list them.
pub(in crate::output) fn planes(channels: Channels) -> Vec<Plane> {
    let color = vectors(["R", "G", "B", "A"], Source::Color);
    let mut all = color.to_vec();
    all.extend(channels.depth.then(|| Plane::new("Z", Source::Depth)));
    let axes = |has: bool, names: [&'static str; 3], source| {
        has.then(|| vectors(names, source)).into_iter().flatten()
    };
    let [n, p, v] = [
        ["N.X", "N.Y", "N.Z"],
        ["P.X", "P.Y", "P.Z"],
        ["V.X", "V.Y", "V.Z"],
    ];
    let albedo = ["albedo.R", "albedo.G", "albedo.B"];
    all.extend(axes(channels.normal, n, Source::Normal));
    all.extend(axes(channels.position, p, Source::Position));
    all.extend(axes(channels.velocity, v, Source::Velocity));
    all.extend(axes(channels.albedo, albedo, Source::Albedo));
    all.extend(channels.id.then(|| Plane::new("id.I", Source::Id)));
    all
}

fn vectors<const N: usize>(names: [&'static str; N], source: fn(usize) -> Source) -> [Plane; N] {
    std::array::from_fn(|component| Plane::new(names[component], source(component)))
}

/// The same in the order of the file: by name, byte by byte.
pub(super) fn planes_in_file(channels: Channels) -> Vec<Plane> {
    let mut all = planes(channels);
    all.sort_unstable_by_key(|plane| plane.name);
    all
}
