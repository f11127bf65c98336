//! One time step in memory: [`RawParticles`] as a reader returns them, and [`ParticleFrame`] as the renderer
//! needs them (finite, f32, relative to the origin of the sequence).

use std::borrow::Cow;
use std::ops::Deref;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::bonds::{self, Bond};
use crate::gather::{gather, keep};
use crate::names::RADII;
use crate::with_values;
use crate::{Attribute, AttributeData, Labels, SimulationCell, TypeShapes};

/// Positions in the precision of the file, world units.
#[derive(Debug, Clone, PartialEq)]
pub enum Positions {
    /// Single precision, which most simulations write.
    F32(Vec<Vec3>),
    /// Double precision; an origin is subtracted before rounding, so that fine detail is kept.
    F64(Vec<DVec3>),
}

impl Default for Positions {
    fn default() -> Self {
        Self::F32(Vec::new())
    }
}

impl Positions {
    /// Replaces each position, in order; `moved` works in f64.
    pub(super) fn each(&mut self, mut moved: impl FnMut(DVec3) -> DVec3) {
        match self {
            Self::F32(v) => {
                for position in v {
                    *position = moved(position.as_dvec3()).as_vec3();
                }
            }
            Self::F64(v) => {
                for position in v {
                    *position = moved(*position);
                }
            }
        }
    }

    /// Particle count.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(v) => v.len(),
            Self::F64(v) => v.len(),
        }
    }

    /// True if there are no positions.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// `parts` after one another: in single precision if all are.
    pub(crate) fn joined(mut parts: Vec<Self>) -> Self {
        if parts.len() == 1 {
            return parts.remove(0);
        }
        let count = parts.iter().map(Self::len).sum();
        if parts.iter().all(|part| matches!(part, Self::F32(_))) {
            let mut all = Vec::with_capacity(count);
            for part in parts {
                if let Self::F32(v) = part {
                    all.extend(v);
                }
            }
            return Self::F32(all);
        }
        let mut all: Vec<DVec3> = Vec::with_capacity(count);
        for part in parts {
            match part {
                Self::F32(v) => all.extend(v.iter().map(|p| p.as_dvec3())),
                Self::F64(v) => all.extend(v),
            }
        }
        Self::F64(all)
    }

    /// Bytes of the positions in memory.
    pub fn byte_len(&self) -> u64 {
        match self {
            Self::F32(v) => size_of_val(&v[..]) as u64,
            Self::F64(v) => size_of_val(&v[..]) as u64,
        }
    }

    /// The largest distance that a position moves when it is rounded to f32 relative to `origin`, as in
    /// [`ParticleFrame::from_raw`]. Positions that are dropped there do not count.
    pub fn rounding(&self, origin: DVec3) -> f64 {
        if matches!(self, Self::F32(_)) && origin == DVec3::ZERO {
            return 0.0;
        }
        let moved = |i: usize| {
            let (position, rounded) = (self.get(i), (self.get(i) - origin).as_vec3());
            let distance = (rounded.as_dvec3() + origin).distance(position);
            if is_near(&rounded) { distance } else { 0.0 }
        };
        let all = (0..self.len()).into_par_iter().with_min_len(4096);
        all.map(moved).reduce(|| 0.0, f64::max)
    }

    /// Position `index` in f64.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn get(&self, index: usize) -> DVec3 {
        match self {
            Self::F32(v) => v[index].as_dvec3(),
            Self::F64(v) => v[index],
        }
    }
}

/// Positions that belong to a caller, world units.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the same as of `Positions`")]
pub enum PositionSlice<'a> {
    F32(&'a [Vec3]),
    F64(&'a [DVec3]),
}

impl Default for PositionSlice<'_> {
    fn default() -> Self {
        Self::F32(&[])
    }
}

impl PositionSlice<'_> {
    /// Particle count.
    pub const fn len(&self) -> usize {
        match self {
            Self::F32(v) => v.len(),
            Self::F64(v) => v.len(),
        }
    }

    /// True if there are no positions.
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A copy.
    pub fn to_positions(&self) -> Positions {
        match self {
            Self::F32(v) => Positions::F32(v.to_vec()),
            Self::F64(v) => Positions::F64(v.to_vec()),
        }
    }
}

/// All data of one step as a reader returns it: unfiltered, in file order. The positions may belong to a caller, as
/// [`PositionSlice`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RawParticles<P = Positions> {
    /// Positions in the precision of the file.
    pub positions: P,
    /// All other numeric per-particle data; each attribute has exactly one value group per particle.
    pub attributes: Vec<Attribute>,
    /// Simulation time, if the file has it.
    pub time: Option<f64>,
    /// Step number written inside the file (LAMMPS `TIMESTEP`), if any.
    pub step: Option<i64>,
    /// The simulation cell, if the file has it.
    pub cell: Option<SimulationCell>,
    /// Bonds, if the file lists them, by indices of the particles.
    pub bonds: Vec<Bond>,
    /// What the user should know, such as columns that only some parts have.
    pub notes: Vec<String>,
    /// Names of parts and of other values.
    pub labels: Labels,
    /// Shapes of the types of particles, if the file has them.
    pub shapes: Option<Arc<TypeShapes>>,
}

impl<P> RawParticles<P> {
    /// The same particles with their positions in another type.
    fn with_positions<Q>(self, convert: impl FnOnce(P) -> Q) -> RawParticles<Q> {
        RawParticles {
            positions: convert(self.positions),
            attributes: self.attributes,
            time: self.time,
            step: self.step,
            cell: self.cell,
            bonds: self.bonds,
            notes: self.notes,
            labels: self.labels,
            shapes: self.shapes,
        }
    }
}

impl RawParticles<PositionSlice<'_>> {
    /// A copy that owns its positions.
    pub fn to_owned_particles(&self) -> RawParticles {
        RawParticles {
            positions: self.positions.to_positions(),
            attributes: self.attributes.clone(),
            time: self.time,
            step: self.step,
            cell: self.cell,
            bonds: self.bonds.clone(),
            notes: self.notes.clone(),
            labels: self.labels.clone(),
            shapes: self.shapes.clone(),
        }
    }
}

impl RawParticles {
    /// Bytes of positions, attributes and bonds in memory.
    pub fn byte_len(&self) -> u64 {
        let attributes = self.attributes.iter().map(|a| a.data.byte_len());
        let bonds = size_of_val(&self.bonds[..]) as u64;
        self.positions.byte_len() + attributes.sum::<u64>() + bonds
    }

    /// Keeps only the particles with these indices, which are ascending. No array is copied.
    ///
    /// # Panics
    /// If there is no particle with one of the indices.
    pub fn select(&mut self, indices: &[u32]) {
        bonds::renumber(&mut self.bonds, self.positions.len(), indices);
        let (positions, attributes) = (&mut self.positions, &mut self.attributes);
        rayon::join(
            || match positions {
                Positions::F32(v) => keep(v, 1, indices),
                Positions::F64(v) => keep(v, 1, indices),
            },
            || {
                attributes.par_iter_mut().for_each(|attribute| {
                    with_values!(&mut attribute.data, v => keep(v, attribute.components, indices));
                });
            },
        );
    }

    /// Keeps only the particles with these indices, in their order. Arrays are copied one after the other.
    ///
    /// # Panics
    /// If there is no particle with one of the indices.
    pub fn gather(&mut self, indices: &[u32]) {
        bonds::renumber(&mut self.bonds, self.positions.len(), indices);
        match &mut self.positions {
            Positions::F32(v) => *v = gather(v, 1, indices),
            Positions::F64(v) => *v = gather(v, 1, indices),
        }
        for attribute in &mut self.attributes {
            with_values!(&mut attribute.data, v => *v = gather(v, attribute.components, indices));
        }
    }

    /// Bytes of the largest array among positions and attributes.
    pub fn largest_array_len(&self) -> u64 {
        let attributes = self.attributes.iter().map(|a| a.data.byte_len());
        attributes.fold(self.positions.byte_len(), u64::max)
    }
}

/// Sphere radii in scene units.
#[derive(Debug, Clone, PartialEq)]
pub enum Radius {
    /// All particles have this radius.
    Common(f32),
    /// One radius per particle, in particle order.
    PerParticle(Vec<f32>),
}

/// The particles of one time step, ready for building a tree: every position is finite. The positions may belong to a
/// caller, as `Cow<[Vec3]>`.
#[derive(Debug, Clone, PartialEq)]
pub struct ParticleFrame<P = Vec<Vec3>> {
    /// Positions relative to `origin`, scene units.
    pub positions: P,
    /// World position that `positions` are relative to; the same for a whole sequence.
    pub origin: DVec3,
    /// Radii, if the file has them (an attribute named `radius` or `pscale`, or half of a `diameter`). `None`
    /// means that they must be estimated from the spacing.
    pub radius: Option<Radius>,
    /// Attributes in particle order.
    pub attributes: Vec<Attribute>,
    /// Simulation time, if known.
    pub time: Option<f64>,
    /// The simulation cell, if known, in world coordinates.
    pub cell: Option<SimulationCell>,
    /// Bonds, if known, by indices of the particles.
    pub bonds: Vec<Bond>,
    /// Shapes of the types of particles, if the file has them.
    pub shapes: Option<Arc<TypeShapes>>,
    /// Particles that were dropped because a coordinate was NaN or beyond [`FARTHEST`].
    pub dropped: u64,
    /// File-order index of each kept particle; `None` if all particles of the file were kept (the indices are then
    /// equal).
    pub file_index: Option<Vec<u32>>,
}

/// The largest coordinate relative to a sequence's origin, and the largest radius, of particles that are kept.
/// Boxes around such spheres and the quantised planes of tree nodes are finite, even after rounding up.
pub const FARTHEST: f32 = f32::MAX / 16.0;

/// Whether a position relative to the origin is finite and within [`FARTHEST`].
pub fn is_near(position: &Vec3) -> bool {
    position.abs().cmple(Vec3::splat(FARTHEST)).all()
}

/// Whether a radius is a number from 0 to [`FARTHEST`].
pub fn is_radius(radius: f32) -> bool {
    (0.0..=FARTHEST).contains(&radius)
}

impl ParticleFrame {
    /// Drops and counts particles that are not [near](is_near), subtracts `origin` in f64 and rounds to f32.
    pub fn from_raw(raw: RawParticles, origin: DVec3) -> Self {
        let relative = raw.with_positions(|p| Cow::Owned(relative_positions(p, origin)));
        ParticleFrame::kept(relative, origin).with_positions(Cow::into_owned)
    }

    /// Same as [`Self::from_raw`] for the particles with these indices, in their order. `file_index` has them.
    ///
    /// # Panics
    /// If there is no particle with one of the indices.
    pub fn from_selected(mut raw: RawParticles, indices: Vec<u32>, origin: DVec3) -> Self {
        if indices.is_sorted() {
            raw.select(&indices);
        } else {
            raw.gather(&indices);
        }
        let mut frame = Self::from_raw(raw, origin);
        frame.file_index = Some(match frame.file_index {
            None => indices,
            Some(kept) => kept.iter().map(|i| indices[*i as usize]).collect(),
        });
        frame
    }
}

impl<'a> ParticleFrame<Cow<'a, [Vec3]>> {
    /// Same as [`ParticleFrame::from_raw`], of positions that belong to a caller. They are not copied if they are in
    /// single precision, the origin is zero, and no particle is dropped.
    pub fn borrowed(raw: RawParticles<PositionSlice<'a>>, origin: DVec3) -> Self {
        let relative = match raw.positions {
            PositionSlice::F32(v) if origin == DVec3::ZERO => Cow::Borrowed(v),
            PositionSlice::F32(v) => {
                let moved = v.par_iter().map(|p| (p.as_dvec3() - origin).as_vec3());
                Cow::Owned(moved.collect())
            }
            PositionSlice::F64(v) => {
                Cow::Owned(v.par_iter().map(|p| (p - origin).as_vec3()).collect())
            }
        };
        Self::kept(raw.with_positions(|_| relative), origin)
    }

    /// The particles that are near, of `raw` with positions relative to `origin`.
    fn kept(raw: RawParticles<Cow<'a, [Vec3]>>, origin: DVec3) -> Self {
        let RawParticles { mut positions, mut attributes, time, cell, mut bonds, shapes, .. } = raw;
        // Keep the arrays if no particle is dropped
        let (mut file_index, mut dropped) = (None, 0);
        if !positions.iter().all(is_near) {
            let keep: Vec<bool> = positions.iter().map(is_near).collect();
            for attribute in &mut attributes {
                attribute.data.retain_particles(attribute.components, &keep);
            }
            // Remember where the others were in the file
            let count = keep.iter().filter(|k| **k).count();
            let mut indices = Vec::with_capacity(count);
            let mut near = Vec::with_capacity(count);
            for (index, position) in positions.iter().enumerate().filter(|(i, _)| keep[*i]) {
                near.push(*position);
                indices.push(u32::try_from(index).unwrap_or(u32::MAX));
            }
            dropped = (positions.len() - count) as u64;
            bonds::renumber(&mut bonds, positions.len(), &indices);
            positions = Cow::Owned(near);
            file_index = Some(indices);
        }
        Self {
            positions,
            origin,
            radius: find_radius(&attributes),
            attributes,
            time,
            cell,
            bonds,
            shapes,
            dropped,
            file_index,
        }
    }
}

impl<P> ParticleFrame<P> {
    /// The same frame with its positions in another type.
    pub fn with_positions<Q>(self, convert: impl FnOnce(P) -> Q) -> ParticleFrame<Q> {
        ParticleFrame {
            positions: convert(self.positions),
            origin: self.origin,
            radius: self.radius,
            attributes: self.attributes,
            time: self.time,
            cell: self.cell,
            bonds: self.bonds,
            shapes: self.shapes,
            dropped: self.dropped,
            file_index: self.file_index,
        }
    }
}

impl<P: Deref<Target = [Vec3]>> ParticleFrame<P> {
    /// The attribute called `name`: an exact match, else one that ignores case.
    pub fn attribute(&self, name: &str) -> Option<&Attribute> {
        let exact = self.attributes.iter().find(|a| a.name == name);
        exact.or_else(|| self.attributes.iter().find(|a| a.name.eq_ignore_ascii_case(name)))
    }

    /// Number of particles (kept ones, which are finite).
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// True if there are no particles; such a frame is valid and shows the background.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }
}

/// An f64 that is too large for f32 becomes infinite here, and the caller drops the particle.
fn relative_positions(positions: Positions, origin: DVec3) -> Vec<Vec3> {
    match positions {
        Positions::F32(v) if origin == DVec3::ZERO => v,
        Positions::F32(mut v) => {
            for p in &mut v {
                *p = (p.as_dvec3() - origin).as_vec3();
            }
            v
        }
        Positions::F64(v) => v.into_iter().map(|p| (p - origin).as_vec3()).collect(),
    }
}

/// The radii among `attributes`, by the names that simulations and Houdini use.
#[expect(clippy::cast_possible_truncation, reason = "radii are f32 in the renderer")]
pub fn find_radius(attributes: &[Attribute]) -> Option<Radius> {
    let named = |name: &str| {
        attributes.iter().find(|a| {
            a.components == 1
                && a.name.eq_ignore_ascii_case(name)
                && matches!(a.data, AttributeData::F32(_) | AttributeData::F64(_))
        })
    };
    let mut found = RADII.iter().map(|(name, scale)| (named(name), scale));
    let (attribute, scale) = found.find_map(|(attribute, scale)| attribute.zip(Some(scale)))?;
    let radii: Vec<f32> =
        (0..attribute.count()).map(|i| (attribute.data.get_f64(i) * scale) as f32).collect();
    match radii.first() {
        Some(first) if radii.iter().all(|r| r == first) => Some(Radius::Common(*first)),
        Some(_) => Some(Radius::PerParticle(radii)),
        None => None,
    }
}
