//! Damage of USD files, and what is refused.

use proptest::prelude::*;

use super::FORMAT;
use crate::read::damage::{TestedReader, attribute, coordinates, mutate, numbers, sample};
use spherule_frame::{AttributeData, MemoryBudget, ParseError};

const READER: TestedReader = TestedReader {
    steps: |bytes| FORMAT.steps(bytes),
    read: |bytes, step| FORMAT.read(bytes, step),
};

const SAMPLES: [&str; 11] = [
    "drops.usda",
    "drops.usdc",
    "drops.usdz",
    "types.usda",
    "types.usdc",
    "between.usda",
    "between.usdc",
    "moved.usda",
    "moved.usdc",
    "instances.usda",
    "instances.usdc",
];

fn usd(name: &str) -> Vec<u8> {
    sample(&format!("usd/{name}"))
}

/// Reads a text file with `content`.
fn text(content: &str) -> Result<Vec<spherule_frame::RawParticles>, ParseError> {
    READER.all(format!("#usda 1.0\n{content}").as_bytes())
}

#[track_caller]
fn refused(content: &str, words: &str) {
    let error = text(content).expect_err(content).to_string();
    assert!(error.contains(words), "{error}");
}

const POINTS: &str = "def Points \"P\" { point3f[] points = [(1, 2, 3), (4, 5, 6)] }";

#[test]
fn older_names_of_types_read_alike() {
    let with = |point: &str, vector: &str, color: &str, quaternion: &str, matrix: &str| {
        let content = format!(
            "def Points \"P\" {{ {point}[] points = [(1, 2, 3), (4, 5, 6)]\n {vector}[] velocities = [(1, 0, 0), (0, 1, 0)]\n \
             {color}[] primvars:displayColor = [(1, 0.5, 0), (0, 0.25, 1)]\n {quaternion} primvars:turn = (1, 0, 0, 0)\n \
             {matrix} xformOp:transform = ((1, 0, 0, 0), (0, 2, 0, 0), (0, 0, 1, 0), (5, 0, 0, 1))\n \
             uniform token[] xformOpOrder = [\"xformOp:transform\"] }}"
        );
        text(&content).expect("known types")
    };
    let today = with("point3f", "vector3f", "color3f", "quath", "matrix4d");
    assert_eq!(today[0].positions.len(), 2);
    assert_eq!(today[0].attributes.len(), 3);
    let older = with("PointFloat", "VectorFloat", "ColorFloat", "Quath", "Matrix4d");
    assert_eq!(older, today);
    let older = with("Point", "Vector", "Color", "Quatd", "Frame");
    assert_eq!(older, with("point3d", "vector3d", "color3d", "quatd", "frame4d"));
    assert_eq!(
        with("Vec3f", "Normal", "Vec3d", "Quatf", "Matrix4d")[0].positions,
        today[0].positions
    );
}

#[test]
fn unknown_types_of_positions_and_transforms_are_refused() {
    let points = "[(1, 2, 3), (4, 5, 6)]";
    refused(
        &format!("def Points \"P\" {{ Location[] points = {points} }}"),
        "of /P have the unknown type \"Location[]\"",
    );
    refused(
        &format!("def Points \"P\" {{ Location[] points.timeSamples = {{ 1: {points} }} }}"),
        "unknown type",
    );
    let blocked = text("def Points \"P\" { Location[] points = None }").expect("no value");
    assert_eq!(blocked[0].positions.len(), 0);
    refused(
        &format!(
            "def Points \"P\" {{ point3f[] points = {points}\n Matrix xformOp:transform = ((1, 0), (0, 1))\n \
             uniform token[] xformOpOrder = [\"xformOp:transform\"] }}"
        ),
        "unknown type",
    );
}

// Each of eleven files is read up to 1,500 times, with another byte changed each time.
#[test]
fn whatever_byte_is_changed_there_is_no_panic() {
    for name in SAMPLES {
        let bytes = usd(name);
        for at in (0..bytes.len()).step_by(bytes.len().div_ceil(500)) {
            for change in [0xff, 0x80, 1] {
                let mut changed = bytes.clone();
                changed[at] ^= change;
                let _ = READER.all(&changed);
            }
        }
    }
}

#[test]
fn files_that_are_cut_short_are_refused() {
    for name in SAMPLES {
        let bytes = usd(name);
        for cut in (0..bytes.len()).step_by(bytes.len().div_ceil(1000)) {
            let result = READER.all(&bytes[..cut]);
            // A text file is whole after each prim; a package may lack its list of files
            let is_whole = match name.rsplit('.').next() {
                Some("usda") => bytes[..cut].trim_ascii_end().ends_with(b"}"),
                Some("usdz") => cut + 400 > bytes.len(),
                _ => false,
            };
            assert!(result.is_err() || is_whole, "{name} cut at {cut} was read");
        }
    }
}

#[test]
fn budget_limits_every_array() {
    for name in SAMPLES {
        let bytes = usd(name);
        let mut outcomes = [0, 0];
        for budget in (0..18).map(|bits| MemoryBudget::new(1 << bits, "take care")) {
            let mut source = crate::read::ByteSource::whole(&bytes);
            let steps = FORMAT.steps_within(&mut source, budget);
            let read = steps.and_then(|steps| FORMAT.read_within(&mut source, &steps[0], budget));
            match read {
                Ok(particles) => {
                    assert!(particles.byte_len() <= budget.bytes(), "{name}");
                    outcomes[0] += 1;
                }
                Err(ParseError::TooLarge { what }) => {
                    assert!(what.ends_with("take care"), "{what}");
                    outcomes[1] += 1;
                }
                Err(error) => panic!("{name}: {error}"),
            }
        }
        assert!(outcomes[0] > 0 && outcomes[1] > 0, "{name}: {outcomes:?}");
    }
}

#[test]
fn text_has_comments_strings_and_separators_anywhere() {
    let particles = text(
        "( # a comment with ) and \"\n \"\"\"documentation with \"quotes\" and )\"\"\"\n upAxis = 'Z';\n\
         doc = 'it\\'s' )\n\
         /* no def Points \"X\" { } */\n\
         def Xform \"A\" ( kind = \"group\" prepend apiSchemas = [\"B\"]\n customData = { string a = \"}\" } )\n{\n\
         rel target = </A/P>\n custom string note = \"\"\"{ ( [\"\"\"\n uniform token[] names = [\"]\", '}']\n\
         asset file = @a}b@ ( doc = \")\" )\n\
         def Points \"P\" { point3f[] points.timeSamples = { 10 : [(1,2,3)], 2: [(4, 5 , 6 ,)], }\n\
         float[] primvars:a = [1.5e1] ( interpolation = \"vertex\" ) ; int[] primvars:b.connect = </x.y> }\n }",
    );
    // A comma after the last number of a tuple is no longer USD
    assert!(particles.is_err());
    let particles = text(
        "( # a comment with ) and \"\n \"\"\"documentation with \"quotes\" and )\"\"\"\n upAxis = 'Z';\n\
         doc = 'it\\'s' )\n\
         /* no def Points \"X\" { } */\n\
         def Xform \"A\" ( kind = \"group\" prepend apiSchemas = [\"B\"]\n customData = { string a = \"}\" } )\n{\n\
         rel target = </A/P>\n custom string note = \"\"\"{ ( [\"\"\"\n uniform token[] names = [\"]\", '}']\n\
         asset file = @a}b@ ( doc = \")\" )\n\
         def Points \"P\" { point3f[] points.timeSamples = { 10 : [(1,2,3)], 2: [(4, 5 , 6 )], }\n\
         float[] primvars:a = [1.5e1] ( interpolation = \"vertex\" ) ; int[] primvars:b.connect = </x.y> }\n }",
    ).expect("a good file");
    assert_eq!(particles.len(), 2);
    assert_eq!(coordinates(&particles[0].positions), [[4.0, 5.0, 6.0]]);
    assert_eq!(particles[1].time, Some(10.0 / 24.0));
    assert_eq!(particles[1].step, Some(10));
    assert_eq!(numbers(&attribute(&particles[1], "a").data), [15.0]);
}

#[test]
fn scenes_whose_positions_may_depend_on_other_files_are_refused() {
    let flatten = "usdcat --flatten";
    refused(&format!("( subLayers = [@other.usda@] )\n{POINTS}"), flatten);
    refused(
        &format!("def Xform \"A\" ( references = @a.usda@</B> (offset = 2) ) {{ {POINTS} }}"),
        flatten,
    );
    refused(&format!("def Xform \"A\" ( prepend payload = @a.usda@ ) {{ {POINTS} }}"), flatten);
    refused(&format!("def \"A\" ( inherits = </C> ) {{ {POINTS} }}"), flatten);
    refused(&format!("def \"A\" {{ variantSet \"x\" = {{ \"y\" {{ }} }} {POINTS} }}"), flatten);
    refused(&format!("def \"A\" {{ variantSet \"x\" = {{ \"y\" {{ {POINTS} }} }} }}"), flatten);
    refused("def Mesh \"A\" { }", "without Points");
    refused(&format!("over \"A\" {{ {POINTS} }}\nclass \"B\" {{ {POINTS} }}"), "without Points");
    refused(&format!("def \"A\" ( active = false ) {{ {POINTS} }}"), "without Points");
    // References elsewhere do not matter, and are reported
    let other = format!("#usda 1.0\ndef \"A\" ( references = @a.usda@ ) {{ }}\n{POINTS}");
    assert_eq!(READER.one(other.as_bytes()).positions.len(), 2);
    let notes = FORMAT.reader().notes(other.as_bytes());
    assert!(notes.iter().any(|note| note.contains("are not read")), "{notes:?}");
}

#[test]
fn transforms_that_are_not_read_are_refused_by_name() {
    let with = |operation: &str, name: &str| {
        format!(
            "def Xform \"A\" {{ {operation} uniform token[] xformOpOrder = [\"{name}\"] {POINTS} }}"
        )
    };
    let cases = [
        ("", "xformOp:twist", "no value"),
        (
            "double xformOp:twist = 1",
            "xformOp:twist",
            "/A: the transform xformOp:twist is not known",
        ),
        ("double xformOp:scale = 1", "xformOp:scale", "another type"),
        ("double3 xformOp:scale = (0, 1, 1)", "!invert!xformOp:scale", "cannot be inverted"),
        ("double3 xformOp:scale = (nan, 1, 1)", "xformOp:scale", "is not a number"),
        (
            "double xformOp:rotateX.spline = { bezier, 1: 2 }",
            "xformOp:rotateX",
            "a curve over time",
        ),
        (
            "matrix4d xformOp:transform = ( (1, 0, 0, 1), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )",
            "xformOp:transform",
            "is a projection",
        ),
        ("double3 size = (2, 2, 2)", "size", "is not known"),
    ];
    for (operation, name, words) in cases {
        if words == "no value" {
            let particles = text(&with(operation, name)).expect("OpenUSD ignores it");
            assert_eq!(coordinates(&particles[0].positions)[0], [1.0, 2.0, 3.0]);
        } else {
            refused(&with(operation, name), words);
        }
    }
    let turning = "quatf xformOp:orient.timeSamples = { 0: (1, 0, 0, 0), 2: (0, 1, 0, 0) }\n\
                   uniform token[] xformOpOrder = [\"xformOp:orient\"]\n\
                   point3f[] points.timeSamples = { 0: [(1, 2, 3)], 1: [(1, 2, 3)] }";
    refused(&format!("def Points \"A\" {{ {turning} }}"), "no sample at the time");
    let many = vec!["\"xformOp:translate\""; 65].join(", ");
    refused(
        &format!(
            "def Points \"A\" {{ uniform token[] xformOpOrder = [{many}] point3f[] points = [(1, 2, 3)] }}"
        ),
        "more than 64",
    );
}

#[test]
fn widths_and_velocities_are_transformed_with_the_positions() {
    let particles = text(
        "def Xform \"A\" { double3 xformOp:scale = (2, 2, 2) float xformOp:rotateZ = 90\n\
         uniform token[] xformOpOrder = [\"xformOp:scale\", \"xformOp:rotateZ\"]\n\
         def Points \"P\" { point3f[] points = [(1, 2, 3)] float[] widths = [0.5]\n\
         vector3f[] velocities = [(1, 0, 0)] vector3f[] primvars:v = [(1, 0, 0)] } }",
    );
    let particles = &particles.expect("a good file")[0];
    let near = |found: &[f64], expected: &[f64]| {
        found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12)
    };
    assert!(near(&coordinates(&particles.positions)[0], &[-4.0, 2.0, 6.0]));
    assert_eq!(numbers(&attribute(particles, "diameter").data), [1.0]);
    assert!(near(&numbers(&attribute(particles, "velocities").data), &[0.0, 2.0, 0.0]));
    assert_eq!(numbers(&attribute(particles, "v").data), [1.0, 0.0, 0.0]);
}

#[test]
fn values_that_do_not_fit_are_left_out() {
    let particles = text(
        "def Points \"P\" { point3f[] points = [(1, 2, 3), (4, 5, 6), (7, 8, 9)]\n\
         float[] primvars:few = [1, 2] string[] primvars:names = [\"a\", \"b\", \"c\"]\n\
         float[] primvars:all = [5, 6, 7] int[] primvars:all:indices = [2, 0, 2]\n\
         float[] primvars:beyond = [5, 6, 7] int[] primvars:beyond:indices = [2, 0, 3]\n\
         int64[] ids = [9223372036854775807, -9223372036854775808, 0] bool[] primvars:yes = [true, 0, 1] }",
    );
    let particles = &particles.expect("a good file")[0];
    assert_eq!(crate::read::damage::names(particles), ["ids", "all", "yes"]);
    assert_eq!(numbers(&attribute(particles, "all").data), [7.0, 5.0, 7.0]);
    let ids = AttributeData::I64(vec![i64::MAX, i64::MIN, 0]);
    assert_eq!(attribute(particles, "ids").data, ids);
}

#[test]
fn prims_may_be_nested_up_to_a_limit() {
    let nested = |levels: usize| {
        let (open, close) = ("def \"A\" { ".repeat(levels), "}".repeat(levels));
        text(&format!("{open}{POINTS}{close}"))
    };
    assert_eq!(nested(255).expect("not too deep")[0].positions.len(), 2);
    let error = nested(100_000).expect_err("too deep").to_string();
    assert!(error.contains("more than 256 others"), "{error}");
    // Brackets in values have no limit
    let many = "(".repeat(1 << 20);
    refused(&format!("def \"A\" {{ int a = {many}"), "cut short");
}

#[test]
fn up_axis_is_that_of_the_file() {
    for (name, is_y_up) in
        [("drops.usda", true), ("drops.usdc", true), ("drops.usdz", true), ("types.usdc", false)]
    {
        assert_eq!(FORMAT.reader().is_y_up(&usd(name)), is_y_up, "{name}");
    }
}

#[test]
fn notes_have_units_and_parts() {
    for name in ["drops.usda", "drops.usdc", "drops.usdz"] {
        let notes = FORMAT.reader().notes(&usd(name));
        assert_eq!(
            notes,
            [
                "a length unit is 0.01 m, and y points up; times are time codes divided by 30 a second",
                "attribute `part` has numbers for prims: 0 = /World/Oil, 1 = /World/Water",
                "the widths of points are the attribute `diameter`",
            ]
        );
    }
    for name in ["moved.usda", "moved.usdc"] {
        let notes = FORMAT.reader().notes(&usd(name));
        assert!(notes.iter().any(|note| note.contains("are transformed")), "{notes:?}");
    }
    let notes = FORMAT.reader().notes(&usd("instances.usdc"));
    assert!(notes.iter().any(|note| note.contains("PointInstancer")), "{notes:?}");
}

proptest! {
    #![proptest_config(crate::read::text_samples::config())]

    #[test]
    fn damage_never_panics(
        which in 0..SAMPLES.len(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
    ) {
        let _ = READER.all(&mutate(&usd(SAMPLES[which]), &changes));
    }
}
