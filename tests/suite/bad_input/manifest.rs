//! Manifests with something wrong in them: file, line, column, key, remedy.

use std::fs;

use super::refused;
use crate::harness::{Workshop, dam_break};

#[track_caller]
fn wrong(text: &str, expected: &[&str]) {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1]);
    fs::write(workshop.join("my.toml"), text).expect("a file");
    refused(&workshop, &["render", "my.toml"], expected);
    let left = fs::read_dir(workshop.path()).expect("the directory").count();
    assert_eq!(left, 2, "a refused job leaves nothing");
}

#[test]
fn unknown_keys_get_the_nearest_known_one() {
    wrong(
        "[input]\npath = \"in\"\n[render]\nmax_dept = 3\n",
        &[
            "error: my.toml: line 4, column 1: render.max_dept: unknown key; did you mean `render.max_depth`?",
        ],
    );
    wrong(
        "[input]\npath = \"in\"\n[rendr]\nmax_depth = 3\n",
        &["my.toml: line 3, column 2: rendr: unknown key; did you mean `render`?"],
    );
    wrong(
        "[input]\npath = \"in\"\n[render]\nsamples = 3\n",
        &[
            "my.toml: line 4, column 1: render.samples: unknown key here; did you mean `image.samples`?",
        ],
    );
}

#[test]
fn wrong_types_have_line_and_column() {
    wrong(
        "[input]\npath = \"in\"\n[image]\nwidth = \"wide\"\nheight = 1.5\n",
        &[
            "error: my.toml: line 4, column 9: image.width: expected a length on paper such as \"85mm\", or a whole number from 1 to 65536, found the text \"wide\"",
            "error: my.toml: line 5, column 10: image.height: expected a length on paper",
        ],
    );
    wrong(
        "[input]\npath = \"in\"\n[camera]\neye = 3\nlook_at = [0, 0, 0]\n",
        &["my.toml: line 4, column 7: camera.eye: expected three numbers"],
    );
    wrong(
        "[input]\npath = 7\n",
        &["my.toml: line 2, column 8: input.path: expected a name in quotes, found 7"],
    );
    wrong("image = 3\n[input]\npath = \"in\"\n", &["line 1, column 9: image: expected a table"]);
}

#[test]
fn missing_keys_are_named() {
    wrong("", &["my.toml: ", "input.path: is missing; a directory, a pattern"]);
    wrong("[input]\nup = \"y\"\n", &["input.path: is missing"]);
    wrong(
        "[input]\npath = \"in\"\n[camera]\nmode = \"fixed\"\n",
        &["camera.eye: is missing", "camera.look_at: is missing"],
    );
    wrong(
        "[input]\npath = \"elsewhere\"\n",
        &["my.toml: input.path: elsewhere: no such file or directory"],
    );
}

#[test]
fn toml_errors_have_a_location() {
    wrong("[input]\npath = [\n", &["my.toml: line 2, column "]);
    wrong("[input]\npath = \"a\"\npath = \"b\"\n", &["my.toml: line 3, column 1: duplicate key"]);
    wrong("\u{1}\u{2}", &["my.toml: line 1, column "]);
}

#[test]
fn keys_of_the_camera_have_line_and_column() {
    let key = "[[camera.key]]\nframe = 3\neye = [9, 0, 0]\n";
    let job = |keys: &str| format!("[input]\npath = \"in\"\n{keys}");
    wrong(
        &job(&[key, "look_at = [9, 0, 0]\nfov = 0\n"].concat()),
        &[
            "my.toml: line 6, column 1: camera.key.0.look_at: is where the eye is; they must differ",
            "my.toml: line 7, column 7: camera.key.0.fov: expected degrees between 0 and 180, found 0",
        ],
    );
    wrong(
        &job(&[key, "look_at = [0, 0, 0]\nup = [-1, 0, 0]\n"].concat()),
        &["my.toml: line 7, column 1: camera.key.0.up: points along the view; it must not"],
    );
    wrong(
        &job(&[key, "look_at = [0, 0, 0]\n", key, "look_at = [1, 0, 0]\n"].concat()),
        &["my.toml: line 8, column 1: camera.key.1.frame: there is a key of frame 3 already"],
    );
    wrong(
        &job("[camera]\nmode = \"keys\"\n"),
        &["my.toml: line 3, column 1: camera.key: is missing; mode = \"keys\" needs at least one"],
    );
    wrong(
        &job("[camera]\nmode = \"turntable\"\neye = [0, 0, 1]\n"),
        &["my.toml: line 5, column 1: camera.eye: is given, but a turntable finds its own"],
    );
    // BGEO is y up, and that is along this view: known only once the frames are.
    wrong(
        &job("[[camera.key]]\nframe = 3\neye = [0, 9, 0]\nlook_at = [0, 0, 0]\n"),
        &["error: camera.key: the key of frame 3: up is zero or points along the view"],
    );
}

#[test]
fn manifest_that_is_not_text_or_not_a_file() {
    let workshop = Workshop::new();
    fs::write(workshop.join("bytes.toml"), [0xff, 0xfe, 0, 9]).expect("a file");
    refused(&workshop, &["render", "bytes.toml"], &["error: bytes.toml: "]);
    fs::create_dir(workshop.join("dir.toml")).expect("a directory");
    refused(&workshop, &["render", "dir.toml"], &["error: dir.toml: "]);
    refused(&workshop, &["render", "none.toml"], &["error: none.toml: "]);
}
