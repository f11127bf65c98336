//! The list of formats that this crate reads.

use std::path::Path;

use crate::native;
use crate::read::{
    amber, bgeo, bi4, charmm_crd, csv, dcd, dl_poly, e57, gadget, gro, gromos, gsd, houdini,
    lammps, las, mdcrd, mmcif, mol2, npy, openpmd_json, pcd, pdb, ply, pts, rst7, sdf, tinker,
    tipsy, trr, usd, vasp, vtk, vtk_xml, xtc, xyz,
};
use spherule_readers::Format;
use spherule_readers::compression::strip_extension;

/// All formats. If several formats match a file equally well, the first one wins. Messages list them in this order.
const FORMATS: &[Format] = &[
    native::FORMAT,
    vtk::FORMAT,
    vtk_xml::FORMAT,
    bgeo::FORMAT,
    houdini::FORMAT,
    ply::FORMAT,
    pcd::FORMAT,
    pts::FORMAT,
    las::FORMAT,
    e57::FORMAT,
    xyz::FORMAT,
    lammps::FORMAT,
    lammps::BINARY,
    lammps::DATA,
    npy::NPY,
    npy::NPZ,
    gsd::FORMAT,
    bi4::FORMAT,
    gadget::FORMAT,
    gro::FORMAT,
    xtc::FORMAT,
    trr::FORMAT,
    dcd::FORMAT,
    amber::FORMAT,
    rst7::FORMAT,
    mdcrd::FORMAT,
    vasp::FORMAT,
    mol2::FORMAT,
    sdf::FORMAT,
    tinker::FORMAT,
    dl_poly::FORMAT,
    gromos::FORMAT,
    charmm_crd::FORMAT,
    // Before PDB, whose records may begin a file of this format
    pdb::PQR,
    pdb::FORMAT,
    mmcif::FORMAT,
    usd::FORMAT,
    openpmd_json::FORMAT,
    #[cfg(feature = "hdf5")]
    crate::hdf5::FORMAT,
    // Behind formats with longer signatures
    tipsy::FORMAT,
    csv::FORMAT,
];

/// All formats.
pub const fn all() -> &'static [Format] {
    FORMATS
}

/// The format that the name of the file suggests, without the extension of a compression; `None` for other names.
pub fn by_name(path: &Path) -> Option<Format> {
    let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
    let (stem, extension) = strip_extension(&name).rsplit_once('.')?;
    let matches = |format: &&Format| format.reader().matches_name(stem, extension);
    FORMATS.iter().find(matches).copied()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn names_and_extensions_are_unique() {
        let mut names = HashSet::new();
        let mut extensions = HashSet::new();
        for format in all() {
            assert!(names.insert(format.name()), "{format:?}");
            for extension in format.reader().info().extensions {
                assert!(extensions.insert(*extension), "{format:?} {extension}");
            }
        }
    }

    #[test]
    fn names_suggest_formats() {
        let by_name = |name: &str| super::by_name(Path::new(name));
        assert_eq!(by_name("x/dump.drop.1200.lammps.gz"), Some(lammps::FORMAT));
        assert_eq!(by_name("a_7.vtu.zst"), Some(vtk_xml::FORMAT));
        assert_eq!(by_name("a_7.zip"), None);
        assert_eq!(by_name("dump.250"), Some(lammps::FORMAT));
        assert_eq!(by_name("A_7.VTK"), Some(vtk::FORMAT));
        assert_eq!(by_name("notes.12"), None);
        assert_eq!(by_name("README"), None);
    }
}
