//! The channels of a file, and the location of their samples in a film.

use std::iter;

use exr::meta::attribute::SampleType;

use crate::render::planes::{Components, PlaneKind};
use crate::render::{Channels, FilmPlane};

/// Start of the names of the layers of light groups. No other layer begins with it.
const LIGHT_GROUP: &str = "light_";

/// Name of the group of light without a group.
pub const DEFAULT_LIGHT_GROUP: &str = "default";

const RGBA: [&str; 4] = ["R", "G", "B", "A"];

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
pub(in crate::output) struct ExrChannel {
    /// Name in the file.
    pub(in crate::output) name: String,
    /// Location of the samples in a film.
    pub(super) source: Source,
}

/// A component of the colours or of a plane of a film.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Source {
    Color(usize),
    Plane(FilmPlane, usize),
}

/// Kinds of channels by the statistics of their samples, for compression.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SampleKind {
    /// Half-floats that change from pixel to pixel.
    Color,
    /// Floats that change from pixel to pixel, with changing exponents.
    Surface,
    /// Floats that change from pixel to pixel, mostly with the same exponent: depths and positions.
    Position,
    /// Values that all pixels of a particle share.
    Particle,
}

impl ExrChannel {
    /// Statistics of the samples.
    pub(super) const fn kind(&self) -> SampleKind {
        let Source::Plane(plane, component) = self.source else {
            return SampleKind::Color;
        };
        match plane.kind() {
            PlaneKind::Light => SampleKind::Color,
            PlaneKind::Distance | PlaneKind::Position => SampleKind::Position,
            PlaneKind::Surface => SampleKind::Surface,
            PlaneKind::Particle | PlaneKind::Id => SampleKind::Particle,
            PlaneKind::Matte if component.is_multiple_of(2) => SampleKind::Particle,
            PlaneKind::Matte => SampleKind::Surface,
        }
    }

    /// Type of the samples. Colours are half-floats, which is sufficient for displays. Data keep all of their bits.
    pub(in crate::output) const fn sample_type(&self) -> SampleType {
        match self.source {
            Source::Color(_) => SampleType::F16,
            Source::Plane(plane, _) => match plane.kind() {
                PlaneKind::Light => SampleType::F16,
                PlaneKind::Id => SampleType::U32,
                _ => SampleType::F32,
            },
        }
    }
}

/// The channels of a file, plane by plane.
pub(in crate::output) fn exr_channels(channels: Channels, names: &PlaneNames) -> Vec<ExrChannel> {
    let color = |(component, axis): (usize, &str)| ExrChannel {
        name: axis.to_owned(),
        source: Source::Color(component),
    };
    let planes = FilmPlane::all().filter(|plane| channels.has(*plane)).flat_map(|plane| {
        let names = plane_channels(plane, channels, names).into_iter().enumerate();
        names.map(move |(i, name)| ExrChannel { name, source: Source::Plane(plane, i) })
    });
    RGBA.into_iter().enumerate().map(color).chain(planes).collect()
}

/// Divides the channels of a file between its parts: all in one, or colours and data apart. Without data, there is one
/// part.
pub(in crate::output) fn parts(
    channels: Vec<ExrChannel>,
    has_data_part: bool,
) -> Vec<Vec<ExrChannel>> {
    let is_first = |channel: &ExrChannel| !has_data_part || channel.kind() == SampleKind::Color;
    let (first, data): (Vec<_>, Vec<_>) = channels.into_iter().partition(is_first);
    let mut all = vec![first, data];
    all.retain(|channels| !channels.is_empty());
    all
}

/// The names of the channels of a file for the components of `plane`.
pub fn plane_channels(plane: FilmPlane, channels: Channels, names: &PlaneNames) -> Vec<String> {
    let name = plane.name();
    match plane.components() {
        Components::One => vec![name.to_owned()],
        Components::Named(axes) => axes.iter().map(|axis| format!("{name}.{axis}")).collect(),
        Components::LightGroups => {
            let named = names.light_groups.iter().map(String::as_str);
            let groups = iter::once(DEFAULT_LIGHT_GROUP).chain(named);
            let groups = groups.take(channels.layers.light_groups.into());
            let axes =
                |group| RGBA[..3].iter().map(move |axis| format!("{LIGHT_GROUP}{group}.{axis}"));
            groups.flat_map(axes).collect()
        }
        Components::Attributes => {
            names.attributes.iter().take(channels.components(plane)).cloned().collect()
        }
        // Two objects with their coverage are in each layer of four channels
        Components::Levels => (0..channels.components(plane))
            .map(|rank| format!("{name}{:02}.{}", rank / 4, RGBA[rank % 4]))
            .collect(),
    }
}

/// The names of the planes of an attribute.
pub fn attribute_planes(name: &str, components: usize) -> Vec<String> {
    match components {
        1 => vec![name.to_owned()],
        2..=4 => (0..components).map(|c| format!("{name}.{}", ["X", "Y", "Z", "W"][c])).collect(),
        _ => (0..components).map(|c| format!("{name}.{c}")).collect(),
    }
}

/// A name that several channels of a file with `channels` have.
pub fn ambiguous_name(channels: Channels, names: &PlaneNames) -> Option<String> {
    let all = channels_in_file(channels, names);
    let mut pairs = all.windows(2);
    let found = pairs.find(|pair| pair[0].name == pair[1].name)?;
    Some(found[0].name.clone())
}

/// The channels of a file in its order: by name, compared byte by byte.
pub(super) fn channels_in_file(channels: Channels, names: &PlaneNames) -> Vec<ExrChannel> {
    let mut all = exr_channels(channels, names);
    all.sort_unstable_by(|a, b| a.name.cmp(&b.name));
    all
}
