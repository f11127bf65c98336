//! An open HDF5 file, through the crate `hdf5-reader`, and the files that it refers to.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, RwLock};

use hdf5_reader::error::Error;
use hdf5_reader::group::Group;
use hdf5_reader::object_header::ObjectHeader;
use hdf5_reader::{Hdf5File, OpenOptions, Storage, StorageBuffer};

use super::flat_heap::FlatHeaps;
use super::global_heap::heap_object;
use super::header_patch::{Addressing, Patch, virtual_layout};
use super::links::{ExternalLink, external_links};
use super::members::{Lookups, Members};
use super::virtual_list::{VirtualPart, read_list};
use spherule_frame::ParseError;
use spherule_readers::read::CUT_SHORT;
use spherule_readers::shared::SharedBytes;

/// Most bytes of the header of one object. Those of simulations have some kibibytes.
const MAX_HEADER_BYTES: usize = 16 << 20;
/// Most virtual data sets of a file. The group is listed again for each of them, so time grows with the square.
const MAX_VIRTUAL: usize = 512;
/// Most parts of all virtual data sets of a file. Simulations have one for each file of a step and data set.
const MAX_PARTS: usize = 1 << 15;

/// Tells the groups and data sets of open files apart, whatever their names: address of the file in memory, place of
/// the object header in the file.
pub(super) type ObjectKey = (usize, usize);

/// An open file.
#[derive(Clone)]
pub(super) struct H5File {
    bytes: SharedBytes,
    file: Hdf5File,
    storage: Arc<PatchedStorage>,
    /// Whether it was opened for another file, which calls it so.
    name: Option<Arc<str>>,
    found: Arc<Mutex<Found>>,
}

/// What was looked up in a file.
#[derive(Default)]
struct Found {
    /// Lists of parts of virtual data sets by the addresses of their headers.
    virtual_parts: BTreeMap<u64, Arc<Vec<VirtualPart>>>,
    /// Links to other files by the addresses of their groups.
    links: BTreeMap<u64, Arc<Vec<ExternalLink>>>,
    /// Members of groups by the addresses of these.
    members: BTreeMap<u64, Lookups>,
    /// The first damaged attribute or heap of attributes.
    attribute_fault: Option<ParseError>,
    /// Open files by their names in this one.
    others: BTreeMap<String, H5File>,
}

/// The bytes of a file as `hdf5-reader` sees them.
struct PatchedStorage {
    bytes: SharedBytes,
    patches: RwLock<Vec<Patch>>,
    heaps: Mutex<FlatHeaps>,
    /// Byte of the file at which address 0 is.
    base: OnceLock<u64>,
}

impl Storage for PatchedStorage {
    fn len(&self) -> u64 {
        self.bytes.len() as u64
    }

    fn read_range(&self, offset: u64, len: usize) -> Result<StorageBuffer, Error> {
        let mut heaps = self.heaps.lock().unwrap_or_else(PoisonError::into_inner);
        let base = self.base.get().copied().unwrap_or(0);
        if let Some(shown) = heaps.shown(&self.bytes, base, offset, len)? {
            return Ok(shown);
        }
        drop(heaps);
        let start = usize::try_from(offset).map_err(|_| Error::OffsetOutOfBounds(offset))?;
        let buffer = StorageBuffer::from_shared_owner(self.bytes.owner(), start, len)?;
        let patches = self.patches.read().unwrap_or_else(PoisonError::into_inner);
        let range = offset..offset.saturating_add(len as u64);
        if !patches.iter().any(|patch| patch.touches(&range)) {
            return Ok(buffer);
        }
        let mut patched = buffer.to_vec();
        for patch in &*patches {
            patch.apply(offset, &mut patched);
        }
        Ok(StorageBuffer::from_vec(patched))
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
            .with_max_object_header_bytes(MAX_HEADER_BYTES);
        let storage = Arc::new(PatchedStorage {
            bytes: bytes.clone(),
            patches: RwLock::default(),
            heaps: Mutex::default(),
            base: OnceLock::new(),
        });
        let file = Hdf5File::from_storage_with_options(storage.clone(), options)
            .map_err(|e| parse_error(&e, bytes.len(), 0))?;
        storage.base.get_or_init(|| file.superblock().base_address);
        let stated = file.superblock().eof_address;
        if stated > bytes.len() as u64 {
            let what = format!("the superblock states {stated} bytes: {CUT_SHORT}");
            return Err(ParseError::malformed(bytes.len(), what));
        }
        Ok(Self { bytes: bytes.clone(), file, storage, name: None, found: Arc::default() })
    }

    /// Whether `other` is this file.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        std::ptr::eq(self.bytes(), other.bytes())
    }

    /// The key of the object whose header is at byte `at`.
    pub(super) fn key(&self, at: usize) -> ObjectKey {
        (self.bytes().as_ptr().addr(), at)
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

    fn found(&self) -> MutexGuard<'_, Found> {
        self.found.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The file that is called `name` in this one; `.` is this one.
    ///
    /// # Errors
    /// [`ParseError`] that names it, if it is not beside this one or is damaged.
    pub(super) fn other(&self, name: &str) -> Result<Self, ParseError> {
        if name == "." {
            return Ok(self.clone());
        }
        if let Some(other) = self.found().others.get(name) {
            return Ok(other.clone());
        }
        let bytes = self.bytes.sibling(name)?;
        let other =
            Self::open(&bytes).map_err(|e| e.map_message(|what| format!("in `{name}`: {what}")))?;
        let other = Self { name: Some(name.into()), ..other };
        self.found().others.insert(name.to_owned(), other.clone());
        Ok(other)
    }

    /// Whether it was opened because another file refers to it. Its own links are not followed then, so that files
    /// that refer to each other come to an end.
    pub(super) const fn is_other(&self) -> bool {
        self.name.is_some()
    }

    /// Names of the files that were met, as they are called in this one.
    pub(super) fn other_names(&self) -> BTreeSet<String> {
        let found = self.found();
        let parts = found
            .virtual_parts
            .values()
            .flat_map(|parts| parts.iter())
            .map(|part| part.file.to_string());
        let names = parts.chain(found.others.keys().cloned());
        names.filter(|name| name != ".").collect()
    }

    /// Opens the files that were met, and those that were met in these, as far as they exist.
    pub(super) fn open_others(&self) {
        for name in self.other_names() {
            let Ok(other) = self.other(&name) else {
                continue;
            };
            for name in other.other_names() {
                let _ = other.other(&name);
            }
        }
    }

    /// The links to other files in the group at `address` with the name `path`.
    ///
    /// # Errors
    /// [`ParseError::Malformed`].
    pub(super) fn links(
        &self,
        address: u64,
        path: &str,
    ) -> Result<Arc<Vec<ExternalLink>>, ParseError> {
        if let Some(links) = self.found().links.get(&address) {
            return Ok(Arc::clone(links));
        }
        let header = self.header(address, path)?;
        let links = external_links(&self.file, &header);
        let links = Arc::new(links.map_err(|e| self.error(&e, address, path))?);
        self.found().links.insert(address, Arc::clone(&links));
        Ok(links)
    }

    /// All members of `group`, if many of its names have been looked up.
    pub(super) fn members(&self, group: &Group) -> Option<Arc<Members>> {
        let mut found = self.found();
        let lookups = found.members.entry(group.address()).or_default();
        lookups.next(group)
    }

    /// Remembers damage of the attributes of the object at `address` with the name `path`. Attributes of types that
    /// are not read count as missing.
    pub(super) fn report_attribute(&self, error: &Error, address: u64, path: &str) {
        let fault = self.error(error, address, &format!("attributes of {path}"));
        if matches!(fault, ParseError::Malformed { .. }) {
            self.found().attribute_fault.get_or_insert(fault);
        }
    }

    /// Fails if attributes that were looked up, in this file or in those that it refers to, are damaged.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] with the name of their object.
    pub(super) fn check_attributes(&self) -> Result<(), ParseError> {
        let found = self.found();
        if let Some(fault) = &found.attribute_fault {
            return Err(fault.clone());
        }
        let others = found.others.values().cloned().collect::<Vec<_>>();
        drop(found);
        others.iter().try_for_each(Self::check_attributes)
    }

    /// The parts of the data set whose header is at `address`, if it is virtual and was met before.
    pub(super) fn virtual_parts(&self, address: u64) -> Option<Arc<Vec<VirtualPart>>> {
        self.found().virtual_parts.get(&address).cloned()
    }

    /// What `ask` gives when all virtual data sets that it meets are shown to the library as empty ones. `path` is for
    /// messages.
    ///
    /// # Errors
    /// [`ParseError`] if the list of the parts of one is damaged.
    pub(super) fn with_virtual<T>(
        &self,
        path: &str,
        ask: impl Fn() -> Result<T, Error>,
    ) -> Result<Result<T, Error>, ParseError> {
        loop {
            match ask() {
                Err(error) => match virtual_address(&error) {
                    Some(address) if self.virtual_parts(address).is_none() => {
                        let shown = self.show_virtual(address);
                        shown.map_err(|e| self.error(&e, address, path))?;
                    }
                    _ => return Ok(Err(error)),
                },
                Ok(answer) => return Ok(Ok(answer)),
            }
        }
    }

    /// Reads the list of the virtual data set whose header is at `address`, and shows the header as that of an empty
    /// data set.
    fn show_virtual(&self, address: u64) -> Result<(), Error> {
        let superblock = self.file.superblock();
        let addressing = Addressing {
            offset_size: superblock.offset_size,
            length_size: superblock.length_size,
            base: superblock.base_address,
        };
        let found = virtual_layout(&self.bytes, address, addressing)?;
        let (place, patches) = found.ok_or(Error::UnsupportedLayoutClass(3))?;
        // Read the list, within what is left of the limits
        let (known, used) = {
            let all = &self.found().virtual_parts;
            (all.len(), all.values().map(|parts| parts.len()).sum())
        };
        if known >= MAX_VIRTUAL {
            let what = format!("more than {MAX_VIRTUAL} virtual data sets");
            return Err(Error::UnsupportedEncoding(what));
        }
        let list = heap_object(&self.bytes, place, addressing)?;
        let missing = || Error::InvalidData("the list of a virtual data set is missing".into());
        let left = MAX_PARTS.saturating_sub(used);
        let parts = read_list(list.ok_or_else(missing)?, addressing.length_size, left)?;
        // Show another header
        let shown = &self.storage.patches;
        let mut shown = shown.write().unwrap_or_else(PoisonError::into_inner);
        shown.extend(patches);
        self.found().virtual_parts.insert(address, Arc::new(parts));
        Ok(())
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
        let path = self.named(path);
        error.map_message(|what| format!("{path}: {what}"))
    }

    /// `path`, with the name of this file if another one refers to it.
    pub(super) fn named(&self, path: &str) -> String {
        match &self.name {
            Some(name) => format!("in `{name}`: {path}"),
            None => path.to_owned(),
        }
    }
}

/// `error` at byte `at` of a file of `len` bytes.
fn parse_error(error: &Error, len: usize, at: usize) -> ParseError {
    let mut root = error;
    while let Error::Context { source, .. } = root {
        root = source;
    }
    match root {
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

/// The address of the header of a virtual data set, if `error` is that it is one.
fn virtual_address(error: &Error) -> Option<u64> {
    // The library gives it as text only
    let (mut innermost, mut root) = (None, error);
    while let Error::Context { path, source } = root {
        innermost = Some(path);
        root = source;
    }
    match root {
        Error::UnsupportedLayoutClass(3) => {
            let (_, address) = innermost?.rsplit_once("at 0x")?;
            u64::from_str_radix(address, 16).ok()
        }
        _ => None,
    }
}
