//! Targets of `spherule-formats`. Each returns how many steps gave particles or meshes, or how many frames there are.

use spherule_formats::Format;
use spherule_formats::stats::FrameStats;
use spherule_formats::{MemoryBudget, ParseError, ParticleFrame, RawParticles, choose_origin};
use spherule_formats::{hdf5 as hdf5_files, read};

mod convert;
mod e57_pages;
mod lists;
mod mesh;
mod names;
mod native;
mod packed;

pub use convert::convert;
pub use lists::lists;
pub use mesh::mesh;
pub use names::names;
pub use native::native;
pub use packed::{compressed, houdini, npz, open};

/// A target: takes any bytes, panics where a promise is broken, returns the steps that were read.
pub type Target = fn(&[u8]) -> usize;

/// Every target by the name of its folder in `corpus`.
pub const TARGETS: [(&str, Target); 48] = [
    ("vtk", vtk),
    ("vtk_xml", vtk_xml),
    ("bgeo", bgeo),
    ("houdini", houdini),
    ("ply", ply),
    ("las", las),
    ("e57", e57),
    ("openpmd_json", openpmd_json),
    ("pts", pts),
    ("pcd", pcd),
    ("xyz", xyz),
    ("lammps", lammps),
    ("npy", npy),
    ("npz", npz),
    ("csv", csv),
    ("gsd", gsd),
    ("bi4", bi4),
    ("tipsy", tipsy),
    ("gadget", gadget),
    ("gro", gro),
    ("xtc", xtc),
    ("trr", trr),
    ("dcd", dcd),
    ("amber", amber),
    ("rst7", rst7),
    ("mdcrd", mdcrd),
    ("charmm_crd", charmm_crd),
    ("gromos", gromos),
    ("dl_poly", dl_poly),
    ("tinker", tinker),
    ("sdf", sdf),
    ("mol2", mol2),
    ("vasp", vasp),
    ("prmtop", prmtop),
    ("pdb", pdb),
    ("pqr", pqr),
    ("mmcif", mmcif),
    ("lammps_binary", lammps_binary),
    ("lammps_data", lammps_data),
    ("usd", usd),
    ("hdf5", hdf5),
    ("open", open),
    ("compressed", compressed),
    ("lists", lists),
    ("native", native),
    ("convert", convert),
    ("names", names),
    ("mesh", mesh),
];

/// Steps read of one input: the rest goes the same way.
const MAX_STEPS: usize = 4;
/// Bytes of particles for a byte of the file: text of one digit and a blank becomes eight bytes.
const EXPANSION: u64 = 8;
/// What the tightest packing that is read gives for a byte: xz, then deflate.
const XZ_RATIO: u64 = 16_384;
const DEFLATE_RATIO: u64 = 1032;
/// An atom of an `.xtc` file has two bits at least.
const XTC_RATIO: u64 = 8;
/// At most 1024 points for a byte, of up to 64 bytes in practice.
const LAZ_RATIO: u64 = 65_536;
/// Headers that stand for values without bytes in the file (a radius common to all).
const SLACK: u64 = 4096;

/// Legacy VTK.
pub fn vtk(bytes: &[u8]) -> usize {
    read_all(read::vtk::FORMAT, bytes, 1)
}

/// XML VTK.
pub fn vtk_xml(bytes: &[u8]) -> usize {
    let packs = |name: &str| bytes.windows(name.len()).any(|w| w == name.as_bytes());
    let ratio = match () {
        () if !packs("compressor") => 1,
        () if !packs("LZMA") => DEFLATE_RATIO,
        () => XZ_RATIO,
    };
    read_all(read::vtk_xml::FORMAT, bytes, ratio)
}

/// Classic BGEO.
pub fn bgeo(bytes: &[u8]) -> usize {
    read_all(read::bgeo::FORMAT, bytes, 1)
}

/// PLY.
pub fn ply(bytes: &[u8]) -> usize {
    read_all(read::ply::FORMAT, bytes, 1)
}

/// LAS and LAZ.
pub fn las(bytes: &[u8]) -> usize {
    let is_compressed = bytes.get(104).is_some_and(|format| format & 0x80 != 0);
    read_all(read::las::FORMAT, bytes, if is_compressed { LAZ_RATIO } else { 1 })
}

/// The content of E57, which is divided into pages with checksums here: the reader refuses pages that are damaged.
pub fn e57(bytes: &[u8]) -> usize {
    let pages = e57_pages::sealed(bytes.to_vec());
    // Points of one bit, with fields of none
    read_all(read::e57::FORMAT, &pages, 8 * 32)
}

/// openPMD in JSON.
pub fn openpmd_json(bytes: &[u8]) -> usize {
    // A number, and those of records of one value
    read_all(read::openpmd_json::FORMAT, bytes, 3 * 64)
}

/// Point clouds of laser scanners in text.
pub fn pts(bytes: &[u8]) -> usize {
    read_all(read::pts::FORMAT, bytes, 1)
}

/// PCD.
pub fn pcd(bytes: &[u8]) -> usize {
    read_all(read::pcd::FORMAT, bytes, 88)
}

/// Raw, bare and molecular XYZ.
pub fn xyz(bytes: &[u8]) -> usize {
    read_all(read::xyz::FORMAT, bytes, 1)
}

/// LAMMPS text dumps.
pub fn lammps(bytes: &[u8]) -> usize {
    read_all(read::lammps::FORMAT, bytes, 1)
}

/// One NPY array.
pub fn npy(bytes: &[u8]) -> usize {
    let packing = if bytes.starts_with(b"PK") { DEFLATE_RATIO } else { 1 };
    read_all(read::npy::NPY, bytes, packing)
}

/// CSV.
pub fn csv(bytes: &[u8]) -> usize {
    read_all(read::csv::FORMAT, bytes, 1)
}

/// GSD.
pub fn gsd(bytes: &[u8]) -> usize {
    read_all(read::gsd::FORMAT, bytes, 1)
}

/// DualSPHysics.
pub fn bi4(bytes: &[u8]) -> usize {
    read_all(read::bi4::FORMAT, bytes, 1)
}

/// Tipsy snapshots.
pub fn tipsy(bytes: &[u8]) -> usize {
    read_all(read::tipsy::FORMAT, bytes, 1)
}

/// Binary snapshots of GADGET.
pub fn gadget(bytes: &[u8]) -> usize {
    read_all(read::gadget::FORMAT, bytes, 1)
}

/// GROMACS text.
pub fn gro(bytes: &[u8]) -> usize {
    read_all(read::gro::FORMAT, bytes, 1)
}

/// GROMACS trajectories of compressed positions.
pub fn xtc(bytes: &[u8]) -> usize {
    read_all(read::xtc::FORMAT, bytes, XTC_RATIO)
}

/// GROMACS trajectories of positions, velocities and forces.
pub fn trr(bytes: &[u8]) -> usize {
    read_all(read::trr::FORMAT, bytes, 1)
}

/// DCD.
pub fn dcd(bytes: &[u8]) -> usize {
    read_all(read::dcd::FORMAT, bytes, 1)
}

/// AMBER NetCDF.
pub fn amber(bytes: &[u8]) -> usize {
    read_all(read::amber::FORMAT, bytes, 1)
}

/// AMBER restart files in text.
pub fn rst7(bytes: &[u8]) -> usize {
    read_all(read::rst7::FORMAT, bytes, 1)
}

/// AMBER trajectories in text.
pub fn mdcrd(bytes: &[u8]) -> usize {
    read_all(read::mdcrd::FORMAT, bytes, 1)
}

/// CHARMM coordinates.
pub fn charmm_crd(bytes: &[u8]) -> usize {
    read_all(read::charmm_crd::FORMAT, bytes, 1)
}

/// GROMOS.
pub fn gromos(bytes: &[u8]) -> usize {
    read_all(read::gromos::FORMAT, bytes, 1)
}

/// DL_POLY.
pub fn dl_poly(bytes: &[u8]) -> usize {
    read_all(read::dl_poly::FORMAT, bytes, 1)
}

/// Tinker.
pub fn tinker(bytes: &[u8]) -> usize {
    read_all(read::tinker::FORMAT, bytes, 1)
}

/// MDL files.
pub fn sdf(bytes: &[u8]) -> usize {
    read_all(read::sdf::FORMAT, bytes, 1)
}

/// Tripos mol2.
pub fn mol2(bytes: &[u8]) -> usize {
    read_all(read::mol2::FORMAT, bytes, 1)
}

/// VASP structures and trajectories.
pub fn vasp(bytes: &[u8]) -> usize {
    read_all(read::vasp::FORMAT, bytes, 1)
}

/// AMBER topologies.
pub fn prmtop(bytes: &[u8]) -> usize {
    let Ok((count, atoms)) = read::prmtop::read(bytes, MemoryBudget::UNLIMITED) else {
        return 0;
    };
    for attribute in &atoms.attributes {
        assert_eq!(attribute.data.len(), attribute.components * count, "{}", attribute.name);
    }
    assert!(atoms.bonds.iter().flatten().all(|atom| (*atom as usize) < count));
    1
}

/// LAMMPS data files.
pub fn lammps_data(bytes: &[u8]) -> usize {
    read_all(read::lammps::DATA, bytes, 1)
}

/// Protein Data Bank files.
pub fn pdb(bytes: &[u8]) -> usize {
    read_all(read::pdb::FORMAT, bytes, 1)
}

/// PQR.
pub fn pqr(bytes: &[u8]) -> usize {
    read_all(read::pdb::PQR, bytes, 1)
}

/// mmCIF.
pub fn mmcif(bytes: &[u8]) -> usize {
    read_all(read::mmcif::FORMAT, bytes, 1)
}

/// LAMMPS binary dumps.
pub fn lammps_binary(bytes: &[u8]) -> usize {
    read_all(read::lammps::BINARY, bytes, 1)
}

/// USD.
pub fn usd(bytes: &[u8]) -> usize {
    // Integers are packed twice, a value may stand for those of all particles, and parts may share their values.
    read_all(read::usd::FORMAT, bytes, DEFLATE_RATIO * DEFLATE_RATIO)
}

/// HDF5.
pub fn hdf5(bytes: &[u8]) -> usize {
    // A chunk may be packed more than once.
    read_all(hdf5_files::FORMAT, bytes, DEFLATE_RATIO * DEFLATE_RATIO)
}

/// Reads `bytes` as `format`, the first steps and the last. `packing` is the ratio that
/// compression inside the format may reach; places in what is unpacked count from its start.
fn read_all(format: Format, bytes: &[u8], packing: u64) -> usize {
    let len = (bytes.len() as u64).saturating_mul(packing);
    let steps = match format.steps(bytes) {
        Ok(steps) => steps,
        Err(error) => {
            check_error(&error, len);
            return 0;
        }
    };
    let mut read_count = 0;
    for (place, step) in steps.iter().enumerate() {
        assert_eq!(step.index, place);
        if let Some(range) = step.byte_range() {
            assert!(range.start <= range.end && range.end <= bytes.len());
        }
        if place >= MAX_STEPS && place + 1 != steps.len() {
            continue;
        }
        match format.read(bytes, step) {
            Ok(particles) => {
                check_particles(&particles, len);
                prepare(particles);
                read_count += 1;
            }
            Err(error) => check_error(&error, len),
        }
    }
    read_count
}

/// The place is inside the file, and the message is one line that a terminal can show.
fn check_error(error: &ParseError, len: u64) {
    match error {
        ParseError::Malformed { at, what } => {
            assert!(*at <= len, "byte {at} of {len}: {what}");
            check_message(what);
        }
        ParseError::Unsupported { what } | ParseError::TooLarge { what } => check_message(what),
    }
}

fn check_message(what: &str) {
    assert!(!what.is_empty() && what.len() < 4000, "{} bytes: {what:.200}", what.len());
    assert!(!what.contains(char::is_control), "{what:?}");
}

/// Each attribute has one group a particle, and nothing came out of nothing.
fn check_particles(particles: &RawParticles, len: u64) {
    let count = particles.positions.len();
    for attribute in &particles.attributes {
        assert!(attribute.components > 0, "{} is empty", attribute.name);
        assert_eq!(
            attribute.data.len(),
            count * attribute.components,
            "{} of {count} particles",
            attribute.name
        );
    }
    let most = len.saturating_mul(EXPANSION) + SLACK;
    assert!(
        particles.byte_len() <= most,
        "{} bytes of particles from a file of {len}",
        particles.byte_len()
    );
}

/// What the pipeline does with particles before a tree is built.
fn prepare(particles: RawParticles) {
    let count = particles.positions.len();
    let stats = FrameStats::of(&particles);
    let origin = stats.bounds.map(|(min, max)| choose_origin(min, max));
    let frame = ParticleFrame::from_raw(particles, origin.unwrap_or_default());
    assert_eq!(frame.len() as u64 + frame.dropped, count as u64);
    assert!(frame.positions.iter().all(|p| p.is_finite()));
    for attribute in &frame.attributes {
        assert_eq!(attribute.data.len(), frame.len() * attribute.components);
    }
}
