//! The lines that introduce attributes: `SCALARS`, `VECTORS`, `FIELD` and the rest. Says what an
//! attribute is called and how it is stored; its numbers are left to [`super::payload`].

use super::cursor::{LineCursor, VtkLine};
use super::types::{VtkEncoding, VtkType, stored_type};
use spherule_frame::{ParseError, ScalarType};

/// One array about to follow.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ArrayHeader {
    pub(super) name: String,
    pub(super) components: usize,
    /// Stated in a FIELD only; else it is the count of the section.
    pub(super) tuples: Option<usize>,
    pub(super) stored: VtkType,
}

/// Parses a count or a number of components.
///
/// # Errors
/// Malformed if it is missing, negative or no integer.
pub(super) fn count(line: &VtkLine, word: Option<&&[u8]>) -> Result<usize, ParseError> {
    word.and_then(|w| parse_count(w)).ok_or_else(|| {
        ParseError::malformed(line.at, format!("`{}`: a count is expected", line.shown()))
    })
}

fn parse_count(word: &[u8]) -> Option<usize> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// The array that an attribute keyword line announces; `None` if the keyword is none of an
/// attribute. Takes the `LOOKUP_TABLE` line after `SCALARS` too, if it is there.
pub(super) fn keyword_array(
    line: &VtkLine,
    cursor: &mut LineCursor<'_, '_>,
    encoding: VtkEncoding,
) -> Result<Option<ArrayHeader>, ParseError> {
    let keyword = line.first_word().to_ascii_uppercase();
    let components = match keyword.as_slice() {
        b"SCALARS" => {
            let header = scalars(line)?;
            skip_lookup_reference(cursor)?;
            return Ok(Some(header));
        }
        b"COLOR_SCALARS" => return color_scalars(line, encoding).map(Some),
        b"TEXTURE_COORDINATES" => return texture_coordinates(line).map(Some),
        b"VECTORS" | b"NORMALS" => 3,
        b"TENSORS" => 9,
        b"TENSORS6" => 6,
        b"GLOBAL_IDS" | b"PEDIGREE_IDS" | b"EDGE_FLAGS" => 1,
        _ => return Ok(None),
    };
    let words = line.words();
    let [_, name @ .., stored] = words.as_slice() else {
        return Err(incomplete(line));
    };
    Ok(Some(ArrayHeader {
        name: decode_name(name),
        components,
        tuples: None,
        stored: stored_type(line.at, stored)?,
    }))
}

/// `SCALARS name type [components]`; a name may hold blanks, so this reads from the right.
fn scalars(line: &VtkLine) -> Result<ArrayHeader, ParseError> {
    let words = line.words();
    let (name, stored, components) = match words.as_slice() {
        [_, name @ .., stored, k]
            if parse_count(k).is_some() && VtkType::parse(stored).is_some() =>
        {
            (name, stored, count(line, Some(k))?)
        }
        [_, name @ .., stored] => (name, stored, 1),
        [] | [_] => return Err(incomplete(line)),
    };
    Ok(ArrayHeader {
        name: decode_name(name),
        components,
        tuples: None,
        stored: stored_type(line.at, stored)?,
    })
}

/// `COLOR_SCALARS name k`: bytes in binary, numbers from 0 to 1 in ASCII.
fn color_scalars(line: &VtkLine, encoding: VtkEncoding) -> Result<ArrayHeader, ParseError> {
    let words = line.words();
    let [_, name @ .., components] = words.as_slice() else {
        return Err(incomplete(line));
    };
    Ok(ArrayHeader {
        name: decode_name(name),
        components: count(line, Some(components))?,
        tuples: None,
        stored: VtkType::Scalar(match encoding {
            VtkEncoding::Ascii => ScalarType::F32,
            VtkEncoding::Binary => ScalarType::U8,
        }),
    })
}

/// `TEXTURE_COORDINATES name dimensions type`.
fn texture_coordinates(line: &VtkLine) -> Result<ArrayHeader, ParseError> {
    let words = line.words();
    let [_, name @ .., components, stored] = words.as_slice() else {
        return Err(incomplete(line));
    };
    Ok(ArrayHeader {
        name: decode_name(name),
        components: count(line, Some(components))?,
        tuples: None,
        stored: stored_type(line.at, stored)?,
    })
}

/// `name components tuples type` inside a FIELD; `None` if the line is not that.
pub(super) fn field_array(line: &VtkLine) -> Option<ArrayHeader> {
    let words = line.words();
    let [name @ .., components, tuples, stored] = words.as_slice() else {
        return None;
    };
    Some(ArrayHeader {
        name: decode_name(name),
        components: parse_count(components)?,
        tuples: Some(parse_count(tuples)?),
        stored: VtkType::parse(stored)?,
    })
}

/// Skips `LOOKUP_TABLE name`, which some writers leave out. With a size after the name it is
/// a table of its own and not the reference that belongs to SCALARS.
fn skip_lookup_reference(cursor: &mut LineCursor<'_, '_>) -> Result<(), ParseError> {
    if !cursor.goes_on_with(b"LOOKUP_TABLE") {
        return Ok(());
    }
    let behind = cursor.ahead(|cursor| {
        let line = cursor.keyword_line()?;
        let is_table = line.is_some_and(
            |line| matches!(line.words().as_slice(), [_, _, size] if parse_count(size).is_some()),
        );
        Ok((!is_table).then(|| cursor.at()))
    })?;
    if let Some(behind) = behind {
        cursor.go_to(behind);
    }
    Ok(())
}

fn incomplete(line: &VtkLine) -> ParseError {
    ParseError::malformed(line.at, format!("`{}` is incomplete", line.shown()))
}

/// Joins the words of a name and undoes VTK's percent encoding.
fn decode_name(words: &[&[u8]]) -> String {
    let raw = words.join(&b' ');
    let mut name = Vec::with_capacity(raw.len());
    let mut rest = raw.as_slice();
    while let Some((&byte, tail)) = rest.split_first() {
        let escaped = tail
            .get(..2)
            .filter(|_| byte == b'%')
            .and_then(|digits| std::str::from_utf8(digits).ok())
            .filter(|digits| digits.bytes().all(|b| b.is_ascii_hexdigit()))
            .and_then(|digits| u8::from_str_radix(digits, 16).ok());
        if let Some(decoded) = escaped {
            name.push(decoded);
            rest = tail.get(2..).unwrap_or_default();
        } else {
            name.push(byte);
            rest = tail;
        }
    }
    String::from_utf8_lossy(&name).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(text: &str) -> VtkLine {
        VtkLine { at: 0, text: text.as_bytes().to_vec() }
    }

    #[test]
    fn names_are_decoded_and_may_contain_blanks() {
        assert_eq!(field_array(&line("vel%20x 3 10 float")).unwrap().name, "vel x");
        assert_eq!(field_array(&line("50%_%zz 3 10 float")).unwrap().name, "50%_%zz");
        let spaced = field_array(&line("pressure acceleration 3 10 FLOAT\r")).unwrap();
        assert_eq!((spaced.name.as_str(), spaced.components), ("pressure acceleration", 3));
        assert_eq!(spaced.tuples, Some(10));
        assert_eq!(field_array(&line("VECTORS v float")), None);
        assert_eq!(field_array(&line("v -3 10 float")), None);
    }

    #[test]
    fn scalars_read_from_the_right() {
        let two = scalars(&line("SCALARS my id unsigned_int 2")).unwrap();
        assert_eq!((two.name.as_str(), two.components), ("my id", 2));
        let one = scalars(&line("scalars id Int")).unwrap();
        assert_eq!((one.name.as_str(), one.components), ("id", 1));
        assert!(scalars(&line("SCALARS id wrong 1")).is_err());
        assert!(scalars(&line("SCALARS")).is_err());
    }
}
