//! The planes of a file, and the location of their samples in a film.

use exr::meta::attribute::SampleType;

use crate::render::Channels;

/// One channel of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::output) struct Plane {
    /// Name in the file.
    pub(in crate::output) name: &'static str,
    /// Location of the samples in a film.
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

/// Kinds of planes by the statistics of their samples, for compression.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PlaneKind {
    /// Half-floats that change from pixel to pixel.
    Color,
    /// Floats that change from pixel to pixel, with changing exponents.
    Normal,
    /// Floats that change from pixel to pixel, mostly with the same exponent: depths and positions.
    Position,
    /// Values that all pixels of a particle share.
    Particle,
}

impl Plane {
    const fn new(name: &'static str, source: Source) -> Self {
        Self { name, source }
    }

    /// Statistics of the samples.
    pub(super) const fn kind(&self) -> PlaneKind {
        match self.source {
            Source::Color(_) => PlaneKind::Color,
            Source::Normal(_) => PlaneKind::Normal,
            Source::Depth | Source::Position(_) => PlaneKind::Position,
            Source::Velocity(_) | Source::Albedo(_) | Source::Id => PlaneKind::Particle,
        }
    }

    /// Type of the samples. Colours are half-floats, which is sufficient for displays. Data keep all of their bits.
    pub(in crate::output) const fn sample_type(&self) -> SampleType {
        match self.source {
            Source::Color(_) => SampleType::F16,
            Source::Id => SampleType::U32,
            _ => SampleType::F32,
        }
    }
}

/// The planes of a file with `channels`, in the order of the channel names in the manual.
pub(in crate::output) fn planes(channels: Channels) -> Vec<Plane> {
    let color = vectors(["R", "G", "B", "A"], Source::Color);
    let mut all = color.to_vec();
    all.extend(channels.depth.then(|| Plane::new("Z", Source::Depth)));
    let axes = |is_present: bool, names: [&'static str; 3], source| {
        is_present
            .then(|| vectors(names, source))
            .into_iter()
            .flatten()
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

/// The planes of a file with `channels`, in the order of the file: by name, compared byte by byte.
pub(super) fn planes_in_file(channels: Channels) -> Vec<Plane> {
    let mut all = planes(channels);
    all.sort_unstable_by_key(|plane| plane.name);
    all
}
