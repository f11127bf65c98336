//! ParaView collections as input of every command.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::harness::{SMALL, Workshop, files, natives, sample};

/// Copies the files below `from`.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a directory");
    for entry in fs::read_dir(from).expect("a directory") {
        let path = entry.expect("an entry").path();
        let target = to.join(path.file_name().expect("a name"));
        if path.is_dir() {
            copy(&path, &target)
        } else {
            fs::copy(&path, &target).expect("a copy");
        }
    }
}

/// A workshop with the sample collections in `in`.
fn workshop() -> Workshop {
    let workshop = Workshop::new();
    copy(&sample("collections"), &workshop.join("in"));
    workshop
}

/// One JSON value for each line.
fn lines(text: &str) -> Vec<Value> {
    let values = text.lines().map(serde_json::from_str);
    values.map(|value| value.expect("JSON")).collect()
}

#[test]
fn inspect_describes_lists_and_their_files() {
    let workshop = workshop();
    let ran = workshop.run(&["inspect", "--json", "in/parts.pvd"]).expect(0);
    let objects = lines(&ran.text());
    let list = &objects[0];
    assert_eq!(list["list"], "ParaView collection");
    assert_eq!((&list["steps"], &list["files"]), (&3.into(), &9.into()));
    assert_eq!(list["parts"], serde_json::json!(["fluid", "wall"]));
    assert_eq!(list["times"], serde_json::json!([0.0, 0.125, 0.5]));
    assert_eq!(objects.len(), 10);
    assert_eq!((&objects[9]["frame"], &objects[9]["time"]), (&2.into(), &0.5.into()));
    let ran = workshop.run(&["inspect", "in/blocks.vtm.series"]).expect(0);
    let text = ran.text();
    assert!(
        text.contains("ParaView file series, 3 time steps, 6 files, times 0 to 0.5")
            && text.contains("parts fluid, wall/floor"),
        "{text}"
    );
}

/// Walls are drawn, too.
fn render_of_all_parts() -> Vec<&'static str> {
    let start = ["render", "in/parts.pvd", "--parts", "fluid,wall"];
    [&start[..], &["-o", "out/f.####.exr"], &SMALL].concat()
}

#[test]
fn walls_are_glass_unless_something_else_is_said() {
    let workshop = workshop();
    let still = |options: &[&str]| {
        let arguments = [&["still", "in/parts.pvd", "-o", "a.exr"][..], &SMALL, options].concat();
        workshop.run(&arguments).expect(0).errors()
    };
    // Glass by default; where it is not possible, the line has the option for it
    let plain = still(&[]);
    let hidden = "part == 'wall': hidden";
    assert!(plain.contains("glass behind the others: wall, walls by name"), "{plain}");
    assert!(plain.contains(&format!("--style \"{hidden}\" leaves them out")), "{plain}");
    let studio = still(&["--look", "studio"]);
    assert!(studio.contains("left out: wall, walls by name"), "{studio}");
    let glass = "part == 'wall': smooth, material thin-glass";
    assert!(studio.contains(&format!("--style \"{glass}\" draws them as glass")), "{studio}");
    // Whoever has styles says what is drawn
    for style in [hidden, glass] {
        let styled = still(&["--style", style]);
        assert!(!styled.contains("walls by name"), "{styled}");
    }
}

#[test]
fn a_job_with_walls_of_glass_goes_on() {
    let workshop = workshop();
    let start = |frames: &'static str| {
        let start = ["render", "in/parts.pvd", "--frames", frames, "-o", "out/f.####.exr"];
        [&start[..], &SMALL].concat()
    };
    assert_eq!(workshop.run(&start("0")).expect(0).rendered(), [0]);
    let rest = workshop.run(&start("0-1")).expect(0);
    assert_eq!(rest.rendered(), [1]);
    let written = fs::read_to_string(workshop.join("out/job.toml")).expect("a manifest");
    assert!(written.contains("underlay = true"), "{written}");
}

#[test]
fn render_check_convert_and_resume() {
    let workshop = workshop();
    let check = workshop
        .run(&[&["check", "in/parts.pvd", "--json", "-o", "out/f.####.exr"], &SMALL[..]].concat());
    check.expect(0);
    let arguments = render_of_all_parts();
    let ran = workshop.run(&arguments).expect(0);
    assert_eq!(ran.rendered(), [0, 1, 2]);
    ran.prints("ParaView collection, 3 time steps, 9 files, times 0 to 0.5");
    assert!(workshop.run(&arguments).expect(0).rendered().is_empty());
    // Another member of frame 1
    let member = workshop.join("in/parts/wall_10_1.vtu");
    fs::copy(workshop.join("in/parts/wall_10_0.vtu"), &member).expect("a copy");
    workshop
        .run(&arguments)
        .prints("inputs of finished frames have changed: frame 1: ")
        .prints("wall_10_1.vtu");
    // A conversion stores the times of the list
    workshop.run(&["convert", "in/drop.vtk.series", "-o", "native"]).expect(0);
    assert_eq!(natives(&workshop.join("native")).len(), 2);
    let ran = workshop.run(&["inspect", "--json", "native"]).expect(0);
    let times: Vec<Value> = lines(&ran.text()).iter().map(|o| o["time"].clone()).collect();
    assert_eq!(times, [0.0, 0.125]);
}

#[test]
fn faults_of_members_cost_their_frame() {
    let workshop = workshop();
    fs::remove_file(workshop.join("in/parts/wall_10_1.vtu")).expect("a file");
    let arguments = render_of_all_parts();
    workshop.run(&arguments).expect(1).prints(
        "in/parts/wall_10.pvtu: line 11: it lists in/parts/wall_10_1.vtu, which does not exist",
    );
    let images = files(&workshop.join("out"));
    assert!(images.keys().any(|name| name.ends_with("f.0002.exr")), "{:?}", images.keys());
}

#[test]
fn files_outside_need_an_option() {
    let workshop = workshop();
    let collection = "<VTKFile type=\"Collection\"><Collection>\n\
                      <DataSet timestep=\"1\" file=\"../in/series/drop_0.vtu\"/>\n</Collection></VTKFile>";
    fs::create_dir(workshop.join("lists")).expect("a directory");
    fs::write(workshop.join("lists/all.pvd"), collection).expect("a file");
    let outside =
        "lists/all.pvd: line 2: `../in/series/drop_0.vtu` is outside the directory of the list";
    for command in [
        &["inspect", "lists/all.pvd"][..],
        &["convert", "lists/all.pvd", "-o", "native"],
        &["render", "lists/all.pvd", "-o", "out/f.#.exr", "--width", "64", "--samples", "1"],
    ] {
        let ran = workshop.run(command).prints(outside);
        assert!(ran.code().is_some_and(|code| code != 0), "{command:?}");
        workshop.run(&[command, &["--follow-links"]].concat()).expect(0);
    }
}
