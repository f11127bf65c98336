//! Time in pictures: from one frame to the next, and while the shutter is open.

use crate::surface::slices::slice_times;

/// From one frame to the next, for motion on the film.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameStep {
    /// Time, in the unit of the velocities.
    pub time: f32,
    /// Difference of the frame numbers.
    pub numbers: i64,
}

impl FrameStep {
    /// The step of the same length to the previous frame.
    pub(super) const fn back(self) -> Self {
        Self { time: -self.time, numbers: self.numbers.saturating_neg() }
    }
}

/// Motion blur: when the shutter is open, and how the particles move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shutter {
    /// When it opens, relative to the time of the frame, as a fraction of the step.
    pub open: f64,
    /// When it closes.
    pub close: f64,
    /// From one frame to the next.
    pub step: FrameStep,
    /// Whether the velocities are those in the files. Otherwise, particles move to their places in the next frame.
    pub has_velocities: bool,
    /// Number of slices of the exposure in which surfaces other than spheres do not change.
    pub slices: u32,
}

impl Shutter {
    /// The time from that of the frame to the middle of the exposure, and the length of the exposure, both in the unit of
    /// time of the velocities.
    pub(super) fn middle_and_length(&self) -> [f64; 2] {
        let time = f64::from(self.step.time);
        [0.5 * (self.open + self.close) * time, (self.close - self.open) * time]
    }

    /// The middles of the slices, as fractions of the step from the time of the frame.
    pub(super) fn slice_times(&self) -> impl Iterator<Item = f64> + use<> {
        let (middle, length) = (0.5 * (self.open + self.close), self.close - self.open);
        slice_times(self.slices).map(move |time| middle + length * f64::from(time))
    }
}
