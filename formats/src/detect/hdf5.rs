//! HDF5 files: not read, but the program that wrote one decides what the message recommends.

use memchr::memmem;

/// What every HDF5 file has at byte 0, or at 512, 1024... after a user block.
const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";

/// Where the signature is looked for.
const PLACES: [usize; 4] = [0, 512, 1024, 2048];

/// The bytes in which names of groups are looked for: those of the root group come early.
const PREFIX: usize = 1 << 16;

/// Names of groups and attributes that all must be there, and the message.
const LAYOUTS: &[(&[&[u8]], &str)] = &[
    (
        &[b"VTKHDF"],
        "a VTKHDF file, which is not read yet; save as .vtu or .vtp with ParaView",
    ),
    (
        &[b"openPMD"],
        "an openPMD file (HDF5), which is not read yet; write positions and attributes to .npz with openpmd-api and numpy",
    ),
    (
        &[b"h5md"],
        "an H5MD file (HDF5), which is not read yet; write .xyz or a LAMMPS dump with MDAnalysis or OVITO",
    ),
    (
        &[b"PartType"],
        "a snapshot of Gadget, AREPO, SWIFT or a code like these (HDF5), which is not read yet; write \
         Coordinates, Velocities... of a PartType to .npz with h5py and numpy",
    ),
    (
        &[b"Step#"],
        "an H5Part file (HDF5), which is not read yet; save as .vtu with ParaView, or write .npz with h5py and numpy",
    ),
    (
        &[b"solver_data", b"particles"],
        "a PySPH file (HDF5), which is not read yet; `pysph dump_vtk` writes .vtu from it",
    ),
];

const UNKNOWN: &str = "an HDF5 file, which is not read yet; write positions and attributes to .npz with h5py and numpy, \
                       or save as .vtu or .csv with the program that made it";

/// The message for `bytes`, the beginning of a file, if that is HDF5.
pub(super) fn what(bytes: &[u8]) -> Option<&'static str> {
    let is_at = |at: &usize| bytes.get(*at..).is_some_and(|b| b.starts_with(SIGNATURE));
    // A file that is shorter than its signature is still one.
    let is_cut = bytes.starts_with(b"\x89HDF");
    if !is_cut && !PLACES.iter().any(is_at) {
        return None;
    }
    let prefix = &bytes[..bytes.len().min(PREFIX)];
    let has = |name: &&[u8]| memmem::find(prefix, name).is_some();
    let known = LAYOUTS.iter().find(|(names, _)| names.iter().all(has));
    Some(known.map_or(UNKNOWN, |(_, what)| what))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn suggests(content: &[u8], hint: &str) {
        for before in [0, 512] {
            let bytes = [&vec![b' '; before], SIGNATURE, content].concat();
            let what = what(&bytes).expect("HDF5");
            assert!(what.contains(hint), "{what}");
        }
    }

    #[test]
    fn formats_are_recognised_by_column_names() {
        suggests(b"\0\0Header\0PartType0\0", "Gadget");
        suggests(b"\0h5md\0particles\0", "H5MD");
        suggests(b"\0\0Step#0\0", "H5Part");
        suggests(b"\0openPMD\0", "openPMD");
        suggests(b"\0VTKHDF\0", "ParaView");
        suggests(b"\0particles\0solver_data\0", "pysph dump_vtk");
        suggests(b"\0something\0", "h5py");
        suggests(
            &[&[0; PREFIX][..], b"PartType0"].concat(),
            "with the program that made it",
        );
        assert_eq!(what(b"x,y,z\n"), None);
        assert!(what(b"\x89HDF").is_some());
    }
}
