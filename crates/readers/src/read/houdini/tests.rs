//! Geometry made by hand, and what damage does to files. `formats/tests/reference.rs` reads whole files.

use proptest::prelude::*;

use super::cursor::JsonCursor;
use super::numbers::Numbers;
use super::tokens::{ElementType, Value};
use super::*;
use crate::read::damage::{TestedReader, attribute, coordinates, mutate, names, numbers, sample};
use spherule_frame::ScalarType;

const READER: TestedReader = TestedReader {
    steps: |bytes| FORMAT.steps(bytes),
    read: |bytes, step| FORMAT.read(bytes, step),
};

fn text(text: &str) -> Vec<u8> {
    let len = u8::try_from(text.len()).unwrap();
    [&[0x27, len], text.as_bytes()].concat()
}

fn list(items: &[Vec<u8>]) -> Vec<u8> {
    [b"[", items.concat().as_slice(), b"]"].concat()
}

fn int(number: i32) -> Vec<u8> {
    [&[0x13], number.to_le_bytes().as_slice()].concat()
}

fn ints(numbers: &[i32]) -> Vec<u8> {
    let head = [0x40, 0x13, u8::try_from(numbers.len()).unwrap()];
    let numbers = numbers.iter().flat_map(|n| n.to_le_bytes());
    head.into_iter().chain(numbers).collect()
}

fn floats(numbers: &[f32]) -> Vec<u8> {
    let head = [0x40, 0x19, u8::try_from(numbers.len()).unwrap()];
    let numbers = numbers.iter().flat_map(|n| n.to_le_bytes());
    head.into_iter().chain(numbers).collect()
}

fn flags(flags: &[bool]) -> Vec<u8> {
    let list: Vec<Vec<u8>> = flags.iter().map(|f| vec![0x30 + u8::from(*f)]).collect();
    self::list(&list)
}

/// An attribute with `values` after its size and storage.
fn numeric(name: &str, size: i32, storage: &str, values: &[Vec<u8>]) -> Vec<u8> {
    let definition = list(&[text("type"), text("numeric"), text("name"), text(name)]);
    let head = [text("size"), int(size), text("storage"), text(storage)];
    let values = list(&[head.as_slice(), values].concat());
    list(&[definition, list(&[text("values"), values])])
}

/// A file of `count` points with these attributes, and with `more` after them.
fn file(count: i32, attributes: &[Vec<u8>], more: &[Vec<u8>]) -> Vec<u8> {
    let attributes = list(&[text("pointattributes"), list(attributes)]);
    let head = [text("pointcount"), int(count), text("attributes"), attributes];
    [b"\x7fNSJb".as_slice(), &list(&[head.as_slice(), more].concat())].concat()
}

/// Positions of `count` points at 0.
fn origin(count: usize) -> Vec<u8> {
    let zeros = floats(&vec![0.0; 3 * count]);
    numeric("P", 3, "fpreal32", &[text("pagesize"), int(1024), text("rawpagedata"), zeros])
}

#[test]
fn pages_hold_one_packed_vector_after_the_other() {
    let values = [
        text("pagesize"),
        int(2),
        text("packing"),
        ints(&[1, 2]),
        text("constantpageflags"),
        list(&[flags(&[true, false, true]), flags(&[false, true, false])]),
        text("rawpagedata"),
        ints(&[10, 20, 30, 21, 31, 12, 13, 22, 32, 14, 24, 34]),
    ];
    let bytes = file(5, &[origin(5), numeric("a", 3, "int32", &values)], &[]);
    let particles = READER.one(&bytes);
    let expected = [10, 20, 30, 10, 21, 31, 12, 22, 32, 13, 22, 32, 14, 24, 34];
    let found = attribute(&particles, "a");
    assert_eq!(found.components, 3);
    assert_eq!(found.data, AttributeData::I32(expected.to_vec()));
}

#[test]
fn numbers_take_the_stated_type_if_they_fit() {
    let read = |storage: &str, numbers: Vec<u8>| {
        let values = [text("arrays"), list(&[numbers])];
        let bytes = file(2, &[origin(2), numeric("a", 1, storage, &values)], &[]);
        READER.all(&bytes).map(|mut all| all.remove(0))
    };
    let data =
        |storage: &str, numbers| attribute(&read(storage, numbers).unwrap(), "a").data.clone();
    assert_eq!(data("int64", ints(&[-1, 7])), AttributeData::I64(vec![-1, 7]));
    assert_eq!(data("uint8", ints(&[255, 0])), AttributeData::U8(vec![255, 0]));
    assert_eq!(data("fpreal64", floats(&[0.5, 2.0])), AttributeData::F64(vec![0.5, 2.0]));
    assert_eq!(data("fpreal16", floats(&[0.5, 2.0])), AttributeData::F32(vec![0.5, 2.0]));
    for (storage, numbers) in [("uint8", ints(&[256, 0])), ("int32", floats(&[1.0, 2.0]))] {
        let error = read(storage, numbers).expect_err("they do not fit").to_string();
        assert!(error.contains("do not fit into the stated type"), "{error}");
    }
}

#[test]
fn names_are_defined_anywhere_and_may_change() {
    let bytes = [
        b"\x7fNSJb[".as_slice(),
        b"+\x05\x0apointcount&\x05\x11\x01",
        b"+\x05\x0aattributes&\x05[\x27\x0fpointattributes+\x05\x01P[",
        &list(&[
            list(&[text("type"), text("numeric"), text("name"), b"&\x05".to_vec()]),
            list(&[
                text("values"),
                list(&[text("size"), int(3), text("tuples"), list(&[floats(&[1.0, 2.0, 3.0])])]),
            ]),
        ]),
        b"]]-\x05]",
    ]
    .concat();
    assert_eq!(coordinates(&READER.one(&bytes).positions), [[1.0, 2.0, 3.0]]);
}

#[test]
fn w_divides_unless_it_is_zero_or_one() {
    let numbers = floats(&[2.0, 4.0, 6.0, 2.0, 2.0, 4.0, 6.0, 0.0, 2.0, 4.0, 6.0, 1.0]);
    let values = [text("pagesize"), int(1024), text("rawpagedata"), numbers];
    let particles = READER.one(&file(3, &[numeric("P", 4, "fpreal32", &values)], &[]));
    assert_eq!(
        coordinates(&particles.positions),
        [[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [2.0, 4.0, 6.0]]
    );
}

#[test]
fn packed_primitives_are_refused_by_name() {
    let primitive = |kind: &str| {
        let definition = list(&[text("type"), text(kind)]);
        [text("primitives"), list(&[list(&[definition, list(&[])])])]
    };
    for kind in ["PackedGeometry", "PackedDisk", "PackedFragment_run", "AlembicRef"] {
        let error = READER.error(&file(1, &[origin(1)], &primitive(kind)));
        assert!(matches!(error, ParseError::Unsupported { .. }), "{error}");
        let name = kind.strip_suffix("_run").unwrap_or(kind);
        assert!(error.to_string().contains(&format!("({name})")), "{error}");
    }
    let run = list(&[text("type"), text("run"), text("runtype"), text("PackedGeometry")]);
    let run = [text("primitives"), list(&[list(&[run, list(&[])])])];
    assert!(READER.error(&file(1, &[origin(1)], &run)).to_string().contains("Unpack node"));
    // Others leave the points
    let bytes = file(1, &[origin(1)], &primitive("Polygon_run"));
    assert_eq!(READER.one(&bytes).positions.len(), 1);
    let notes = Houdini.notes(&bytes);
    assert_eq!(notes, ["primitives (Polygon) are not used; their points are read as particles"]);
}

#[test]
fn notes_have_version_and_what_is_not_read() {
    assert_eq!(
        Houdini.notes(&sample("houdini/flip_12.bgeo")),
        [
            "geometry of Houdini 20.0.547",
            "primitives (Polygon) are not used; their points are read as particles",
            "point attributes that are neither numbers nor strings are not read: notes",
        ]
    );
    // The beginning of a file
    let notes = Houdini.notes(&sample("houdini/flip_12.bgeo")[..100]);
    assert_eq!(notes, ["geometry of Houdini 20.0.547"]);
}

#[test]
fn attributes_of_houdini_are_left_out() {
    let particles = READER.one(&sample("houdini/flip_12.bgeo"));
    assert_eq!(names(&particles), ["v", "pscale", "id", "Cd", "name"]);
    assert_eq!(numbers(&attribute(&particles, "pscale").data)[..2], [f64::from(0.05_f32); 2]);
    assert_eq!(numbers(&attribute(&particles, "name").data)[6..8], [0.0, 1.0]);
}

#[test]
fn constant_pages_are_bounded_by_the_budget() {
    let pages = 64;
    let values = [
        text("pagesize"),
        int(1 << 16),
        text("constantpageflags"),
        list(&[flags(&[true; 64])]),
        text("rawpagedata"),
        floats(&[0.0; 3 * 64]),
    ];
    let bytes = file(pages << 16, &[numeric("P", 3, "fpreal32", &values)], &[]);
    let step = Step::whole(bytes.len());
    let mut source = ByteSource::whole(&bytes);
    let budget = MemoryBudget::new(1 << 20, "take care");
    let error = FORMAT.read_within(&mut source, &step, budget).expect_err("a bomb");
    assert!(matches!(error, ParseError::TooLarge { .. }), "{error}");
    assert_eq!(READER.one(&bytes).positions.len(), 64 << 16);
    let longer = file(
        1,
        &[
            origin(1),
            numeric(
                "a",
                1,
                "int32",
                &[text("pagesize"), int(1 << 17), text("rawpagedata"), ints(&[1])],
            ),
        ],
        &[],
    );
    let error = READER.error(&longer).to_string();
    assert!(error.contains("pages of 131072 points"), "{error}");
}

#[test]
fn truncated_files_are_detected() {
    for name in ["flip_12", "pages", "empty"] {
        let bytes = sample(&format!("houdini/{name}.bgeo"));
        READER.survives_truncation(&bytes, &[0, 4, 5, 6, bytes.len() - 1], bytes.len());
        for len in 0..bytes.len() {
            READER.error_inside(&bytes[..len]);
        }
    }
}

/// The tokens of the binary file `bytes` as text, as Houdini writes `.geo`.
fn as_text(bytes: &[u8]) -> Vec<u8> {
    let mut cursor = JsonCursor::new(bytes, MemoryBudget::UNLIMITED).expect("binary JSON");
    let (mut text, mut depth) = (String::new(), 0);
    loop {
        let token = cursor.next().expect("a token");
        match token.value {
            Value::Begin => text.push('['),
            Value::End => text.push(']'),
            Value::Null => text.push_str("null"),
            Value::Bool(flag) => text.push_str(if flag { "true" } else { "false" }),
            Value::Integer(number) => text += &number.to_string(),
            Value::Real(number) => text += &format!("{number:?}"),
            Value::Text(name) => text += &format!("\"{}\"", String::from_utf8_lossy(name)),
            Value::Uniform(array) if array.element == ElementType::Text => text += "[\"text\"]",
            Value::Uniform(_) => {
                let read = Numbers::read(&mut cursor, token, MemoryBudget::UNLIMITED);
                let data = read.expect("numbers").decode(cursor.endian, ScalarType::F64, 0);
                let AttributeData::F64(numbers) = data.expect("numbers") else { unreachable!() };
                // Integers without a point
                let words: Vec<String> = numbers.iter().map(f64::to_string).collect();
                text += &format!("[{}]", words.join(", "));
            }
        }
        depth += i32::from(matches!(token.value, Value::Begin));
        depth -= i32::from(matches!(token.value, Value::End));
        if depth == 0 {
            return text.into_bytes();
        }
        let is_begin = matches!(token.value, Value::Begin);
        text.push_str(if is_begin { "\n\t" } else { ",\n" });
    }
}

#[test]
fn text_has_the_particles_and_notes_of_the_same_binary_file() {
    for name in ["flip_12", "pages", "empty"] {
        let binary = sample(&format!("houdini/{name}.bgeo"));
        let text = as_text(&binary);
        assert_eq!(Houdini.sniff(&text), Ok(Confidence::Signature), "{name}");
        // Values that are NaN differ from themselves
        let shown = |bytes: &[u8]| format!("{:?}", READER.one(bytes));
        assert_eq!(shown(&text), shown(&binary), "{name}");
        assert_eq!(Houdini.notes(&text), Houdini.notes(&binary), "{name}");
        READER.survives_truncation(&text, &[0, 1, 20, text.len() - 1], 200);
    }
}

/// A file as text, with `values` of the attribute P.
fn text_file(count: &str, values: &str) -> String {
    format!(
        "[\n\t\"fileversion\",\"20.5.278\",\n\t\"hasindex\",false,\n\t\"pointcount\",{count},\n\t\"info\",{{\"a\\\"]\":\"b\"}},\n\t\
         \"attributes\",[\"pointattributes\",[[[\"scope\",\"public\",\"type\",\"numeric\",\"name\",\"P\"],\n\t\
         [\"size\",3,\"storage\",\"fpreal32\",\"values\",[\"size\",3,\"storage\",\"fpreal32\",{values}]]]]]\n]\n"
    )
}

#[test]
fn text_is_read_as_houdini_writes_it() {
    let text = text_file("2", "\"tuples\",[[1.5,-2,3e-1],[0,1,nan]]");
    let found = READER.one(text.as_bytes());
    let Positions::F32(positions) = &found.positions else { panic!("{found:?}") };
    assert_eq!(positions[0], Vec3::new(1.5, -2.0, 0.3));
    assert!(positions[1].z.is_nan());
    assert_eq!(Houdini.notes(text.as_bytes()), ["geometry of Houdini 20.5.278"]);
}

#[test]
fn damaged_text_is_named() {
    let tuples = "\"tuples\",[[1,2,3],[4,5,6]]";
    let good = text_file("2", tuples);
    assert_eq!(READER.one(good.as_bytes()).positions.len(), 2);
    let error = |text: &str| READER.error_inside(text.as_bytes()).to_string();
    for (text, expected) in [
        (text_file("3", tuples), "attribute `P`"),
        (text_file("2", "\"tuples\",[[1,2,3],[4,5]]"), "attribute `P`"),
        (text_file("2", "\"tuples\",[[1,2,3],[4,x,6]]"), "`x` is not a number"),
        (text_file("2", "\"tuples\",[[1,2,3],[4,\"a\",6]]"), "a number expected here"),
        (text_file("-2", tuples), "the count -2"),
        (text_file("\"2\"", tuples), "a count expected here"),
        (text_file("2", "\"sizes\",[]"), "attribute `P` has no"),
        (text_file("99999999999", tuples), "attribute `P`"),
        (good.replace("\"P\"", "\"Q\""), "no positions (attribute P)"),
        (good.replace("fpreal32", "int128"), "unknown type `int128`"),
        (good.replace("\"pointcount\"", "\"count\""), "no number of points"),
        (good.trim_end().trim_end_matches(']').to_owned(), "does not end"),
        ("[\"fileversion\",\"20".to_owned(), "a string does not end"),
    ] {
        let found = error(&text);
        assert!(found.contains(expected), "{found}, not {expected}");
    }
}

#[test]
fn numbers_of_text_are_bounded_by_the_budget() {
    // Each of two attributes fits, but not both
    let values = format!("\"tuples\",[{}]", "[0,0,0],".repeat(1000));
    let one = text_file("1000", &values);
    let (start, end) = one.split_once("[[[\"scope").expect("the attribute");
    let attribute = end.rsplit_once("]]\n]").expect("its end").0;
    let two = format!("{start}[[[\"scope{attribute},[[\"scope{attribute}]]\n]");
    let read = |text: &str, budget| {
        let mut source = ByteSource::whole(text.as_bytes());
        let budget = MemoryBudget::new(budget, "take care");
        FORMAT.read_within(&mut source, &Step::whole(text.len()), budget).map(|_| ())
    };
    assert_eq!(read(&one, 100_000), Ok(()));
    let error = read(&two, 40_000).expect_err("more numbers than memory");
    assert!(matches!(error, ParseError::TooLarge { .. }), "{error}");
}

proptest! {
    #[test]
    fn mutations_of_text_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let text = as_text(&sample("houdini/flip_12.bgeo"));
        let _ = READER.all(&mutate(&text, &changes));
    }

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = READER.all(&bytes);
        let _ = READER.all(&[b"\x7fNSJb[".as_slice(), &bytes].concat());
    }

    #[test]
    fn mutations_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        for name in ["flip_12", "pages"] {
            let _ = READER.all(&mutate(&sample(&format!("houdini/{name}.bgeo")), &changes));
        }
    }
}
