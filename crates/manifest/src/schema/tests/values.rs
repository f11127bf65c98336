//! Many values for every key: the schema accepts a value if and only if the reader accepts it.

use std::sync::LazyLock;

use super::*;

/// Values of every type, around every bound.
const VALUES: [&str; 105] = [
    "[[0, 0, 0], [1, 1, 1]]",
    "\"99%\"",
    "0",
    "1",
    "-1",
    "2",
    "7",
    "8",
    "8.5",
    "9",
    "0.0",
    "0.5",
    "-0.5",
    "1.5",
    "1e-3",
    "45.25",
    "-89.5",
    "90",
    "-90.5",
    "91",
    "100",
    "101",
    "-100",
    "-100.5",
    "179.5",
    "180",
    "180.5",
    "64",
    "65",
    "4096",
    "4097",
    "65535",
    "65536",
    "65537",
    "1e9",
    "1.1e9",
    "1e38",
    "1e39",
    "-1e39",
    "1e300",
    "9223372036854775807",
    "-9223372036854775808",
    "nan",
    "inf",
    "-inf",
    "true",
    "false",
    "1979-05-27",
    "\"\"",
    "\" \"",
    "\"auto\"",
    "\"all\"",
    "\"none\"",
    "\"1-10\"",
    "\" 1 - 10 x 2 \"",
    "\"-5--2\"",
    "\"1-5:2\"",
    "\"1-9y3\"",
    "\"1 , 2,3-4\"",
    "\"1-z\"",
    "\"10-\"",
    "\"1-10x\"",
    "\"1 2\"",
    "\"1,\"",
    "\"4GiB\"",
    "\" 512 mib \"",
    "\"1.5G\"",
    "\".5k\"",
    "\"1.5\"",
    "\"1.5B\"",
    "\"4XiB\"",
    "\"4Gi\"",
    "\"-1\"",
    "\"x.exr\"",
    "\"out/f.####.EXR\"",
    "\"x.png\"",
    "\"out/.exr\"",
    "\".exr\"",
    "[]",
    "[1]",
    "[1, 2]",
    "[1, 2, 3]",
    "[0, 0, 0]",
    "[0, 1e100, 0]",
    "[1, 2, 3, 4]",
    "[-1, 0, 0]",
    "[1, \"a\", 3]",
    "[1, nan, 3]",
    "[\"a\"]",
    "[\"a\", \"\"]",
    "[\"RGBA\"]",
    "[\"Z\", \"id\"]",
    "[\"Z\", \"Z\"]",
    "[\"z\"]",
    "{}",
    "{ attribute = \"v\" }",
    "{ attribute = \"v\", scale = 0.5 }",
    "{ attribute = \"v\", scale = 0 }",
    "{ attribute = \"\" }",
    "{ bottom = [0, 0, 0], top = [1, 1, 1] }",
    "{ bottom = [0, 0, 0] }",
    "\"x > 1\"",
    "{ axis = \"z\", center = 1, thickness = 0.5 }",
    "{ axis = \"z\", center = 1, thickness = 0 }",
    "{ top = [0, 0, 0], bottom = [1, 1, 1], x = 1 }",
];

/// Values for colours that come from an attribute.
const COLORS: [&str; 17] = [
    "{ attribute = \"v\", map = \"turbo\", range = [0, 1] }",
    "{ attribute = \"v\", map = \"trubo\" }",
    "{ attribute = \"v\", range = [1] }",
    "{ attribute = \"v\", range = [0, \"1\"] }",
    "{ attribute = \"v\", scale = 1 }",
    "{ map = \"turbo\" }",
    "{ map = \"batlow_r\", reverse = true, steps = 2 }",
    "{ map = \"turbo_r_r\" }",
    "{ steps = 1 }",
    "{ steps = 65 }",
    "{ range = \"1%-99.5%\" }",
    "{ range = \"-1%-99%\" }",
    "{ range = \"1-99\" }",
    "{ range = \"symmetric\" }",
    "{ scale = \"symlog\", threshold = 0.5 }",
    "{ scale = \"categorical\", map = \"okabe-ito\", names = { 0 = \"a\", -3 = \"b\" } }",
    "{ scale = \"categorical\", names = { 01 = \"a\" } }",
];

/// Values of colour bars.
const BARS: [&str; 8] = [
    "\".2f\"",
    "\"%.2e\"",
    "\",.0f\"",
    "\".2g\"",
    "\".31f\"",
    "[0, 1.5]",
    "[0, 1.5, 2, 3, 4]",
    "21",
];

/// Values that the schema accepts and the reader rejects.
const BEYOND: [(&str, &str); 2] = [
    // A size must be above 0.
    ("render.memory_limit", "0B"),
    // There is a scale bar, for which a panorama has no scale.
    ("camera.projection", "equirectangular"),
];

/// A manifest with all keys that other keys depend on.
const BASE: &str = r#"
input = { path = "data" }
camera = { mode = "fixed", eye = [5, 6, 7.5], look_at = [9, 9, 9.25], key = [{ frame = 0, eye = [5, 6, 7.5], look_at = [9, 9, 9.25] }] }
light = [{ type = "point", position = [0, 0, 10] }, { type = "directional", direction = [0, 0, -1] }, { type = "sun", direction = [0, 0, -1] }, { type = "sphere", position = [0, 0, 10], radius = 1 }, { type = "rect", position = [0, 0, 10], direction = [0, 0, -1], width = 2, height = 1 }, { type = "disc", position = [0, 0, 10], direction = [0, 0, -1], radius = 1 }]
clip = [{ type = "plane", normal = "x" }, { type = "box", min = [0, 0, 0], max = [1, 1, 1] }]
overlay = [{ type = "colorbar" }, { type = "text" }, { type = "scale_bar" }, { type = "axes" }]
job = { isolate = true }
"#;

/// All keys, of tables and of items of lists.
fn keys() -> Vec<String> {
    let items = read(BASE).unwrap().entries();
    items.list().iter().map(|e| e.key.clone()).collect()
}

/// `BASE` with `value` for the dotted `key`.
fn with(key: &str, value: &toml::Value) -> Table {
    static PARSED: LazyLock<Table> = LazyLock::new(|| BASE.parse().unwrap());
    let mut base = toml::Value::Table(PARSED.clone());
    let mut node = &mut base;
    for part in key.split('.') {
        node = match node {
            toml::Value::Array(items) => &mut items[part.parse::<usize>().unwrap()],
            toml::Value::Table(table) => {
                let empty = toml::Value::Table(Table::new());
                table.entry(part).or_insert(empty)
            }
            other => panic!("{key}: {other}"),
        };
    }
    *node = value.clone();
    match base {
        toml::Value::Table(table) => table,
        other => panic!("{other}"),
    }
}

/// Collects the words that keys accept, and a misspelling of each.
fn words_and_slips(schema: &Value, found: &mut BTreeSet<String>) {
    match schema {
        Value::Object(map) => {
            let words = map.get("enum").and_then(Value::as_array);
            for word in words.into_iter().flatten().chain(map.get("const")) {
                if let Some(word) = word.as_str() {
                    found.insert(format!("{word:?}"));
                    found.insert(format!("{:?}", format!("{word}x")));
                }
            }
            map.values().for_each(|v| words_and_slips(v, found));
        }
        Value::Array(items) => items.iter().for_each(|v| words_and_slips(v, found)),
        _ => {}
    }
}

/// A float without a fraction is an integer in JSON schema, but not in TOML.
fn is_whole_float(value: &toml::Value) -> bool {
    matches!(value, toml::Value::Float(f) if f.fract() == 0.0)
}

/// Checks that schema and reader accept the same values of all keys: each key gets one of `every` words of the schema, all
/// of them in turn, and all other values.
fn values_agree(every: usize) {
    let (schema, validator) = (job_schema(), validator());
    let fixed: BTreeSet<String> =
        VALUES.iter().chain(&COLORS).chain(&BARS).map(|v| (*v).to_owned()).collect();
    let mut words = BTreeSet::new();
    words_and_slips(&schema, &mut words);
    let parsed = |text: String| {
        let value = format!("v = {text}").parse::<Table>().unwrap()["v"].clone();
        (text, value)
    };
    let words: Vec<(String, toml::Value)> = words.difference(&fixed).cloned().map(parsed).collect();
    let fixed: Vec<(String, toml::Value)> = fixed.into_iter().map(parsed).collect();
    let mut differ = Vec::new();
    for (index, key) in keys().into_iter().enumerate() {
        let mut taken = 0;
        let own_words = words.iter().skip(index % every).step_by(every);
        for (text, value) in fixed.iter().chain(own_words) {
            let table = with(&key, value);
            let read = read(&table.to_string());
            let valid = validator.is_valid(&serde_json::to_value(&table).unwrap());
            taken += usize::from(valid);
            let is_known = BEYOND.contains(&(key.as_str(), value.as_str().unwrap_or_default()));
            if valid != read.is_ok() && !(valid && is_whole_float(value)) && !is_known {
                let verdict =
                    read.map_or_else(|e| e.to_string(), |_| "the schema refuses it".to_owned());
                differ.push(format!("{key} = {text}: {verdict}"));
            }
        }
        // The camera is fixed, and has no view along an axis
        if every == 1 && taken == 0 && key != "camera.view" {
            differ.push(format!("{key}: takes nothing"));
        }
    }
    assert!(differ.is_empty(), "{}", differ.join("\n"));
}

// More than 100 values, and every eighth word of the schema, are read and validated for each key.
#[test]
fn schema_and_reader_accept_the_same_values() {
    values_agree(8);
}

#[test]
#[ignore = "takes two minutes; a part of the words is in the usual run"]
fn schema_and_reader_accept_the_same_words() {
    values_agree(1);
}

/// Checks that the list of differences is up to date.
#[test]
fn checks_of_the_reader_alone() {
    for (key, value) in BEYOND {
        let table = with(key, &toml::Value::from(value));
        assert!(validator().is_valid(&serde_json::to_value(&table).unwrap()));
        assert!(read(&table.to_string()).is_err(), "{key}");
    }
}
