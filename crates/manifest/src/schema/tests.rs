//! Schema and reader agree on keys, defaults, words and valid values.

use std::collections::BTreeSet;

use jsonschema::Validator;
use toml::Table;

use super::*;
use crate::ManifestError;

mod values;

/// A manifest with keys of all tables, which satisfies the dependencies between them.
const EVERYTHING: &str = r#"
input = { path = ["a", "b"], frames = 7, radius = { attribute = "d", scale = 0.5 }, up = "-y", verify = true }
camera = { mode = "keys", key = [{ frame = 9, eye = [1, 2, 3], look_at = [0, 0, 0], fov = 30 }] }
image = { width = "85mm", height = "6 cm", dpi = 600 }
render = { surface = "smooth", integrator = "path", bounces = 0, ground_pattern = "checker", ground_tile = 0.5, background = { bottom = [0, 0, 0], top = [1, 1, 1] }, ground = true, ground_height = -2, memory_limit = "1.5GiB" }
surface = { normals = "field", smoothing = 1, exact = true, voxel = 0.5, smoothing_length = 2.5, threshold = 0.55, spray = true, spray_style = "spheres", whitewater = false, whitewater_speed = 3.5, whitewater_amount = 2, whitewater_size = 0.5 }
select = { where = "x > 1 && !(speed <= 2)", ids = "1-5", every = 2, slab = { axis = "y", center = 0, thickness = 0.5 } }
clip = [{ type = "plane", normal = "-x", offset = 2 }, { type = "plane", normal = [1, 2, 0], point = [1, 1, 1], mode = "cut" }, { type = "box", min = [0, 0, 0], max = [1, 1, 1], keep = "outside" }]
material = { color = { attribute = "velocity.x", map = "red-blue_r", range = "1%-99.5%", scale = "symlog", threshold = 0.1, steps = 8, reverse = true }, absorption = [0.5, 1, 0], absorption_length = 3, fresnel = "exact" }
light = [{ type = "directional", direction = [0, 0, -2] }, { type = "point", position = [1, 1, 1], falloff = "inverse-square" }, { type = "sun", direction = [0, 0, -2], size = 2 }, { type = "sphere", position = [1, 1, 1], radius = 2, visible = true }, { type = "rect", position = [1, 1, 1], direction = [0, 1, 0], width = 2, height = 3 }, { type = "disc", position = [1, 1, 1], direction = [0, 1, 0], radius = 2 }]
mesh = [{ path = "tank.stl" }, { path = "w.##.ply", material = "glass", color = [1, 1, 0.5], roughness = 0, normals = "flat", faces = "back", scale = 0.001, translate = [1, 0, 0] }, { path = "b", holdout = true }]
trails = { frames = 8, radius = 0.1, every = 2, color = [1, 0, 0] }
bonds = { find = "covalent", radius = 0.1, color = { attribute = "f", map = "turbo", range = [0, 5] } }
arrows = [{ attribute = "velocity", scale = 0.1 }, { attribute = "f", scale = 2, radius = 0.1, every = 10, anchor = "center", color = { attribute = "f", map = "turbo", range = [0, 5] } }]
overlay = [{ type = "colorbar", title = "Speed", unit = "m/s", length = 0.5, corner = "top-right" }, { type = "text", text = "t = {time:.2f}", offset = [0.1, -0.1], color = [1, 0, 0] }, { type = "scale_bar", length = 2, unit = "mm" }, { type = "axes", size = 0.05 }, { type = "image", path = "logo.png", height = 0.2 }]
environment = { type = "image", image = "hall.exr", intensity = 2, rotation = -30, visible = true }
output = { path = "x/%04d.EXR", channels = ["id"], fps = 24 }
job = { threads = 3, isolate = true, memory_ceiling = 1073741824, stop_file = "../stop" }
"#;

fn validator() -> Validator {
    jsonschema::draft202012::options().build(&job_schema()).expect("a good schema")
}

fn read(text: &str) -> Result<Manifest, ManifestError> {
    Manifest::parse(text, "job.toml".as_ref())
}

fn json(text: &str) -> Value {
    let table: Table = text.parse().expect("TOML");
    serde_json::to_value(table).expect("TOML has no values that JSON lacks, but for NaN")
}

#[track_caller]
fn both_take(text: &str) {
    read(text).unwrap();
    let (json, validator) = (json(text), validator());
    let errors: Vec<_> = validator.iter_errors(&json).map(|e| e.to_string()).collect();
    assert!(errors.is_empty(), "{text}\n{errors:?}");
}

#[track_caller]
fn both_refuse(text: &str) {
    assert!(read(text).is_err(), "the reader takes {text}");
    assert!(!validator().is_valid(&json(text)), "the schema takes {text}");
}

#[test]
fn it_is_a_schema_of_draft_2020_12() {
    let schema = job_schema();
    assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
    assert!(jsonschema::meta::is_valid(&schema));
}

#[test]
fn written_manifests_are_valid() {
    let plain = Manifest::new("data");
    both_take(&plain.to_commented_toml());
    both_take(EVERYTHING);
    both_take("input.path = \"a\"\nmaterial.opacity = { attribute = \"density\", range = [2, 1] }");
    both_take(&read(EVERYTHING).unwrap().to_commented_toml());
    let mut fixed = plain;
    fixed.camera.mode = crate::CameraMode::Fixed;
    fixed.camera.eye = Some(glam::DVec3::ONE);
    fixed.camera.look_at = Some(glam::DVec3::ZERO);
    both_take(&fixed.to_commented_toml());
}

/// Every table of the schema, with a manifest that ends in this table, so that a line can be appended to it.
const TABLES: [(&str, &str); 55] = [
    ("", ""),
    ("/properties/input", "[input]\n"),
    ("/properties/camera", "[camera]\n"),
    ("/properties/camera/properties/key/items", "[[camera.key]]\n"),
    ("/properties/mist", "[mist]\n"),
    ("/properties/cell", "[cell]\n"),
    ("/properties/image", "[image]\n"),
    ("/properties/render", "[render]\n"),
    ("/properties/surface", "[surface]\n"),
    ("/properties/material", "[material]\n"),
    ("/properties/light/items/oneOf/0", "[[light]]\ntype = \"point\"\n"),
    ("/properties/light/items/oneOf/1", "[[light]]\ntype = \"directional\"\n"),
    ("/properties/light/items/oneOf/2", "[[light]]\ntype = \"sun\"\n"),
    ("/properties/light/items/oneOf/3", "[[light]]\ntype = \"sphere\"\n"),
    ("/properties/light/items/oneOf/4", "[[light]]\ntype = \"rect\"\n"),
    ("/properties/light/items/oneOf/5", "[[light]]\ntype = \"disc\"\n"),
    ("/properties/overlay/items/oneOf/0", "[[overlay]]\ntype = \"colorbar\"\n"),
    ("/properties/overlay/items/oneOf/1", "[[overlay]]\ntype = \"text\"\n"),
    ("/properties/overlay/items/oneOf/2", "[[overlay]]\ntype = \"scale_bar\"\n"),
    ("/properties/overlay/items/oneOf/3", "[[overlay]]\ntype = \"axes\"\n"),
    ("/properties/overlay/items/oneOf/4", "[[overlay]]\ntype = \"image\"\npath = \"logo.png\"\n"),
    ("/properties/mesh/items", "[[mesh]]\npath = \"a.stl\"\n"),
    ("/properties/material/properties/part/items", "[[material.part]]\nparts = [1]\n"),
    ("/properties/environment", "[environment]\n"),
    ("/properties/output", "[output]\n"),
    ("/properties/job", "[job]\n"),
    ("/properties/trails", "[trails]\n"),
    ("/properties/bonds", "[bonds]\n"),
    ("/properties/bonds/properties/color/anyOf/2", "[bonds.color]\n"),
    ("/properties/trails/properties/color/anyOf/2", "[trails.color]\n"),
    ("/properties/arrows/items", "[[arrows]]\nattribute = \"f\"\nscale = 1\n"),
    (
        "/properties/arrows/items/properties/color/anyOf/2",
        "[[arrows]]\nattribute = \"f\"\nscale = 1\n[arrows.color]\n",
    ),
    ("/properties/input/properties/radius/anyOf/2", "[input.radius]\n"),
    ("/properties/material/properties/color/anyOf/2", "[material.color]\n"),
    ("/properties/render/properties/background/anyOf/2", "[render.background]\n"),
    ("/properties/render/properties/ground/anyOf/3", "[render.ground]\n"),
    ("/properties/render/properties/caustics", "[render.caustics]\n"),
    ("/properties/camera/properties/focus/anyOf/2", "[camera.focus]\n"),
    ("/properties/environment/properties/sun", "[environment.sun]\n"),
    ("/properties/select", "[select]\n"),
    ("/properties/select/properties/slab", "[select.slab]\n"),
    ("/properties/clip/items/oneOf/0", "[[clip]]\ntype = \"plane\"\n"),
    ("/properties/clip/items/oneOf/1", "[[clip]]\ntype = \"box\"\n"),
    ("/properties/material/properties/opacity/anyOf/1", "[material.opacity]\n"),
    ("/properties/style/items", "[[style]]\n"),
    ("/properties/style/items/properties/radius/anyOf/2", "[[style]]\n[style.radius]\n"),
    ("/properties/style/items/properties/color/anyOf/2", "[[style]]\n[style.color]\n"),
    ("/properties/style/items/properties/opacity/anyOf/1", "[[style]]\n[style.opacity]\n"),
    ("/properties/style/items/properties/material", "[[style]]\n[style.material]\n"),
    ("/properties/style/items/properties/bonds", "[[style]]\n[style.bonds]\n"),
    ("/properties/style/items/properties/orientation", "[[style]]\n[style.orientation]\n"),
    ("/properties/style/items/properties/arrows", "[[style]]\n[style.arrows]\n"),
    (
        "/properties/style/items/properties/arrows/properties/color/anyOf/2",
        "[[style]]\n[style.arrows.color]\n",
    ),
    ("/properties/style/items/properties/trails", "[[style]]\n[style.trails]\n"),
    (
        "/properties/style/items/properties/trails/properties/color/anyOf/2",
        "[[style]]\n[style.trails.color]\n",
    ),
];

#[test]
fn the_reader_knows_the_same_keys() {
    let schema = job_schema();
    for (pointer, text) in TABLES {
        let error = read(&format!("{text}zzzzzzzzzzzzzzzz = 1\n")).unwrap_err().to_string();
        let known: BTreeSet<&str> = error
            .split("known here: ")
            .nth(1)
            .and_then(|rest| rest.lines().next())
            .expect(&error)
            .split(", ")
            .collect();
        let table = schema.pointer(pointer).expect(pointer);
        let properties = table["properties"].as_object().expect(pointer);
        let described: BTreeSet<&str> = properties.keys().map(String::as_str).collect();
        assert_eq!(described, known, "{pointer}");
        assert_eq!(table["additionalProperties"], false, "{pointer}");
    }
    assert_eq!(count_tables(&schema), TABLES.len());
}

fn count_tables(schema: &Value) -> usize {
    match schema {
        Value::Object(map) => {
            // Tables of names have no fixed keys
            let is_table = map.get("type").is_some_and(|t| t == "object");
            let is_table = is_table && map.contains_key("properties");
            usize::from(is_table) + map.values().map(count_tables).sum::<usize>()
        }
        Value::Array(items) => items.iter().map(count_tables).sum(),
        _ => 0,
    }
}

#[test]
fn comments_defaults_and_examples_are_those_of_init() {
    let schema = job_schema();
    for entry in Manifest::new("").entries().list() {
        let at = match &*entry.section {
            "" => format!("/properties/{}", entry.name()),
            section => format!("/properties/{section}/properties/{}", entry.name()),
        };
        let property = schema.pointer(&at).expect(&at);
        assert_eq!(property["description"], entry.comment(), "{at}");
        let sample = json_of(entry.sample());
        let expected = match (&*entry.key, &entry.value) {
            ("input.path", _) => (Value::Null, Value::Null),
            (_, Some(_)) => (sample, Value::Null),
            (_, None) => (Value::Null, json!([sample])),
        };
        let found = (&property["default"], &property["examples"]);
        assert_eq!(found, (&expected.0, &expected.1), "{at}");
    }
    for (pointer, text) in TABLES {
        let about = &schema.pointer(pointer).expect(pointer)["description"];
        assert!(about != "", "{text}");
    }
}

/// Missing keys have the same defaults in the schema and in the reader.
#[test]
fn defaults_of_items_are_the_readers() {
    let schema = job_schema();
    for (pointer, text) in [
        ("/properties/light/items/oneOf/0", "type = \"point\"\nposition = [1, 2, 3]\n"),
        ("/properties/light/items/oneOf/1", "type = \"directional\"\ndirection = [1, 2, 3]\n"),
    ] {
        let head = format!("input.path = \"data\"\n[[light]]\n{text}");
        let plain = read(&head).unwrap();
        for (name, property) in schema.pointer(pointer).unwrap()["properties"].as_object().unwrap()
        {
            if let Some(default) = property.get("default") {
                let set = read(&format!("{head}{name} = {default}\n")).unwrap();
                assert_eq!(set, plain, "{name}");
            }
        }
    }
}

#[test]
fn required_keys_agree() {
    let path = "input.path = \"data\"\n";
    both_refuse("");
    both_refuse("[input]\nup = \"y\"");
    for wrong in [
        "[[camera.key]]\neye = [1, 0, 0]\nlook_at = [0, 0, 0]",
        "[[camera.key]]\nframe = 1\nlook_at = [0, 0, 0]",
        "[[camera.key]]\nframe = 1\neye = [1, 0, 0]",
        "[[light]]",
        "[[light]]\nposition = [0, 0, 1]",
        "[[light]]\ntype = \"point\"",
        "[[light]]\ntype = \"directional\"\nposition = [0, 0, 1]",
        "[[light]]\ntype = \"point\"\nposition = [0, 0, 1]\ndirection = [0, 0, 1]",
        "[[light]]\ntype = \"directional\"\ndirection = [0, 0, 1]\nfalloff = \"none\"",
        "[light]\ntype = \"point\"\nposition = [0, 0, 1]",
        "light = 3",
        "camera.key = 3",
        "camera.key = [3]",
        "input = 3",
        "image = [1]",
        "samples = 3",
        "[render]\nsamples = 3",
    ] {
        both_refuse(&if wrong.starts_with("input") {
            wrong.to_owned()
        } else {
            format!("{path}{wrong}")
        });
    }
}

/// All combinations of keys that define the camera.
#[test]
fn key_dependencies_agree() {
    let modes = ["", "auto", "fixed", "turntable", "keys"];
    let has = [false, true];
    for mode in modes {
        for (eye, look_at) in has.iter().flat_map(|a| has.iter().map(move |b| (*a, *b))) {
            for key in has {
                let mut text = String::from("input.path = \"data\"\n[camera]\n");
                if !mode.is_empty() {
                    text += &format!("mode = \"{mode}\"\n");
                }
                text += if eye { "eye = [1, 2, 3]\n" } else { "" };
                text += if look_at { "look_at = [0, 0, 0]\n" } else { "" };
                if key {
                    text += "[[camera.key]]\nframe = 1\neye = [1, 2, 3]\nlook_at = [0, 0, 0]\n";
                }
                let valid = validator().is_valid(&json(&text));
                assert_eq!(valid, read(&text).is_ok(), "{text}");
            }
        }
    }
}

/// Settings that are valid alone or with one or two others.
const SETTINGS: [[&str; 2]; 54] = [
    ["camera.mode", "\"auto\""],
    ["camera.mode", "\"fixed\""],
    ["camera.mode", "\"turntable\""],
    ["camera.mode", "\"keys\""],
    ["camera.eye", "[1, 2, 3]"],
    ["camera.look_at", "[0, 0, 0]"],
    ["camera.key", "[{ frame = 1, eye = [1, 2, 3], look_at = [0, 0, 0] }]"],
    ["camera.center", "[1, 2, 3]"],
    ["camera.f_stop", "2"],
    ["camera.aperture", "0.1"],
    ["camera.projection", "\"perspective\""],
    ["camera.projection", "\"orthographic\""],
    ["camera.projection", "\"equirectangular\""],
    ["camera.fov", "30"],
    ["camera.height", "2"],
    ["camera.azimuth", "3"],
    ["camera.elevation", "3"],
    ["camera.view", "\"left\""],
    ["camera.view", "\"top\""],
    ["camera.stereo", "true"],
    ["camera.stereo", "false"],
    ["camera.eye_distance", "0.1"],
    ["camera.eye_distance", "\"auto\""],
    ["camera.convergence", "\"parallel\""],
    ["camera.shutter", "0.5"],
    ["image.crop", "[0, 0, 9, 9]"],
    ["image.overscan", "3"],
    ["image.samples", "1"],
    ["render.surface", "\"union\""],
    ["render.surface", "\"smooth\""],
    ["render.integrator", "\"whitted\""],
    ["render.ground", "\"shadow_catcher\""],
    ["render.ground", "{ type = \"image\", image = \"a.png\", width = 2 }"],
    ["render.denoise", "true"],
    ["surface.normals", "\"field\""],
    ["surface.normals", "\"pca\""],
    ["surface.normals", "\"sphere\""],
    ["surface.exact", "true"],
    ["surface.spray", "true"],
    ["surface.whitewater", "true"],
    ["material.type", "\"glass\""],
    ["material.type", "\"matte\""],
    ["material.opacity", "0.5"],
    ["material.opacity", "1"],
    ["material.transmission", "1"],
    ["material.part", "[{ parts = [1] }]"],
    ["environment.type", "\"sky\""],
    ["environment.type", "\"image\""],
    ["environment.image", "\"a.exr\""],
    ["trails.frames", "3"],
    ["job.follow", "true"],
    ["job.isolate", "true"],
    ["job.isolate", "false"],
    ["job.memory_ceiling", "\"1G\""],
];

/// The keys of tables that are values: colours, radii and grounds.
const INNER: [&[&str]; 3] = [
    &[
        "scale = \"log\"",
        "scale = \"symlog\"",
        "scale = \"categorical\"",
        "range = [1, 2]",
        "range = \"symmetric\"",
        "steps = 3",
        "map = \"turbo\"",
        "threshold = 0.1",
        "names = { 1 = \"a\" }",
        "values = { 1 = [1, 0, 0] }",
    ],
    &["attribute = \"a\"", "table = \"vdw\"", "values = { 1 = 0.5 }", "scale = 2"],
    &["type = \"image\"", "type = \"plain\"", "image = \"a.png\"", "width = 2", "repeat = true"],
];

/// Checks that schema and reader accept the same of all combinations of `settings` and up to `more` others.
fn combinations_agree(more: usize) {
    let validator = validator();
    let agree = |text: &str| {
        let text = format!("input.path = \"data\"\n{text}");
        // A key twice is not TOML
        if text.parse::<Table>().is_ok() {
            let valid = validator.is_valid(&json(&text));
            assert_eq!(valid, read(&text).is_ok(), "{text}");
        }
    };
    let settings = SETTINGS.map(|[key, value]| format!("{key} = {value}"));
    for chosen in choices(&settings, more + 1) {
        agree(&chosen.join("\n"));
    }
    for (table, keys) in ["material.color", "input.radius", "render.ground"].iter().zip(INNER) {
        for chosen in choices(&keys.iter().map(ToString::to_string).collect::<Vec<_>>(), more + 1) {
            agree(&format!("{table} = {{ {} }}", chosen.join(", ")));
        }
    }
}

/// All choices of one to `most` of `items`.
fn choices(items: &[String], most: usize) -> Vec<Vec<String>> {
    let mut all: Vec<Vec<String>> = Vec::new();
    for (index, item) in items.iter().enumerate() {
        all.push(vec![item.clone()]);
        if most > 1 {
            let others = choices(&items[index + 1..], most - 1).into_iter();
            all.extend(others.map(|rest| [vec![item.clone()], rest].concat()));
        }
    }
    all
}

#[test]
fn rules_between_keys_agree() {
    combinations_agree(1);
}

#[test]
#[ignore = "takes minutes; pairs are in the usual run"]
fn rules_between_three_keys_agree() {
    combinations_agree(2);
}
