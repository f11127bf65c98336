//! Truncated, absurd and misspelt files, each with the error it must give.

use super::*;

#[test]
#[cfg_attr(miri, ignore = "too many bytes for an interpreter")]
fn truncation_is_rejected() {
    for name in ["ascii", "be", "color", "double", "le"] {
        let bytes = single(name);
        let header_end = PlyHeader::parse(&bytes).unwrap().body;
        // Without its last digits the text of the last number is another number, but a number.
        let needed = if name == "ascii" { bytes.len() - 8 } else { bytes.len() };
        READER.survives_truncation(
            &bytes,
            &[3, 4, header_end - 1, header_end, header_end + 1],
            needed,
        );
    }
}

#[test]
fn huge_counts_are_rejected() {
    for count in ["2147483647", "-1", "9223372036854775808", "99999999999999999999", "x"] {
        for format in ["ascii", "binary_little_endian"] {
            let lines = vertices(count, &[]);
            let mut all = vec![format!("format {format} 1.0")];
            all.extend(lines);
            let all: Vec<&str> = all.iter().map(String::as_str).collect();
            let mut bytes = header(&all);
            bytes.extend(b"1 2 3\n");
            let error = READER.error(&bytes);
            assert!(matches!(error, ParseError::Malformed { .. }), "{count}: {error}");
        }
    }
    // An element before the vertices, with and without lists.
    for property in ["property list char float l", "property float f"] {
        let mut bytes = header(&[
            "format binary_big_endian 1.0",
            "element camera 9223372036854775807",
            property,
            "element vertex 0",
            XYZ[0],
            XYZ[1],
            XYZ[2],
        ]);
        bytes.extend([0; 64]);
        assert!(matches!(READER.error(&bytes), ParseError::Malformed { .. }));
    }
    let mut negative_list = header(&[
        "format binary_big_endian 1.0",
        "element camera 1",
        "property list char float l",
        "element vertex 0",
        XYZ[0],
        XYZ[1],
        XYZ[2],
    ]);
    negative_list.push(0xff);
    assert!(READER.error(&negative_list).to_string().contains("negative"));
}

#[test]
fn invalid_text_is_described() {
    for (bytes, words) in [
        (points("2", &[], "1.25 2 3\n4 5\n"), "line ends before z"),
        (points("2", &[], "1 2 3 4\n4 5 6\n"), "more values than the 3"),
        (points("1", &[], "1 two 3\n"), "y is `two`, not f32"),
        (points("1", &["property uchar id"], "1 2 3 256\n"), "id is `256`, not u8"),
        (points("2", &[], "1 2 3\n          \n"), "file ends before 2 lines"),
        (ascii(&["element vertex 0", "property float x", "property float y"], ""), "no property z"),
        (ascii(&["element point 0"], ""), "it has [point]"),
        (ascii(&["property float x"], ""), "property before any element"),
        (ascii(&["element vertex 0", "property quad x"], ""), "unknown ply type `quad`"),
        (b"ply\nelement vertex 0\nend_header\n".to_vec(), "without a format"),
        (b"ply\nformat pdp_endian 1.0\nend_header\n".to_vec(), "unknown ply format `pdp_endian`"),
        (b"plyx".to_vec(), "the first line is not `ply`"),
        (b"ply\nformat ascii 1.0\n".to_vec(), "before end_header"),
        (b"ply\nhello\n".to_vec(), "begins with `hello`"),
    ] {
        let text = READER.error(&bytes).to_string();
        assert!(text.contains(words), "{text}");
    }
    let whole = READER.one(&points("1", &["property uchar id"], "1 2 3 255.0\n"));
    assert_eq!(attribute(&whole, "id").data, AttributeData::U8(vec![255]));
}

#[test]
fn names_from_the_file_are_escaped() {
    let bad = points("1", &["property uchar \u{1b}[2J"], "1 2 3 x\n");
    let text = READER.error(&bad).to_string();
    assert!(text.contains(r"\u{1b}[2J is `x`"), "{text}");
    let elements = format!("element {} 0", "x".repeat(4096));
    let text = READER.error(&ascii(&[&elements], "")).to_string();
    assert!(text.contains("characters left out] ") && text.ends_with("as vertices"), "{text}");
}
