//! Links of a group to other files.

use hdf5_reader::btree_v2::{BTreeV2Header, BTreeV2Record, collect_btree_v2_records_storage};
use hdf5_reader::error::Error;
use hdf5_reader::fractal_heap::{FractalHeap, FractalHeapDirectBlockCache};
use hdf5_reader::io::Cursor;
use hdf5_reader::messages::HdfMessage;
use hdf5_reader::messages::link::{self, LinkMessage, LinkTarget};
use hdf5_reader::messages::link_info::LinkInfoMessage;
use hdf5_reader::object_header::ObjectHeader;
use hdf5_reader::{Hdf5File, Storage};

/// A link to another file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ExternalLink {
    pub(super) name: String,
    /// The file as it is called in this one.
    pub(super) file: String,
    /// Path of the object in that file.
    pub(super) path: String,
}

/// The links to other files in the group with `header`. Groups of the old kind have none.
///
/// # Errors
/// [`Error`] if the links are damaged.
pub(super) fn external_links(
    file: &Hdf5File,
    header: &ObjectHeader,
) -> Result<Vec<ExternalLink>, Error> {
    let mut links = Vec::new();
    for message in &header.messages {
        match message {
            HdfMessage::Link(link) => links.extend(external(link)),
            HdfMessage::LinkInfo(info) => {
                let size = file.superblock().offset_size;
                if !Cursor::is_undefined_offset(info.fractal_heap_address, size) {
                    links.extend(heap_links(file, info)?);
                }
            }
            _ => {}
        }
    }
    Ok(links)
}

fn external(link: &LinkMessage) -> Option<ExternalLink> {
    match &link.target {
        LinkTarget::External { filename, path } => Some(ExternalLink {
            name: link.name.clone(),
            file: filename.clone(),
            path: path.clone(),
        }),
        _ => None,
    }
}

/// Those of a group with many links, which are in a heap.
fn heap_links(file: &Hdf5File, info: &LinkInfoMessage) -> Result<Vec<ExternalLink>, Error> {
    let storage: &dyn Storage = file.storage();
    let (offsets, lengths) = {
        let superblock = file.superblock();
        (superblock.offset_size, superblock.length_size)
    };
    let heap = FractalHeap::parse_at_storage(storage, info.fractal_heap_address, offsets, lengths)?;
    let index = info.btree_name_index_address;
    let index = BTreeV2Header::parse_at_storage(storage, index, offsets, lengths)?;
    let records =
        collect_btree_v2_records_storage(storage, &index, offsets, lengths, None, &[], None)?;
    let mut blocks = FractalHeapDirectBlockCache::default();
    let mut links = Vec::new();
    for record in &records {
        let BTreeV2Record::LinkNameHash { heap_id, .. } = record else {
            continue;
        };
        let bytes =
            heap.get_object_storage_cached(heap_id, storage, offsets, lengths, &mut blocks)?;
        let link = link::parse(&mut Cursor::new(&bytes), offsets, lengths, bytes.len())?;
        links.extend(external(&link));
    }
    Ok(links)
}
