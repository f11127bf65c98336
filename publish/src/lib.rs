//! Files that appear under their name complete or not at all. They are written under a temporary name in the
//! same directory, synced and renamed, and the directory is synced.
//!
//! Temporary files are called `.NAME.OWNER.N.part`. The owner distinguishes files of killed processes from those
//! that are being written, also across machines that share the file system.
//!
//! `formats` and `jobs` publish their files with this crate, which uses neither of them.
#![deny(unsafe_code)]

mod directory;
mod owner;
mod publisher;

pub use owner::{discard_parts, host_name, owner, part_owner, process_token, set_owner};
pub use publisher::{Publisher, discard_own_parts, publish, publish_with};
