//! Memory-mapped files: the only module of the crate with a memory map.
//!
//! Somebody may cut a file short while it is mapped; touching pages that are gone then raises a signal that
//! ends a process. Here such pages become zeros and the file is marked as lost, so that whoever used it
//! finds out afterwards, and one frame fails instead of the whole job.
#![expect(
    unsafe_code,
    reason = "mapping has no safe form; every block says why it is sound"
)]

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use memmap2::Mmap;
use rkyv::util::AlignedVec;

use super::NativeFrame;
use super::layout::{FrameIndex, parse};
use crate::regular::regular_len;
use crate::{FrameError, ParseError};

/// How the bytes of a native frame come into memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Access {
    /// Mapped: opening is O(1), pages come as they are touched.
    #[default]
    Map,
    /// Read as a whole: for file systems where a file may be cut short while it is used.
    Read,
}

/// A memory-mapped file.
#[derive(Debug)]
pub struct MappedFile {
    path: PathBuf,
    file: File,
    modified: Option<SystemTime>,
    // Before the map, so that it is let go first.
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
        // Opening a pipe would wait for a writer.
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

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The bytes. Some may be zeros that were not in the file if it is cut short: ask
    /// [`Self::check`] afterwards.
    pub fn bytes(&self) -> &[u8] {
        &self.map
    }

    /// Says that the bytes will be read from front to back, so that the system reads ahead and lets go of
    /// pages already read. Only advice: it changes nothing but speed.
    pub(crate) fn advise_sequential(&self) {
        #[cfg(unix)]
        let _ = self.map.advise(memmap2::Advice::Sequential);
    }

    /// Whether the file is still what it was when it was mapped. Ask before use, and after it before
    /// anything that came of it is believed.
    ///
    /// # Errors
    /// [`FrameError::Malformed`] if its length or time of change differs, or bytes were lost.
    pub fn check(&self) -> Result<(), FrameError> {
        let meta = self.file.metadata();
        let meta = meta.map_err(|e| FrameError::io(&self.path, e))?;
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
        let what = format!("{what}; leave it alone, or read it instead of mapping (--no-mmap)");
        Err(ParseError::malformed(0, what).in_file(&self.path))
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
    /// Aligned as sections are, see [`super::layout::ALIGN`].
    Read(AlignedVec<64>),
}

impl NativeFile {
    /// Opens the native frame at `path` and checks its header and index, not its sections.
    ///
    /// # Errors
    /// [`FrameError`] if it cannot be read, or is damaged, cut off, or of another version.
    pub fn open(path: &Path, access: Access) -> Result<Self, FrameError> {
        let bytes = match access {
            Access::Map => FileBytes::Mapped(MappedFile::open(path)?),
            Access::Read => FileBytes::Read(read(path)?),
        };
        let index = parse(bytes.as_slice()).map_err(|e| e.in_file(path))?;
        Ok(Self {
            path: path.to_owned(),
            bytes,
            index,
        })
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the file holds.
    pub const fn index(&self) -> &FrameIndex {
        &self.index
    }

    /// Bytes of the file.
    pub fn byte_len(&self) -> u64 {
        self.bytes.as_slice().len() as u64
    }

    /// Whether the bytes are those of the file itself.
    pub const fn is_mapped(&self) -> bool {
        matches!(self.bytes, FileBytes::Mapped(_))
    }

    /// The particles in place. Take it anew for every use: it looks again whether a mapped file is still
    /// what it was.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn frame(&self) -> Result<NativeFrame<'_>, FrameError> {
        self.check()?;
        Ok(self.frame_unchecked())
    }

    /// [`Self::frame`] without looking at the file again: for short looks between two checks.
    pub fn frame_unchecked(&self) -> NativeFrame<'_> {
        NativeFrame::with_index(self.bytes.as_slice(), &self.index)
    }

    /// Whether a mapped file is still what it was, see [`MappedFile::check`].
    ///
    /// # Errors
    /// [`FrameError::Malformed`] if it is not.
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

/// The whole file, aligned as its sections are.
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

/// Maps `file`, which nobody may change while the map lives.
///
/// Native frames are published by rename and never written in place, so only somebody outside can do
/// that. [`MappedFile::check`] compares length and time of change; what is cut off reads as zeros (see
/// `guard`). Contents are plain numbers, valid for any bit pattern, and never used as indices
/// unchecked, so that a change between two looks is a wrong picture that is found out, at worst a fault
/// that costs the frame.
fn map(file: &File) -> io::Result<Mmap> {
    // SAFETY: `Mmap::map` needs the file not to be changed while mapped; what is done about that, and why
    // a change cannot break more than numbers, stands above.
    unsafe { Mmap::map(file) }
}

#[cfg(all(target_os = "linux", not(miri)))]
mod guard {
    //! Pages of a mapped file that is cut short: the kernel raises SIGBUS where one is touched. The
    //! handler here puts a page of zeros there and remembers the loss.

    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

    /// Maps that can be watched at a time; more than the stages of a pipeline hold.
    const REGIONS: usize = 64;

    struct Region {
        /// First address; 0 if the entry is free, 1 while it is taken.
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

    /// Watches a map as long as it lives.
    #[derive(Debug)]
    pub(super) struct Guard {
        place: Option<usize>,
    }

    impl Guard {
        pub(super) fn over(map: &[u8]) -> Self {
            if map.is_empty() || INSTALLED.get_or_init(install).is_none() {
                return Self { place: None };
            }
            let start = map.as_ptr() as usize;
            let free = REGION.iter().position(|region| {
                let taken =
                    region
                        .start
                        .compare_exchange(0, 1, Ordering::AcqRel, Ordering::Relaxed);
                taken.is_ok()
            });
            if let Some(place) = free {
                let region = &REGION[place];
                region.lost.store(false, Ordering::Relaxed);
                region.end.store(start + map.len(), Ordering::Relaxed);
                region.start.store(start, Ordering::Release);
            }
            Self { place: free }
        }

        /// Whether zeros stand for bytes that are gone.
        pub(super) fn has_lost(&self) -> bool {
            self.place
                .is_some_and(|place| REGION[place].lost.load(Ordering::Acquire))
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
        // SAFETY: `sysconf` takes any number; a sigaction of zeros is valid and filled in below; both
        // pointers given to `sigaction` are to live values, and the handler has the signature that
        // SA_SIGINFO asks for.
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

    /// Only reads atomics and calls the kernel, as a signal handler may.
    extern "C" fn on_bus_error(
        _signal: libc::c_int,
        info: *mut libc::siginfo_t,
        _context: *mut libc::c_void,
    ) {
        // SAFETY: the kernel gives a valid `info` to a handler that was installed with SA_SIGINFO, and for
        // SIGBUS its address is set.
        let address = unsafe { (*info).si_addr() } as usize;
        let Some(Some(installed)) = INSTALLED.get() else {
            return;
        };
        for region in &REGION {
            let start = region.start.load(Ordering::Acquire);
            if start > 1 && address >= start && address < region.end.load(Ordering::Relaxed) {
                let page = address & !(installed.page - 1);
                // SAFETY: the page belongs to a map that is still held (it was just touched) and whose
                // file has no such bytes; zeros take its place, readable as before, until the map goes.
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
        // Not ours: whoever was there before gets it, as the fault happens again.
        // SAFETY: `before` is what the kernel gave for this signal.
        unsafe {
            libc::sigaction(
                libc::SIGBUS,
                &raw const installed.before,
                std::ptr::null_mut(),
            );
        }
    }
}

#[cfg(any(not(target_os = "linux"), miri))]
mod guard {
    //! Elsewhere a file must not be cut short while it is mapped.

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
