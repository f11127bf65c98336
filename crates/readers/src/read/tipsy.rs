//! Tipsy snapshots of Gasoline, PKDGRAV and ChaNGa: gas, dark matter and stars, big-endian (the standard) or native.
//!
//! A header with the time and the numbers of particles, then records of single precision: gas, dark matter, stars. After
//! the manual of Tipsy (Katz and Quinn). There is no signature: the numbers of particles must add up.

use super::columns::{self, ComponentStride, StridedColumn, check_room};
use super::numbers::NumberReader;
use super::{ByteSource, Step};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader};
use spherule_frame::{
    Attribute, AttributeData, Endian, MemoryBudget, ParseError, RawParticles, ScalarType,
};

/// Tipsy snapshots.
pub const FORMAT: Format = Format::new(&Tipsy);

struct Tipsy;

/// Bytes of the header; the last four are padding.
const HEADER: usize = 32;
const SIZE: usize = ScalarType::F32.size();
const PART: &str = "part";

/// Names of the numbers of a particle behind its mass, position and velocity.
const GAS: &[&str] = &["density", "temperature", "hsmooth", "metals", "phi"];
const DARK: &[&str] = &["eps", "phi"];
const STARS: &[&str] = &["metals", "tform", "eps", "phi"];

/// The kinds of particles in the order of the file: their names, and those of their numbers.
const KINDS: [(&str, &[&str]); 3] = [("gas", GAS), ("dark matter", DARK), ("stars", STARS)];

/// Numbers that all kinds have first: mass, position, velocity.
const COMMON: usize = 7;

impl Reader for Tipsy {
    fn info(&self) -> FormatInfo {
        FormatInfo::new("tipsy", &["tipsy", "std"])
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let is_header = Header::read(head).is_ok_and(|header| header.total() > 0);
        Ok(Confidence::signature_if(is_header))
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let bytes = source.bytes();
        let mut step = Step::whole(bytes.len());
        step.time = Header::read(bytes).ok().map(|header| header.time);
        Ok(vec![step])
    }

    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        read(source.bytes(), budget)
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        let Ok(header) = Header::read(head) else { return Vec::new() };
        let counted = KINDS.iter().zip(header.counts).enumerate();
        let kinds =
            counted.map(|(number, ((name, _), count))| format!("{number} = {name} ({count})"));
        vec![format!("attribute `part` is the kind: {}", kinds.collect::<Vec<String>>().join(", "))]
    }
}

struct Header {
    endian: Endian,
    time: f64,
    counts: [usize; 3],
}

impl Header {
    fn read(bytes: &[u8]) -> Result<Self, ParseError> {
        let found = [Endian::Big, Endian::Little].into_iter().find_map(|endian| {
            let mut numbers = NumberReader::new(bytes, 0, endian);
            let time = numbers.f64().ok().filter(|time| time.is_finite())?;
            let mut count = || numbers.count("number of particles").ok();
            let (total, dimensions) = (count()?, count()?);
            let counts = [count()?, count()?, count()?];
            let sum = counts.iter().fold(0, |sum: usize, count| sum.saturating_add(*count));
            (dimensions == 3 && sum == total).then_some(Self { endian, time, counts })
        });
        found.ok_or_else(|| {
            let what = "no header of a Tipsy snapshot: the numbers of gas, dark matter and stars do not add up to that of \
                        all, or there are not three dimensions";
            ParseError::malformed(0, what)
        })
    }

    fn total(&self) -> usize {
        self.counts.iter().sum()
    }

    /// A property of all particles by its name and components. The records of the kinds begin at `starts`; `offset` is that
    /// of the property among the numbers of a kind with these names. Kinds without it get NaN.
    fn property(
        &self,
        bytes: &[u8],
        starts: [usize; 3],
        (name, components): (&str, usize),
        offset: &dyn Fn(&[&str]) -> Option<usize>,
    ) -> Result<Attribute, ParseError> {
        let mut all = AttributeData::F32(Vec::new());
        for (((_, names), count), start) in KINDS.iter().zip(self.counts).zip(starts) {
            let Some(offset) = offset(names) else {
                all.append_nan(count * components);
                continue;
            };
            let first = ComponentStride { start: start + SIZE * offset, stride: record_len(names) };
            let scalar = (ScalarType::F32, self.endian);
            let column = StridedColumn::interleaved(name, scalar, components, first);
            all.append(columns::values(bytes, count, &column)?);
        }
        Ok(Attribute { name: name.to_owned(), components, data: all })
    }
}

/// Bytes of a record.
const fn record_len(names: &[&str]) -> usize {
    SIZE * (COMMON + names.len())
}

fn read(bytes: &[u8], budget: MemoryBudget) -> Result<RawParticles, ParseError> {
    let header = Header::read(bytes)?;
    // Check that all records are there
    let mut start = HEADER;
    let mut starts = [0; 3];
    for (((_, names), count), place) in KINDS.iter().zip(header.counts).zip(&mut starts) {
        check_room(start, count, record_len(names), bytes.len())?;
        *place = start;
        start += count * record_len(names);
    }
    let total = header.total();
    // Mass, position and velocity, the kind, and all other numbers
    let others = others();
    let each = SIZE * (COMMON + 1 + others.len());
    budget.check(2 * (each as u64).saturating_mul(total as u64), "its numbers in memory are")?;
    let gather = |property, offset: &dyn Fn(&[&str]) -> Option<usize>| {
        header.property(bytes, starts, property, offset)
    };
    let positions = columns::positions(vec![gather(("positions", 3), &|_| Some(1))?.data], total);
    let mut attributes =
        vec![gather(("mass", 1), &|_| Some(0))?, gather(("velocity", 3), &|_| Some(4))?];
    for name in others {
        let offset = |names: &[&str]| names.iter().position(|own| *own == name).map(|i| COMMON + i);
        // Kinds without particles add nothing
        let is_used = KINDS
            .iter()
            .zip(header.counts)
            .any(|((_, names), count)| count > 0 && names.contains(&name));
        if is_used {
            attributes.push(gather((name, 1), &offset)?);
        }
    }
    let of_kind = (0..).zip(header.counts);
    let parts = of_kind.flat_map(|(number, count)| std::iter::repeat_n(number, count)).collect();
    attributes.push(Attribute {
        name: PART.to_owned(),
        components: 1,
        data: AttributeData::U32(parts),
    });
    let names = (0..).zip(KINDS).map(|(number, (name, _))| (number, name.to_owned()));
    Ok(RawParticles {
        positions,
        attributes,
        time: Some(header.time),
        labels: [(PART.to_owned(), names.collect())].into(),
        ..RawParticles::default()
    })
}

/// The names of all numbers behind the common ones, each once.
fn others() -> Vec<&'static str> {
    let mut names = Vec::new();
    for name in KINDS.iter().flat_map(|(_, names)| *names) {
        if !names.contains(name) {
            names.push(*name);
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::damage::{TestedReader, attribute, coordinates, names, numbers};

    const READER: TestedReader = TestedReader {
        steps: |bytes| FORMAT.steps(bytes),
        read: |bytes, step| FORMAT.read(bytes, step),
    };

    fn snapshot(is_big: bool, counts: [u32; 3]) -> Vec<u8> {
        fn ordered<const N: usize>(mut little: [u8; N], is_big: bool) -> Vec<u8> {
            if is_big {
                little.reverse();
            }
            little.to_vec()
        }
        let int = |number: u32| ordered(number.to_le_bytes(), is_big);
        let mut bytes = ordered(0.5_f64.to_le_bytes(), is_big);
        bytes.extend(int(counts.iter().sum()));
        bytes.extend(int(3));
        bytes.extend(counts.map(int).concat());
        bytes.resize(HEADER, 0);
        for ((_, names), count) in KINDS.iter().zip(counts) {
            for particle in 0..count {
                for number in 0..COMMON + names.len() {
                    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
                    let value = number as f32 + 100.0 * particle as f32;
                    bytes.extend(ordered(value.to_le_bytes(), is_big));
                }
            }
        }
        bytes
    }

    #[test]
    fn kinds_follow_one_another_in_both_byte_orders() {
        for is_big in [true, false] {
            let bytes = snapshot(is_big, [2, 1, 1]);
            assert_eq!(FORMAT.reader().sniff(&bytes), Ok(Confidence::Signature));
            let found = READER.one(&bytes);
            assert_eq!(coordinates(&found.positions)[1], [101.0, 102.0, 103.0]);
            let values = |name: &str| numbers(&attribute(&found, name).data);
            assert_eq!(values("mass"), [0.0, 100.0, 0.0, 0.0]);
            assert_eq!(values("velocity")[3..6], [104.0, 105.0, 106.0]);
            assert_eq!(values("part"), [0.0, 0.0, 1.0, 2.0]);
            assert_eq!(values("metals")[3], 7.0);
            assert!(values("metals")[2].is_nan());
            assert_eq!(values("phi"), [11.0, 111.0, 8.0, 10.0]);
            assert_eq!((found.time, found.labels[PART][&2].as_str()), (Some(0.5), "stars"));
        }
        let dark = READER.one(&snapshot(true, [0, 3, 0]));
        assert_eq!(names(&dark), ["mass", "velocity", "phi", "eps", "part"]);
    }

    #[test]
    fn damage_is_named() {
        let good = snapshot(true, [2, 1, 1]);
        READER.survives_truncation(&good, &[8, 20, 32, 60], good.len());
        let mut bytes = good.clone();
        bytes[19] = 9;
        assert!(READER.error_inside(&bytes).to_string().contains("do not add up"));
        let huge =
            [&snapshot(true, [0; 3])[..8], &[127, 0, 0, 0, 0, 0, 0, 3, 127], &[0; 15]].concat();
        assert!(READER.error_inside(&huge).to_string().contains("2130706432 particles need"));
        for bytes in [&[0; 64][..], b"", &[1; 40]] {
            assert_eq!(FORMAT.reader().sniff(bytes), Ok(Confidence::No));
        }
        let tight = MemoryBudget::new(50, "take care");
        let mut source = ByteSource::whole(&good);
        assert!(FORMAT.read_within(&mut source, &Step::whole(good.len()), tight).is_err());
    }
}
