//! That every option of `render` is a key of the manifest, or says why it is none.

use std::collections::BTreeSet;

use super::*;
use crate::cli::render::RunArgs;
use crate::manifest::Manifest;

/// Options that are no property of a job: where it is, any key, many keys, and what one run does with what is
/// there.
const ACTIONS: [&str; 8] = ["gpu", "input", "set", "look", "draft", "force", "keep_done", "shard"];

/// Options for parts of `material.color`.
const COLORS: [&str; 4] = ["color_by", "map", "range", "color_scale"];

/// Options for several keys.
const SHORT: [&str; 7] = ["size", "ortho", "no_legend", "vmin", "vmax", "slice", "turntable"];

/// Options for items of lists. Their tests are below.
const LISTS: [&str; 12] = [
    "mesh",
    "camera_path",
    "clip",
    "arrows",
    "colorbar",
    "title",
    "unit",
    "time_stamp",
    "text",
    "scale_bar",
    "axes",
    "style",
];

/// Other options with a value that is not the default, and the key that it is laid over.
const FLAGS: [(&str, &str); 71] = [
    ("--output x.####.exr", "output.path = \"x.####.exr\""),
    ("--frames 3-4", "input.frames = \"3-4\""),
    ("--width 7", "image.width = 7"),
    ("--height 7", "image.height = 7"),
    ("--dpi 7", "image.dpi = 7"),
    ("--projection orthographic", "camera.projection = \"orthographic\""),
    ("--view top", "camera.view = \"top\""),
    ("--ortho", "camera.projection = \"orthographic\""),
    ("--fov 30", "camera.fov = 30.0"),
    ("--azimuth -30", "camera.azimuth = -30.0"),
    ("--elevation 20", "camera.elevation = 20.0"),
    (
        "--eye -1,2,3 --look-at 0,0,0",
        "camera = { eye = [-1.0, 2.0, 3.0], look_at = [0.0, 0.0, 0.0] }",
    ),
    ("--size 7x1080", "image.width = 7"),
    ("--background #fff", "render.background = [1.0, 1.0, 1.0]"),
    ("--color red", "material.color = [1.0, 0.0, 0.0]"),
    ("--opacity 0.5", "material.opacity = 0.5"),
    ("--trails 3", "trails.frames = 3"),
    ("--transparent", "output.transparent = true"),
    ("--vmin 0 --vmax 2", "material.color.range = [0.0, 2.0]"),
    ("--samples 7", "image.samples = 7"),
    ("--seed 7", "render.seed = 7"),
    ("--noise 0.02", "render.noise = 0.02"),
    ("--crop 3,4,50,60", "image.crop = [3, 4, 50, 60]"),
    ("--radius 0.5", "input.radius = 0.5"),
    ("--up -y", "input.up = \"-y\""),
    (
        "--color-by v --map turbo --range 0 2",
        "material.color = { attribute = \"v\", map = \"turbo\", range = [0.0, 2.0] }",
    ),
    ("--map turbo", "material.color.map = \"turbo\""),
    ("--range 0 2", "material.color.range = [0.0, 2.0]"),
    ("--color-scale log", "material.color.scale = \"log\""),
    ("--channels RGBA,Z", "output.channels = [\"RGBA\", \"Z\"]"),
    ("--max-depth 7", "render.max_depth = 7"),
    ("--ground", "render.ground = true"),
    ("--ground=shadow_catcher", "render.ground = \"shadow_catcher\""),
    ("--ground checker", "render.ground = \"checker\""),
    ("--outline 1.5", "render.outline = 1.5"),
    ("--depth-cue 0.7", "render.depth_cue = 0.7"),
    ("--denoise false", "render.denoise = false"),
    ("--denoise", "render.denoise = true"),
    ("--bonds", "bonds.find = \"covalent\""),
    ("--cell", "cell.visible = true"),
    ("--replicate 2,2,1", "cell.replicate = [2, 2, 1]"),
    ("--unwrap", "cell.unwrap = true"),
    ("--wrap", "cell.wrap = true"),
    ("--center x>2", "cell.center = \"x>2\""),
    ("--align x>2", "cell.align = \"x>2\""),
    ("--bonds covalent", "bonds.find = \"covalent\""),
    ("--surface union", "render.surface = \"union\""),
    ("--smoothing 0.5", "surface.smoothing = 0.5"),
    ("--surface smooth --exact-surface", "surface.exact = true"),
    ("--surface smooth --spray", "surface.spray = true"),
    ("--surface smooth --whitewater", "surface.whitewater = true"),
    ("--no-mmap", "input.mmap = false"),
    ("--follow-links", "input.follow_links = true"),
    ("--mesh-points", "input.mesh_points = true"),
    ("--where x>2", "select.where = \"x>2\""),
    ("--topology a.gro", "input.topology = \"a.gro\""),
    ("--parts a,b", "input.parts = [\"a\", \"b\"]"),
    ("--accelerator bvh", "render.accelerator = \"bvh\""),
    ("--device cpu", "render.device = \"cpu\""),
    ("--memory-limit 4GiB", "render.memory_limit = \"4GiB\""),
    ("--threads 7", "job.threads = 7"),
    ("--progress json", "job.progress = \"json\""),
    ("--isolate", "job.isolate = true"),
    ("--isolate --memory-ceiling 4GiB", "job.memory_ceiling = \"4GiB\""),
    ("--retries 7", "job.retries = 7"),
    ("--takeover-after 7", "job.takeover_after = 7.0"),
    ("--grace 7", "job.grace = 7.0"),
    ("--follow", "job.follow = true"),
    ("--idle 7", "job.idle = 7.0"),
    ("--settle 7", "job.settle = 7.0"),
    ("--stop-file stop", "job.stop_file = \"stop\""),
];

fn command() -> Command {
    RunArgs::augment_args(Command::new("render"))
}

fn manifest(flags: &str) -> Manifest {
    let arguments = format!("render data {flags}");
    let arguments = with_equals(arguments.split_whitespace().map(OsString::from));
    let matches = command().get_matches_from(arguments);
    let run = RunArgs::from_arg_matches(&matches).unwrap();
    run.manifest.manifest().unwrap().manifest
}

#[test]
fn every_option_is_a_key() {
    for (flags, expected) in FLAGS.iter() {
        let (key, value) = expected.split_once(" = ").unwrap();
        let mut plain = Manifest::new("data");
        assert_ne!(manifest(flags), plain, "{flags}");
        let mut sets = vec![format!("{key}={value}")];
        // Some options need another one
        for (other, set) in [
            ("--isolate --", "job.isolate=true"),
            ("--surface smooth --", "render.surface=\"smooth\""),
        ] {
            if flags.contains(other) {
                sets.push(set.to_owned());
            }
        }
        let sets = sets.iter().map(|set| format!(" --set {}", set.replace(' ', "")));
        plain = manifest(&sets.collect::<String>());
        assert_eq!(manifest(flags), plain, "{flags}");
    }
}

/// Options whose `[default: ...]` is no value that could be given.
const WORDS: [&str; 16] = [
    "gpu",
    "center",
    "align",
    "fit",
    "where",
    "crop",
    "dpi",
    "view",
    "memory-limit",
    "memory-ceiling",
    "parts",
    "topology",
    "color_by",
    "range",
    "color_scale",
    "stop-file",
];

#[test]
fn options_of_lists_add_items() {
    for (flags, sets) in [
        ("--colorbar", "overlay=[{type=\"colorbar\",layout=\"auto\"}]"),
        ("--legend", "overlay=[{type=\"colorbar\",layout=\"auto\"}]"),
        (
            "--title Speed --unit m/s",
            "overlay=[{type=\"colorbar\",layout=\"auto\",title=\"Speed\",unit=\"m/s\"}]",
        ),
        (
            "--text a --text {frame} --scale-bar --axes --timestamp",
            "overlay=[{type=\"text\"},{type=\"text\",text=\"a\"},{type=\"text\",text=\"{frame}\"},\
             {type=\"scale_bar\"},{type=\"axes\"}]",
        ),
        ("--arrows velocity:0.05", "arrows=[{attribute=\"velocity\",scale=0.05}]"),
        ("--style x<1:hidden", "style=[{where=\"x<1\",draw=\"hidden\"}]"),
        (
            "--clip x<0.5 --clip z>=-1",
            "clip=[{type=\"plane\",normal=\"x\",offset=0.5},{type=\"plane\",normal=\"-z\",offset=1.0}]",
        ),
        ("--slice z=0.5:0.1", "select.slab={axis=\"z\",center=0.5,thickness=0.1}"),
        ("--cmap turbo", "material.color.map=turbo"),
        ("--colour-by v", "material.color={attribute=\"v\"}"),
        ("--no-legend", "legend=false"),
        (
            "--turntable 36",
            "camera.mode=turntable --set camera.degrees_per_frame=10.0 --set input.repeat=36",
        ),
        ("--size 80mmx60mm", "image={width=\"80mm\",height=\"60mm\"}"),
    ] {
        let expected = manifest(&format!("--set {sets}"));
        assert_eq!(manifest(flags), expected, "{flags}");
        assert_ne!(expected, Manifest::new("data"), "{flags}");
    }
}

#[test]
fn wrong_values_of_short_options_are_refused() {
    for (flags, part) in [
        ("--size 640", "the width and the height, such as 1280x720"),
        ("--size x640", "the width and the height"),
        ("--size 0x0", "--size: image.width: expected"),
        ("--size 640x480 --width 7", "cannot be used with"),
        ("--background notacolour", "--background: expected a colour"),
        ("--background #12345", "needs 3 or 6 hexadecimal digits"),
        ("--background [300,0,0]", "300 is not in 0 to 255"),
        ("--background [1,0", "--background: expected a colour"),
        ("--color velocty", "--color: expected a colour"),
        ("--text", "a value is required"),
        ("--text=", "a value is required"),
        ("--text {tme}", "unknown variable `{tme}`"),
        ("--vmin 3", "--vmax"),
        ("--vmin 3 --vmax 2", "expected two rising numbers"),
        ("--vmin 0 --vmax 2 --range 0 1", "cannot be used with"),
        ("--arrows velocity", "such as velocity:0.05"),
        ("--arrows velocity:-1", "scale: expected"),
        ("--slice z=0.5", "such as z=0.5:0.1"),
        ("--slice w=0.5:0.1", "select.slab.axis: expected one of x, y, z"),
        ("--slice z=0.5:0", "thickness: expected"),
        ("--clip w<1", "such as x<0.5"),
        ("--clip x<nan", "such as x<0.5"),
        ("--clip x", "such as x<0.5"),
        ("--fov 180", "--fov: expected"),
        ("--eye 1,2", "--eye: expected three numbers"),
        ("--opacity 2", "--opacity: expected a number from 0 to 1"),
        ("--color red --color-by v", "cannot be used with"),
    ] {
        let arguments = format!("render data {flags}");
        let arguments = with_equals(arguments.split_whitespace().map(OsString::from));
        let message = match command().try_get_matches_from(arguments) {
            Err(error) => error.to_string(),
            Ok(matches) => {
                let run = RunArgs::from_arg_matches(&matches).unwrap();
                let error = run.manifest.manifest().expect_err(flags);
                error.messages().join("\n")
            }
        };
        assert!(message.contains(part), "{flags}: {message}");
    }
}

#[test]
fn defaults_in_the_help_are_those_of_the_manifest() {
    let mut checked = 0;
    for argument in command().get_arguments() {
        let help = argument.get_help().map(ToString::to_string).unwrap_or_default();
        let Some((_, rest)) = help.split_once("[default: ") else {
            continue;
        };
        if WORDS.contains(&argument.get_id().as_str()) {
            continue;
        }
        let default = rest.trim_end_matches(']');
        let flag = argument.get_long().unwrap();
        let given = manifest(&format!("--{flag} {default}"));
        // A map of its own is another setting, though it is the same one.
        if flag == "map" {
            assert_eq!(given, manifest("--set material.color.map=viridis"));
        } else {
            assert_eq!(given, Manifest::new("data"), "--{flag} {default}");
        }
        checked += 1;
    }
    assert!(checked >= 15, "{checked}");
}

#[test]
fn no_option_is_forgotten() {
    let of_keys: Vec<&str> = key_flags().iter().map(|key| key.flag.name).collect();
    let tried: BTreeSet<&str> = FLAGS
        .iter()
        .flat_map(|(flags, _)| flags.split_whitespace())
        .filter_map(|flag| flag.strip_prefix("--"))
        .collect();
    for argument in command().get_arguments() {
        let name = argument.get_id().as_str();
        assert!(
            ACTIONS.contains(&name)
                || COLORS.contains(&name)
                || LISTS.contains(&name)
                || SHORT.contains(&name)
                || of_keys.contains(&name),
            "{name}"
        );
        assert!(!COLORS.contains(&name) || tried.contains(&*name.replace('_', "-")), "{name}");
    }
    // Every kind of value is tried.
    for key in key_flags() {
        let is_tried = |other: &KeyFlag| other.kind == key.kind && tried.contains(other.flag.name);
        assert!(key_flags().iter().any(is_tried), "{key:?}");
    }
}

#[test]
fn values_without_equals_are_told_from_inputs() {
    for (line, expected) in [
        ("--ground checker in", "--ground=checker in"),
        ("--ground in", "--ground in"),
        ("--ground cheker", "--ground=cheker"),
        ("--ground --cell", "--ground --cell"),
        ("--denoise false --cell", "--denoise=false --cell"),
        ("--bonds 1.8 in", "--bonds=1.8 in"),
        ("--bonds=1.8 2", "--bonds=1.8 2"),
        ("-- --ground checker", "-- --ground checker"),
        // A file
        ("--ground Cargo.toml", "--ground Cargo.toml"),
    ] {
        let joined = with_equals(line.split_whitespace().map(OsString::from));
        let joined: Vec<&str> = joined.iter().filter_map(|text| text.to_str()).collect();
        assert_eq!(joined.join(" "), expected);
    }
}
