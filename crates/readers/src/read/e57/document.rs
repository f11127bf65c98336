//! The XML part of a file: its scans, where their points are, and what each point has.

use glam::{DMat3, DQuat, DVec3};
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use crate::read::vtk_xml::{attribute, short};
use spherule_frame::ParseError;

/// Points of one position of a scanner.
#[derive(Debug, Default)]
pub(super) struct Scan {
    /// Place in the file of its points.
    pub(super) place: usize,
    pub(super) count: usize,
    pub(super) name: String,
    /// What each point has.
    pub(super) fields: Vec<Field>,
    pose: Pose,
}

/// Maximum number of letters of the name of a scan that are kept.
const MAX_NAME: usize = 60;
/// Maximum number of fields of a point; real ones have up to twenty.
const MAX_FIELDS: usize = 1000;

/// A number of each point.
#[derive(Debug)]
pub(super) struct Field {
    /// Name in the file.
    pub(super) name: String,
    pub(super) kind: FieldKind,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum FieldKind {
    Single,
    Double,
    /// Whole numbers from `min` to `max`, which is not less.
    Whole {
        min: i64,
        max: i64,
    },
    /// The same, times `scale` plus `offset`.
    Scaled {
        min: i64,
        max: i64,
        scale: f64,
        offset: f64,
    },
}

impl FieldKind {
    /// Bits of a value.
    pub(super) const fn bits(self) -> u32 {
        match self {
            Self::Single => 32,
            Self::Double => 64,
            Self::Whole { min, max } | Self::Scaled { min, max, .. } => {
                u64::BITS - max.wrapping_sub(min).cast_unsigned().leading_zeros()
            }
        }
    }
}

/// Rotation and position of a scanner.
#[derive(Debug, Clone, Copy)]
struct Pose {
    rotation: DQuat,
    translation: DVec3,
}

impl Default for Pose {
    fn default() -> Self {
        Self { rotation: DQuat::IDENTITY, translation: DVec3::ZERO }
    }
}

impl Scan {
    /// Whether points have coordinates of the whole file.
    pub(super) fn has_pose(&self) -> bool {
        self.pose.rotation != DQuat::IDENTITY || self.pose.translation != DVec3::ZERO
    }

    /// The coordinates in the file of those from the scanner.
    pub(super) fn placed(&self) -> impl Fn(DVec3) -> DVec3 {
        let (matrix, translation) = (DMat3::from_quat(self.pose.rotation), self.pose.translation);
        let has_pose = self.has_pose();
        move |point| if has_pose { matrix * point + translation } else { point }
    }

    /// The place of the field called `name`.
    pub(super) fn field(&self, name: &str) -> Option<usize> {
        self.fields.iter().position(|field| field.name == name)
    }

    /// Adds the text of the element at `path` below the scan: its name, or a number of the pose.
    fn add_text(&mut self, path: &str, text: &str, at: usize) -> Result<(), ParseError> {
        let Pose { rotation, translation } = &mut self.pose;
        let number = match path {
            "/name" => {
                self.name = text.chars().filter(|c| !c.is_control()).take(MAX_NAME).collect();
                return Ok(());
            }
            "/pose/rotation/w" => &mut rotation.w,
            "/pose/rotation/x" => &mut rotation.x,
            "/pose/rotation/y" => &mut rotation.y,
            "/pose/rotation/z" => &mut rotation.z,
            "/pose/translation/x" => &mut translation.x,
            "/pose/translation/y" => &mut translation.y,
            "/pose/translation/z" => &mut translation.z,
            _ => return Ok(()),
        };
        *number = parsed(text, at)?;
        Ok(())
    }
}

/// The path of a scan.
const SCAN: &str = "/e57Root/data3D/vectorChild";

/// The scans of `xml`, which begins at byte `start` of the file.
pub(super) fn scans(xml: &str, start: usize) -> Result<Vec<Scan>, ParseError> {
    let (mut scans, mut path) = (Vec::new(), String::new());
    let mut reader = Reader::from_str(xml);
    loop {
        let event = reader.read_event();
        let at = start + usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX);
        match event {
            Ok(Event::Start(element)) => {
                open(&mut scans, &mut path, &element, at)?;
            }
            Ok(Event::Empty(element)) => {
                open(&mut scans, &mut path, &element, at)?;
                close(&mut path);
            }
            Ok(Event::End(_)) => close(&mut path),
            Ok(Event::Text(text)) => add_text(&mut scans, &path, &text, at)?,
            Ok(Event::CData(text)) => add_text(&mut scans, &path, &text, at)?,
            Ok(Event::Eof) => break,
            Ok(_) => {}
            Err(error) => return Err(ParseError::malformed(at, format!("bad XML: {error}"))),
        }
    }
    // A quaternion that is not one turns nothing
    for scan in &mut scans {
        let rotation = &mut scan.pose.rotation;
        *rotation = rotation.normalize();
        if !rotation.is_finite() {
            return Err(ParseError::malformed(start, "the rotation of a pose is 0"));
        }
    }
    Ok(scans)
}

/// Adds the text of the element at `path`.
fn add_text(scans: &mut [Scan], path: &str, text: &str, at: usize) -> Result<(), ParseError> {
    match (scans.last_mut(), path.strip_prefix(SCAN)) {
        (Some(scan), Some(inside)) => scan.add_text(inside, text.trim_ascii(), at),
        _ => Ok(()),
    }
}

/// Adds what the element that begins says, and its name to `path`.
fn open(
    scans: &mut Vec<Scan>,
    path: &mut String,
    element: &BytesStart<'_>,
    at: usize,
) -> Result<(), ParseError> {
    path.push('/');
    let name = element.local_name();
    let name: &str = name.as_ref();
    path.push_str(name);
    let Some(inside) = path.strip_prefix(SCAN) else {
        return Ok(());
    };
    if inside.is_empty() {
        scans.push(Scan::default());
    }
    let Some(scan) = scans.last_mut() else {
        return Ok(());
    };
    if inside == "/points" {
        scan.place = number(element, "fileOffset", at)?.unwrap_or(0);
        scan.count = number(element, "recordCount", at)?.unwrap_or(0);
    } else if inside.strip_prefix("/points/prototype/") == Some(name) {
        if scan.fields.len() == MAX_FIELDS {
            return Err(ParseError::malformed(at, format!("more than {MAX_FIELDS} fields")));
        }
        if scan.field(name).is_some() {
            let what = format!("points have two fields called {}", short(name));
            return Err(ParseError::malformed(at, what));
        }
        scan.fields.push(Field { name: name.to_owned(), kind: kind_of(element, at)? });
    }
    Ok(())
}

fn close(path: &mut String) {
    path.truncate(path.rfind('/').unwrap_or(0));
}

/// The type of the field that `element` describes.
fn kind_of(element: &BytesStart<'_>, at: usize) -> Result<FieldKind, ParseError> {
    let range = || -> Result<(i64, i64), ParseError> {
        let min = number(element, "minimum", at)?.unwrap_or(i64::MIN);
        let max = number(element, "maximum", at)?.unwrap_or(i64::MAX);
        if min > max {
            return Err(ParseError::malformed(at, format!("a field from {min} to {max}")));
        }
        Ok((min, max))
    };
    Ok(match attribute(element, at, "type")?.as_deref() {
        Some("Float") => match attribute(element, at, "precision")?.as_deref() {
            Some("single") => FieldKind::Single,
            _ => FieldKind::Double,
        },
        Some("Integer") => {
            let (min, max) = range()?;
            FieldKind::Whole { min, max }
        }
        Some("ScaledInteger") => {
            let (min, max) = range()?;
            let scale = number(element, "scale", at)?.unwrap_or(1.0);
            let offset = number(element, "offset", at)?.unwrap_or(0.0);
            FieldKind::Scaled { min, max, scale, offset }
        }
        other => {
            let what = format!("a field of type {}", short(other.unwrap_or("(none)")));
            return Err(ParseError::malformed(at, what));
        }
    })
}

/// The attribute of `element` called `name` as a number.
fn number<T: std::str::FromStr>(
    element: &BytesStart<'_>,
    name: &str,
    at: usize,
) -> Result<Option<T>, ParseError> {
    let text = attribute(element, at, name)?;
    text.map(|text| parsed(&text, at)).transpose()
}

fn parsed<T: std::str::FromStr>(text: &str, at: usize) -> Result<T, ParseError> {
    let wrong = |_| ParseError::malformed(at, format!("`{}` is not a number here", short(text)));
    text.trim_ascii().parse().map_err(wrong)
}
