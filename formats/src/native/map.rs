//! Memory-mapped files: the only module of the crate with a memory map.
//!
//! Another process may truncate a file while it is mapped; an access to a missing page then raises a signal
//! that ends the process. This module replaces such pages with zeros and marks the file as lost. The caller
//! detects the loss afterwards, and one frame fails instead of the whole job.
#![expect(unsafe_code, reason = "mapping has no safe form; every block says why it is sound")]

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use memmap2::Mmap;
use rkyv::util::AlignedVec;

use super::NativeFrame;
use super::layout::{FrameIndex, parse};
use crate::{FrameError, ParseError};
use spherule_readers::regular::regular_len;

/// How to access the bytes of a native frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Access {
    /// Map the file: opening is O(1), and pages are loaded on first access.
    #[default]
    Map,
    /// Read the whole file: for file systems where a file may be truncated while it is in use.
    Read,
}

/// A memory-mapped file.
#[derive(Debug)]
pub struct MappedFile {
    path: PathBuf,
    file: File,
    modified: Option<SystemTime>,
    // Declared before the map, so that it is dropped first.
    guard: guard::Guard,
    map: Mmap,
}

impl MappedFile {
    /// Maps the file at `path`.
    ///
    /// # Errors
    /// [`FrameError`] if it cannot be opened or is not a regular file.
    pub fn open(path: &Path) -> Result<Self, FrameError> {
        let io = |e| FrameError::io(path, e);
        // Opening a pipe would block until it has a writer.
        regular_len(path)?;
        let file = File::open(path).map_err(io)?;
        let meta = file.metadata().map_err(io)?;
        if !meta.is_file() {
            return Err(ParseError::unsupported("no regular file").in_file(path));
        }
        let map = map(&file).map_err(io)?;
        Ok(Self {
            path: path.to_owned(),
            modified: meta.modified().ok(),
            guard: guard::Guard::over(&map),
            file,
            map,
        })
    }

    /// The path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The bytes. If the file was truncated, some of them may be zeros that were never in the file: call
    /// [`Self::check`] after use.
    pub fn bytes(&self) -> &[u8] {
        &self.map
    }

    /// Announces sequential access, so that the system reads ahead and releases pages that were read. This is
    /// only a hint, which affects nothing but speed.
    pub(crate) fn advise_sequential(&self) {
        #[cfg(unix)]
        let _ = self.map.advise(memmap2::Advice::Sequential);
    }

    /// Checks that the file is still the one that was mapped. Call it before use, and again after use before
    /// relying on the results.
    ///
    /// # Errors
    /// [`FrameError::Malformed`] if the length or the modification time differs, or if bytes were lost.
    pub fn check(&self) -> Result<(), FrameError> {
        let meta = self.file.metadata().map_err(|e| FrameError::io(&self.path, e))?;
        let (now, then) = (meta.len(), self.map.len() as u64);
        let what = if now != then {
            format!("the file had {then} bytes when it was mapped and has {now} now")
        } else if self.guard.has_lost() {
            "the file was cut short while it was mapped".to_owned()
        } else if meta.modified().ok() != self.modified {
            "the file was written to while it was mapped".to_owned()
        } else {
            return Ok(());
        };
        let what =
            format!("{what}; do not change it during the run, or read it instead of mapping it");
        Err(ParseError::malformed(0, what).in_file(&self.path))
    }
}

impl AsRef<[u8]> for MappedFile {
    fn as_ref(&self) -> &[u8] {
        self.bytes()
    }
}

/// An opened native frame; [`Self::frame`] gives the view of its particles.
#[derive(Debug)]
pub struct NativeFile {
    path: PathBuf,
    bytes: FileBytes,
    index: FrameIndex,
}

#[derive(Debug)]
enum FileBytes {
    Mapped(MappedFile),
    /// Aligned like sections, see [`super::layout::ALIGN`].
    Read(AlignedVec<64>),
}

impl NativeFile {
    /// Opens the native frame at `path`. Checks the header and the index, not the sections.
    ///
    /// # Errors
    /// [`FrameError`] if the file cannot be read, is damaged or truncated, or has another version.
    pub fn open(path: &Path, access: Access) -> Result<Self, FrameError> {
        let bytes = match access {
            Access::Map => FileBytes::Mapped(MappedFile::open(path)?),
            Access::Read => FileBytes::Read(read(path)?),
        };
        let index = parse(bytes.as_slice()).map_err(|e| e.in_file(path))?;
        Ok(Self { path: path.to_owned(), bytes, index })
    }

    /// The path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The index of the file.
    pub const fn index(&self) -> &FrameIndex {
        &self.index
    }

    /// Length of the file, bytes.
    pub fn byte_len(&self) -> u64 {
        self.bytes.as_slice().len() as u64
    }

    /// Whether the file is mapped, and not read into memory.
    pub const fn is_mapped(&self) -> bool {
        matches!(self.bytes, FileBytes::Mapped(_))
    }

    /// The particles, in place. Call it for every use: it checks again that a mapped file has not changed.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn frame(&self) -> Result<NativeFrame<'_>, FrameError> {
        self.check()?;
        Ok(self.frame_unchecked())
    }

    /// [`Self::frame`] without the check, for short accesses between two checks.
    pub fn frame_unchecked(&self) -> NativeFrame<'_> {
        NativeFrame::with_index(self.bytes.as_slice(), &self.index)
    }

    /// Checks that a mapped file has not changed, see [`MappedFile::check`].
    ///
    /// # Errors
    /// [`FrameError::Malformed`] if the file changed.
    pub fn check(&self) -> Result<(), FrameError> {
        match &self.bytes {
            FileBytes::Mapped(file) => file.check(),
            FileBytes::Read(_) => Ok(()),
        }
    }
}

impl FileBytes {
    fn as_slice(&self) -> &[u8] {
        match self {
            Self::Mapped(file) => file.bytes(),
            Self::Read(bytes) => bytes,
        }
    }
}

/// Reads the whole file into memory that is aligned like its sections.
///
/// # Errors
/// [`FrameError`] if it cannot be read or is not a regular file.
pub(crate) fn read(path: &Path) -> Result<AlignedVec<64>, FrameError> {
    let io = |e| FrameError::io(path, e);
    regular_len(path)?;
    let mut file = File::open(path).map_err(io)?;
    let meta = file.metadata().map_err(io)?;
    if !meta.is_file() {
        return Err(ParseError::unsupported("no regular file").in_file(path));
    }
    let out_of_memory = || FrameError::io(path, io::ErrorKind::OutOfMemory.into());
    let len = usize::try_from(meta.len()).map_err(|_| out_of_memory())?;
    let mut bytes = AlignedVec::with_capacity(len);
    bytes.resize(len, 0);
    file.read_exact(&mut bytes).map_err(io)?;
    Ok(bytes)
}

/// Maps `file`, which must not change while the map lives.
///
/// Native frames are published by rename and never written in place, so that only another program can change
/// one. [`MappedFile::check`] compares the length and the modification time; missing pages read as zeros (see
/// `guard`). The contents are plain numbers, which are valid for any bit pattern and are never used as
/// unchecked indices. A change between two reads therefore gives a wrong picture, which the check detects, or
/// at worst an error that fails the frame.
fn map(file: &File) -> io::Result<Mmap> {
    // SAFETY: `Mmap::map` needs the file not to change while it is mapped. The doc comment above states what
    // guards against a change, and why a change affects nothing but numbers.
    unsafe { Mmap::map(file) }
}

#[cfg(all(target_os = "linux", not(miri)))]
mod guard {
    //! Handles accesses to missing pages of a truncated file: the kernel raises SIGBUS for such a page. The
    //! handler maps a page of zeros in its place and records the loss.

    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

    /// Largest number of maps that are watched at a time; the stages of a pipeline hold fewer.
    const REGIONS: usize = 64;

    struct Region {
        /// First address; 0 if the entry is free, 1 while it is being claimed.
        start: AtomicUsize,
        end: AtomicUsize,
        lost: AtomicBool,
    }

    static REGION: [Region; REGIONS] = [const {
        Region {
            start: AtomicUsize::new(0),
            end: AtomicUsize::new(0),
            lost: AtomicBool::new(false),
        }
    }; REGIONS];

    struct Installed {
        page: usize,
        before: libc::sigaction,
    }

    static INSTALLED: OnceLock<Option<Installed>> = OnceLock::new();

    /// Watches a map for as long as the map lives.
    #[derive(Debug)]
    pub(super) struct Guard {
        place: Option<usize>,
    }

    impl Guard {
        pub(super) fn over(map: &[u8]) -> Self {
            if map.is_empty() || INSTALLED.get_or_init(install).is_none() {
                return Self { place: None };
            }
            // Claim a free entry
            let start = map.as_ptr() as usize;
            let free = REGION.iter().position(|region| {
                let taken =
                    region.start.compare_exchange(0, 1, Ordering::AcqRel, Ordering::Relaxed);
                taken.is_ok()
            });
            // Publish the addresses; the handler reads them once `start` is set
            if let Some(place) = free {
                let region = &REGION[place];
                region.lost.store(false, Ordering::Relaxed);
                region.end.store(start + map.len(), Ordering::Relaxed);
                region.start.store(start, Ordering::Release);
            }
            Self { place: free }
        }

        /// Whether zeros replaced missing bytes.
        pub(super) fn has_lost(&self) -> bool {
            self.place.is_some_and(|place| REGION[place].lost.load(Ordering::Acquire))
        }
    }

    impl Drop for Guard {
        fn drop(&mut self) {
            if let Some(place) = self.place {
                REGION[place].start.store(0, Ordering::Release);
            }
        }
    }

    fn install() -> Option<Installed> {
        // SAFETY: `sysconf` accepts any number. A zeroed sigaction is valid and is filled in below. Both pointers
        // that `sigaction` gets are to live values, and the handler has the signature that SA_SIGINFO requires.
        unsafe {
            let page = usize::try_from(libc::sysconf(libc::_SC_PAGESIZE)).ok()?;
            let mut action: libc::sigaction = std::mem::zeroed();
            let mut before: libc::sigaction = std::mem::zeroed();
            let handler: extern "C" fn(libc::c_int, *mut libc::siginfo_t, *mut libc::c_void) =
                on_bus_error;
            action.sa_sigaction = handler as usize;
            action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
            (libc::sigaction(libc::SIGBUS, &raw const action, &raw mut before) == 0)
                .then_some(Installed { page, before })
        }
    }

    /// Only reads atomics and calls the kernel, as signal handlers must.
    extern "C" fn on_bus_error(
        _signal: libc::c_int,
        info: *mut libc::siginfo_t,
        _context: *mut libc::c_void,
    ) {
        // SAFETY: the kernel passes a valid `info` to a handler that was installed with SA_SIGINFO, and sets
        // its address for SIGBUS.
        let address = unsafe { (*info).si_addr() } as usize;
        let Some(Some(installed)) = INSTALLED.get() else {
            return;
        };
        // Find the map that contains the address
        for region in &REGION {
            let start = region.start.load(Ordering::Acquire);
            if start > 1 && address >= start && address < region.end.load(Ordering::Relaxed) {
                let page = address & !(installed.page - 1);
                // SAFETY: the page belongs to a live map (it was just accessed), and the file has no bytes for
                // it. Zeros replace it, readable as before, until the map is dropped.
                let zeros = unsafe {
                    libc::mmap(
                        page as *mut libc::c_void,
                        installed.page,
                        libc::PROT_READ,
                        libc::MAP_PRIVATE | libc::MAP_ANONYMOUS | libc::MAP_FIXED,
                        -1,
                        0,
                    )
                };
                if zeros != libc::MAP_FAILED {
                    region.lost.store(true, Ordering::Release);
                    return;
                }
            }
        }
        // The address is in no watched map: restore the earlier handler, which gets the signal when the access
        // is repeated.
        // SAFETY: `before` is the action that the kernel returned for this signal.
        unsafe {
            libc::sigaction(libc::SIGBUS, &raw const installed.before, std::ptr::null_mut());
        }
    }
}

#[cfg(any(not(target_os = "linux"), miri))]
mod guard {
    //! On other systems a file must not be truncated while it is mapped.

    #[derive(Debug)]
    pub(super) struct Guard;

    impl Guard {
        pub(super) fn over(_map: &[u8]) -> Self {
            Self
        }

        pub(super) fn has_lost(&self) -> bool {
            false
        }
    }
}
