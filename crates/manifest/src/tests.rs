use spherule_images::output::Compression;
use spherule_tracer::scene::{Background, Falloff};

use glam::{DVec3, Vec3};
use proptest::prelude::*;

use super::*;

/// The example in the design, which is also in the user documentation.
const EXAMPLE: &str = r#"
[input]
path = "ParticleData_Fluid_#.vtk"   # a directory, a pattern, or a list of files
frames = "1-17"                     # default: all
radius = "auto"                     # a length, "auto", or { attribute = "radius", scale = 1.0 }
up = "y"

[camera]
mode = "fixed"                      # auto | fixed | turntable | keys
eye = [0.0, 0.0, 0.0]
look_at = [5.0, 5.0, 0.0]
up = [0.0, 0.0, 1.0]
fov = 45.0                          # vertical, degrees

[image]
width = 1920
height = 1080
samples = 16                        # per pixel

[render]
accelerator = "auto"                # auto | lbvh | kdtree | bvh | sbvh
max_depth = 3
background = [0.05, 0.06, 0.08]     # linear RGB, or { bottom = [...], top = [...] }
ground = false

[material]                          # eq. 4.1-4.3
color = [0.6, 0.7, 0.9]             # or { attribute = "velocity", map = "viridis", range = [0.0, 4.0] }; vectors by magnitude
ambient = 0.1
diffuse = 0.7
specular = 0.2
shininess = 32.0
ior = 1.33
reflection = 1.0
transmission = 0.0

[[light]]
type = "point"                      # point | directional
position = [0.0, 0.0, 10.0]
color = [1.0, 1.0, 1.0]
intensity = 1.0                     # no distance falloff unless falloff = "inverse-square"

[output]
path = "out/frame.####.exr"
channels = ["RGBA", "Z", "N", "id"]
compression = "zip"
preview = true                      # PNG beside each image
"#;

fn path() -> &'static Path {
    Path::new("job.toml")
}

fn parse(text: &str) -> Manifest {
    Manifest::parse(text, path()).unwrap()
}

fn with_sets(sets: &[&str]) -> Result<Manifest, ManifestError> {
    let sets = sets.iter().map(|s| Override::parse(s).unwrap()).collect();
    Manifest::parse_with(EXAMPLE, path(), sets)
}

/// Checks that a valid manifest with `section` appended is rejected with exactly one message, which contains all
/// `parts`.
#[track_caller]
fn refused(section: &str, parts: &[&str]) {
    let text = format!("input.path = \"data\"\n{section}");
    let error = Manifest::parse(&text, path()).unwrap_err();
    assert_eq!(error.messages().len(), 1, "{error}");
    for part in parts {
        assert!(error.to_string().contains(part), "{error}");
    }
}

#[test]
fn example_manifest_is_valid() {
    let manifest = parse(EXAMPLE);
    let mut expected = Manifest::new("ParticleData_Fluid_#.vtk");
    expected.input.frames = Some("1-17".parse().unwrap());
    expected.input.up = Some(UpAxis::Y);
    expected.camera.mode = CameraMode::Fixed;
    expected.camera.eye = Some(DVec3::ZERO);
    expected.camera.look_at = Some(DVec3::new(5.0, 5.0, 0.0));
    expected.camera.up = Some(DVec3::Z);
    expected.render.ground = Some(GroundSetting::of(GroundKind::None));
    expected.render.background = Some(Background::Constant(Vec3::new(0.05, 0.06, 0.08)));
    expected.material.color = ColorSetting::Rgb(Vec3::new(0.6, 0.7, 0.9));
    expected.lights = vec![Light {
        kind: LightKind::Point { position: DVec3::new(0.0, 0.0, 10.0), falloff: Falloff::None },
        color: Vec3::ONE,
        intensity: 1.0,
        visible: false,
        group: None,
    }];
    assert_eq!(manifest, expected);
}

#[test]
fn path_is_the_only_required_key() {
    assert_eq!(parse("[input]\npath = \"data\""), Manifest::new("data"));
    let overlay = Override::new("input.path", "5", "INPUT").unwrap();
    let manifest = Manifest::parse_with("", path(), vec![overlay]).unwrap();
    assert_eq!(manifest, Manifest::new("5"));
    let error = Manifest::parse("", path()).unwrap_err().to_string();
    assert!(error.starts_with("job.toml: input.path: is missing"), "{error}");
}

#[test]
fn unknown_keys_name_the_nearest() {
    refused(
        "[render]\nmax_dept = 5",
        &[
            "job.toml: line 3, column 1: render.max_dept: unknown key; did you mean `render.max_depth`?",
        ],
    );
    refused("[renderer]\n", &["did you mean `render`?"]);
    refused("[material]\ncolour = [1,1,1]", &["did you mean `material.color`?"]);
    refused("[render]\nsamples = 4", &["did you mean `image.samples`?"]);
    refused("[image]\nqqqqq = 4", &["known here: width, height, dpi, samples"]);
    refused(
        "samples = 4",
        &["job.toml: line 2, column 1: samples: unknown key here; did you mean `image.samples`?"],
    );
    refused(
        "[[light]]\ntype = \"directional\"\ndirection = [0,0,1]\nposition = [0,0,1]",
        &["light.0.position: unknown"],
    );
}

#[test]
fn wrong_types_name_the_expected_type() {
    refused(
        "[image]\nwidth = \"wide\"",
        &[
            "line 3, column 9: image.width: expected a length on paper such as \"85mm\", or a whole number from 1 to 65536, found the text \"wide\"",
        ],
    );
    refused("[image]\nwidth = 0", &["image.width", "found 0"]);
    refused("[image]\nsamples = 0", &["image.samples", "from 1"]);
    refused("[image]\nheight = -5", &["image.height", "found -5"]);
    refused("[image]\nheight = 10.5", &["image.height", "whole"]);
    refused(
        "[render]\nground = 1",
        &[
            "render.ground: expected true, false or one of none, plain, checker, shadow_catcher, image or \"auto\", found 1",
        ],
    );
    refused("[render]\nbackground = [1, 2]", &["render.background", "a list of 2"]);
    refused("[render]\nbackground = { bottom = [0,0,0] }", &["render.background.top: is missing"]);
    refused("[render]\naccelerator = \"lbhv\"", &["did you mean lbvh?"]);
    refused("[render]\nbvh_preset = \"meduim\"", &["render.bvh_preset", "did you mean medium?"]);
    refused("[render]\nbvh_leaves = 16", &["render.bvh_leaves: expected one of blocks, particles"]);
    for wrong in ["-0.5", "nan", "8.01", "1e39", "inf", "\"much\"", "[1]"] {
        refused(
            &format!("[render]\nsbvh_budget = {wrong}"),
            &["render.sbvh_budget: expected a number from 0 (no spatial splits) to 8, found"],
        );
    }
    for wrong in ["-1e-5", "1.5", "nan"] {
        refused(
            &format!("[render]\nsbvh_alpha = {wrong}"),
            &["render.sbvh_alpha: expected a number from 0 to 1, found"],
        );
    }
    for right in ["0", "0.5", "8"] {
        let set = format!("render.sbvh_budget={right}");
        let budget = with_sets(&[&set]).unwrap().render.sbvh_budget;
        assert_eq!(budget, right.parse::<f32>().unwrap());
    }
    refused("[render]\nground_height = inf", &["render.ground_height", "height or"]);
    refused("[material]\ncolor = [0.1, -0.2, 0.3]", &["material.color", "from 0"]);
    refused("[material]\ncolor = [0.1, nan, 0.3]", &["material.color"]);
    refused("[material]\ncolor = [0.1, 1e39, 0.3]", &["material.color"]);
    refused("[material]\ncolor = {}", &["material.color.attribute: is missing"]);
    refused(
        "[material]\ncolor = { attribute = \"v\", map = \"virids\" }",
        &["did you mean viridis?"],
    );
    refused("[material]\ncolor = { attribute = \"v\", range = [4, 0] }", &["two rising numbers"]);
    for (color, part) in [
        ("range = \"99%-1%\"", "two rising numbers"),
        ("range = \"1%-101%\"", "percentiles such as"),
        ("range = [4, 0]", "reverse = true reverses the map"),
        ("scale = \"log\", range = [0, 1]", "material.color.range: 0.0 has no logarithm"),
        ("scale = \"log\", range = \"symmetric\"", "material.color.range: a symmetric range"),
        ("scale = \"categorical\", steps = 3", "material.color.steps: categories have no steps"),
        (
            "scale = \"categorical\", range = [0, 1]",
            "material.color.range: categories have no range",
        ),
        ("names = { 1 = \"a\" }", "material.color.names: only categories"),
        ("threshold = 1", "material.color.threshold: only"),
        ("map = \"okabe-ito\"", "material.color.map: a palette needs"),
        ("map = \"batlov\"", "did you mean batlow?"),
        ("scale = \"linar\"", "did you mean linear?"),
    ] {
        let text = format!("[material]\ncolor = {{ attribute = \"v\", {color} }}");
        refused(&text, &[part]);
    }
    refused("[material]\nreflection = 1.5", &["from 0 to 1"]);
    refused("[camera]\nfov = 180", &["camera.fov"]);
    refused("[camera]\nmode = \"fixed\"\neye = [1,2,3]", &["camera.look_at: is missing"]);
    refused("[camera]\neye = [1,2,3]\nlook_at = [1,2,3]", &["camera.look_at: is where"]);
    refused(
        "[camera]\neye = [0,0,0]\nlook_at = [0,0,3]\nup = [0,0,1]",
        &["line 5", "camera.up: points along"],
    );
    refused("[camera]\nup = [0,0,0]", &["camera.up", "not all 0"]);
    refused("[camera]\nmode = \"keys\"", &["camera.key: is missing"]);
    refused(
        "[camera]\nmode = \"turntable\"\neye = [1,2,3]",
        &["line 4, column 1: camera.eye: is given, but a turntable finds its own"],
    );
    refused("[light]\ntype = \"point\"", &["light: expected a list of tables, such as [[light]]"]);
    refused("[[light]]\n", &["light.0.type: is missing"]);
    refused("[[light]]\ntype = \"point\"", &["light.0.position: is missing"]);
    refused("[output]\npath = \"x.jpg\"", &["output.path", ".exr or .png"]);
    refused("[output]\nchannels = []", &["output.channels"]);
    refused("[output]\nchannels = [\"RGBA\", \"z\"]", &["output.channels.1", "did you mean Z?"]);
    refused("[output]\nchannels = [\"Z\", \"Z\"]", &["Z is there twice"]);
    refused("[output]\nfps = 0", &["output.fps"]);
    refused("[output]\ncompression = 3", &["one of none, rle, zip, zips, piz, found 3"]);
    refused("render = 3", &["render: expected a table, found 3"]);
}

#[test]
fn keys_of_the_camera_are_checked() {
    let key = |rest: &str| format!("[[camera.key]]\nframe = 4\neye = [0,0,9]\n{rest}\n");
    for (rest, what) in [
        ("", "line 2, column 1: camera.key.0.look_at: is missing; each"),
        ("look_at = [0,0,9]", "line 5, column 1: camera.key.0.look_at: is where the eye is"),
        ("look_at = [0,1]", "line 5, column 11: camera.key.0.look_at: expected three numbers"),
        (
            "look_at = [0,0,1]\nup = [0,0,-2]",
            "line 6, column 1: camera.key.0.up: points along the view",
        ),
        (
            "look_at = [0,0,1]\nup = [0,0,0]",
            "line 6, column 6: camera.key.0.up: expected three numbers that are not all 0",
        ),
        (
            "look_at = [0,0,1]\n[camera]\nup = [0,0,3]",
            "line 2, column 1: camera.key.0.up: is camera.up, which points along the view",
        ),
        ("look_at = [0,1,1]\nfov = 180", "line 6, column 7: camera.key.0.fov: expected degrees"),
        ("look_at = [0,1,1]\nupp = [0,0,1]", "did you mean `camera.key.0.up`?"),
    ] {
        refused(&key(rest), &[what]);
    }
    let good = key("look_at = [1,0,1]");
    refused(
        &[&good[..], &good].concat(),
        &["line 7, column 1: camera.key.1.frame: there is a key of frame 4 already"],
    );
    refused(
        &["[camera]\nmode = \"keys\"\nlook_at = [1,2,3]\n", &good].concat(),
        &["line 4, column 1: camera.look_at: is given, but each [[camera.key]] has its own"],
    );
}

#[test]
fn images_depend_on_keys_and_not_on_their_order() {
    let key = |frame: i64, rest: &str| {
        format!("[[camera.key]]\nframe = {frame}\neye = [9,0,0]\nlook_at = [0,0,0]\n{rest}\n")
    };
    let settings = |keys: [String; 2]| {
        let text = ["input.path = \"data\"\n", &keys.concat()].concat();
        parse(&text).settings()
    };
    let base = settings([key(1, ""), key(5, "")]);
    assert_eq!(settings([key(5, ""), key(1, "")]), base);
    for (rest, shown) in [
        ("up = [0,1,0]", "camera.key.1.up: (not set) -> [0.0, 1.0, 0.0]"),
        ("fov = 30", "camera.key.1.fov: (not set) -> 30.0"),
    ] {
        let other = settings([key(1, ""), key(5, rest)]);
        let changes = spherule_jobs::compare_settings(&base, &other);
        assert_eq!(changes.len(), 1);
        assert_eq!(changes[0].to_string(), shown);
    }
}

#[test]
fn input_is_checked() {
    let refused = |text: &str, part: &str| {
        let error = Manifest::parse(text, path()).unwrap_err();
        assert_eq!(error.messages().len(), 1, "{error}");
        assert!(error.to_string().contains(part), "{error}");
    };
    refused("[input]\npath = \"\"", "input.path: expected a name");
    refused("[input]\npath = []", "input.path: expected a directory");
    refused("[input]\npath = [\"a\", 3]", "input.path.1");
    refused("[input]\npath = \"a\"\nradius = 0", "input.radius: expected a length above 0");
    refused("[input]\npath = \"a\"\nradius = { scale = 2 }", "input.radius.attribute: is missing");
    refused("[input]\npath = \"a\"\nframes = \"1-z\"", "character 3");
    let manifest = parse("[input]\npath = [\"a\", \"b\"]\nframes = 7\nradius = 2");
    assert_eq!(*manifest.input.path, ["a", "b"]);
    assert_eq!(manifest.input.frames, Some("7".parse().unwrap()));
    assert_eq!(manifest.input.radius, RadiusSetting::Length(2.0));
    // Which of the frames 1-3 exist is unknown without the sequence.
    for range in ["3", "1-3"] {
        let text =
            format!("input = {{ path = \"a\", frames = \"{range}\" }}\noutput.path = \"a.exr\"");
        let one = parse(&text);
        assert!(one.check_frame_count(1).is_ok());
        let error = one.check_frame_count(2).unwrap_err().to_string();
        assert!(error.contains("a.exr for 2 frames: several frames would get"), "{error}");
        let followed = parse(&format!("{text}\njob.follow = true"));
        assert_eq!(followed.check_frame_count(1).is_ok(), range == "3");
    }
}

#[test]
fn toml_errors_have_line_and_column() {
    let error = Manifest::parse("[input]\npath = \n", path()).unwrap_err().to_string();
    assert!(error.starts_with("job.toml: line 2, column "), "{error}");
    let error = Manifest::parse("a = 1\na = 2", path()).unwrap_err().to_string();
    assert!(error.contains("line 2"), "{error}");
}

#[test]
fn all_problems_are_reported_at_once() {
    let error = Manifest::parse("[image]\nwidth = 0\n[render]\nx = 1\n", path()).unwrap_err();
    let messages = error.messages();
    assert_eq!(messages.len(), 3, "{error}");
    assert!(messages[0].contains("image.width"));
    assert!(messages[1].contains("render.x"));
    assert!(messages[2].contains("input.path"));
}

#[test]
fn overrides_replace_file_values() {
    let manifest = with_sets(&[
        "render.max_depth=5",
        "output.compression = piz",
        "input.frames=1-3x2",
        "output.path=a=b.####.exr",
        "material.color={ attribute = \"velocity\", map = \"turbo\" }",
        "light.0.intensity=2",
        "input.parts=[\"fluid\"]",
    ])
    .unwrap();
    assert_eq!(manifest.render.max_depth, 5);
    assert_eq!(manifest.output.compression, Compression::Piz);
    assert_eq!(manifest.input.frames, Some("1-3x2".parse().unwrap()));
    assert_eq!(manifest.output.path.as_str(), "a=b.####.exr");
    assert_eq!(
        manifest.material.color,
        ColorSetting::Mapped(ColorMapping {
            map: MapName::named("turbo"),
            ..ColorMapping::by("velocity")
        })
    );
    assert_eq!(manifest.lights[0].intensity, 2.0);
    assert_eq!(manifest.input.parts, Some(vec!["fluid".to_owned()]));
}

#[test]
fn map_alone_keeps_the_attribute() {
    let auto = |range: Option<[f64; 2]>| {
        ColorSetting::Mapped(ColorMapping {
            map: MapName::named("turbo"),
            range: range.map(RangeSetting::Values),
            ..ColorMapping::default()
        })
    };
    let color = |sets: &[&str]| {
        let sets = sets.iter().map(|s| Override::parse(s).unwrap()).collect();
        let manifest = Manifest::parse_with("input.path = \"data\"", path(), sets);
        manifest.unwrap().material.color
    };
    assert_eq!(color(&["material.color.map=turbo"]), auto(None));
    let both = ["material.color=auto", "material.color.map=turbo", "material.color.range=[1, 2]"];
    assert_eq!(color(&both), auto(Some([1.0, 2.0])));
    let mut manifest = Manifest::new("data");
    manifest.material.color = auto(Some([1.0, 2.0]));
    let text = manifest.to_commented_toml();
    assert_eq!(Manifest::parse(&text, path()), Ok(manifest));
}

#[test]
fn control_characters_in_strings_are_escaped() {
    let hostile = "a\u{1b}[2J\nb\u{9b}\u{202e}\"\\";
    let text = Manifest::new(hostile).to_commented_toml();
    let raw = text.chars().find(|c| *c != '\n' && spherule_files::is_control(*c));
    assert_eq!(raw, None);
    let again = Manifest::parse(&text, path());
    assert_eq!(again, Ok(Manifest::new(hostile)));
}

#[test]
fn invalid_overrides() {
    let wrong = |set: &str, part: &str| {
        let error = with_sets(&[set]).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    };
    wrong(
        "render.max_dept=5",
        "--set render.max_dept=5: unknown key; did you mean `render.max_depth`?",
    );
    wrong("image.width=wide", "--set image.width=wide: expected");
    wrong(
        "image.width.x=1",
        "--set image.width.x=1: image.width is 1920, which has no keys; set image.width itself",
    );
    wrong("light.1.intensity=1", "light.1: the list has no such item");
    for (set, part) in [
        ("a", "no `=`"),
        ("a..b=1", "invalid key"),
        ("=1", "invalid key"),
        ("a=[1", "--set a=[1: "),
    ] {
        let error = Override::parse(set).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn media_scatter_light_along_paths_alone() {
    let read = |text: &str| {
        let text = format!("input.path = \"a\"\n{text}");
        Manifest::parse_with_warnings(&text, path(), Vec::new()).map_err(|e| e.to_string())
    };
    let murky = "scattering = [1, 0.5, 0], scattering_length = 0.1, anisotropy = 0.8";
    let (manifest, warnings) =
        read(&format!("material = {{ type = \"water\", {murky} }}")).unwrap();
    let found = (manifest.material.scattering_length, manifest.material.anisotropy);
    assert_eq!((found, warnings.len()), ((Some(0.1), 0.8), 0));
    let style = |kind: &str| {
        format!("style = [{{ draw = \"smooth\", material = {{ type = \"{kind}\", {murky} }} }}]")
    };
    let (manifest, _) = read(&style("water")).unwrap();
    let own = manifest.styles[0].material.as_ref().unwrap();
    let own = own.as_material(&manifest.material, 1.33);
    assert_eq!((own.scattering_length, own.anisotropy), found);
    // Whitted's model refuses them, whoever chose it
    for whitted in ["render.integrator = \"whitted\"", "material.shininess = 5"] {
        let clear = "material.type = \"glass\"\nmaterial.scattering = \"white\"";
        let error = read(&format!("{clear}\n{whitted}")).unwrap_err();
        let expected =
            "material.scattering: render.integrator = \"whitted\" does not follow the light";
        assert!(error.contains(expected), "{error}");
        let none = read(&format!("{}\n{whitted}", clear.replace("white", "black")));
        none.unwrap();
        let error = read(&format!("{}\n{whitted}", style("glass"))).unwrap_err();
        assert!(error.contains("style.0.material.scattering: render.integrator"), "{error}");
    }
    // Light does not enter other materials
    let (_, warnings) = read("material.scattering = \"white\"").unwrap();
    let expected = "material.scattering: has no effect: light does not enter this material";
    assert!(warnings.len() == 1 && warnings[0].contains(expected), "{warnings:?}");
    let (_, warnings) = read(&style("metal")).unwrap();
    assert!(warnings.len() == 1 && warnings[0].contains("scattering: has no effect"));
    // Values out of range
    for (key, value) in [
        ("scattering_length", "0"),
        ("scattering_length", "-1"),
        ("scattering_length", "nan"),
        ("scattering_length", "1e60"),
        ("scattering_length", "inf"),
        ("scattering", "[-0.1, 0, 0]"),
        ("scattering", "[1.5, 0, 0]"),
        ("scattering", "[nan, 0, 0]"),
        ("anisotropy", "0.96"),
        ("anisotropy", "-1"),
        ("anisotropy", "nan"),
    ] {
        let error =
            read(&format!("material = {{ type = \"water\", {key} = {value} }}")).unwrap_err();
        assert!(error.contains(&format!("material.{key}: ")), "{value}: {error}");
    }
}

#[test]
fn both_branches_are_followed_to_a_bounded_depth() {
    let glass = "[input]\npath = \"a\"\n[material]\ntransmission = 0.5\n";
    let with = |render: &str| {
        let text = format!("{glass}[render]\n{render}\n");
        Manifest::parse(&text, path()).map_err(|e| e.to_string())
    };
    assert_eq!(parse(glass).render.min_weight, 1.0 / 1024.0);
    assert!(with("min_weight = 0\nmax_depth = 8").is_ok());
    let error = with("min_weight = 0\nmax_depth = 9").unwrap_err();
    assert!(
        error.starts_with(
            "job.toml: line 6, column 1: render.min_weight: 0 follows both branches at transmissive spheres"
        ),
        "{error}"
    );
    assert!(error.contains("max_depth of at most 8"), "{error}");
    assert!(with("min_weight = 1e-5\nmax_depth = 64").is_ok());
    assert!(with("min_weight = 0\nmax_depth = 64\nsurface = \"union\"").is_ok());
    assert!(with("min_weight = 1e-6").is_err() && with("min_weight = 1.5").is_err());
    let opaque = "[input]\npath = \"a\"\n[render]\nmin_weight = 0\nmax_depth = 64\n";
    assert_eq!(parse(opaque).render.min_weight, 0.0);
}

#[test]
fn settings_are_what_images_depend_on() {
    let base = parse(EXAMPLE).settings();
    let same = [
        "input.path=other",
        "input.frames=1-20",
        "render.accelerator=lbvh",
        "render.bvh_preset=high",
        "render.bvh_leaves=particles",
        "render.accelerator=sbvh",
        "render.sbvh_alpha=0.001",
        "render.sbvh_budget=0",
        "output.path=elsewhere/frame.####.exr",
    ];
    for set in same {
        assert_eq!(with_sets(&[set]).unwrap().settings(), base, "{set}");
    }
    let other = with_sets(&["render.max_depth=5"]).unwrap().settings();
    let changes = spherule_jobs::compare_settings(&base, &other);
    assert_eq!(changes.len(), 1);
    assert_eq!(changes[0].to_string(), "render.max_depth: 3 -> 5");
    for set in ["output.path=out/f.####.exr", "light.0.intensity=2", "output.fps=25"] {
        assert_eq!(
            spherule_jobs::compare_settings(&base, &with_sets(&[set]).unwrap().settings()).len(),
            1,
            "{set}"
        );
    }
}

#[test]
fn commented_file_round_trips_with_every_key() {
    let plain = Manifest::new("a \"quoted\"\\path\n#.vtk");
    let text = plain.to_commented_toml();
    assert_eq!(parse(&text), plain);
    for key in known_keys() {
        let name = key.rsplit('.').next().unwrap();
        assert!(text.contains(&format!("{name} = ")), "{key}\n{text}");
    }
    assert_eq!(parse(&parse(EXAMPLE).to_commented_toml()), parse(EXAMPLE));
    // Check that the keys in comments are valid too
    let uncommented: String = text
        .lines()
        .map(|l| {
            l.strip_prefix("# ").filter(|l| l.contains(" = ") || l.starts_with("[[")).unwrap_or(l)
        })
        .map(|l| format!("{l}\n"))
        .collect();
    let error = Manifest::parse(&uncommented, path()).unwrap_err().to_string();
    assert!(error.contains("camera.eye: is given"), "{error}");
    let all = uncommented
        .replace("mode = \"auto\"", "mode = \"fixed\"")
        .replace("type = \"studio\"", "type = \"image\"");
    // A fixed camera has its own view
    let all = all.replace("\nview = ", "\n# view = ");
    // A style of spheres draws no bonds, arrows, trails and grains
    let own = [
        "bonds = {",
        "arrows = ",
        "trails = ",
        "shape = ",
        "mesh = ",
        "exponents = ",
        "orientation = {",
        "angular_velocity = ",
    ];
    let is_other = |line: &str| {
        own.iter().any(|key| line.starts_with(key)) || line.contains("# Semi-axes of grains")
    };
    let all: String = (all.lines())
        .map(|line| format!("{}{line}\n", if is_other(line) { "# " } else { "" }))
        .collect();
    let all = parse(&all.replace("isolate = false", "isolate = true"));
    assert_eq!(all.lights.len(), 1);
    assert_eq!(all.camera.keys.len(), 1);
    assert!(all.camera.keys[0].up.is_some() && all.camera.keys[0].fov.is_some());
    assert_eq!(all.output.fps, Some(24.0));
    assert_eq!(parse(&all.to_commented_toml()), all);
}

#[test]
fn lists_of_all_kinds_round_trip() {
    let text = r#"
input = { path = ["a", "b"], radius = { attribute = "d", scale = 0.5 }, up = "-y" }
camera.key = [{ frame = 9, eye = [1,2,3], look_at = [0,0,0], fov = 30 }, { frame = -1, eye = [1,1,1], look_at = [0,0,0], up = [0,1,0] }]
render = { background = { bottom = [0,0,0], top = [1,1,1] }, ground = true, ground_height = -2 }
material.color = { attribute = "velocity", map = "red-blue", range = [-1, 1] }
light = [{ type = "directional", direction = [0,0,-2] }, { type = "point", position = [1,1,1], falloff = "inverse-square" }]
"#;
    let manifest = parse(text);
    assert_eq!(manifest.camera.mode, CameraMode::Keys);
    assert_eq!(manifest.camera.keys[0].frame, -1);
    assert_eq!(manifest.camera.keys[0].up, Some(DVec3::Y));
    assert_eq!(manifest.render.ground_height, Some(-2.0));
    assert_eq!(parse(&manifest.to_commented_toml()), manifest);
}

proptest! {
    #[test]
    fn numbers_round_trip_to_the_bit(
        wide in prop::array::uniform3(prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL),
        narrow in prop::num::f32::POSITIVE | prop::num::f32::SUBNORMAL,
        path in "[^\\PC]{1,8}x",
    ) {
        let narrow = narrow.abs().min(f32::MAX);
        let mut manifest = Manifest::new(path);
        manifest.lights = vec![Light {
            kind: LightKind::Point { position: wide.into(), falloff: Falloff::None },
            color: Vec3::splat(narrow),
            intensity: narrow,
            visible: false,
            group: None,
        }];
        manifest.material.color = ColorSetting::Rgb(Vec3::splat(narrow));
        prop_assert_eq!(&parse(&manifest.to_commented_toml()), &manifest);
    }

    #[test]
    fn arbitrary_text_never_panics(text in "[a-z\\[\\]=.\"0-9{}, \n#]{0,60}") {
        let _ = Manifest::parse(&text, path());
    }
}

#[test]
fn number_of_reported_problems_is_limited() {
    let keys: String = (0..100_000).map(|i| format!("widt{i} = 1\n")).collect();
    let text = format!("input.path = \"a\"\n[image]\n{keys}");
    let error = Manifest::parse(&text, Path::new("job.toml")).expect_err("unknown keys");
    let message = error.to_string();
    assert!(
        message.contains("line 3, column 1: image.widt0: unknown key; did you mean"),
        "{message}"
    );
    assert!(message.ends_with("job.toml: and more like these"), "{message}");
    assert_eq!(message.lines().count(), 51);
}

#[test]
fn terms_of_the_thesis_select_its_model() {
    let integrator = |text: &str| parse(&format!("input.path = \"a\"\n{text}")).integrator();
    let whitted = IntegratorKind::Whitted;
    assert_eq!(integrator("material.shininess = 5"), whitted);
    // Defaults select nothing, however they are written
    assert_eq!(integrator("material.transmission = 0.0"), IntegratorKind::Path);
    assert_eq!(integrator(""), IntegratorKind::Path);
    assert_eq!(integrator("material.ior = 1.5"), IntegratorKind::Path);
    // The integrator that a manifest names is the one that it gets
    let both = "render.integrator = \"path\"\nmaterial.shininess = 5";
    assert_eq!(integrator(both), IntegratorKind::Path);
}

#[test]
fn a_term_that_selects_the_integrator_is_named_in_a_warning() {
    let warnings = |text: &str| {
        let text = format!("input.path = \"a\"\n[material]\n{text}");
        Manifest::parse_with_warnings(&text, path(), Vec::new()).unwrap().1
    };
    assert_eq!(
        warnings("ambient = 0.1\ntransmission = 1.0"),
        ["job.toml: line 4, column 1: material.transmission: selects integrator = \"whitted\"; \
             render.integrator = \"path\" keeps path tracing"]
    );
    assert_eq!(warnings("ambient = 0.1\ntransmission = 0.0"), [""; 0]);
    let named = "transmission = 1.0\n[render]\nintegrator = \"path\"";
    assert_eq!(warnings(named), [""; 0]);
}
