//! Molecules in text, scans in text and snapshots of Tipsy that are broken.

use super::base::{Base, find};
use super::{Made, big};
use crate::harness::sample;

/// A sample of molecules.
fn base(name: &'static str, extension: &'static str, file: &str) -> Base {
    let bytes = std::fs::read(sample(&format!("molecules/{file}"))).expect("a sample");
    Base::new(name, extension, bytes)
}

pub(super) fn molecules() -> Vec<Made> {
    [
        mol2(),
        sdf(),
        vasp(),
        tinker(),
        dl_poly(),
        gromos(),
        charmm(),
        pqr(),
        lammps_data(),
        mdcrd(),
        pts(),
        tipsy(),
    ]
    .concat()
}

fn mol2() -> Vec<Made> {
    base("tripos", "mol2", "water.mol2")
        .replace("magic", "@<TRIPOS>MOLECULE", "@<TRIPOS>MOLECULAR")
        .replace("no-atoms", "@<TRIPOS>ATOM", "@<TRIPOS>ATOMS")
        .replace("absurd-atoms", " 3 2 1", " 2000000000 2 1")
        .replace("negative-atoms", " 3 2 1", " -3 2 1")
        .replace("more-atoms", " 3 2 1", " 4 2 1")
        .replace("word-as-count", " 3 2 1", " three 2 1")
        .replace("word", "0.5", "zero")
        .replace("nan", "0.5", "nan")
        .replace("bond-beyond", "BOND\n1 1 2", "BOND\n1 1 9")
        .cut("cut-in-head", "@<TRIPOS>MOLECULE\n", 3)
        .cut("cut-in-atoms", "@<TRIPOS>ATOM\n", 30)
        .made
}

fn sdf() -> Vec<Made> {
    base("table", "sdf", "water.sdf")
        .replace("version", "V2000", "V9000")
        .replace("absurd-atoms", "  3  2", "999  2")
        .replace("negative-atoms", "  3  2", " -3  2")
        .replace("more-atoms", "  3  2", "  4  2")
        .replace("word-as-count", "  3  2", "abc  2")
        .replace("more-bonds", "  3  2", "  3  7")
        .replace("word", "0.5000", "0.5x00")
        .replace("no-end", "M  END", "M  FIN")
        .cut("cut-in-atoms", "V2000\n", 40)
        .cut("cut-in-head", "V20", 0)
        .made
}

fn vasp() -> Vec<Made> {
    base("steps", "xdatcar", "water.xdatcar")
        .replace("scale", "  1.0\n", "  one\n")
        .replace("no-scale", "  1.0\n", "  0.0\n")
        .replace("cell", "10.0 0.0 0.0", "10.0 0.0")
        .replace("flat-cell", "  0.0 10.0 0.0", "  10.0 0.0 0.0")
        .replace("word-in-cell", "10.0 0.0 0.0", "10.0 0.0 x.0")
        .cut("cut-in-cell", "water\n  1.0\n", 9)
        .cut("cut-in-atoms", "Direct configuration=", 30)
        .replace("counts", "1 2", "1 x")
        .replace("negative-counts", "1 2", "1 -2")
        .replace("absurd-counts", "1 2", "1 2000000000")
        .made
}

fn tinker() -> Vec<Made> {
    base("archive", "arc", "water.arc")
        .replace("absurd-atoms", "     3  water", "     2000000000  water")
        .replace("negative-atoms", "     3  water", "    -3  water")
        .replace("more-atoms", "     3  water", "     9  water")
        .replace("word-as-count", "     3  water", "     a  water")
        .replace("word", "0.500000", "0.5000x0")
        .replace("nan", "0.500000", "     nan")
        .replace("bond-beyond", "63     2     3", "63     2     9")
        .replace("negative-bond", "63     2     3", "63     2    -3")
        .cut("cut-in-head", "     3  wa", 0)
        .cut("cut-in-atoms", "0.500000", 3)
        .made
}

fn dl_poly() -> Vec<Made> {
    base("config", "dlpoly", "salt.dlpoly")
        .replace("level", "         1         3         2", "         7         3         2")
        .replace("cell-kind", "         1         3         2", "         1        77         2")
        .replace("absurd-atoms", "        10         2         1", "        102000000000         1")
        .replace("more-atoms", "        10         2         1", "        10         9         1")
        .replace(
            "negative-atoms",
            "        10         2         1",
            "        10        -2         1",
        )
        .replace("word-in-cell", "10.0 0.0 0.0", "ten 0.0 0.0")
        .replace("cell", "10.0 0.0 0.0", "10.0 0.0")
        .replace("nan-cell", "10.0 0.0 0.0", "nan 0.0 0.0")
        .cut("cut-in-head", "sodium chloride\n", 8)
        .cut("cut-in-cell", "  10.0 0.0 0.0", 3)
        .made
}

fn gromos() -> Vec<Made> {
    base("blocks", "g96", "water.g96")
        .replace("magic", "TITLE", "TITTLE")
        .replace("no-end", "water\nEND\n", "water\n")
        .replace("time", "0.500000", "0.5000x0")
        .replace("block", "POSITION", "POSITIONAL")
        .replace("no-box", "BOX", "BOXES")
        .cut("cut-in-title", "TITLE\nwa", 0)
        .cut("cut-in-time", "TIMESTEP\n", 12)
        .cut("cut-in-positions", "POSITION\n", 30)
        .cut("cut-behind-positions", "POSITION\n", 0)
        .cut("cut-in-box", "BOX\n", 8)
        .made
}

fn charmm() -> Vec<Made> {
    base("card", "cor", "alanine.cor")
        .replace("magic", "* sodium", "+ sodium")
        .replace("absurd-atoms", "    2\n", "99999\n")
        .replace("more-atoms", "    2\n", "    3\n")
        .replace("negative-atoms", "    2\n", "   -2\n")
        .replace("word-as-count", "    2\n", "    x\n")
        .replace("word", "0.50000", "0.5x000")
        .replace("nan", "   0.50000", "       nan")
        .replace("joined-columns", "0.50000-100.25000", "0.50000-100-25000")
        .cut("cut-in-head", "* sodium", 3)
        .cut("cut-in-atoms", "ALA  CA  ", 5)
        .made
}

fn pqr() -> Vec<Made> {
    base("charges", "pqr", "charges.pqr")
        .replace("cell", "30.000", "thirty")
        .replace("no-cell", "30.000", " 0.000")
        .replace("word", "11.250", "11.2x0")
        .replace("nan", "11.250", "   nan")
        .replace("charge", "-0.3000", "-0.3x00")
        .replace("radius", "1.8500", "1.8x00")
        .replace("negative-radius", "1.8500", "-1.850")
        .replace("no-radius", "-0.3000 1.8500", "-0.3000")
        .cut("cut-in-atoms", "11.250  -8", 0)
        .cut("cut-in-head", "REMARK   1 MA", 0)
        .made
}

fn mdcrd() -> Vec<Made> {
    base("trajectory", "mdcrd", "ethanol.mdcrd")
        .replace("word", "-1.171", "-1.x71")
        .replace("nan", "  -1.171", "     nan")
        .replace("stars", "  -1.171", "********")
        .replace("joined", "  -1.171   0.300", "  -1.171-10-0.300")
        .replace("short-line", "   0.293  -1.000", "   0.293")
        .cut("cut-in-title", "ethanol, w", 0)
        .cut("cut-in-number", "  -1.171   0.3", 0)
        .cut("cut-in-frame", "-0.861", 0)
        .cut("cut-in-cell", "  10.000", 2)
        .cut("no-numbers", "ethanol, written by hand\n", 0)
        .made
}

fn lammps_data() -> Vec<Made> {
    base("input", "data", "ethanol.data")
        .replace("absurd-atoms", "9 atoms", "2000000000 atoms")
        .replace("negative-atoms", "9 atoms", "-9 atoms")
        .replace("more-atoms", "9 atoms", "10 atoms")
        .replace("fewer-atoms", "9 atoms", "8 atoms")
        .replace("word-as-count", "9 atoms", "nine atoms")
        .replace("no-count", "9 atoms", "")
        .replace("no-atoms", "Atoms", "Adams")
        .replace("style", "Atoms # full", "Atoms # none")
        .replace("word", "-1.171", "-1.x71")
        .replace("bond-beyond", "Bonds\n\n1 1 1 ", "Bonds\n\n1 1 77 ")
        .cut("cut-in-head", "9 atoms\n", 3)
        .cut("cut-in-atoms", "Atoms # full\n\n", 20)
        .made
}

fn pts() -> Vec<Made> {
    let text = "3\n0.0 0.0 0.0 -1500 10 20 30\n1.0 0.5 0.25 0 10 20 30\n2.0 1.0 0.5 90 10 20 30\n";
    Base::new("leica", "pts", text.as_bytes().to_vec())
        .replace("absurd-points", "3\n", "2000000000\n")
        .replace("negative-points", "3\n", "-3\n")
        .replace("more-points", "3\n", "4\n")
        .replace("fewer-points", "3\n", "2\n")
        .replace("word-as-count", "3\n", "three\n")
        .replace("word", "0.25", "zero")
        .replace("nan", "1.0 0.5", "nan 0.5")
        .replace("columns", "0.25 0 10 20 30", "0.25 0 10")
        .replace("color", "10 20 30\n1.0", "10 20 300\n1.0")
        .cut("cut-in-points", "1.0 0.5", 0)
        .cut("cut-in-head", "3", 0)
        .file("zero", b"0\n".to_vec())
        .made
}

/// A snapshot of three particles of dark matter in the standard form.
fn tipsy_bytes(points: &[[f32; 3]]) -> Vec<u8> {
    let count = u32::try_from(points.len()).expect("a few points");
    let mut file = 0.5_f64.to_be_bytes().to_vec();
    file.extend([count, 3, 0, count, 0, 0].map(u32::to_be_bytes).concat());
    for point in points {
        // Mass, position, velocity, softening and potential
        file.extend(big(&[[1.0, point[0], point[1]], [point[2], 0.0, 0.0], [0.0, 0.1, -1.0]]));
    }
    file
}

fn tipsy() -> Vec<Made> {
    let all = tipsy_bytes(&super::WHOLE);
    let first = find(&all, &1.0_f32.to_be_bytes());
    Base::new("nbody", "tipsy", all)
        .patch("time", 0, &f64::NAN.to_be_bytes())
        .patch("absurd-total", 8, &[0x7f, 0xff, 0xff, 0xff])
        .patch("negative-total", 8, &[0xff; 4])
        .patch("dimensions", 12, &[0, 0, 0, 2])
        .patch("absurd-gas", 16, &[0x7f, 0xff, 0xff, 0xff])
        .patch("other-gas", 16, &[0, 0, 0, 1])
        .patch(
            "absurd-counts",
            8,
            &[0x7f, 0xff, 0xff, 0xff, 0, 0, 0, 3, 0, 0, 0, 0, 0x7f, 0xff, 0xff, 0xff],
        )
        .cut_at("cut-in-head", 20)
        .cut_at("cut-behind-head", first)
        .cut_at("cut-in-particles", first + 50)
        .file("nan", tipsy_bytes(&super::NAN))
        .file("zero", tipsy_bytes(&[]))
        .made
}
