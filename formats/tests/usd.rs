//! USD files: damage with the error of each, and transforms. `reference.rs` compares good files with OpenUSD.
#![expect(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::{Path, PathBuf};

use spherule_formats::{AttributeData, FrameFile, MemoryBudget};

fn data(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    root.join("../tests/data/usd").join(name)
}

fn bytes_of(name: &str) -> Vec<u8> {
    fs::read(data(name)).expect("a sample")
}

/// Number of steps that are read, and the first error.
fn outcome(name: &str, bytes: Vec<u8>) -> (usize, String) {
    let budget = MemoryBudget::new(64 << 20, "take care");
    let shown = |error: spherule_formats::FrameError| {
        let message = error.to_string();
        assert!(!message.contains(char::is_control), "{message}");
        let what = message.strip_prefix(&format!("{name}: "));
        what.expect("an error begins with the path").to_owned()
    };
    match FrameFile::from_bytes_within(Path::new(name), bytes, budget) {
        Err(error) => (0, shown(error)),
        Ok(file) => {
            let read: Vec<_> = (0..file.steps().len()).map(|step| file.read(step)).collect();
            let good = read.iter().filter(|step| step.is_ok()).count();
            let error = read.into_iter().find_map(Result::err);
            (good, error.map_or_else(String::new, shown))
        }
    }
}

/// Compares the outcome of each line of a table of damage.
#[track_caller]
fn check(name: &str, table: &[(Vec<u8>, usize, &str)]) {
    let mut wrong = String::new();
    for (index, (bytes, steps, message)) in table.iter().enumerate() {
        let (found_steps, found) = outcome(name, bytes.clone());
        if found != *message || found_steps != *steps {
            wrong += &format!("\n{index}: {found_steps} steps, {found}");
        }
    }
    assert!(wrong.is_empty(), "{name}:{wrong}");
}

/// `bytes` with others from `at` on.
fn patched(bytes: &[u8], at: usize, new: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at..at + new.len()].copy_from_slice(new);
    bytes
}

fn u64_at(bytes: &[u8], at: usize) -> usize {
    let stored = bytes[at..].first_chunk().expect("eight bytes");
    usize::try_from(u64::from_le_bytes(*stored)).expect("a place")
}

/// Where a section of a binary file begins, and where the table has it.
fn section(bytes: &[u8], name: &str) -> (usize, usize) {
    let table = u64_at(bytes, 16);
    let entries = (0..u64_at(bytes, table)).map(|index| table + 8 + 32 * index);
    let mut named = entries
        .filter(|at| bytes[*at..].starts_with(name.as_bytes()) && bytes[at + name.len()] == 0);
    let entry = named.next().expect("a section");
    (u64_at(bytes, entry + 16), entry)
}

#[test]
fn damaged_binary_files() {
    let good = bytes_of("drops.usdc");
    let table = u64_at(&good, 16);
    let huge = u64::MAX.to_le_bytes();
    let count = 25_u64.to_le_bytes();
    let array = good.windows(8).position(|w| w == count).expect("an array of 25 points");
    let many = 200_000_u64.to_le_bytes();
    let [tokens, fields, sets, paths, specs] =
        ["TOKENS", "FIELDS", "FIELDSETS", "PATHS", "SPECS"].map(|name| section(&good, name));
    check(
        "drops.usdc",
        &[
            (
                good[..50].to_vec(),
                0,
                "byte 0: 88 bytes expected here, file has 50 left: the file is cut short, perhaps still being written",
            ),
            (
                good[..3000].to_vec(),
                0,
                "byte 16: something is at byte 6274, the file has 3000: it is damaged or cut short",
            ),
            (
                good[..good.len() - 1].to_vec(),
                0,
                "byte 6466: 8 bytes expected here, file has 7 left: the file is cut short, perhaps still being written",
            ),
            (
                patched(&good, 9, &[3]),
                0,
                "version 0.3 of binary USD files, 0.4 to 0.13 are read; write the file anew: usdcat old.usd -o new.usda",
            ),
            (
                patched(&good, 8, &[1]),
                0,
                "version 1.8 of binary USD files, 0.4 to 0.13 are read; write the file anew: usdcat old.usd -o new.usda",
            ),
            (
                patched(&good, 16, &huge),
                0,
                "byte 16: something is at byte 18446744073709551615, the file has 6474: it is damaged or cut short",
            ),
            (
                patched(&good, table, &huge),
                0,
                "byte 6274: a table of 18446744073709551615 sections: the file is damaged",
            ),
            (patched(&good, tokens.1, b"TOKEN!"), 0, "byte 6274: the file has no section TOKENS"),
            (
                patched(&good, tokens.0, &huge),
                0,
                "byte 5490: more tokens than a file of 6474 bytes can have",
            ),
            (
                patched(&good, tokens.0 + 8, &huge),
                0,
                "byte 5498: 18446744073709551615 bytes of tokens: the file is damaged",
            ),
            (
                patched(&good, tokens.0, &many),
                0,
                "byte 5514: 33 tokens, the file promises 200000: it is damaged",
            ),
            (
                patched(&good, tokens.0 + 30, &[0xff; 20]),
                0,
                "byte 5514: 29 tokens, the file promises 33: it is damaged",
            ),
            (
                patched(&good, fields.0, &many),
                0,
                "byte 5824: the block here does not have 200000 integers: the file is damaged",
            ),
            (
                patched(&good, fields.0 + 8, &huge),
                0,
                "byte 5824: 18446744073709551615 bytes expected here, file has 650 left: the file is cut short, perhaps still being written",
            ),
            (
                patched(&good, sets.0 + 16, &[9]),
                0,
                "byte 6037: the compressed block here is damaged",
            ),
            (
                patched(&good, paths.0 + 8, &many),
                0,
                "byte 6108: 200000 paths, the file promises 14: it is damaged",
            ),
            (
                patched(&good, paths.0 + 8, &[1]),
                0,
                "byte 6124: the compressed block here is damaged",
            ),
            (
                patched(&good, specs.0, &huge),
                0,
                "byte 6195: more objects than a file of 6474 bytes can have",
            ),
            // The length of an array
            (
                patched(&good, array, &huge),
                2,
                "its numbers in memory are larger than 31 MiB; take care",
            ),
            (
                vec![0; 100],
                0,
                "byte 0: named like a usd file, but does not begin like one: bytes 00 00 00 00 00 00 00 00",
            ),
        ],
    );
}

#[test]
fn damaged_text_files() {
    let good = String::from_utf8(bytes_of("between.usda")).expect("text");
    let with = |old: &str, new: &str| {
        assert!(good.contains(old), "{old}");
        good.replacen(old, new, 1).into_bytes()
    };
    let cut = |len: usize| good.as_bytes()[..len].to_vec();
    check(
        "between.usda",
        &[
            (
                cut(7),
                0,
                "a USD file without Points and PointInstancer prims; export the particles as points",
            ),
            (
                cut(60),
                0,
                "byte 60: `)` expected: the file is cut short, perhaps still being written",
            ),
            (
                cut(1000),
                0,
                "byte 1000: the name of a property expected: the file is cut short, perhaps still being written",
            ),
            (
                cut(good.len() - 3),
                0,
                "byte 17669: `}` expected: the file is cut short, perhaps still being written",
            ),
            (
                with("#usda 1.0", "#usd 1.0"),
                0,
                "byte 0: named like a usd file, but does not begin like one: `#usd 1.0`",
            ),
            (
                with("def Points \"One\"", "def Points One"),
                0,
                "byte 93: a string expected, not \"One\"",
            ),
            (
                with("def Points \"One\"", "def Points \"One"),
                0,
                "byte 3161: `{` expected, not \"vertex\\\"\"",
            ),
            (
                with("point3f[] points.timeSamples = {", "point3f[] points.timeSamples = ["),
                0,
                "byte 1025: `{` expected, not \"[\"",
            ),
            (
                with(
                    "point3f[] points.timeSamples = {\n        0: [(",
                    "point3f[] points.timeSamples = {\n        0: [(x, ",
                ),
                3,
                "byte 1040: \"x\" is not a number of this type",
            ),
            (
                with(
                    "point3f[] points.timeSamples = {\n        0: [(",
                    "point3f[] points.timeSamples = {\n        0: [(1, ",
                ),
                3,
                "byte 1065: `)` expected, not \", -0.80487704), (-0.9127\"...",
            ),
            (with("1.5: [", "half: ["), 0, "byte 424: \"half\" is not a time"),
            (
                with("1.5: [", "1.5 ["),
                0,
                "byte 428: `:` expected, not \"[1099511627782, 10995116\"...",
            ),
            (
                with("point3f[] points", "int[] points"),
                0,
                "byte 1035: \"\" is not a number of this type",
            ),
            (with("upAxis = \"Z\"\n)", "upAxis = \"Z\"\n"), 0, "byte 98: `)` expected, not \"{\""),
            (
                with("def Points", "= Points"),
                0,
                "byte 82: a prim or a property expected, not \"= Points \\\"One\\\"\"",
            ),
            (
                with(
                    "int64[] ids.timeSamples = {\n        0: [",
                    "int64[] ids.timeSamples = {\n        0: [1.5, ",
                ),
                3,
                "byte 145: \"1.5\" is not a number of this type",
            ),
        ],
    );
}

#[test]
fn damaged_packages() {
    let good = bytes_of("drops.usdz");
    check(
        "drops.usdz",
        &[
            (
                good[..28].to_vec(),
                0,
                "byte 0: npz: invalid Zip archive: Could not find EOCD: the file is damaged or cut short, perhaps still being written",
            ),
            (
                good[..2000].to_vec(),
                0,
                "byte 2000: no USD file in the package: the file is cut short, perhaps still being written",
            ),
            (
                patched(&good, 8, &[8]),
                0,
                "a USD package whose first file is compressed, which the format does not allow; unpack it",
            ),
            (
                patched(&good, 6, &[1]),
                0,
                "a USD package whose first file is compressed, which the format does not allow; unpack it",
            ),
            (
                patched(&good, 18, &[0xff; 4]),
                0,
                "byte 6640: no USD file in the package: the file is cut short, perhaps still being written",
            ),
            (
                patched(&good, 64, b"ABCDEFGH"),
                0,
                "byte 64: not a USD file: it begins neither with PXR-USDC nor with #usda",
            ),
        ],
    );
}

/// Transforms of OpenUSD are in double precision, with other elementary functions than ours.
#[test]
fn transforms_are_those_of_the_reference() {
    let table = fs::read_to_string(data("moved.tsv")).expect("the table");
    for name in ["moved.usda", "moved.usdc"] {
        let file = FrameFile::open(&data(name)).expect("a good file");
        let steps: Vec<_> =
            (0..file.steps().len()).map(|step| file.read(step).expect("a good step")).collect();
        assert_eq!(steps.len(), 3);
        let lines = table.lines().filter_map(|line| line.strip_prefix(name)?.strip_prefix('\t'));
        let (mut positions, mut velocities) = ([0; 3], [0; 3]);
        for line in lines {
            let fields: Vec<&str> = line.split('\t').collect();
            let step: usize = fields[0].parse().expect("a step");
            let expected: Vec<f64> =
                fields[2..].iter().map(|f| f.parse().expect("a number")).collect();
            let (found, most) = match fields[1] {
                "positions" => {
                    positions[step] += 1;
                    (steps[step].positions.get(positions[step] - 1).to_array(), 1e-12)
                }
                _ => {
                    velocities[step] += 1;
                    let all = &steps[step].attributes;
                    let all = all.iter().find(|a| a.name == "velocities").expect("velocities");
                    let AttributeData::F32(v) = &all.data else { panic!("f32") };
                    let start = 3 * (velocities[step] - 1);
                    ([0, 1, 2].map(|axis| f64::from(v[start + axis])), 1e-6)
                }
            };
            for (found, expected) in found.iter().zip(&expected) {
                let distance = (found - expected).abs();
                assert!(distance <= most * 200.0, "{name} {line}: {found} instead of {expected}");
            }
        }
        assert_eq!([positions, velocities], [[7; 3]; 2], "{name}");
    }
}
