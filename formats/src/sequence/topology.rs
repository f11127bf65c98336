//! Properties of the atoms of a trajectory that are in another file: its topology.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use crate::open::FrameFile;
use crate::read::psf;
use crate::{Attribute, FrameError, MemoryBudget, ParseError, Positions, RawParticles};
use spherule_readers::read_whole;

/// Properties of a topology that change with time.
const CHANGING: [&str; 2] = ["velocity", "force"];

/// The properties of all atoms, in the order of the trajectory.
#[derive(Debug)]
pub struct Topology {
    path: PathBuf,
    /// Atoms.
    count: usize,
    /// Their attributes with labels, their bonds, and notes.
    atoms: RawParticles,
}

impl Topology {
    /// Reads the first step of the file at `path`.
    ///
    /// # Errors
    /// [`FrameError`] if it cannot be read.
    pub fn open(path: &Path, budget: MemoryBudget) -> Result<Self, FrameError> {
        let (count, mut atoms) = if psf::is_psf(&crate::open::head(path)?) {
            let bytes = read_whole(path, budget.for_content())?;
            psf::read(&bytes, budget).map_err(|e| e.in_file(path))?
        } else {
            let mut particles = FrameFile::open_within(path, budget)?.read(0)?;
            let count = particles.positions.len();
            particles.positions = Positions::default();
            (count, particles)
        };
        atoms.attributes.retain(|attribute| !CHANGING.contains(&attribute.name.as_str()));
        Ok(Self { path: path.to_owned(), count, atoms })
    }

    /// The file of the topology.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Adds the properties and the bonds that `particles` of the file at `path` do not have.
    ///
    /// # Errors
    /// [`FrameError::Malformed`] if there are more or fewer particles than atoms.
    pub fn add_to(&self, particles: &mut RawParticles, path: &Path) -> Result<(), FrameError> {
        let count = particles.positions.len();
        if count != self.count {
            let what = format!(
                "{count} atoms, but the topology {} has {}; give the topology of this simulation",
                self.path.display(),
                self.count
            );
            return Err(ParseError::malformed(0, what).in_file(path));
        }
        // Looked up, never searched for: there may be very many.
        let own = particles.attributes.iter();
        let known: HashSet<String> = own.map(|attribute| attribute.name.clone()).collect();
        let is_new = |attribute: &&Attribute| !known.contains(&attribute.name);
        for attribute in self.atoms.attributes.iter().filter(is_new) {
            let labels = self.atoms.labels.get_key_value(&attribute.name);
            particles.labels.extend(labels.map(|(name, labels)| (name.clone(), labels.clone())));
            particles.attributes.push(attribute.clone());
        }
        if particles.bonds.is_empty() {
            particles.bonds.clone_from(&self.atoms.bonds);
        }
        particles.notes.extend_from_slice(&self.atoms.notes);
        Ok(())
    }
}
