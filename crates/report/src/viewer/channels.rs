//! Small pictures of the channels of an image.

use colorous::VIRIDIS;

use spherule_images::output::view::byte_from_linear;
use spherule_images::output::{PlaneNames, attribute_planes, plane_channels};
use spherule_images::picture::{Picture, SampledPlanes};
use spherule_tracer::render::{Channels, FilmPlane, NO_ID};

/// The planes that pages show.
pub(super) const SHOWN: [FilmPlane; 5] =
    [FilmPlane::Id, FilmPlane::Depth, FilmPlane::Normal, FilmPlane::Velocity, FilmPlane::Albedo];

/// A channel that can be shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ChannelKind {
    /// `Z`: near is bright.
    Depth,
    /// `N`: components from -1 to 1 as red, green and blue.
    Normal,
    /// `albedo`: as sRGB.
    Albedo,
    /// The length of `V`, by viridis.
    Speed,
    /// An attribute or its length, by viridis.
    Attribute(String),
}

/// Smallest and largest values of channels, the same for all frames.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct ChannelRanges(Vec<(ChannelKind, [f32; 2])>);

/// Planes of the components of a vector.
pub(super) type Axes<'a> = [&'a [f32]; 3];

/// The names of the channels of `plane` in a file.
fn names_of(plane: FilmPlane) -> Vec<String> {
    plane_channels(plane, Channels::COLOR, &PlaneNames::default())
}

/// The vectors of `plane`.
pub(super) fn vectors(planes: &SampledPlanes, plane: FilmPlane) -> Option<Axes<'_>> {
    vectors_of(planes, &names_of(plane))
}

/// The vectors of the attribute `name`.
pub(super) fn attribute_vectors<'a>(planes: &'a SampledPlanes, name: &str) -> Option<Axes<'a>> {
    vectors_of(planes, &attribute_planes(name, 3))
}

fn vectors_of<'a>(planes: &'a SampledPlanes, names: &[String]) -> Option<Axes<'a>> {
    let axes: Option<Vec<_>> = names.iter().map(|name| planes.floats(name)).collect();
    axes?.try_into().ok()
}

/// The ids of particles.
pub(super) fn ids(planes: &SampledPlanes) -> Option<&[u32]> {
    planes.integers(names_of(FilmPlane::Id).first()?)
}

/// The distances along the view axis.
pub(super) fn depths(planes: &SampledPlanes) -> Option<&[f32]> {
    planes.floats(FilmPlane::Depth.name())
}

/// The length of the vector at sample `i`.
pub(super) fn length(axes: &Axes<'_>, i: usize) -> f32 {
    axes.iter().map(|axis| axis[i] * axis[i]).sum::<f32>().sqrt()
}

impl ChannelKind {
    /// Its name on the page.
    pub fn name(&self) -> &str {
        match self {
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::Albedo => "albedo",
            Self::Speed => "speed",
            Self::Attribute(name) => name,
        }
    }

    /// The channels that `planes` have.
    pub(super) fn in_planes(planes: &SampledPlanes, attributes: &[String]) -> Vec<Self> {
        let mut all = vec![Self::Depth, Self::Normal, Self::Albedo, Self::Speed];
        all.extend(attributes.iter().cloned().map(Self::Attribute));
        all.retain(|kind| match kind {
            Self::Normal | Self::Albedo => kind.axes(planes).is_some(),
            _ => kind.values(planes).is_some(),
        });
        all
    }

    fn axes<'a>(&self, planes: &'a SampledPlanes) -> Option<Axes<'a>> {
        match self {
            Self::Normal => vectors(planes, FilmPlane::Normal),
            Self::Albedo => vectors(planes, FilmPlane::Albedo),
            _ => None,
        }
    }

    /// One value for each sample; NaN where there is none.
    fn values(&self, planes: &SampledPlanes) -> Option<Vec<f32>> {
        let count = planes.size[0] * planes.size[1];
        let ids = ids(planes);
        let is_empty = |i: usize| ids.is_some_and(|ids| ids[i] == NO_ID);
        let known = |value: f32, i: usize| if is_empty(i) { f32::NAN } else { value };
        let lengths = |axes: Axes<'_>| (0..count).map(|i| known(length(&axes, i), i)).collect();
        match self {
            Self::Depth => depths(planes).map(<[f32]>::to_vec),
            Self::Speed => vectors(planes, FilmPlane::Velocity).map(lengths),
            Self::Attribute(name) => match planes.floats(name) {
                Some(samples) => Some(samples.iter().zip(0..).map(|(v, i)| known(*v, i)).collect()),
                None => attribute_vectors(planes, name).map(lengths),
            },
            Self::Normal | Self::Albedo => None,
        }
    }
}

impl ChannelRanges {
    /// The ranges in some frames.
    pub(super) fn of(frames: &[SampledPlanes], channels: &[ChannelKind]) -> Self {
        let range = |kind: &ChannelKind| {
            let values = frames.iter().filter_map(|planes| kind.values(planes)).flatten();
            let finite = values.filter(|value| value.is_finite());
            let [low, high] = finite.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], v| {
                [low.min(v), high.max(v)]
            });
            if low <= high { [low, high] } else { [0.0, 1.0] }
        };
        Self(channels.iter().map(|kind| (kind.clone(), range(kind))).collect())
    }

    /// Where `value` is in the range, from 0 to 1.
    fn part(&self, kind: &ChannelKind, value: f32) -> f32 {
        let range = self.0.iter().find(|(other, _)| other == kind);
        let [low, high] = range.map_or([0.0, 1.0], |(_, range)| *range);
        if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 }
    }
}

/// The picture of a channel; None if the image has no such channel. Black where there is nothing.
pub(super) fn channel_picture(
    planes: &SampledPlanes,
    kind: &ChannelKind,
    ranges: &ChannelRanges,
) -> Option<Picture> {
    let [width, height] = planes.size;
    // Map the numbers to colours; each kind of channel has a mapping of its own
    let rgb: Vec<u8> = match kind {
        ChannelKind::Normal => {
            let axes = kind.axes(planes)?;
            let byte = |v: f32, is_empty: bool| {
                if is_empty { 0 } else { unit_byte(0.5 + 0.5 * v) }
            };
            let color = |i: usize| {
                let normal = axes.map(|axis| axis[i]);
                let is_empty = normal.iter().all(|v| *v == 0.0);
                normal.map(|v| byte(v, is_empty))
            };
            (0..width * height).flat_map(color).collect()
        }
        ChannelKind::Albedo => {
            let axes = kind.axes(planes)?;
            let color = |i: usize| axes.map(|axis| byte_from_linear(axis[i], 0.5));
            (0..width * height).flat_map(color).collect()
        }
        ChannelKind::Depth => {
            let values = kind.values(planes)?;
            let gray = |v: &f32| {
                if v.is_finite() {
                    [unit_byte(1.0 - 0.85 * ranges.part(kind, *v)); 3]
                } else {
                    [0; 3]
                }
            };
            values.iter().flat_map(gray).collect()
        }
        ChannelKind::Speed | ChannelKind::Attribute(_) => {
            let values = kind.values(planes)?;
            let color = |v: &f32| {
                if v.is_finite() {
                    VIRIDIS.eval_continuous(f64::from(ranges.part(kind, *v))).as_array()
                } else {
                    [0; 3]
                }
            };
            values.iter().flat_map(color).collect()
        }
    };
    Some(Picture::new(width, height, rgb))
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a value from 0 to 255; NaN becomes 0"
)]
fn unit_byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}
