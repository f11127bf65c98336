//! Groups and attributes of HDF5 files, with the errors of this crate. Links to other files are followed.

use std::collections::HashSet;
use std::ops::Deref;
use std::sync::Arc;

use hdf5_reader::error::Error;
use hdf5_reader::group::Group;
use hdf5_reader::{Attribute, Dataset};

use super::file::{H5File, ObjectKey};
use super::links::ExternalLink;
use super::types::stored_scalar;
use spherule_files::one_line;
use spherule_frame::ParseError;

/// Most numbers of an attribute that are read.
const MAX_ATTRIBUTE_NUMBERS: usize = 1 << 16;

/// A group.
#[derive(Clone)]
pub(super) struct Node {
    file: H5File,
    group: Group,
    path: String,
}

/// A data set, and the file that has it.
pub(super) struct NodeDataset {
    pub(super) file: H5File,
    dataset: Dataset,
}

impl Deref for NodeDataset {
    type Target = Dataset;

    fn deref(&self) -> &Dataset {
        &self.dataset
    }
}

/// What a link to another file leads to.
enum Linked {
    Group(Node),
    Dataset(Box<NodeDataset>),
}

impl Node {
    /// The root group of `file`.
    ///
    /// # Errors
    /// [`ParseError::Malformed`].
    pub(super) fn root(file: &H5File) -> Result<Self, ParseError> {
        let group = file.inner().root_group().map_err(|e| file.error(&e, 0, "/"))?;
        Ok(Self::new(file, group, String::new()))
    }

    /// `group` of `file`, whose path is `path`.
    fn new(file: &H5File, group: Group, path: String) -> Self {
        Self { file: file.clone(), group, path }
    }

    /// The file.
    pub(super) const fn file(&self) -> &H5File {
        &self.file
    }

    /// The path from the root, which is empty; without a slash at the end.
    pub(super) fn path(&self) -> &str {
        &self.path
    }

    /// The path of the member `name`.
    pub(super) fn path_of(&self, name: &str) -> String {
        format!("{}/{name}", self.path)
    }

    /// Names of the groups and of the data sets in it, sorted.
    ///
    /// # Errors
    /// [`ParseError`] if the group is damaged, or a link leads to nothing.
    pub(super) fn members(&self) -> Result<(Vec<String>, Vec<String>), ParseError> {
        let names = self.file.with_virtual(self.shown_path(), || self.group.member_names())?;
        let (mut groups, mut datasets) = names.map_err(|e| self.error(&e, self.shown_path()))?;
        for link in self.links()?.iter() {
            match self.follow(link)? {
                Linked::Group(_) => groups.push(link.name.clone()),
                Linked::Dataset(_) => datasets.push(link.name.clone()),
            }
        }
        groups.sort();
        datasets.sort();
        Ok((groups, datasets))
    }

    /// The groups in it whose names are `wanted`, with their names, sorted. A group with several of these names is there
    /// under the first of them: its particles would count several times.
    ///
    /// # Errors
    /// As [`Self::members`].
    pub(super) fn distinct_groups(
        &self,
        wanted: impl Fn(&str) -> bool,
    ) -> Result<Vec<(String, Self)>, ParseError> {
        let mut seen = HashSet::new();
        let mut groups = Vec::new();
        let names = self.members()?.0.into_iter();
        for name in names.filter(|name| wanted(name)) {
            if let Some(group) = self.group(&name)?
                && seen.insert(group.key())
            {
                groups.push((name, group));
            }
        }
        Ok(groups)
    }

    /// Whether a name that is looked up is taken from a list of all members.
    #[cfg(test)]
    pub(super) fn is_opened_as_a_whole(&self) -> bool {
        self.file.members(&self.group).is_some()
    }

    /// What is the same for all names of the group.
    pub(super) fn key(&self) -> ObjectKey {
        self.file.key(self.file.place(self.group.address()))
    }

    /// The group `name`, if there is one.
    ///
    /// # Errors
    /// As [`Self::members`].
    pub(super) fn group(&self, name: &str) -> Result<Option<Self>, ParseError> {
        let path = self.path_of(name);
        let group = match self.file.members(&self.group) {
            Some(members) => members.group(name),
            None => self.file.with_virtual(&path, || self.group.group(name))?,
        };
        match group {
            Ok(group) => Ok(Some(Self::new(&self.file, group, path))),
            Err(Error::GroupNotFound(_)) => match self.linked(name)? {
                Some(Linked::Group(node)) => Ok(Some(node)),
                Some(Linked::Dataset(_)) | None => Ok(None),
            },
            Err(e) => Err(self.error(&e, &path)),
        }
    }

    /// The group at `path` below this one, if there is one.
    ///
    /// # Errors
    /// As [`Self::members`].
    pub(super) fn descend(&self, path: &str) -> Result<Option<Self>, ParseError> {
        let mut node = self.clone();
        for name in path.split('/').filter(|name| !name.is_empty()) {
            let Some(next) = node.group(name)? else {
                return Ok(None);
            };
            node = next;
        }
        Ok(Some(node))
    }

    /// The data set `name`, if there is one.
    ///
    /// # Errors
    /// As [`Self::members`].
    pub(super) fn dataset(&self, name: &str) -> Result<Option<NodeDataset>, ParseError> {
        let path = self.path_of(name);
        let dataset = match self.file.members(&self.group) {
            Some(members) => members.dataset(name),
            None => self.file.with_virtual(&path, || self.group.dataset(name))?,
        };
        match dataset {
            Ok(dataset) => Ok(Some(NodeDataset { file: self.file.clone(), dataset })),
            Err(Error::DatasetNotFound(_)) => match self.linked(name)? {
                Some(Linked::Dataset(dataset)) => Ok(Some(*dataset)),
                Some(Linked::Group(_)) | None => Ok(None),
            },
            Err(e) => Err(self.error(&e, &path)),
        }
    }

    /// The data set at `path` below this group, if there is one.
    ///
    /// # Errors
    /// As [`Self::members`].
    pub(super) fn dataset_at(&self, path: &str) -> Result<Option<NodeDataset>, ParseError> {
        let (groups, name) = path.rsplit_once('/').unwrap_or(("", path));
        match self.descend(groups)? {
            Some(node) => node.dataset(name),
            None => Ok(None),
        }
    }

    fn links(&self) -> Result<Arc<Vec<ExternalLink>>, ParseError> {
        self.file.links(self.group.address(), self.shown_path())
    }

    /// What the link `name` to another file leads to, if there is one.
    fn linked(&self, name: &str) -> Result<Option<Linked>, ParseError> {
        let links = self.links()?;
        let link = links.iter().find(|link| link.name == name);
        link.map(|link| self.follow(link)).transpose()
    }

    fn follow(&self, link: &ExternalLink) -> Result<Linked, ParseError> {
        let path = self.path_of(&link.name);
        let refused = |why: &str| {
            let target = format!("{path} is a link to `{}` in `{}`", link.path, link.file);
            ParseError::unsupported(format!("{target}, {why}"))
        };
        if self.file.is_other() {
            return Err(refused(
                "in a file that a link led to, and is not followed; link to the data itself",
            ));
        }
        let other = self
            .file
            .other(&link.file)
            .map_err(|e| e.map_message(|what| format!("{path} {what}")))?;
        let root = Self::root(&other)?;
        if let Some(node) = root.descend(&link.path)? {
            return Ok(Linked::Group(Self { path, ..node }));
        }
        match root.dataset_at(&link.path)? {
            Some(dataset) => Ok(Linked::Dataset(Box::new(dataset))),
            None => Err(refused("where it is not")),
        }
    }

    /// The numbers of an attribute; `None` if it is missing or has no numbers.
    pub(super) fn numbers(&self, name: &str) -> Option<Vec<f64>> {
        numbers(&self.attribute(name)?)
    }

    /// The first number of an attribute.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.numbers(name)?.first().copied()
    }

    /// The texts of an attribute that is an array of them; empty if it is not.
    pub(super) fn texts(&self, name: &str) -> Vec<String> {
        let texts = self.attribute(name).and_then(|attribute| attribute.read_strings().ok());
        texts.unwrap_or_default()
    }

    /// The text of an attribute, as one line.
    pub(super) fn text(&self, name: &str) -> Option<String> {
        text(&self.attribute(name)?)
    }

    /// An attribute, if there is one. Damage is reported to the file.
    fn attribute(&self, name: &str) -> Option<Attribute> {
        match self.group.attribute(name) {
            Ok(attribute) => Some(attribute),
            Err(Error::AttributeNotFound(_)) => None,
            Err(error) => {
                let address = self.group.address();
                self.file.report_attribute(&error, address, self.shown_path());
                None
            }
        }
    }

    fn shown_path(&self) -> &str {
        match self.path.as_str() {
            "" => "/",
            path => path,
        }
    }

    fn error(&self, error: &Error, path: &str) -> ParseError {
        self.file.error(error, self.group.address(), path)
    }
}

/// The first number of an attribute of a data set.
pub(super) fn dataset_number(dataset: &Dataset, name: &str) -> Option<f64> {
    numbers(&dataset.attribute(name).ok()?)?.first().copied()
}

/// The text of an attribute of a data set, as one line.
pub(super) fn dataset_text(dataset: &Dataset, name: &str) -> Option<String> {
    text(&dataset.attribute(name).ok()?)
}

fn numbers(attribute: &Attribute) -> Option<Vec<f64>> {
    let (scalar, endian) = stored_scalar(&attribute.datatype)?;
    let bytes = attribute.raw_data.chunks_exact(scalar.size());
    let count = usize::try_from(attribute.num_elements().ok()?).ok()?;
    let numbers = bytes.take(count.min(MAX_ATTRIBUTE_NUMBERS));
    Some(numbers.map(|number| scalar.decode_one(number, endian)).collect())
}

fn text(attribute: &Attribute) -> Option<String> {
    let text = match attribute.read_string() {
        Ok(text) => text,
        Err(_) => attribute.read_strings().ok()?.join(", "),
    };
    Some(one_line(text.trim().to_owned()))
}
