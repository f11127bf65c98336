//! E57 point clouds (`.e57`) of laser scanners, after ASTM E2807-11.
//!
//! Pages with checksums hold scans in packets of bits, and XML that describes them. All scans of a file are read, each
//! from the place of its scanner. The crate `e57` is not used: it queues up to 190 bytes for each byte of a damaged file.

use glam::DVec3;

use super::{ByteSource, Step};
use crate::format::Format;
use crate::reader::{Confidence, FileExtent, FormatInfo, Reader, ValueNames};
use crate::shared::SharedBytes;
use spherule_frame::join::{PART, Part, join_numbered};
use spherule_frame::{Attribute, AttributeData, MemoryBudget, ParseError, Positions, RawParticles};

mod document;
mod pages;
mod points;

use document::{FieldKind, Scan};
use pages::{MAGIC, Pages};

/// E57 point clouds.
pub const FORMAT: Format = Format::new(&E57);

struct E57;

const CARTESIAN: [&str; 3] = ["cartesianX", "cartesianY", "cartesianZ"];
/// Distance from the scanner, and two angles in radians: from x towards y, and from there towards z.
const SPHERICAL: [&str; 3] = ["sphericalRange", "sphericalAzimuth", "sphericalElevation"];
/// Not 0 for points without a place.
const INVALID: [&str; 2] = ["cartesianInvalidState", "sphericalInvalidState"];
const COLOR: [&str; 3] = ["colorRed", "colorGreen", "colorBlue"];
/// Names of attributes that are not those of the file.
const NAMES: [(&str, &str); 8] = [
    ("rowIndex", "row_index"),
    ("columnIndex", "column_index"),
    ("returnCount", "return_count"),
    ("returnIndex", "return_index"),
    ("timeStamp", "time_stamp"),
    ("isColorInvalid", "is_color_invalid"),
    ("isIntensityInvalid", "is_intensity_invalid"),
    ("isTimeStampInvalid", "is_time_stamp_invalid"),
];
impl Reader for E57 {
    fn info(&self) -> FormatInfo {
        FormatInfo { notes_need_whole_file: true, ..FormatInfo::new("e57", &["e57"]) }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        Ok(Confidence::signature_if(head.starts_with(MAGIC)))
    }

    /// Reads the points of all scans. Points that the scanner could not place have no position.
    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let (pages, scans) = open(source.bytes(), budget)?;
        points::check_counts(&scans, pages.len())?;
        // Check the memory for the numbers in double precision and in their types
        let need = |scan: &Scan| {
            let each = size_of::<DVec3>() + 2 * scan.fields.len() * size_of::<f64>();
            (each as u64).saturating_mul(scan.count as u64)
        };
        let need = scans.iter().map(need).fold(0, u64::saturating_add);
        budget.check(need, "its numbers in memory are")?;
        // Read the scans, and put them together
        let mut parts = Vec::new();
        for (number, scan) in (0..).zip(&scans) {
            let particles = particles(scan, &points::values(&pages, scan)?)?;
            parts.push(Part { number, name: name_of(number, scan), particles });
        }
        match parts.len() {
            1 => Ok(parts.remove(0).particles),
            _ => join_numbered(parts, budget.less(need)),
        }
    }

    /// The numbers in double precision.
    fn unpacked_arrays_len(&self, _: &[u8], _: FileExtent, particles: &RawParticles) -> u64 {
        let numbers: usize = particles.attributes.iter().map(|found| found.components).sum();
        ((3 + numbers) * size_of::<f64>() * particles.positions.len()) as u64
    }

    fn value_names(&self, file: &SharedBytes) -> Vec<ValueNames> {
        let Ok((_, scans)) = open(file, MemoryBudget::UNLIMITED) else { return Vec::new() };
        if scans.len() == 1 {
            return Vec::new();
        }
        let numbered = (0..).zip(&scans);
        let names = numbered.map(|(number, scan)| (number.into(), name_of(number, scan)));
        vec![ValueNames { attribute: PART.to_owned(), names: names.collect() }]
    }

    fn notes(&self, bytes: &[u8]) -> Vec<String> {
        let scans = open(bytes, MemoryBudget::UNLIMITED).map(|(_, scans)| scans);
        let several = scans.ok().filter(|scans| scans.len() > 1);
        let note = |scans: Vec<Scan>| format!("{} scans; `{PART}` is their number", scans.len());
        several.map(note).into_iter().collect()
    }
}

/// The name of a scan.
fn name_of(number: u32, scan: &Scan) -> String {
    if scan.name.is_empty() { format!("scan{number}") } else { scan.name.clone() }
}

/// The pages and the scans of a file.
fn open(bytes: &[u8], budget: MemoryBudget) -> Result<(Pages<'_>, Vec<Scan>), ParseError> {
    let (pages, place) = Pages::open(bytes)?;
    budget.check(place.len.min(pages.len()) as u64, "its XML is")?;
    let (mut xml, start) = (Vec::new(), pages.place_of(place.at));
    pages.read(place.at, place.len, &mut xml)?;
    let xml = String::from_utf8(xml)
        .map_err(|_| ParseError::malformed(start, "the XML is not text in UTF-8"))?;
    // Some programs pad it
    let scans = document::scans(xml.trim_end_matches('\0'), start)?;
    if scans.is_empty() {
        return Err(ParseError::malformed(start, "no scans; the file may have pictures alone"));
    }
    Ok((pages, scans))
}

/// The particles of the points of `scan` with these `values` of its fields.
fn particles(scan: &Scan, values: &[Vec<f64>]) -> Result<RawParticles, ParseError> {
    let found = positions_of(scan, values)?;
    let positions = if has_single_positions(scan) {
        Positions::F32(found.iter().map(|position| position.as_vec3()).collect())
    } else {
        Positions::F64(found)
    };
    let color = fields_of(scan, COLOR);
    let mut attributes = Vec::new();
    if let Some([red, green, blue]) = color {
        let colors = values[red].iter().zip(&values[green]).zip(&values[blue]);
        let values: Vec<f64> = colors.flat_map(|((r, g), b)| [*r, *g, *b]).collect();
        let kinds = [red, green, blue].map(|field| scan.fields[field].kind);
        let data = typed(&kinds, &values);
        attributes.push(Attribute { name: "color".into(), components: 3, data });
    }
    for (field, values) in scan.fields.iter().zip(values) {
        let name = field.name.as_str();
        let is_place = [&CARTESIAN[..], &SPHERICAL, &INVALID].concat().contains(&name);
        if is_place || color.is_some() && COLOR.contains(&name) {
            continue;
        }
        let known = NAMES.iter().find(|(in_file, _)| *in_file == name);
        let shown = known.map_or(name, |(_, shown)| shown);
        let data = typed(&[field.kind], values);
        attributes.push(Attribute { name: shown.to_owned(), components: 1, data });
    }
    Ok(RawParticles { positions, attributes, ..RawParticles::default() })
}

/// The places of three fields.
fn fields_of(scan: &Scan, names: [&str; 3]) -> Option<[usize; 3]> {
    let [x, y, z] = names.map(|name| scan.field(name));
    Some([x?, y?, z?])
}

/// Whether single precision has all positions of a scan.
fn has_single_positions(scan: &Scan) -> bool {
    let is_single = |at: usize| scan.fields[at].kind == FieldKind::Single;
    !scan.has_pose() && fields_of(scan, CARTESIAN).is_some_and(|all| all.into_iter().all(is_single))
}

/// The positions of the points of `scan` with these `values` of its fields; not numbers for points without a place.
fn positions_of(scan: &Scan, values: &[Vec<f64>]) -> Result<Vec<DVec3>, ParseError> {
    let triple =
        |of: [usize; 3], point: usize| DVec3::from_array(of.map(|field| values[field][point]));
    let local: Box<dyn Fn(usize) -> DVec3> =
        match (fields_of(scan, CARTESIAN), fields_of(scan, SPHERICAL)) {
            (Some(of), _) => Box::new(move |point| triple(of, point)),
            (None, Some(of)) => Box::new(move |point| {
                let [range, azimuth, elevation] = triple(of, point).to_array();
                let across = range * libm::cos(elevation);
                let (sine, cosine) = libm::sincos(azimuth);
                DVec3::new(across * cosine, across * sine, range * libm::sin(elevation))
            }),
            (None, None) => {
                return Err(ParseError::malformed(
                    scan.place,
                    "the points of a scan have no places",
                ));
            }
        };
    let invalid = scan.field(INVALID[usize::from(fields_of(scan, CARTESIAN).is_none())]);
    let is_valid = |point: usize| invalid.is_none_or(|field| values[field][point] == 0.0);
    let placed = scan.placed();
    let place = |point: usize| if is_valid(point) { placed(local(point)) } else { DVec3::NAN };
    Ok((0..scan.count).map(place).collect())
}

/// `values` in the smallest type that has all values of these kinds.
#[expect(clippy::cast_possible_truncation, reason = "the type has all of them")]
fn typed(kinds: &[FieldKind], values: &[f64]) -> AttributeData {
    let ranges: Option<Vec<[i64; 2]>> = kinds
        .iter()
        .map(|kind| match kind {
            FieldKind::Whole { min, max } => Some([*min, *max]),
            _ => None,
        })
        .collect();
    if let Some(ranges) = ranges {
        let least = ranges.iter().map(|[min, _]| *min).min().unwrap_or(0);
        let most = ranges.iter().map(|[_, max]| *max).max().unwrap_or(0);
        return match (least, most) {
            (0.., ..=0xff) => AttributeData::U8(values.iter().map(|v| *v as u8).collect()),
            (0.., ..=0xffff) => AttributeData::U16(values.iter().map(|v| *v as u16).collect()),
            (-0x8000_0000.., ..=0x7fff_ffff) => {
                AttributeData::I32(values.iter().map(|v| *v as i32).collect())
            }
            _ => AttributeData::I64(values.iter().map(|v| *v as i64).collect()),
        };
    }
    if kinds.iter().all(|kind| *kind == FieldKind::Single) {
        return AttributeData::F32(values.iter().map(|v| *v as f32).collect());
    }
    AttributeData::F64(values.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::damage::{TestedReader, attribute, coordinates, names, numbers, sample};

    const READER: TestedReader = TestedReader {
        steps: |bytes| FORMAT.steps(bytes),
        read: |bytes, step| FORMAT.read(bytes, step),
    };

    #[test]
    fn scans_are_put_together_as_their_writer_reads_them() {
        let bytes = sample("e57/scans.e57");
        assert_eq!(FORMAT.reader().sniff(&bytes), Ok(Confidence::Signature));
        let found = READER.one(&bytes);
        let text = String::from_utf8(sample("e57/scans.csv")).expect("text");
        let rows: Vec<Vec<f64>> = text
            .lines()
            .skip(1)
            .map(|row| row.split(',').map(|number| number.parse().expect("a number")).collect())
            .collect();
        assert_eq!(rows.len(), found.positions.len());
        let colors = numbers(&attribute(&found, "color").data);
        for (point, (place, row)) in coordinates(&found.positions).iter().zip(&rows).enumerate() {
            // The first scanner is at the origin, the second one turned
            let error = if point < 60 { 0.0 } else { 1e-13 };
            for (found, expected) in place.iter().zip(row) {
                assert!((found - expected).abs() <= error, "{point}: {place:?} {row:?}");
            }
            assert_eq!(colors[3 * point..][..3], row[3..6]);
            assert_eq!(numbers(&attribute(&found, "row_index").data)[point], row[6]);
        }
        let expected = ["color", "intensity", "row_index", "column_index", "part"];
        assert_eq!(names(&found), expected);
        assert!(matches!(attribute(&found, "color").data, AttributeData::U8(_)));
        let scan = numbers(&attribute(&found, "part").data);
        assert_eq!((scan[59], scan[60]), (0.0, 1.0));
        assert_eq!(FORMAT.reader().notes(&bytes), ["2 scans; `part` is their number"]);
    }

    #[test]
    fn scaled_numbers_angles_and_points_without_a_place_are_read() {
        let scaled = READER.one(&sample("e57/scaled_integer_intensity.e57"));
        assert_eq!(coordinates(&scaled.positions), [[1.1, 2.2, 3.3], [4.4, 5.5, 6.6]]);
        let intensity = numbers(&attribute(&scaled, "intensity").data);
        assert!((intensity[0] + 66.6).abs() < 1e-9, "{intensity:?}");
        let invalid = READER.one(&sample("e57/cartesian_invalid_state_single.e57"));
        let places = coordinates(&invalid.positions);
        assert!(places[1][0].is_nan() && places[2][0].is_nan() || places[0][0].is_nan());
        assert_eq!(places.iter().filter(|place| place[0].is_finite()).count(), 1);
        // A quarter of a sphere around the scanner
        let round = READER.one(&sample("e57/tiny_spherical.e57"));
        let places = coordinates(&round.positions);
        let distances = places.iter().map(|p| p.map(|axis| axis * axis).iter().sum::<f64>().sqrt());
        assert_eq!(distances.filter(|distance| (distance - 1.0).abs() < 1e-6).count(), 180);
    }

    #[test]
    fn files_that_are_cut_off_are_refused() {
        for name in ["scans", "scaled_integer_intensity", "tiny_spherical"] {
            let bytes = sample(&format!("e57/{name}.e57"));
            READER.survives_truncation(&bytes, &[8, 47, 48, 1020, 1023], bytes.len());
        }
    }
}
