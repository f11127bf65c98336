//! Where the particles of all frames are placed: in the periodic cell, with whole molecules, around a group of particles, and
//! turned with it.

use std::fmt::Debug;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use glam::DVec3;
use spherule_frame::center::{self, center_in_cell, mean_position, move_mean_to};
use spherule_frame::superpose::{GroupPlaces, superpose};
use spherule_frame::values::id_of;
use spherule_frame::{
    BondLengths, FrameError, Molecules, ParseError, PeriodicImages, RawParticles,
};

use super::Sequence;

/// A group of particles, which this crate cannot find itself: it knows no conditions.
pub trait Group: Debug + Send + Sync {
    /// The indices of its particles in a frame, rising, and at least one.
    ///
    /// # Errors
    /// There is none, or the frame lacks what is needed to find them.
    fn particles(&self, frame: &RawParticles) -> Result<Vec<u32>, ParseError>;
}

/// What is done with the particles of each frame, in the order of the fields.
#[derive(Debug, Clone, Default)]
pub struct Placement {
    /// Wrapping and unwrapping; copies are made at the end.
    pub images: PeriodicImages,
    /// The lengths of bonds, for unwrapping without bonds.
    pub lengths: Option<Arc<BondLengths>>,
    /// The group that stays in the middle of a periodic cell, or without one where it is in the first frame.
    pub center: Option<Arc<dyn Group>>,
    /// The group that is superposed on that of the first frame.
    pub align: Option<Arc<dyn Group>>,
}

impl Placement {
    /// Whether particles stay as they are.
    pub(super) fn is_none(&self) -> bool {
        self.images.is_none() && self.center.is_none() && self.align.is_none()
    }

    /// Bytes that placing `count` particles needs at most beside them.
    pub(super) fn bytes(&self, count: u64) -> u64 {
        let center = if self.center.is_some() { center::BYTES_EACH } else { 0 };
        // Molecules have been made whole before
        self.images.bytes_to_move(count).max(center.saturating_mul(count))
    }

    /// Whether `particles` are placed like those of the first frame.
    pub(super) fn needs_reference(&self, particles: &RawParticles) -> bool {
        let has_middle = particles.cell.is_some_and(|cell| cell.periodic.contains(&true));
        self.align.is_some() || (self.center.is_some() && !has_middle)
    }
}

/// Where groups are in the first frame.
#[derive(Debug)]
pub(super) struct Reference {
    /// The mean position of the group that stays where it is.
    mean: Option<DVec3>,
    /// The places of the group that others are superposed on.
    group: Option<GroupPlaces>,
}

/// The reference once it is known, or why there is none.
pub(super) type ReferenceCell = OnceLock<Result<Reference, String>>;

impl Sequence {
    /// Whether [`Self::reference`] reads nothing.
    pub(super) fn has_reference(&self) -> bool {
        self.reference.get().is_some()
    }

    /// Where groups are in the first frame of the sequence, for frame `index`. It is read once; several threads may do so
    /// at the same time, with the same result.
    pub(super) fn reference(&self, index: usize) -> Result<&Reference, FrameError> {
        let read = || self.read_reference().map_err(|error| error.to_string());
        // No thread waits in a lock while another one that reads waits for threads
        let found = match self.reference.get() {
            Some(found) => found,
            None => {
                let read = read();
                self.reference.get_or_init(|| read)
            }
        };
        found.as_ref().map_err(|what| {
            let what =
                format!("the first frame, which others are placed like, cannot be used: {what}");
            self.in_first(index, ParseError::unsupported(what))
        })
    }

    fn read_reference(&self) -> Result<Reference, FrameError> {
        let mut particles = self.read_parts(0)?.particles;
        let in_first = |error| self.in_first(0, error);
        let Placement { images, lengths, center, align } = &self.placement;
        let molecules = images
            .move_particles(&mut particles, lengths.as_deref(), self.budget)
            .map_err(in_first)?;
        let mean = match center {
            None => None,
            Some(group) => {
                let chosen = group.particles(&particles).map_err(in_first)?;
                move_to_middle(&mut particles, &molecules, &chosen).map_err(in_first)?;
                mean_position(&particles.positions, &chosen)
            }
        };
        let group = match align {
            None => None,
            Some(group) => {
                let chosen = group.particles(&particles).map_err(in_first)?;
                let places = GroupPlaces::of(&particles, &chosen);
                // A group without a rotation is a fault of this frame
                superpose(&mut particles, &chosen, &places).map_err(in_first)?;
                Some(places)
            }
        };
        Ok(Reference { mean, group })
    }

    /// Places the particles of frame `index`, which is as it is in its files.
    pub(super) fn place(
        &self,
        index: usize,
        particles: &mut RawParticles,
    ) -> Result<(), FrameError> {
        if self.placement.is_none() {
            return Ok(());
        }
        self.check_order(index, particles).map_err(|error| self.in_first(index, error))?;
        let reference = if self.placement.needs_reference(particles) {
            Some(self.reference(index)?)
        } else {
            None
        };
        self.place_like(reference, particles).map_err(|error| self.in_first(index, error))
    }

    /// Checks that particles of several frames can be matched.
    fn check_order(&self, index: usize, particles: &RawParticles) -> Result<(), ParseError> {
        let is_needed = self.placement.align.is_some() && id_of(&particles.attributes).is_none();
        // A file that cannot be opened has been reported before
        let is_native = |path: &Path| crate::open::is_native(path).unwrap_or(false);
        if is_needed && self.inputs(index).into_iter().any(is_native) {
            return Err(ParseError::unsupported(
                "cell.align needs ids in native frames, which have their particles in another order; align the files \
                 that they were made of",
            ));
        }
        Ok(())
    }

    fn place_like(
        &self,
        reference: Option<&Reference>,
        particles: &mut RawParticles,
    ) -> Result<(), ParseError> {
        let Placement { images, lengths, center, align } = &self.placement;
        let molecules = images.move_particles(particles, lengths.as_deref(), self.budget)?;
        if let Some(group) = center {
            let chosen = group.particles(particles)?;
            let mean = reference.and_then(|reference| reference.mean);
            if !move_to_middle(particles, &molecules, &chosen)?
                && let Some(mean) = mean
            {
                move_mean_to(particles, &chosen, mean);
            }
        }
        if let Some(group) = align
            && let Some(places) = reference.and_then(|reference| reference.group.as_ref())
        {
            let chosen = group.particles(particles)?;
            superpose(particles, &chosen, places)?;
        }
        images.copy_particles(particles, self.budget)
    }
}

/// Moves the `chosen` particles to the middle of the cell, with all others around them. False without a periodic cell.
fn move_to_middle(
    particles: &mut RawParticles,
    molecules: &Molecules,
    chosen: &[u32],
) -> Result<bool, ParseError> {
    let Some(cell) = particles.cell.filter(|cell| cell.periodic.contains(&true)) else {
        return Ok(false);
    };
    let inverse = cell.fractions().ok_or_else(|| {
        ParseError::unsupported(
            "the simulation cell has no volume, so that nothing can be moved to its middle",
        )
    })?;
    center_in_cell(particles, (&cell, inverse), molecules, chosen);
    Ok(true)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::{SequenceInput, SequenceSettings};
    use super::*;

    /// The particles with these indices.
    #[derive(Debug)]
    struct Indices(Vec<u32>);

    impl Group for Indices {
        fn particles(&self, frame: &RawParticles) -> Result<Vec<u32>, ParseError> {
            let count = frame.positions.len();
            if self.0.iter().any(|index| *index as usize >= count) {
                return Err(ParseError::unsupported(format!("{count} particles")));
            }
            Ok(self.0.clone())
        }
    }

    /// Frames of four particles without a cell, each shifted and turned by a right angle more than the one before.
    fn sequence(placement: Placement) -> (tempfile::TempDir, Sequence) {
        let dir = tempfile::tempdir().unwrap();
        let mut places = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [5.0, 5.0, 3.0]];
        for frame in 0..3 {
            let row = |[x, y, z]: &[f64; 3]| format!("{x},{y},{z}\n");
            let rows: String = places.iter().map(row).collect();
            fs::write(dir.path().join(format!("f_{frame}.csv")), format!("x,y,z\n{rows}")).unwrap();
            places = places.map(|[x, y, z]| [10.0 - y, x, z - 4.0]);
        }
        let input = SequenceInput::Directory(dir.path().to_owned());
        let settings = SequenceSettings::default();
        let mut sequence = Sequence::open_with(&input, settings).unwrap();
        sequence.set_placement(placement);
        (dir, sequence)
    }

    fn places(sequence: &Sequence, index: usize) -> Vec<DVec3> {
        let particles = sequence.load_raw(index).unwrap();
        (0..4).map(|i| particles.positions.get(i)).collect()
    }

    #[test]
    fn without_a_cell_groups_stay_where_they_are_in_the_first_frame() {
        let group = || Some(Arc::new(Indices(vec![0, 1, 2])) as Arc<dyn Group>);
        let (_dir, plain) = sequence(Placement::default());
        let first = places(&plain, 0);
        assert!(places(&plain, 2)[3].distance(first[3]) > 5.0);
        // The last frame is loaded first: it does not become the reference
        let (_dir, centred) = sequence(Placement { center: group(), ..Placement::default() });
        assert!(centred.lone_file(0).is_none());
        for index in [2, 0, 1] {
            let found = places(&centred, index);
            let mean = |places: &[DVec3]| places[..3].iter().sum::<DVec3>() / 3.0;
            assert!(mean(&found).distance(mean(&first)) < 1e-9, "{index}");
            assert_eq!(index == 0, found[1].distance(first[1]) < 1e-9, "it does not turn");
        }
        let (_dir, aligned) = sequence(Placement { align: group(), ..Placement::default() });
        for index in [2, 0, 1] {
            for (found, expected) in places(&aligned, index).iter().zip(&first) {
                assert!(found.distance(*expected) < 1e-5, "{index}: {found} {expected}");
            }
        }
        // Without its particles in the first frame, all frames fail
        let group = Some(Arc::new(Indices(vec![7])) as Arc<dyn Group>);
        let (_dir, none) = sequence(Placement { align: group, ..Placement::default() });
        let error = none.load_raw(1).unwrap_err().to_string();
        assert!(
            error.contains("f_1.csv: the first frame, which others are placed like"),
            "{error}"
        );
        assert!(error.contains("f_0.csv: 4 particles"), "{error}");
    }
}
