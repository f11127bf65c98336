//! Arrows of vector attributes at the particles of a frame.

use glam::{DVec3, Vec3};
use spherule_formats::Attribute;

use super::SharedFrame;
use super::decoded::ids;
use super::load_error::{LoadError, missing};
use super::rods::FrameRods;
use super::setup::{ArrowStyle, Setup};
use super::styles::StyleRanges;
use crate::surface::rods::{Caps, Rod, arrow};

/// The arrows at the particles of `frame`, which was read from `file` and has this `number`. Passes notes to `notes`.
///
/// # Errors
/// The frame lacks an attribute.
pub(super) fn arrows_of(
    setup: &Setup,
    (frame, ranges): (&SharedFrame<'_>, &StyleRanges),
    (number, file): (i64, &str),
    notes: &mut Vec<String>,
) -> Result<Vec<FrameRods>, LoadError> {
    let mut all = Vec::new();
    for style in &setup.picture.things.arrows {
        if frame.is_empty() {
            continue;
        }
        // Find the vectors
        let found = frame.attribute(&style.attribute);
        let vectors = found.filter(|attribute| attribute.components == 3);
        let Some(vectors) = vectors else {
            let has = frame.attributes.iter().map(|a| a.name.as_str());
            let purpose = "arrows, with three components";
            return Err(missing(&style.attribute, purpose, file, has));
        };
        // Make an arrow for each of the chosen particles
        let arrows = Arrows::new(style, (frame, ranges), vectors);
        if arrows.not_finite > 0 {
            notes.push(format!(
                "frame {number}: {} vectors of `{}` are not finite or too long and have no arrow",
                arrows.not_finite, style.attribute
            ));
        }
        let (rods, owners) = ((arrows.rods, Caps::Flat), arrows.owners.into_iter());
        all.push(style.look.rods((setup, frame), (number, file), rods, owners)?);
    }
    Ok(all)
}

/// The particles of a style of a frame, or of all, whose id is a multiple of `every`; without ids, it is their place in
/// the file.
pub(super) fn every_nth(
    (frame, ranges): (&SharedFrame<'_>, &StyleRanges),
    style: Option<usize>,
    every: u32,
) -> Vec<usize> {
    let all = style.map_or(0..frame.len(), |style| ranges.of(style));
    if every <= 1 {
        return all.collect();
    }
    match ids(frame) {
        Some(ids) => all.filter(|i| ids[*i].is_multiple_of(every)).collect(),
        None => all.step_by(every as usize).collect(),
    }
}

/// The arrows of an attribute.
struct Arrows {
    rods: Vec<Rod>,
    /// The particle of each arrow.
    owners: Vec<usize>,
    /// Number of vectors whose arrow has no finite end.
    not_finite: u64,
}

impl Arrows {
    fn new(
        style: &ArrowStyle,
        (frame, ranges): (&SharedFrame<'_>, &StyleRanges),
        vectors: &Attribute,
    ) -> Self {
        let mut arrows = Self { rods: Vec::new(), owners: Vec::new(), not_finite: 0 };
        for particle in every_nth((frame, ranges), style.style, style.every) {
            let point = frame.positions[particle];
            let vector = scaled(vectors, particle, style.scale);
            if !(vector.length_squared().is_finite() && (point + vector).is_finite()) {
                arrows.not_finite += 1;
                continue;
            }
            let Ok(color) = u32::try_from(arrows.owners.len()) else {
                break;
            };
            if let Some(rods) = arrow(point, vector, (style.look.radius, style.anchor), color) {
                arrows.rods.extend(rods);
                arrows.owners.push(particle);
            }
        }
        arrows
    }
}

/// The vector of a particle, scene units.
fn scaled(vectors: &Attribute, particle: usize, scale: f64) -> Vec3 {
    let component = |c: usize| vectors.data.get_f64(3 * particle + c);
    (scale * DVec3::new(component(0), component(1), component(2))).as_vec3()
}
