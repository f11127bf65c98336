//! The same bytes whoever renders them.

use crate::harness::{JOB, Workshop, dam_break, images, sample};

/// Everything that could depend on order: several samples, reflection, refraction, ground.
const RICH: [&str; 8] = [
    "--samples",
    "4",
    "--set",
    "material.transmission=0.6",
    "--max-depth",
    "4",
    "--ground",
    "--channels=RGBA,Z,N,id,P,V,albedo",
];

/// Path tracing: many light paths a sample, and a shadow catcher.
const STUDIO: [&str; 6] =
    ["--samples", "4", "--look", "studio", "--set", "output.transparent=true"];

#[test]
fn any_number_of_threads_makes_the_same_images() {
    same_on_any_threads(&RICH);
}

#[test]
fn any_number_of_threads_traces_the_same_paths() {
    same_on_any_threads(&STUDIO);
}

/// Renders three frames eight times: twice on each of four numbers of threads.
fn same_on_any_threads(options: &[&str]) {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1, 5, 9]);
    let mut first = None;
    let threads: [&[&str]; 4] =
        [&["--threads", "1"], &["--threads", "2"], &["--threads", "5"], &[]];
    for (count, threads) in threads.iter().enumerate() {
        // Twice each: what differs from run to run would differ here.
        for again in 0..2 {
            let out = format!("out{count}-{again}");
            // Each option may be given once, so small images come by `--set` here.
            let pattern = format!("{out}/f.####.exr");
            let size = ["--width", "64", "--height", "36"];
            let arguments =
                [&["render", "in", "-o", &pattern][..], &size, options, threads].concat();
            let ran = workshop.run(&arguments).expect(0);
            assert_eq!(ran.rendered(), [1, 5, 9]);
            let made = images(&workshop.join(&out));
            assert_eq!(made.len(), 6);
            let first = first.get_or_insert_with(|| made.clone());
            assert!(made == *first, "{out} differs from out0-0");
        }
    }
}

#[test]
fn the_place_of_input_and_output_does_not_matter() {
    let here = Workshop::new();
    let there = Workshop::new();
    dam_break(&here.join("in"), [4]);
    dam_break(&there.join("deeper/data"), [4]);
    here.render(&[]).expect(0);
    let input = there.join("deeper/data");
    let input = input.to_str().expect("UTF-8");
    let arguments = [&["render", input, "-o", "f.####.exr"][..], &JOB].concat();
    there.run(&arguments).expect(0);
    assert!(images(&here.join("out")) == images(there.path()));
}

#[test]
fn a_file_with_many_steps_is_resumed_too() {
    let workshop = Workshop::new();
    let input = sample("lammps_drop/drop_2frames.lammpstrj");
    let input = input.to_str().expect("UTF-8");
    let arguments = [&["render", input, "-o", "out/f.####.exr"][..], &JOB].concat();
    let first = workshop.run(&arguments).expect(0).rendered();
    assert_eq!(first.len(), 2);
    let whole = images(&workshop.join("out"));
    let image = workshop.join(format!("out/f.{:04}.exr", first[1]));
    std::fs::remove_file(image).expect("an image");
    let again = workshop.run(&arguments).expect(0);
    assert_eq!(again.rendered(), first[1..]);
    assert!(images(&workshop.join("out")) == whole);
}
