//! Molecular files in pieces, cut at any byte, and with other bytes in them.

use proptest::prelude::*;
use proptest::sample::Index;

use super::damage::{TestedReader, mutate, sample};
use super::{
    Step, amber, dcd, dl_poly, gro, gromos, lammps, mdcrd, mmcif, mol2, pdb, pieces, sdf,
    text_samples, tinker, trr, vasp, xtc,
};
use crate::format::Format;
use crate::reader::{Confidence, HEAD_LEN};
use spherule_frame::{ParseError, RawParticles};

macro_rules! readers {
    ($($name:ident: $format:expr, $sample:literal;)*) => {
        $(mod $name {
            use super::*;

            fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
                pieces::steps($format, bytes)
            }

            fn read(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
                pieces::read($format, bytes, step)
            }

            pub(super) const READER: TestedReader = TestedReader { steps, read };
        })*

        const SAMPLES: &[(&str, Format, TestedReader)] = &[$(($sample, $format, $name::READER)),*];
    };
}

readers! {
    gro_reader: gro::FORMAT, "water.gro";
    xtc_reader: xtc::FORMAT, "water.xtc";
    large_xtc_reader: xtc::FORMAT, "large.xtc";
    trr_reader: trr::FORMAT, "single.trr";
    dcd_reader: dcd::FORMAT, "fixed.dcd";
    amber_reader: amber::FORMAT, "offset64.nc";
    mdcrd_reader: mdcrd::FORMAT, "ethanol.mdcrd";
    pdb_reader: pdb::FORMAT, "models.pdb";
    pqr_reader: pdb::PQR, "charges.pqr";
    mmcif_reader: mmcif::FORMAT, "models.cif";
    vasp_reader: vasp::FORMAT, "water.xdatcar";
    mol2_reader: mol2::FORMAT, "water.mol2";
    sdf_reader: sdf::FORMAT, "water.sdf";
    tinker_reader: tinker::FORMAT, "water.arc";
    dl_poly_reader: dl_poly::FORMAT, "salt.dlpoly";
    gromos_reader: gromos::FORMAT, "water.g96";
    lammps_reader: lammps::BINARY, "custom.lammpsbin";
}

fn bytes_of(name: &str) -> Vec<u8> {
    sample(&format!("molecules/{name}"))
}

#[test]
fn samples_are_recognised_and_read_in_pieces() {
    for (name, format, reader) in SAMPLES {
        let bytes = bytes_of(name);
        assert!(reader.all(&bytes).is_ok_and(|steps| steps.len() > 1), "{name}");
        let head = &bytes[..bytes.len().min(HEAD_LEN)];
        let confidence = format.reader().sniff(head).expect("a good file");
        assert!(confidence >= Confidence::Likely, "{name}: {confidence:?}");
    }
}

#[test]
fn truncation_is_survived() {
    for (name, _, reader) in SAMPLES {
        let bytes = bytes_of(name);
        let sections: Vec<usize> = (1..40).chain([bytes.len() - 1]).collect();
        reader.survives_truncation(&bytes, &sections, 0);
    }
}

proptest! {
    #![proptest_config(text_samples::config())]

    #[test]
    fn other_bytes_are_survived(
        which in any::<Index>(),
        changes in prop::collection::vec((any::<Index>(), any::<u8>()), 1..6),
        in_head in any::<bool>(),
    ) {
        let (name, _, reader) = which.get(SAMPLES);
        let bytes = bytes_of(name);
        let head = bytes.len().min(160);
        let (start, rest) = bytes.split_at(if in_head { head } else { bytes.len() });
        let _ = reader.all(&[&mutate(start, &changes), rest].concat());
    }
}
