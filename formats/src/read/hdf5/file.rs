//! Groups and attributes of an HDF5 file, through the crate `hdf5-reader`, with the errors of this crate.

use std::fmt;
use std::sync::Arc;

use hdf5_reader::error::Error;
use hdf5_reader::group::Group;
use hdf5_reader::messages::HdfMessage;
use hdf5_reader::messages::link::LinkTarget;
use hdf5_reader::object_header::ObjectHeader;
use hdf5_reader::{Attribute, Dataset, Hdf5File, OpenOptions, Storage, StorageBuffer};

use super::types::stored_scalar;
use crate::ParseError;
use crate::message::one_line;
use crate::read::CUT_SHORT;
use crate::shared::SharedBytes;

/// Most bytes of the header of one object. Those of simulations have some kibibytes.
const MOST_HEADER_BYTES: usize = 16 << 20;
/// Most numbers of an attribute that are read.
const MOST_ATTRIBUTE_NUMBERS: usize = 1 << 16;

/// An open file.
#[derive(Clone)]
pub(super) struct H5File {
    bytes: SharedBytes,
    file: Hdf5File,
}

/// The bytes of a file for `hdf5-reader`.
struct SharedStorage(SharedBytes);

impl Storage for SharedStorage {
    fn len(&self) -> u64 {
        self.0.len() as u64
    }

    fn read_range(&self, offset: u64, len: usize) -> Result<StorageBuffer, Error> {
        let start = usize::try_from(offset).map_err(|_| Error::OffsetOutOfBounds(offset))?;
        StorageBuffer::from_shared_owner(self.0.owner(), start, len)
    }
}

impl fmt::Debug for H5File {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.bytes.fmt(f)
    }
}

impl H5File {
    /// Opens `bytes`.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if the file is damaged or cut short.
    pub(super) fn open(bytes: &SharedBytes) -> Result<Self, ParseError> {
        let options = OpenOptions::default()
            .with_chunk_cache_bytes(0)
            .with_max_object_header_bytes(MOST_HEADER_BYTES);
        let storage = Arc::new(SharedStorage(bytes.clone()));
        let file = Hdf5File::from_storage_with_options(storage, options);
        let file = file.map_err(|e| parse_error(&e, bytes.len(), 0))?;
        let stated = file.superblock().eof_address;
        if stated > bytes.len() as u64 {
            let what = format!("the superblock states {stated} bytes: {CUT_SHORT}");
            return Err(ParseError::malformed(bytes.len(), what));
        }
        Ok(Self {
            bytes: bytes.clone(),
            file,
        })
    }

    /// Whether `other` is this file.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        std::ptr::eq(self.bytes(), other.bytes())
    }

    /// All bytes.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The file as `hdf5-reader` has it.
    pub(super) const fn inner(&self) -> &Hdf5File {
        &self.file
    }

    /// The byte at `address`, which counts from the superblock; at most the end of the file.
    pub(super) fn place(&self, address: u64) -> usize {
        let place = address.saturating_add(self.file.superblock().base_address);
        usize::try_from(place).map_or(self.bytes.len(), |place| place.min(self.bytes.len()))
    }

    /// The root group.
    ///
    /// # Errors
    /// [`ParseError::Malformed`].
    pub(super) fn root(&self) -> Result<Node, ParseError> {
        let group = self.file.root_group();
        let group = group.map_err(|e| parse_error(&e, self.bytes.len(), 0))?;
        Ok(Node {
            file: self.clone(),
            group,
            path: String::new(),
        })
    }

    /// The header of the object at `address`.
    ///
    /// # Errors
    /// [`ParseError`] that begins with `path`.
    pub(super) fn header(&self, address: u64, path: &str) -> Result<Arc<ObjectHeader>, ParseError> {
        let header = self.file.get_or_parse_header(address);
        header.map_err(|e| self.error(&e, address, path))
    }

    /// `error` of the object at `address` with the name `path`.
    pub(super) fn error(&self, error: &Error, address: u64, path: &str) -> ParseError {
        let error = parse_error(error, self.bytes.len(), self.place(address));
        error.map_message(|what| format!("{path}: {what}"))
    }
}

/// `error` at byte `at` of a file of `len` bytes.
fn parse_error(error: &Error, len: usize, at: usize) -> ParseError {
    let mut root = error;
    while let Error::Context { source, .. } = root {
        root = source;
    }
    match root {
        Error::UnsupportedLayoutClass(3) => ParseError::unsupported(
            "a virtual data set, which is not read: its values are in other files; give these, or copy it to a \
             file of its own with h5py",
        ),
        Error::UnsupportedFilter(what) | Error::UnsupportedEncoding(what) => {
            ParseError::unsupported(format!(
                "HDF5 with {what}, which is not read; repack the file with `h5repack -f GZIP=4`"
            ))
        }
        Error::ResourceLimit(what) => ParseError::too_large(what.clone()),
        Error::UnexpectedEof { .. } => ParseError::malformed(at, format!("{root}: {CUT_SHORT}")),
        _ => ParseError::malformed(at.min(len), format!("damaged HDF5: {root}")),
    }
}

/// A group.
#[derive(Clone)]
pub(super) struct Node {
    file: H5File,
    group: Group,
    path: String,
}

impl Node {
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
    /// [`ParseError`] if the group is damaged.
    pub(super) fn members(&self) -> Result<(Vec<String>, Vec<String>), ParseError> {
        let names = self.group.member_names();
        let (mut groups, mut datasets) = names.map_err(|e| self.error(&e))?;
        groups.sort();
        datasets.sort();
        Ok((groups, datasets))
    }

    /// The group `name`, if there is one.
    ///
    /// # Errors
    /// As [`Self::members`].
    pub(super) fn group(&self, name: &str) -> Result<Option<Self>, ParseError> {
        match self.group.group(name) {
            Ok(group) => Ok(Some(Self {
                file: self.file.clone(),
                group,
                path: self.path_of(name),
            })),
            Err(Error::GroupNotFound(_)) => Ok(None),
            Err(e) => Err(self
                .file
                .error(&e, self.group.address(), &self.path_of(name))),
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
    pub(super) fn dataset(&self, name: &str) -> Result<Option<Dataset>, ParseError> {
        match self.group.dataset(name) {
            Ok(dataset) => Ok(Some(dataset)),
            Err(Error::DatasetNotFound(_)) => Ok(None),
            Err(e) => Err(self
                .file
                .error(&e, self.group.address(), &self.path_of(name))),
        }
    }

    /// Links to other files, which are not followed: file and name there.
    pub(super) fn external_links(&self) -> Vec<String> {
        let Ok(header) = self.file.file.get_or_parse_header(self.group.address()) else {
            return Vec::new();
        };
        let links = header.messages.iter().filter_map(|message| match message {
            HdfMessage::Link(link) => match &link.target {
                LinkTarget::External { filename, .. } => {
                    Some(format!("{} in {filename}", self.path_of(&link.name)))
                }
                _ => None,
            },
            _ => None,
        });
        links.collect()
    }

    /// The numbers of an attribute; `None` if it is missing or has no numbers.
    pub(super) fn numbers(&self, name: &str) -> Option<Vec<f64>> {
        numbers(&self.group.attribute(name).ok()?)
    }

    /// The first number of an attribute.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.numbers(name)?.first().copied()
    }

    /// The texts of an attribute that is an array of them; empty if it is not.
    pub(super) fn texts(&self, name: &str) -> Vec<String> {
        let attribute = self.group.attribute(name).ok();
        let texts = attribute.and_then(|attribute| attribute.read_strings().ok());
        texts.unwrap_or_default()
    }

    /// The text of an attribute, as one line.
    pub(super) fn text(&self, name: &str) -> Option<String> {
        text(&self.group.attribute(name).ok()?)
    }

    fn error(&self, error: &Error) -> ParseError {
        let path = if self.path.is_empty() {
            "/"
        } else {
            &self.path
        };
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
    let numbers = bytes.take(count.min(MOST_ATTRIBUTE_NUMBERS));
    Some(
        numbers
            .map(|number| scalar.decode_one(number, endian))
            .collect(),
    )
}

fn text(attribute: &Attribute) -> Option<String> {
    let text = match attribute.read_string() {
        Ok(text) => text,
        Err(_) => attribute.read_strings().ok()?.join(", "),
    };
    Some(one_line(text.trim().to_owned()))
}
