//! Formats of files without a name that suggests one, and notes about files that are not read.
#![expect(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::{Path, PathBuf};

use spherule_formats::detect::detect_format;
use spherule_formats::open;
use spherule_formats::read::{
    amber, charmm_crd, dcd, dl_poly, gro, gromos, gsd, lammps, mmcif, mol2, pdb, rst7, sdf, tinker,
    trr, vasp, xtc,
};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data").join(name)
}

#[test]
fn molecular_files_are_known_by_their_content() {
    for (name, format) in [
        ("water.gro", gro::FORMAT),
        ("water.xtc", xtc::FORMAT),
        ("large.xtc", xtc::FORMAT),
        ("single.trr", trr::FORMAT),
        ("fixed.dcd", dcd::FORMAT),
        ("offset64.nc", amber::FORMAT),
        ("models.pdb", pdb::FORMAT),
        ("charges.pqr", pdb::PQR),
        ("models.cif", mmcif::FORMAT),
        ("water.xdatcar", vasp::FORMAT),
        ("water.mol2", mol2::FORMAT),
        ("water.sdf", sdf::FORMAT),
        ("water.arc", tinker::FORMAT),
        ("salt.dlpoly", dl_poly::FORMAT),
        ("water.g96", gromos::FORMAT),
        ("alanine.cor", charmm_crd::FORMAT),
        ("custom.lammpsbin", lammps::BINARY),
    ] {
        let bytes = fs::read(data("molecules").join(name)).expect("a sample");
        assert_eq!(detect_format(&bytes, Path::new("file")), Ok(format), "{name}");
    }
}

#[test]
fn restart_files_of_amber_are_not_taken_for_tables() {
    let text = "ethanol in water\n    2  0.1000000E+01\n   1.0000000   2.0000000   3.0000000   4.0000000   \
                5.0000000   6.0000000\n";
    assert_eq!(detect_format(text.as_bytes(), Path::new("md.txt")), Ok(rst7::FORMAT));
}

#[test]
fn notes_of_a_file_are_those_of_all_its_bytes() {
    let path = data("gsd/polymer.gsd");
    let bytes = fs::read(&path).expect("a sample");
    let notes = open::notes(&path);
    assert!(!notes.is_empty());
    assert_eq!(notes, gsd::FORMAT.reader().notes(&bytes));
    let file = spherule_formats::FrameFile::open(&path).expect("a good file");
    assert_eq!((file.format(), file.steps().len()), (gsd::FORMAT, 5));
}
