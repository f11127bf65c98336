//! Properties of the atoms of a trajectory that are in another file: its topology.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use crate::open::FrameFile;
use crate::read::{prmtop, psf};
use crate::{
    Attribute, AttributeData, FrameError, MemoryBudget, ParseError, Positions, RawParticles,
};
use spherule_frame::gather::gather;
use spherule_frame::names::ID;
use spherule_frame::{Bond, map_values};
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
        let head = crate::open::head(path)?;
        let whole = || read_whole(path, budget.for_content());
        let (count, mut atoms) = if psf::is_psf(&head) {
            psf::read(&whole()?, budget).map_err(|e| e.in_file(path))?
        } else if prmtop::is_prmtop(&head) {
            prmtop::read(&whole()?, budget).map_err(|e| e.in_file(path))?
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

    /// Adds the properties and the bonds that `particles` of the file at `path` do not have. Particles and atoms are joined
    /// by their ids if both have them, else by their order.
    ///
    /// # Errors
    /// [`FrameError::Malformed`] if there are more or fewer particles than atoms, or an id that no atom has.
    pub fn add_to(&self, particles: &mut RawParticles, path: &Path) -> Result<(), FrameError> {
        let order = self.order(particles).map_err(|e| e.in_file(path))?;
        // Looked up, never searched for: there may be very many.
        let own = particles.attributes.iter();
        let known: HashSet<String> = own.map(|attribute| attribute.name.clone()).collect();
        let is_new = |attribute: &&Attribute| !known.contains(&attribute.name);
        for attribute in self.atoms.attributes.iter().filter(is_new) {
            let labels = self.atoms.labels.get_key_value(&attribute.name);
            particles.labels.extend(labels.map(|(name, labels)| (name.clone(), labels.clone())));
            particles.attributes.push(match &order {
                Some(order) => gathered(attribute, order),
                None => attribute.clone(),
            });
        }
        // Names of values that the particles have themselves
        for (name, labels) in self.atoms.labels.iter().filter(|(name, _)| known.contains(*name)) {
            particles.labels.entry(name.clone()).or_insert_with(|| labels.clone());
        }
        if particles.bonds.is_empty() {
            particles.bonds = match &order {
                Some(order) => renumbered(&self.atoms.bonds, order, self.count),
                None => self.atoms.bonds.clone(),
            };
        }
        particles.notes.extend_from_slice(&self.atoms.notes);
        Ok(())
    }

    /// The atom of each particle by its id; none if particles and atoms have the same order.
    fn order(&self, particles: &RawParticles) -> Result<Option<Vec<u32>>, ParseError> {
        let count = particles.positions.len();
        let ids = ids(particles).zip(ids(&self.atoms));
        if let Some((own, ids)) = ids.filter(|(own, ids)| own != ids)
            && let Some(atoms) = by_id(ids)
        {
            let atom = |id: &i64| {
                atoms.get(id).copied().ok_or_else(|| {
                    let what =
                        format!("no atom of the topology {} has the id {id}", self.path.display());
                    ParseError::malformed(
                        0,
                        format!("{what}; give the topology of this simulation"),
                    )
                })
            };
            return own.iter().map(atom).collect::<Result<_, _>>().map(Some);
        }
        if count == self.count {
            return Ok(None);
        }
        let what = format!(
            "{count} atoms, but the topology {} has {}; give the topology of this simulation",
            self.path.display(),
            self.count
        );
        Err(ParseError::malformed(0, what))
    }
}

/// The ids of all particles, if there are any.
fn ids(particles: &RawParticles) -> Option<&[i64]> {
    particles.attributes.iter().find_map(|attribute| match &attribute.data {
        AttributeData::I64(ids) if attribute.name == ID[0] && attribute.components == 1 => {
            Some(ids.as_slice())
        }
        _ => None,
    })
}

/// The atoms by their ids, if these are distinct.
fn by_id(ids: &[i64]) -> Option<HashMap<i64, u32>> {
    let atoms: HashMap<i64, u32> = ids.iter().copied().zip(0..).collect();
    (atoms.len() == ids.len()).then_some(atoms)
}

/// The values of the atoms with these indices.
fn gathered(attribute: &Attribute, order: &[u32]) -> Attribute {
    let data = map_values!(&attribute.data, v => gather(v, attribute.components, order));
    Attribute { name: attribute.name.clone(), data, ..*attribute }
}

/// The `bonds` of `count` atoms between the particles that are these atoms; others have none.
fn renumbered(bonds: &[Bond], order: &[u32], count: usize) -> Vec<Bond> {
    let mut particles = vec![None; count];
    for (particle, atom) in (0..).zip(order) {
        particles[*atom as usize] = Some(particle);
    }
    let particle = |atom: u32| particles.get(atom as usize).copied().flatten();
    bonds.iter().filter_map(|[a, b]| Some([particle(*a)?, particle(*b)?])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const DATA: &str = "t\n3 atoms\n2 atom types\n2 bonds\n0 9 xlo xhi\n\nMasses\n\n1 15.999 # OW\n2 1.008 # HW\n\n\
        Atoms # molecular\n\n3 1 2 0 0 0\n1 1 1 0 0 0\n2 1 2 0 0 0\n\nBonds\n\n1 1 1 2\n2 1 1 3\n";

    fn topology(text: &str) -> Topology {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("system.data");
        std::fs::write(&path, text).expect("writable");
        Topology::open(&path, MemoryBudget::UNLIMITED).expect("a topology")
    }

    /// Particles with these ids, and without any.
    fn particles(count: usize, ids: Option<&[i64]>) -> RawParticles {
        let id = |ids: &[i64]| Attribute {
            name: "id".to_owned(),
            components: 1,
            data: AttributeData::I64(ids.to_vec()),
        };
        RawParticles {
            positions: Positions::F64(vec![glam::DVec3::ZERO; count]),
            attributes: ids.map(id).into_iter().collect(),
            ..RawParticles::default()
        }
    }

    #[track_caller]
    fn joined(ids: Option<&[i64]>, count: usize) -> Result<(Vec<f64>, Vec<Bond>), FrameError> {
        let mut particles = particles(count, ids);
        topology(DATA).add_to(&mut particles, Path::new("dump"))?;
        let element = particles.attributes.iter().find(|a| a.name == "element").expect("elements");
        let elements = (0..count).map(|index| element.data.get_f64(index)).collect();
        assert_eq!(particles.labels["type"][&1], "OW");
        Ok((elements, particles.bonds))
    }

    #[test]
    fn particles_are_joined_by_id_or_by_order() {
        let all = joined(Some(&[2, 3, 1]), 3).expect("joined");
        assert_eq!(all, (vec![1.0, 1.0, 8.0], vec![[2, 0], [2, 1]]));
        let same = joined(Some(&[1, 2, 3]), 3).expect("joined");
        assert_eq!(same, (vec![8.0, 1.0, 1.0], vec![[0, 1], [0, 2]]));
        assert_eq!(joined(None, 3).expect("joined"), same);
        // Some of the atoms
        let some = joined(Some(&[3, 1]), 2).expect("joined");
        assert_eq!(some, (vec![1.0, 8.0], vec![[1, 0]]));
        let error = joined(Some(&[1, 7]), 2).expect_err("another simulation").to_string();
        assert!(error.contains("has the id 7; give the topology of this simulation"), "{error}");
        let error = joined(None, 2).expect_err("another simulation").to_string();
        assert!(
            error.starts_with("dump: ") && error.contains("2 atoms, but the topology"),
            "{error}"
        );
    }

    #[test]
    fn topologies_of_amber_have_no_positions() {
        let sample =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/molecules/ethanol.prmtop");
        let topology = Topology::open(&sample, MemoryBudget::UNLIMITED).expect("a topology");
        let mut ethanol = particles(9, None);
        topology.add_to(&mut ethanol, Path::new("ethanol.mdcrd")).expect("joined");
        assert_eq!(ethanol.bonds.len(), 8);
        assert!(ethanol.attributes.iter().any(|attribute| attribute.name == "atom_name"));
    }
}
