//! Short texts of the command line: frame ranges, names of images.

use std::collections::HashSet;

use spherule::manifest::OutputPattern;
use spherule_jobs::FrameRange;

/// Frames that are counted of a range: it may have more than can be.
const MAX: usize = 100;

/// Bytes of the longest text whose frames are counted: that takes time by the square of the number of commas.
const LONGEST: usize = 4096;

/// A range of frames.
pub fn range(bytes: &[u8]) -> usize {
    let text = String::from_utf8_lossy(bytes);
    let range: FrameRange = match text.parse() {
        Ok(range) => range,
        Err(error) => {
            let error: spherule_jobs::RangeError = error;
            assert!(error.at <= text.chars().count() + 1 && !error.what.is_empty());
            return 0;
        }
    };
    let again: FrameRange = range.to_string().parse().expect("as it was written");
    assert_eq!(again, range);
    let has_several = range.has_several();
    if text.len() > LONGEST {
        return 1;
    }
    let frames: Vec<i64> = range.iter().take(MAX).collect();
    let each: HashSet<i64> = frames.iter().copied().collect();
    assert!(each.len() == frames.len() && frames.iter().all(|f| range.contains(*f)));
    assert_eq!(has_several, frames.len() > 1);
    if frames.len() < MAX {
        let mut available = frames.clone();
        available.sort_unstable();
        assert_eq!(range.select(&available), frames);
    }
    if let Some(same) = FrameRange::from_frames(frames.iter().copied()) {
        assert!(frames.iter().all(|f| same.contains(*f)));
        assert_eq!(same.iter().count(), frames.len());
    }
    frames.len()
}

/// The name of images.
pub fn output(bytes: &[u8]) -> usize {
    let text = String::from_utf8_lossy(bytes);
    let pattern = match OutputPattern::parse(&text) {
        Ok(pattern) => pattern,
        Err(what) => {
            assert!(!what.is_empty());
            return 0;
        }
    };
    assert_eq!(pattern.as_str(), text);
    assert!(pattern.as_str().ends_with(pattern.file_name()));
    let frames = [i64::MIN, -7, 0, 7, 99_999, i64::MAX];
    let images: HashSet<_> = frames.iter().map(|f| pattern.path_for(*f)).collect();
    let previews: HashSet<_> = frames.iter().map(|f| pattern.preview_path_for(*f)).collect();
    let count = if pattern.has_number() { frames.len() } else { 1 };
    assert_eq!((images.len(), previews.len()), (count, count));
    assert!(images.iter().all(|path| path.parent() == Some(pattern.dir())));
    1
}
