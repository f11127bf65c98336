//! Messages about invalid manifests: each names line, column and the nearest known key.

use std::path::Path;

use super::*;

/// Checks that `text` gives exactly one message: the file's name, followed by `expected`.
#[track_caller]
fn fails_with(text: &str, expected: &str) {
    let error = Manifest::parse(text, Path::new("job.toml")).unwrap_err();
    assert_eq!(error.messages(), [format!("job.toml: {expected}")]);
}

/// Same as [`fails_with`], with two valid lines in front of `text`.
#[track_caller]
fn fails_below(text: &str, expected: &str) {
    fails_with(&format!("[input]\npath = \"ä\"\n{text}"), expected);
}

#[test]
fn obsolete_value_is_accepted_with_a_warning() {
    let text = "input.path = \"a\"\n[render]\nsurface = \"medium\"";
    let read = |text| Manifest::parse_with_warnings(text, Path::new("job.toml"), Vec::new());
    let (manifest, warnings) = read(text).unwrap();
    assert_eq!(
        warnings,
        [
            "job.toml: line 3, column 11: render.surface: \"medium\" is now called \"union\"; the old name still works"
        ]
    );
    let shown = manifest.to_commented_toml();
    assert!(shown.contains("surface = \"union\""), "{shown}");
    assert_eq!(read(&shown).unwrap(), (manifest, Vec::new()));
}

#[test]
fn keys_in_tables() {
    for (text, place, key, nearest) in [
        ("[rendre]", "line 3, column 2", "rendre", "render"),
        ("[[lights]]", "line 3, column 3", "lights", "light"),
        ("[camra.key]", "line 3, column 2", "camra", "camera"),
        ("[image]\n\n  widht = 3", "line 5, column 3", "image.widht", "image.width"),
        ("[camera]\nfvo = 3", "line 4, column 1", "camera.fvo", "camera.fov"),
        ("[render]\nmax-depth = 3", "line 4, column 1", "render.max-depth", "render.max_depth"),
        ("[material]\n\"iro\" = 3", "line 4, column 1", "material.iro", "material.ior"),
        ("[output]\nchannel = 3", "line 4, column 1", "output.channel", "output.channels"),
        ("[job]\ntheads = 3", "line 4, column 1", "job.theads", "job.threads"),
    ] {
        fails_below(text, &format!("{place}: {key}: unknown key; did you mean `{nearest}`?"));
    }
}

#[test]
fn keys_in_the_wrong_table() {
    fails_below(
        "samples = 4",
        "line 3, column 1: input.samples: unknown key here; did you mean `image.samples`?",
    );
    fails_below(
        "[output]\nthreads = 4",
        "line 4, column 1: output.threads: unknown key here; did you mean `job.threads`?",
    );
}

#[test]
fn keys_in_items_of_lists() {
    fails_below(
        "[[light]]\ntype = \"point\"\nposition = [0, 0, 1]\nintesity = 2",
        "line 6, column 1: light.0.intesity: unknown key; did you mean `light.0.intensity`?",
    );
    fails_below(
        "[[light]]\ntype = \"point\"\nposition = [0, 0, 1]\n[[light]]\ntype = \"directional\"\ndirectoin = [0, 0, 1]\ndirection = [0, 0, 1]",
        "line 8, column 1: light.1.directoin: unknown key; did you mean `light.1.direction`?",
    );
    fails_below(
        "[[camera.key]]\nframe = 1\neye = [1, 0, 0]\nlook_at = [0, 0, 0]\nfow = 30",
        "line 7, column 1: camera.key.0.fow: unknown key; did you mean `camera.key.0.fov`?",
    );
    fails_below(
        "[[camera.key]]\nframe = 1\neye = [1, 0, 0]\nlookat = [0, 0, 0]\nlook_at = [0, 0, 0]",
        "line 6, column 1: camera.key.0.lookat: unknown key; did you mean `camera.key.0.look_at`?",
    );
}

#[test]
fn keys_in_inline_tables() {
    fails_with(
        "input = { path = \"ä\", raduis = 3 }",
        "line 1, column 23: input.raduis: unknown key; did you mean `input.radius`?",
    );
    fails_with(
        "input = { path = \"ä\", radius = { attribute = \"h\", scael = 3 } }",
        "line 1, column 51: input.radius.scael: unknown key; did you mean `input.radius.scale`?",
    );
    fails_below(
        "[render]\nbackground = { bottom = [0, 0, 0], top = [1, 1, 1], botom = 3 }",
        "line 4, column 53: render.background.botom: unknown key; did you mean `render.background.bottom`?",
    );
    fails_below(
        "[material.color]\nattribute = \"v\"\nrnage = [0, 1]",
        "line 5, column 1: material.color.rnage: unknown key; did you mean `material.color.range`?",
    );
    fails_with(
        "input.path = \"a\"\nlight = [{ type = \"point\", position = [0, 0, 1], colour = [1, 1, 1] }]",
        "line 2, column 50: light.0.colour: unknown key; did you mean `light.0.color`?",
    );
    fails_with(
        "input.path = \"a\"\ncamera.key = [{ frame = 1, eye = [1, 0, 0], look_at = [0, 0, 0], fvo = 3 }]",
        "line 2, column 66: camera.key.0.fvo: unknown key; did you mean `camera.key.0.fov`?",
    );
}

#[test]
fn values_in_every_kind_of_table() {
    fails_below(
        "[job]\nsettle = \"soon\"",
        "line 4, column 10: job.settle: expected seconds from 0 to 1e9, found the text \"soon\"",
    );
    fails_below(
        "[[light]]\ntype = \"spot\"",
        "line 4, column 8: light.0.type: expected one of point, directional, sun, sphere, rect, disc, found the text \"spot\"",
    );
    fails_with(
        "input.path = \"a\"\nmaterial.color = { attribute = \"v\", map = \"trubo\" }",
        "line 2, column 43: material.color.map: unknown colour map `trubo`; did you mean turbo?",
    );
}

#[test]
fn invalid_toml() {
    for (text, place) in [
        ("[job", "line 3, column 5"),
        ("[job]\nthreads = ", "line 4, column 11"),
        ("[job]\nthreads 3", "line 4, column 9"),
        ("[job]\nstop_file = \"stop", "line 4, column 18"),
        ("[camera]\neye = [1, 2", "line 4, column 12"),
        ("[camera]\nfov = 1\nfov = 2", "line 5, column 1"),
        ("[job]\n[job]", "line 4, column 2"),
        ("[material]\ncolor = { attribute = \"v\", attribute = \"w\" }", "line 4, column 28"),
        ("[job]\nidle = 1.2.3", "line 4, column 11"),
    ] {
        let text = format!("[input]\npath = \"ä\"\n{text}");
        let error = Manifest::parse(&text, Path::new("job.toml")).unwrap_err();
        assert_eq!(error.messages().len(), 1, "{error}");
        let expected = format!("job.toml: {place}: ");
        assert!(error.to_string().starts_with(&expected), "{error}, not {place}");
    }
}
