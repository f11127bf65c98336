//! Files of reference writers: every array of every step is, to the bit, what the reference reader gives.
//!
//! `make.py` in a directory of `tests/data` makes its files and `expected.tsv`; `tests/data/reference.py` describes
//! the lines.
#![expect(clippy::expect_used, reason = "a test says what it expects")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use flate2::Crc;
use spherule_formats::{AttributeData, Positions, RawParticles, Sequence, SequenceInput};

fn directory(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data").join(name)
}

/// One array of a step, as the reference reader has it.
struct ExpectedArray {
    name: String,
    scalar: String,
    components: usize,
    count: usize,
    /// Least and largest number of each component; none without particles.
    bounds: Option<[Vec<f64>; 2]>,
    crc: u32,
}

/// A step, as the reference reader has it.
#[derive(Default)]
struct ExpectedStep {
    number: Option<i64>,
    time: Option<f64>,
    arrays: Vec<ExpectedArray>,
}

/// The steps of each file of `directory`.
fn expected(directory: &Path) -> BTreeMap<String, Vec<ExpectedStep>> {
    let text = fs::read_to_string(directory.join("expected.tsv")).expect("the table");
    let mut files = BTreeMap::<String, Vec<ExpectedStep>>::new();
    for line in text.lines() {
        let fields: Vec<&str> = line.split('\t').collect();
        let [file, index, number, time, name, scalar, components, count, least, largest, crc] =
            fields[..]
        else {
            panic!("not 11 fields: {line}");
        };
        let steps = files.entry(file.to_owned()).or_default();
        let index: usize = index.parse().expect("an index");
        steps.resize_with(steps.len().max(index + 1), ExpectedStep::default);
        let numbers = |text: &str| -> Vec<f64> {
            let words = text.split(' ');
            words.map(|word| word.parse().expect("a number")).collect()
        };
        steps[index].number = number.parse().ok();
        steps[index].time = time.parse().ok();
        steps[index].arrays.push(ExpectedArray {
            name: name.to_owned(),
            scalar: scalar.to_owned(),
            components: components.parse().expect("a number"),
            count: count.parse().expect("a number"),
            bounds: (least != "-").then(|| [numbers(least), numbers(largest)]),
            crc: u32::from_str_radix(crc, 16).expect("a checksum"),
        });
    }
    files
}

/// The arrays of a step by name, positions among them.
fn arrays(particles: RawParticles) -> BTreeMap<String, (usize, AttributeData)> {
    let positions = match particles.positions {
        Positions::F32(v) => AttributeData::F32(v.iter().flat_map(|p| p.to_array()).collect()),
        Positions::F64(v) => AttributeData::F64(v.iter().flat_map(|p| p.to_array()).collect()),
    };
    let attributes = particles.attributes.into_iter();
    let mut all: BTreeMap<_, _> = attributes.map(|a| (a.name, (a.components, a.data))).collect();
    all.insert("positions".to_owned(), (3, positions));
    all
}

fn crc_of(data: &AttributeData) -> u32 {
    macro_rules! bytes {
        ($($variant:ident),*) => {
            match data {
                $(AttributeData::$variant(v) => v.iter().flat_map(|x| x.to_le_bytes()).collect(),)*
            }
        };
    }
    let bytes: Vec<u8> = bytes!(I8, U8, I16, U16, I32, U32, I64, U64, F32, F64);
    let mut crc = Crc::new();
    crc.update(&bytes);
    crc.sum()
}

/// Least and largest number of each component.
fn bounds_of(components: usize, data: &AttributeData) -> [Vec<f64>; 2] {
    let numbers: Vec<f64> = (0..data.len()).map(|i| data.get_f64(i)).collect();
    let of = |better: fn(f64, f64) -> f64, worst: f64| -> Vec<f64> {
        let component = |c| numbers.iter().skip(c).step_by(components).copied();
        (0..components).map(|c| component(c).fold(worst, better)).collect()
    };
    [of(f64::min, f64::INFINITY), of(f64::max, f64::NEG_INFINITY)]
}

#[track_caller]
fn compare_array(place: &str, expected: &ExpectedArray, components: usize, data: &AttributeData) {
    let place = format!("{place} {}", expected.name);
    assert_eq!(data.scalar_type().name(), expected.scalar, "{place}");
    assert_eq!(components, expected.components, "{place}");
    assert_eq!(data.len(), components * expected.count, "{place}");
    if let Some(bounds) = &expected.bounds {
        assert_eq!(bounds_of(components, data), *bounds, "{place}");
    }
    assert_eq!(crc_of(data), expected.crc, "{place}: other bits");
}

/// Compares all files of `tests/data/NAME` and returns the number of arrays.
#[track_caller]
fn compare(name: &str) -> usize {
    let directory = directory(name);
    let mut count = 0;
    for (file, steps) in expected(&directory) {
        let input = SequenceInput::from_path(directory.join(&file));
        let sequence = Sequence::open(&input).expect("a sequence");
        assert_eq!(sequence.frames().len(), steps.len(), "{file}");
        for (index, step) in steps.iter().enumerate() {
            let place = format!("{file}, step {index}:");
            let particles = sequence.load_raw(index).expect("a good step");
            assert_eq!(particles.time, step.time, "{place}");
            if let Some(number) = step.number {
                assert_eq!(sequence.frames()[index].number, number, "{place}");
            }
            let mut found = arrays(particles);
            for expected in &step.arrays {
                let array = found.remove(&expected.name);
                let (components, data) =
                    array.unwrap_or_else(|| panic!("{place} no array {}", expected.name));
                compare_array(&place, expected, components, &data);
                count += 1;
            }
            // What only some parts have is NaN in the others, and not in the lists of the references
            let is_whole =
                |data: &AttributeData| (0..data.len()).all(|i| !data.get_f64(i).is_nan());
            found.retain(|_, (_, data)| is_whole(data));
            let more: Vec<String> = found.into_keys().collect();
            assert!(more.is_empty(), "{place} also has {more:?}");
        }
    }
    count
}

#[test]
fn gsd_is_what_the_reference_reader_gives() {
    assert_eq!(compare("gsd"), 126);
}

#[test]
fn collections_are_what_the_reference_readers_give() {
    assert_eq!(compare("collections"), 54);
}

#[test]
#[cfg(feature = "hdf5")]
fn hdf5_is_what_the_reference_readers_give() {
    assert_eq!(compare("hdf5"), 115);
}

#[test]
#[cfg(feature = "hdf5")]
fn hdf5_in_several_files_is_what_the_reference_reader_gives() {
    assert_eq!(compare("hdf5_links"), 20);
}

#[test]
fn houdini_geometry_is_what_was_written() {
    assert_eq!(compare("houdini"), 39);
}

#[test]
fn dualsphysics_parts_are_what_was_written() {
    assert_eq!(compare("dualsphysics"), 22);
}

#[test]
fn molecules_are_what_the_reference_readers_give() {
    assert_eq!(compare("molecules"), 118);
}

#[test]
fn usd_is_what_the_reference_reader_gives() {
    assert_eq!(compare("usd"), 172);
}
