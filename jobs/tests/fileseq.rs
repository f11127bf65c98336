//! Compares frame ranges with the results of Fileseq, whose notation they follow.
//!
//! The results are those of version 3.4.0 of the Python package `Fileseq`: `list(fileseq.FrameSet(text))`.

use spherule_jobs::FrameRange;

/// Texts that both read in the same way.
const SAME: [(&str, &[i64]); 61] = [
    ("1", &[1]),
    ("7", &[7]),
    ("0", &[0]),
    ("-7", &[-7]),
    ("-1", &[-1]),
    ("007", &[7]),
    ("0001", &[1]),
    ("1-1", &[1]),
    ("0-0", &[0]),
    ("1-5", &[1, 2, 3, 4, 5]),
    ("5-1", &[5, 4, 3, 2, 1]),
    ("-5--2", &[-5, -4, -3, -2]),
    ("-2--5", &[-2, -3, -4, -5]),
    ("-5-5", &[-5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5]),
    ("5--5", &[5, 4, 3, 2, 1, 0, -1, -2, -3, -4, -5]),
    ("-0-3", &[0, 1, 2, 3]),
    ("98-103", &[98, 99, 100, 101, 102, 103]),
    ("1-10x2", &[1, 3, 5, 7, 9]),
    ("1-10x3", &[1, 4, 7, 10]),
    ("1-10x20", &[1]),
    ("1-1x5", &[1]),
    ("1-5x1", &[1, 2, 3, 4, 5]),
    ("5-1x1", &[5, 4, 3, 2, 1]),
    ("10-1x3", &[10, 7, 4, 1]),
    ("10-1x-3", &[10, 7, 4, 1]),
    ("10-1x-1", &[10, 9, 8, 7, 6, 5, 4, 3, 2, 1]),
    ("-10--1x4", &[-10, -6, -2]),
    ("-1--10x-4", &[-1, -5, -9]),
    ("-5-5x5", &[-5, 0, 5]),
    ("5--5x-5", &[5, 0, -5]),
    ("1-10y2", &[2, 4, 6, 8, 10]),
    ("1-10y3", &[2, 3, 5, 6, 8, 9]),
    ("10-1y3", &[9, 8, 6, 5, 3, 2]),
    ("10-1y-3", &[9, 8, 6, 5, 3, 2]),
    ("1-2y2", &[2]),
    ("1-3y2", &[2]),
    ("1-10y20", &[2, 3, 4, 5, 6, 7, 8, 9, 10]),
    ("-5-5y5", &[-4, -3, -2, -1, 1, 2, 3, 4]),
    ("7,9,20", &[7, 9, 20]),
    ("20,9,7", &[20, 9, 7]),
    ("1,1,1", &[1]),
    ("1-5,3-7", &[1, 2, 3, 4, 5, 6, 7]),
    ("1-3,2", &[1, 2, 3]),
    ("5-1,1-6", &[5, 4, 3, 2, 1, 6]),
    ("1-5,8,10-20x5", &[1, 2, 3, 4, 5, 8, 10, 15, 20]),
    ("1-3,1-6y2", &[1, 2, 3, 4, 6]),
    ("1-10x2,2-10x2", &[1, 3, 5, 7, 9, 2, 4, 6, 8, 10]),
    ("-3--1,1-3", &[-3, -2, -1, 1, 2, 3]),
    ("10-1x-3,2-10x4", &[10, 7, 4, 1, 2, 6]),
    ("1-10:1", &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10]),
    ("5-1:1", &[5, 4, 3, 2, 1]),
    ("1-1:5", &[1]),
    (" 1-5", &[1, 2, 3, 4, 5]),
    ("1-5 ", &[1, 2, 3, 4, 5]),
    ("1 - 5", &[1, 2, 3, 4, 5]),
    ("1, 5", &[1, 5]),
    ("1 -5", &[1, 2, 3, 4, 5]),
    ("-5 - -3", &[-5, -4, -3]),
    ("1-10 x 2", &[1, 3, 5, 7, 9]),
    ("1-10x 2", &[1, 3, 5, 7, 9]),
    ("1-4 , 9", &[1, 2, 3, 4, 9]),
];

/// Texts that neither accepts.
const REFUSED_BY_BOTH: [&str; 36] = [
    "-", "--", "--1", "1-", "-1-", "1--", "1---5", "1-5x", "1-5y", "1-5:", "x2", "1x2", "1y2",
    "1:2", "1-10x0", "1-10y0", "1-10:0", "1-10x-1", "1-10x-3", "1-10y-2", "1-10:-3", "1-10x2x3",
    "1-10x2y3", "1-10xx2", "1-10X2", "1-10z2", "1-5-9", "+1", "1-+5", "a", "1-a", "0x10", "1_000",
    "1–5", "1-5;7", "1-5,a",
];

/// `:` is a step, as in Open Job Description. For Fileseq it is a stagger, in which the skipped frames follow:
/// `1-5:2` is 1, 3, 5, 2, 4. These are the results of `IntRangeExpr.from_str(text)` of the Python package
/// `openjd-model`, version 0.13.0.
const STEPS_OF_ENGINES: [(&str, &[i64]); 8] = [
    ("1-10:2", &[1, 3, 5, 7, 9]),
    ("1-10:3", &[1, 4, 7, 10]),
    ("10-1:-3", &[10, 7, 4, 1]),
    ("-5-5:5", &[-5, 0, 5]),
    ("1-10:20", &[1]),
    ("-2-2:2", &[-2, 0, 2]),
    ("1-9:2,20", &[1, 3, 5, 7, 9, 20]),
    ("-1--5:-2", &[-1, -3, -5]),
];

/// Texts that Fileseq accepts and spherule rejects, with the error: a typing error must not select other frames.
const REFUSED_HERE: [(&str, &str); 16] = [
    // No frames.
    ("", "missing"),
    (",", "`,`"),
    ("#", "`#`"),
    ("1-10y1", "no frame"),
    ("1-1y2", "no frame"),
    ("5-5y3", "no frame"),
    // Empty items
    (",1", "`,`"),
    ("1,", "missing"),
    ("1,,2", "`,`"),
    // White space inside numbers, which Fileseq removes: 12, and 1 to 20
    ("1 2", "`2`"),
    ("1-2 0", "`0`"),
    // The padding of file names
    ("1-5#", "`#`"),
    ("1-5@", "`@`"),
    // Fractional frames
    ("1.5", "`.`"),
    ("1-5x1.5", "`.`"),
    // Numbers beyond 64 bits
    ("99999999999999999999", "64 bits"),
];

fn frames(text: &str) -> Vec<i64> {
    let range: FrameRange = text.parse().unwrap_or_else(|e| panic!("{e}"));
    range.iter().collect()
}

#[test]
fn valid_texts_are_read_like_fileseq_does() {
    for (text, expected) in SAME {
        assert_eq!(frames(text), expected, "{text:?}");
        // The canonical text is read in the same way
        let range: FrameRange = text.parse().unwrap();
        assert_eq!(frames(&range.to_string()), expected, "{text:?} as {range}");
    }
}

#[test]
fn texts_that_fileseq_rejects_are_rejected() {
    for text in REFUSED_BY_BOTH {
        let error = text.parse::<FrameRange>().expect_err(text);
        assert!((1..=text.chars().count() + 1).contains(&error.at), "{error}");
    }
}

#[test]
fn a_colon_is_a_step() {
    for (text, expected) in STEPS_OF_ENGINES {
        assert_eq!(frames(text), expected, "{text:?}");
    }
}

#[test]
fn likely_typing_errors_are_rejected() {
    for (text, what) in REFUSED_HERE {
        let error = text.parse::<FrameRange>().expect_err(text);
        assert!(error.what.contains(what), "{text:?}: {error}");
    }
}
