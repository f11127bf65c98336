//! Flags and their values.

use super::{not_rendered, refused};
use crate::harness::{Workshop, dam_break};

fn one_frame() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1]);
    workshop
}

#[test]
fn typing_errors_get_the_nearest_word() {
    let workshop = one_frame();
    refused(
        &workshop,
        &["rendr", "in"],
        &["`render`", "rendr"].map(|w| w.trim_matches('`')),
    );
    not_rendered(&workshop, &["--widht", "64"], &["--widht", "'--width'"]);
    not_rendered(&workshop, &["--progress", "jsn"], &["jsn", "'json'"]);
    not_rendered(
        &workshop,
        &["--set", "render.max_dept=4"],
        &[
            "--set render.max_dept=4: render.max_dept: unknown key; did you mean `render.max_depth`?",
        ],
    );
    not_rendered(
        &workshop,
        &["--color-by", "velocity", "--map", "viridi"],
        &[
            "material.color.map: wants one of viridis, ",
            "did you mean viridis?",
        ],
    );
    not_rendered(
        &workshop,
        &["--accelerator", "lbhv"],
        &[
            "--accelerator: render.accelerator: wants one of ",
            "did you mean lbvh?",
        ],
    );
    not_rendered(
        &workshop,
        &["--channels", "RGBA,z"],
        &["output.channels", "did you mean Z?"],
    );
    not_rendered(
        &workshop,
        &["--surface", "smoth"],
        &[
            "--surface: render.surface: wants one of spheres, medium, smooth",
            "did you mean smooth?",
        ],
    );
    not_rendered(
        &workshop,
        &["--look", "watr"],
        &["--look watr: there is no such look", "did you mean water?"],
    );
    refused(&workshop, &["render"], &["<INPUT>"]);
}

#[test]
fn surfaces_that_make_no_sense_are_refused() {
    let workshop = one_frame();
    for (options, wanted) in [
        (
            ["--exact-surface", "--surface=medium"],
            "surface.exact: is for the smooth surface alone",
        ),
        (
            ["--spray", "--surface=spheres"],
            "surface.spray: lies beside one body; set render.surface",
        ),
        (
            ["--smoothing", "1.5"],
            "--smoothing: surface.smoothing: wants a number from 0 to 1",
        ),
    ] {
        not_rendered(&workshop, &options, &[wanted]);
    }
}

#[test]
fn numbers_have_ranges() {
    let workshop = one_frame();
    for (options, wanted) in [
        (
            ["--width", "-5"],
            "--width: image.width: wants a whole number from 1 to 65536, not -5",
        ),
        (
            ["--width", "0"],
            "image.width: wants a whole number from 1 to 65536, not 0",
        ),
        (["--width", "65537"], "from 1 to 65536, not 65537"),
        (
            ["--height", "-1"],
            "--height: image.height: wants a whole number from 1 to 65536",
        ),
        (["--height", "99999999999"], "not 99999999999"),
        (
            ["--samples", "0"],
            "--samples: image.samples: wants a whole number from 1 to 4096, not 0",
        ),
        (
            ["--samples", "-4"],
            "image.samples: wants a whole number from 1 to 4096, not -4",
        ),
        (
            ["--max-depth", "0"],
            "render.max_depth: wants a whole number from 1 to 64, not 0",
        ),
        (
            ["--max-depth", "-3"],
            "render.max_depth: wants a whole number from 1 to 64, not -3",
        ),
        (
            ["--radius", "0"],
            "--radius: input.radius: wants a length above 0",
        ),
        (["--radius", "-0.1"], "input.radius: wants a length above 0"),
        (["--radius", "nan"], "not NaN"),
        (["--radius", "inf"], "not inf"),
        (["--radius", "thick"], "not the text \"thick\""),
        (
            ["--set", "camera.fov=0"],
            "--set camera.fov=0: camera.fov: wants degrees between 0 and 180, not 0",
        ),
        (
            ["--set", "camera.fov=180"],
            "camera.fov: wants degrees between 0 and 180, not 180",
        ),
        (
            ["--set", "material.ior=nan"],
            "--set material.ior=nan: material.ior: wants a number above 0, not NaN",
        ),
        (
            ["--set", "material.diffuse=inf"],
            "material.diffuse: wants a number from 0, not inf",
        ),
        (
            ["--set", "material.reflection=1.5"],
            "material.reflection: wants a number from 0 to 1",
        ),
        (
            ["--set", "camera.eye=[nan,0,0]"],
            "camera.eye: wants three numbers",
        ),
        (
            ["--set", "camera.eye=[1,2]"],
            "camera.eye: wants three numbers",
        ),
        (
            ["--set", "camera.up=[0,0,0]"],
            "camera.up: wants three numbers that are not all 0",
        ),
        (
            ["--set", "image.width"],
            "--set image.width: no `=`, as in render.max_depth=5",
        ),
        (
            ["--set", "image=7"],
            "--set image=7: image: wants a table, not 7",
        ),
        (["--threads", "0"], "--threads"),
        (["--threads", "many"], "--threads"),
        (["--up", "w"], "--up: input.up: wants one of x, y, z"),
    ] {
        not_rendered(&workshop, &options, &[wanted]);
    }
}

#[test]
fn all_that_is_wrong_is_told_at_once() {
    let workshop = one_frame();
    not_rendered(
        &workshop,
        &[
            "--width",
            "0",
            "--samples",
            "0",
            "--set",
            "output.previw=false",
        ],
        &[
            "image.width",
            "image.samples",
            "did you mean `output.preview`?",
        ],
    );
}

#[test]
fn cameras_that_see_nothing() {
    let workshop = one_frame();
    let camera = |eye: &str, look_at: &str, up: &str, wanted: &str| {
        let set = [eye, look_at, up].map(|s| format!("camera.{s}"));
        let mut options = Vec::new();
        for set in &set {
            options.extend(["--set", set]);
        }
        not_rendered(&workshop, &options, &[wanted]);
    };
    camera(
        "eye=[1,2,3]",
        "look_at=[1,2,3]",
        "up=[0,1,0]",
        "camera.look_at: is where the eye is; they must differ",
    );
    camera(
        "eye=[0,5,0]",
        "look_at=[0,0,0]",
        "up=[0,-2,0]",
        "camera.up: points along the view; it must not",
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
        &[
            "camera.eye: is missing; a fixed camera needs it",
            "camera.look_at: is missing",
        ],
    );
}

#[test]
fn frame_ranges() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    for (range, wanted) in [
        (
            "900",
            "input.frames: 900 has none of the frames that there are: 1-3",
        ),
        (
            "3-",
            "--frames: input.frames: frame range `3-`: character 3: a frame number is missing",
        ),
        ("", "input.frames"),
        ("one", "`one`: character 1"),
        ("1-3x0", "`1-3x0`"),
    ] {
        not_rendered(&workshop, &["--frames", range], &[wanted]);
    }
}

#[test]
fn colours_by_what_is_not_there() {
    let workshop = one_frame();
    not_rendered(
        &workshop,
        &["--color-by", "nosuch"],
        &[
            "material.color.attribute: no attribute `nosuch` in any frame looked at; there are `density`, `id`, `velocity`",
        ],
    );
    not_rendered(
        &workshop,
        &["--set", "input.radius={ attribute = \"size\" }"],
        &["input.radius: no attribute `size` in any frame looked at; there are `density`"],
    );
    not_rendered(&workshop, &["--map", "turbo"], &["--color-by"]);
    not_rendered(
        &workshop,
        &["--color-by", "velocity", "--range", "3", "3"],
        &["material.color.range: wants two rising numbers"],
    );
}
