//! Formats numbers for people.

/// Bytes per MiB.
pub(super) const MIB: f64 = 1024.0 * 1024.0;

/// A count with its digits in groups of three, separated by narrow non-breaking spaces.
pub(super) fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// About three digits; empty for unknown values.
pub(super) fn short(value: f64) -> String {
    match value {
        v if !v.is_finite() => String::new(),
        v if v >= 99.95 => format!("{v:.0}"),
        v if v >= 9.995 => format!("{v:.1}"),
        v if v >= 0.9995 => format!("{v:.2}"),
        v if v >= 0.0095 || v == 0.0 => format!("{v:.3}"),
        v => format!("{v:.5}"),
    }
}

/// Seconds in a table, with a resolution of 0.1 ms for short times.
pub(super) fn seconds(value: f64) -> String {
    if value < 0.9995 { format!("{value:.4}") } else { short(value) }
}

/// A duration with a suitable unit.
pub(super) fn duration(seconds: f64) -> String {
    if seconds < 1.0 {
        return format!("{} ms", short(seconds * 1e3));
    }
    if seconds < 100.0 {
        return format!("{} s", short(seconds));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let whole = seconds.round() as u64;
    let (hours, minutes, seconds) = (whole / 3600, whole / 60 % 60, whole % 60);
    if hours > 0 {
        format!("{hours} h {minutes} min")
    } else {
        format!("{minutes} min {seconds} s")
    }
}

/// A part of 1 as a percentage.
pub(super) fn percent(part: f64) -> String {
    format!("{} %", short(100.0 * part))
}

/// Bytes in MiB, without the unit.
pub(super) fn mib(bytes: u64) -> String {
    short(float(bytes) / MIB)
}

/// A size with its unit.
pub(super) fn bytes(bytes: u64) -> String {
    let mib = float(bytes) / MIB;
    if mib < 0.9995 {
        format!("{} KiB", short(mib * 1024.0))
    } else if mib < 1024.0 {
        format!("{} MiB", short(mib))
    } else {
        format!("{} GiB", short(mib / 1024.0))
    }
}

/// For display: above 2^53 the last digits do not matter.
#[expect(clippy::cast_precision_loss, reason = "see above")]
pub(super) const fn float(value: u64) -> f64 {
    value as f64
}

/// At most `most` characters of `text`, because a message may contain a whole file.
pub(super) fn shortened(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}\u{2026}", &text[..end]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_formatted() {
        assert_eq!(
            [0, 999, 1000, 12_345_678].map(count),
            ["0", "999", "1\u{202f}000", "12\u{202f}345\u{202f}678"]
        );
        let values = [0.0, 0.001_234, 0.0346, 1.0, 12.34, 99.96, 1234.6, f64::NAN];
        assert_eq!(
            values.map(short),
            ["0.000", "0.00123", "0.035", "1.00", "12.3", "100", "1235", ""]
        );
        assert_eq!([0.002_76, 1.5].map(seconds), ["0.0028", "1.50"]);
        assert_eq!(
            [0.002, 5.0, 125.0, 7260.0].map(duration),
            ["2.00 ms", "5.00 s", "2 min 5 s", "2 h 1 min"]
        );
        assert_eq!([2048, 3 << 20, 5 << 30].map(bytes), ["2.00 KiB", "3.00 MiB", "5.00 GiB"]);
        assert_eq!(shortened("a\u{e4}bc", 2), "a\u{e4}\u{2026}");
        assert_eq!(shortened("ab", 2), "ab");
    }
}
