//! Text with variables, such as `t = {time:.2f} s`.

use super::number_format::NumberFormat;

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
    Variable(Variable, NumberFormat),
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
            // A doubled brace is text
            if let Some(doubled) = after.strip_prefix(brace) {
                plain.push_str(brace);
                rest = doubled;
                continue;
            }
            // Anything else is a variable up to its closing brace
            let end = after.find('}').filter(|_| brace == "{").ok_or_else(|| {
                format!("`{brace}` has no partner; write {brace}{brace} for a brace")
            })?;
            if !plain.is_empty() {
                pieces.push(Piece::Text(std::mem::take(&mut plain)));
            }
            pieces.push(variable(&after[..end])?);
            rest = &after[end + 1..];
        }
        // Keep the text behind the last variable
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

    /// Whether it has variables.
    pub(super) fn varies(&self) -> bool {
        self.pieces.iter().any(|piece| matches!(piece, Piece::Variable(..)))
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
    // Find the variable; ends of attributes are behind their names
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
    // Find the format
    let format = NumberFormat::parse(format).ok_or_else(|| {
        format!("unknown format `{format}` of `{{{name}}}` (examples: .2f, .1e, 04d, and a comma for groups of digits)")
    })?;
    Ok(Piece::Variable(variable, format))
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
