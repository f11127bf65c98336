//! The channels of the images, with the attributes among them.

use crate::math::narrow;
use spherule_formats::names;

use super::{ResolveError, require_attribute};
use crate::manifest::{Channel, Manifest, Output};
use crate::output::{PlaneNames, attribute_planes as planes_of};
use crate::pipeline::{AttributeChannel, FrameStep, attribute_list};
use crate::render::layers::{MAX_ATTRIBUTE_FLOATS, MAX_LIGHT_GROUPS};
use crate::render::{Channels, FilmPlane};
use crate::survey::Survey;

const KEY: &str = "output.channels";

/// The longest name of an attribute with a channel, bytes.
const MAX_NAME: usize = 200;

/// The channels of the images, and the attributes with channels.
///
/// # Errors
/// An attribute does not exist or cannot be a channel, or there are too many light groups.
pub(super) fn channels(
    manifest: &Manifest,
    survey: &Survey,
) -> Result<(Channels, Vec<AttributeChannel>), ResolveError> {
    let output = &manifest.output;
    if output.path.is_png() {
        return Ok((Channels::COLOR, Vec::new()));
    }
    let unsupported = |what: String| ResolveError::Unsupported { key: KEY, what };
    // Find the channels with fixed names, and the light groups
    let mut channels = Channels::of(output.channels.iter().filter_map(Channel::named));
    channels.layers.set_matte_levels(output.cryptomatte_levels);
    let light_groups = manifest.light_groups();
    channels.layers.set_light_groups(light_groups.len());
    if channels.layers.light_groups > 0 && light_groups.len() >= MAX_LIGHT_GROUPS {
        return Err(unsupported(format!(
            "light_groups: the lights have {} groups, but at most {} are possible; use fewer names",
            light_groups.len(),
            MAX_LIGHT_GROUPS - 1
        )));
    }
    // Find the attributes
    let attributes = output.channels.iter().filter_map(Channel::attribute);
    let attributes: Vec<_> =
        attributes.map(|name| attribute(name, survey)).collect::<Result<_, _>>()?;
    let names = attribute_planes(&attributes);
    if names.len() > MAX_ATTRIBUTE_FLOATS {
        return Err(unsupported(format!(
            "the attributes have more than {MAX_ATTRIBUTE_FLOATS} components in total; leave some of them out"
        )));
    }
    channels.layers.attributes = u8::try_from(names.len()).unwrap_or(u8::MAX);
    // Check that the channels have different names in the file
    let names = PlaneNames {
        attributes: names,
        light_groups: light_groups.into_iter().map(str::to_owned).collect(),
    };
    if let Some(name) = crate::output::ambiguous_name(channels, &names) {
        return Err(unsupported(format!(
            "two channels of the file would be called {name}; leave one of them out"
        )));
    }
    Ok((channels, attributes))
}

/// The attribute `name` of the frames.
fn attribute(name: &str, survey: &Survey) -> Result<AttributeChannel, ResolveError> {
    require_attribute(survey, KEY, name)?;
    let unsupported = |what: &str| ResolveError::Unsupported {
        key: KEY,
        what: format!("attribute `{name}`: {what}"),
    };
    if name.len() > MAX_NAME || !name.bytes().all(|b| b.is_ascii_graphic() || b == b' ') {
        return Err(unsupported(
            "channels of OpenEXR files need short names in ASCII; rename the attribute",
        ));
    }
    let index = survey.attributes.iter().position(|a| a.eq_ignore_ascii_case(name));
    let components = index.and_then(|index| survey.components.get(index)).copied().unwrap_or(1);
    Ok(AttributeChannel {
        name: name.to_owned(),
        components: components.clamp(1, MAX_ATTRIBUTE_FLOATS + 1),
    })
}

/// The step to the next frame, if there is a channel for motion.
///
/// # Errors
/// There are no velocities, or the time between frames is unknown.
pub(super) fn frame_step(
    channels: &Channels,
    output: &Output,
    survey: &Survey,
) -> Result<Option<FrameStep>, ResolveError> {
    let planes = [FilmPlane::Motion, FilmPlane::MotionBack];
    let Some(plane) = planes.into_iter().find(|plane| channels.has(*plane)) else {
        return Ok(None);
    };
    let name = plane.name();
    let unsupported = |what: String| ResolveError::Unsupported { key: KEY, what };
    if survey.most_particles > 0 && !has_velocities(survey) {
        return Err(unsupported(format!(
            "{name} needs velocities, and the sampled frames have none; available: {}",
            attribute_list(survey.attributes.iter().map(String::as_str))
        )));
    }
    let step = step_to_next(output, survey)
        .ok_or_else(|| unsupported(format!("{name} needs {UNKNOWN_STEP}")))?;
    Ok(Some(step))
}

/// What is needed if the step to the next frame is unknown.
pub(super) const UNKNOWN_STEP: &str =
    "the time between frames, which the files do not contain; set output.frame_time";

/// The step to the next frame, if the time until then is known.
pub(super) fn step_to_next(output: &Output, survey: &Survey) -> Option<FrameStep> {
    let time = output.frame_time.or(survey.frame_time).or_else(|| output.fps.map(f64::recip))?;
    Some(FrameStep { time: narrow(time), numbers: survey.frame_numbers.unwrap_or(1) })
}

/// Whether the frames have velocities.
pub(super) fn has_velocities(survey: &Survey) -> bool {
    let mut attributes = survey.attributes.iter().zip(&survey.components);
    attributes.any(|(name, components)| {
        let is_name = |known: &&str| name.eq_ignore_ascii_case(known);
        *components == 3 && names::VELOCITY.iter().any(is_name)
    })
}

/// The names of the planes of `attributes` in a file.
pub(super) fn attribute_planes(attributes: &[AttributeChannel]) -> Vec<String> {
    let planes = attributes.iter().map(|a| planes_of(&a.name, a.components));
    planes.flatten().collect()
}
