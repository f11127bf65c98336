//! Members of groups in which many names are looked up, opened together.
//!
//! For each name, `hdf5-reader` copies and verifies a block of the heap with the links: 64 KiB and more, so that the
//! time for all names would grow with the square of their number. When it lists the whole group, it does so once.
//! Few names take less time than the list.

use std::collections::BTreeMap;
use std::sync::Arc;

use hdf5_reader::Dataset;
use hdf5_reader::error::Error;
use hdf5_reader::group::Group;

/// Names that are looked up one by one before all members are opened.
const MAX_LOOKUPS: u32 = 64;

/// The members of a group as far as they are known.
pub(super) enum Lookups {
    /// So many were looked up by their names.
    Single(u32),
    /// All of them; `None` if one cannot be opened. That one is an error only where it is needed.
    Together(Option<Arc<Members>>),
}

impl Lookups {
    /// All members of `group`, if this is not one of the first names that are looked up in it.
    pub(super) fn next(&mut self, group: &Group) -> Option<Arc<Members>> {
        match self {
            Self::Together(members) => members.clone(),
            Self::Single(count) if *count < MAX_LOOKUPS => {
                *count += 1;
                None
            }
            Self::Single(_) => {
                let members = Members::of(group).ok().map(Arc::new);
                *self = Self::Together(members.clone());
                members
            }
        }
    }
}

impl Default for Lookups {
    fn default() -> Self {
        Self::Single(0)
    }
}

/// All groups and data sets of a group, by their names.
pub(super) struct Members {
    groups: BTreeMap<String, Group>,
    datasets: BTreeMap<String, Dataset>,
}

impl Members {
    fn of(group: &Group) -> Result<Self, Error> {
        let (groups, datasets) = group.members()?;
        let groups = groups.into_iter().map(|g| (g.name().to_owned(), g));
        let datasets = datasets.into_iter().map(|d| (d.name().to_owned(), d));
        Ok(Self { groups: groups.collect(), datasets: datasets.collect() })
    }

    /// The group `name`.
    pub(super) fn group(&self, name: &str) -> Result<Group, Error> {
        let group = self.groups.get(name).cloned();
        group.ok_or_else(|| Error::GroupNotFound(name.to_owned()))
    }

    /// The data set `name`.
    pub(super) fn dataset(&self, name: &str) -> Result<Dataset, Error> {
        let dataset = self.datasets.get(name).cloned();
        dataset.ok_or_else(|| Error::DatasetNotFound(name.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::file::H5File;
    use super::super::node::Node;
    use super::MAX_LOOKUPS;
    use spherule_frame::MemoryBudget;
    use spherule_readers::read_whole;
    use spherule_readers::shared::SharedBytes;

    /// The group `run` of a file, in which many names were looked up.
    fn run_of(bytes: &[u8]) -> Node {
        let file = H5File::open(&SharedBytes::copy(bytes)).expect("HDF5");
        let root = Node::root(&file).expect("a root");
        let run = root.group("run").expect("links").expect("the group");
        for _ in 0..MAX_LOOKUPS {
            assert!(!run.is_opened_as_a_whole());
        }
        run
    }

    /// Without a clock: which groups are listed as a whole.
    #[test]
    fn many_names_are_looked_up_in_one_list_unless_a_member_is_damaged() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/hdf5_names");
        let path = root.join("deep_heaps.h5.xz");
        let mut bytes = read_whole(&path, MemoryBudget::UNLIMITED).expect("a good file");
        let run = run_of(&bytes);
        assert!(run.is_opened_as_a_whole());
        let density = run.dataset("density").expect("links").expect("a data set");
        assert!(run.dataset("Density").expect("links").is_none());
        assert!(run.group("density").expect("links").is_none());
        bytes[density.file.place(density.address())] = 0;
        let run = run_of(&bytes);
        assert!(!run.is_opened_as_a_whole());
        assert!(run.dataset("positions").expect("links").is_some());
        assert!(run.dataset("density").is_err());
    }
}
