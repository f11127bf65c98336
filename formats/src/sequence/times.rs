//! Finds the frame of a simulation time.

use super::Sequence;
use crate::FrameError;
use crate::convert::open_source;
use crate::native::{Access, NativeFile};

impl Sequence {
    /// The simulation time of frame `index`: that of a list of files, or that in its file. None if neither states one,
    /// or if it is not finite.
    ///
    /// # Errors
    /// [`FrameError`] of the first file that cannot be read.
    ///
    /// # Panics
    /// If there is no frame `index`.
    pub fn time(&self, index: usize) -> Result<Option<f64>, FrameError> {
        let time = match self.listed_time(index) {
            Some(time) => Some(time),
            None => self.time_in_files(index)?,
        };
        Ok(time.filter(|time| time.is_finite()))
    }

    fn time_in_files(&self, index: usize) -> Result<Option<f64>, FrameError> {
        if let Some(path) = self.native_file(index) {
            return Ok(NativeFile::open(path, Access::Map)?.index().time);
        }
        // Formats that state the time before the particles need not be read as a whole
        let source = self.lone_file(index).map(open_source).transpose()?.flatten();
        match source.and_then(|source| source.time()) {
            Some(time) => Ok(Some(time)),
            None => Ok(self.load_raw(index)?.time),
        }
    }

    /// Index and time of the frame that is nearest to `time`; of two at the same distance, the earlier one. Reads only
    /// a few frames, because times rise from frame to frame. None if a frame on the way has no time.
    ///
    /// # Errors
    /// Same as [`Self::time`].
    pub fn frame_at(&self, time: f64) -> Result<Option<(usize, f64)>, FrameError> {
        let (mut before, mut after) = (None, None);
        // Find the first frame that is not earlier, between the last one known before and the first one known after it
        let (mut low, mut high) = (0, self.frames().len());
        while low < high {
            let middle = low + (high - low) / 2;
            let Some(found) = self.time(middle)? else {
                return Ok(None);
            };
            if found < time {
                before = Some((middle, found));
                low = middle + 1;
            } else {
                after = Some((middle, found));
                high = middle;
            }
        }
        let distance = |frame: &(usize, f64)| (frame.1 - time).abs();
        let both = before.into_iter().chain(after);
        Ok(both.min_by(|a, b| distance(a).total_cmp(&distance(b))))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;
    use crate::SequenceInput;

    /// Frames in extended XYZ with these times.
    fn frames(directory: &Path, times: &[Option<f64>]) -> Sequence {
        for (number, time) in times.iter().enumerate() {
            let time = time.map_or_else(String::new, |time| format!("Time={time} "));
            let text = format!("1\n{time}Properties=species:S:1:pos:R:3\nHe 0 0 0\n");
            fs::write(directory.join(format!("f_{number}.xyz")), text).expect("a file");
        }
        Sequence::open(&SequenceInput::from_path(directory)).expect("frames")
    }

    #[test]
    fn nearest_frame_in_time_is_found() {
        let directory = tempfile::tempdir().expect("a directory");
        let times = [0.0, 0.25, 0.5, 1.5, 2.0, 7.0];
        let sequence = frames(directory.path(), &times.map(Some));
        for wanted in [-3.0, 0.0, 0.1, 0.125, 0.2, 0.5, 0.9, 1.0, 1.1, 4.4, 4.6, 7.0, 1e9] {
            let distance = |index: &usize| (times[*index] - wanted).abs();
            let expected = (0..times.len())
                .reduce(|a, b| if distance(&b) < distance(&a) { b } else { a })
                .expect("frames");
            let found = sequence.frame_at(wanted).expect("readable");
            assert_eq!(found, Some((expected, times[expected])), "{wanted}");
        }
    }

    #[test]
    fn frames_without_times_are_not_found() {
        let directory = tempfile::tempdir().expect("a directory");
        let sequence = frames(directory.path(), &[None, None]);
        assert_eq!(sequence.time(0).expect("readable"), None);
        assert_eq!(sequence.frame_at(0.5).expect("readable"), None);
    }
}
