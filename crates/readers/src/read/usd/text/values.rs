//! Values of text USD files.

use std::ops::Range;

use half::f16;

use super::lexer::Lexer;
use crate::read::text::{number, shown};
use crate::read::usd::number_type::{NumberType, Numbers, Scalar};
use crate::read::usd::prim::TextValue;
use spherule_frame::{AttributeData, MemoryBudget, ParseError, ScalarType};

/// The text of a file.
#[derive(Debug, Clone, Copy)]
pub(in crate::read::usd) struct TextFile<'a> {
    bytes: &'a [u8],
}

impl<'a> TextFile<'a> {
    pub(super) const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    pub(in crate::read::usd) const fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    fn text(&self, range: &Range<usize>) -> &'a [u8] {
        self.bytes.get(range.clone()).unwrap_or_default()
    }

    /// See [`crate::read::usd::layer::Layer::tokens`].
    pub(in crate::read::usd) fn tokens(&self, value: &TextValue) -> Vec<&'a [u8]> {
        let mut lexer = Lexer::new(self.bytes, value.range.clone());
        let mut tokens = Vec::new();
        lexer.take(b'[');
        while let Ok(token) = lexer.string() {
            tokens.push(self.text(&token));
            lexer.take(b',');
        }
        tokens
    }

    /// The type of a value, if that is not one of numbers.
    pub(in crate::read::usd) fn foreign_type(&self, value: &TextValue) -> Option<String> {
        let name = self.text(&value.type_name);
        let is_blocked = self.text(&value.range) == b"None";
        let is_known = number_type(name.strip_suffix(b"[]").unwrap_or(name)).is_some();
        (!is_blocked && !is_known).then(|| shown(name))
    }

    /// See [`crate::read::usd::layer::Layer::numbers`].
    pub(in crate::read::usd) fn numbers(
        &self,
        value: &TextValue,
        budget: MemoryBudget,
    ) -> Result<Option<Numbers>, ParseError> {
        let name = self.text(&value.type_name);
        let element = name.strip_suffix(b"[]");
        let is_array = element.is_some();
        let Some(number_type) = number_type(element.unwrap_or(name)) else {
            return Ok(None);
        };
        if self.text(&value.range) == b"None" {
            return Ok(None);
        }
        // A digit and a comma for each number
        let most = value.range.len() as u64 / 2 + 1;
        let size = number_type.in_memory().size() as u64;
        budget.check(most.saturating_mul(size), "its numbers in memory are")?;
        let lexer = Lexer::new(self.bytes, value.range.clone());
        let mut words = Words {
            lexer,
            bytes: self.bytes,
            data: AttributeData::zeros(number_type.in_memory(), 0),
        };
        if is_array {
            words.array(number_type)?;
        } else {
            words.value(number_type)?;
        }
        Ok(Some(Numbers {
            components: number_type.components,
            data: words.data,
            is_array,
            is_quaternion: number_type.is_quaternion,
        }))
    }
}

/// Reads the numbers of a value.
struct Words<'a> {
    lexer: Lexer<'a>,
    bytes: &'a [u8],
    data: AttributeData,
}

impl Words<'_> {
    fn array(&mut self, number_type: NumberType) -> Result<(), ParseError> {
        self.lexer.expect(b'[')?;
        while !self.lexer.take(b']') {
            self.value(number_type)?;
            if !self.lexer.take(b',') {
                return self.lexer.expect(b']');
            }
        }
        Ok(())
    }

    /// One number, or several in parentheses. Matrices have parentheses around each row, too.
    fn value(&mut self, number_type: NumberType) -> Result<(), ParseError> {
        let count = number_type.components;
        let row = match count {
            1 => return self.number(number_type.scalar),
            9 => 3,
            16 => 4,
            _ => count,
        };
        let is_matrix = row != count;
        self.lexer.expect(b'(')?;
        for index in 0..count {
            if is_matrix && index % row == 0 {
                self.lexer.expect(b'(')?;
            }
            self.number(number_type.scalar)?;
            if is_matrix && index % row == row - 1 {
                self.lexer.expect(b')')?;
            }
            if index + 1 < count {
                self.lexer.expect(b',')?;
            }
        }
        self.lexer.expect(b')')
    }

    #[expect(clippy::cast_possible_truncation, reason = "as OpenUSD rounds numbers in text")]
    fn number(&mut self, scalar: Scalar) -> Result<(), ParseError> {
        let word = self.lexer.word();
        let word = self.bytes.get(word).unwrap_or_default();
        let float = || number(word);
        let is_pushed = match (&mut self.data, scalar) {
            (AttributeData::F32(v), Scalar::Half) => {
                push(v, float().map(|n| f16::from_f32(n as f32).to_f32()))
            }
            (AttributeData::F32(v), _) => push(v, float().map(|n| n as f32)),
            (AttributeData::F64(v), _) => push(v, float()),
            (AttributeData::U8(v), _) => push(v, integer(word)),
            (AttributeData::I32(v), _) => push(v, integer(word)),
            (AttributeData::U32(v), _) => push(v, integer(word)),
            (AttributeData::I64(v), _) => push(v, integer(word)),
            (AttributeData::U64(v), _) => push(v, integer(word)),
            _ => None,
        };
        is_pushed.ok_or_else(|| {
            let what = format!("{} is not a number of this type", shown(word));
            ParseError::malformed(self.lexer.at() - word.len(), what)
        })
    }
}

fn push<T>(numbers: &mut Vec<T>, number: Option<T>) -> Option<()> {
    numbers.push(number?);
    Some(())
}

/// An integer, or a boolean in words.
fn integer<T: TryFrom<i128>>(word: &[u8]) -> Option<T> {
    let number = match word {
        b"true" => 1,
        b"false" => 0,
        _ => str::from_utf8(word).ok()?.parse::<i128>().ok()?,
    };
    T::try_from(number).ok()
}

/// Names of types that older files have, and those of today, as OpenUSD reads them.
const ALIASES: [(&[u8], &[u8]); 27] = [
    (b"Color", b"color3d"),
    (b"ColorFloat", b"color3f"),
    (b"Frame", b"frame4d"),
    (b"Matrix2d", b"matrix2d"),
    (b"Matrix3d", b"matrix3d"),
    (b"Matrix4d", b"matrix4d"),
    (b"Normal", b"normal3d"),
    (b"NormalFloat", b"normal3f"),
    (b"Point", b"point3d"),
    (b"PointFloat", b"point3f"),
    (b"Quatd", b"quatd"),
    (b"Quatf", b"quatf"),
    (b"Quath", b"quath"),
    (b"Vec2d", b"double2"),
    (b"Vec2f", b"float2"),
    (b"Vec2h", b"half2"),
    (b"Vec2i", b"int2"),
    (b"Vec3d", b"double3"),
    (b"Vec3f", b"float3"),
    (b"Vec3h", b"half3"),
    (b"Vec3i", b"int3"),
    (b"Vec4d", b"double4"),
    (b"Vec4f", b"float4"),
    (b"Vec4h", b"half4"),
    (b"Vec4i", b"int4"),
    (b"Vector", b"vector3d"),
    (b"VectorFloat", b"vector3f"),
];

/// The type of numbers called `name`; `None` for other types.
fn number_type(name: &[u8]) -> Option<NumberType> {
    let today = ALIASES.iter().find(|(alias, _)| *alias == name);
    if let Some((_, today)) = today {
        return number_type(today);
    }
    const F32: Scalar = Scalar::Plain(ScalarType::F32);
    const F64: Scalar = Scalar::Plain(ScalarType::F64);
    let plain = |scalar| Some(NumberType::new(Scalar::Plain(scalar), 1));
    match name {
        b"bool" | b"uchar" => return plain(ScalarType::U8),
        b"int" => return plain(ScalarType::I32),
        b"uint" => return plain(ScalarType::U32),
        b"int64" => return plain(ScalarType::I64),
        b"uint64" => return plain(ScalarType::U64),
        b"half" => return Some(NumberType::new(Scalar::Half, 1)),
        b"float" => return Some(NumberType::new(F32, 1)),
        b"double" | b"timecode" | b"duration" => return Some(NumberType::new(F64, 1)),
        b"matrix2d" => return None,
        b"matrix3d" => return Some(NumberType::new(F64, 9)),
        b"matrix4d" | b"frame4d" => return Some(NumberType::new(F64, 16)),
        b"quath" => return Some(NumberType::quaternion(Scalar::Half)),
        b"quatf" => return Some(NumberType::quaternion(F32)),
        b"quatd" => return Some(NumberType::quaternion(F64)),
        _ => {}
    }
    // A stem, a digit, and for roles such as `point` the letter of the scalar
    let digit = name.iter().position(u8::is_ascii_digit)?;
    let (stem, rest) = name.split_at(digit);
    let (components, letter) = rest.split_first()?;
    let components = usize::from(components - b'0');
    let scalar = match (stem, letter) {
        (b"float", b"") => F32,
        (b"double", b"") => F64,
        (b"half", b"") => Scalar::Half,
        (b"int", b"") => Scalar::Plain(ScalarType::I32),
        (b"point" | b"vector" | b"normal" | b"color" | b"texCoord", b"f") => F32,
        (b"point" | b"vector" | b"normal" | b"color" | b"texCoord", b"d") => F64,
        (b"point" | b"vector" | b"normal" | b"color" | b"texCoord", b"h") => Scalar::Half,
        _ => return None,
    };
    (2..=4).contains(&components).then(|| NumberType::new(scalar, components))
}
