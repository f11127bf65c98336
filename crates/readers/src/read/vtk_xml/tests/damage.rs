//! Files that are cut short, lie about counts and sizes, or are random.

use proptest::prelude::*;

use super::made::{Made, Pack, Style, Where, all_styles, made};
use super::{good, malformed, parse_file, read, sample, steps};
use crate::read::Step;
use crate::read::vtk_xml::appended::{self, Appended};
use spherule_frame::{AttributeData, ParseError};

#[test]
#[cfg_attr(miri, ignore = "too many bytes for an interpreter")]
fn huge_counts_are_rejected_without_allocation() {
    for style in all_styles() {
        let file = made(style, &[3]);
        for count in [
            "2147483648",
            "9223372036854775808",
            "18446744073709551615",
            "6148914691236517206",
            "-1",
            "1e9",
            "2",
            "4",
        ] {
            for from in ["NumberOfPoints=\"3\"", "Name=\"id\" NumberOfComponents=\"1\""] {
                let (key, _) = from.rsplit_once('=').unwrap();
                let bad = replace(&file, from, &format!("{key}=\"{count}\""));
                malformed(&bad);
            }
        }
    }
}

#[test]
fn inconsistent_block_headers_are_rejected() {
    let style = Style { pack: Pack::Zlib(1 << 15, true), ..Style::RAW };
    let file = made(style, &[3]);
    let blob = blob_at(&file);
    // A single block may be called the last of any size above its own, or a full one.
    let is_true = |word, lie| (word == 1 && lie > 12) || (word == 2 && lie == 0);
    for word in 0..4 {
        for lie in [0_u32, 1, 2, 13, 1 << 31, u32::MAX] {
            let mut bad = file.clone();
            let at = blob + 4 * word;
            if bad[at..at + 4] == lie.to_le_bytes() || is_true(word, lie) {
                continue;
            }
            bad[at..at + 4].copy_from_slice(&lie.to_le_bytes());
            // The first array is the time, which a damaged header costs and nothing else.
            assert_eq!(good(&bad).time, None, "word {word} = {lie}");
            let mut bad = file.clone();
            let at = at + (16 + style.packed(&0.75_f64.to_le_bytes()).1.len());
            if bad[at..at + 4] == lie.to_le_bytes() {
                continue;
            }
            bad[at..at + 4].copy_from_slice(&lie.to_le_bytes());
            let what = malformed(&bad);
            assert!(what.starts_with("array `id`"), "{what}");
        }
    }
}

#[test]
fn compression_bombs_are_rejected() {
    // 64 KiB stored for what its header calls 12 bytes, and the other way round.
    let zeros = AttributeData::F32(vec![0.0; 1 << 14]);
    let style = Style { pack: Pack::Zlib(1 << 16, true), ..Style::RAW };
    let file = Made::new(style)
        .xml("<Piece NumberOfPoints=\"1\"><Points>")
        .array("p", 3, &zeros)
        .xml("</Points></Piece>")
        .end();
    malformed(&file);
    let mut lying = file.clone();
    let blob = blob_at(&file);
    lying[blob + 8..blob + 12].copy_from_slice(&12_u32.to_le_bytes());
    let what = malformed(&lying);
    assert!(what.contains("zlib"), "{what}");
}

#[test]
fn arrays_that_share_bytes_count_against_the_budget() {
    let values = AttributeData::F32(vec![0.5; 300]);
    let style = Style::RAW;
    let file = Made::new(style)
        .xml("<Piece NumberOfPoints=\"100\"><Points>")
        .array("p", 3, &values)
        .xml("</Points><PointData></PointData></Piece>")
        .end();
    let share = |count: usize| {
        let arrays: String = (0..count)
            .map(|i| {
                format!(
                    "<DataArray type=\"Float32\" Name=\"a{i}\" NumberOfComponents=\"3\" \
                     format=\"appended\" offset=\"0\"/>"
                )
            })
            .collect();
        replace(&file, "<PointData>", &format!("<PointData>{arrays}"))
    };
    assert_eq!(good(&share(0)).attributes.len(), 0);
    let what = malformed(&share(1));
    assert!(what.starts_with("array `a0` and those before it need 2400"), "{what}");
    malformed(&share(1000));
}

#[test]
fn error_offsets_do_not_depend_on_names() {
    let name = [0xff; 1000];
    let file = [
        b"<VTKFile type='PolyData'><PolyData><Piece NumberOfPoints='1'><Points>\
          <DataArray type='Float32' NumberOfComponents='3' Name='"
            .as_slice(),
        &name,
        b"'>1 2 x</DataArray></Points></Piece></PolyData></VTKFile>",
    ]
    .concat();
    let Err(ParseError::Malformed { at, .. }) = parse_file(&file) else {
        panic!("x is not a number");
    };
    assert_eq!(file[usize::try_from(at).unwrap()], b'x');
}

/// The first byte of the appended data.
fn blob_at(file: &[u8]) -> usize {
    let tag = appended::find(file).unwrap();
    Appended::parse(file, tag, &std::cell::Cell::new(0)).unwrap().at
}

#[track_caller]
fn replace(file: &[u8], from: &str, to: &str) -> Vec<u8> {
    let at = memchr::memmem::find(file, from.as_bytes()).unwrap_or_else(|| panic!("no {from}"));
    [&file[..at], to.as_bytes(), &file[at + from.len()..]].concat()
}

/// Whatever is missing at the end must be noticed, unless it is only closing tags.
#[track_caller]
fn check_cuts(bytes: &[u8], cuts: impl Iterator<Item = usize>) {
    let whole = good(bytes);
    let (mut cut_count, mut refused) = (0, 0);
    for cut in cuts {
        cut_count += 1;
        match parse_file(&bytes[..cut]) {
            Ok(part) => assert_eq!(part, whole, "cut at {cut}"),
            Err(ParseError::Malformed { .. }) => refused += 1,
            Err(error) => panic!("cut at {cut}: {error}"),
        }
    }
    assert!(refused * 10 >= cut_count * 8, "{refused} of {cut_count}");
}

#[test]
#[cfg_attr(miri, ignore = "too many bytes for an interpreter")]
fn truncation_is_detected() {
    for place in [Where::Ascii, Where::Inline, Where::Base64, Where::Raw] {
        for pack in [Pack::Plain, Pack::Zlib(12, true)] {
            let file = made(Style { place, pack, ..Style::RAW }, &[3, 2]);
            check_cuts(&file, 0..file.len());
        }
    }
    for name in
        ["single_frames/raw-lzma.vtu", "single_frames/raw-lz4.vtu", "single_frames/inline-zlib.vtp"]
    {
        let file = sample(name);
        let last_array =
            if name.contains("raw-") { 38_590.min(file.len() / 2) } else { file.len() };
        check_cuts(&file, (0..last_array).step_by(97));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(256) })]

    #[test]
    fn random_bytes_do_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), blob in any::<bool>()) {
        let _ = read(&bytes, &Step::whole(bytes.len()));
        let style = Style { pack: Pack::Zlib(12, true), ..Style::RAW };
        let mut file = made(style, &[3]);
        file.truncate(if blob { blob_at(&file) } else { 150 });
        file.extend(bytes);
        let _ = steps(&file);
        let _ = read(&file, &Step::whole(file.len()));
    }

    #[test]
    fn random_damage_does_not_panic(
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), any::<bool>()), 1..6),
        style in prop::sample::select(all_styles()),
    ) {
        let mut file = made(style, &[3, 2]);
        for (place, value, digit) in damage {
            let at = place.index(file.len());
            file[at] = if digit { b'0' + value % 10 } else { value };
        }
        let _ = steps(&file);
        let _ = read(&file, &Step::whole(file.len()));
    }

    #[test]
    fn damaged_xz_and_lz4_do_not_panic(
        place in any::<prop::sample::Index>(), value in any::<u8>(), lz4 in any::<bool>()
    ) {
        let name = if lz4 { "single_frames/raw-lz4.vtu" } else { "single_frames/raw-lzma.vtu" };
        let mut file = sample(name);
        let blob = blob_at(&file);
        // The headers and streams of the four arrays that are read.
        let end = file.len().min(blob + 26_000);
        let at = blob + place.index(end - blob);
        file[at] = value;
        let _ = read(&file, &Step::whole(file.len()));
    }
}
