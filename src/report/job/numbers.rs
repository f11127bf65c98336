//! Numbers as people read them.

/// Binary multiples of a byte.
pub(super) const MIB: f64 = 1024.0 * 1024.0;

/// A count with its digits in threes, by a narrow space that does not break.
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

/// About three digits; nothing for what is not known.
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

/// Seconds in the unit that suits them.
pub(super) fn duration(seconds: f64) -> String {
    if seconds < 1.0 {
        return format!("{} ms", short(seconds * 1e3));
    }
    if seconds < 100.0 {
        return format!("{} s", short(seconds));
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates"
    )]
    let whole = seconds.round() as u64;
    let (hours, minutes, seconds) = (whole / 3600, whole / 60 % 60, whole % 60);
    if hours > 0 {
        format!("{hours} h {minutes} min")
    } else {
        format!("{minutes} min {seconds} s")
    }
}

/// Bytes in MiB, without the unit.
pub(super) fn mib(bytes: u64) -> String {
    short(float(bytes) / MIB)
}

/// Bytes with their unit.
pub(super) fn bytes(bytes: u64) -> String {
    let mib = float(bytes) / MIB;
    if mib < 1024.0 {
        format!("{} MiB", short(mib))
    } else {
        format!("{} GiB", short(mib / 1024.0))
    }
}

/// For people: past 2^53 the last digits do not count.
#[expect(clippy::cast_precision_loss, reason = "see above")]
pub(super) const fn float(value: u64) -> f64 {
    value as f64
}

/// At most `most` characters of `text`; a message may hold a whole file.
pub(super) fn shortened(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}\u{2026}", &text[..end]),
        None => text.to_owned(),
    }
}
