//! `--memory-limit`: what does not fit is refused before it starts, and the rest goes on.

use crate::harness::{Workshop, dam_break, images, ledger};

use super::{AWAY, vtk};

/// Three frames of which the second is heavy.
fn one_heavy() -> Workshop {
    let workshop = Workshop::new();
    for (frame, count) in [(1, 1000), (2, 500_000), (3, 1000)] {
        vtk(&workshop.join(format!("in/f_{frame}.vtk")), count, false);
    }
    workshop
}

#[test]
fn frames_beyond_memory_are_not_started() {
    let workshop = Workshop::new();
    vtk(&workshop.join("in/f_1.vtk"), 1000, false);
    vtk(&workshop.join("in/f_2.vtk"), 1000, false);
    let ran = workshop
        .render(&["--memory-limit", "1MiB"])
        .expect(2)
        .prints("no frame fits into memory: frame 1: it needs about")
        .prints("render.memory_limit is 1.00 MiB")
        .prints("raise the limit");
    assert!(ran.errors().contains("images"), "{}", ran.errors());
    assert!(!workshop.join("out").exists(), "a refused job leaves nothing");
    let images = ["--memory-limit", "30MiB", "--width", "2000", "--height", "2000"];
    let images = [&["render", "in", "-o", "out/f.####.exr"][..], &images].concat();
    workshop.run(&images).expect(2).prints("make the image smaller or ask for fewer channels");
    assert!(!workshop.join("out").exists(), "a refused job leaves nothing");
}

#[test]
fn invalid_sizes() {
    let workshop = Workshop::new();
    vtk(&workshop.join("in/f_1.vtk"), 10, false);
    for size in ["0", "", "-5", "much", "4 gallons", "1e3"] {
        workshop
            .render(&["--memory-limit", size])
            .expect(2)
            .prints("--memory-limit: expected a size above 0, such as \"4GiB\"");
    }
    for size in ["2GiB", "2G", "2048m", "2147483648"] {
        workshop.render(&["--memory-limit", size]).expect(0);
    }
    workshop.render(&["--force", "--set", "render.memory_limit=2147483648"]).expect(0);
}

#[test]
fn one_heavy_frame_costs_one_frame() {
    let workshop = one_heavy();
    let ran =
        workshop.render(&["--memory-limit", "16MiB"]).expect(1).prints("frame 2: it needs about");
    assert_eq!(ran.rendered(), [1, 3]);
    let lines = ledger(&workshop.join("out")).lines;
    let failed = lines.iter().find(|l| l["status"] == "failed");
    let reason = failed.expect("one failed")["reason"].as_str();
    assert!(reason.expect("a reason").contains("reading"), "{reason:?}");
    // The limit is no property of the images.
    let ran = workshop.render(&["--memory-limit", "1GiB"]).expect(0);
    assert_eq!(ran.rendered(), [2]);
}

// Six images of 1280x720: two of them at once have to be too large for the limit.
#[test]
fn frames_run_one_at_a_time_if_two_do_not_fit() {
    let workshop = Workshop::new();
    for frame in 1..=3 {
        vtk(&workshop.join(format!("in/f_{frame}.vtk")), 1000, false);
    }
    // Two images side by side, one being encoded, need 80 MiB, one at a time 50.
    let large = ["--width", "1280", "--height", "720", "--samples", "1"];
    let run = |out: &str, options: &[&str]| {
        let pattern = format!("{out}/f.####.exr");
        let start = ["render", "in", "-o", &pattern];
        workshop.run(&[&start[..], &large, &AWAY, options].concat())
    };
    run("free", &[]).expect(0);
    run("tight", &["--memory-limit", "65MiB"])
        .expect(0)
        .prints("one frame at a time, to reduce memory");
    assert_eq!(images(&workshop.join("free")), images(&workshop.join("tight")));
}

// Three jobs with smooth surfaces. Each estimates the size of its grid from the particles.
#[test]
fn grid_beyond_memory_is_rejected_with_its_radius() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1]);
    let smooth = ["--surface", "smooth", "--set=output.preview=false"];
    // Of particles that do not meet each has a grid of its own, as the survey finds.
    let tiny = ["--radius", "0.0001", "--memory-limit", "40MiB"];
    workshop
        .render(&[&smooth[..], &tiny].concat())
        .expect(2)
        .prints("no frame fits into memory: frame 1: it needs about")
        .prints(" for a smooth surface of particles of radius 0.0001 in voxels of 0.0001, ")
        .prints("give larger voxels (surface.voxel), or raise the limit");
    assert!(!workshop.join("out").exists(), "a refused job leaves nothing");
    // What fits is rendered, on the same directory.
    let right = ["--radius", "0.02", "--memory-limit", "40MiB", "--force"];
    let ran = workshop.render(&[&smooth[..], &right].concat()).expect(0);
    assert_eq!(ran.rendered(), [1]);
    // A predicted excess reports the memory of the surface.
    let tight = ["--radius", "0.02", "--memory-limit", "5MiB", "--force"];
    workshop
        .render(&[&smooth[..], &tight].concat())
        .expect(2)
        .prints("no frame fits into memory: frame 1: it needs about")
        .prints(" for a smooth surface of particles of radius 0.02 in voxels of 0.02, render.memory_limit is")
        .prints("give larger voxels (surface.voxel), or raise the limit");
}
