//! HDF5 files: damage, limits of memory, and ranges for conversion. `reference.rs` compares good files with their
//! reference readers.
#![cfg(feature = "hdf5")]
#![expect(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use spherule_formats::convert::open_source;
use spherule_formats::sequence::{Sequence, SequenceInput, stands_for_others};
use spherule_formats::{
    Attribute, AttributeData, FrameError, FrameFile, MemoryBudget, RawParticles,
};

fn data(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    root.join("../tests/data/hdf5").join(name)
}

fn damaged(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    root.join("../tests/damaged_hdf5").join(name)
}

/// All steps, or the first error.
fn read(file: Result<FrameFile, FrameError>) -> Result<Vec<RawParticles>, FrameError> {
    let file = file?;
    (0..file.steps().len()).map(|step| file.read(step)).collect()
}

#[test]
fn damaged_files_give_their_errors() {
    give_their_errors(&damaged(""));
}

#[test]
fn damaged_references_give_their_errors() {
    give_their_errors(&damaged("../damaged_hdf5_links"));
}

/// Each file of `directory` gives the error in its table.
fn give_their_errors(directory: &Path) {
    let table = fs::read_to_string(directory.join("table.tsv")).expect("the table");
    let mut count = 0;
    for line in table.lines() {
        let (name, words) = line.split_once('\t').expect("two fields");
        let path = directory.join(name);
        let error = read(FrameFile::open(&path)).expect_err(name).to_string();
        assert!(error.contains(words), "{name}: {error}");
        assert!(error.contains(name) && !error.contains(char::is_control), "{error}");
        // Conversion finds the same fault, when it opens the file or when it reads. It reads only files of one step.
        if !name.ends_with("vtkhdf") && !name.ends_with("h5md") {
            let read = open_source(&path).and_then(|source| {
                let source = source.expect("one step");
                let count = usize::try_from(source.count()).expect("few");
                source.read_positions(0, &mut vec![DVec3::ZERO; count])
            });
            let error = read.expect_err(name).to_string();
            assert!(error.contains(words), "{name}: {error}");
        }
        count += 1;
    }
    // Also the table, its script, and one good file.
    let files = fs::read_dir(directory).expect("files").count();
    assert_eq!(count + 3, files);
}

#[test]
fn bombs_are_refused_within_the_budget() {
    let budget = |mebibytes: u64| MemoryBudget::new(mebibytes << 20, "take care");
    let path = damaged("bomb.h5");
    assert!(fs::metadata(&path).expect("a file").len() < 100_000);
    for small in [1, 16, 40] {
        let error = read(FrameFile::open_within(&path, budget(small))).expect_err("a bomb");
        assert!(matches!(error, FrameError::TooLarge { .. }), "{error}");
        assert!(error.to_string().ends_with("take care"), "{error}");
    }
    let steps = read(FrameFile::open_within(&path, budget(200))).expect("enough memory");
    assert_eq!(steps[0].positions.len(), 2_000_000);
}

/// The values of `attribute`, little-endian.
fn bytes_of(attribute: &Attribute) -> Vec<u8> {
    macro_rules! bytes {
        ($($variant:ident),*) => {
            match &attribute.data {
                $(AttributeData::$variant(v) => v.iter().flat_map(|x| x.to_le_bytes()).collect(),)*
            }
        };
    }
    bytes!(I8, U8, I16, U16, I32, U32, I64, U64, F32, F64)
}

#[test]
fn ranges_are_parts_of_the_whole() {
    for name in [
        "axes.h5",
        "plain.h5",
        "table.h5",
        "gadget.hdf5",
        "swift.hdf5",
        "pysph_250.hdf5",
        "points.vtkhdf",
        "blocks.vtkhdf",
        "multi.vtkhdf",
        "../hdf5_links/joined.h5",
        "../hdf5_links/selected.h5",
        "../hdf5_links/table.h5",
        "../hdf5_links/linked.hdf5",
        "../hdf5_links/many.h5",
    ] {
        let path = data(name);
        let whole = &read(FrameFile::open(&path)).expect("a good file")[0];
        let source = open_source(&path).expect("a good file").expect("one step");
        let count = whole.positions.len();
        assert_eq!(source.count(), count as u64, "{name}");
        assert_eq!(source.time(), whole.time, "{name}");
        assert_eq!(source.attributes().len(), whole.attributes.len(), "{name}");
        for len in [1, 7, count] {
            for first in (0..count).step_by(len) {
                let len = len.min(count - first);
                let mut places = vec![DVec3::ZERO; len];
                source.read_positions(first as u64, &mut places).expect("there");
                let expected = (first..first + len).map(|i| whole.positions.get(i));
                assert!(places.into_iter().eq(expected), "{name} {first}");
                for (index, attribute) in source.attributes().iter().enumerate() {
                    let all = bytes_of(&whole.attributes[index]);
                    let width = attribute.width();
                    let mut own = vec![0; len * width];
                    source.read_values(index, first as u64, &mut own).expect("there");
                    let expected = &all[first * width..(first + len) * width];
                    assert_eq!(own, expected, "{name} {} {first}", attribute.name);
                }
            }
        }
        assert!(source.read_positions(count as u64, &mut [DVec3::ZERO]).is_err());
    }
}

#[test]
fn truncations_and_wrong_bytes_are_survived() {
    for name in ["axes.h5", "plain.h5", "table.h5", "temporal.vtkhdf", "beam.h5part"] {
        let path = data(name);
        let budget = MemoryBudget::new(64 << 20, "take care");
        let open = |bytes| FrameFile::from_bytes_within(&path, bytes, budget);
        survives(name, &fs::read(&path).expect("readable"), 80, open);
    }
}

/// Opens cut and changed versions of `whole`, which must be errors or whole particles.
fn survives(
    name: &str,
    whole: &[u8],
    changes: usize,
    open: impl Fn(Vec<u8>) -> Result<FrameFile, FrameError>,
) {
    for cut in (0..whole.len()).step_by(whole.len() / 30) {
        assert!(read(open(whole[..cut].to_vec())).is_err(), "{name} cut at {cut}");
    }
    // Multiplicative steps reach all parts of the file
    let mut seed = 12_345_usize;
    for _ in 0..changes {
        let mut bytes = whole.to_owned();
        for _ in 0..3 {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let at = (seed >> 20) % bytes.len();
            bytes[at] = seed.to_le_bytes()[7];
        }
        if let Ok(steps) = read(open(bytes)) {
            for step in steps {
                let count = step.positions.len();
                let is_whole = |a: &Attribute| a.data.len() == a.components * count;
                assert!(step.attributes.iter().all(is_whole), "{name}");
            }
        }
    }
}

#[test]
fn wrong_bytes_in_references_are_survived() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    fs::create_dir(dir.path().join("parts")).expect("writable");
    for part in ["first.h5", "second.h5", "type.h5"] {
        let part = Path::new("parts").join(part);
        let from = data("../hdf5_links").join(&part);
        fs::copy(from, dir.path().join(part)).expect("readable");
    }
    for name in ["joined.h5", "joined-latest.h5", "table.h5", "frames.h5", "linked.hdf5", "many.h5"]
    {
        let whole = fs::read(data("../hdf5_links").join(name)).expect("readable");
        let path = dir.path().join(name);
        survives(name, &whole, 100, |bytes| {
            fs::write(&path, bytes).expect("writable");
            FrameFile::open_within(&path, MemoryBudget::new(64 << 20, "take care"))
        });
    }
}

#[test]
fn files_that_are_referred_to_are_among_those_of_a_sequence() {
    let references = |name: &str| {
        let path = data("../hdf5_links").join(name);
        let sequence = Sequence::open(&SequenceInput::Files(vec![path])).expect("a sequence");
        let found = sequence.references().into_values().flatten();
        let name = |path: PathBuf| path.file_name().map(|name| name.to_owned());
        Vec::from_iter(found.filter_map(name))
    };
    assert_eq!(references("joined.h5"), ["first.h5", "second.h5"]);
    assert_eq!(references("frames.h5"), ["first.h5", "second.h5"]);
    let all = ["first.h5", "second.h5", "type.h5"];
    assert_eq!(references("linked.hdf5"), all);
    assert!(references("../hdf5/plain.h5").is_empty());
}

#[test]
fn bytes_in_memory_refer_to_no_files() {
    let path = data("../hdf5_links/joined.h5");
    let bytes = fs::read(&path).expect("readable");
    let error = read(FrameFile::from_bytes(&path, bytes)).expect_err("no directory");
    assert!(error.to_string().contains("in memory"), "{error}");
}

/// Copies the files `names` of the data to an empty directory.
fn directory_of(names: &[&str]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("a temporary directory");
    for name in names {
        fs::copy(data(name), dir.path().join(name)).expect("readable");
    }
    dir
}

/// The ids of each frame of `input`, and the notes.
fn ids_of(input: SequenceInput) -> (Vec<Vec<f64>>, String) {
    let sequence = Sequence::open(&input).expect("a sequence");
    let ids = |index| {
        let frame = sequence.load_raw(index).expect("readable");
        let ids = frame.attributes.iter().find(|a| a.name == "ParticleIDs");
        let ids = ids.expect("ids");
        (0..ids.data.len()).map(|i| ids.data.get_f64(i)).collect()
    };
    let frames = (0..sequence.frames().len()).map(ids).collect();
    (frames, sequence.notes().join("; "))
}

#[test]
fn virtual_data_sets_of_a_snapshot_give_the_files_with_the_values() {
    const ALL: [&str; 6] = [
        "snap_003.hdf5",
        "snap_003.0.hdf5",
        "snap_003.1.hdf5",
        "snap_004.hdf5",
        "snap_004.0.hdf5",
        "snap_004.1.hdf5",
    ];
    let pattern = |dir: &Path, name: &str| SequenceInput::Pattern(dir.join(name));
    let dir = directory_of(&ALL);
    let (expected, notes) = ids_of(pattern(dir.path(), "snap_#.*.hdf5"));
    assert_eq!(expected.iter().map(Vec::len).collect::<Vec<_>>(), [52, 54]);
    assert!(!notes.contains("virtual"), "{notes}");
    // The directory, the virtual files, and one of them
    let virtual_files = pattern(dir.path(), "snap_#.hdf5");
    for input in [SequenceInput::Directory(dir.path().into()), virtual_files] {
        let (found, notes) = ids_of(input);
        assert_eq!(found, expected);
        assert!(notes.contains("and 1 more have virtual data sets"), "{notes}");
    }
    assert!(stands_for_others(&dir.path().join(ALL[3])) && !stands_for_others(&data(ALL[4])));
    let one = SequenceInput::Files(vec![dir.path().join(ALL[3])]);
    assert_eq!(ids_of(one).0, expected[1..]);
    // A file with the values is missing
    let dir = directory_of(&ALL[..2]);
    let sequence = Sequence::open(&SequenceInput::Directory(dir.path().into()));
    let error = sequence.expect("one frame").load_raw(0).expect_err("half of it").to_string();
    assert!(error.contains("snap_003.1.hdf5: does not exist; "), "{error}");
    assert!(error.contains("has 2 files, of which there are 1: copy the others there"), "{error}");
    // One is read alone by its name
    let (found, notes) = ids_of(SequenceInput::Files(vec![dir.path().join(ALL[1])]));
    assert_eq!(found[0].len(), 23);
    assert!(notes.contains("of 2 files, but only 1 of them is used"), "{notes}");
    // All are
    let dir = directory_of(&ALL[..1]);
    let sequence = Sequence::open(&SequenceInput::Directory(dir.path().into()));
    let error = sequence.expect("one frame").load_raw(0).expect_err("no values").to_string();
    assert!(error.contains("refers to the file `snap_003.0.hdf5`"), "{error}");
}

/// Blocks of VTKHDF are parts with the names of the assembly; an image among them is left out.
#[test]
fn blocks_of_vtkhdf_are_parts() {
    for name in ["blocks.vtkhdf", "multi.vtkhdf"] {
        let path = data(name);
        let particles = read(FrameFile::open(&path)).expect("a good file").remove(0);
        let labels: Vec<(i64, &str)> =
            particles.labels["part"].iter().map(|(part, name)| (*part, name.as_str())).collect();
        assert_eq!(labels, [(0, "fluid"), (1, "wall")], "{name}");
        assert!(particles.notes.iter().any(|note| note.contains("`density`")), "{name}");
        let notes = spherule_formats::open::notes(&path).join("; ");
        assert!(notes.contains("0 = fluid, 1 = wall"), "{notes}");
        assert!(notes.contains("left out: grid (ImageData)"), "{notes}");
    }
}

/// The only step of a file with unusual names.
fn named(name: &str) -> RawParticles {
    let path = data("../hdf5_names").join(name);
    let mut steps = read(FrameFile::open(&path)).expect("a good file");
    assert_eq!(steps.len(), 1, "{name}");
    steps.remove(0)
}

/// Links and attributes of more than 512 KiB are in indirect blocks of indirect blocks.
#[test]
fn heaps_with_several_levels_are_read() {
    let particles = named("deep_heaps.h5.xz");
    assert_eq!(particles.positions.len(), 10);
    assert_eq!(particles.time, Some(2.5));
    let density = particles.attributes.iter().find(|a| a.name == "density");
    let density = &density.expect("the attribute").data;
    let expected: Vec<f32> = (0..10_u8).map(f32::from).collect();
    assert_eq!(*density, AttributeData::F32(expected));
}

/// Blocks that are missing, or there twice, are found in every indirect block.
#[test]
fn damaged_heaps_with_several_levels_are_refused() {
    // Signature, version, address of the heap, and offset of the block are before the addresses of blocks
    const FIRST: usize = 17;
    let path = data("../hdf5_names").join("deep_heaps.h5.xz");
    let file = FrameFile::open(&path).expect("a good file");
    let good = file.bytes();
    let blocks: Vec<usize> = good
        .windows(4)
        .enumerate()
        .filter(|(_, bytes)| bytes == b"FHIB")
        .map(|(at, _)| at + FIRST)
        .collect();
    assert!(blocks.len() >= 4, "two heaps with two levels");
    let mut is_attribute = Vec::new();
    for at in blocks {
        let second = &good[at + 8..at + 16];
        for wrong in [&[0xee; 8], second] {
            let mut bytes = good.to_vec();
            bytes[at..at + 8].copy_from_slice(wrong);
            let name = Path::new("deep_heaps.h5");
            let error =
                read(FrameFile::from_bytes(name, bytes)).expect_err("a damaged heap").to_string();
            assert!(error.contains("deep_heaps.h5: byte"), "{error}");
            assert!(error.contains("/run"), "{error}");
            is_attribute.push(error.contains("attributes of /run: damaged HDF5"));
        }
    }
    assert!(is_attribute.contains(&true) && is_attribute.contains(&false));
}

#[test]
fn objects_with_several_names_count_once() {
    for name in ["alias_links.h5", "alias_pysph.h5"] {
        let particles = named(name);
        assert_eq!(particles.positions.len(), 4, "{name}");
        let has_parts = particles.attributes.iter().any(|a| a.name == "part");
        assert!(!has_parts || name == "alias_pysph.h5", "{name}");
    }
}

#[test]
fn openpmd_in_json_is_that_in_hdf5() {
    let open = |name: &str| {
        let path = format!("{}/../tests/data/openpmd/{name}", env!("CARGO_MANIFEST_DIR"));
        FrameFile::open(path.as_ref()).expect("a sample")
    };
    let (json, hdf5) = (open("species.json"), open("species.h5.gz"));
    assert_eq!((json.format().name(), json.steps().len()), ("openpmd-json", 2));
    for index in 0..2 {
        let [mut one, mut other] = [&json, &hdf5].map(|file| file.read(index).expect("particles"));
        for particles in [&mut one, &mut other] {
            particles.attributes.sort_by(|a, b| a.name.cmp(&b.name));
        }
        // Numbers that are missing are NaN
        assert_eq!(format!("{one:?}"), format!("{other:?}"));
        assert_eq!(one.positions.len(), 8);
    }
    assert_eq!(json.steps()[1].number, Some(100));
}
