use super::*;
use crate::read::pieces;
use crate::read::text_samples::*;
use glam::DVec3;
use proptest::prelude::*;

fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    pieces::steps(FORMAT, bytes)
}

fn read(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
    pieces::read(FORMAT, bytes, step)
}

/// The only step of `text`.
#[track_caller]
fn only(text: &str) -> Result<RawParticles, ParseError> {
    let steps = steps(text.as_bytes()).unwrap();
    assert_eq!(steps.len(), 1);
    read(text.as_bytes(), &steps[0])
}

#[track_caller]
fn fault(text: &str) -> String {
    only(text).unwrap_err().to_string()
}

fn dump(bounds: &str, columns: &str, rows: &[&str]) -> String {
    let rows: String = rows.iter().map(|row| format!("{row}\n")).collect();
    let count = rows.lines().count();
    format!(
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{count}\n{bounds}ITEM: ATOMS {columns}\n{rows}"
    )
}

const BOX: &str = "ITEM: BOX BOUNDS pp pp pp\n-10 10\n0 5\n100 104\n";

#[test]
fn agrees_with_the_same_particles_raw() {
    let bytes = sample("single_frames/custom.lammpstrj");
    let steps = steps(&bytes).unwrap();
    assert_eq!(steps.len(), 1);
    let particles = read(&bytes, &steps[0]).unwrap();
    assert_agrees_with_raw(&particles);
    assert_eq!(whole(&particles, "id")[..2], [9459, 9568]);
    assert_eq!(whole(&particles, "type")[0], 1);
    assert_eq!(real(&particles, "velocity")[..4], [-4.783, 0.0314533, 0.280406, -0.594408]);
    assert_eq!(attribute(&particles, "velocity").components, 3);
    assert_eq!(particles.attributes.len(), 3);
    assert_eq!((particles.step, particles.time), (Some(0), None));
}

#[test]
fn steps_of_one_file() {
    let bytes = sample("lammps_drop/drop_2frames.lammpstrj");
    let steps = steps(&bytes).unwrap();
    let numbers: Vec<_> = steps.iter().map(|step| step.number).collect();
    assert_eq!(numbers, [Some(0), Some(400)]);
    let range = |step: &Step| step.byte_range().expect("text").clone();
    assert_eq!(range(&steps[0]).end, range(&steps[1]).start);
    assert_eq!(range(&steps[1]).end, bytes.len());
    let second = read(&bytes, &steps[1]).unwrap();
    assert_eq!(second.positions.len(), 200);
    assert_eq!(second.positions.get(0), DVec3::new(-0.957812, -0.49793, 0.336167));
    assert_eq!(second.step, Some(400));
}

#[test]
fn dump_in_gzip() {
    let bytes = sample("lammps_drop/dump.drop.1200.lammps.gz");
    let steps = steps(&bytes).unwrap();
    let particles = read(&bytes, &steps[0]).unwrap();
    assert_eq!(particles.positions.len(), 4461);
    let mut ids = whole(&particles, "id").to_vec();
    ids.sort_unstable();
    assert!(ids.into_iter().eq(1..=4461));
}

#[test]
fn scaled_positions_fill_the_box() {
    for columns in ["xs ys zs id", "xsu ysu zsu id"] {
        let particles =
            only(&dump(BOX, columns, &["0 0 0 1", "0.5 1 0.25 2", "1.5 -1 2 3"])).unwrap();
        let expected =
            [DVec3::new(-10., 0., 100.), DVec3::new(0., 5., 101.), DVec3::new(20., -5., 108.)];
        assert_eq!(f64_positions(&particles), expected);
    }
    let without = dump("", "xs ys zs", &["0 0 0"]);
    assert!(fault(&without).contains("no ITEM: BOX BOUNDS"));
    let old = "ITEM: BOX BOUNDS\n-10 10\n0 5\n100 104\n";
    let particles = only(&dump(old, "xs ys zs", &["0 0.2 0"])).unwrap();
    assert_eq!(f64_positions(&particles), [DVec3::new(-10., 1., 100.)]);
}

#[test]
fn tilted_boxes() {
    // xlo 0, xhi 10, ylo 0, yhi 8, zlo 1, zhi 5; xy 3, xz -2, yz -1: the bounding box is from
    // min(0, 3, -2, 1) = -2 to 10 + 3 in x, and from -1 to 8 in y.
    let bounds = "ITEM: BOX BOUNDS xy xz yz pp pp pp\n-2 13 3\n-1 8 -2\n1 5 -1\n";
    let rows = ["0 0 0", "1 0 0", "0 1 0", "0 0 1", "0.5 0.5 0.5"];
    let particles = only(&dump(bounds, "xs ys zs", &rows)).unwrap();
    let cell = particles.cell.expect("a cell");
    assert_eq!(cell.origin, DVec3::new(0., 0., 1.));
    let vectors = [[10., 0., 0.], [3., 8., 0.], [-2., -1., 4.]];
    assert_eq!(cell.vectors, vectors.map(DVec3::from_array));
    assert_eq!(cell.periodic, [true; 3]);
    let expected = [
        DVec3::new(0., 0., 1.),
        DVec3::new(10., 0., 1.),
        DVec3::new(3., 8., 1.),
        DVec3::new(-2., -1., 5.),
        DVec3::new(5.5, 3.5, 3.),
    ];
    assert_eq!(f64_positions(&particles), expected);

    let general = "ITEM: BOX BOUNDS abc origin pp fs pp\n1 2 0 10\n0 3 1 20\n-1 0 4 30\n";
    let particles = only(&dump(general, "xs ys zs", &rows)).unwrap();
    let cell = particles.cell.expect("a cell");
    assert_eq!(cell.origin, DVec3::new(10., 20., 30.));
    assert_eq!(cell.vectors[2], DVec3::new(-1., 0., 4.));
    assert_eq!(cell.periodic, [true, false, true]);
    let expected = [
        DVec3::new(10., 20., 30.),
        DVec3::new(11., 22., 30.),
        DVec3::new(10., 23., 31.),
        DVec3::new(9., 20., 34.),
        DVec3::new(10., 22.5, 32.5),
    ];
    assert_eq!(f64_positions(&particles), expected);
}

#[test]
fn wrapped_positions_have_precedence() {
    let columns = "zs ys xs zu yu xu z y x";
    let particles = only(&dump(BOX, columns, &["0 0 0 6 5 4 3 2 1"])).unwrap();
    assert_eq!(f64_positions(&particles), [DVec3::new(1., 2., 3.)]);
    assert_eq!(real(&particles, "xu"), [4.]);
    let particles = only(&dump(BOX, "zs ys xs zu yu xu x", &["0 0 0 6 5 4 1"])).unwrap();
    assert_eq!(f64_positions(&particles), [DVec3::new(4., 5., 6.)]);
    let flat = only(&dump(BOX, "id x y", &["1 2 3"])).unwrap();
    assert_eq!(f64_positions(&flat), [DVec3::new(2., 3., 0.)]);
    let none = fault(&dump(BOX, "id type c_pe", &["1 2 3"]));
    assert!(none.contains(r#""id", "type", "c_pe": dump"#), "{none}");
}

#[test]
fn columns_of_every_type() {
    let columns =
        "element id mol type x y z fx fy fz radius vx vy f_ave[1] ix v_name typelabel note";
    let rows = [
        "C 9007199254740993 4 1 0 0 0 1 2 3 0.5 7 8 1e-3 -1 2 3 ok",
        "12 2 5 1 1 1 1 4 5 6 0.25 9 10 nan 0 inf 4 5",
    ];
    let particles = only(&dump(BOX, columns, &rows)).unwrap();
    assert_eq!(whole(&particles, "id"), [9_007_199_254_740_993, 2]);
    assert_eq!(whole(&particles, "mol"), [4, 5]);
    assert_eq!(real(&particles, "force"), [1., 2., 3., 4., 5., 6.]);
    assert_eq!(real(&particles, "radius"), [0.5, 0.25]);
    assert_eq!(real(&particles, "vy"), [8., 10.]);
    assert_eq!(real(&particles, "ix"), [-1., 0.]);
    assert!(real(&particles, "f_ave[1]")[1].is_nan());
    let names: Vec<_> = particles.attributes.iter().map(|a| &*a.name).collect();
    let expected = [
        "element",
        "id",
        "mol",
        "type",
        "force",
        "radius",
        "vx",
        "vy",
        "f_ave[1]",
        "ix",
        "v_name",
        "typelabel",
    ];
    assert_eq!(names, expected);
    assert_eq!(whole(&particles, "element")[0], 6);
    assert!(whole(&particles, "typelabel").iter().all(|code| *code >= 1000));
    let twice = only(&dump(BOX, "x y z vx vy vz vx", &["0 0 0 1 2 3 4"])).unwrap();
    assert_eq!(real(&twice, "velocity"), [1., 2., 3.]);
    assert_eq!(real(&twice, "vx"), [4.]);
}

/// The columns of the examples of LIGGGHTS: the type twice, and blanks at the ends of lines.
#[test]
fn columns_of_liggghts() {
    let columns = "id type type x y z ix iy iz vx vy vz fx fy fz omegax omegay omegaz radius ";
    let row = "7 1 1 0.01 0.02 0.03 0 0 0 1 2 3 4 5 6 7 8 9 0.0025 ";
    let walls = "ITEM: BOX BOUNDS mm ff fs\n-0.05 0.05\n-0.05 0.05\n0 0.15\n";
    let particles = only(&dump(walls, columns, &[row])).unwrap();
    assert_eq!(particles.positions.get(0), DVec3::new(0.01, 0.02, 0.03));
    assert_eq!(whole(&particles, "id"), [7]);
    assert_eq!(real(&particles, "velocity"), [1., 2., 3.]);
    assert_eq!(real(&particles, "omega"), [7., 8., 9.]);
    assert_eq!(real(&particles, "radius"), [0.0025]);
}

#[test]
fn elements_are_the_same_numbers_in_every_frame() {
    let code = |rows: &[&str]| {
        let particles = only(&dump(BOX, "id element x y z", rows)).unwrap();
        whole(&particles, "element").to_vec()
    };
    let first = code(&["1 O 0 0 0", "2 H 0 0 0", "3 wall 0 0 0"]);
    assert_eq!(first[..2], [8, 1]);
    let second = code(&["3 wall 0 0 0", "2 H 0 0 0"]);
    assert_eq!(second, [first[2], 1]);
}

#[test]
fn notes_name_the_cell_and_the_elements() {
    let text = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS xy xz yz pp pp ff\n0 1 0\n\
        0 1 0\n0 1 0\nITEM: ATOMS id element x y z\n1 O 0 0 0\n2 H 0 0 0\nITEM: TIMESTEP\n1\n";
    let notes = notes::notes(text.as_bytes());
    assert_eq!(notes.len(), 2, "{notes:?}");
    assert!(notes[0].contains("simulation cell with periodic boundaries (pp pp ff)"));
    assert!(notes[1].ends_with("\"H\" = 1, \"O\" = 8"), "{notes:?}");
    for end in 0..text.len() {
        notes::notes(&text.as_bytes()[..end]);
    }
    let shrink = text.replace("xy xz yz pp pp ff", "ss ss ss").replace("element", "c");
    let notes = notes::notes(shrink.as_bytes());
    assert!(notes.len() == 1 && !notes[0].contains("periodic"), "{notes:?}");
}

#[test]
fn units_time_blanks_and_line_ends() {
    let text = "\u{feff}\nITEM: UNITS\nlj\nITEM: TIME\n0.5\nITEM: TIMESTEP\n5000000000\n\
        ITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS pp pp ff\n0 1 \n0 1 \n0 1 \n\
        ITEM: ATOMS id x y z \n7 1 2 3 \n\
        ITEM: TIME\n1.5\nITEM: TIMESTEP\n5000000001\nITEM: NUMBER OF ATOMS\n0\n\
        ITEM: BOX BOUNDS pp pp ff\n0 1 \n0 1 \n0 1 \nITEM: ATOMS id x y z \n";
    for text in [text.to_owned(), text.replace('\n', "\r\n")] {
        let bytes = text.as_bytes();
        let steps = steps(bytes).unwrap();
        let found: Vec<_> = steps.iter().map(|step| (step.number, step.time)).collect();
        let expected = [(Some(5_000_000_000), Some(0.5)), (Some(5_000_000_001), Some(1.5))];
        assert_eq!(found, expected);
        let first = read(bytes, &steps[0]).unwrap();
        assert_eq!(f64_positions(&first), [DVec3::new(1., 2., 3.)]);
        assert_eq!((first.step, first.time), (Some(5_000_000_000), Some(0.5)));
        let empty = read(bytes, &steps[1]).unwrap();
        assert_eq!(empty.positions.len(), 0);
        assert!(whole(&empty, "id").is_empty());
    }
}

#[test]
fn last_copy_of_a_repeated_step_wins() {
    let step = |number: i64, x: i64| {
        dump(BOX, "x y z", &[&format!("{x} 0 0")]).replace("STEP\n0", &format!("STEP\n{number}"))
    };
    let text = [step(0, 1), step(10, 2), step(20, 3), step(10, 4), step(20, 5)].concat();
    let steps = steps(text.as_bytes()).unwrap();
    let found: Vec<_> = steps
        .iter()
        .map(|step| {
            let particles = read(text.as_bytes(), step).unwrap();
            (step.index, step.number, particles.positions.get(0).x)
        })
        .collect();
    assert_eq!(found, [(0, Some(0), 1.), (1, Some(10), 4.), (2, Some(20), 5.)]);
}

#[test]
fn truncated_last_step() {
    let bytes = sample("lammps_drop/drop_2frames.lammpstrj");
    let whole = steps(&bytes).unwrap();
    let second = whole[1].start();
    let expected = read(&bytes, &whole[0]).unwrap();
    for len in (second..bytes.len()).step_by(61).chain(second..second + 60) {
        let cut = &bytes[..len];
        let found = steps(cut).unwrap();
        assert_eq!(read(cut, &found[0]).unwrap(), expected, "{len}");
        if let Some(last) = found.get(1) {
            let error = read(cut, last).unwrap_err();
            assert!(error.to_string().contains("perhaps still being written"), "{len}: {error}");
        } else {
            assert!(len < second + 5, "{len}");
        }
    }
    let cut = &bytes[..bytes.len() - 30];
    let error = read(cut, &steps(cut).unwrap()[1]).unwrap_err();
    assert!(error.to_string().contains("column") || error.to_string().contains("expected"));
    // A number without its last digits must not take the place of another step.
    let text =
        "ITEM: TIMESTEP\n12\nITEM: NUMBER OF ATOMS\n0\nITEM: ATOMS x y z\nITEM: TIMESTEP\n12";
    let numbers: Vec<_> = steps(text.as_bytes()).unwrap().iter().map(|s| s.number).collect();
    assert_eq!(numbers, [Some(12), None]);
}

#[test]
fn truncated_step_inside_the_file() {
    let good = dump(BOX, "id x y z", &["1 1 2 3", "2 4 5 6"]);
    for broken in [
        "ITEM: TIMESTEP\n5\nITEM: NUMBER OF ATOMS\n9\nITEM: ATOMS id x y z\n1 1 2 3\n2 4 0.",
        "ITEM: TIMESTEP\n5\nITEM: NUMB",
    ] {
        let text = [broken, &good].concat();
        let steps = steps(text.as_bytes()).unwrap();
        assert_eq!(steps.len(), 2);
        let error = read(text.as_bytes(), &steps[0]).unwrap_err().to_string();
        let expected = format!("cut short at byte {}", broken.len());
        assert!(error.contains(&expected), "{error}");
        assert_eq!(read(text.as_bytes(), &steps[1]).unwrap().positions.len(), 2);
    }
}

#[test]
fn faults_are_described() {
    let cases = [
        (dump(BOX, "x y z", &["1 2"]), "line has 2 of 3 columns"),
        (dump(BOX, "x y z", &["1 2 3 4"]), "more than 3 columns"),
        (dump(BOX, "x y z", &["1 2 W"]), "column 3 has \"W\""),
        (dump(BOX, "id x y z", &["1 1 1 1", "b 1 2 3"]), "column 1 has \"b\""),
        (dump(BOX, "x y z", &["1 2 3"]) + "4 5 6\n", "more lines than the 1 atoms"),
        (dump("ITEM: BOX BOUNDS\n0 1\n0\n0 1\n", "x y z", &[]), "byte 62: box bounds"),
        (dump("ITEM: BOX BOUNDS\n0 1\n0 a\n0 1\n", "x y z", &[]), "byte 62: box bounds"),
        (
            dump(BOX, "x y z", &[]).replace("ATOMS\n0", "ATOMS\n-1"),
            "\"-1\" is not a number of atoms",
        ),
        (dump(BOX, "x y z", &[]).replace("STEP\n0", "STEP\n0.5"), "byte 15: the step is \"0.5\""),
        ("ITEM: TIMESTEP\n0\nITEM: ATOMS x y z\n".into(), "without ITEM: NUMBER OF ATOMS"),
        ("ITEM: TIMESTEP\n0\nITEM: NUMBER OF ENTRIES\n0\nITEM: ENTRIES a\n".into(), "dump custom"),
    ];
    for (text, expected) in cases {
        let found = fault(&text);
        assert!(found.contains(expected), "{found} | {expected}");
    }
    for (text, expected) in [
        ("", "no step yet"),
        ("ITE", "no step yet"),
        ("x,y,z\n", "begins with ITEM: TIMESTEP, not \"x,y,z\""),
        ("junk ITEM: TIMESTEP\n", "not \"junk"),
        ("\u{1}\0\0\u{0}DUMPCUSTOM\u{1}", "binary2txt"),
    ] {
        let found = steps(text.as_bytes()).unwrap_err().to_string();
        assert!(found.contains(expected), "{found} | {expected}");
    }
}

#[test]
fn huge_counts_allocate_nothing() {
    for count in ["9000000000000000000", "99999999999", "99999999999999999999999"] {
        let text = dump(BOX, "x y z", &["1 2 3"]).replace("ATOMS\n1", &format!("ATOMS\n{count}"));
        let found = fault(&text);
        assert!(
            found.contains("expected") || found.contains("is not a number of atoms"),
            "{found}"
        );
    }
}

#[test]
fn a_step_of_another_file_is_an_error() {
    let text = dump(BOX, "x y z", &["1 2 3"]);
    let mut step = steps(text.as_bytes()).unwrap().remove(0);
    let end = step.byte_range().expect("text").end;
    step.end_at(end + 1);
    assert!(read(text.as_bytes(), &step).is_err());
}

#[test]
#[cfg_attr(miri, ignore = "too many bytes for an interpreter")]
fn truncated_files_do_not_panic() {
    cut_everywhere(&sample("lammps_drop/drop_2frames.lammpstrj"), steps, read);
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn damaged_files_do_not_panic(mutations in mutations()) {
        let text = dump(BOX, "id type xs ys zs vx vy vz", &["1 1 0 .5 1 1 2 3", "2 1 0 0 0 4 5 6"]);
        let two = [&*text, &text.replace("STEP\n0", "STEP\n8")].concat();
        read_all(&mutated(two.as_bytes(), &mutations), steps, read);
    }

    #[test]
    fn random_bytes_do_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), letters in letters()) {
        read_all(&bytes, steps, read);
        read_all(&letters, steps, read);
        read_all(&[b"ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n1\nITEM: ATOMS x y z\n", &*letters].concat(), steps, read);
    }

    #[test]
    fn written_steps_round_trip(
        frames in prop::collection::vec(
            prop::collection::vec((any::<i64>(), any::<[f32; 3]>(), any::<[f32; 3]>()), 0..20),
            1..4,
        )
    ) {
        let mut text = String::new();
        for (number, frame) in frames.iter().enumerate() {
            let rows: Vec<String> = frame
                .iter()
                .map(|(id, p, v)| format!("{} {} {id} {} {} {} {}", p[2], v[1], v[0], p[0], p[1], v[2]))
                .collect();
            let rows: Vec<&str> = rows.iter().map(|row| &**row).collect();
            let step = dump(BOX, "z vy id vx x y vz", &rows);
            text += &step.replace("STEP\n0", &format!("STEP\n{number}"));
        }
        let steps = steps(text.as_bytes()).unwrap();
        prop_assert_eq!(steps.len(), frames.len());
        for (step, frame) in steps.iter().zip(&frames) {
            let found = read(text.as_bytes(), step).unwrap();
            let bits = |v: DVec3| v.as_vec3().to_array().map(f32::to_bits);
            for (i, (id, p, v)) in frame.iter().enumerate() {
                prop_assert_eq!(whole(&found, "id")[i], *id);
                prop_assert_eq!(bits(found.positions.get(i)), p.map(f32::to_bits));
                let velocity = &real(&found, "velocity")[3 * i..][..3];
                prop_assert_eq!(bits(DVec3::from_slice(velocity)), v.map(f32::to_bits));
            }
        }
    }
}
