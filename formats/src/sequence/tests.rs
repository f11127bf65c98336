//! Directories, patterns and lists on disk.

use std::fs;

use glam::{DVec3, Vec3};

use super::notes::ranges;
use super::*;
use crate::{AttributeData, ParticleFrame, RawParticles, native};

struct Dir(tempfile::TempDir);

impl Dir {
    /// A directory with empty files of these names.
    fn with(names: &[String]) -> Self {
        let dir = tempfile::tempdir().expect("a temporary directory");
        for name in names {
            fs::write(dir.path().join(name), b"").expect("writable");
        }
        Self(dir)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn open(&self, name: &str) -> Result<Sequence, SequenceError> {
        Sequence::open(&SequenceInput::from_path(self.path(name)))
    }

    #[track_caller]
    fn numbers(&self, name: &str) -> Vec<i64> {
        let sequence = self.open(name).expect("a sequence");
        sequence.frames().iter().map(|f| f.number).collect()
    }

    #[track_caller]
    fn error(&self, name: &str) -> String {
        self.open(name).expect_err("no sequence").to_string()
    }
}

fn owned(texts: &[&str]) -> Vec<String> {
    texts.iter().map(|t| (*t).to_owned()).collect()
}

fn series(count: i64, name: impl Fn(i64) -> String) -> Vec<String> {
    (1..=count).map(name).collect()
}

#[test]
fn a_directory_of_frames() {
    let mut names = series(17, |i| format!("ParticleData_Fluid_{i}.vtk"));
    names.extend(owned(&[
        "README.md",
        "scene.json",
        "frame_1.png",
        "frame_1.exr",
        "job.toml",
        ".hidden_1.vtk",
        "ParticleData_Fluid_18.vtk.part",
    ]));
    let dir = Dir::with(&names);
    assert_eq!(dir.numbers(""), (1..=17).collect::<Vec<_>>());
    let sequence = dir.open("").expect("a sequence");
    assert!(sequence.notes().is_empty(), "{:?}", sequence.notes());
    assert_eq!(sequence.inputs(1), [dir.path("ParticleData_Fluid_2.vtk")]);
    let error = sequence.load_raw(0).expect_err("empty file").to_string();
    assert!(error.contains("ParticleData_Fluid_1.vtk: byte 0: the file is empty"), "{error}");
}

#[test]
fn part_names_match_fragments_in_any_case() {
    let parts = ["Fluid", "Boundary_0", "Boundary_1", "Oil", "OilRig"].map(str::to_owned);
    let meant = |name: &str| parts_meant(&parts, name);
    assert_eq!(meant("fluid"), [0]);
    assert_eq!(meant("BOUND"), [1, 2]);
    // The whole name goes before a part of one.
    assert_eq!(meant("oil"), [3]);
    assert_eq!(meant("rig"), [4]);
    assert!(meant("gas").is_empty() && meant("").is_empty());
    assert_eq!(parts_meant(&["a".to_owned(), "A".to_owned()], "A"), [1]);
    assert_eq!(parts_meant(&["a".to_owned(), "A".to_owned(), "b".to_owned()], "B"), [2]);
    assert!(parts_meant(&[String::new()], "a").is_empty());
}

#[test]
fn patterns_choose() {
    let mut names = series(3, |i| format!("x_{i}.vtk"));
    names.extend(series(3, |i| format!("x_{i}.bgeo")));
    let dir = Dir::with(&names);
    assert!(dir.error("").contains("2 sequences are here"));
    for pattern in ["x_#.vtk", "x_####.bgeo", "x_%04d.vtk", "x_*.vtk", "x_?.bgeo", "*.vtk"] {
        assert_eq!(dir.numbers(pattern), [1, 2, 3], "{pattern}");
    }
}

#[test]
fn a_mixed_directory_by_pattern() {
    let dir = Dir::with(&owned(&[
        "double_dam_break_frame_01_4732_particles.vtk",
        "double_dam_break_frame_26_4732_particles.vtk",
        "dam_break_frame_9_6859_particles.bgeo",
        "dam_break_frame_23_24389_particles.bgeo",
        "cube_8_particles.vtk",
        "LICENSE",
    ]));
    assert_eq!(dir.numbers("dam_break_frame_*.bgeo"), [9, 23]);
    assert_eq!(dir.numbers("double_dam_break_frame_#_*.vtk"), [1, 26]);
    assert_eq!(dir.numbers("cube_8_particles.vtk"), [8]);
}

#[test]
fn lammps_names() {
    let mut names: Vec<String> = (0..10).map(|i| format!("dump.drop.{}.lammps", i * 400)).collect();
    names[3] += ".gz";
    let dir = Dir::with(&names);
    let expected: Vec<i64> = (0..10).map(|i| i * 400).collect();
    assert_eq!(dir.numbers(""), expected);
    assert_eq!(dir.numbers("dump.drop.#.lammps*"), expected);
    let bare = Dir::with(&owned(&["dump.0", "dump.250", "log.lammps.txt"]));
    assert_eq!(bare.numbers(""), [0, 250]);
}

#[test]
fn parts_and_gaps_are_reported() {
    let mut names = series(9, |i| format!("ParticleData_Fluid_{i}.vtk"));
    names.extend((6..=8).map(|i| format!("ParticleData_Oil_{i}.vtk")));
    names.retain(|n| n != "ParticleData_Fluid_4.vtk");
    let sequence = Dir::with(&names).open("").expect("a sequence");
    assert_eq!(sequence.part_names(), ["Fluid", "Oil"]);
    assert_eq!(
        sequence.notes(),
        [
            "frame numbers go up by 1, but jump from 3 to 5",
            "part `Oil` is missing in 5 of 8 frames: 1-3, 5, 9",
        ]
    );
}

#[test]
fn missing_inputs_are_reported_with_a_remedy() {
    let dir = Dir::with(&owned(&["x_1.vtk", "y.png"]));
    let text = dir.error("x_#.vtu");
    assert!(text.contains("closest of 2 files") && text.contains("x_1.vtk"), "{text}");
    let text = dir.error("x_2.vtk");
    assert!(text.contains("no such file") && text.contains("x_1.vtk"), "{text}");
    // Nothing like it is there
    let text = dir.error("nothing");
    assert!(text.ends_with("nothing: no such file or directory"), "{text}");
    assert!(dir.error("none/x_#.vtk").contains("no such file"));
    fs::remove_file(dir.path("x_1.vtk")).expect("removable");
    assert!(dir.error("").contains("it has 1 .png"));
    fs::remove_file(dir.path("y.png")).expect("removable");
    assert!(dir.error("").contains("empty"));
    fs::create_dir(dir.path("vtk")).expect("writable");
    assert!(dir.error("").contains("`vtk`; give one of them"));
    fs::write(dir.path("a.abc"), b"Ogawa\0").expect("writable");
    assert!(dir.error("").contains("Alembic"));
    let nothing = Sequence::open(&SequenceInput::Files(vec![]));
    assert!(matches!(nothing, Err(SequenceError::NoInput)));
}

#[test]
fn lists_may_have_patterns() {
    let dir = Dir::with(&owned(&["a_1.vtk", "a_2.vtk", "b_7.vtk"]));
    let paths = ["a_#.vtk", "b_7.vtk", "a_1.vtk"].map(|n| dir.path(n)).to_vec();
    let sequence = Sequence::open(&SequenceInput::from_paths(paths)).expect("a sequence");
    let numbers: Vec<i64> = sequence.frames().iter().map(|f| f.number).collect();
    assert_eq!(numbers, [1, 2, 7]);
}

#[test]
fn ranges_are_formatted_compactly() {
    assert_eq!(ranges(&[]), "");
    assert_eq!(ranges(&[1, 2, 3, 7, 9, 10]), "1-3, 7, 9-10");
    assert!(ranges(&(0..99).map(|i| i * 2).collect::<Vec<_>>()).ends_with(", ..."));
}

fn write_frame(path: &Path, positions: Vec<Vec3>, step: i64) {
    let raw = RawParticles {
        positions: crate::Positions::F32(positions),
        attributes: vec![],
        ..RawParticles::default()
    };
    let frame = ParticleFrame::from_raw(raw, DVec3::ZERO);
    native::write(path, &frame, Some(step)).expect("writable");
}

#[test]
fn directories_of_adios_are_named() {
    let dir = Dir::with(&owned(&["data.0", "md.0", "md.idx", "mmd.0"]));
    let error = dir.error(".");
    assert!(error.contains("ADIOS2 data (.bp)") && error.contains("openpmd-pipe"), "{error}");
}

#[test]
fn a_part_of_one_step_is_drawn_if_it_is_named() {
    let mut names = series(3, |i| format!("Fluid_{i}.csv"));
    names.push("Case1.csv".into());
    let dir = Dir::with(&[]);
    for name in &names {
        fs::write(dir.path(name), "x,y,z\n1,2,3\n").expect("writable");
    }
    let mut sequence = dir.open(".").expect("a sequence");
    let count = |sequence: &Sequence| sequence.load(0, DVec3::ZERO).expect("a frame").len();
    assert_eq!((sequence.part_names(), count(&sequence)), (&owned(&[""])[..], 1));
    assert!(sequence.notes()[0].contains("--parts Case"), "{:?}", sequence.notes());
    assert!(sequence.lone_file(1).is_some());
    sequence.keep_parts(&owned(&["Case", "Fluid"])).expect("both");
    let notes = sequence.notes();
    assert!(!notes[0].contains("left out"), "{notes:?}");
    assert_eq!((sequence.frames().len(), count(&sequence)), (3, 2));
    let mut sequence = dir.open(".").expect("a sequence");
    sequence.keep_parts(&owned(&["Case"])).expect("the part");
    assert_eq!((sequence.frames().len(), count(&sequence)), (1, 1));
    let error = dir.open(".").expect("a sequence").keep_parts(&owned(&["Oil"]));
    assert!(error.expect_err("no part").to_string().contains("Case, Fluid"));
}

#[test]
fn frames_are_loaded_and_parts_merged() {
    let dir = Dir::with(&[]);
    for i in [1u8, 2, 10] {
        let at = Vec3::splat(f32::from(i));
        write_frame(&dir.path(&format!("fluid_{i}.spf")), vec![at; 2], i.into());
        if i != 2 {
            write_frame(&dir.path(&format!("wall_{i}.spf")), vec![-at], i.into());
        }
    }
    let sequence = dir.open("").expect("a sequence");
    assert_eq!(sequence.part_names(), ["fluid", "wall"]);
    let loaded = sequence.load_measured(2).expect("readable");
    assert!(loaded.notes.is_empty());
    let on_disk = |path: &std::path::Path| std::fs::metadata(path).expect("a file").len();
    let sizes: Vec<u64> = sequence.inputs(2).into_iter().map(on_disk).collect();
    assert_eq!(loaded.all_bytes, sizes.iter().sum::<u64>());
    assert_eq!(Some(&loaded.content_bytes), sizes.iter().max());
    let last = loaded.particles;
    assert_eq!(last.byte_len(), 3 * 12 + 3 * 4);
    let expected = vec![Vec3::splat(10.0), Vec3::splat(10.0), Vec3::splat(-10.0)];
    assert_eq!(last.positions, crate::Positions::F32(expected));
    assert_eq!(last.attributes[0].data, AttributeData::U32(vec![0, 0, 1]));
    let middle = sequence.load(1, DVec3::ONE).expect("readable");
    assert_eq!(middle.positions, [Vec3::ONE; 2]);
    // Every frame has the attribute, also where a part is missing.
    assert!(middle.attribute(PART_ATTRIBUTE).is_some());
    fs::write(dir.path("wall_1.spf"), b"SPHERULE").expect("writable");
    let error = sequence.load(0, DVec3::ZERO).expect_err("damaged").to_string();
    assert!(error.contains("wall_1.spf: byte 8"), "{error}");
    assert!(sequence.load(2, DVec3::ZERO).is_ok());
}

#[test]
fn thinned_frames_have_the_particles_of_multiples() {
    let dir = Dir::with(&[]);
    let points = |count: u8| (0..count).map(|i| Vec3::new(f32::from(i), 2.0, 1.0)).collect();
    write_frame(&dir.path("alone_1.spf"), points(50), 1);
    write_frame(&dir.path("fluid_2.spf"), points(7), 2);
    write_frame(&dir.path("wall_2.spf"), points(4), 2);
    for (name, count) in [("alone_1.spf", 50_u32), ("", 11)] {
        // A native frame is read in steps, and parts are read as a whole
        let mut sequence = if name.is_empty() {
            fs::remove_file(dir.path("alone_1.spf")).expect("a file");
            dir.open("").expect("a sequence")
        } else {
            dir.open(name).expect("a sequence")
        };
        let whole = sequence.load_raw(0).expect("readable");
        assert_eq!(whole.positions.len(), count as usize);
        sequence.set_thinning(4);
        let thinned = sequence.load_raw(0).expect("readable");
        let ids: Vec<u32> = (0..count).step_by(4).collect();
        let expected: Vec<DVec3> = ids.iter().map(|id| whole.positions.get(*id as usize)).collect();
        let found: Vec<DVec3> =
            (0..thinned.positions.len()).map(|i| thinned.positions.get(i)).collect();
        assert_eq!(found, expected);
        let own = thinned.attributes.iter().find(|own| own.name == "id").expect("ids");
        assert_eq!(own.data, AttributeData::U32(ids));
        sequence.set_thinning(0);
        assert_eq!(sequence.load_raw(0).expect("readable"), whole);
    }
}

#[test]
fn one_file_is_a_sequence_of_its_steps() {
    let dir = Dir::with(&[]);
    write_frame(&dir.path("alone.spf"), vec![Vec3::ONE], 3);
    assert_eq!(dir.numbers("alone.spf"), [0]);
    assert_eq!(dir.numbers(""), [0]);
    let sequence = dir.open("alone.spf").expect("a sequence");
    assert_eq!(sequence.load(0, DVec3::ZERO).expect("readable").len(), 1);
}

/// An array of shape (steps, 1, 3); the particle is at the step's index plus `from`.
fn write_steps(path: &Path, steps: u8, from: u8) {
    let dict = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({steps}, 1, 3), }}");
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend_from_slice(format!("{dict:117}\n").as_bytes());
    for step in 0..steps {
        for _ in 0..3 {
            bytes.extend_from_slice(&f32::from(from + step).to_le_bytes());
        }
    }
    fs::write(path, bytes).expect("writable");
}

#[track_caller]
fn first_x(sequence: &Sequence, index: usize) -> f64 {
    let frame = sequence.load_raw(index).expect("readable");
    frame.positions.get(0).x
}

#[test]
fn steps_of_one_file_are_frames() {
    let dir = Dir::with(&[]);
    let path = dir.path("all_7.npy");
    write_steps(&path, 3, 10);
    let sequence = dir.open("").expect("a sequence");
    let steps: Vec<_> = sequence.frames().iter().map(|f| (f.number, f.parts[0].step)).collect();
    assert_eq!(steps, [(0, Some(0)), (1, Some(1)), (2, Some(2))]);
    // Backwards and from several threads, as a pipeline may.
    std::thread::scope(|scope| {
        for index in [2u8, 0, 1] {
            let sequence = &sequence;
            scope.spawn(move || {
                assert_eq!(first_x(sequence, index.into()), f64::from(10 + index));
            });
        }
    });
    // A file that was written anew is read anew.
    write_steps(&path, 4, 20);
    assert_eq!(first_x(&sequence, 1), 21.0);
    write_steps(&path, 1, 0);
    let error = sequence.load_raw(2).expect_err("gone").to_string();
    assert!(error.contains("step 2 does not exist, the file has 1"), "{error}");
}

#[test]
fn steps_are_numbered_across_files() {
    let dir = Dir::with(&[]);
    for (name, steps, from) in [("a_1.npy", 1, 0), ("a_2.npy", 1, 1), ("a_10.npy", 1, 8)] {
        write_steps(&dir.path(name), steps, from);
    }
    assert_eq!(dir.numbers(""), [1, 2, 10]);
    // Neither first nor last, but its size gives it away.
    write_steps(&dir.path("a_2.npy"), 7, 1);
    let sequence = dir.open("").expect("a sequence");
    let numbers: Vec<i64> = sequence.frames().iter().map(|f| f.number).collect();
    assert_eq!(numbers, (0..9).collect::<Vec<_>>());
    for (index, expected) in (0u8..9).enumerate() {
        assert_eq!(first_x(&sequence, index), f64::from(expected));
    }
}

#[test]
fn file_that_gained_steps_is_reported() {
    let dir = Dir::with(&[]);
    for i in 1..=3 {
        write_steps(&dir.path(&format!("a_{i}.npy")), 1, i);
    }
    let sequence = dir.open("").expect("a sequence");
    write_steps(&dir.path("a_2.npy"), 2, 0);
    assert_eq!(first_x(&sequence, 0), 1.0);
    let error = sequence.load_raw(1).expect_err("two steps").to_string();
    assert!(error.contains("2 time steps where one was expected"), "{error}");
}
