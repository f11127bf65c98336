//! XML VTK (`.vtu`, `.vtp`): the points of UnstructuredGrid and PolyData with all numeric point
//! data, from any number of pieces, in every encoding that VTK, meshio and pyvisfile write.
//!
//! `document` reads the XML, `appended` finds the blob after it, `blocks` gets the bytes of
//! an array out of either, `compressor` unpacks them, `merge` puts pieces together, `mesh` reads cells. Lists
//! of files (`.pvtu`, `.vtm`, `.pvd`) are left to `spherule_formats::sequence`; grids are refused by name. Layout after "VTK
//! File Formats" (the VTK user's guide) and after files of VTK 9, ParaView, meshio and PySPH.

mod appended;
mod blocks;
mod compressor;
mod document;
mod merge;
mod mesh;
mod sniff;
#[cfg(test)]
mod tests;

pub use document::attribute;
pub use mesh::read_mesh;
pub use sniff::root_type;

use std::cell::Cell;

use memchr::memmem;

use super::text::same_length;
use super::vtk::{MAX_COMPONENTS, parse_values};
use super::{ByteSource, Step};
use crate::format::Format;
use crate::reader::{Confidence, FileExtent, FormatInfo, Reader};
use appended::Appended;
use blocks::{ArrayEncoding, ArrayFault, EncodedBytes, payload};
use document::{ArrayLocation, DataArray, XmlDocument, XmlPart};
use spherule_frame::{AttributeData, Endian, MemoryBudget, ParseError, RawParticles, ScalarType};

/// XML VTK: `.vtu` and `.vtp`.
pub const FORMAT: Format = Format::new(&XmlVtk);

struct XmlVtk;

impl Reader for XmlVtk {
    fn info(&self) -> FormatInfo {
        FormatInfo::new("vtk-xml", &["vtu", "vtp"])
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        sniff::sniff(head)
    }

    /// One step, with the time if a `TimeValue` before the pieces has it. Faults are reported by `read`, not here.
    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        let bytes = source.bytes();
        let mut step = Step::whole(bytes.len());
        step.time = parse(bytes, XmlPart::Fields, |mut document, appended| {
            document.encoding.decoders = budget;
            Ok(time(&document, appended))
        })
        .unwrap_or_default();
        Ok(vec![step])
    }

    /// Reads all pieces.
    ///
    /// [`ParseError::Malformed`] if the file is cut short or breaks the format,
    /// [`ParseError::Unsupported`] if it is a grid, a list of files, or of an unknown compressor.
    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        parse(source.bytes(), XmlPart::Particles, |mut document, appended| {
            check_shares(&document, appended)?;
            document.encoding.decoders = check_memory(&document, budget)?;
            let particles = merge::particles(&document, appended, budget)?;
            Ok(RawParticles { time: time(&document, appended), ..particles })
        })
    }

    fn unpacked_arrays_len(&self, head: &[u8], _file: FileExtent, particles: &RawParticles) -> u64 {
        let has = |text: &[u8]| memmem::find(head, text).is_some();
        if has(b"compressor=") || !has(b"encoding=\"raw\"") {
            particles.largest_array_len()
        } else {
            0
        }
    }
}

/// Cuts the file, parses the XML in front and hands both parts on.
fn parse<T>(
    bytes: &[u8],
    part: XmlPart,
    then: impl FnOnce(XmlDocument<'_>, Option<Appended<'_>>) -> Result<T, ParseError>,
) -> Result<T, ParseError> {
    let cut = appended::find(bytes);
    let head = bytes.get(..cut.unwrap_or(bytes.len())).unwrap_or_default();
    // Names in another encoding than UTF-8 are no reason to refuse the numbers.
    let head = same_length(head);
    let document = XmlDocument::parse(&head, cut.is_some(), part)?;
    check_total(&document, bytes.len())?;
    let spent = Cell::new(0);
    let appended = cut.map(|tag| Appended::parse(bytes, tag, &spent)).transpose()?;
    then(document, appended)
}

/// The most bytes that `len` bytes of the file can stand for.
fn most_bytes(document: &XmlDocument<'_>, len: usize) -> usize {
    match document.encoding.compressor {
        Some(compressor) => compressor.most_output(len),
        None => len,
    }
}

/// Rejects particle counts that no file of this length can hold; pieces that share their bytes
/// would get past the check of each array.
fn check_total(document: &XmlDocument<'_>, file: usize) -> Result<(), ParseError> {
    let most = most_bytes(document, file);
    let total =
        document.pieces.iter().try_fold(0_usize, |sum, piece| sum.checked_add(piece.points));
    // A coordinate takes a byte at least.
    match total.and_then(|n| n.checked_mul(3)) {
        Some(bytes) if bytes <= most => Ok(()),
        _ => Err(ParseError::malformed(
            0,
            format!("the pieces state more points than a file of {file} bytes can hold"),
        )),
    }
}

/// Rejects appended arrays that together need more than the appended bytes can hold: they share bytes, and
/// a small file with many such arrays would fill the memory.
fn check_shares(
    document: &XmlDocument<'_>,
    appended: Option<Appended<'_>>,
) -> Result<(), ParseError> {
    let Some(appended) = appended else {
        return Ok(());
    };
    let len = appended.blob.len();
    let most = most_bytes(document, len);
    let mut need = 0_usize;
    for (array, bytes) in array_sizes(document) {
        if !matches!(array.place, ArrayLocation::Appended(_)) {
            continue;
        }
        need = need.saturating_add(bytes);
        if need > most {
            return Err(ParseError::malformed(
                array.at,
                format!(
                    "array `{}` and those before it need {need} bytes, more than the {len} bytes \
                     appended can hold; each array needs bytes of its own",
                    short(&array.name)
                ),
            ));
        }
    }
    Ok(())
}

/// Rejects arrays that together take more memory than is allowed, before any is unpacked. Returns what is left.
fn check_memory(
    document: &XmlDocument<'_>,
    budget: MemoryBudget,
) -> Result<MemoryBudget, ParseError> {
    let sizes = array_sizes(document).map(|(_, bytes)| bytes as u64);
    let need = sizes.fold(0, u64::saturating_add);
    // The largest is there twice: as bytes, and as numbers.
    let largest = array_sizes(document).map(|(_, bytes)| bytes as u64).max();
    let need = need.saturating_add(largest.unwrap_or(0));
    budget.check(need, "decompressed its arrays are")?;
    Ok(budget.less(need))
}

/// The numeric arrays and the bytes that their numbers take.
fn array_sizes<'d, 'a>(
    document: &'d XmlDocument<'a>,
) -> impl Iterator<Item = (&'d DataArray<'a>, usize)> {
    document.pieces.iter().flat_map(|piece| {
        let coordinates = piece.coordinates.iter().map(|array| (array, 3));
        let data = piece.point_data.iter().map(|array| (array, array.components.unwrap_or(1)));
        coordinates.chain(data).filter_map(|(array, components)| {
            let scalar = scalar_type(&array.type_name)?;
            let values = piece.points.saturating_mul(components);
            Some((array, values.saturating_mul(scalar.size())))
        })
    })
}

/// A field of times has no more numbers: it is read before anything is known of the rest.
const MAX_TIMES: usize = 1 << 16;

/// The simulation time, if a field has it. It is optional: a damaged field costs only the time.
fn time(document: &XmlDocument<'_>, appended: Option<Appended<'_>>) -> Option<f64> {
    let is_time = |array: &&DataArray<'_>| {
        ["TimeValue", "TIME"].iter().any(|name| array.name.eq_ignore_ascii_case(name))
    };
    let array = document.fields.iter().find(is_time)?;
    let count = array
        .tuples
        .unwrap_or(1)
        .checked_mul(array.components.unwrap_or(1))
        .filter(|count| *count <= MAX_TIMES)?;
    let data = values(array, document.encoding, appended, count).ok()??;
    (!data.is_empty()).then(|| data.get_f64(0))
}

/// Type names; `None` for strings and other things that are not numbers.
fn scalar_type(name: &str) -> Option<ScalarType> {
    Some(match name.to_ascii_lowercase().as_str() {
        "int8" => ScalarType::I8,
        "uint8" => ScalarType::U8,
        "int16" => ScalarType::I16,
        "uint16" => ScalarType::U16,
        "int32" => ScalarType::I32,
        "uint32" => ScalarType::U32,
        "int64" => ScalarType::I64,
        "uint64" => ScalarType::U64,
        "float32" => ScalarType::F32,
        "float64" => ScalarType::F64,
        _ => return None,
    })
}

/// The `count` numbers of an array; `None` if it does not hold numbers.
///
/// # Errors
/// Malformed, naming the array, if there are not exactly that many.
fn values(
    array: &DataArray<'_>,
    encoding: ArrayEncoding,
    appended: Option<Appended<'_>>,
    count: usize,
) -> Result<Option<AttributeData>, ParseError> {
    let Some(scalar) = scalar_type(&array.type_name) else {
        return Ok(None);
    };
    if count == 0 {
        return scalar.decode(Endian::Little, &[]).map(Some);
    }
    let fault = |at: usize, what: String| {
        ParseError::malformed(at, format!("array `{}`: {what}", short(&array.name)))
    };
    let need = count
        .checked_mul(scalar.size())
        .ok_or_else(|| fault(array.at, format!("{count} numbers are too many")))?;
    let (at, source) = match &array.place {
        ArrayLocation::Ascii(text) => {
            let bytes = text.text.as_bytes();
            let (data, end) =
                parse_values(bytes, 0, count, scalar).map_err(|error| match error {
                    ParseError::Malformed { at, what } => {
                        fault(text.at.saturating_add(usize::try_from(at).unwrap_or(0)), what)
                    }
                    other => other,
                })?;
            let rest = bytes.get(end..).unwrap_or_default();
            if !rest.trim_ascii().is_empty() {
                return Err(fault(text.at + end, format!("more than {count} numbers")));
            }
            return Ok(Some(data));
        }
        ArrayLocation::Inline(text) => (text.at, EncodedBytes::Base64(text.text.as_bytes())),
        ArrayLocation::Appended(offset) => {
            let Some(appended) = appended else {
                return Err(fault(array.at, "the file has no <AppendedData>".to_owned()));
            };
            let Some(from) = appended.blob.get(*offset..) else {
                let length = appended.blob.len();
                return Err(fault(
                    array.at,
                    format!("offset {offset} is beyond the {length} bytes appended"),
                ));
            };
            let source = if appended.is_base64 {
                EncodedBytes::Base64(from)
            } else {
                EncodedBytes::Raw(from)
            };
            (appended.at + offset, source)
        }
    };
    let (bytes, used) = payload(source, encoding, need).map_err(|why| match why {
        ArrayFault::Damaged(what) => fault(at, what),
        ArrayFault::TooLarge(error) => {
            error.map_message(|what| format!("array `{}`: {what}", short(&array.name)))
        }
    })?;
    let is_appended = matches!(array.place, ArrayLocation::Appended(_));
    if is_appended && !appended.is_none_or(|appended| appended.spend(used)) {
        let what = "it shares its bytes with too many others; each array needs bytes of its own";
        return Err(fault(at, what.to_owned()));
    }
    let data = scalar.decode(encoding.endian, &bytes);
    data.map(Some).map_err(|error| fault(at, error.to_string()))
}

/// `points * components`, checked.
fn value_count(
    array: &DataArray<'_>,
    points: usize,
    components: usize,
) -> Result<usize, ParseError> {
    points.checked_mul(components).filter(|_| components <= MAX_COMPONENTS).ok_or_else(|| {
        ParseError::malformed(
            array.at,
            format!("{points} points of {components} components are too many"),
        )
    })
}

/// A name from the file, short enough for a message.
pub fn short(name: &str) -> String {
    name.chars().take(40).flat_map(char::escape_default).collect()
}
