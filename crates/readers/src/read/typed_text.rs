//! Words of text as numbers of the type that a header states, packed into records.

use std::str::FromStr;

use spherule_frame::ScalarType;

/// `word` as a number of type `T`.
pub(super) fn parse<T: FromStr>(word: &[u8]) -> Option<T> {
    str::from_utf8(word).ok()?.parse().ok()
}

/// Appends `word` as a little-endian number of type `scalar`; `None` if it is none.
pub(super) fn push_number(packed: &mut Vec<u8>, word: &[u8], scalar: ScalarType) -> Option<()> {
    macro_rules! integer {
        ($ty:ty) => {{
            let number: $ty = parse(word).or_else(|| whole_number(word)?.try_into().ok())?;
            packed.extend_from_slice(&number.to_le_bytes());
        }};
    }
    match scalar {
        ScalarType::I8 => integer!(i8),
        ScalarType::U8 => integer!(u8),
        ScalarType::I16 => integer!(i16),
        ScalarType::U16 => integer!(u16),
        ScalarType::I32 => integer!(i32),
        ScalarType::U32 => integer!(u32),
        ScalarType::I64 => integer!(i64),
        ScalarType::U64 => integer!(u64),
        ScalarType::F32 => {
            let number: f32 = parse(word).or_else(|| c_special(word))?;
            packed.extend_from_slice(&number.to_le_bytes());
        }
        ScalarType::F64 => {
            let number = parse(word).or_else(|| c_special(word).map(f64::from))?;
            packed.extend_from_slice(&number.to_le_bytes());
        }
    }
    Some(())
}

/// An integer that was written as a float, such as `255.0` or `1e3`.
fn whole_number(word: &[u8]) -> Option<i64> {
    /// Beyond this an f64 is no longer sure to be the number that was meant.
    const EXACT: f64 = 9_007_199_254_740_992.0;
    let number: f64 = parse(word)?;
    #[expect(clippy::cast_possible_truncation, reason = "checked to be whole and within 53 bits")]
    (number.fract() == 0.0 && number.abs() <= EXACT).then_some(number as i64)
}

/// Spellings of infinity and NaN that come from C libraries: `1.#INF`, `-1.#IND`, `-nan(ind)`.
fn c_special(word: &[u8]) -> Option<f32> {
    let word = str::from_utf8(word).ok()?.to_ascii_lowercase();
    let (sign, word) = match word.strip_prefix('-') {
        Some(word) => (-1.0, word),
        None => (1.0, word.as_str()),
    };
    if word.starts_with("1.#inf") {
        Some(sign * f32::INFINITY)
    } else if word.starts_with("1.#") || word.starts_with("nan(") {
        Some(f32::NAN)
    } else {
        None
    }
}
