//! Damaged meshes: each gives its named error, within little memory.
//!
//! `tests/damaged_meshes` holds the files and `table.tsv`, a line for each: the name, then text that the error must
//! have, or `reads V vertices T triangles`. `SPHERULE_BLESS=1` writes the files anew from `make.rs`; the table is
//! written by hand.

use std::fs;
use std::path::{Path, PathBuf};

use spherule_formats::mesh::{parse_mesh, read_mesh};
use spherule_formats::{MemoryBudget, ParseError};

use crate::make;

fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/damaged_meshes")
}

/// What reading the file gives, as the table has it.
fn outcome(path: &Path) -> String {
    // More would be an allocation for a count that is wrong.
    match read_mesh(path, MemoryBudget::new(1 << 20, "raise the limit")) {
        Ok(mesh) => {
            let (vertices, triangles) = (mesh.vertices.len(), mesh.triangles.len());
            format!("reads {vertices} vertices {triangles} triangles")
        }
        Err(error) => {
            let message = error.to_string();
            let what = message.strip_prefix(&format!("{}: ", path.display()));
            what.expect("an error begins with the path").to_owned()
        }
    }
}

#[test]
fn every_damaged_mesh_gives_its_named_error() {
    let made = make::damaged();
    if std::env::var_os("SPHERULE_BLESS").is_some() {
        for (name, bytes) in &made {
            fs::write(directory().join(name), bytes).expect("a file");
        }
    }
    let table = fs::read_to_string(directory().join("table.tsv")).expect("the table");
    let table = table.lines().map(|line| line.split_once('\t').expect("a name, a tab, a message"));
    let (mut wrong, mut listed) = (Vec::new(), Vec::new());
    for (name, expected) in table {
        let found = outcome(&directory().join(name));
        let agrees =
            found == expected || !expected.starts_with("reads ") && found.contains(expected);
        if !agrees {
            wrong.push(format!("{name}\t{found}"));
        }
        listed.push(name.to_owned());
    }
    assert!(wrong.is_empty(), "these differ from the table:\n{}", wrong.join("\n"));
    let mut makeable: Vec<String> = made.into_iter().map(|(name, _)| name).collect();
    let entries = fs::read_dir(directory()).expect("the directory");
    let names = entries
        .map(|entry| entry.expect("an entry").file_name())
        .map(|name| name.to_string_lossy().into_owned());
    let mut there: Vec<String> = names.filter(|name| name != "table.tsv").collect();
    for names in [&mut listed, &mut makeable, &mut there] {
        names.sort();
    }
    assert_eq!(listed, makeable, "the table and the files that are made");
    assert_eq!(there, listed, "the directory and the table");
}

/// Every truncation, and every byte changed in several ways: no panic, and the place of an error is in the file.
#[test]
fn no_damage_of_any_byte_is_a_panic() {
    for (name, extension, bytes) in make::whole() {
        let path = format!("a.{extension}");
        let read = |bytes: &[u8]| {
            let result =
                parse_mesh(bytes, Path::new(&path), MemoryBudget::new(1 << 20, "raise it"));
            match result {
                Ok(mesh) => {
                    let count = mesh.vertices.len();
                    let indices = mesh.triangles.as_flattened();
                    assert!(indices.iter().all(|index| (*index as usize) < count), "{name}");
                }
                Err(ParseError::Malformed { at, what }) => {
                    assert!(at <= bytes.len() as u64, "{name}: byte {at}: {what}");
                }
                Err(_) => {}
            }
        };
        for len in 0..bytes.len() {
            read(&bytes[..len]);
        }
        let mut changed = bytes.clone();
        for at in 0..bytes.len() {
            for byte in [0, b'0', b'9', b'-', b' ', b'\n', 0x7f, 0xff, bytes[at] ^ 1] {
                changed[at] = byte;
                read(&changed);
            }
            changed[at] = bytes[at];
        }
    }
}
