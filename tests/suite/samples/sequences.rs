//! Sample sequences: found, ordered, gaps reported, every frame read and rendered.

use std::fs;

use glam::Vec3;
use spherule_formats::sequence::{PART_ATTRIBUTE, SequenceError};
use spherule_formats::{
    Attribute, AttributeData, FrameFile, Positions, Sequence, SequenceInput, write,
};

use crate::harness::{Workshop, sample};
use crate::picture::Picture;

/// The sequence at `path` below the samples.
#[track_caller]
fn open(path: &str) -> Sequence {
    let input = SequenceInput::from_path(sample(path));
    Sequence::open(&input).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// Frame numbers and particle counts, every frame read.
#[track_caller]
fn counts(sequence: &Sequence) -> Vec<(i64, usize)> {
    let frames = sequence.frames().iter().enumerate();
    frames
        .map(|(index, frame)| {
            let particles = sequence.load_raw(index).expect("a whole frame");
            (frame.number, particles.positions.len())
        })
        .collect()
}

/// Renders `path` small; the images must be there and show that something is covered exactly
/// where there are particles.
#[track_caller]
fn render(path: &str, expected: &[(i64, usize)]) {
    let workshop = Workshop::new();
    let input = sample(path).display().to_string();
    let size = ["--width", "48", "--height", "27", "--samples", "1"];
    let arguments = [&["render", &input, "-o", "f.####.exr"][..], &size].concat();
    workshop.run(&arguments).expect(0);
    for (frame, count) in expected {
        let picture = Picture::open(&workshop.join(format!("f.{frame:04}.exr")));
        assert_eq!((picture.width, picture.height), (48, 27));
        let facts = picture.facts.as_ref().expect("facts");
        assert_eq!(facts["frame"], *frame, "{path}");
        assert_eq!(facts["particles"], *count, "{path}");
        let covered = picture.floats("A").iter().any(|a| *a > 0.0);
        assert_eq!(covered, *count > 0, "{path} frame {frame}");
    }
}

/// Checks that `path` has these frames and notes, and that they render.
#[track_caller]
fn check(path: &str, expected: &[(i64, usize)], notes: &[&str]) {
    let sequence = open(path);
    assert_eq!(sequence.notes(), notes, "{path}");
    assert_eq!(counts(&sequence), expected, "{path}");
    render(path, expected);
}

#[test]
fn emitter_starts_without_particles() {
    let expected = [(1, 0), (2, 0), (3, 90), (4, 300), (5, 480), (10, 1410)];
    let note = "frame numbers go up by 1, but jump from 5 to 10";
    check("emitter_sph/ParticleData_Fluid_#.bgeo", &expected, &[note]);
    check("emitter_sph/ParticleData_Fluid_#.vtk", &[(1, 0), (3, 90)], &[]);
}

#[test]
fn two_formats_in_one_directory_are_not_mixed() {
    let input = SequenceInput::from_path(sample("emitter_sph"));
    match Sequence::open(&input) {
        Err(SequenceError::Ambiguous { groups, .. }) => {
            let patterns: Vec<&str> = groups.iter().map(|g| g.pattern.as_str()).collect();
            assert_eq!(patterns, ["ParticleData_Fluid_#.bgeo", "ParticleData_Fluid_#.vtk"]);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn dumps_of_which_one_is_gzipped() {
    let expected = [0, 400, 800, 1200, 2000].map(|step| (step, 200));
    let note = "frame numbers go up by 400, but jump from 1200 to 2000";
    check("lammps_drop/steps", &expected, &[note]);
}

#[test]
fn four_steps_in_one_file() {
    let expected = [0, 400, 800, 1200].map(|step| (step, 200));
    check("lammps_drop/drop_4frames.lammpstrj", &expected, &[]);
    // The same steps as files of their own, in whatever order.
    let (whole, files) = (open("lammps_drop/drop_4frames.lammpstrj"), open("lammps_drop/steps"));
    for index in 0..4 {
        assert_eq!(
            whole.load_raw(index).expect("a step").positions,
            files.load_raw(index).expect("a file").positions
        );
    }
}

#[test]
fn the_dam_break_of_the_examples() {
    let path = "../../examples/dam-break";
    let expected = [1, 3, 5, 7, 9, 11, 13, 15, 17].map(|frame| (frame, 10_422));
    check(path, &expected, &[]);
}

#[test]
fn fluid_and_obstacle_are_parts_of_one_step() {
    let path = "pysph/dam_break_3d_*_#.vtu";
    check(path, &[(100, 2880 + 36)], &[]);
    let mut sequence = open(path);
    assert_eq!(sequence.part_names(), ["fluid", "obstacle"]);
    let merged = sequence.load_raw(0).expect("both parts");
    let part = merged
        .attributes
        .iter()
        .find(|a| a.name == PART_ATTRIBUTE)
        .expect("an attribute that tells the parts apart");
    let of = |value: f64| (0..part.count()).filter(|i| part.data.get_f64(*i) == value).count();
    assert_eq!((of(0.0), of(1.0)), (2880, 36));

    let obstacle = FrameFile::open(&sample("pysph/dam_break_3d_obstacle_00100.vtu"))
        .and_then(|file| file.read(0))
        .expect("the obstacle");
    let (Positions::F64(all), Positions::F64(last)) = (&merged.positions, &obstacle.positions)
    else {
        panic!("PySPH writes doubles");
    };
    assert!(all.ends_with(last));

    sequence.keep_parts(&["obstacle".to_owned()]).expect("the part");
    assert_eq!(sequence.load_raw(0).expect("one part").positions, obstacle.positions);
}

#[test]
fn part_can_be_selected_on_the_command_line() {
    let workshop = Workshop::new();
    let input = sample("pysph/dam_break_3d_*_#.vtu").display().to_string();
    let size = ["--width", "48", "--height", "27", "--samples", "1"];
    let arguments = ["render", &input, "-o", "f.exr", "--parts", "obstacle"];
    workshop.run(&[&arguments[..], &size].concat()).expect(0);
    let facts = Picture::open(&workshop.join("f.exr")).facts.expect("facts");
    assert_eq!(facts["particles"], 36);
    // Part of the name will do, and the parts are listed.
    let arguments = ["render", &input, "-o", "g.exr", "--parts", "OBST"];
    workshop
        .run(&[&arguments[..], &size, &["--force"]].concat())
        .expect(0)
        .prints("each step has the parts fluid, obstacle; used: obstacle");
    let arguments = ["render", &input, "-o", "g.exr", "--parts", "wall"];
    workshop
        .run(&arguments)
        .expect(2)
        .prints("no part is called `wall`; the parts are fluid, obstacle");
    workshop.run(&["inspect", &input]).expect(0).prints("each step has the parts fluid, obstacle");
}

#[test]
fn file_metadata_is_reported() {
    let workshop = Workshop::new();
    let text = "2\nLattice=\"9 0 0 0 9 0 0 0 9\" pbc=\"T T T\" Properties=species:S:1:pos:R:3\nO 0 0 0\nH 1 0 0\n";
    fs::write(workshop.join("water.xyz"), text).expect("a file");
    let cell = "simulation cell with periodic boundaries (T T T)";
    let hint = "--cell draws the simulation cell";
    let names = "\"H\" = 1, \"O\" = 8";
    let text = workshop.run(&["inspect", "water.xyz"]).expect(0).text();
    assert!(text.contains(cell) && text.contains(names), "{text}");
    assert_eq!(text.matches(hint).count(), 1, "{text}");
    let size = ["--width", "48", "--height", "27", "--samples", "1"];
    let arguments = ["render", "water.xyz", "-o", "f.exr", "--color-by", "element"];
    workshop
        .run(&[&arguments[..], &size].concat())
        .expect(0)
        .prints(cell)
        .prints(hint)
        .prints(names)
        .prints("colour by `element`, range 1 to 8");
    let drawn = ["still", "water.xyz", "-o", "c.png", "--cell"];
    let errors = workshop.run(&[&drawn[..], &size].concat()).expect(0).errors();
    assert!(errors.contains(cell) && !errors.contains(hint), "{errors}");
}

#[test]
fn ids_are_found_under_tool_specific_names() {
    let workshop = Workshop::new();
    let ids = |file: &str| {
        let input = sample(file).display().to_string();
        let size = ["--width", "48", "--height", "27", "--samples", "1"];
        let arguments = ["render", &input, "-o", "f.exr", "--radius", "0.02", "--force"];
        workshop.run(&[&arguments[..], &size].concat()).expect(0);
        let picture = Picture::open(&workshop.join("f.exr"));
        picture.integers("id.I").to_vec()
    };
    let expected = ids("single_frames/be.ply");
    assert!(expected.iter().any(|id| (1200..20_000).contains(id)), "ids, not indices");
    for file in ["plain.npz", "dualsphysics.csv"] {
        let found = ids(&format!("single_frames/{file}"));
        let same = found.iter().zip(&expected).filter(|(a, b)| a == b);
        // The digits of the text may move an edge.
        assert!(same.count() + 2 >= expected.len(), "{file}");
    }
}

/// Colour by speed is only what `auto` chooses: a frame without velocities is drawn all the same,
/// unless they were asked for.
#[test]
fn frames_may_lack_unused_attributes() {
    let workshop = Workshop::new();
    let positions: Vec<Vec3> = (0..20_u8).map(|i| Vec3::X * f32::from(i)).collect();
    let velocity = Attribute {
        name: "velocity".to_owned(),
        components: 3,
        data: AttributeData::F32(vec![1.0; 60]),
    };
    let write = |name, attributes: &[Attribute]| {
        write::vtk::write(&workshop.join(name), &positions, attributes).expect("a file");
    };
    write("f_1.vtk", &[velocity]);
    write("f_2.vtk", &[]);
    let render = |output: &str, more: &[&str]| {
        let size = ["--width", "48", "--height", "27", "--samples", "1"];
        let arguments = [&["render", "f_#.vtk", "-o", output][..], &size, more].concat();
        workshop.run(&arguments)
    };
    render("auto/f.#.exr", &[]).expect(0);
    let picture = Picture::open(&workshop.join("auto/f.2.exr"));
    assert!(picture.floats("A").iter().any(|a| *a > 0.0));

    let ran = render("named/f.#.exr", &["--color-by", "velocity"]).expect(1);
    assert!(ran.errors().contains("no attribute `velocity` for colour"), "{}", ran.errors());
    assert!(workshop.join("named/f.1.exr").exists());
    assert!(!workshop.join("named/f.2.exr").exists());
}
