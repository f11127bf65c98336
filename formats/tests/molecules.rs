//! Molecular files that are damaged: the error of each, and how many frames are read all the same. `reference.rs`
//! compares good files with their reference readers.
#![expect(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::{Path, PathBuf};

use spherule_formats::{
    FrameError, FrameFile, MemoryBudget, RawParticles, Sequence, SequenceError, SequenceInput,
};

fn data(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    root.join("../tests/data/molecules").join(name)
}

fn bytes_of(name: &str) -> Vec<u8> {
    fs::read(data(name)).expect("a sample")
}

/// What is done to a sample.
#[derive(Clone, Copy)]
enum Damage {
    /// Only the first bytes are left.
    Cut(usize),
    /// The last bytes are missing.
    Lose(usize),
    /// Big-endian numbers at an offset.
    Big(usize, i32),
    /// Little-endian ones.
    Little(usize, i32),
    /// Text in place of the first such text; bytes of the same length for binary files.
    Text(&'static str, &'static str),
    /// All bytes from an offset on, up to another.
    Fill(usize, usize, u8),
}
use Damage::{Big, Cut, Fill, Little, Lose, Text};

impl Damage {
    fn of(self, name: &str) -> Vec<u8> {
        let mut bytes = bytes_of(name);
        match self {
            Cut(len) => bytes.truncate(len),
            Lose(len) => bytes.truncate(bytes.len() - len),
            Big(at, number) => bytes[at..at + 4].copy_from_slice(&number.to_be_bytes()),
            Little(at, number) => bytes[at..at + 4].copy_from_slice(&number.to_le_bytes()),
            Text(old, new) => {
                let place = bytes.windows(old.len()).position(|w| w == old.as_bytes());
                let at = place.expect("the text is in the sample");
                bytes.splice(at..at + old.len(), new.bytes());
            }
            Fill(from, to, byte) => bytes[from..to].fill(byte),
        }
        bytes
    }
}

/// Frames that are read, and the first error.
fn outcome(name: &str, bytes: Vec<u8>) -> (usize, Option<String>) {
    let path = Path::new(name);
    // The least that readers are called with
    let budget = MemoryBudget::new(64 << 20, "take care");
    let shown = |error: FrameError| {
        let message = error.to_string();
        assert!(!message.contains(char::is_control), "{message}");
        let what = message.strip_prefix(&format!("{name}: "));
        what.expect("an error begins with the path").to_owned()
    };
    match FrameFile::from_bytes_within(path, bytes, budget) {
        Err(error) => (0, Some(shown(error))),
        Ok(file) => {
            let mut read: Vec<_> = (0..file.steps().len()).map(|step| file.read(step)).collect();
            let fault =
                read.iter().position(Result::is_err).map(|step| read.remove(step).map(|_| ()));
            let good = read.iter().filter(|step| step.is_ok()).count();
            (good, fault.and_then(Result::err).map(shown))
        }
    }
}

/// Compares the outcome of each line of a table.
#[track_caller]
fn check(name: &str, table: &[(Damage, usize, &str)]) {
    let mut wrong = String::new();
    for (index, (damage, frames, message)) in table.iter().enumerate() {
        let (found_frames, found) = outcome(name, damage.of(name));
        let found = found.unwrap_or_default();
        if found != *message || found_frames != *frames {
            wrong += &format!("\n{index}: {found_frames} frames, {found}");
        }
    }
    assert!(wrong.is_empty(), "{name}:{wrong}");
}

#[test]
fn damaged_xtc() {
    check(
        "water.xtc",
        &[
            (
                Cut(10),
                0,
                "byte 8: 4 bytes expected here, file has 2 left: the file is cut short, perhaps still being written",
            ),
            (
                Lose(5),
                3,
                "byte 2360: 640 bytes expected here, file has 635 left: the file is cut short, perhaps still being written",
            ),
            // In the middle of the file
            (
                Big(760, 1994),
                3,
                "byte 760: a frame begins with 1995 or 2023, not 1994: the file is damaged here",
            ),
            (Big(4, -1), 0, "byte 4: the number of atoms is -1"),
            (Big(52, 179), 3, "byte 52: 179 positions of 180 atoms"),
            (Big(56, 0), 3, "byte 56: the precision is 0: the file is damaged"),
            (
                Big(60, 2_000_000_000),
                3,
                "byte 60: positions from 2000000000 to 2091: the file is damaged",
            ),
            (
                Big(84, 200),
                3,
                "byte 56: the range 200 of small distances is not in 9..73: the file is damaged",
            ),
            (
                Big(84, 3),
                3,
                "byte 56: the range 3 of small distances is not in 9..73: the file is damaged",
            ),
            (
                Big(88, i32::MAX),
                0,
                "byte 92: 2147483647 bytes expected here, file has 2908 left: the file is cut short, perhaps still being written",
            ),
            (Big(88, -5), 3, "byte 88: the length of the compressed positions is -5"),
            (
                Big(88, 20),
                3,
                "byte 112: the compressed positions end before the last atom: the file is damaged",
            ),
            (
                Fill(92, 740, 0xff),
                3,
                "byte 56: a run of 10 atoms reaches beyond the 180 of the frame",
            ),
        ],
    );
}

#[test]
fn damaged_trr() {
    check(
        "single.trr",
        &[
            (
                Cut(30),
                0,
                "byte 28: 4 bytes expected here, file has 2 left: the file is cut short, perhaps still being written",
            ),
            (
                Lose(5),
                2,
                "byte 1488: 12 particles need 144 bytes, file has 139 left: the file is cut short, perhaps still being written",
            ),
            (
                Big(0, 1992),
                0,
                "byte 0: named like a trr file, but does not begin like one: bytes 00 00 07 c8 00 00 00 0d",
            ),
            (
                Big(552, 1992),
                2,
                "byte 552: a frame does not begin with 1993 and GMX_trn_file: the file is damaged here",
            ),
            (
                Big(32, 5),
                2,
                "byte 24: the box has 5 bytes and the positions, velocities and forces of 12 atoms 144, 144 and 144: neither single nor double precision",
            ),
            (
                Big(52, 146),
                2,
                "byte 24: the box has 36 bytes and the positions, velocities and forces of 12 atoms 146, 144 and 144: neither single nor double precision",
            ),
            (Big(56, -1), 2, "byte 56: the length of the velocities is -1"),
            (Big(64, -1), 2, "byte 64: the number of atoms is -1"),
            (
                Big(64, i32::MAX),
                2,
                "byte 24: the box has 36 bytes and the positions, velocities and forces of 2147483647 atoms 144, 144 and 144: neither single nor double precision",
            ),
            (
                Big(64, 0),
                2,
                "byte 24: the box has 36 bytes and the positions, velocities and forces of 0 atoms 144, 144 and 144: neither single nor double precision",
            ),
        ],
    );
}

#[test]
fn damaged_gro() {
    check(
        "water.gro",
        &[
            (
                Cut(9),
                0,
                "byte 9: no number of atoms after the title: the file is cut short, perhaps still being written",
            ),
            (Lose(40), 2, "byte 2565: columns 61 to 68 of an atom have \"\", not a coordinate"),
            (
                Lose(31),
                2,
                "byte 2634: no box after 12 atoms: the file is cut short, perhaps still being written",
            ),
            (Text("\n12\n", "\ntwelve\n"), 0, "byte 25: \"twelve\" is not a number of atoms"),
            (Text("\n12\n", "\n-12\n"), 0, "byte 25: \"-12\" is not a number of atoms"),
            (
                Text("\n12\n", "\n2000000000\n"),
                0,
                "byte 864: columns 37 to 44 of an atom have \"\", not a coordinate",
            ),
            (
                Text("\n12\n", "\n11\n"),
                0,
                "byte 856: no box after 11 atoms: the file is cut short, perhaps still being written",
            ),
            (
                Text("\n12\n", "\n13\n"),
                0,
                "byte 856: columns 37 to 44 of an atom have \"\", not a coordinate",
            ),
            (
                Text("   2.50000", "   halfway"),
                2,
                "byte 887: no box after 12 atoms: the file is cut short, perhaps still being written",
            ),
            (
                Text("HW1    2", "HW1    2   half "),
                2,
                "byte 97: columns 21 to 28 of an atom have \"half\", not a coordinate",
            ),
            (
                Text("    1SOL     OW    1", "    1SOL     OW    1 no position"),
                2,
                "byte 28: columns 21 to 28 of an atom have \"no posi\", not a coordinate",
            ),
        ],
    );
}

#[test]
fn damaged_dcd() {
    check(
        "charmm.dcd",
        &[
            (
                Cut(50),
                0,
                "byte 0: the record of the header has 84 bytes, file has 46 left: the file is cut short, perhaps still being written",
            ),
            (
                Lose(5),
                3,
                "byte 1548: the record of the z has 80 bytes, file has 79 left: the file is cut short, perhaps still being written",
            ),
            (
                Little(0, 85),
                0,
                "byte 0: named like a dcd file, but does not begin like one: bytes 55 00 00 00 43 4f 52 44",
            ),
            (
                Text("CORD", "VELD"),
                0,
                "a DCD file of velocities, which is not read; give that of positions",
            ),
            (
                Little(88, 83),
                0,
                "byte 88: the record of the header does not end with its length: the file is damaged here",
            ),
            (Little(92, i32::MAX), 4, ""),
            (Little(40, 21), 0, "byte 40: the number of fixed atoms is not in 0..20"),
            (Little(40, -1), 0, "byte 40: the number of fixed atoms is not in 0..20"),
            (Little(348, -1), 0, "byte 348: the number of atoms is -1"),
            (
                Little(348, 21),
                0,
                "byte 412: the record of the x has 80 bytes, 84 expected: the file is damaged here",
            ),
            (
                Little(344, 8),
                0,
                "byte 356: the record of the number of atoms does not end with its length: the file is damaged here",
            ),
            (
                Little(412, 76),
                3,
                "byte 492: the record of the x does not end with its length: the file is damaged here",
            ),
            (
                Little(676, 40),
                3,
                "byte 720: the record of the unit cell does not end with its length: the file is damaged here",
            ),
        ],
    );
}

#[test]
fn damaged_amber() {
    check(
        "offset64.nc",
        &[
            (
                Cut(20),
                0,
                "byte 20: 5 bytes expected here, file has 0 left: the file is cut short, perhaps still being written",
            ),
            (
                Lose(90),
                2,
                "byte 1586: the velocity of frame 2 end at 1628: the file is cut short, perhaps still being written",
            ),
            (
                Big(0, 0x4344_4603),
                0,
                "byte 0: named like a amber file, but does not begin like one: bytes 43 44 46 03 00 00 00 03",
            ),
            (Big(4, i32::MAX), 3, ""),
            (Big(4, -2), 0, "byte 4: the number of records is -2"),
            (
                Big(8, 9),
                0,
                "byte 8: the list of dimensions has the tag 9 and 5 entries, 10 and up to 8192 expected",
            ),
            (
                Big(12, 100_000),
                0,
                "byte 8: the list of dimensions has the tag 10 and 100000 entries, 10 and up to 8192 expected",
            ),
            (
                Big(16, i32::MAX),
                0,
                "byte 20: 2147483647 bytes expected here, file has 1656 left: the file is cut short, perhaps still being written",
            ),
            (
                Text("AMBER", "OTHER"),
                0,
                "a NetCDF file with the conventions \"OTHER\", only those of AMBER are read; export as .vtu or .npy",
            ),
            (
                Text("coordinates", "coordinotes"),
                0,
                "byte 1676: the file has no variable `coordinates`",
            ),
            (
                Cut(300),
                0,
                "byte 300: 4 bytes expected here, file has 0 left: the file is cut short, perhaps still being written",
            ),
        ],
    );
}

#[test]
fn damaged_pdb() {
    check(
        "models.pdb",
        &[
            (
                Text("ALA A   1 ", "ALA A   1   half  "),
                1,
                "byte 113: columns 31 to 38 of an atom have \"alf\", not a coordinate",
            ),
            (
                Text("ALA A   1 ", "ALA A   1         "),
                1,
                "byte 113: columns 31 to 38 of an atom have \"\", not a coordinate",
            ),
            (Cut(120), 0, "byte 113: columns 31 to 38 of an atom have \"\", not a coordinate"),
            (Lose(60), 1, "byte 1008: columns 39 to 46 of an atom have \"\", not a coordinate"),
            (
                Text("-78.459", "-78,459"),
                1,
                "byte 113: columns 39 to 46 of an atom have \"-78,459\", not a coordinate",
            ),
            (
                Text("936.442", "1e3 e m"),
                1,
                "byte 113: columns 47 to 54 of an atom have \"1e3 e m\", not a coordinate",
            ),
            (Text("ATOM      2", "ATOM     2"), 2, ""),
            (Text("936.442", "*******"), 2, ""),
            (Text("HEADER", "HEEDER"), 2, ""),
            (Text("\nENDMDL", "\n#"), 2, ""),
        ],
    );
    let header = "HEADER    NOTHING ELSE\nEND\n";
    let found = outcome("a.pdb", header.into());
    let what = "byte 0: no ATOM or HETATM records: the file has no positions";
    assert_eq!(found, (0, Some(what.to_owned())));
    // A file of UTF-16, one with tabs between the fields, and numbers that are none
    let record =
        "ATOM      1  N   ALA A   1      11.000  12.000  13.000  1.00 16.50           N  \n";
    let wide: Vec<u8> = record.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let marked = [&b"\xff\xfe"[..], &wide].concat();
    let tabs = header.replace("END\n", &record.replace("   ", "\t"));
    let cases = [
        (marked, "UTF-16 text, which is not read; save as UTF-8"),
        (tabs.into_bytes(), what),
        (
            record.replace("13.000", "13.0_0").into_bytes(),
            "byte 0: columns 47 to 54 of an atom have \"13.0_0\", not a coordinate",
        ),
        (
            record.replace("  12.000", "12.0.000").into_bytes(),
            "byte 0: columns 39 to 46 of an atom have \"12.0.000\", not a coordinate",
        ),
    ];
    for (bytes, what) in cases {
        let found = outcome("a.pdb", bytes);
        assert_eq!(found, (0, Some(what.to_owned())));
    }
}

#[test]
fn damaged_mmcif() {
    check(
        "models.cif",
        &[
            (Cut(60), 0, "byte 49: _atom_site has no column Cartn_x"),
            (
                Lose(30),
                1,
                "byte 1177: a row has 10 of 17 values: the file is cut short, perhaps still being written",
            ),
            (Text("Cartn_y", "Cartn_w"), 0, "byte 49: _atom_site has no column Cartn_y"),
            (
                Text("_atom_site.group_PDB", "_atom_site.group_PDB ATOM"),
                0,
                "_atom_site is not a loop; write it as one",
            ),
            (
                Text("\"N\" .", "\n;N\n;\n ."),
                0,
                "_atom_site has text of several lines, which is not read",
            ),
            (Text("ALA 1 ", "ALA 1 half "), 0, "byte 459: \"half\" is not a coordinate"),
            (Text("ALA 1 ", "ALA 1 ? "), 0, "byte 459: \"?\" is not a coordinate"),
            (
                Text("data_MADE", "date_MADE"),
                0,
                "byte 0: named like a mmcif file, but does not begin like one: `date_MAD`",
            ),
            (
                Text("_atom_site.Cartn_z", "_atom_site.Cartn_x"),
                0,
                "byte 49: _atom_site has no column Cartn_z",
            ),
            (
                Text(" 502.001", ""),
                1,
                "byte 1174: a row has 16 of 17 values: the file is cut short, perhaps still being written",
            ),
            (Text("936.442", "936,442"), 0, "byte 475: \"936,442\" is not a coordinate"),
        ],
    );
}

#[test]
fn damaged_lammps_binary() {
    check(
        "custom.lammpsbin",
        &[
            (
                Cut(30),
                0,
                "byte 26: 8 bytes expected here, file has 4 left: the file is cut short, perhaps still being written",
            ),
            (
                Lose(5),
                2,
                "byte 4677: 2048 bytes expected here, file has 2043 left: the file is cut short, perhaps still being written",
            ),
            (
                Little(0, -9),
                0,
                "a LAMMPS binary dump without names of columns, which is not read; run `binary2txt` on it, or dump to a text file",
            ),
            (
                Little(22, 1),
                0,
                "a LAMMPS binary dump without names of columns; run `binary2txt` on it",
            ),
            (Little(38, -1), 0, "byte 34: -4294967264 atoms"),
            (Little(34, i32::MAX), 0, "byte 34: 2147483647 atoms expected, 32 in the blocks"),
            (
                Little(42, 2),
                0,
                "a LAMMPS binary dump with a general triclinic box; run `binary2txt` on it",
            ),
            (
                Text("id type x y z vx vy vz", "id type a b c vx vy vz"),
                2,
                "byte 165: no positions among the columns \"id\", \"type\", \"a\", \"b\", \"c\", \"vx\", \"vy\", \"vz\": dump x y z, xu yu zu, xs ys zs or xsu ysu zsu",
            ),
            (
                Little(146, i32::MAX),
                0,
                "byte 150: 2147483647 bytes expected here, file has 6575 left: the file is cut short, perhaps still being written",
            ),
            (
                Text("id type x y z vx vy vz", "id type x yyz vx vy vz"),
                0,
                "byte 142: 8 columns with 7 names",
            ),
        ],
    );
}

#[test]
fn scaled_positions_are_those_in_the_box() {
    let read = |name: &str, step| -> RawParticles {
        let file = FrameFile::open(&data(name)).expect("a good file");
        file.read(step).expect("a good step")
    };
    for step in 0..3 {
        let (custom, scaled) = (read("custom.lammpsbin", step), read("scaled.lammpsbin", step));
        // Positions outside the box are put back into it by the scaled dump.
        let distances = (0..32).map(|i| custom.positions.get(i).distance(scaled.positions.get(i)));
        let near = distances.filter(|distance| *distance < 1e-12).count();
        assert!(near > 20, "{near}");
        assert_eq!(scaled.step, custom.step);
    }
}

#[test]
fn frames_of_a_trajectory_have_the_properties_of_its_topology() {
    let open = |name: &str| {
        let input = SequenceInput::from_path(data(name));
        Sequence::open(&input).expect("a sequence")
    };
    let mut sequence = open("double.trr");
    sequence.add_topology(&data("water.gro")).expect("a topology");
    for index in 0..2 {
        let particles = sequence.load_raw(index).expect("as many atoms");
        let names: Vec<&str> = particles.attributes.iter().map(|a| a.name.as_str()).collect();
        assert_eq!(names, ["velocity", "element", "residue", "residue_name", "atom_name"]);
        assert_eq!(particles.labels["residue_name"].values().collect::<Vec<_>>(), ["SOL"]);
        assert_eq!(particles.attributes[1].data.get_f64(3), 8.0);
    }
    // Of the first frame of a topology and of one file of several
    let mut sequence = open("water.xtc");
    sequence.add_topology(&data("water.gro")).expect("a topology");
    let error = sequence.load_raw(2).expect_err("other atoms").to_string();
    assert!(error.contains("water.xtc: byte 0: 180 atoms, but the topology"), "{error}");
    assert!(error.ends_with("water.gro has 12; give the topology of this simulation"), "{error}");
    let error = sequence.add_topology(&data("nothing.gro")).expect_err("no file");
    assert!(matches!(error, SequenceError::Topology(_)), "{error}");
}

/// Text of `models` models of `atoms` atoms each: before all of them, before each, each atom, behind each.
fn models(
    head: &str,
    (start, end): (impl Fn(usize) -> String, &str),
    atom: impl Fn(usize, usize) -> String,
) -> String {
    let mut text = head.to_owned();
    for model in 0..MODELS {
        text += &start(model);
        for index in 0..ATOMS {
            text += &atom(model, index);
        }
        text += end;
    }
    text
}

const MODELS: usize = 20;
const ATOMS: usize = 2000;

/// Files that are larger than what is read as a whole.
fn large_texts() -> [(&'static str, String); 5] {
    let place = |model: usize, index: usize| (model + 1, index % 100, index / 100);
    let pad = "#".repeat(30);
    let cif = "data_A\n_cell.length_a 30\n_cell.length_b 40\n_cell.length_c 50\n_cell.angle_alpha 90\n\
               _cell.angle_beta 90\n_cell.angle_gamma 90\nloop_\n_atom_site.group_PDB\n_atom_site.type_symbol\n\
               _atom_site.Cartn_x\n_atom_site.Cartn_y\n_atom_site.Cartn_z\n_atom_site.note\n\
               _atom_site.pdbx_PDB_model_num\n";
    let cif = models(cif, (|_| String::new(), ""), |model, index| {
        let (x, y, z) = place(model, index);
        format!("ATOM C {x}.0 {y}.5 {z}.25 'a{pad}' {}\n", model + 1)
    });
    let cell = "CRYST1   30.000   40.000   50.000  90.00  90.00  90.00 P 1           1\n";
    let pdb = models(
        cell,
        (|model| format!("MODEL     {:4}\n", model + 1), "ENDMDL\n"),
        |model, index| {
            let (x, y, z) = place(model, index);
            format!(
                "ATOM  {:5}  CA  ALA A   1    {x:4}.000{y:4}.000{z:4}.000  1.00  0.00           C\n",
                index + 1
            )
        },
    );
    let start = |model| format!("t={model}.0\n{ATOMS}\n");
    let gro = models("", (start, "   9.00000   9.00000   9.00000\n"), |model, index| {
        let (x, y, z) = place(model, index);
        format!("    1ALA     CA{:5}{x:4}.00000000{y:4}.00000000{z:4}.00000000\n", index + 1)
    });
    let xyz = models("", (|model| format!("{ATOMS}\nTime={model}\n"), ""), |model, index| {
        let (x, y, z) = place(model, index);
        format!("C {x} {y} {z} {pad}{pad}\n")
    });
    let start = |model| {
        format!(
            "ITEM: TIMESTEP\n{model}\nITEM: NUMBER OF ATOMS\n{ATOMS}\nITEM: BOX BOUNDS pp pp pp\n0 9\n0 9\n0 9\n\
                 ITEM: ATOMS x y z note\n"
        )
    };
    let lammps = models("", (start, ""), |model, index| {
        let (x, y, z) = place(model, index);
        format!("{x} {y} {z} a{pad}{pad}\n")
    });
    [("a.cif", cif), ("a.pdb", pdb), ("a.gro", gro), ("a.xyz", xyz), ("a.lammpstrj", lammps)]
}

#[test]
fn steps_of_large_texts_are_read_in_any_order() {
    let dir = tempfile::tempdir().expect("a directory");
    for (name, text) in large_texts() {
        assert!(text.len() > 2 << 20, "{name}: {}", text.len());
        let path = dir.path().join(name);
        fs::write(&path, &text).expect("writable");
        let file = FrameFile::open(&path).expect("a good file");
        assert_eq!(file.steps().len(), MODELS, "{name}");
        assert!(file.bytes().len() < text.len(), "{name} is read in pieces");
        for index in [0, 10, 19, 5, 6, 7, 15, 2, 2] {
            let particles = file.read(index).unwrap_or_else(|error| panic!("{index}: {error}"));
            assert_eq!(particles.positions.len(), ATOMS, "{name}: {index}");
            let last = particles.positions.get(ATOMS - 1);
            assert_eq!(last.x, (index + 1) as f64, "{name}");
            assert_eq!(particles.cell.is_some(), name != "a.xyz", "{name}: {index}");
        }
    }
}
