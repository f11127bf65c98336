//! HDF5 files of particle simulations, through the crate `hdf5-reader`.
//!
//! ```text
//! file.h5 -> formats -> [hdf5] -> RawParticles
//! ```
//!
//! The layout of groups and data sets tells the dialect: `gadget`, `h5md`, `h5part`, `openpmd`, `pysph`, `vtkhdf`, and
//! `plain` for names alone. A dialect lists the time steps and finds the values of each (`dialect`, `properties`). The values are data
//! sets, or parts of them (`values`), in one piece or in chunks (`chunks`), which are decoded in parallel. `table`
//! joins the parts of a step. Nothing is allocated before the shapes agree with the storage and with a budget.
//!
//! `spherule-formats` finds out that a file is one of HDF5, and reads it with [`FORMAT`]:
//!
//! ```
//! let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/hdf5/cell-moving.h5md");
//! let bytes = std::fs::read(file)?;
//! let steps = spherule_hdf5::FORMAT.steps(&bytes)?;
//! let particles = spherule_hdf5::FORMAT.read(&bytes, &steps[0])?;
//! assert!(particles.cell.is_some() && !particles.positions.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![deny(unsafe_code)]

mod band_cache;
#[cfg(test)]
mod cell_tests;
mod chunks;
mod dialect;
mod file;
mod flat_heap;
mod gadget;
mod global_heap;
mod h5md;
mod h5part;
mod header_patch;
mod links;
mod members;
mod node;
mod openpmd;
mod piece;
mod plain;
mod properties;
mod pysph;
mod ranges;
mod slice;
mod stored;
mod table;
mod types;
mod values;
mod virtual_list;
mod virtual_rows;
mod vtkhdf;

use self::dialect::{Dialect, listed};
use self::file::H5File;
use self::gadget::Snapshot;
use self::h5md::Trajectory;
use self::h5part::StepGroups;
use self::node::Node;
use self::openpmd::OpenPmd;
use self::plain::PlainFile;
use self::pysph::ParticleArrays;
use self::ranges::TableRanges;
use self::vtkhdf::VtkHdf;
use spherule_frame::{MemoryBudget, ParseError, RawParticles};
use spherule_readers::Format;
use spherule_readers::hdf5_signature::is_hdf5;
use spherule_readers::ranges::ParticleRanges;
use spherule_readers::read::{ByteSource, Step};
use spherule_readers::shared::SharedBytes;
use spherule_readers::{Confidence, FileExtent, FormatInfo, Reader, ValueNames};

/// HDF5 files of particles.
pub const FORMAT: Format = Format::new(&Hdf5);

struct Hdf5;

impl Reader for Hdf5 {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            may_hold_many_steps: true,
            notes_need_whole_file: true,
            may_refer_to_files: true,
            ..FormatInfo::new(
                "hdf5",
                &["hdf5", "h5", "hdf", "he5", "vtkhdf", "h5part", "h5p", "h5md"],
            )
        }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        Ok(Confidence::signature_if(is_hdf5(head)))
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        let file = OpenFile::open(&source.to_shared())?;
        let infos = file.checked(file.dialect.steps(budget))?;
        // Numbers that do not increase say nothing about the order
        let is_numbered = infos.iter().all(|info| info.number.is_some())
            && infos.is_sorted_by(|a, b| a.number < b.number);
        let mut steps = Vec::new();
        for info in infos {
            Step::push_with_key(&mut steps, 0, budget)?;
            if let Some(step) = steps.last_mut() {
                step.number = info.number.filter(|_| is_numbered);
                step.time = info.time;
            }
        }
        Ok(steps)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let file = OpenFile::open(&source.to_shared())?;
        let table = file.checked(file.dialect.table(step.index, budget))?;
        table.read_all(budget)
    }

    fn ranges(&self, file: &SharedBytes) -> Result<Option<Box<dyn ParticleRanges>>, ParseError> {
        let file = OpenFile::open(file)?;
        if file.dialect.steps(MemoryBudget::UNLIMITED)?.len() != 1 {
            return Ok(None);
        }
        let table = file.checked(file.dialect.table(0, MemoryBudget::UNLIMITED))?;
        Ok(Some(Box::new(TableRanges::new(table))))
    }

    /// Some chunks that are decoded at the same time.
    fn unpacked_arrays_len(&self, _head: &[u8], file: FileExtent, particles: &RawParticles) -> u64 {
        const CHUNKS_LEN: u64 = 32 << 20;
        let all_steps = particles.byte_len().saturating_mul(file.step_count);
        if file.byte_len < all_steps { particles.largest_array_len().min(CHUNKS_LEN) } else { 0 }
    }

    fn piece_count(&self, file: &SharedBytes) -> u64 {
        let root = H5File::open(file).and_then(|file| Node::root(&file));
        root.map_or(1, |root| gadget::file_count(&root))
    }

    fn refers_to_pieces(&self, file: &SharedBytes) -> bool {
        let root = H5File::open(file).and_then(|file| Node::root(&file));
        root.is_ok_and(|root| gadget::is_virtual(&root))
    }

    fn value_names(&self, file: &SharedBytes) -> Vec<ValueNames> {
        OpenFile::open(file).map_or_else(|_| Vec::new(), |open| open.dialect.value_names())
    }

    fn notes_of_file(&self, file: &SharedBytes) -> Vec<String> {
        let Ok(OpenFile { file, dialect }) = OpenFile::open(file) else {
            return Vec::new();
        };
        let mut notes = dialect.notes();
        if let Ok(table) = dialect.table(0, MemoryBudget::UNLIMITED) {
            if table.has_integer_positions() {
                notes.push("positions are stored as integers, and used as they are".to_owned());
            }
            notes.extend_from_slice(table.notes());
        }
        let others = Vec::from_iter(file.other_names());
        if !others.is_empty() {
            notes.push(format!("refers to other files: {}", listed(&others)));
        }
        notes
    }

    fn open_referenced(&self, file: &SharedBytes) {
        let Ok(OpenFile { file, dialect }) = OpenFile::open(file) else {
            return;
        };
        // What is looked up on the way tells the files
        let unlimited = MemoryBudget::UNLIMITED;
        let steps = dialect.steps(unlimited).map_or(0, |steps| steps.len());
        for step in [0, steps.saturating_sub(1)] {
            let _ = dialect.table(step, unlimited);
        }
        file.open_others();
    }
}

/// An open file and its layout.
struct OpenFile {
    file: H5File,
    dialect: Box<dyn Dialect>,
}

impl OpenFile {
    /// Opens the file `bytes`.
    fn open(bytes: &SharedBytes) -> Result<Self, ParseError> {
        let file = H5File::open(bytes)?;
        let dialect = dialect_in(&Node::root(&file)?);
        file.check_attributes()?;
        Ok(Self { dialect: dialect?, file })
    }

    /// `answer` of the layout, or damage of attributes that were looked up for it. These count as missing until here.
    fn checked<T>(&self, answer: Result<T, ParseError>) -> Result<T, ParseError> {
        self.file.check_attributes()?;
        answer
    }
}

fn dialect_in(root: &Node) -> Result<Box<dyn Dialect>, ParseError> {
    if let Some(points) = VtkHdf::open(root)? {
        return Ok(Box::new(points));
    }
    if let Some(iterations) = OpenPmd::open(root)? {
        return Ok(Box::new(iterations));
    }
    if let Some(trajectory) = Trajectory::open(root)? {
        return Ok(Box::new(trajectory));
    }
    if let Some(steps) = StepGroups::open(root)? {
        return Ok(Box::new(steps));
    }
    if let Some(snapshot) = Snapshot::open(root)? {
        return Ok(Box::new(snapshot));
    }
    if let Some(arrays) = ParticleArrays::open(root)? {
        return Ok(Box::new(arrays));
    }
    // Alembic keeps everything below this group
    if root.group("ABC")?.is_some() {
        let what = "an Alembic file in HDF5, which is not read; export the points as .ply or .bgeo";
        return Err(ParseError::unsupported(what));
    }
    Ok(Box::new(PlainFile::open(root)?))
}
