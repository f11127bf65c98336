//! Point clouds of laser scanners in text (`.pts`): a count, then a line for each point.
//!
//! Lines are `x y z`, with the intensity (-2048 to 2047), with the colour (0 to 255), or with both in this order. The
//! format has no title, so that the name of the file must tell it from molecular text. After what Leica Cyclone exports.

use super::line_words::next_line;
use super::sniff::is_text;
use super::table::{
    Comments, Decimal, Dialect, ExtraCells, NumberKind, RowLabels, Separator, Table, TargetArray,
    TargetComponent, TextPolicy, most_rows,
};
use super::text::{self, Line, Lines};
use super::{ByteSource, CUT_SHORT, Step};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{ParseError, RawParticles};

/// Point clouds of laser scanners in text.
pub const FORMAT: Format = Format::new(&Pts);

struct Pts;

const DIALECT: Dialect = Dialect {
    separator: Separator::Blanks,
    decimal: Decimal::Point,
    comments: Comments::None,
    surplus: ExtraCells::Empty,
};

impl Reader for Pts {
    fn info(&self) -> FormatInfo {
        FormatInfo::new("pts", &["pts"])
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let mut lines = Lines::new(head, 0..head.len());
        let has_count = is_text(head) && lines.next().is_some_and(|line| count(line).is_ok());
        Ok(if has_count { Confidence::IfNamed } else { Confidence::No })
    }

    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        Some(StreamUnit::Rows)
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        Ok(vec![Step::whole(source.text().left_about())])
    }

    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let text = source.text();
        let line = next_line(text, "number of points")?;
        let (count_at, count) = (line.at, count(line)?);
        let (fields, targets) = columns(text.peek_line().filter(|_| count > 0))?;
        let table = Table {
            dialect: DIALECT,
            rows: most_rows(text.left_about(), fields.len()).min(count),
            fields,
            targets,
            labels: Some(RowLabels { first_line: 2, columns: Vec::new() }),
        };
        let rows = table.particles(text, count, budget);
        let found = rows.lines;
        let (positions, attributes) = rows.content?;
        if found < count || positions.len() != count {
            let what = format!("{count} points expected, {} follow: {CUT_SHORT}", positions.len());
            return Err(ParseError::malformed(count_at, what));
        }
        text.pass_blank_lines(usize::MAX);
        if let Some(line) = text.peek_line() {
            let what = format!(
                "{} follows {count} points: if it is the count of another scan, write each scan to a file of its own",
                text::shown(line.text)
            );
            return Err(ParseError::malformed(line.at, what));
        }
        Ok(RawParticles { positions, attributes, ..RawParticles::default() })
    }
}

fn count(line: Line<'_>) -> Result<usize, ParseError> {
    let token = line.text.trim_ascii();
    let count = text::integer(token).and_then(|count| usize::try_from(count).ok());
    count.ok_or_else(|| {
        let what = format!("{} is not a number of points", text::shown(token));
        ParseError::malformed(line.at, what)
    })
}

type TableColumns = (Vec<Option<TargetComponent>>, Vec<TargetArray>);

/// The columns by the line of the first point.
fn columns(first: Option<Line<'_>>) -> Result<TableColumns, ParseError> {
    let words = first.map_or(3, |line| text::words(line.text).take(8).count());
    let (has_intensity, has_color) = match words {
        3 => (false, false),
        4 => (true, false),
        6 => (false, true),
        7 => (true, true),
        _ => {
            let line = first.unwrap_or(Line { at: 0, text: b"" });
            let what = format!(
                "{} is not a point: x y z, perhaps the intensity, perhaps red, green and blue",
                text::shown(line.text)
            );
            return Err(ParseError::malformed(line.at, what));
        }
    };
    let mut targets = vec![TargetArray::positions()];
    let mut fields = Vec::new();
    let mut add = |target: usize, components: usize| {
        let places = (0..components).map(|component| Some(TargetComponent { target, component }));
        fields.extend(places);
    };
    add(0, 3);
    for (name, components, _) in
        [("intensity", 1, has_intensity), ("color", 3, has_color)].into_iter().filter(|c| c.2)
    {
        add(targets.len(), components);
        let numbers = NumberKind::WholeIfAll;
        targets.push(TargetArray::attribute(name, components, numbers, TextPolicy::Fault));
    }
    Ok((fields, targets))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::damage::{TestedReader, attribute, coordinates, names, numbers};
    use crate::read::pieces;

    fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
        pieces::steps(FORMAT, bytes)
    }

    fn read(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
        pieces::read(FORMAT, bytes, step)
    }

    const READER: TestedReader = TestedReader { steps, read };

    #[test]
    fn points_have_intensity_and_colour() {
        for (tail, expected) in [
            ("", &[][..]),
            (" -2047", &["intensity"]),
            (" 255 128 0", &["color"]),
            (" 0.5 255 128 0", &["intensity", "color"]),
        ] {
            let text = format!("2\n1.5 -2 3e1{tail}\n4 5 6{tail}\n");
            for text in [&text, &text.replace('\n', "\r\n"), &format!("{text}\n")] {
                let found = READER.one(text.as_bytes());
                assert_eq!(names(&found), expected);
                assert_eq!(coordinates(&found.positions), [[1.5, -2.0, 30.0], [4.0, 5.0, 6.0]]);
                if expected.contains(&"color") {
                    let color = attribute(&found, "color");
                    assert_eq!(color.data.scalar_type(), spherule_frame::ScalarType::I64);
                    assert_eq!(numbers(&color.data)[..3], [255.0, 128.0, 0.0]);
                }
            }
        }
        assert_eq!(READER.one(b"0\n").positions.len(), 0);
    }

    #[test]
    fn damage_is_named() {
        for (text, message) in [
            ("x\n1 2 3\n", "byte 0: \"x\" is not a number of points"),
            ("3\n1 2 3\n4 5 6\n", "byte 0: 3 points expected, 2 follow: the file is cut short"),
            ("999999999999\n1 2 3\n", "byte 0: 999999999999 points expected, 1 follow"),
            (
                "1\n1 2 3\n1\n1 2 3\n",
                "byte 8: \"1\" follows 1 points: if it is the count of another scan",
            ),
            ("2\n1 2 3 4 5\n", "byte 2: \"1 2 3 4 5\" is not a point"),
            ("2\n1 2 3 4\n1 2 x 4\n", "byte 14: line 3: column 3 has \"x\", not a number"),
            ("2\n1 2 3\n1 2 3 4\n", "byte 14: line 3 has more than 3 columns"),
        ] {
            let error = READER.error_inside(text.as_bytes()).to_string();
            assert!(error.starts_with(message), "{error} | {message}");
        }
    }
}
