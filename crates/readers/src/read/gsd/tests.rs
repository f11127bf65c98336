//! Files made by hand for the GSD reader, and the damage it must survive.

use proptest::prelude::*;

use super::*;
use crate::read::damage::{TestedReader, attribute, coordinates, mutate, names, numbers, sample};
use crate::read::pieces;
use spherule_frame::Positions;

fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    pieces::steps(FORMAT, bytes)
}

fn read(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
    pieces::read(FORMAT, bytes, step)
}

const READER: TestedReader = TestedReader { steps, read };

/// Codes of types in the index.
const U32: u8 = 3;
const U64: u8 = 4;
const I32: u8 = 7;
const F32: u8 = 9;
const TEXT: u8 = 11;

/// A chunk: frame, name, type, rows and columns, numbers.
struct Chunk(u64, &'static str, u8, (u64, u32), Vec<u8>);

fn f32s(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
}

fn count(frame: u64, count: u32) -> Chunk {
    let bytes = count.to_le_bytes().to_vec();
    Chunk(frame, "particles/N", U32, (1, 1), bytes)
}

fn step(frame: u64, step: u64) -> Chunk {
    let bytes = step.to_le_bytes().to_vec();
    Chunk(frame, "configuration/step", U64, (1, 1), bytes)
}

/// Positions `(i, 0, 0)`.
fn positions(frame: u64, rows: u8) -> Chunk {
    let bytes: Vec<f32> = (0..rows).flat_map(|i| [f32::from(i), 0.0, 0.0]).collect();
    let shape = (rows.into(), 3);
    Chunk(frame, "particles/position", F32, shape, f32s(&bytes))
}

/// Byte of the index in [`file`]: behind the header.
const INDEX: usize = 256;

/// A file of version 2.1: header, index, names, numbers.
fn file(chunks: &[Chunk]) -> Vec<u8> {
    let mut known: Vec<&str> = Vec::new();
    for Chunk(_, name, ..) in chunks {
        if !known.contains(name) {
            known.push(name);
        }
    }
    let mut list = known.join("\0").into_bytes();
    list.resize((list.len() + 2).next_multiple_of(64), 0);
    // One entry more marks the end, some more allow for gaps between frames.
    let entry_count = chunks.len() + 9;
    let names_at = INDEX + 32 * entry_count;
    let header = [INDEX, entry_count, names_at, list.len() / 64].map(|n| n as u64);
    let mut bytes = MAGIC.to_vec();
    bytes.extend(header.into_iter().flat_map(u64::to_le_bytes));
    bytes.extend([(1 << 16) + 4, (2_u32 << 16) + 1].into_iter().flat_map(u32::to_le_bytes));
    for (text, end) in [("tests", 112), ("hoomd", INDEX)] {
        bytes.extend(text.bytes());
        bytes.resize(end, 0);
    }
    let mut location = names_at + list.len();
    for Chunk(frame, name, kind, (rows, columns), numbers) in chunks {
        let place = known.iter().position(|n| n == name).unwrap();
        let wide = [*frame, *rows, location as u64];
        bytes.extend(wide.into_iter().flat_map(u64::to_le_bytes));
        bytes.extend(columns.to_le_bytes());
        bytes.extend(u16::try_from(place).unwrap().to_le_bytes());
        bytes.extend([*kind, 0]);
        location += numbers.len();
    }
    bytes.resize(names_at, 0);
    bytes.extend(list);
    bytes.extend(chunks.iter().flat_map(|chunk| &chunk.4));
    bytes
}

fn two_frames() -> Vec<u8> {
    file(&[step(0, 5), count(0, 2), positions(0, 2), step(1, 9), positions(1, 2)])
}

#[track_caller]
fn fails(bytes: &[u8], words: &str) {
    let error = READER.error_inside(bytes).to_string();
    assert!(error.contains(words), "{error}");
}

#[test]
fn frames_are_steps() {
    let bytes = two_frames();
    let listed = steps(&bytes).unwrap();
    assert_eq!(listed.iter().map(|s| s.number).collect::<Vec<_>>(), [Some(5), Some(9)]);
    let all = READER.all(&bytes).unwrap();
    assert_eq!(coordinates(&all[1].positions), [[0.0; 3], [1.0, 0.0, 0.0]]);
    assert_eq!((all[1].step, all[1].time), (Some(9), None));
    assert_eq!(names(&all[0]), ["diameter"]);
    assert_eq!(numbers(&attribute(&all[0], "diameter").data), [1.0, 1.0]);
}

#[test]
fn missing_values_are_those_of_frame_0_or_of_the_schema() {
    let mass = |frame, values: &[f32]| {
        Chunk(frame, "particles/mass", F32, (values.len() as u64, 1), f32s(values))
    };
    let bytes = file(&[
        count(0, 2),
        positions(0, 2),
        mass(0, &[3.0, 4.0]),
        // Frame 1 has no chunk at all.
        count(2, 3),
        positions(2, 3),
        mass(4, &[5.0, 6.0]),
    ]);
    let all: Vec<RawParticles> =
        steps(&bytes).unwrap().iter().map(|step| read(&bytes, step).unwrap()).collect();
    let masses = |index: usize| numbers(&attribute(&all[index], "mass").data);
    assert_eq!(all.len(), 5);
    assert_eq!((masses(0), masses(1)), (vec![3.0, 4.0], vec![3.0, 4.0]));
    assert_eq!(masses(2), [1.0; 3]);
    assert_eq!(masses(4), [5.0, 6.0]);
    assert_eq!(all[4].positions, all[0].positions);
}

#[test]
fn steps_that_do_not_increase_do_not_number_frames() {
    let listed = steps(&file(&[step(0, 5), step(1, 5)])).unwrap();
    assert!(listed.iter().all(|step| step.number.is_none()));
    // A step of 0 is left out by writers.
    let listed = steps(&file(&[count(0, 0), step(1, 7)])).unwrap();
    assert_eq!(listed.iter().map(|s| s.number).collect::<Vec<_>>(), [Some(0), Some(7)]);
    let listed = steps(&file(&[step(0, u64::MAX)])).unwrap();
    assert_eq!(listed[0].number, Some(0));
    let none = steps(&file(&[count(0, 0)])).unwrap();
    assert_eq!(none[0].number, None);
    assert!(steps(&file(&[])).unwrap().is_empty());
}

#[test]
fn stored_particles_have_a_layout() {
    let diameter = || Chunk(0, "particles/diameter", F32, (2, 1), f32s(&[0.5, 2.0]));
    let bytes = file(&[step(0, 3), count(0, 2), positions(0, 2), diameter()]);
    let layout = Gsd.layout(&bytes).unwrap().expect("all values are stored");
    let particles = layout.particles(&bytes).unwrap();
    assert_eq!(particles, READER.one(&bytes));
    assert_eq!(particles.step, Some(3));
    assert_eq!(Gsd.layout(&file(&[count(0, 2), positions(0, 2)])), Ok(None));
    assert_eq!(Gsd.layout(&two_frames()), Ok(None));
}

#[test]
fn logged_values_of_particles_are_attributes() {
    let log = |name, shape, len| Chunk(0, name, F32, shape, f32s(&vec![2.5; len]));
    let bytes = file(&[
        count(0, 2),
        positions(0, 2),
        log("log/particles/force", (2, 3), 6),
        log("log/particles/global", (1, 1), 1),
        log("log/particles/wide", (2, 17), 34),
        Chunk(0, "log/particles/text", TEXT, (2, 1), b"ab".to_vec()),
        log("log/temperature", (2, 1), 2),
    ]);
    let particles = READER.one(&bytes);
    assert_eq!(names(&particles), ["force", "diameter"]);
    assert_eq!(attribute(&particles, "force").components, 3);
}

#[test]
fn a_particle_at_the_origin_and_none_need_no_positions() {
    let one = READER.one(&file(&[count(0, 1)]));
    assert_eq!(coordinates(&one.positions), [[0.0; 3]]);
    let none = READER.one(&file(&[count(0, 0), positions(0, 0)]));
    assert!(matches!(none.positions, Positions::F32(v) if v.is_empty()));
    fails(
        &file(&[count(0, u32::MAX)]),
        "frame 0 has 4294967295 particles and no particles/position",
    );
}

#[test]
fn chunks_must_fit_the_particles() {
    let with = |name, kind, shape: (u64, u32), len| {
        file(&[count(0, 2), positions(0, 2), Chunk(0, name, kind, shape, vec![0; len])])
    };
    fails(
        &with("particles/mass", F32, (3, 1), 12),
        "frame 0: particles/mass has 3 rows for 2 particles",
    );
    fails(&with("particles/velocity", F32, (2, 2), 16), "has 2 columns, not 3");
    fails(&with("particles/mass", I32, (2, 1), 8), "has numbers of type i32");
    fails(&with("particles/typeid", F32, (2, 1), 8), "has numbers of type f32");
    fails(&with("particles/body", TEXT, (2, 1), 2), "is text");
    let integers = Chunk(0, "particles/position", I32, (1, 3), vec![0; 12]);
    fails(&file(&[count(0, 1), integers]), "particles/position has numbers of type i32");
    let signed = Chunk(0, "particles/N", I32, (1, 1), vec![2, 0, 0, 0]);
    fails(&file(&[signed]), "particles/N is not one unsigned integer");
    let two = Chunk(0, "particles/N", U32, (2, 1), vec![0; 8]);
    fails(&file(&[two]), "particles/N is not one unsigned integer");
}

/// [`two_frames`] with other bytes from `at` on.
fn patched(at: usize, bytes: &[u8]) -> Vec<u8> {
    let mut file = two_frames();
    file[at..at + bytes.len()].copy_from_slice(bytes);
    file
}

#[test]
fn the_index_must_be_sound() {
    let entry = |index: usize| INDEX + 32 * index;
    let error = |bytes: Vec<u8>| steps(&bytes).expect_err("damaged").to_string();
    assert!(error(patched(entry(1) + 30, &[12])).contains("unknown type 12"));
    assert!(error(patched(entry(1) + 31, &[1])).contains("unknown flags 0x1"));
    assert!(error(patched(entry(1) + 28, &[3])).contains("name 3, the file has 3 names"));
    assert!(error(patched(entry(4), &[14])).contains("frame 14, the index has 14 entries"));
    assert!(error(patched(entry(1), &[2])).contains("frame 0 follows those of frame 2"));
    let again = file(&[count(0, 1), step(0, 1), count(0, 1), step(0, 1)]);
    assert!(error(again).contains("frame 0 has a chunk twice"));
    // Only the frame is lost whose numbers are missing.
    let far = patched(entry(4) + 16, &[0xff; 4]);
    assert_eq!(steps(&far).unwrap().len(), 2);
    let listed = steps(&far).unwrap();
    assert!(read(&far, &listed[0]).is_ok());
    let error = read(&far, &listed[1]).expect_err("far off").to_string();
    assert!(
        error.contains("particles/position has 2 rows of 3 from byte 4294967295 on"),
        "{error}"
    );
    fails(&patched(entry(2) + 8, &[0xff; 8]), "rows for 2 particles");
}

#[test]
fn the_header_must_be_sound() {
    let error = |at, bytes: &[u8]| steps(&patched(at, bytes)).expect_err("damaged").to_string();
    assert!(error(0, b"x").contains("not a GSD file"));
    assert!(error(46, &[3]).contains("GSD version 3.1, versions 1 and 2 are read"));
    assert!(error(42, &[3]).contains("version 3.4 of the GSD schema hoomd"));
    assert!(error(112, b"other").contains("the schema `other`"));
    assert!(error(16, &[0xff; 8]).contains("the index has 18446744073709551615 times 32 bytes"));
    assert!(error(24, &[0xff; 8]).contains("the list of names has"));
    let short = steps(&two_frames()[..200]).expect_err("cut").to_string();
    assert!(short.contains("byte 200: file ends within the GSD header"), "{short}");
    // The last draft has the layout of version 1.
    let version_1 = sample("gsd/polymer-version-1.gsd");
    let mut draft = version_1.clone();
    draft[44..48].copy_from_slice(&[3, 0, 0, 0]);
    assert_eq!(steps(&draft), steps(&version_1));
}

/// Many names for the same bytes: a small file must not become large.
#[test]
fn chunks_must_not_overlap() {
    let names: Vec<&'static str> =
        (0..40).map(|i| &*Box::leak(format!("log/particles/{i}").into_boxed_str())).collect();
    let mut chunks = vec![count(0, 200), positions(0, 200)];
    chunks.extend(names.into_iter().map(|name| Chunk(0, name, F32, (200, 3), Vec::new())));
    let mut bytes = file(&chunks);
    // All of them begin where the positions do.
    let start = bytes[INDEX + 32 + 16..][..8].to_vec();
    for entry in 2..chunks.len() {
        bytes[INDEX + 32 * entry + 16..][..8].copy_from_slice(&start);
    }
    fails(&bytes, "its chunks have 98400 bytes together");
}

#[test]
fn the_cell_is_around_the_origin() {
    let bytes = sample("gsd/polymer.gsd");
    let steps = steps(&bytes).unwrap();
    // 12 x 10 x 8, tilted by 0.25, 0 and -0.5
    let cell = read(&bytes, &steps[0]).unwrap().cell.expect("a cell");
    let vectors = [[12.0, 0.0, 0.0], [2.5, 10.0, 0.0], [0.0, -4.0, 8.0]];
    assert_eq!(cell.vectors.map(|v| v.to_array()), vectors);
    assert_eq!(cell.origin.to_array(), [-7.25, -3.0, -4.0]);
    assert_eq!(cell.periodic, [true; 3]);
}

#[test]
fn bonds_are_those_of_frame_0_unless_a_frame_has_its_own() {
    let bytes = sample("gsd/polymer.gsd");
    let chain: Vec<[u32; 2]> = (0..39).map(|i| [i, i + 1]).collect();
    for step in steps(&bytes).unwrap() {
        assert_eq!(read(&bytes, &step).unwrap().bonds, chain);
    }
    let bonds = |kind, shape, of: &[u32]| {
        let bytes = of.iter().flat_map(|n| n.to_le_bytes()).collect();
        let bonds = Chunk(0, "bonds/group", kind, shape, bytes);
        file(&[count(0, 2), positions(0, 2), bonds])
    };
    assert_eq!(READER.one(&bonds(U32, (1, 2), &[1, 0])).bonds, [[1, 0]]);
    fails(
        &bonds(U32, (1, 2), &[0, 2]),
        "frame 0: bonds/group has a bond of particle 2, but there are 2 particles",
    );
    fails(&bonds(I32, (1, 2), &[0, u32::MAX]), "particle 4294967295");
    for bytes in [bonds(F32, (1, 2), &[0, 1]), bonds(U32, (2, 1), &[0, 1])] {
        fails(&bytes, "bonds/group has no pairs of unsigned integers");
    }
}

/// Two frames of two particles with these shapes, in rows of 64 characters.
fn with_shapes(kind: u8, shapes: &[&str]) -> Vec<u8> {
    let text = shapes.iter().flat_map(|shape| {
        let mut row = shape.as_bytes().to_vec();
        row.resize(64, 0);
        row
    });
    let rows = shapes.len() as u64;
    let shapes = Chunk(0, "particles/type_shapes", kind, (rows, 64), text.collect());
    file(&[
        step(0, 1),
        count(0, 2),
        positions(0, 2),
        shapes,
        step(1, 2),
        count(1, 3),
        positions(1, 3),
    ])
}

#[test]
fn types_have_shapes() {
    let shapes = [r#"{"type": "Ellipsoid", "a": 1, "b": 2, "c": 3}"#, "{}", "{"];
    for particles in READER.all(&with_shapes(TEXT, &shapes)).unwrap() {
        // Frame 1 has those of frame 0, although it has another number of particles
        let types = particles.shapes.expect("shapes");
        assert_eq!((&*types.attribute, types.shapes.len()), ("typeid", 3));
        let ellipsoid = spherule_frame::TypeShape::Ellipsoid(glam::Vec3::new(1.0, 2.0, 3.0));
        assert_eq!(types.shapes[0], ellipsoid);
        assert_eq!(types.shapes[1], spherule_frame::TypeShape::Unspecified);
    }
    let notes = Gsd.notes(&with_shapes(TEXT, &shapes));
    assert!(!notes.iter().any(|note| note.contains("type_shapes")), "{notes:?}");
    assert_eq!(READER.all(&two_frames()).unwrap()[0].shapes, None);
    fails(&with_shapes(I32, &["1"; 4])[..], "type_shapes");
}

#[test]
fn orientations_are_upright_by_default() {
    let turned = Chunk(1, "particles/orientation", F32, (2, 4), f32s(&[0.5; 8]));
    let bytes =
        file(&[step(0, 1), count(0, 2), positions(0, 2), step(1, 2), turned, positions(1, 2)]);
    let all = READER.all(&bytes).unwrap();
    let first = numbers(&attribute(&all[0], "orientation").data);
    assert_eq!(first, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    assert_eq!(numbers(&attribute(&all[1], "orientation").data), [0.5; 8]);
}

#[test]
fn notes_report_what_is_not_in_the_particles() {
    let notes = Gsd.notes(&sample("gsd/polymer.gsd"));
    assert_eq!(
        notes,
        [
            "GSD 2.1, schema hoomd 2.0, written by \"gsd.hoomd 5.0.1\"",
            "attribute `typeid` has numbers for types: 0 = \"A\", 1 = \"solvent\"",
            "the cell of the first frame is 12 x 10 x 8, its tilt factors are 0.25, 0, -0.5",
            "the file has a simulation cell",
            "not used: \"log\"",
        ]
    );
    let flat = Gsd.notes(&sample("gsd/varying.gsd"));
    assert!(flat.contains(&"the simulation has two dimensions".to_owned()), "{flat:?}");
    assert!(flat.iter().any(|r| r.contains("no diameters")), "{flat:?}");
    // The beginning of a file, as it is known of a compressed one.
    assert_eq!(Gsd.notes(&sample("gsd/polymer.gsd")[..256]).len(), 1);
    assert!(Gsd.notes(b"").is_empty());
}

#[test]
fn truncation_is_noticed() {
    let bytes = two_frames();
    READER.survives_truncation(&bytes, &[0, 8, 255, 256, 700], bytes.len());
    let sample = sample("gsd/polymer.gsd");
    READER.survives_truncation(&sample, &[256], 0);
}

#[test]
fn default_values_count_against_the_budget() {
    let bytes = file(&[count(0, 2), positions(0, 2)]);
    let listed = steps(&bytes).unwrap();
    let read = |bytes_allowed| {
        let mut source = ByteSource::whole(&bytes);
        source.limit(MemoryBudget::new(bytes_allowed, "get more"));
        Gsd.read(&mut source, &listed[0])
    };
    assert!(read(32).is_ok());
    assert!(matches!(read(31), Err(ParseError::TooLarge { .. })));
    let mut source = ByteSource::whole(&bytes);
    source.limit(MemoryBudget::new(8, "get more"));
    assert!(Gsd.steps(&mut source).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    #[cfg_attr(miri, ignore = "too slow")]
    fn mutations_never_panic(
        changes in proptest::collection::vec((any::<proptest::sample::Index>(), any::<u8>()), 1..6),
        is_made in any::<bool>(),
    ) {
        let base = if is_made { two_frames() } else { sample("gsd/varying.gsd") };
        let bytes = mutate(&base, &changes);
        let _ = READER.all(&bytes);
        let _ = Gsd.layout(&bytes);
        let _ = Gsd.notes(&bytes);
    }

    #[test]
    #[cfg_attr(miri, ignore = "too slow")]
    fn mutated_headers_never_panic(
        changes in proptest::collection::vec((8_usize..400, any::<u8>()), 1..4),
    ) {
        let mut bytes = two_frames();
        for (at, byte) in changes {
            bytes[at] = byte;
        }
        let _ = READER.all(&bytes);
    }
}

#[test]
fn files_of_big_endian_machines_are_refused() {
    let swapped: Vec<u8> = MAGIC.iter().rev().copied().collect();
    let error = Gsd.sniff(&swapped).expect_err("not read").to_string();
    assert!(error.contains("big-endian"), "{error}");
    assert_eq!(Gsd.sniff(&two_frames()), Ok(Confidence::Signature));
    assert_eq!(Gsd.sniff(&MAGIC[..7]), Ok(Confidence::No));
}
