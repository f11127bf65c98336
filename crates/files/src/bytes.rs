//! Parses and formats sizes of memory and files.

use std::fmt;
use std::str::FromStr;

use crate::ValueError;

/// A number of bytes. Displayed in binary units with three digits (`1.25 GiB`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Bytes(pub u64);

/// Names and factors, largest first: units with `i` and single letters are powers of 1024, `GB` etc. are powers of
/// 1000.
const UNITS: [(&str, u64); 13] = [
    ("TiB", 1 << 40),
    ("GiB", 1 << 30),
    ("MiB", 1 << 20),
    ("KiB", 1 << 10),
    ("TB", 1_000_000_000_000),
    ("GB", 1_000_000_000),
    ("MB", 1_000_000),
    ("kB", 1000),
    ("T", 1 << 40),
    ("G", 1 << 30),
    ("M", 1 << 20),
    ("K", 1 << 10),
    ("B", 1),
];

impl FromStr for Bytes {
    type Err = ValueError;

    /// `4GiB`, `1.5G`, `512MiB`, `4GB`, `4294967296`: a number without a unit is in bytes.
    fn from_str(text: &str) -> Result<Self, ValueError> {
        let wrong = || ValueError::new("a size, such as 4GiB, 512MiB or a number of bytes", text);
        let trimmed = text.trim();
        let digits = trimmed.find(|c: char| !c.is_ascii_digit() && c != '.');
        let (number, unit) = trimmed.split_at(digits.unwrap_or(trimmed.len()));
        let unit = unit.trim_start();
        let factor = match unit {
            "" => 1,
            _ => {
                UNITS.iter().find(|(name, _)| name.eq_ignore_ascii_case(unit)).ok_or_else(wrong)?.1
            }
        };
        if let Ok(whole) = number.parse::<u64>() {
            return whole.checked_mul(factor).map(Self).ok_or_else(wrong);
        }
        let number: f64 = number.parse().map_err(|_| wrong())?;
        let bytes = number * factor as f64;
        // Fractions of a byte are errors.
        if factor == 1 || bytes >= u64::MAX as f64 {
            return Err(wrong());
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "only digits and a point, and below 2^64"
        )]
        Ok(Self(bytes as u64))
    }
}

impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = UNITS[..4].iter().find(|(_, factor)| self.0 >= *factor);
        let Some((name, factor)) = unit else {
            return write!(f, "{} B", self.0);
        };
        let value = self.0 as f64 / *factor as f64;
        let digits = if value < 9.995 { 2 } else { usize::from(value < 99.95) };
        write!(f, "{value:.digits$} {name}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parses_sizes_with_units() {
        for (text, bytes) in [
            ("4096", 4096),
            ("0", 0),
            ("512MiB", 512 << 20),
            ("4GiB", 4 << 30),
            ("4 gib", 4 << 30),
            ("4G", 4 << 30),
            ("1.5G", 3 << 29),
            ("2k", 2048),
            ("2GB", 2_000_000_000),
            ("7B", 7),
            ("16777215TiB", 16_777_215 << 40),
        ] {
            assert_eq!(text.parse(), Ok(Bytes(bytes)), "{text}");
        }
        for text in
            ["", "G", "-1", "4X", "4GiB of it", "1.5", "1.2.3G", "1e9", "99999999TiB", "inf", "."]
        {
            let error = text.parse::<Bytes>().unwrap_err();
            assert!(error.expected.contains("4GiB"), "{text}: {error}");
        }
    }

    #[test]
    fn formats_sizes_with_three_digits() {
        for (bytes, text) in [
            (0, "0 B"),
            (1023, "1023 B"),
            (1024, "1.00 KiB"),
            (10_235, "10.0 KiB"),
            (9 << 20, "9.00 MiB"),
            (123 << 20, "123 MiB"),
            (5 << 40, "5.00 TiB"),
        ] {
            assert_eq!(Bytes(bytes).to_string(), text);
        }
    }
}
