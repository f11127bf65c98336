//! Where the bytes of a data set are: shape, type, and storage, from its object header.

use std::sync::Arc;

use hdf5_reader::messages::HdfMessage;
use hdf5_reader::messages::filter_pipeline::FilterDescription;
use hdf5_reader::messages::layout::{ChunkIndexing, DataLayout};
use hdf5_reader::{Datatype, dtype_element_size};

use super::file::{H5File, ObjectKey};
use super::node::{Node, NodeDataset};
use super::virtual_list::VirtualPart;
use spherule_frame::ParseError;
use spherule_readers::read::CUT_SHORT;

/// A data set.
#[derive(Debug)]
pub(super) struct Stored {
    /// The file that has the values.
    pub(super) file: H5File,
    /// Path in the file.
    pub(super) path: String,
    /// Byte of the file at which its object header is, for messages.
    pub(super) at: usize,
    /// Numbers of elements along each dimension, the slowest first.
    pub(super) shape: Vec<u64>,
    /// Largest numbers of elements that the dimensions may have, `u64::MAX` if unlimited.
    pub(super) max_shape: Option<Vec<u64>>,
    pub(super) datatype: Datatype,
    /// Bytes of one element.
    pub(super) element_len: usize,
    pub(super) place: Storage,
}

/// How the elements are stored.
#[derive(Debug)]
pub(super) enum Storage {
    /// In the object header.
    Compact(Vec<u8>),
    /// All together, from this byte of the file on.
    Contiguous(usize),
    Chunked(ChunkedLayout),
    /// In other data sets.
    Virtual(Arc<Vec<VirtualPart>>),
    /// Space was never allocated.
    Missing,
}

/// A data set that is stored in chunks of equal shape.
#[derive(Debug)]
pub(super) struct ChunkedLayout {
    /// Address of the index of chunks.
    pub(super) index: u64,
    pub(super) indexing: Option<ChunkIndexing>,
    /// Numbers of elements of a chunk along each dimension.
    pub(super) chunk: Vec<u32>,
    pub(super) filters: Vec<FilterDescription>,
}

impl Stored {
    /// The data set `name` in `node`; `None` if there is none.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] for a damaged header, [`ParseError::Unsupported`] for values in other files.
    pub(super) fn open(node: &Node, name: &str) -> Result<Option<Self>, ParseError> {
        let Some(dataset) = node.dataset(name)? else {
            return Ok(None);
        };
        Self::of(&node.path_of(name), &dataset).map(Some)
    }

    /// `dataset`, whose path is `path`.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub(super) fn of(path: &str, dataset: &NodeDataset) -> Result<Self, ParseError> {
        let file = &dataset.file;
        let address = dataset.address();
        let element_len =
            dtype_element_size(dataset.dtype()).map_err(|e| file.error(&e, address, path))?;
        let mut stored = Self {
            file: file.clone(),
            at: file.place(address),
            shape: dataset.shape().to_vec(),
            max_shape: dataset.max_dims().map(<[u64]>::to_vec),
            datatype: dataset.dtype().clone(),
            element_len,
            place: Storage::Missing,
            path: file.named(path),
        };
        if let Some(parts) = file.virtual_parts(address) {
            stored.place = Storage::Virtual(parts);
            return Ok(stored);
        }
        // Find the messages about the storage
        let header = file.header(address, path)?;
        let (mut layout, mut filters) = (None, Vec::new());
        for message in &header.messages {
            match message {
                HdfMessage::DataLayout(message) => layout = Some(&message.layout),
                HdfMessage::FilterPipeline(pipeline) => filters.clone_from(&pipeline.filters),
                HdfMessage::ExternalFiles(_) => {
                    let what = format!(
                        "{}: its values are in another file, which is not read; copy it with `h5repack`",
                        stored.path
                    );
                    return Err(ParseError::unsupported(what));
                }
                _ => {}
            }
        }
        let is_undefined = |address: u64| {
            let size = u32::from(file.inner().superblock().offset_size) * 8;
            address == u64::MAX >> 64_u32.saturating_sub(size).min(63)
        };
        stored.place =
            match layout {
                Some(DataLayout::Compact { data }) => Storage::Compact(data.clone()),
                Some(
                    DataLayout::Contiguous { address, .. } | DataLayout::Chunked { address, .. },
                ) if is_undefined(*address) => Storage::Missing,
                Some(DataLayout::Contiguous { address, .. }) => {
                    let base = file.inner().superblock().base_address;
                    let start = address.checked_add(base);
                    let start = start.and_then(|start| usize::try_from(start).ok());
                    Storage::Contiguous(start.unwrap_or(usize::MAX))
                }
                Some(DataLayout::Chunked { address, dims, chunk_indexing, .. }) => {
                    // Old versions add the size of an element to the shape of a chunk.
                    let rank = stored.shape.len();
                    let extra = usize::from(dims.len() == rank + 1);
                    let chunk = dims[..dims.len() - extra].to_vec();
                    if chunk.len() != rank || chunk.contains(&0) {
                        return Err(stored
                            .bad(format!("a shape of {:?} in chunks of {chunk:?}", stored.shape)));
                    }
                    Storage::Chunked(ChunkedLayout {
                        index: *address,
                        indexing: chunk_indexing.clone(),
                        chunk,
                        filters,
                    })
                }
                None => Storage::Missing,
            };
        Ok(stored)
    }

    /// Equal for the same data set of the same open file.
    pub(super) fn key(&self) -> ObjectKey {
        self.file.key(self.at)
    }

    /// Number of elements; `None` if no file can have as many.
    pub(super) fn element_count(&self) -> Option<u64> {
        let mut sizes = self.shape.iter();
        sizes.try_fold(1_u64, |count, size| count.checked_mul(*size))
    }

    /// Bytes of all elements; `None` if no file can have as many.
    pub(super) fn byte_len(&self) -> Option<usize> {
        let count = usize::try_from(self.element_count()?).ok()?;
        count.checked_mul(self.element_len)
    }

    /// Whether all elements are in one range of the file or of the header, or can be counted if they are elsewhere.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if they are not all there.
    pub(super) fn check_whole(&self) -> Result<(), ParseError> {
        let (start, len) = match &self.place {
            Storage::Compact(bytes) => (0, bytes.len()),
            Storage::Contiguous(start) => (*start, self.file.bytes().len()),
            Storage::Virtual(_) if self.element_count().is_none() => {
                return Err(self.bad(format!("a virtual data set of shape {:?}", self.shape)));
            }
            Storage::Chunked(_) | Storage::Virtual(_) | Storage::Missing => return Ok(()),
        };
        let end = self.byte_len().and_then(|len| len.checked_add(start));
        if end.is_some_and(|end| end <= len) {
            return Ok(());
        }
        let (shape, element_len) = (&self.shape, self.element_len);
        Err(self.bad(format!(
            "{shape:?} elements of {element_len} bytes from byte {start} on, there are {len}: {CUT_SHORT}"
        )))
    }

    /// The error for values that were never written.
    pub(super) fn never_written(&self) -> ParseError {
        self.bad(format!("shape {:?}, but its values were never written: {CUT_SHORT}", self.shape))
    }

    /// The error `what` at the object header.
    pub(super) fn bad(&self, what: impl std::fmt::Display) -> ParseError {
        ParseError::malformed(self.at, format!("{}: {what}", self.path))
    }
}
