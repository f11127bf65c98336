//! Text with variables, such as `t = {time:.2f} s`.

use super::ticks::number;

/// What variables stand for in one frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrameValues {
    /// Simulation time, if known.
    pub time: Option<f64>,
    /// Frame number.
    pub frame: i64,
    /// Particle count.
    pub particles: u64,
    /// Name of the file.
    pub file: String,
    /// Smallest and largest values, in the order of the names that were requested; None if the frame has none.
    pub ranges: Vec<(String, Option<[f64; 2]>)>,
}

/// Text with variables.
#[derive(Debug, Clone, PartialEq)]
pub struct Template {
    pieces: Vec<Piece>,
}

#[derive(Debug, Clone, PartialEq)]
enum Piece {
    Text(String),
    Variable(Variable, Format),
}

#[derive(Debug, Clone, PartialEq)]
enum Variable {
    Time,
    Frame,
    Particles,
    File,
    Least(String),
    Greatest(String),
}

/// How a number is written.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Format {
    decimals: Option<usize>,
    /// At least so many digits.
    digits: usize,
    /// With commas between groups of three digits.
    is_grouped: bool,
    is_scientific: bool,
}

/// Largest number of digits in a format.
const MAX_DIGITS: usize = 30;

/// Names of variables.
const NAMES: [&str; 4] = ["time", "frame", "particles", "file"];

impl Template {
    /// Reads a text. `{{` and `}}` stand for braces.
    ///
    /// # Errors
    /// A brace has no partner, or a variable or its format is unknown: the problem, with the variable.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (mut pieces, mut plain) = (Vec::new(), String::new());
        let mut rest = text;
        while let Some(at) = rest.find(['{', '}']) {
            plain.push_str(&rest[..at]);
            let brace = &rest[at..=at];
            let after = &rest[at + 1..];
            if let Some(doubled) = after.strip_prefix(brace) {
                plain.push_str(brace);
                rest = doubled;
                continue;
            }
            let end = after.find('}').filter(|_| brace == "{");
            let end = end.ok_or_else(|| {
                format!("`{brace}` has no partner; write {brace}{brace} for a brace")
            })?;
            if !plain.is_empty() {
                pieces.push(Piece::Text(std::mem::take(&mut plain)));
            }
            pieces.push(variable(&after[..end])?);
            rest = &after[end + 1..];
        }
        plain.push_str(rest);
        if !plain.is_empty() {
            pieces.push(Piece::Text(plain));
        }
        Ok(Self { pieces })
    }

    /// The texts between the variables.
    pub(super) fn texts(&self) -> impl Iterator<Item = &str> {
        self.pieces.iter().filter_map(|piece| match piece {
            Piece::Text(text) => Some(&**text),
            Piece::Variable(..) => None,
        })
    }

    /// Names of the values whose ranges are needed.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.pieces.iter().filter_map(|piece| match piece {
            Piece::Variable(Variable::Least(name) | Variable::Greatest(name), _) => Some(&**name),
            _ => None,
        })
    }

    /// The text of a frame. Unknown values are dashes.
    pub fn expand(&self, values: &FrameValues) -> String {
        let range = |name: &str| {
            let mut ranges = values.ranges.iter();
            ranges.find(|(known, _)| known == name).and_then(|(_, range)| *range)
        };
        let pieces = self.pieces.iter().map(|piece| match piece {
            Piece::Text(text) => text.clone(),
            Piece::Variable(variable, format) => match variable {
                Variable::Time => format.real(values.time),
                Variable::Frame => format.integer(values.frame.into()),
                Variable::Particles => format.integer(values.particles.into()),
                Variable::File => values.file.clone(),
                Variable::Least(name) => format.real(range(name).map(|range| range[0])),
                Variable::Greatest(name) => format.real(range(name).map(|range| range[1])),
            },
        });
        pieces.collect()
    }
}

/// Reads what stands between braces: `time:.2f`.
fn variable(text: &str) -> Result<Piece, String> {
    let (name, format) = text.split_once(':').unwrap_or((text, ""));
    let variable = match name {
        "time" => Variable::Time,
        "frame" => Variable::Frame,
        "particles" => Variable::Particles,
        "file" => Variable::File,
        _ => match name.rsplit_once('.') {
            Some((value, "min")) if !value.is_empty() => Variable::Least(value.to_owned()),
            Some((value, "max")) if !value.is_empty() => Variable::Greatest(value.to_owned()),
            _ => {
                let names = NAMES.join(", ");
                return Err(format!(
                    "unknown variable `{{{name}}}`; known are {names}, and NAME.min and NAME.max of attributes"
                ));
            }
        },
    };
    let format = Format::parse(format).ok_or_else(|| {
        format!("unknown format `{format}` of `{{{name}}}` (examples: .2f, .1e, 04d, and a comma for groups of digits)")
    })?;
    Ok(Piece::Variable(variable, format))
}

impl Format {
    /// Reads a part of Python's formats: `.2f`, `.1e`, `04d`, `,`.
    fn parse(text: &str) -> Option<Self> {
        let mut format = Self::default();
        let mut rest = text;
        if let Some(after) = rest.strip_prefix('0') {
            let end = after.find(|c: char| !c.is_ascii_digit()).unwrap_or(after.len());
            format.digits = after[..end].parse().ok().filter(|digits| *digits <= MAX_DIGITS)?;
            rest = &after[end..];
        }
        if let Some(after) = rest.strip_prefix(',') {
            format.is_grouped = true;
            rest = after;
        }
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

    fn integer(self, value: i128) -> String {
        let digits = format!("{:0width$}", value.unsigned_abs(), width = self.digits);
        let sign = if value < 0 { "\u{2212}" } else { "" };
        let digits = if self.is_grouped { grouped(&digits) } else { digits };
        format!("{sign}{digits}")
    }

    fn real(self, value: Option<f64>) -> String {
        let Some(value) = value.filter(|value| value.is_finite()) else {
            return "\u{2013}".to_owned();
        };
        match self.decimals {
            Some(decimals) if self.is_scientific => {
                let text = format!("{value:.decimals$e}");
                match text.split_once('e') {
                    Some((mantissa, exponent)) => {
                        let power = exponent
                            .parse()
                            .map_or_else(|_| String::new(), super::ticks::power_text);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn values() -> FrameValues {
        FrameValues {
            time: Some(0.034_9),
            frame: 7,
            particles: 1_234_567,
            file: "dump_0007.bgeo".to_owned(),
            ranges: vec![
                ("density".to_owned(), Some([-998.5, 1001.25])),
                ("mass".to_owned(), None),
            ],
        }
    }

    #[test]
    fn variables_have_values_and_formats() {
        for (text, expected) in [
            ("t = {time:.2f} s", "t = 0.03 s"),
            ("{time}", "0.0349"),
            ("{time:.1e}", "3.5×10⁻²"),
            ("frame {frame:04d}/{frame}", "frame 0007/7"),
            ("{particles:,} of {particles}", "1,234,567 of 1234567"),
            ("{file}", "dump_0007.bgeo"),
            ("ρ = {density.min:.1f} … {density.max:.0f}", "ρ = −998.5 … 1001"),
            ("{density.max:,.2f}", "1,001.25"),
            ("{mass.max:.1f}", "–"),
            ("{{time}} }}", "{time} }"),
            ("", ""),
        ] {
            let template = Template::parse(text).expect(text);
            assert_eq!(template.expand(&values()), expected, "{text}");
        }
        let template = Template::parse("{density.min} {v.x.max:.1f}").expect("good");
        assert_eq!(template.names().collect::<Vec<_>>(), ["density", "v.x"]);
        let early = FrameValues { time: None, ..values() };
        assert_eq!(Template::parse("{time:.1f}").expect("good").expand(&early), "–");
    }

    #[test]
    fn unknown_variables_are_refused() {
        for (text, part) in [
            ("{tme}", "unknown variable `{tme}`"),
            ("{}", "unknown variable `{}`"),
            ("{.min}", "unknown variable"),
            ("{time", "`{` has no partner"),
            ("time}", "`}` has no partner"),
            ("{time:.2g}", "unknown format `.2g`"),
            ("{time:.99f}", "unknown format"),
            ("{frame:099999999999999d}", "unknown format"),
            ("{frame:é}", "unknown format"),
        ] {
            let error = Template::parse(text).expect_err(text);
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
