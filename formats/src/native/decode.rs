//! Decodes native frames to plain particles, for uses other than tracing in place.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::layout::RadiusIndex;
use super::view::NativeFrame;
use crate::blocks::{BLOCK_SIZE, StoredLeaves};
use crate::names::RADIUS;
use crate::{Attribute, AttributeData, ParseError, Positions, RawParticles, sample_indices};

impl NativeFrame<'_> {
    /// All particles in the order of the file, in world coordinates: f32 if the origin is zero, else f64.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if a section does not match the index, [`ParseError::Unsupported`] as
    /// [`Self::leaves`].
    pub fn to_raw(&self) -> Result<RawParticles, ParseError> {
        let leaves = self.leaves()?;
        let mut attributes = Vec::with_capacity(self.index().attributes.len());
        for attribute in self.attributes() {
            attributes.push(attribute.to_attribute()?);
        }
        attributes.extend(self.radius_attribute(&attributes, &leaves)?);
        Ok(RawParticles {
            positions: self.positions(&leaves)?,
            attributes,
            time: self.index().time,
            step: self.index().step,
            labels: self.index().details.labels.clone(),
            cell: self.index().details.cell,
            ..RawParticles::default()
        })
    }

    /// An evenly spaced sample of whole blocks, at most `most` particles, in world coordinates and with
    /// attributes and radii. It gives percentiles without reading all of a large frame.
    ///
    /// # Errors
    /// As [`Self::to_raw`].
    pub fn sample(&self, most: usize) -> Result<RawParticles, ParseError> {
        let leaves = self.leaves()?;
        let count = self.len()?;
        // Choose whole blocks
        let blocks = count.div_ceil(BLOCK_SIZE);
        let chosen: Vec<usize> = sample_indices(blocks, (most / BLOCK_SIZE).max(1))
            .flat_map(|block| block * BLOCK_SIZE..count.min((block + 1) * BLOCK_SIZE))
            .collect();
        Ok(self.chosen(&chosen, &leaves))
    }

    /// The particles whose index is a multiple of `every`, in world coordinates and with attributes and radii.
    ///
    /// # Errors
    /// As [`Self::to_raw`].
    ///
    /// # Panics
    /// `every` is 0.
    pub fn every(&self, every: usize) -> Result<RawParticles, ParseError> {
        let chosen: Vec<usize> = (0..self.len()?).step_by(every).collect();
        Ok(self.chosen(&chosen, &self.leaves()?))
    }

    /// The particles with these indices.
    fn chosen(&self, chosen: &[usize], leaves: &StoredLeaves<'_>) -> RawParticles {
        let origin = DVec3::from_array(self.index().origin);
        let position = |i: &usize| leaves.center(*i).as_dvec3() + origin;
        // Copy their attributes
        let mut attributes: Vec<Attribute> = Vec::new();
        for view in self.attributes() {
            let components = view.components();
            let of = |i: usize| (0..components).map(move |c| (i, c));
            let values = chosen.iter().copied().flat_map(of);
            attributes.push(Attribute {
                name: view.name().to_owned(),
                components: view.components(),
                data: AttributeData::F64(values.map(|(i, c)| view.get(i, c)).collect()),
            });
        }
        // Add the radii
        if wants_radius(&attributes)
            && let Some(radius) = self.radius_of(leaves)
        {
            attributes.push(radii(chosen.iter().map(|i| radius(*i)).collect()));
        }
        RawParticles {
            positions: Positions::F64(chosen.iter().map(position).collect()),
            attributes,
            time: self.index().time,
            step: self.index().step,
            labels: self.index().details.labels.clone(),
            cell: self.index().details.cell,
            ..RawParticles::default()
        }
    }

    /// Distances from `queries` evenly spread particles to their nearest particle at another position, among
    /// the particles around them in the file. In tree order, the nearest neighbour is seldom outside of this
    /// window, so that few of the distances are too long.
    ///
    /// # Errors
    /// As [`Self::to_raw`].
    pub fn neighbour_distances(&self, queries: usize) -> Result<Vec<f32>, ParseError> {
        let nearest = |squares: &mut dyn Iterator<Item = f32>| {
            let nearest = squares.filter(|d| *d > 0.0).fold(f32::INFINITY, f32::min);
            nearest.is_finite().then(|| nearest.sqrt())
        };
        let distances = self.around_some(queries, nearest)?;
        Ok(distances.into_iter().flatten().collect())
    }

    /// The number of particles within `reach` of `queries` particles, themselves included, among the particles
    /// around them in the file. The count is too low for some particles at the edge of a cell of the order and
    /// exact for the others.
    ///
    /// # Errors
    /// As [`Self::to_raw`].
    pub fn neighbour_counts(&self, queries: usize, reach: f32) -> Result<Vec<u32>, ParseError> {
        let count = |squares: &mut dyn Iterator<Item = f32>| {
            let near = squares.filter(|d| *d <= reach * reach);
            near.map(|_| 1_u32).sum()
        };
        self.around_some(queries, count)
    }

    /// The results of `reduce` for the squared distances from some particles to the particles around them in the file.
    fn around_some<T: Send>(
        &self,
        queries: usize,
        reduce: impl Fn(&mut dyn Iterator<Item = f32>) -> T + Sync,
    ) -> Result<Vec<T>, ParseError> {
        /// Particles on either side of the given one: one cell of the order and half of the next.
        const AROUND: usize = 1536;
        let leaves = self.leaves()?;
        let count = self.len()?;
        let of = |i: usize| {
            let from = leaves.center(i);
            let blocks =
                i.saturating_sub(AROUND) / BLOCK_SIZE..(i + AROUND).min(count).div_ceil(BLOCK_SIZE);
            let others = blocks.flat_map(|block| leaves.block(block).centers());
            reduce(&mut others.map(|to| from.distance_squared(to)))
        };
        let indices: Vec<usize> = sample_indices(count, queries.max(1)).collect();
        Ok(indices.into_par_iter().map(of).collect())
    }

    /// The number of particles, if it fits `usize`.
    fn len(&self) -> Result<usize, ParseError> {
        let count = usize::try_from(self.index().count);
        count.map_err(|_| ParseError::unsupported("more particles than this machine can count"))
    }

    fn positions(&self, leaves: &StoredLeaves) -> Result<Positions, ParseError> {
        let count = self.len()?;
        let origin = DVec3::from_array(self.index().origin);
        let lanes = |block: usize| leaves.block(block).centers();
        Ok(if origin == DVec3::ZERO {
            let mut positions = vec![Vec3::ZERO; count];
            let blocks = positions.par_chunks_mut(BLOCK_SIZE).enumerate();
            blocks.with_min_len(1024).for_each(|(block, to)| {
                to.iter_mut().zip(lanes(block)).for_each(|(to, p)| *to = p);
            });
            Positions::F32(positions)
        } else {
            let mut positions = vec![DVec3::ZERO; count];
            let blocks = positions.par_chunks_mut(BLOCK_SIZE).enumerate();
            blocks.with_min_len(1024).for_each(|(block, to)| {
                let world = lanes(block).map(|p| p.as_dvec3() + origin);
                to.iter_mut().zip(world).for_each(|(to, p)| *to = p);
            });
            Positions::F64(positions)
        })
    }

    /// The radius of a particle, if the frame has it.
    fn radius_of<'s>(&self, leaves: &'s StoredLeaves) -> Option<impl Fn(usize) -> f32 + 's> {
        let common = match &self.index().radius {
            RadiusIndex::None => return None,
            RadiusIndex::Common(radius) => *radius,
            RadiusIndex::PerParticle(_) => f32::NAN,
        };
        Some(move |i: usize| {
            let own = leaves.radii.load(i / BLOCK_SIZE);
            own.map_or(common, |block| block.0[i % BLOCK_SIZE])
        })
    }

    /// The radii as the attribute that readers look for, if no attribute has its name.
    fn radius_attribute(
        &self,
        attributes: &[Attribute],
        leaves: &StoredLeaves,
    ) -> Result<Option<Attribute>, ParseError> {
        if !wants_radius(attributes) {
            return Ok(None);
        }
        let count = self.len()?;
        let all = |radius: &dyn Fn(usize) -> f32| (0..count).map(radius).collect();
        Ok(self.radius_of(leaves).map(|radius| radii(all(&radius))))
    }
}

fn wants_radius(attributes: &[Attribute]) -> bool {
    !attributes.iter().any(|a| a.name.eq_ignore_ascii_case(RADIUS))
}

fn radii(values: Vec<f32>) -> Attribute {
    Attribute { name: RADIUS.to_owned(), components: 1, data: AttributeData::F32(values) }
}
