//! Flags and their values.

use super::{not_rendered, refused};
use crate::harness::{SMALL, Workshop, dam_break};

fn one_frame() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1]);
    workshop
}

#[test]
fn misspelled_values_have_suggestions() {
    let workshop = one_frame();
    refused(&workshop, &["rendr", "in"], &["`render`", "rendr"].map(|w| w.trim_matches('`')));
    not_rendered(&workshop, &["--widht", "64"], &["--widht", "'--width'"]);
    not_rendered(&workshop, &["--progress", "jsn"], &["jsn", "'json'"]);
    not_rendered(
        &workshop,
        &["--set", "render.max_dept=4"],
        &["--set render.max_dept=4: unknown key; did you mean `render.max_depth`?"],
    );
    not_rendered(
        &workshop,
        &["--color-by", "velocity", "--map", "viridi"],
        &["--map: material.color.map: unknown colour map `viridi`; did you mean viridis?"],
    );
    not_rendered(
        &workshop,
        &["--accelerator", "lbhv"],
        &["--accelerator: expected one of ", "did you mean lbvh?"],
    );
    not_rendered(&workshop, &["--channels", "RGBA,z"], &["output.channels", "did you mean Z?"]);
    not_rendered(
        &workshop,
        &["--surface", "smoth"],
        &["--surface: expected one of spheres, union, smooth", "did you mean smooth?"],
    );
    not_rendered(
        &workshop,
        &["--look", "watr"],
        &[
            "--look: expected one of auto, plain, paper, studio, water, whitted, none, found the text \"watr\"",
            "did you mean water?",
        ],
    );
    refused(&workshop, &["render"], &["<INPUT>"]);
}

#[test]
fn contradictory_surface_options_are_rejected() {
    let workshop = one_frame();
    for (options, expected) in [
        (
            ["--exact-surface", "--surface=union"],
            "--exact-surface: is for the smooth surface alone",
        ),
        (["--spray", "--surface=spheres"], "--spray: lies beside one body; set render.surface"),
        (
            ["--whitewater", "--surface=union"],
            "--whitewater: lies on a smooth surface; set render.surface",
        ),
        (["--smoothing", "1.5"], "--smoothing: expected a number from 0 to 1"),
    ] {
        not_rendered(&workshop, &options, &[expected]);
    }
}

#[test]
fn numbers_have_ranges() {
    let workshop = one_frame();
    for (options, expected) in [
        (
            ["--width", "-5"],
            "--width: expected a length on paper such as \"85mm\", or a whole number from 1 to 65536, found -5",
        ),
        (
            ["--width", "0"],
            "--width: expected a length on paper such as \"85mm\", or a whole number from 1 to 65536, found 0",
        ),
        (["--width", "65537"], "from 1 to 65536, found 65537"),
        (
            ["--height", "-1"],
            "--height: expected a length on paper such as \"85mm\", or a whole number from 1 to 65536",
        ),
        (["--height", "99999999999"], "found 99999999999"),
        (["--samples", "0"], "--samples: expected a whole number from 1 to 4096, found 0"),
        (["--samples", "-4"], "--samples: expected a whole number from 1 to 4096, found -4"),
        (["--max-depth", "0"], "--max-depth: expected a whole number from 1 to 64, found 0"),
        (["--max-depth", "-3"], "--max-depth: expected a whole number from 1 to 64, found -3"),
        (["--radius", "0"], "--radius: expected a length above 0"),
        (["--radius", "-0.1"], "--radius: expected a length above 0"),
        (["--radius", "nan"], "found NaN"),
        (["--radius", "inf"], "found inf"),
        (["--radius", "thick"], "found the text \"thick\""),
        (
            ["--set", "camera.fov=0"],
            "--set camera.fov=0: expected degrees between 0 and 180, found 0",
        ),
        (
            ["--set", "camera.fov=180"],
            "--set camera.fov=180: expected degrees between 0 and 180, found 180",
        ),
        (
            ["--set", "material.ior=nan"],
            "--set material.ior=nan: expected a number above 0, found NaN",
        ),
        (
            ["--set", "material.diffuse=inf"],
            "--set material.diffuse=inf: expected a number from 0, found inf",
        ),
        (
            ["--set", "material.reflection=1.5"],
            "--set material.reflection=1.5: expected a number from 0 to 1",
        ),
        (["--set", "camera.eye=[nan,0,0]"], "--set camera.eye=[nan,0,0]: expected three numbers"),
        (["--set", "camera.eye=[1,2]"], "--set camera.eye=[1,2]: expected three numbers"),
        (
            ["--set", "camera.up=[0,0,0]"],
            "--set camera.up=[0,0,0]: expected three numbers that are not all 0",
        ),
        (["--set", "image.width"], "--set image.width: no `=` (example: render.max_depth=5)"),
        (["--set", "image=7"], "--set image=7: expected a table, found 7"),
        (
            ["--width", "4k"],
            "--width: unknown unit `k`; write a whole number of pixels, or a length in mm, cm, in or pt",
        ),
        (["--samples", "many"], "expected a whole number, such as 16"),
        (["--idle", "1h"], "expected a number of seconds"),
        (
            ["--threads", "2000"],
            "--threads: expected \"all\" or a whole number from 1 to 1024, found 2000",
        ),
        (["--threads", "0"], "--threads"),
        (["--threads", "many"], "--threads"),
        (["--up", "w"], "--up: expected one of x, y, z"),
    ] {
        not_rendered(&workshop, &options, &[expected]);
    }
}

#[test]
fn all_invalid_options_are_reported_at_once() {
    let workshop = one_frame();
    not_rendered(
        &workshop,
        &["--width", "0", "--samples", "0", "--set", "output.previw=false"],
        &["--width: ", "--samples: ", "did you mean `output.preview`?"],
    );
}

#[test]
fn invalid_cameras() {
    let workshop = one_frame();
    let camera = |eye: &str, look_at: &str, up: &str, expected: &str| {
        let set = [eye, look_at, up].map(|s| format!("camera.{s}"));
        let mut options = Vec::new();
        for set in &set {
            options.extend(["--set", set]);
        }
        not_rendered(&workshop, &options, &[expected]);
    };
    camera(
        "eye=[1,2,3]",
        "look_at=[1,2,3]",
        "up=[0,1,0]",
        "--set camera.look_at=[1,2,3]: is where the eye is; they must differ",
    );
    camera(
        "eye=[0,5,0]",
        "look_at=[0,0,0]",
        "up=[0,-2,0]",
        "--set camera.up=[0,-2,0]: points along the view; it must not",
    );
    // BGEO is y up, and that is along this view.
    camera(
        "eye=[0,5,0]",
        "look_at=[0,0,0]",
        "fov=40",
        "error: camera: up is zero or points along the view; choose another camera.up",
    );
    not_rendered(
        &workshop,
        &["--set", "camera.mode=\"fixed\""],
        &["camera.eye: is missing; a fixed camera needs it", "camera.look_at: is missing"],
    );
}

#[test]
fn frame_ranges() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    for (range, expected) in [
        ("900", "input.frames: 900 contains none of the frames of the input: 1-3"),
        ("3-", "--frames: frame range `3-`: character 3: a frame number is missing"),
        ("", "--frames: frame range"),
        ("one", "`one`: character 1"),
        ("1-3x0", "`1-3x0`"),
    ] {
        not_rendered(&workshop, &["--frames", range], &[expected]);
    }
}

#[test]
fn missing_colour_attribute() {
    let workshop = one_frame();
    not_rendered(
        &workshop,
        &["--color-by", "nosuch"],
        &[
            "material.color.attribute: no attribute `nosuch` in the sampled frames; available: `density`, `depth`, \
             `height`, `id`, `index`, `radius`, `speed`, `velocity`, `vx`, `vy`, `vz`, `x`, `y`, `z`",
        ],
    );
    not_rendered(
        &workshop,
        &["--set", "input.radius={ attribute = \"size\" }"],
        &["input.radius: no attribute `size` in the sampled frames; available: `density`"],
    );
    let plain = "input.path = \"in\"\nmaterial.color = [1, 0, 0]\n";
    std::fs::write(workshop.join("plain.toml"), plain).expect("a file");
    refused(
        &workshop,
        &["render", "plain.toml", "--map", "turbo"],
        &["--map: material.color.map: material.color is a list of 3, which has no keys"],
    );
    not_rendered(
        &workshop,
        &["--color-by", "velocity", "--range", "3", "3"],
        &["material.color.range: expected two rising numbers"],
    );
}

// Starts the program for each colour that a manifest or an option may already have.
#[test]
fn map_applies_to_the_existing_colour() {
    let workshop = one_frame();
    let kept = |key: &str| {
        let text = std::fs::read_to_string(workshop.join("out/job.toml")).expect("a manifest");
        let line = text.lines().find(|line| line.starts_with(key));
        line.expect("the key").to_owned()
    };
    // By speed, as nothing else is asked for.
    workshop.render(&["--map", "turbo"]).expect(0).prints("colour by `speed`");
    assert!(kept("color = ").starts_with("color = { map = \"turbo\" }"));
    let plain = workshop.render_to("plain", &[]).expect(0);
    drop(plain);
    let image = |dir: &str| std::fs::read(workshop.join(dir).join("f.0001.exr")).expect("an image");
    assert!(image("out") != image("plain"), "the map is used");
    // Over a manifest that says "auto", and over one that names an attribute.
    workshop.run(&["render", "plain/job.toml", "--map", "turbo", "--force"]).expect(0);
    assert!(image("out") == image("plain"));
    workshop.render(&["--color-by", "density", "--force"]).expect(0);
    workshop
        .run(&["render", "out/job.toml", "--map", "magma", "--range", "1", "2", "--force"])
        .expect(0);
    let color = kept("color = ");
    assert!(
        color.starts_with(
            "color = { attribute = \"density\", map = \"magma\", range = [1.0, 2.0] }"
        ),
        "{color}"
    );
    std::fs::write(workshop.join("a.xyz"), "0 0 0\n1 1 1\n").expect("a file");
    let bare = ["render", "a.xyz", "-o", "bare/f.exr", "--map", "turbo"];
    refused(&workshop, &bare, &["material.color: no attribute `velocity` in the sampled frames"]);
}

#[test]
fn patterns_and_ranges_of_any_size() {
    let workshop = one_frame();
    for (pattern, expected) in [
        ("#".repeat(70_000), "more than 32 digits for the frame number"),
        ("%0999999d".to_owned(), "more than 32 digits"),
        ("%099999999999999999999999d".to_owned(), "more than 32 digits"),
    ] {
        let output = format!("out/f.{pattern}.exr");
        refused(&workshop, &["render", "in", "-o", &output], &[expected]);
    }
    for pattern in ["#".repeat(70_000), "*?".repeat(60_000), "%0999999d".to_owned()] {
        let input = format!("in/{pattern}.nosuch");
        refused(&workshop, &["render", &input], &["no file name fits this pattern"]);
    }
    for (range, expected) in [
        ("1-99999999999999999999", "does not fit in 64 bits"),
        ("1-10x99999999999999999999", "does not fit in 64 bits"),
        ("0-9000000000000000000x7", "contains none of the frames"),
    ] {
        not_rendered(&workshop, &["--frames", range], &[expected]);
    }
}

// Starts the program nine times: each command calculates with numbers of frames.
/// The first and the last frame number that there are.
#[test]
fn frame_numbers_at_both_ends() {
    let workshop = one_frame();
    for number in [i64::MIN, i64::MAX] {
        let name = format!("in/f_{number}.bgeo");
        std::fs::copy(workshop.join("in/f_1.bgeo"), workshop.join(name)).expect("a file");
    }
    for options in [&[][..], &["--set", "camera.mode=turntable"]] {
        let ran = workshop.render(&[options, &["--force"]].concat()).expect(0);
        assert!(!ran.errors().contains("fault"), "{}", ran.errors());
        for name in ["f.-9223372036854775808.exr", "f.0001.exr", "f.9223372036854775807.exr"] {
            assert!(workshop.join("out").join(name).exists(), "{name}");
        }
    }
    workshop.run(&["status", "out"]).expect(0);
    workshop.run(&["verify", "out"]).expect(0);
    workshop.run(&["check", "out/job.toml"]).expect(0);
    workshop.run(&["inspect", "in"]).expect(0);
    workshop.run(&["convert", "in", "-o", "native"]).expect(0);
    workshop.run(&["export", "slurm", "out/job.toml"]).expect(0);
    let shard = ["--shard", "2/3", "--frames", "-9223372036854775808-9223372036854775807"];
    workshop.render_to("shard", &shard).expect(0);
}

#[test]
fn thread_count_is_limited() {
    let workshop = one_frame();
    workshop.render(&["--threads", "1000"]).expect(0).prints("note: --threads 1000: ");
    for command in [
        &["verify", "out"][..],
        &["convert", "in", "-o", "native"],
        &["scale", "--particles", "10"],
    ] {
        let arguments = [command, &["--threads", "2000"]].concat();
        let ran = workshop.run(&arguments).expect(2);
        ran.prints("2000 is not in 1..=1024");
    }
}

#[test]
fn missing_manifest_lists_the_directory() {
    let workshop = one_frame();
    std::fs::write(workshop.join("dam.toml"), "input.path = \"in\"\n").expect("a file");
    for arguments in [
        &["render", "dan.toml"][..],
        &["check", "dan.toml"],
        &["status", "dan.toml"],
        &["export", "slurm", "dan.toml"],
    ] {
        refused(
            &workshop,
            arguments,
            &["error: dan.toml: no such file or directory; ", "dam.toml"],
        );
    }
}

#[test]
fn conversions_write_directories() {
    let workshop = one_frame();
    for (output, expected) in [
        (
            "x.vtk",
            "x.vtk: has the extension of another format: convert writes only native frames (.spf)",
        ),
        ("x.csv.gz", "give a directory, as in -o x"),
    ] {
        refused(&workshop, &["convert", "in", "-o", output], &[expected]);
        assert!(!workshop.join(output).exists());
    }
    workshop.run(&["convert", "in", "-o", "v1.2"]).expect(0);
}

#[test]
fn a_radius_far_from_the_spacing_gets_a_note() {
    let workshop = one_frame();
    let still = |radius: &str| {
        let start = ["still", "in", "-o", "a.png", "--radius", radius];
        workshop.run(&[&start[..], &SMALL].concat()).expect(0)
    };
    still("5").prints("note: the radius 5 is ");
    let usual = still("0.025");
    assert!(!usual.text().contains("is its unit"), "{}", usual.text());
}
