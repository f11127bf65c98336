//! How numbers are written: a part of Python's formats.

/// How a number is written.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NumberFormat {
    decimals: Option<usize>,
    /// At least so many digits.
    digits: usize,
    /// With commas between groups of three digits.
    is_grouped: bool,
    is_scientific: bool,
}

/// Largest number of digits in a format.
const MAX_DIGITS: usize = 30;

impl NumberFormat {
    /// Reads `.2f`, `.1e`, `04d` or `,`, also after the `%` of C.
    pub fn parse(text: &str) -> Option<Self> {
        let mut format = Self::default();
        let mut rest = text.strip_prefix('%').unwrap_or(text);
        // A width, filled with zeros
        if let Some(after) = rest.strip_prefix('0') {
            let end = after.find(|c: char| !c.is_ascii_digit()).unwrap_or(after.len());
            format.digits = after[..end].parse().ok().filter(|digits| *digits <= MAX_DIGITS)?;
            rest = &after[end..];
        }
        // Groups of digits
        if let Some(after) = rest.strip_prefix(',') {
            format.is_grouped = true;
            rest = after;
        }
        // Decimals, and how they are written
        if let Some(after) = rest.strip_prefix('.') {
            let end = after.find(|c: char| !c.is_ascii_digit()).unwrap_or(after.len());
            let decimals = after[..end].parse().ok().filter(|digits| *digits <= MAX_DIGITS)?;
            format.decimals = Some(decimals);
            rest = &after[end..];
            format.is_scientific = rest == "e";
            return matches!(rest, "f" | "e").then_some(format);
        }
        matches!(rest, "" | "d").then_some(format)
    }

    pub(super) fn integer(self, value: i128) -> String {
        let digits = format!("{:0width$}", value.unsigned_abs(), width = self.digits);
        let sign = if value < 0 { "\u{2212}" } else { "" };
        let digits = if self.is_grouped { grouped(&digits) } else { digits };
        format!("{sign}{digits}")
    }

    /// A finite number.
    pub(super) fn write(self, value: f64) -> String {
        if self.decimals.is_some() || !value.is_finite() {
            return self.real(Some(value));
        }
        // Whole numbers; huge ones saturate
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let whole = value.round() as i128;
        self.integer(whole)
    }

    pub(super) fn real(self, value: Option<f64>) -> String {
        // A dash stands for a value that is not there
        let Some(value) = value.filter(|value| value.is_finite()) else {
            return "\u{2013}".to_owned();
        };
        // Write decimals with true minus signs, and powers of ten as on paper
        match self.decimals {
            Some(decimals) if self.is_scientific => {
                let text = format!("{value:.decimals$e}");
                match text.split_once('e') {
                    Some((mantissa, exponent)) => {
                        let power = exponent.parse().map_or_else(|_| String::new(), power_text);
                        format!("{}\u{d7}{power}", mantissa.replace('-', "\u{2212}"))
                    }
                    None => text,
                }
            }
            Some(decimals) => {
                let text = number(value, decimals);
                match (self.is_grouped, text.split_once('.')) {
                    (true, Some((whole, part))) => format!("{}.{part}", grouped(whole)),
                    (true, None) => grouped(&text),
                    (false, _) => text,
                }
            }
            None => value.to_string().replace('-', "\u{2212}"),
        }
    }
}

/// `value` with `decimals`, with the sign that mathematics uses.
pub(super) fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_zero = text.bytes().all(|b| matches!(b, b'-' | b'0' | b'.'));
    match text.strip_prefix('-') {
        Some(digits) if is_zero => digits.to_owned(),
        Some(digits) => format!("\u{2212}{digits}"),
        None => text,
    }
}

/// `10` to the power of `exponent`, as text.
pub(super) fn power_text(exponent: i32) -> String {
    let superscript = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32(0x2070 + digit.to_digit(10).unwrap_or(0)).unwrap_or(digit),
    };
    let digits = exponent.to_string();
    format!("10{}", digits.chars().map(superscript).collect::<String>())
}

/// Digits with a comma after each group of three from the end.
fn grouped(digits: &str) -> String {
    let count = digits.chars().filter(char::is_ascii_digit).count();
    let mut left = count;
    let mut text = String::new();
    for c in digits.chars() {
        if c.is_ascii_digit() {
            if left != count && left.is_multiple_of(3) {
                text.push(',');
            }
            left -= 1;
        }
        text.push(c);
    }
    text
}
