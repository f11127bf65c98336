//! Names of real outputs, grouped.

use std::path::Path;

use super::*;

fn names(names: &[String]) -> Vec<FileName> {
    names.iter().map(|n| FileName::parse(Path::new(n), None)).collect()
}

fn owned(texts: &[&str]) -> Vec<String> {
    texts.iter().map(|t| (*t).to_owned()).collect()
}

#[track_caller]
fn picked(files: &[String]) -> (FileGroup, Vec<String>) {
    let mut notes = Vec::new();
    let group = pick(Path::new("dir"), names(files), &mut notes).expect("one sequence");
    (group, notes)
}

#[track_caller]
fn ambiguous(files: &[&str]) -> String {
    let error = pick(Path::new("dir"), names(&owned(files)), &mut Vec::new())
        .expect_err("several sequences");
    assert!(matches!(error, SequenceError::Ambiguous { .. }), "{error}");
    error.to_string()
}

fn numbers(group: &FileGroup) -> Vec<i64> {
    group.files.iter().filter_map(|f| f.number).collect()
}

#[test]
fn unpadded_numbers_sort_as_numbers() {
    let files: Vec<String> =
        [10, 9, 2, 1, 11].map(|i| format!("ParticleData_Fluid_{i}.vtk")).into();
    let (group, notes) = picked(&files);
    assert_eq!(numbers(&group), [1, 2, 9, 10, 11]);
    assert_eq!(group.parts, [""]);
    assert!(notes.is_empty());
}

#[test]
fn varying_count_is_not_the_frame_number() {
    let files = owned(&[
        "dam_break_frame_23_24389_particles.bgeo",
        "dam_break_frame_9_6859_particles.bgeo",
    ]);
    assert_eq!(numbers(&picked(&files).0), [9, 23]);
    let constant = owned(&["a_01_4732.vtk", "a_26_4732.vtk"]);
    assert_eq!(numbers(&picked(&constant).0), [1, 26]);
}

#[test]
fn files_of_one_step_become_parts() {
    let files: Vec<String> = (0..4)
        .flat_map(|i| {
            [
                format!("dam_break_3d_fluid_{:05}.vtu", i * 100),
                format!("dam_break_3d_boundary_{:05}.vtu", i * 100),
            ]
        })
        .collect();
    let (group, _) = picked(&files);
    assert_eq!(group.parts, ["boundary", "fluid"]);
    assert_eq!(numbers(&group), [0, 0, 100, 100, 200, 200, 300, 300]);
    let one_step = owned(&["dam_break_3d_fluid_00100.vtu", "dam_break_3d_obstacle_00100.vtu"]);
    let (group, _) = picked(&one_step);
    assert_eq!((numbers(&group), group.parts), (vec![100, 100], owned(&["fluid", "obstacle"])));
}

#[test]
fn objects_of_one_model_become_parts() {
    let files: Vec<String> =
        (1..4).flat_map(|i| [0, 1].map(|o| format!("ParticleData_Fluid_{o}_{i}.vtk"))).collect();
    let (group, _) = picked(&files);
    assert_eq!(group.parts, ["0", "1"]);
    assert_eq!(numbers(&group), [1, 1, 2, 2, 3, 3]);
}

#[test]
fn a_name_of_one_step_is_left_out_of_several() {
    for count in [2, 3, 20] {
        let mut files: Vec<String> = (0..count).map(|i| format!("Part_{i:04}.bi4")).collect();
        files.push("CaseDam0.bi4".into());
        let (group, _) = picked(&files);
        let lone = group.lone.expect("the initial state");
        let notes = lone.notes;
        assert_eq!((lone.parts, lone.others), (BTreeSet::from([0]), owned(&[""])));
        assert!(
            notes[0].starts_with("`CaseDam0.bi4` is left out")
                && notes[0].contains("--parts CaseDam"),
            "{notes:?}"
        );
        let listed = listed(names(&files), &mut Vec::new()).expect("a sequence");
        assert_eq!((listed.files.len(), listed.lone), (files.len(), None));
    }
}

#[test]
fn parts_may_start_late() {
    let mut files: Vec<String> = (1..9).map(|i| format!("Fluid_{i}.vtk")).collect();
    files.extend((7..9).map(|i| format!("Oil_{i}.vtk")));
    let (group, _) = picked(&files);
    assert_eq!((group.parts, group.files.len()), (owned(&["Fluid", "Oil"]), 10));
}

#[test]
fn few_stray_files_are_skipped_and_reported() {
    let mut files: Vec<String> = (0..10).map(|i| format!("dump.drop.{}.lammps", i * 400)).collect();
    files[3] += ".gz";
    files.push("drop_4frames.lammpstrj".into());
    let (group, notes) = picked(&files);
    assert_eq!(numbers(&group), (0..10).map(|i| i * 400).collect::<Vec<_>>());
    assert_eq!(notes, ["`drop_4frames.lammpstrj` (1 file) is left out"]);
    let files = owned(&["out_1.vtk", "out_2.vtk", "initial.vtk"]);
    let (group, notes) = picked(&files);
    assert_eq!((numbers(&group), notes.len()), (vec![1, 2], 1));
}

#[test]
fn two_formats_are_reported_with_their_patterns() {
    let text = ambiguous(&["x_1.vtk", "x_2.vtk", "x_1.bgeo", "x_2.bgeo"]);
    assert!(
        text.contains("`x_#.bgeo` (2 frames)") && text.contains("`x_#.vtk` (2 frames)"),
        "{text}"
    );
    let text = ambiguous(&[
        "dam_break_3d_fluid_00100.vtu",
        "dam_break_3d_obstacle_00100.vtu",
        "dam_break_3d_00300.npz",
    ]);
    assert!(text.contains("`dam_break_3d_*_#.vtu` (1 frame, 2 files)"), "{text}");
}

#[test]
fn a_mixed_directory_names_every_sequence() {
    let text = ambiguous(&[
        "double_dam_break_frame_26_4732_particles.vtk",
        "double_dam_break_frame_01_4732_particles.vtk",
        "hilbert2_7954_particles.vtk",
        "fluid_250_particles.vtu",
        "cube_normals.ply",
        "dam_break_frame_9_6859_particles.bgeo",
        "dam_break_frame_23_24389_particles.bgeo",
        "cube_8_particles.vtu",
    ]);
    assert!(text.contains("`double_dam_break_frame_#_4732_particles.vtk`"), "{text}");
    assert!(text.contains("`dam_break_frame_#_*_particles.bgeo`"), "{text}");
}

#[test]
fn the_same_frame_twice_is_an_error() {
    for pair in [["a_7.vtk", "a_07.vtk"], ["a_7.vtk", "a_7.vtk.gz"]] {
        let error = pick(Path::new("dir"), names(&owned(&pair)), &mut Vec::new());
        let text = error.expect_err("a duplicate").to_string();
        assert!(pair.iter().all(|name| text.contains(name)), "{text}");
    }
}

#[test]
fn all_listed_files_are_used() {
    let mut notes = Vec::new();
    let mut list = |files: &[&str]| {
        notes.clear();
        let group = listed(names(&owned(files)), &mut notes).expect("a sequence");
        (numbers(&group), group.parts.len(), notes.len())
    };
    assert_eq!(list(&["b.vtk", "a.vtk"]), (vec![0, 1], 1, 1));
    assert_eq!(list(&["x_2.vtk", "x_1.bgeo"]), (vec![1, 2], 1, 0));
    assert_eq!(list(&["a_1.vtk", "b_7.vtk"]), (vec![1, 7], 1, 0));
    assert_eq!(list(&["fluid_3.vtk", "wall_3.ply"]), (vec![3, 3], 2, 0));
    assert_eq!(list(&["alone.vtk"]), (vec![], 1, 0));
}

#[test]
fn unrelated_names_are_grouped_in_linear_time() {
    // Compared each with each, these would take minutes.
    let letters = |mut i: usize| {
        let mut text = String::new();
        for _ in 0..4 {
            text.push(char::from(b'a' + u8::try_from(i % 26).expect("a letter")));
            i /= 26;
        }
        text
    };
    let files: Vec<String> = (0..100_000).map(|i| format!("{}.vtk", letters(i))).collect();
    let found = candidates(names(&files));
    assert_eq!(found.len(), files.len());
}
