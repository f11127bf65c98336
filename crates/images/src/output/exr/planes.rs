//! The planes of a file, and the location of their samples in a film.

use std::borrow::Cow;
use std::iter;

use exr::meta::attribute::SampleType;

use crate::render::Channels;
use crate::render::layers::Layers;

/// Start of the names of the layers of light groups. No other layer begins with it.
const LIGHT_GROUP: &str = "light_";

/// Name of the group of light without a group.
pub const DEFAULT_LIGHT_GROUP: &str = "default";

/// Names of planes that depend on the job.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PlaneNames {
    /// The planes of attribute channels, as many as the film has.
    pub attributes: Vec<String>,
    /// The light groups from number 1 on, as many as the film has. Number 0 is [`DEFAULT_LIGHT_GROUP`].
    pub light_groups: Vec<String>,
}

/// One channel of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::output) struct Plane {
    /// Name in the file.
    pub(in crate::output) name: Cow<'static, str>,
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
    /// A float of the layers, as a colour.
    LayerColor(usize),
    /// A float of the layers that changes from pixel to pixel.
    Layer(usize),
    /// A float of the layers that all pixels of a particle share.
    ParticleLayer(usize),
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
    fn new(name: impl Into<Cow<'static, str>>, source: Source) -> Self {
        let name = name.into();
        Self { name, source }
    }

    /// Statistics of the samples.
    pub(super) const fn kind(&self) -> PlaneKind {
        match self.source {
            Source::Color(_) | Source::LayerColor(_) => PlaneKind::Color,
            Source::Normal(_) | Source::Layer(_) => PlaneKind::Normal,
            Source::Depth | Source::Position(_) => PlaneKind::Position,
            Source::Velocity(_) | Source::Albedo(_) | Source::Id | Source::ParticleLayer(_) => {
                PlaneKind::Particle
            }
        }
    }

    /// Type of the samples. Colours are half-floats, which is sufficient for displays. Data keep all of their bits.
    pub(in crate::output) const fn sample_type(&self) -> SampleType {
        match self.source {
            Source::Color(_) | Source::LayerColor(_) => SampleType::F16,
            Source::Id => SampleType::U32,
            _ => SampleType::F32,
        }
    }
}

/// The planes of a file with `channels`, in the order of the channel names in the manual.
pub(in crate::output) fn planes(channels: Channels, names: &PlaneNames) -> Vec<Plane> {
    let color = vectors(["R", "G", "B", "A"], Source::Color);
    let mut all = color.to_vec();
    all.extend(channels.depth.then(|| Plane::new("Z", Source::Depth)));
    let axes = |is_present: bool, names: [&'static str; 3], source| {
        is_present.then(|| vectors(names, source)).into_iter().flatten()
    };
    let [n, p, v] = [["N.X", "N.Y", "N.Z"], ["P.X", "P.Y", "P.Z"], ["V.X", "V.Y", "V.Z"]];
    let albedo = ["albedo.R", "albedo.G", "albedo.B"];
    all.extend(axes(channels.normal, n, Source::Normal));
    all.extend(axes(channels.position, p, Source::Position));
    all.extend(axes(channels.velocity, v, Source::Velocity));
    all.extend(axes(channels.albedo, albedo, Source::Albedo));
    all.extend(channels.id.then(|| Plane::new("id.I", Source::Id)));
    all.extend(layers(&channels.layers, names));
    all
}

/// Divides the planes of a file between its parts: all in one, or colours and data apart. Without data, there is one
/// part.
pub(in crate::output) fn parts(planes: Vec<Plane>, has_data_part: bool) -> Vec<Vec<Plane>> {
    let is_first = |plane: &Plane| !has_data_part || plane.kind() == PlaneKind::Color;
    let (first, data): (Vec<_>, Vec<_>) = planes.into_iter().partition(is_first);
    let mut all = vec![first, data];
    all.retain(|planes| !planes.is_empty());
    all
}

/// The planes of layers.
fn layers(layers: &Layers, names: &PlaneNames) -> Vec<Plane> {
    let mut all = Vec::new();
    // Colours
    let lights = layers
        .lights
        .iter()
        .map(|class| (class.name(), layers.light_at(class).unwrap_or_default()));
    for (name, at) in lights.chain([("noisy", layers.noisy_at())]) {
        let planes = at.zip(["R", "G", "B"]);
        all.extend(
            planes.map(|(i, axis)| Plane::new(format!("{name}.{axis}"), Source::LayerColor(i))),
        );
    }
    let named = names.light_groups.iter().map(String::as_str);
    let groups = iter::once(DEFAULT_LIGHT_GROUP).chain(named);
    for (group, name) in (0..usize::from(layers.light_groups)).zip(groups) {
        let planes = layers.light_group_at(group).zip(["R", "G", "B"]);
        all.extend(planes.map(|(i, axis)| {
            Plane::new(format!("{LIGHT_GROUP}{name}.{axis}"), Source::LayerColor(i))
        }));
    }
    // Data of surfaces and particles
    all.extend(layers.shadow_at().map(|i| Plane::new("shadow", Source::Layer(i))));
    let motion = layers.motion_at().zip(["motion.U", "motion.V"]);
    all.extend(motion.map(|(i, name)| Plane::new(name, Source::Layer(i))));
    let named = layers.attributes_at().zip(&names.attributes);
    all.extend(named.map(|(i, name)| Plane::new(name.clone(), Source::ParticleLayer(i))));
    // Cryptomatte: two objects with their coverage in each layer of four channels
    for kind in layers.mattes.iter() {
        for (rank, i) in layers.matte_at(kind).unwrap_or_default().enumerate() {
            let axis = ["R", "G", "B", "A"][rank % 4];
            let name = format!("{}{:02}.{axis}", kind.name(), rank / 4);
            let source = match rank % 2 {
                0 => Source::ParticleLayer(i),
                _ => Source::Layer(i),
            };
            all.push(Plane::new(name, source));
        }
    }
    // Overlays come last
    let axes = ["overlay.R", "overlay.G", "overlay.B", "overlay.A"];
    let overlay = layers.overlay_at().zip(axes);
    all.extend(overlay.map(|(i, name)| Plane::new(name, Source::LayerColor(i))));
    all
}

/// The planes of a film's [`layers`](crate::render::Film::layers): their names in a file, and the indices of their
/// floats in a pixel.
pub fn layer_planes(channels: Channels, names: &PlaneNames) -> Vec<(String, usize)> {
    let planes = layers(&channels.layers, names).into_iter();
    let float = |source| match source {
        Source::LayerColor(i) | Source::Layer(i) | Source::ParticleLayer(i) => Some(i),
        _ => None,
    };
    planes.filter_map(|plane| Some((plane.name.into_owned(), float(plane.source)?))).collect()
}

/// The names of the planes of an attribute.
pub fn attribute_planes(name: &str, components: usize) -> Vec<String> {
    match components {
        1 => vec![name.to_owned()],
        2..=4 => (0..components).map(|c| format!("{name}.{}", ["X", "Y", "Z", "W"][c])).collect(),
        _ => (0..components).map(|c| format!("{name}.{c}")).collect(),
    }
}

fn vectors<const N: usize>(names: [&'static str; N], source: fn(usize) -> Source) -> [Plane; N] {
    std::array::from_fn(|component| Plane::new(names[component], source(component)))
}

/// A name that several planes of a file with `channels` have.
pub fn ambiguous_name(channels: Channels, names: &PlaneNames) -> Option<String> {
    let all = planes_in_file(channels, names);
    let mut pairs = all.windows(2);
    let found = pairs.find(|pair| pair[0].name == pair[1].name)?;
    Some(found[0].name.to_string())
}

/// The planes of a file with `channels`, in the order of the file: by name, compared byte by byte.
pub(super) fn planes_in_file(channels: Channels, names: &PlaneNames) -> Vec<Plane> {
    let mut all = planes(channels, names);
    all.sort_unstable_by(|a, b| a.name.cmp(&b.name));
    all
}
