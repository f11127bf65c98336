//! Streaming conversion: what streams is what the reader reads, and a frame that is ordered in parts holds the
//! particles of one that is ordered at once.

use std::fs;
use std::path::Path;

use glam::DVec3;
use spherule_formats::convert::{
    AttributeChoice, ConvertError, ConvertReport, ConvertSettings, ParticleSource, RadiusRule,
    convert as convert_whole, convert_in_parts, open_source,
};
use spherule_formats::native::{Access, Bound, Encoding, NativeFile};
use spherule_formats::{FrameError, FrameFile, RawParticles};

use super::check_message;

/// Names of formats that can stream; the first byte picks one, and with its higher bits settings.
const NAMES: [&str; 8] = ["a.bgeo", "a.ply", "a.xyz", "a.npy", "a.vtk", "a", "a.csv", "a.vtu"];

/// The first byte picks name and settings, the others are the file.
pub fn convert(bytes: &[u8]) -> usize {
    let Some((choice, bytes)) = bytes.split_first() else {
        return 0;
    };
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join(NAMES[usize::from(*choice) % NAMES.len()]);
    fs::write(&path, bytes).expect("writable");
    let read = || FrameFile::open(&path)?.read(0);
    match open_source(&path) {
        Ok(None) => 0,
        Ok(Some(source)) => {
            same(&*source, &read().expect("as it streams"));
            converted(&*source, &settings(*choice), dir.path())
        }
        Err(streamed) => {
            check_message(&streamed.to_string());
            let read = read().expect_err("as it does not stream");
            assert_eq!(streamed.to_string(), read.to_string());
            0
        }
    }
}

fn settings(choice: u8) -> ConvertSettings {
    let is_set = |bit: u8| choice & bit != 0;
    ConvertSettings {
        encoding: match (is_set(0x08), is_set(0x10)) {
            (false, false) => Some(Encoding::F32),
            (true, false) => Some(Encoding::Q16),
            (false, true) => Some(Encoding::Q10),
            (true, true) => None,
        },
        bound: if is_set(0x20) { Bound::Length(1e-3) } else { Bound::None },
        radius: if is_set(0x40) {
            RadiusRule::All(0.5)
        } else {
            RadiusRule::Source { otherwise: Some(0.25) }
        },
        other_attributes: if is_set(0x80) {
            AttributeChoice::Ranged
        } else {
            AttributeChoice::AsIs
        },
        keep_ids: is_set(0x80),
        memory: ConvertSettings::MIN_MEMORY,
        ..ConvertSettings::default()
    }
}

/// Compares a source with what the reader found.
fn same(source: &dyn ParticleSource, raw: &RawParticles) {
    let count = raw.positions.len();
    assert_eq!(source.count(), count as u64);
    assert_eq!(
        (source.time().map(f64::to_bits), source.step()),
        (raw.time.map(f64::to_bits), raw.step)
    );
    let mut positions = vec![DVec3::NAN; count];
    source.read_positions(0, &mut positions).expect("as they were counted");
    let bits = |p: DVec3| p.to_array().map(f64::to_bits);
    for (place, position) in positions.iter().enumerate() {
        assert_eq!(bits(*position), bits(raw.positions.get(place)), "{place}");
    }
    assert_eq!(source.attributes().len(), raw.attributes.len());
    for (number, (streamed, read)) in source.attributes().iter().zip(&raw.attributes).enumerate() {
        assert_eq!((&streamed.name, streamed.components), (&read.name, read.components));
        assert_eq!(streamed.scalar, read.data.scalar_type());
        let mut values = vec![0; streamed.width() * count];
        source.read_values(number, 0, &mut values).expect("as they were counted");
    }
    let beyond = source.read_positions(count as u64, &mut [DVec3::ZERO]);
    assert!(beyond.is_err(), "a particle after the last");
}

/// Returns how many particles there are in the frame.
fn converted(source: &dyn ParticleSource, settings: &ConvertSettings, dir: &Path) -> usize {
    let path = dir.join("frame.spf");
    let whole = convert_whole(source, &path, settings, &());
    let one = whole.and_then(|report| checked(report, &path));
    let in_parts = convert_in_parts(source, &path, settings);
    match (one, in_parts.and_then(|report| checked(report, &path))) {
        (Ok(one), Ok(parts)) => {
            assert_eq!(
                (one.index.count, one.index.dropped),
                (parts.index.count, parts.index.dropped)
            );
            usize::try_from(one.index.count).expect("as many are in the file")
        }
        (Err(one), Err(parts)) => {
            check_message(&one.to_string());
            assert_eq!(one.to_string(), parts.to_string());
            0
        }
        (one, parts) => panic!("whole {one:?}, in parts {parts:?}"),
    }
}

/// The frame at `path` is sound.
fn checked(report: ConvertReport, path: &Path) -> Result<ConvertReport, ConvertError> {
    let file = NativeFile::open(path, Access::Read)?;
    assert_eq!(*file.index(), report.index);
    let verify = || -> Result<(), FrameError> {
        let frame = file.frame()?;
        frame.verify_all().map_err(|e| e.in_file(path))?;
        frame.to_raw().map_err(|e| e.in_file(path)).map(|_| ())
    };
    verify().expect("as it was written");
    Ok(report)
}
