//! Simulation cells of molecular files, against cells computed by hand.

use glam::DVec3;

use super::damage::sample;
use super::{amber, dcd, gro, lammps, mmcif, pdb, trr, xtc};
use crate::format::Format;
use spherule_frame::SimulationCell;

/// The cells of all steps of `bytes`.
fn cells(format: Format, bytes: &[u8]) -> Vec<Option<SimulationCell>> {
    let steps = format.steps(bytes).expect("steps");
    let cell = |step| format.read(bytes, step).expect("particles").cell;
    steps.iter().map(cell).collect()
}

#[track_caller]
fn assert_cell(found: Option<SimulationCell>, expected: [[f64; 3]; 3]) {
    let found = found.expect("a cell");
    assert_eq!(found.origin, DVec3::ZERO);
    assert_eq!(found.periodic, [true; 3]);
    for (found, expected) in found.vectors.into_iter().zip(expected) {
        let distance = found.distance(DVec3::from_array(expected));
        assert!(distance < 1e-6, "{found} instead of {expected:?}");
    }
}

const fn diagonal([x, y, z]: [f64; 3]) -> [[f64; 3]; 3] {
    [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]]
}

/// `bytes` with the first occurrence of `old` replaced.
#[track_caller]
fn replaced(bytes: &[u8], old: &[u8], new: &[u8]) -> Vec<u8> {
    let at = memchr::memmem::find(bytes, old).expect("the old bytes");
    [&bytes[..at], new, &bytes[at + old.len()..]].concat()
}

fn big_endian(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_be_bytes()).collect()
}

#[expect(clippy::cast_possible_truncation, reason = "exact in f32")]
fn big_endian_f32(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|n| (*n as f32).to_be_bytes()).collect()
}

/// A triclinic cell as GROMACS has them.
const TILTED: [f64; 9] = [3.0, 0.0, 0.0, 0.5, 2.5, 0.0, -0.25, 0.75, 2.0];
const TILTED_EDGES: [[f64; 3]; 3] = [[3.0, 0.0, 0.0], [0.5, 2.5, 0.0], [-0.25, 0.75, 2.0]];
const STRAIGHT: [f64; 9] = [3.0, 0.0, 0.0, 0.0, 2.5, 0.0, 0.0, 0.0, 2.0];

#[test]
fn gromacs_trajectories_have_cells() {
    for (format, name) in [
        (xtc::FORMAT, "water.xtc"),
        (xtc::FORMAT, "large.xtc"),
        (xtc::FORMAT, "few.xtc"),
        (trr::FORMAT, "single.trr"),
        (trr::FORMAT, "double.trr"),
    ] {
        let bytes = sample(&format!("molecules/{name}"));
        let found = cells(format, &bytes);
        assert!(found.len() > 1);
        for cell in found {
            assert_cell(cell, diagonal([3.0, 2.5, 2.0]));
        }
        let encode = match name {
            "double.trr" => big_endian,
            _ => big_endian_f32,
        };
        let tilted = replaced(&bytes, &encode(&STRAIGHT), &encode(&TILTED));
        assert_cell(cells(format, &tilted)[0], TILTED_EDGES);
        // No box, and a damaged one
        for numbers in [[0.0; 9], [f64::NAN; 9]] {
            let bytes = replaced(&bytes, &encode(&STRAIGHT), &encode(&numbers));
            assert_eq!(cells(format, &bytes)[0], None, "{name}");
        }
    }
}

#[test]
fn gro_files_have_cells_in_their_last_line() {
    let with = |box_line: &str| {
        let text = format!("title\n1\n    1SOL     OW    1   0.100   0.200   0.300\n{box_line}\n");
        cells(gro::FORMAT, text.as_bytes())[0]
    };
    assert_cell(with("   3.00000   2.50000   2.00000"), diagonal([3.0, 2.5, 2.0]));
    let tilted = "3.0 2.5 2.0 0.0 0.0 0.5 0.0 -0.25 0.75";
    assert_cell(with(tilted), TILTED_EDGES);
    // No blanks between the numbers of a large box
    let large = "1000.000002000.500003000.25000   0.00000   0.00000 500.00000   0.00000-250.00000 750.00000";
    assert_cell(with(large), [[1000.0, 0.0, 0.0], [500.0, 2000.5, 0.0], [-250.0, 750.0, 3000.25]]);
    for damaged in ["0.0 0.0 0.0", "3.0 2.5 2.0 1.0", "3.0 2.5e 2.0", "1e999 2.0 3.0"] {
        assert_eq!(with(damaged), None, "{damaged}");
    }
}

#[test]
fn dcd_files_have_cells_with_angles_or_cosines() {
    let bytes = sample("molecules/big-endian.dcd");
    let old = big_endian(&[30.0, 0.0, 25.0, 0.0, 0.0, 20.0]);
    for cell in cells(dcd::FORMAT, &bytes) {
        assert_cell(cell, diagonal([30.0, 25.0, 20.0]));
    }
    for cell in cells(dcd::FORMAT, &sample("molecules/fixed.dcd")) {
        assert_cell(cell, diagonal([30.0, 25.0, 20.0]));
    }
    // a, gamma, b, beta, alpha, c: gamma is 120 degrees
    let with =
        |numbers: [f64; 6]| cells(dcd::FORMAT, &replaced(&bytes, &old, &big_endian(&numbers)))[0];
    let hexagonal = [[3.0, 0.0, 0.0], [-2.0, 12.0_f64.sqrt(), 0.0], [0.0, 0.0, 5.0]];
    assert_cell(with([3.0, 120.0, 4.0, 90.0, 90.0, 5.0]), hexagonal);
    assert_cell(with([3.0, -0.5, 4.0, 0.0, 0.0, 5.0]), hexagonal);
    // beta 60 degrees: c = 5 (1/2, 0, sqrt(3)/2)
    let monoclinic = [[3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [2.5, 0.0, 18.75_f64.sqrt()]];
    assert_cell(with([3.0, 90.0, 4.0, 60.0, 90.0, 5.0]), monoclinic);
    assert_eq!(with([0.0; 6]), None);
    assert_eq!(with([3.0, 90.0, 4.0, 200.0, 90.0, 5.0]), None);
    assert_eq!(with([f64::NAN, 90.0, 4.0, 90.0, 90.0, 5.0]), None);
    for cell in cells(dcd::FORMAT, &sample("molecules/x-plor.dcd")) {
        assert_eq!(cell, None);
    }
    let has_note = |bytes: &[u8]| {
        let notes = dcd::FORMAT.reader().notes(bytes);
        notes.iter().any(|note| note.contains("simulation cell"))
    };
    assert!(has_note(&bytes) && !has_note(&replaced(&bytes, &old, &big_endian(&[0.0; 6]))));
    // Symmetric matrices of newer versions of CHARMM. The last number of the header is the version, here 24
    let newer = |numbers: [f64; 6]| {
        let mut bytes = replaced(&bytes, &old, &big_endian(&numbers));
        bytes[84..88].copy_from_slice(&36_i32.to_be_bytes());
        (cells(dcd::FORMAT, &bytes)[0], has_note(&bytes))
    };
    let matrix = [4.0, 0.5, 5.0, -0.25, 0.25, 6.0];
    let rows = [[4.0, 0.5, -0.25], [0.5, 5.0, 0.25], [-0.25, 0.25, 6.0]];
    assert_cell(newer(matrix).0, rows);
    assert_ne!(with(matrix), newer(matrix).0);
    // Without the version: as angles these are none
    assert_cell(
        with([4.0, 2.5, 5.0, -0.25, 0.75, 6.0]),
        [[4.0, 2.5, -0.25], [2.5, 5.0, 0.75], [-0.25, 0.75, 6.0]],
    );
    assert_cell(newer([300.0, 90.0, 250.0, 90.0, 90.0, 200.0]).0, diagonal([300.0, 250.0, 200.0]));
    assert_cell(newer([3.0, 120.0, 4.0, 90.0, 90.0, 5.0]).0, hexagonal);
    assert_eq!(newer([f64::NAN; 6]), (None, false));
    assert_eq!(newer([4.0, 100.0, 5.0, 300.0, -7.0, 6.0]), (None, false));
}

#[test]
fn amber_files_have_cells() {
    for name in ["classic.nc", "offset64.nc", "data64.nc"] {
        let bytes = sample(&format!("molecules/{name}"));
        let old = big_endian(&[30.0, 25.0, 20.0]);
        if memchr::memmem::find(&bytes, &old).is_none() {
            continue;
        }
        for cell in cells(amber::FORMAT, &bytes) {
            assert_cell(cell, diagonal([30.0, 25.0, 20.0]));
        }
        let bytes = replaced(&bytes, &big_endian(&[90.0; 3]), &big_endian(&[90.0, 90.0, 120.0]));
        let hexagonal = [[30.0, 0.0, 0.0], [-12.5, 12.5 * 3.0_f64.sqrt(), 0.0], [0.0, 0.0, 20.0]];
        assert_cell(cells(amber::FORMAT, &bytes)[0], hexagonal);
        let bytes = replaced(&bytes, &old, &big_endian(&[30.0, f64::NAN, 20.0]));
        assert_eq!(cells(amber::FORMAT, &bytes)[0], None);
    }
    let restart = sample("molecules/restart.ncrst");
    assert_cell(cells(amber::FORMAT, &restart)[0], diagonal([3.0; 3]));
}

#[test]
fn pdb_files_have_cells() {
    for cell in cells(pdb::FORMAT, &sample("molecules/models.pdb")) {
        assert_cell(cell, diagonal([30.0, 25.0, 20.0]));
    }
    let atom = "ATOM      1  N   ALA A   1     362.864 -78.459 936.442  1.00 16.50           N\n";
    let record = |numbers: &str| format!("CRYST1{numbers} P 1           1\n");
    let hexagonal = record("    3.000    4.000    5.000  90.00  90.00 120.00");
    let edges = [[3.0, 0.0, 0.0], [-2.0, 12.0_f64.sqrt(), 0.0], [0.0, 0.0, 5.0]];
    // A model with a cell of its own, and one with that of the file
    let own = record("    6.000    7.000    8.000  90.00  90.00  90.00");
    let text =
        format!("{hexagonal}MODEL        1\n{own}{atom}ENDMDL\nMODEL        2\n{atom}ENDMDL\n");
    let found = cells(pdb::FORMAT, text.as_bytes());
    assert_cell(found[0], diagonal([6.0, 7.0, 8.0]));
    let text = format!("{hexagonal}{atom}ENDMDL\n{atom}ENDMDL\n");
    for cell in cells(pdb::FORMAT, text.as_bytes()) {
        assert_cell(cell, edges);
    }
    for numbers in [
        "    1.000    1.000    1.000  90.00  90.00  90.00",
        "    3.000    x.000    5.000  90.00  90.00  90.00",
        "    3.000    4.000    5.000",
    ] {
        let text = format!("{}{atom}", record(numbers));
        assert_eq!(cells(pdb::FORMAT, text.as_bytes())[0], None, "{numbers}");
    }
}

#[test]
fn mmcif_files_have_cells() {
    let loop_ = "loop_\n_atom_site.Cartn_x\n_atom_site.Cartn_y\n_atom_site.Cartn_z\n1 2 3\n4 5 6\n";
    let with = |cell: &str| {
        let text = format!("data_A\n{cell}{loop_}");
        cells(mmcif::FORMAT, text.as_bytes())[0]
    };
    let angles = "_cell.angle_alpha 90\n_cell.angle_beta  90.000\n_cell.angle_gamma 120(1)\n";
    let lengths = "_cell.length_a   3.0(2)\n_cell.length_b 4.0\n_cell.length_c 5\n";
    let edges = [[3.0, 0.0, 0.0], [-2.0, 12.0_f64.sqrt(), 0.0], [0.0, 0.0, 5.0]];
    assert_cell(with(&[lengths, angles].concat()), edges);
    assert_eq!(with(angles), None);
    assert_eq!(with(&lengths.replace("4.0", "?")), None);
    assert_eq!(with(&[&lengths.replace("4.0", "-4"), angles].concat()), None);
    assert_eq!(with(""), None);
}

#[test]
fn lammps_binary_dumps_have_cells_and_boundaries() {
    let bytes = sample("molecules/custom.lammpsbin");
    // In the header, the sides of the box around the tilted one: 4.10394 = lx + xy + xz, 3.76195 = ly + yz
    let (xy, xz, yz) = (0.5129927840030091, 0.1709975946676697, 0.3419951893353394);
    let edges = [
        [4.103942272024073 - xy - xz, 0.0, 0.0],
        [xy, 3.761947082688733 - yz, 0.0],
        [xz, yz, 3.4199518933533937],
    ];
    let found = cells(lammps::BINARY, &bytes);
    assert_eq!(found.len(), 3);
    assert_cell(found[0], edges);
    // After the names, the numbers of the step and of atoms, and the flag of a tilted box: flags of boundaries
    let mut fixed = bytes.clone();
    fixed[18 + 24 + 4 + 2 * 8..][..4].copy_from_slice(&1_i32.to_le_bytes());
    fixed[18 + 24 + 4 + 2 * 8 + 4..][..4].copy_from_slice(&2_i32.to_le_bytes());
    let cell = cells(lammps::BINARY, &fixed)[0].expect("a cell");
    assert_eq!(cell.periodic, [true, true, false]);
    let mut damaged = bytes;
    damaged[18 + 24 + 28..][..8].copy_from_slice(&f64::NAN.to_le_bytes());
    assert_eq!(cells(lammps::BINARY, &damaged)[0], None);
}

#[test]
fn pdb_cells_behind_models_belong_to_the_model_before() {
    let atom = "ATOM      1  N   ALA A   1     362.864 -78.459 936.442  1.00 16.50           N\n";
    let model = |edge: f64| {
        let cell =
            format!("CRYST1{edge:9.3}{edge:9.3}{edge:9.3}  90.00  90.00  90.00 P 1           1\n");
        (format!("MODEL        {edge}\n{atom}ENDMDL\n"), cell)
    };
    let (behind, before) = [2.0, 3.0, 4.0]
        .map(model)
        .into_iter()
        .fold((String::new(), String::new()), |(behind, before), (model, cell)| {
            (behind + &model + &cell, before + &cell + &model)
        });
    for text in [behind, before] {
        let found = cells(pdb::FORMAT, format!("{text}END\n").as_bytes());
        assert_eq!(found.len(), 3);
        for (cell, edge) in found.into_iter().zip([2.0, 3.0, 4.0]) {
            assert_cell(cell, diagonal([edge; 3]));
        }
    }
}
