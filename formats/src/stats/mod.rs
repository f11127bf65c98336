//! The statistics that `inspect` reports about a frame: counts, bounds, means, and the range of every attribute.
//!
//! All numbers are computed from the values in the file, in f64 or exact integers. Sums are computed over fixed
//! pieces, so that the result does not depend on the number of threads.

use std::fmt;

use glam::DVec3;

use self::gathered::Gathered;
use self::sums::PIECE;
use crate::convert::{ParticleSource, SourceAttribute};
use crate::{Attribute, AttributeData, FrameError, Positions, RawParticles, ScalarType};

mod gathered;
mod sums;

/// Particles of a source that are in memory at a time: whole pieces, so that sums are those of all particles together.
const BLOCK: usize = 16 * PIECE;

/// Statistics of a frame, world units.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameStats {
    /// Number of particles that are drawn: with finite positions, not beyond [`FARTHEST`](crate::FARTHEST).
    pub count: u64,
    /// Number of the others, which have a coordinate that is NaN or beyond it; the other fields ignore them.
    pub dropped: u64,
    /// Smallest and largest radius in the file; `None` if the file has no radii.
    pub radius: Option<(f32, f32)>,
    /// Smallest and largest position; `None` without particles.
    pub bounds: Option<(DVec3, DVec3)>,
    /// Mean position; `None` without particles.
    pub mean: Option<DVec3>,
    /// One entry for each attribute, in the order of the file.
    pub attributes: Vec<AttributeStats>,
}

/// Statistics of an attribute.
#[derive(Debug, Clone, PartialEq)]
pub struct AttributeStats {
    /// The name in the file.
    pub name: String,
    /// Type of the numbers.
    pub scalar_type: ScalarType,
    /// One entry for each component.
    pub components: Vec<ComponentStats>,
}

/// Statistics of one component of an attribute over all particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComponentStats {
    /// Smallest value that is not NaN; `None` if all values are NaN.
    pub min: Option<Number>,
    /// Largest value that is not NaN; `None` if all values are NaN.
    pub max: Option<Number>,
    /// Mean of the values that are not NaN; `None` if all values are NaN.
    pub mean: Option<f64>,
    /// Sum of the values that are not NaN; exact for integers.
    pub sum: Number,
    /// Number of NaN values.
    pub nan: u64,
}

/// A number that stays exact for integers: i128 holds the sum of any array of 64-bit integers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// A number of an integer attribute.
    Int(i128),
    /// A number of a floating-point attribute.
    Float(f64),
}

impl Number {
    /// The number as f64; integers beyond 2^53 are rounded.
    #[expect(clippy::cast_precision_loss, reason = "said in the doc comment")]
    pub const fn as_f64(self) -> f64 {
        match self {
            Self::Int(n) => n as f64,
            Self::Float(x) => x,
        }
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Int(n) => n.fmt(f),
            Self::Float(x) => x.fmt(f),
        }
    }
}

impl FrameStats {
    /// Counts, bounds and means of `raw`.
    pub fn of(raw: &RawParticles) -> Self {
        let shape = |a: &Attribute| (a.name.clone(), a.data.scalar_type(), a.components);
        let mut gathered = Gathered::of(raw.attributes.iter().map(shape));
        gathered.add(&raw.positions, &raw.attributes);
        gathered.finish()
    }

    /// [`Self::of`] of all particles of `source`, which are read in blocks. A radius that the source has apart from its
    /// attributes is not among them.
    ///
    /// # Errors
    /// [`FrameError`] if the source cannot be read.
    pub fn of_source(source: &dyn ParticleSource) -> Result<Self, FrameError> {
        let shape = |a: &SourceAttribute| (a.name.clone(), a.scalar, a.components);
        let mut gathered = Gathered::of(source.attributes().iter().map(shape));
        let mut first = 0;
        while first < source.count() {
            // Read a block of positions
            let len = (source.count() - first).min(BLOCK as u64);
            let len_here = usize::try_from(len).unwrap_or(BLOCK);
            let mut positions = vec![DVec3::ZERO; len_here];
            source.read_positions(first, &mut positions)?;
            // Read the values of its attributes
            let mut attributes = Vec::new();
            for (index, attribute) in source.attributes().iter().enumerate() {
                let mut data =
                    AttributeData::zeros(attribute.scalar, attribute.components * len_here);
                source.read_values(index, first, data.as_bytes_mut())?;
                data.decode_little_endian();
                attributes.push(Attribute {
                    name: attribute.name.clone(),
                    components: attribute.components,
                    data,
                });
            }
            // Add it to the sums
            gathered.add(&Positions::F64(positions), &attributes);
            first += len;
        }
        source.check()?;
        Ok(gathered.finish())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::Vec3;

    use super::*;
    use crate::AttributeData;
    use crate::convert::RawSource;

    fn raw(positions: Positions, attributes: Vec<(&str, usize, AttributeData)>) -> RawParticles {
        let attribute = |(name, components, data): (&str, usize, AttributeData)| Attribute {
            name: name.to_owned(),
            components,
            data,
        };
        RawParticles {
            positions,
            attributes: attributes.into_iter().map(attribute).collect(),
            ..RawParticles::default()
        }
    }

    #[test]
    fn dropped_particles_are_excluded_from_statistics() {
        let positions = vec![
            Vec3::new(1.0, 2.0, 3.0),
            Vec3::new(f32::NAN, 0.0, 0.0),
            Vec3::new(3.0, 4.0, -5.0),
            Vec3::new(0.0, f32::INFINITY, 0.0),
        ];
        let stats = FrameStats::of(&raw(
            Positions::F32(positions),
            vec![
                ("id", 1, AttributeData::I32(vec![-1, 50, 2, 60])),
                ("v", 2, AttributeData::F32(vec![1.0, 2.0, 9.0, 9.0, f32::NAN, 5.0, 9.0, 9.0])),
                ("pscale", 1, AttributeData::F32(vec![0.5, 9.0, 0.25, 9.0])),
            ],
        ));
        assert_eq!((stats.count, stats.dropped), (2, 2));
        assert_eq!(stats.bounds, Some((DVec3::new(1.0, 2.0, -5.0), DVec3::new(3.0, 4.0, 3.0))));
        assert_eq!(stats.mean, Some(DVec3::new(2.0, 3.0, -1.0)));
        assert_eq!(stats.radius, Some((0.25, 0.5)));
        let id = stats.attributes[0].components[0];
        assert_eq!((id.min, id.max), (Some(Number::Int(-1)), Some(Number::Int(2))));
        assert_eq!((id.sum, id.mean, id.nan), (Number::Int(1), Some(0.5), 0));
        let v = &stats.attributes[1].components;
        assert_eq!((v[0].max, v[0].nan, v[0].mean), (Some(Number::Float(1.0)), 1, Some(1.0)));
        assert_eq!((v[1].sum, v[1].nan), (Number::Float(7.0), 0));
    }

    #[test]
    fn particles_that_frames_drop_are_not_counted() {
        let far = [0.0, 2e37, 3e37, -3e37, f32::MAX];
        let single = far.map(|x| Vec3::new(1.0, x, 0.0)).to_vec();
        let double = far.map(|x| DVec3::new(1.0, 0.0, f64::from(x))).to_vec();
        for positions in [Positions::F32(single), Positions::F64(double)] {
            let raw = raw(positions, Vec::new());
            let stats = FrameStats::of(&raw);
            let frame = crate::ParticleFrame::from_raw(raw, DVec3::ZERO);
            assert_eq!((stats.count, stats.dropped), (2, 3));
            assert_eq!((frame.len() as u64, frame.dropped), (2, 3));
        }
    }

    #[test]
    fn empty_frames_have_no_bounds() {
        let ids = vec![("id", 1, AttributeData::U8(vec![])), ("v", 3, AttributeData::F64(vec![]))];
        let stats = FrameStats::of(&raw(Positions::F32(vec![]), ids));
        assert_eq!((stats.count, stats.bounds, stats.mean), (0, None, None));
        assert_eq!(stats.attributes[0].components[0].sum.to_string(), "0");
        assert_eq!(stats.attributes[1].components.len(), 3);
        assert_eq!(stats.attributes[1].components[2].mean, None);
    }

    #[test]
    fn integer_sums_are_exact() {
        let ids = vec![u64::MAX; 3];
        let positions = Positions::F32(vec![Vec3::ZERO; 3]);
        let stats = FrameStats::of(&raw(positions, vec![("id", 1, AttributeData::U64(ids))]));
        let sum = stats.attributes[0].components[0].sum;
        assert_eq!(sum.to_string(), "55340232221128654845");
    }

    #[test]
    fn means_are_accurate_over_many_particles() {
        let point = DVec3::new(1e6 + 0.1, -0.3, 1e-9);
        let stats = FrameStats::of(&raw(Positions::F64(vec![point; 3 * PIECE + 7]), vec![]));
        assert_eq!(stats.mean, Some(point));
        assert_eq!(stats.count, 3 * PIECE as u64 + 7);
    }

    #[test]
    fn blocks_give_what_all_particles_give() {
        let count = BLOCK + 3 * PIECE + 7;
        let number = |i: usize| ((i * 7919) % 100_003) as f32 * 1e-3;
        let mut positions: Vec<Vec3> =
            (0..count).map(|i| Vec3::splat(number(i)).with_y(0.1)).collect();
        positions[5].x = f32::NAN;
        let mut radii: Vec<f32> = (0..count).map(number).collect();
        radii[BLOCK + 1] = 1e4;
        let ids = (0..count as i64).collect();
        let vectors = (0..2 * count).map(|i| f64::from(number(i))).collect();
        let raw = raw(
            Positions::F32(positions),
            vec![
                ("id", 1, AttributeData::I64(ids)),
                ("v", 2, AttributeData::F64(vectors)),
                ("radius", 1, AttributeData::F32(radii)),
            ],
        );
        let source = RawSource::new(Path::new("a"), &raw).expect("whole particles");
        let stats = FrameStats::of_source(&source).expect("in memory");
        assert_eq!(stats, FrameStats::of(&raw));
        assert_eq!((stats.dropped, stats.radius), (1, Some((0.0, 1e4))));
    }

    #[test]
    fn infinite_values_are_numbers() {
        let values = AttributeData::F32(vec![1.0, f32::INFINITY]);
        let positions = Positions::F32(vec![Vec3::ZERO; 2]);
        let stats = FrameStats::of(&raw(positions, vec![("p", 1, values)]));
        let p = stats.attributes[0].components[0];
        assert_eq!(
            (p.max, p.sum),
            (Some(Number::Float(f64::INFINITY)), Number::Float(f64::INFINITY))
        );
    }
}
