//! The values of one particle, and those of all particles of a frame.

use glam::DVec3;
use serde::Serialize;
use spherule_formats::RawParticles;
use spherule_frame::values::{Column, Context, Named, Value, id_of, value_names};

use super::error::ExploreError;
use super::explorer::Explorer;
use super::stage::Stage;
use crate::pipeline::attribute_list;

/// Bars of a histogram.
const BARS: usize = 64;

/// A particle with all its values.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParticleValues {
    /// Its id, or its index if the file has none.
    pub id: i64,
    /// Its place in the frame.
    pub index: usize,
    /// Its position in the file.
    pub position: [f64; 3],
    /// Names of its attributes, with their components; null for those that are not finite.
    pub attributes: Vec<(String, Vec<Option<f64>>)>,
    /// Names behind its numbers, such as that of its part.
    pub names: Vec<(String, String)>,
}

/// How often values occur among the particles of a frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Histogram {
    /// The smallest and the largest value.
    pub range: [f64; 2],
    /// Number of particles in parts of the range with the same length.
    pub counts: Vec<u64>,
    /// Number of particles without a finite value.
    pub missing: u64,
}

impl Explorer {
    /// The values of the particle with this id in `frame`. The frame is read again for the first one.
    ///
    /// # Errors
    /// The frame cannot be read.
    pub fn particle(
        &self,
        frame: i64,
        id: u32,
    ) -> Option<Result<Option<ParticleValues>, ExploreError>> {
        self.ask(move |stage| Ok(values_of(stage.particles(frame)?, id)))
    }

    /// How often the values called `name` occur in `frame`; None if the thread that renders has ended.
    ///
    /// # Errors
    /// The frame cannot be read, or has no such values.
    pub fn histogram(&self, frame: i64, name: String) -> Option<Result<Histogram, ExploreError>> {
        self.ask(move |stage| histogram(stage, frame, &name))
    }

    /// Names of all values of the particles in `frame`.
    ///
    /// # Errors
    /// The frame cannot be read.
    pub fn names(&self, frame: i64) -> Option<Result<Vec<String>, ExploreError>> {
        self.ask(move |stage| match stage.particles(frame) {
            Ok(particles) => Ok(value_names(&particles.attributes, |_| true)),
            // Without their components
            Err(ExploreError::TooLarge { .. }) => {
                Ok(stage.prepared().map(|own| own.survey.attributes.clone()).unwrap_or_default())
            }
            Err(error) => Err(error),
        })
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "ids in pictures are the lower 32 bits of those in files"
)]
fn values_of(particles: &RawParticles, id: u32) -> Option<ParticleValues> {
    let RawParticles { attributes, positions, labels, .. } = particles;
    // Find it as pictures name it: by its id, or by its place
    let ids = id_of(attributes);
    let index = match ids {
        Some(ids) => (0..positions.len()).find(|&i| ids.get(i, 0) as i64 as u32 == id)?,
        None => Some(id as usize).filter(|index| *index < positions.len())?,
    };
    // Collect what the files say
    let finite = |value: f64| value.is_finite().then_some(value);
    let values = attributes.iter().map(|column| {
        let components = (0..column.components()).map(|c| finite(column.get(index, c)));
        (column.name().to_owned(), components.collect())
    });
    let names = attributes.iter().filter_map(|column| {
        let name = labels.get(column.name())?.get(&(column.get(index, 0) as i64))?;
        Some((column.name().to_owned(), name.clone()))
    });
    Some(ParticleValues {
        id: ids.map_or(index as i64, |ids| ids.get(index, 0) as i64),
        index,
        position: positions.get(index).to_array(),
        attributes: values.collect(),
        names: names.collect(),
    })
}

/// What values of a frame need beside its columns.
struct FrameContext<'a> {
    particles: &'a RawParticles,
    up: DVec3,
}

impl Context for FrameContext<'_> {
    fn position(&self, particle: usize) -> DVec3 {
        self.particles.positions.get(particle)
    }

    fn radius(&self, particle: usize) -> f64 {
        let radii = self.particles.attributes.iter().find(|column| column.name() == "radius");
        radii.map_or(f64::NAN, |radii| radii.get(particle, 0))
    }

    fn up(&self) -> DVec3 {
        self.up
    }

    fn time(&self) -> f64 {
        self.particles.time.unwrap_or(f64::NAN)
    }
}

fn histogram(stage: &mut Stage, frame: i64, name: &str) -> Result<Histogram, ExploreError> {
    let up = stage.prepared().map_or(DVec3::Z, |prepared| prepared.setup.picture.view.up);
    let particles = stage.particles(frame)?;
    let columns = &particles.attributes;
    let value = Value::named(name, columns)
        .and_then(|value| value.bind(|name| columns.iter().find(|c| c.name() == name)));
    let Some(value) = value else {
        let message = format!(
            "{name}: is not among the values: {}",
            attribute_list(columns.iter().map(Named::name))
        );
        let key = Some("material.color".to_owned());
        return Err(super::error::Fault { message, key }.into());
    };
    let context = FrameContext { particles, up };
    let values: Vec<f64> = (0..particles.positions.len()).map(|i| value.get(i, &context)).collect();
    Ok(Histogram::of(&values))
}

impl Histogram {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        clippy::cast_sign_loss,
        reason = "numbers of bars"
    )]
    fn of(values: &[f64]) -> Self {
        let finite = || values.iter().copied().filter(|value| value.is_finite());
        let low = finite().fold(f64::INFINITY, f64::min);
        let high = finite().fold(f64::NEG_INFINITY, f64::max);
        let mut counts = vec![0; BARS];
        let count = finite().count() as u64;
        for value in finite() {
            let part = if high > low { (value - low) / (high - low) } else { 0.0 };
            counts[((part * BARS as f64) as usize).min(BARS - 1)] += 1;
        }
        let range = if count > 0 { [low, high] } else { [0.0, 0.0] };
        Self { range, counts, missing: values.len() as u64 - count }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn histograms_count_all_values() {
        let values = [0.0, 1.0, 1.0, 64.0, f64::NAN, f64::INFINITY];
        let Histogram { range, counts, missing } = Histogram::of(&values);
        assert_eq!((range, missing), ([0.0, 64.0], 2));
        assert_eq!((counts[0], counts[1], counts[63]), (1, 2, 1));
        assert_eq!(Histogram::of(&[]).range, [0.0, 0.0]);
        assert_eq!(Histogram::of(&[2.0, 2.0]).counts[0], 2);
    }
}
