//! What programs need around files, before they know what is in them.
//!
//! ```text
//! compression, readers, formats, images, report, jobs, spherule -> [files] -> the file system
//! ```
//!
//! - [`publish`], [`Publisher`]: files that appear under their name complete or not at all. They are written under a
//!   temporary name in the same directory, synced and renamed, and the directory is synced. Temporary files are called
//!   `.NAME.OWNER.N.part`. The owner distinguishes files of killed processes from those that are being written, also
//!   across machines that share the file system.
//! - [`open_regular`], [`read_regular`]: regular files only, up to a limit. A name may lead to a pipe or a device.
//! - [`catch_panic`]: a panic in the work on one file becomes an error of that file.
//! - [`Interrupt`]: requests to stop.
//! - [`memory`]: memory of the process and of the machine, which limits how much of a file may be read.
//! - [`Bytes`], [`counted`], [`one_line`], [`escape_controls`], [`ValueError`]: sizes, counts and foreign text in
//!   messages.
//!
//! This crate depends on no other crate of spherule.
//!
//! ```
//! use spherule_files::{Bytes, publish, read_regular_text};
//!
//! let dir = tempfile::tempdir()?;
//! let path = dir.path().join("notes.txt");
//! publish(&path, b"complete, or not there at all")?;
//! assert_eq!(read_regular_text(&path, 1 << 20)?, "complete, or not there at all");
//! assert_eq!(Bytes(1 << 20).to_string(), "1.00 MiB");
//! # Ok::<(), std::io::Error>(())
//! ```
#![deny(unsafe_code)]

mod bytes;
mod counted;
mod directory;
mod interrupt;
pub mod memory;
mod message;
mod owner;
mod panic;
mod publisher;
mod regular;
mod value_error;

pub use bytes::Bytes;
pub use counted::counted;
pub use interrupt::{Interrupt, InterruptLevel};
pub use message::{escape_controls, is_control, one_line};
pub use owner::{discard_parts, host_name, owner, part_owner, process_token, set_owner};
pub use panic::{Panic, catch_panic};
pub use publisher::{Publisher, discard_own_parts, publish, publish_with};
pub use regular::{open_regular, read_regular, read_regular_text};
pub use value_error::ValueError;
